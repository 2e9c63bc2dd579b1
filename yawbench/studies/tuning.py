"""Tuning of control laws by one objective, one search and one budget, so that they can be compared.

An experiment file with the key `tuning` gives the ranges of every law's parameters. Trials are runs of that
experiment like any other: planned before they start, executed in separate processes, added to the journal.
A search that was interrupted resumes with the missing runs.

The search is scipy's differential evolution, strategy best/1/bin: R. Storn, K. Price, Differential Evolution
- a simple and efficient heuristic for global optimization over continuous spaces, J. Global Optimization
11 (1997) 341-359. It gets a first generation (the middle of all ranges, and a Latin hypercube), the
number of generations, and a seed; nothing ends it early.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from yawbench.foundation.errors import ScenarioError
from yawbench.metrics.expressions import MetricValue
from yawbench.orchestrator.signal_names import Target

from .axes import DesignAxisSpec, OverrideSpec, VariantSpec, level_at
from .derived import MetricTable, derive
from .experiment import LoadedExperiment
from .experiment_result import ExperimentResult
from .tables import Table, column

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from .schema import LawSpec, TuningSpec

DIGITS = 3
"""Significant digits of tried values, so that files can state them; chosen: gains matter to a per cent."""
TRIAL = "trial"
"""Name of the axis of trials."""
JudgeExperiment = Callable[[LoadedExperiment], ExperimentResult]
"""Executes the missing runs of an experiment and returns its result."""


@dataclass(frozen=True)
class Trial:
    """Tried parameter values and their objective; None if a run failed or yields no number."""

    generation: int  # from 1
    values: dict[Target, float]  # in the units of the ranges
    objective: float | None

    @property
    def cost(self) -> float:
        """The objective; infinite if it is None."""
        return math.inf if self.objective is None else self.objective


@dataclass(frozen=True)
class TunedLaw:
    """A law with all its trials, in order; the first is the middle of all ranges."""

    law: str
    trials: list[Trial]

    @property
    def best(self) -> Trial:
        """The first trial with the smallest objective."""
        return min(self.trials, key=lambda trial: trial.cost)


def tuning_of(experiment: LoadedExperiment) -> TuningSpec:
    """Return the `tuning` of an experiment.

    Raises:
        ScenarioError: the experiment has none.
    """
    if experiment.spec.tuning is None:
        raise ScenarioError(
            f"{experiment.path}: has no 'tuning'; use `yawbench study` or `sweep`",
            code="file-wrong-kind",
        )
    return experiment.spec.tuning


def with_seed(experiment: LoadedExperiment, seed: int) -> LoadedExperiment:
    """Return the experiment with another seed of its search."""
    tuning = tuning_of(experiment).model_copy(update={"seed": seed})
    return replace(experiment, spec=experiment.spec.model_copy(update={"tuning": tuning}))


def search(experiment: LoadedExperiment, judged: JudgeExperiment) -> list[TunedLaw]:
    """Search the parameters of every law and return all trials.

    Args:
        experiment: with `tuning`.
        judged: executes runs and judges them.

    Raises:
        ScenarioError: a run cannot start.
    """
    import numpy as np
    from scipy.optimize import differential_evolution
    from scipy.stats import qmc

    tuning = tuning_of(experiment)
    fixed = _fixed(experiment, judged)
    tuned_laws = []
    for name, law in tuning.laws.items():
        axes, trials = law.axes.values(), list[Trial]()

        def costs(positions: Any, name: str = name, law: LawSpec = law, trials: list[Trial] = trials) -> Any:
            values = [_values(law, column) for column in np.asarray(positions).T]
            tried = [changes_of(law, point) for point in values]
            findings = judged(
                trials_of(experiment, {f"{name}, {k + 1}": changes for k, changes in enumerate(tried)})
            ).of_models()
            objectives = [_objective(experiment, {**fixed, **at}) for at in findings.at.values()]
            number = len(trials) // tuning.population + 1
            trials += [Trial(number, *pair) for pair in zip(values, objectives, strict=True)]
            return np.array([trial.cost for trial in trials[-len(values) :]])

        chance = np.random.default_rng(tuning.seed)
        first = qmc.LatinHypercube(len(axes), rng=chance).random(tuning.population)
        first[0] = 0.5
        differential_evolution(
            costs, [(0.0, 1.0)] * len(axes), init=first, maxiter=tuning.generations - 1, rng=chance,
            tol=0.0, atol=0.0, polish=False, vectorized=True, updating="deferred",
        )  # fmt: skip
        tuned_laws.append(TunedLaw(name, trials))
    return tuned_laws


def best_of(experiment: LoadedExperiment, tuned_laws: Sequence[TunedLaw]) -> LoadedExperiment:
    """Return the experiment with the best trial of every law."""
    laws = tuning_of(experiment).laws
    return trials_of(
        experiment, {tuned.law: changes_of(laws[tuned.law], tuned.best.values) for tuned in tuned_laws}
    )


def _fixed(experiment: LoadedExperiment, judged: JudgeExperiment) -> MetricTable:
    """Return the metrics of the runs without a tuned law."""
    left = trials_of(experiment, {"untuned": VariantSpec.model_validate({})}, driven=False)
    return judged(left).of_models().values if left.runs else {}


def trials_of(
    experiment: LoadedExperiment, tried: dict[str, VariantSpec], *, driven: bool = True
) -> LoadedExperiment:
    """Return an experiment of the runs with laws, or of the others, whose only axis are the trials."""
    drives = experiment.matching(tuning_of(experiment).runs)
    runs = {name: run for name, run in experiment.runs.items() if (run in drives) == driven}
    axes = {TRIAL: DesignAxisSpec.model_validate({"variants": tried})}
    changed: dict[str, Any] = {"axes": axes, "tuning": None, "tables": [], "figures": []}
    return replace(experiment, spec=experiment.spec.model_copy(update=changed), runs=runs)


def _values(law: LawSpec, positions: Sequence[float]) -> dict[Target, float]:
    """Return target -> value at a point of the unit cube."""
    values: dict[Target, float] = {}
    for axis, position in zip(law.axes.values(), positions, strict=True):
        number = float(f"{level_at(axis, float(position)).value:.{DIGITS}g}")
        values.update(dict.fromkeys(axis.vary, number))
    return values


def changes_of(law: LawSpec, values: dict[Target, float]) -> VariantSpec:
    """Return a law's overrides together with tried values."""
    units = {target: axis.unit for axis in law.axes.values() for target in axis.vary}
    tried = {target: f"{x!r} {unit}" if (unit := units[target]) else x for target, x in values.items()}
    own = {name: getattr(law, name) for name in OverrideSpec.model_fields}
    return VariantSpec.model_construct(**{**own, "set": {**law.set, **tried}})


