"""Rate of a sampled value: difference quotient over a step, smoothed by a first-order lag.

    tau dq/dt = slope - q        solved exactly over a step; tau = 0: the backward difference

Over very short steps the quotient is meaningless: a host's last step may be as short as a rounding error.
Steps shorter than `SHORTEST` are added to the next step; until then the rate is constant.
"""

from math import exp

SHORTEST = 1e-6
"""Shortest step [s] over which a difference is taken; chosen: a thousandth of a communication step."""


class Slope:
    """Smoothed rate of a sampled value.

    Args:
        value: initial value; the rate starts at zero.
        tau: time constant of the lag [s].
    """

    def __init__(self, value: float, tau: float) -> None:
        self.tau = tau
        self.value = value
        self.elapsed = 0.0  # since the last value [s]
        self.rate = 0.0
        self.h = self.kept = 0.0  # length [s] of the last step, and decay of the rate over it

    def see(self, value: float, h: float) -> None:
        """Update the rate with the value at the end of a step of `h` [s]."""
        if self.elapsed:
            h += self.elapsed
        if h < SHORTEST:
            self.elapsed = h
            return
        if h != self.h:
            self.h, self.kept = h, exp(-h / self.tau) if self.tau > 0.0 else 0.0
        slope = (value - self.value) / h
        self.rate = slope + (self.rate - slope) * self.kept
        self.value = value
        self.elapsed = 0.0
