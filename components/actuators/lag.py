"""Motor and friction brake of each wheel, with dead time, first-order lag and limits.

    motor request     T_m* = T* limited to +-motor_torque_limit
    brake request     T_f* = T* - T_m* limited to -friction_brake_torque_limit .. 0
    both              tau dT/dt = T*(t - delay) - T,    |dT/dt| <= rate limit              (14), (15)
    wheel torque      T_m + T_f

Braking is regenerative up to the motor's limit; the friction brake supplies the rest. Delay and lag are
solved exactly for any step size (`mathematics.first_order_lag`).

Source: paper B, equations (14), (15). Erratum: printed with exp(+k s), which would be an advance. The paper
gives no values.
"""

from dataclasses import dataclass

from ..fmi.component import Component
from ..fmi.variables import output, parameter
from ..mathematics.first_order_lag import Stage


@dataclass(frozen=True)
class LagParameters:
    """Parameters of motor and brake, equal for all four wheels."""

    motor_time_constant: float = parameter(0.015, "s", "Lag of the motor", "chosen", minimum=0.0)
    motor_delay: float = parameter(0.003, "s", "Pure delay of the motor", "chosen", minimum=0.0)
    motor_torque_limit: float = parameter(
        800.0, "N.m", "Largest motor torque at the wheel, driving or braking", "chosen", minimum=0.0
    )
    motor_rate_limit: float = parameter(
        1e6, "N.m/s", "Fastest change of the motor torque", "chosen: no limit in the paper", minimum=1.0
    )
    brake_time_constant: float = parameter(0.08, "s", "Lag of the friction brake", "chosen", minimum=0.0)
    brake_delay: float = parameter(0.015, "s", "Pure delay of the friction brake", "chosen", minimum=0.0)
    friction_brake_torque_limit: float = parameter(
        2500.0, "N.m", "Largest friction brake torque at the wheel", "chosen", minimum=0.0
    )
    brake_rate_limit: float = parameter(
        1e6, "N.m/s", "Fastest change of the brake torque", "chosen: no limit in the paper", minimum=1.0
    )


def blend(request: float, motor_limit: float, brake_limit: float) -> tuple[float, float]:
    """Split a torque request [N.m] between motor and friction brake; the brake's is never positive."""
    motor = min(max(request, -motor_limit), motor_limit)
    return motor, max(min(request - motor, 0.0), -brake_limit)


class Lag(Component):
    """Motor and friction brake at each wheel: delay, first-order lag, limits, blending."""

    Parameters = LagParameters
    inputs = ("torque_request_*",)
    outputs = (
        "wheel_torque_*",
        output("motor_torque_*", unit="N.m", text="Torque of the wheel's motor"),
        output("brake_torque_*", unit="N.m", text="Torque of the wheel's friction brake, never positive"),
    )

    def start(self, t: float, u: list[float]) -> None:
        p = self.p
        self.motors = [
            Stage(tau=p.motor_time_constant, delay=p.motor_delay, rate=p.motor_rate_limit) for _ in range(4)
        ]
        self.brakes = [
            Stage(tau=p.brake_time_constant, delay=p.brake_delay, rate=p.brake_rate_limit) for _ in range(4)
        ]

    def advance(self, t: float, h: float, u: list[float]) -> None:
        p = self.p
        for request, motor, brake in zip(u, self.motors, self.brakes, strict=True):
            asked_motor, asked_brake = blend(request, p.motor_torque_limit, p.friction_brake_torque_limit)
            motor.advance(t, h, asked_motor)
            brake.advance(t, h, asked_brake)

    def output(self, t: float, u: list[float]) -> tuple[float, ...] | list[float]:
        motors = [stage.value for stage in self.motors]
        brakes = [stage.value for stage in self.brakes]
        return [m + b for m, b in zip(motors, brakes, strict=True)] + motors + brakes
