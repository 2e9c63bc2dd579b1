"""The rate of a value that is known in samples: its slope over a step, smoothed by a first-order lag.

    tau dq/dt = slope - q        solved exactly over a step; tau = 0: the backward difference

A change that takes no time to speak of has no slope: a host's last step may be as short as a rounding
error. Steps shorter than `SHORTEST` are added to the next; until then the rate stays as it is.
"""

from math import exp

SHORTEST = 1e-6
"""Shortest step [s] over which a difference is taken; chosen: a thousandth of a communication step."""


class Slope:
    """The rate of one value.

    Args:
        value: at the start; the rate begins at zero.
        tau: time constant of the lag [s].
    """

    def __init__(self, value: float, tau: float) -> None:
        self.tau = tau
        self.value = value
        self.elapsed = 0.0  # since then [s]
        self.rate = 0.0
        self.h = self.kept = 0.0  # of the last step: its length [s], what is left of the rate after it

    def see(self, value: float, h: float) -> None:
        """Take in the value at the end of a step of `h` [s]."""
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