def middle_of(law: LawSpec) -> VariantSpec:
    """Return a law's overrides with the values in the middle of its ranges."""
    return changes_of(law, _values(law, [0.5] * len(law.axes)))


def _objective(experiment: LoadedExperiment, values: MetricTable) -> float | None:
    value = derive(experiment.spec, values).get(tuning_of(experiment).objective)
    return None if value is None or not math.isfinite(value.number) else value.number


def tuning_table(experiment: LoadedExperiment, tuned_laws: Sequence[TunedLaw]) -> Table:
    """Return the table of laws: objective in the middle of the ranges, smallest objective, its values."""
    tuning = tuning_of(experiment)
    spec = experiment.spec.derived[tuning.objective]
    budget = f"{tuning.population} x {tuning.generations} trials each, seed {tuning.seed}"
    table = Table(f"{spec.says}: {budget}", ["law", "middle of the ranges", "found", "with"])
    for tuned in tuned_laws:
        first, best = (
            "failed" if trial.objective is None else MetricValue(trial.objective, spec.unit)
            for trial in (tuned.trials[0], tuned.best)
        )
        units = {target: axis.unit for axis in tuning.laws[tuned.law].axes.values() for target in axis.vary}
        settings = [
            f"{target}: {number:g} {units[target] or ''}".rstrip()
            for target, number in tuned.best.values.items()
        ]
        table.rows.append([tuned.law, first, best, "\n".join(settings)])
    return table


def columns_of(tuned_laws: Sequence[TunedLaw]) -> Table:
    """Return all trials as columns: law, generation, objective, and every varied target."""
    rows = [(tuned.law, trial) for tuned in tuned_laws for trial in tuned.trials]
    targets = dict.fromkeys(target for _, trial in rows for target in trial.values)
    return Table.of_columns(
        [
            column("law", "string", [law for law, _ in rows]),
            column("generation", "int64", [trial.generation for _, trial in rows]),
            column("objective", "float64", [trial.objective for _, trial in rows]),
            *(
                column(str(target), "float64", [trial.values.get(target) for _, trial in rows])
                for target in targets
            ),
        ]
    )


def history_figure(experiment: LoadedExperiment, tuned_laws: Sequence[TunedLaw], note: str) -> Figure:
    """Draw the smallest objective so far over the number of trials, a line per law."""
    from matplotlib.lines import Line2D

    from yawbench.figures.display import shown_unit
    from yawbench.figures.style import frame, line_style, new_figure

    with new_figure() as figure:
        axes = figure.subplots()
        spec = experiment.spec.derived[tuning_of(experiment).objective]
        unit, factor = shown_unit(spec.unit)
        handles = []
        for k, tuned in enumerate(tuned_laws):
            least = [factor * cost for cost in itertools.accumulate((t.cost for t in tuned.trials), min)]
            axes.step(range(1, len(least) + 1), least, where="post", **line_style(k))
            handles.append(Line2D([], [], label=tuned.law, **line_style(k)))
        axes.set(xlabel="trials", ylabel=f"least so far{f' [{unit}]' if unit else ''}")
        axes.set_title(spec.says)
        frame(figure, 3.4, handles, experiment.spec.title, note)
    return figure
