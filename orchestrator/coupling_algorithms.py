"""Coupling algorithms: how the value of a wire is estimated within a step.

Every input is a weighted sum of at most two samples of its source, and the weights are known before the run.
With time counted in communication steps, an instance of period M stepping from k - M to k sees a source of
period N whose last known sample is at k0 and whose previous one is at k0 - N:

    jacobi         y(k - M)                                     all instances at once, nothing is newer
    gauss_seidel   y(k0)
    extrapolated   y(k0) + (tau - k0) / N (y(k0) - y(k0 - N))   linear through two samples

`extrapolated` takes tau = k - M/2, the middle of the step, for an input that enters an integration (no output
depends on it directly), which makes the integral second-order accurate: for M = N = 1 these are
(y_n + y_n+1) / 2 if the source has already been stepped, 1.5 y_n - 0.5 y_n-1 if not. An input with direct
feedthrough, and every input of a sampled instance, is taken at the end of the step, tau = k: y_n+1 or
2 y_n - y_n-1. A discrete source holds its value from one sample to the next, so of its last two samples the
one in force at tau is taken: a plant integrates with the moment that the controller gave at the beginning of
the step.

A slow instance (M > N) integrates over many samples of its source; it takes the straight line through the
newest sample and the one that was newest at its own last step, so that neither weight exceeds one. Before
there are two samples, both are the initial value: held, for one step.

A wire with a declared delay of one communication step brings y(k - 1), under every algorithm: the newest
sample that is at least one communication step old at the end of the target's step.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple


class WireTiming(NamedTuple):
    """The properties of a wire that its weights depend on; periods in communication steps."""

    source_period: int
    target_period: int
    earlier: bool  # the source comes before the target in the evaluation order
    direct: bool  # the value is needed at the end of the step, not in its middle
    discrete: bool  # the source holds its value between its steps


class CouplingWeights(NamedTuple):
    """Weights of the source's last sample, of the one before, and of the one at the target's last step."""

    now: float = 1.0
    before: float = 0.0
    kept: float = 0.0


def _held(timing: WireTiming, k: int) -> CouplingWeights:
    return CouplingWeights()


def delayed(timing: WireTiming, k: int) -> CouplingWeights:
    """Return the weights of a wire with a declared delay."""
    return CouplingWeights(0.0, 1.0) if _last_sample(timing, k) == k else CouplingWeights()


def _extrapolated(timing: WireTiming, k: int) -> CouplingWeights:
    n, m = timing.source_period, timing.target_period
    last = _last_sample(timing, k)
    ahead = (k if timing.direct else k - m / 2) - last
    if timing.discrete:
        return CouplingWeights() if ahead >= 0 else CouplingWeights(0.0, 1.0)
    if ahead == 0:
        return CouplingWeights()
    if m > n and not timing.direct:
        apart = last - _last_sample(timing, k - m)
        return CouplingWeights(1.0 + ahead / apart, 0.0, -ahead / apart)
    return CouplingWeights(1.0 + ahead / n, -ahead / n)


def _last_sample(timing: WireTiming, k: int) -> int:
    """Return the communication point of the source's last sample when the target steps to `k`."""
    n = timing.source_period
    return k - k % n if timing.earlier else k - 1 - (k - 1) % n


@dataclass(frozen=True)
class CouplingAlgorithm:
    """A coupling algorithm: the weights of samples, and the time that an input is taken for."""

    weights: Callable[[WireTiming, int], CouplingWeights]
    """Called with the properties of a wire and a communication point `k` at which the target ends a step.
    The weights must repeat after the least common multiple of both periods."""
    halves_ahead: Callable[[int, bool], int]
    """Called with the period of an instance and whether an input has direct feedthrough; returns the time
    that the input is taken for, in half communication steps from the beginning of the instance's step."""
    at_once: bool = False  # all instances take their inputs before any of them steps
    needs_before: bool = False  # weights of the sample before the last may differ from 0


ALGORITHMS = {
    "jacobi": CouplingAlgorithm(_held, lambda period, direct: 0, at_once=True),
    "gauss_seidel": CouplingAlgorithm(_held, lambda period, direct: 2 * period),
    "extrapolated": CouplingAlgorithm(
        _extrapolated, lambda period, direct: 2 * period if direct else period, needs_before=True
    ),
}
"""Name -> algorithm. To add an algorithm, add it here."""
