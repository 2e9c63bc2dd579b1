"""Speed control of drivers: PI control of the drive force, with the lag of pedal and engine.

    F* = K e + (K / T_i) integral(e),   e = v_target - v_x,     0 <= F* <= F_max    with anti-windup
    tau dF/dt = F* - F                  drive force = constant part + F

After the accelerator is released, F* = 0 and the constant part is 0.

The force depends on the speed through the lag alone, so that they form no algebraic loop. The driver
accelerates or releases the accelerator, but does not brake.

Paper C's runs are "at a constant 90 km/h"; the paper does not say how.
"""

from dataclasses import dataclass
from math import inf

from ..fmi.variables import parameter
from ..mathematics.first_order_lag import Stage
from ..mathematics.pid_loop import Gains, Pid


@dataclass(frozen=True)
class SpeedHoldingParameters:
    """Parameters of speed control and engine. By default the speed is not held."""

    constant_drive_force: float = parameter(
        0.0, "N", "Constant part of the requested sum of longitudinal tyre forces", "paper A: no driving"
    )
    speed_gain: float = parameter(
        0.0, "N.s/m", "Gain K of speed control, 0 for none", "chosen: none in papers A, B, D", minimum=0.0
    )
    speed_integral_time: float = parameter(
        2.0, "s", "Integral time T_i of speed control", "chosen: slower than the car follows", minimum=0.01
    )
    target_speed: float = parameter(25.0, "m/s", "Speed held, if any", "paper C: 90 km/h", minimum=0.0)
    drive_force_limit: float = parameter(
        3000.0, "N", "Largest force F_max for holding the speed", "chosen: 75 kW at 25 m/s", minimum=0.0
    )
    drive_time_constant: float = parameter(
        0.2, "s", "Lag tau of pedal and engine", "chosen: naturally aspirated engine", minimum=0.0
    )


@dataclass(frozen=True)
class HeldSpeedParameters(SpeedHoldingParameters):
    """Parameters of a driver who holds the speed by default."""

    speed_gain: float = parameter(
        4000.0, "N.s/m", "Gain K of speed control, 0 for none", "chosen: 1000 N at 0.25 m/s", minimum=0.0
    )


class SpeedHold:
    """Speed controller of a driver.

    Args:
        p: parameters of the driver, read again at every step.
        v_x: speed at the start [m/s].
        let_go: time at which the accelerator is released for good [s]; default: never.
    """

    def __init__(self, p: SpeedHoldingParameters, v_x: float, let_go: float = inf) -> None:
        self.p = p
        self.let_go = let_go
        self.gains = Gains(p.speed_gain, p.speed_gain / p.speed_integral_time, 0.0)
        self.constant = p.constant_drive_force
        self.foot = Pid(error=p.target_speed - v_x)
        self.engine = Stage(tau=p.drive_time_constant)

    @property
    def force(self) -> float:
        """Drive force [N]."""
        return self.constant + self.engine.value

    def advance(self, t: float, h: float, v_x: float) -> None:
        """Advance the force from `t` to `t + h` [s] at the speed `v_x` [m/s]."""
        held = min(max(self.let_go - t, 0.0), h)
        if held > 0.0:
            self._hold(t, held, v_x)
        if held < h:
            self.engine.value += self.constant
            self.constant = 0.0
            self.engine.advance(t + held, h - held, 0.0)

    def _hold(self, t: float, h: float, v_x: float) -> None:
        p = self.p
        if p.speed_gain == 0.0:
            return
        self.foot.see(p.target_speed - v_x, h)
        wanted = self.foot.value(self.gains)
        wanted += self.foot.integrate(self.gains, wanted, 0.0, p.drive_force_limit)
        self.engine.advance(t, h, min(max(wanted, 0.0), p.drive_force_limit))
