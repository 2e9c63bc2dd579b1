"""Driver that follows a recording: hand-wheel angle open loop, speed closed loop.

    delta = delta_h / steering_ratio
    F     = mass a_x + K (v - v_x)          between -F_brake and F_drive, held over a step

v, a_x and delta_h are those of the recording. The recorded acceleration includes all resistances, so the gain
only corrects the remaining error; without it (input at 0) the speed lags by mass a_x / K. Negative forces
brake. The force lags the speed by a step, so that they form no algebraic loop.
"""

from dataclasses import dataclass

from ..cars.published_cars import PaperC
from ..driving.hand_wheel import SteeringParameters
from ..fmi.component import Component
from ..fmi.variables import like, output, parameter, signal


@dataclass(frozen=True)
class MeasuredParameters:
    """Parameters of steering and speed control."""

    steering_ratio: float = like(SteeringParameters, "steering_ratio")
    mass: float = like(PaperC, "mass")
    speed_gain: float = parameter(
        16000.0,
        "N.s/m",
        "Gain K of speed holding",
        "chosen: speed follows within 0.1 s, slower than the wheels",
        minimum=0.0,
    )
    drive_force_limit: float = parameter(
        20000.0, "N", "Largest driving force", "chosen: above the grip of a car's tyres", minimum=0.0
    )
    brake_force_limit: float = parameter(
        30000.0, "N", "Largest braking force", "chosen: above the grip of a car's tyres", minimum=0.0
    )


class Measured(Component):
    """Driver that follows a recording: hand-wheel angle open loop, speed closed loop."""

    Parameters = MeasuredParameters
    inputs = (
        signal("steering_wheel_angle_measured", "rad", "Hand-wheel angle of a recording"),
        signal("velocity_x_measured", "m/s", "Speed of a recording along x, at the centre of mass"),
        signal(
            "acceleration_x_measured",
            "m/s2",
            "Longitudinal acceleration of a recording; 0: feedback only",
            optional=True,
        ),
        "velocity_x",
    )
    outputs = (
        output("steer_angle", "steering_wheel_angle_measured"),
        output("drive_force", "velocity_x_measured", "acceleration_x_measured", "velocity_x"),
        output("steering_wheel_angle", "steering_wheel_angle_measured"),
    )

    def start(self, t: float, u: list[float]) -> None:
        self.force = self._wanted(u)

    def advance(self, t: float, h: float, u: list[float]) -> None:
        self.force = self._wanted(u)

    def output(self, t: float, u: list[float]) -> tuple[float, float, float]:
        hand = u[0]
        return hand / self.p.steering_ratio, self.force, hand

    def _wanted(self, u: list[float]) -> float:
        p = self.p
        wanted: float = p.mass * u[2] + p.speed_gain * (u[1] - u[3])
        low: float = -p.brake_force_limit
        high: float = p.drive_force_limit
        return min(max(wanted, low), high)
