"""Tuning of parameters from Python, including those of plain Python controllers."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from yawbench.fmus.fmu import Value
from yawbench.foundation.errors import Diagnostic, ResultsError, ScenarioError
from yawbench.foundation.messages import counted, listed
from yawbench.foundation.progress import bar
from yawbench.orchestrator.scenario.schema_validation import made
from yawbench.studies.axes import AxisSpec
from yawbench.studies.claim_schema import DerivedSpec, MetricSource, MetricSpec
from yawbench.studies.experiment import LoadedExperiment as Design
from yawbench.studies.experiment import NamedRun, experiment_of
from yawbench.studies.experiment_result import ExperimentResult
from yawbench.studies.expression import Expression
from yawbench.studies.schema import LawSpec, TuningSpec
from yawbench.studies.tables import to_pandas
from yawbench.studies.tuning import TunedLaw, columns_of, history_figure, search

from . import arguments
from ._controller import PythonComponent
from ._experiment import executed, numbers_of
from ._run import shown_in_notebooks
from ._scenario import Scenario, warn

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

OBJECTIVE = "objective"
"""Name of the minimized number in the generated experiment."""


def tune(
    base: Scenario | Iterable[Scenario],
    ranges: Mapping[str, Sequence[float | str]],
    objective: str | Mapping[str, float],
    *,
    population: int = 8,
    generations: int = 8,
    seed: int = 1,
    workers: int | None = None,
    progress: bool | None = None,
) -> Tuning:
    """Find the parameters of a scenario that minimize an objective, by differential evolution.

    The search is that of `yawbench tune`; nothing is written. Parameters of plain Python are tuned like those
    of FMUs.

        >>> def follow(yaw_rate_ref, yaw_rate, gain=2e4):
        ...     return gain * (yaw_rate_ref - yaw_rate)
        >>> law = base.swap(controller=follow)
        >>> ranges = {"controller.gain": (1e3, 1e5, "log")}
        >>> tuned = yb.tune(law, ranges, "rms_error(yaw_rate)", population=5, generations=2)
        >>> tuned.objective < law.run().metric("rms_error(yaw_rate)")
        True

    Args:
        base: the scenario, or several, over which the objective is averaged.
        ranges: target of `Scenario.set` -> lowest and highest value, in SI or both with the same unit, and
            "log" if trials are spread by equal factors.
        objective: a metric, or a mapping of metrics to weights, whose weighted sum is minimized.
        population: trials of a generation; default as in the proving ground's tuning.
        generations: number of generations, including the first; default: chosen, equal to `population`.
        seed: of the random numbers.
        workers: number of processes; default: the number of cores. Plain Python that is not native runs here.
        progress: show a bar; default: in a terminal or a notebook, after two seconds.

    Raises:
        ScenarioError: a range or the objective is invalid.
        YawbenchError: a run cannot start.
        ResultsError: no trial has a value of the objective.
    """
    bases = _bases(base)
    weights = _weights(objective)
    tuning = made(
        TuningSpec,
        population=arguments.count(population, "population", least=5),
        generations=arguments.count(generations, "generations"),
        seed=arguments.count(seed, "seed", least=0, most=2**32 - 1),
        objective=OBJECTIVE,
        laws={OBJECTIVE: made(LawSpec, axes=_axes(ranges))},
    )
    workers = None if workers is None else arguments.count(workers, "workers")
    progress = None if progress is None else arguments.flag(progress, "progress")
    design = _design(bases, weights, tuning)
    programs = _programs(bases)
    generations_done: list[ExperimentResult] = []
    total = len(bases) * tuning.population * tuning.generations
    with bar(f"Tune {design.spec.title}", total, wanted=progress) as shown:

        def judged(trials: Design) -> ExperimentResult:
            findings, _ = executed(trials, programs, workers=workers, done=lambda outcome: shown.advance())
            generations_done.append(findings)
            return findings

        (tuned,) = search(design, judged)
    reasons = [reason for findings in generations_done for reason in findings.failed.values()]
    if tuned.best.objective is None:
        why = reasons[0] if reasons else f"no run yields {listed(weights)}"
        raise ResultsError(f"no trial has a value of the objective: {why}", code="results-missing")
    warn(design.spec.title, _diagnostics(generations_done, reasons))
    return Tuning(design, tuned)


def _bases(base: Any) -> list[Scenario]:
    if isinstance(base, Scenario):
        return [base]
    bases = arguments.items(base, "base", "what yawbench.load returns, or a list of these")
    if not bases:
        raise ValueError("base: must have at least one scenario")
    return [arguments.instance(each, f"base[{k}]", Scenario, "yawbench.load") for k, each in enumerate(bases)]


def _weights(objective: Any) -> dict[str, float]:
    """Return metric -> weight."""
    if not isinstance(objective, Mapping):
        return {arguments.text(objective, "objective"): 1.0}
    wanted = "a metric, or a mapping of metrics to weights, {'peak(sideslip)': 1.0}"
    weights = arguments.mapping(objective, "objective", wanted)
    if not weights:
        raise ValueError("objective: must have at least one metric")
    return {name: arguments.number(weight, f"objective[{name!r}]") for name, weight in weights.items()}


def _axes(ranges: Any) -> dict[str, AxisSpec]:
    """Return the ranges as axes of a tuning."""
    wanted = "a mapping of targets to ranges, {'controller.gain': (1e3, 1e5)}"
    axes = {}
    for name, ends in arguments.mapping(ranges, "ranges", wanted).items():
        place = f"ranges[{name!r}]"
        parts = arguments.items(ends, place, "lowest and highest value, (1e3, 1e5) or (1e3, 1e5, 'log')")
        if len(parts) not in (2, 3):
            arguments.refuse(place, "lowest and highest value, (1e3, 1e5) or (1e3, 1e5, 'log')", ends)
        spacing = arguments.text(parts[2], f"{place}[2]") if len(parts) == 3 else "linear"
        numbers = numbers_of(place, parts[:2])
        low, high = numbers.pop("values")
        between = {"from": low, "to": high, "spacing": spacing}
        axes[name] = made(AxisSpec, place, vary=name, **between, **numbers)
    if not axes:
        raise ValueError("ranges: must have at least one target")
    return axes


def _design(bases: list[Scenario], weights: Mapping[str, float], tuning: TuningSpec) -> Design:
    """Return the tuning as an experiment: a named run per scenario, their mean as the objective."""
    runs = [
        NamedRun(f"s{k}", each.title, each.title, each.path, each.changes) for k, each in enumerate(bases)
    ]
    terms = {
        f"{run.name}_m{i}": (made(MetricSource, run=run.name, metric=name), weight)
        for run in runs
        for i, (name, weight) in enumerate(weights.items())
    }
    first, *others = (weight * Expression.named(name) for name, (_, weight) in terms.items())
    words = " + ".join(name if weight == 1.0 else f"{weight:g} {name}" for name, weight in weights.items())
    objective = made(
        DerivedSpec,
        says=words + (f", mean of {len(runs)} scenarios" if len(runs) > 1 else ""),
        expression=sum(others, first) / len(runs),
        of={name: source for name, (source, _) in terms.items()},
    )
    return experiment_of(
        bases[0].path,
        runs,
        title=bases[0].title or bases[0].path.stem,
        metrics={name: made(MetricSpec, "objective", metric=name) for name in weights},
        derived={OBJECTIVE: objective},
        tuning=tuning,
    )


def _programs(bases: list[Scenario]) -> dict[Path, PythonComponent]:
    """Return the plain Python of all scenarios; refuses different programs of one name."""
    programs: dict[Path, PythonComponent] = {}
    for k, each in enumerate(bases):
        for path, program in each._programs.items():
            known = programs.setdefault(path, program)
            if known.fmu.sha256 != program.fmu.sha256:
                raise ScenarioError(
                    f"base[{k}]: has another {path.parent.name} {path.stem!r} than the scenarios before it: "
                    "swap the same object into all",
                    code="argument-invalid",
                )
    return programs


def _diagnostics(done: list[ExperimentResult], reasons: list[str]) -> list[Diagnostic]:
    """Return the diagnostics of the plans of the first trials, and a warning if runs failed."""
    first = done[0].planned
    plans = [job.plan for job in first.jobs if job.plan] if first else []
    diagnostics = list(dict.fromkeys(entry for plan in plans for entry in plan.diagnostics))
    if reasons:
        total = sum(len(findings.records) for findings in done)
        text = f"{len(reasons)} of {counted(total, 'run')} failed: {reasons[0]}"
        diagnostics.append(Diagnostic("runs-with-warnings", text, "warning"))
    return diagnostics


@dataclass(frozen=True)
class Tuning:
    """Result of a tuning; created by `tune`.

    >>> ranges = {"driver.amplitude": (0.02, 0.03)}
    >>> tuned = yb.tune(base, ranges, "peak(sideslip)", population=5, generations=1)
    >>> base.set(tuned.values).run().metric("peak(sideslip)") == tuned.objective
    True
    """

    _design: Design
    _tuned: TunedLaw

    @property
    def objective(self) -> float:
        """Smallest objective, in SI."""
        return self._tuned.best.cost

    @property
    def values(self) -> dict[str, Value]:
        """Values with the smallest objective, as target -> value for `Scenario.set`."""
        assert self._design.spec.tuning is not None
        axes = self._design.spec.tuning.laws[OBJECTIVE].axes
        units = {target: axis.unit for axis in axes.values() for target in axis.vary}
        return {
            str(target): f"{number!r} {units[target]}" if units[target] else number
            for target, number in self._tuned.best.values.items()
        }

    @cached_property
    def table(self) -> pd.DataFrame:
        """Table with a row per trial: generation, objective, values in the units of the ranges."""
        return to_pandas(columns_of([self._tuned])).drop(columns="law")

    def plot(self) -> Figure:
        """Return a figure of the smallest objective over the number of trials."""
        return shown_in_notebooks(history_figure(self._design, [self._tuned], "yawbench.tune"))

    def __repr__(self) -> str:
        settings = ", ".join(f"{target} {value}" for target, value in self.values.items())
        return (
            f"<Tuning: {self.objective:.4g} with {settings}, of {counted(len(self._tuned.trials), 'trial')}>"
        )
