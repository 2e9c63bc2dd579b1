"""Pure delay and first-order lag with limited rate, solved exactly for piecewise constant input.

    tau dx/dt = u(t - delay) - x,        -falling rate <= dx/dt <= rate

A request u is held over its step. Between two changes of the delayed request the lag has a closed form, also
while its rate is limited (a straight line until the exponential is slower). Without numerical integration the
delay need not be a multiple of the step, and two half steps give the same result as a full step.
"""

from collections.abc import Sequence
from itertools import pairwise
from math import exp, inf

History = list[tuple[float, float]]
"""Requests as (start time [s], value), oldest first."""


def relax(x: float, target: float, h: float, *, tau: float, rate: float) -> float:
    """Return x after `h` [s] with a constant target: lag `tau` [s], `rate` limit [1/s of x] both ways."""
    gap = target - x
    excess = abs(gap) - rate * tau  # the gap that is closed at the rate limit
    if excess > 0.0:
        line = excess / rate
        if h <= line:
            return x + (rate * h if gap > 0.0 else -rate * h)
        h -= line
        gap = rate * tau if gap > 0.0 else -rate * tau
    if tau <= 0.0:
        return target
    return target - gap * exp(-h / tau)


class Stage:
    """Pure delay and lag of a scalar.

    Args:
        tau, delay: time constant and pure delay [s].
        rate: rate limit [1/s of the value].
        falling_rate: rate limit of a falling value; default: `rate`.
        value: initial value, settled.
    """

    def __init__(
        self,
        *,
        tau: float,
        delay: float = 0.0,
        rate: float = inf,
        falling_rate: float | None = None,
        value: float = 0.0,
    ) -> None:
        self.tau, self.delay, self.rate = tau, delay, rate
        self.falling_rate = rate if falling_rate is None else falling_rate
        self.value = value
        self.history: History = [(-inf, value)]

    def advance(self, t: float, h: float, request: float) -> None:
        """Advance the value from `t` to `t + h` [s] with a constant request."""
        history = self.history
        if history[-1][1] != request:
            history.append((t, request))
        begin, end = t - self.delay, t + h - self.delay
        if len(history) > 1:
            while len(history) > 1 and history[1][0] <= begin:
                del history[0]
            for (_, target), (change, _) in pairwise(history):
                if change >= end:
                    break
                self._relax(target, change - begin)
                begin = change
        target = current(history, begin)
        if self.value != target and end > begin:
            self._relax(target, end - begin)

    def _relax(self, target: float, h: float) -> None:
        rate = self.rate if target > self.value else self.falling_rate
        self.value = relax(self.value, target, h, tau=self.tau, rate=rate)


def current(history: Sequence[tuple[float, float]], t: float) -> float:
    """Return the request in force at `t` [s]."""
    value = history[0][1]
    for time, later in history:
        if time > t:
            break
        value = later
    return value
