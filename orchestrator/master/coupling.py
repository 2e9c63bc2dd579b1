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
"""

from __future__ import annotations

from dataclasses import dataclass

from ..plan import Algorithm


@dataclass(frozen=True)
class WireTiming:
    """The properties of a wire that its weights depend on; periods in communication steps."""

    source_period: int
    target_period: int
    earlier: bool  # the source comes before the target in the evaluation order
    direct: bool  # the value is needed at the end of the step, not in its middle
    discrete: bool  # the source holds its value between its steps


@dataclass(frozen=True)
class CouplingWeights:
    """Weights of the source's last sample, of the one before, and of the one at the target's last step."""

    now: float = 1.0
    before: float = 0.0
    kept: float = 0.0


def weights(algorithm: Algorithm, relation: WireTiming, k: int) -> CouplingWeights:
    """Return the weights of a wire for the step of its target that ends at `k`.

    `k` is a communication point at which the target ends a step. The weights repeat after the least
    common multiple of both periods.
    """
    if algorithm != "extrapolated":
        return CouplingWeights()
    n, m = relation.source_period, relation.target_period
    last = _last_sample(relation, k)
    ahead = (k if relation.direct else k - m / 2) - last
    if relation.discrete:
        return CouplingWeights() if ahead >= 0 else CouplingWeights(0.0, 1.0)
    if ahead == 0:
        return CouplingWeights()
    if m > n and not relation.direct:
        apart = last - _last_sample(relation, k - m)
        return CouplingWeights(1.0 + ahead / apart, 0.0, -ahead / apart)
    return CouplingWeights(1.0 + ahead / n, -ahead / n)


def halves_ahead(algorithm: Algorithm, period: int, *, direct: bool) -> int:
    """Return the time that an input is taken for, in half communication steps from the step's beginning."""
    held = {"jacobi": 0, "gauss_seidel": 2 * period}
    return held.get(algorithm, 2 * period if direct else period)


def _last_sample(relation: WireTiming, k: int) -> int:
    """Return the communication point of the source's last sample when the target steps to `k`."""
    n = relation.source_period
    return k - k % n if relation.earlier else k - 1 - (k - 1) % n
