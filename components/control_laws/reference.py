"""Base class of references: desired yaw rate and sideslip, and their rates.

The rates are difference quotients of the outputs over the instance's own step, smoothed by a first-order lag
(`mathematics.slope`), since a steering angle often comes in steps of a sensor. They are thus the rates of the
limited references, corners included, and the integral of the pulse at a jump is the jump. They are zero at
the start.
"""

from dataclasses import dataclass
from typing import Any, ClassVar

from ..fmi.component import Component
from ..fmi.variables import output, parameter, signal
from ..mathematics.slope import Slope

SEEN = ("steer_angle", "velocity_x", "friction")
SHOWN = ("yaw_rate_ref", "sideslip_ref", "yaw_acceleration_ref", "sideslip_rate_ref")


@dataclass(frozen=True)
class RateParameters:
    """Parameters of the rates."""

    rate_time_constant: float = parameter(
        0.005, "s", "Lag tau of the rates", "chosen: the controllers' sample time", minimum=0.0
    )


class Reference(Component):
    """Base class of references, which derive the desired motion from the steer angle."""

    inputs: ClassVar[Any] = ("steer_angle", "velocity_x", signal("friction", start=1.0))
    outputs = tuple(output(name, *SEEN) for name in SHOWN)

    def begin(self, u: list[float]) -> tuple[float, float]:
        """Set the state at start time; return r_ref [rad/s] and beta_ref [rad]."""
        raise NotImplementedError

    def follow(self, h: float, u: list[float]) -> tuple[float, float]:
        """Advance the state by `h` [s]; return r_ref [rad/s] and beta_ref [rad]."""
        raise NotImplementedError

    def start(self, t: float, u: list[float]) -> None:
        self.now = self.begin(u)
        self.rates = [Slope(value, self.p.rate_time_constant) for value in self.now]

    def advance(self, t: float, h: float, u: list[float]) -> None:
        r, beta = self.now = self.follow(h, u)
        self.rates[0].see(r, h)
        self.rates[1].see(beta, h)

    def output(self, t: float, u: list[float]) -> tuple[float, ...]:
        r_rate, beta_rate = self.rates
        return *self.now, r_rate.rate, beta_rate.rate
