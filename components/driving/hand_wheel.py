"""Base class of open-loop drivers: hand-wheel angle as a function of time, with optional speed control.

    delta(t) = delta_h(t) / steering_ratio

A manoeuvre is a function of time. Stimuli come from a component, not from the master, so that they are exact
at every instant and not quantised to communication steps. Speed: `driving.speed_holding`.
"""

from dataclasses import dataclass
from math import inf

from ..fmi.component import Component
from ..fmi.variables import of_car, parameter, signal
from .speed_holding import SpeedHold


@dataclass(frozen=True)
class SteeringParameters:
    """Parameters of the steering."""

    steering_ratio: float = of_car(17.0, "chosen: large saloon")
    start_time: float = parameter(1.0, "s", "Time at which steering begins", "chosen: 1 s straight ahead")


def ramp(late: float, duration: float, final: float) -> float:
    """Return a ramp from 0 to `final` over `duration` [s], `late` [s] after its start; 0 s gives a step."""
    if late <= 0.0:
        return 0.0
    return final if late >= duration else final * late / duration


class HandWheelDriver(Component):
    """Base class of open-loop drivers, which steer by `hand_wheel_angle`."""

    inputs = (signal("velocity_x", optional=True),)
    outputs = ("steer_angle", "drive_force", "steering_wheel_angle")

    def hand_wheel_angle(self, t: float) -> float:
        """Return the hand-wheel angle [rad] at `t` [s]."""
        raise NotImplementedError

    def coasts_from(self) -> float:
        """Return the time at which the accelerator is released for good [s]; infinity for never."""
        return inf

    def start(self, t: float, u: list[float]) -> None:
        self.speed = SpeedHold(self.p, u[0], self.coasts_from())

    def advance(self, t: float, h: float, u: list[float]) -> None:
        self.speed.advance(t, h, u[0])

    def output(self, t: float, u: list[float]) -> tuple[float, float, float]:
        hand = self.hand_wheel_angle(t)
        return hand / self.p.steering_ratio, self.speed.force, hand
