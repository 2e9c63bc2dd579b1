"""Comparisons of a scenario's variants: a named run for every combination of the swapped FMUs."""

from __future__ import annotations

import itertools
import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from yawbench.fmus.fmu import is_path
from yawbench.foundation.errors import ScenarioError
from yawbench.foundation.messages import counted, listed
from yawbench.metrics.expressions import metric
from yawbench.metrics.verdict import Status, worded
from yawbench.orchestrator.plan import Override
from yawbench.orchestrator.scenario.overrides import swap_of
from yawbench.orchestrator.scenario.schema_validation import made
from yawbench.planner import Planner

from .claim_schema import MetricSpec, text_of
from .experiment import LoadedExperiment, NamedRun, experiment_of
from .experiment_result import ExperimentResult
from .run_remarks import marked, remarks
from .schema import FigureSpec
from .tables import Cell, Table

FIGURES = {
    "overview":
        ("steer_angle", "sideslip", "sideslip_error", "yaw_rate", "acceleration_y", "yaw_moment", "path"),
    "wheel_torques": ("wheel_torque_*",),
}  # fmt: skip
"""Figure name -> panels."""
FIGURE_SPECS = [
    made(FigureSpec, name=name, title=name.replace("_", " ").capitalize(), runs=["*"], panels=[*panels])
    for name, panels in FIGURES.items()
]


def comparison(
    scenario: Path,
    swaps: Sequence[str],
    changes: Sequence[Override],
    *,
    labels: Sequence[str] = (),
    metrics: Sequence[str] = (),
) -> LoadedExperiment:
    """Return the experiment that compares a scenario's variants (see `variants`).

    Args:
        scenario, swaps, changes: see `variants`.
        labels: of the variants, in their order; default: their own.
        metrics: names of metrics; default: the standard ones.

    Raises:
        ScenarioError: see `variants`; or the labels do not fit.
    """
    runs = variants(scenario, swaps, changes)
    if labels and (len(labels) != len(runs) or len({*labels}) < len(labels)):
        given = listed([run.label for run in runs], last="and")
        raise ScenarioError(
            f"--label: give one label per run, all different: {counted(len(labels), 'label')} for {given}",
            code="option-invalid",
        )
    if labels:
        runs = [replace(run, label=label, row=label) for run, label in zip(runs, labels, strict=True)]
    title = Planner().load(scenario, changes).title or scenario.stem
    exchanged = " and ".join(dict.fromkeys(text.partition("=")[0].strip() for text in swaps))
    title = f"{title} ({exchanged} exchanged)"
    specs = {name: made(MetricSpec, f"metrics.{name}", metric=name) for name in metrics}
    return experiment_of(scenario, runs, changes=changes, title=title, figures=FIGURE_SPECS, metrics=specs)


def variants(scenario: Path, swaps: Sequence[str], changes: Sequence[Override]) -> list[NamedRun]:
    """Return one run for every combination of the FMUs in `swaps`.

    Args:
        scenario: the scenario file.
        swaps: `instance=fmu,fmu,...`; an instance may be named more than once. An FMU may bring
            parameters, `fmu:parameter=value:parameter=value`, so that it can be compared with itself.
            If every instance has a single FMU, the unchanged scenario is the other variant.
        changes: overrides of all runs.

    Raises:
        ScenarioError: the scenario or an option is wrong, or there is nothing to compare.
    """
    choices = _choices(swaps)
    if all(len(names) == 1 for names in choices.values()):
        swapped = [swap_of(instance, names[0], "--swap")[0] for instance, names in choices.items()]
        own = Planner().load(scenario, [*swapped, *changes]).replaced
        for instance, names in choices.items():
            fmu = str(scenario.absolute().parent / own[instance]) if is_path(own[instance]) else own[instance]
            names[:0] = [fmu] if fmu not in names else []
    named = [instance for instance, names in choices.items() if len(names) > 1]
    if not named:
        raise ScenarioError(
            "nothing to compare: name several FMUs, for example --swap controller=a,b", code="option-invalid"
        )
    runs: list[NamedRun] = []
    for combination in itertools.product(*choices.values()):
        chosen = dict(zip(choices, combination, strict=True))
        label = " + ".join(_label(chosen[instance], choices[instance]) for instance in named)
        repeated = sum(run.label.partition(" (")[0] == label for run in runs)
        label += f" ({repeated + 1})" if repeated else ""
        name = re.sub(r"[^\w.+=-]+", "_", label.replace(" + ", "+")).strip("_")
        if any(run.name == name for run in runs):
            name = f"{name}_{len(runs) + 1}"
        swapped_in = [swap for instance, text in chosen.items() for swap in swap_of(instance, text, "--swap")]
        runs.append(NamedRun(name, label, label, scenario, tuple(swapped_in)))
    return runs


def _choices(swaps: Sequence[str]) -> dict[str, list[str]]:
    """Return instance -> its FMUs, without repetition, in the order of the options."""
    choices: dict[str, list[str]] = {}
    for text in swaps:
        instance, equals, fmus = text.partition("=")
        names = [fmus] if Path(fmus).is_file() else [name.strip() for name in fmus.split(",")]
        if not (instance.strip() and equals and all(names)):
            raise ScenarioError(
                f"--swap {text}: write --swap INSTANCE=FMU or --swap INSTANCE=FMU,FMU,...",
                code="option-invalid",
            )
        known = choices.get(instance.strip(), [])
        choices[instance.strip()] = list(dict.fromkeys([*known, *names]))
    return choices


def _label(text: str, choices: Sequence[str]) -> str:
    """Return the label of a choice: its FMU, unless all share it, and the parameters that differ."""
    fmu, *brought = swap_of("", text, "--swap")
    others = [swap_of("", other, "--swap") for other in choices]
    name = str(fmu.value)
    shared = [change for change in brought if all(change in other for other in others)]
    values = [
        f"{change.target.variable}={text_of(change.value)}" for change in brought if change not in shared
    ]
    one_fmu = all(other[0] == fmu for other in others)
    return " ".join([*([] if one_fmu and values else [Path(name).stem if is_path(name) else name]), *values])


def comparison_table(findings: ExperimentResult) -> Table:
    """Return a table with one row per metric and one column per run."""
    results, runs = findings.results, findings.experiment.runs.values()
    failed = [run.label for run in runs if run.name not in results]
    shown = [run for run in runs if run.name in results]
    notes = [*remarks((run.label, results[run.name]) for run in shown)]
    labels = [*(marked(run.label, results[run.name]) for run in shown), *failed]
    table = Table(findings.experiment.title, ["metric", "", *labels], notes=notes)
    for key, spec in findings.spec.metrics.items():
        cells: list[Cell] = [findings.values.get((run.name, key)) for run in shown]
        chosen = metric(spec.metric)
        table.rows.append([chosen.title, chosen.formula, *cells, *(worded(Status.FAILED) for _ in failed)])
    table.notes += [f"{r.label}: {results[r.name].ended}" for r in shown if results[r.name].ended]
    return table
