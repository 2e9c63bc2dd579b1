"""Pure delay and first-order lag with limited rate, solved exactly for an input that is held in steps.

    tau dx/dt = u(t - delay) - x,        -falling rate <= dx/dt <= rate

A request u is held over the step for which it is given. Between two changes of the delayed request the
lag has a closed form, also while its rate is limited (a straight line until the exponential is
slower), so nothing is integrated numerically: the delay may be any time, no multiple of the step,
and a request held over two half steps gives what it gives over one.
"""

from collections.abc import Sequence
from itertools import pairwise
from math import exp, inf

History = list[tuple[float, float]]
"""Requests as (time from which it holds [s], value), oldest first."""


def relax(x: float, target: float, h: float, *, tau: float, rate: float) -> float:
    """Return x after `h` [s] with a held target: lag `tau` [s], `rate` limit [1/s of x] both ways."""
    gap = target - x
    excess = abs(gap) - rate * tau  # what is left for the straight line
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
    """One delay and lag: its value and the requests that still count.

    Args:
        tau, delay: time constant and pure delay [s].
        rate: rate limit [1/s of the value].
        falling_rate: rate limit where the value falls; `rate` if left out.
        value: at the start, as after a request held for ever.
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
        """Take the value from `t` to `t + h` [s], the request holding over that step."""
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
    """Return the request that holds from `t` [s] on."""
    value = history[0][1]
    for time, later in history:
        if time > t:
            break
        value = later
    return value
