"""Sampled PID control: trapezoidal integral, filtered derivative, anti-windup at the output limit.

    u = K_p e + I + K_d q
    dI/dt = K_i e                       I never moves u beyond its limit, only back towards it
    q is the rate of e, smoothed by a lag of tau (`mathematics.slope`)

I is stored in units of the output, so gains may change online without a jump of the output.

Two loops for yaw stability have a common limit:

    M = PID(r_ref - r) + PID(beta - beta_ref)

A positive moment raises the yaw rate and lowers the sideslip, hence the order of the second difference.

Source: paper C, section 2.1, whose block diagram leaves that sign open and has neither filter nor limit.
"""

from math import inf
from typing import NamedTuple

from .slope import Slope


class Gains(NamedTuple):
    """PID gains K_p, K_i, K_d: output per error, per integral of the error, per error rate."""

    p: float
    i: float
    d: float


class Pid:
    """PID loop: last error, integral part and filtered derivative.

    Args:
        tau: time constant of the derivative filter [s].
        error: initial error; integral and derivative start at zero.
    """

    def __init__(self, tau: float = 0.0, error: float = 0.0) -> None:
        self.error = error
        self.rate = Slope(error, tau)
        self.area = 0.0  # integral of the error over the last sample
        self.integral = 0.0

    @property
    def slope(self) -> float:
        """Filtered derivative of the error."""
        return self.rate.rate

    def see(self, e: float, h: float) -> None:
        """Update the loop with the error `e` at the end of a sample of `h` [s]."""
        self.rate.see(e, h)
        self.area = 0.5 * h * (self.error + e)
        self.error = e

    def value(self, gains: Gains) -> float:
        """Return K_p e + I + K_d q with the current integral."""
        return gains.p * self.error + self.integral + gains.d * self.slope

    def integrate(self, gains: Gains, total: float, low: float, high: float) -> float:
        """Add the last sample to the integral and return the increase of the output.

        Args:
            total: current output, to which this loop may contribute only a part.
            low, high: limits of the output.
        """
        step = gains.i * self.area
        room = high - total if step > 0.0 else low - total
        if step * room <= 0.0:
            return 0.0  # already beyond the limit
        if abs(step) > abs(room):
            step = room
        self.integral += step
        return step


class YawLoops:
    """PID loops of yaw rate and sideslip, with a limit for their sum.

    Args:
        tau: time constant of both derivative filters [s].
        r_ref, r, beta_ref, beta: initial yaw rates [rad/s] and sideslip angles [rad].
    """

    def __init__(self, tau: float, r_ref: float, r: float, beta_ref: float, beta: float) -> None:
        self.yaw_rate = Pid(tau, r_ref - r)
        self.sideslip = Pid(tau, beta - beta_ref)

    def see(self, r_ref: float, r: float, beta_ref: float, beta: float, *, h: float) -> None:
        """Update the loops with yaw rates [rad/s] and sideslips [rad] at the end of a sample of `h` [s]."""
        self.yaw_rate.see(r_ref - r, h)
        self.sideslip.see(beta - beta_ref, h)

    def moment(self, yaw_rate: Gains, sideslip: Gains, limit: float = inf) -> float:
        """Integrate the last sample and return the yaw moment [N.m] within +-`limit`."""
        total = self.yaw_rate.value(yaw_rate) + self.sideslip.value(sideslip)
        total += self.yaw_rate.integrate(yaw_rate, total, -limit, limit)
        total += self.sideslip.integrate(sideslip, total, -limit, limit)
        return min(max(total, -limit), limit)

    def integral(self) -> float:
        """Return the integral part of the moment [N.m]."""
        return self.yaw_rate.integral + self.sideslip.integral
