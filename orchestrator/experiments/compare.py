"""One scenario with several FMUs for a unit, as an experiment of one named run per combination."""

from __future__ import annotations

import itertools
import re
from collections.abc import Sequence
from pathlib import Path

from ..errors import ScenarioError
from ..metrics.run_metrics import metric
from ..plan import Change
from ..scenario.load import load_scenario
from ..scenario.overrides import is_path, swap_of
from ..titles import changed
from .expansion import NamedRun
from .experiment import Experiment
from .findings import Findings
from .numbers import text_of
from .schema import ExperimentSpec
from .tables import Cell, Table, marked, remarks

PANELS = (
    "steer_angle",
    "sideslip",
    "sideslip_error",
    "yaw_rate",
    "acceleration_y",
    "yaw_moment",
    "path",
)
FIGURES = {"overview": PANELS, "wheel_torques": ("wheel_torque_*",)}
"""Name of the file -> panels."""


def comparison(scenario: Path, swaps: Sequence[str], changes: Sequence[Change]) -> Experiment:
    """Return the experiment that compares a scenario's variants (see `variants`)."""
    runs = variants(scenario, swaps, changes)
    title = load_scenario(scenario, changes=changes).title or scenario.stem
    exchanged = " and ".join(dict.fromkeys(text.partition("=")[0].strip() for text in swaps))
    return of_runs(runs, f"{title} ({exchanged} exchanged)", scenario, changes, FIGURES)


def of_runs(
    runs: Sequence[NamedRun],
    title: str,
    path: Path,
    changes: Sequence[Change],
    figures: dict[str, tuple[str, ...]],
) -> Experiment:
    """Return an experiment of runs that no file lists; `changes`: of all; `figures`: name -> panels."""
    given = {
        "title": title,
        "runs": [{"name": run.name, "scenario": run.scenario.name} for run in runs],
        "figures": [
            {"name": name, "title": name.replace("_", " ").capitalize(), "runs": ["*"], "panels": [*panels]}
            for name, panels in figures.items()
        ],
    }
    spec = ExperimentSpec.model_validate(given)
    return Experiment(path, spec, {run.name: run for run in runs}, (), tuple(changes))


def variants(scenario: Path, swaps: Sequence[str], changes: Sequence[Change]) -> list[NamedRun]:
    """Return one run for every combination of the FMUs that `swaps` names.

    Args:
        scenario: the scenario file.
        swaps: `unit=fmu,fmu,...`; a unit may be named more than once. An FMU may bring parameters,
            `fmu:parameter=value:parameter=value`, so that one FMU can be compared with itself. If only
            one FMU is named in all, the scenario as it stands is the other variant.
        changes: for all.

    Raises:
        ScenarioError: the scenario or an option is wrong, or there is nothing to compare.
    """
    choices = _choices(swaps)
    if all(len(names) == 1 for names in choices.values()):
        swapped = [swap_of(unit, names[0], "--swap")[0] for unit, names in choices.items()]
        own = load_scenario(scenario, changes=[*swapped, *changes]).replaced
        for unit, names in choices.items():
            fmu = str(scenario.absolute().parent / own[unit]) if is_path(own[unit]) else own[unit]
            names[:0] = [fmu] if fmu not in names else []
    named = [unit for unit, names in choices.items() if len(names) > 1]
    if not named:
        raise ScenarioError("nothing to compare: name several FMUs, for example --swap controller=a,b")
    runs: list[NamedRun] = []
    for combination in itertools.product(*choices.values()):
        chosen = dict(zip(choices, combination, strict=True))
        label = " + ".join(_label(chosen[unit], choices[unit]) for unit in named)
        repeated = sum(run.label.partition(" (")[0] == label for run in runs)
        label += f" ({repeated + 1})" if repeated else ""
        name = re.sub(r"[^\w.+=-]+", "_", label.replace(" + ", "+")).strip("_")
        if any(run.name == name for run in runs):
            name = f"{name}_{len(runs) + 1}"
        swapped_in = [one for unit, text in chosen.items() for one in swap_of(unit, text, "--swap")]
        runs.append(NamedRun(name, label, label, scenario, tuple(swapped_in)))
    return runs


def _choices(swaps: Sequence[str]) -> dict[str, list[str]]:
    """Return unit -> FMUs, each once, in the order of the options."""
    choices: dict[str, list[str]] = {}
    for text in swaps:
        unit, equals, fmus = text.partition("=")
        names = [fmus] if Path(fmus).is_file() else [name.strip() for name in fmus.split(",")]
        if not (unit.strip() and equals and all(names)):
            raise ScenarioError(f"--swap {text}: write --swap UNIT=FMU or --swap UNIT=FMU,FMU,...")
        known = choices.get(unit.strip(), [])
        choices[unit.strip()] = list(dict.fromkeys([*known, *names]))
    return choices


def _label(text: str, choices: Sequence[str]) -> str:
    """Return what tells a choice from the others: its FMU, unless all have it, and what they do not share."""
    fmu, *brought = swap_of("", text, "--swap")
    others = [swap_of("", other, "--swap") for other in choices]
    name = str(fmu.value)
    shared = [one for one in brought if all(one in other for other in others)]
    values = [f"{one.place[1:]}={text_of(one.value)}" for one in brought if one not in shared]
    one_fmu = all(other[0] == fmu for other in others)
    return " ".join([*([] if one_fmu and values else [Path(name).stem if is_path(name) else name]), *values])


def comparison_table(findings: Findings) -> Table:
    """Return a table with one row per metric and one column per run."""
    results, runs = findings.results, findings.experiment.runs.values()
    failed = [run.label for run in runs if run.name not in results]
    shown = [run for run in runs if run.name in results]
    words = changed(findings.experiment.by_options)
    notes = [f"changed: {words}"] if words else []
    notes += remarks((run.label, results[run.name]) for run in shown)
    labels = [*(marked(run.label, results[run.name]) for run in shown), *failed]
    table = Table(findings.spec.title, ["metric", "", *labels], notes=notes)
    for key, spec in findings.spec.metrics.items():
        cells: list[Cell] = [findings.values.get((run.name, key)) for run in shown]
        chosen = metric(spec.metric)
        table.rows.append([chosen.title, chosen.formula, *cells, *("failed" for _ in failed)])
    table.notes += [f"{r.label}: {results[r.name].ended}" for r in shown if results[r.name].ended]
    return table
