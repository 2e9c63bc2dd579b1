"""What a process does with a run of a sweep: simulate it, hand back its metrics."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

from ..metrics.plausibility import findings_in
from ..metrics.run_metrics import evaluate, metric
from ..plan import Plan
from ..studies.jobs import Job

Metrics = tuple[tuple[str, str, tuple[float, float] | None], ...]
"""(key, metric, window) of each metric."""

Measured = dict[str, tuple[float, str] | None]
"""Key of a metric -> its value and unit, None where the run gives none."""


class Measures(NamedTuple):
    """What a run hands back: its metrics, and the kinds of what was remarkable in it."""

    values: Measured
    findings: tuple[str, ...] = ()


@dataclass(frozen=True)
class Measurement(Job):
    """A job whose plan is made; it hands back metrics, and keeps its results only if told so."""

    key: str = ""
    plan: Plan | None = None
    metrics: Metrics = ()
    keep: bool = False


def measure(job: Any) -> Measures:
    """Make the run of a `Measurement` in this process; return its metrics.

    Raises:
        YawbenchError: the run failed.
    """
    from ..master.isolation import opener_of
    from ..master.simulate import simulate, simulate_in_memory
    from ..results.read import load_results

    with opener_of(job.plan, job.call_limit) as opener:
        if job.keep:
            simulate(job.plan, job.out, opener=opener, format=job.format, apart=True)
            results = load_results(job.out)
        else:
            results = simulate_in_memory(job.plan, opener=opener)
    measured: Measured = {}
    for key, name, window in job.metrics:
        value = evaluate(results, metric(name), window)
        short = results.ended and not window  # of a run that a unit has ended early it is another metric
        measured[key] = None if value is None or short else (value.number, value.unit)
    kinds = dict.fromkeys(one.kind for one in findings_in(results.run) if one.time is not None)
    return Measures(measured, tuple(kinds))
