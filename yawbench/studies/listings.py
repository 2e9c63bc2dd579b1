"""Listings of what there is: a run's metrics, runs, files, FMUs, the signals they exchange, measures."""

from __future__ import annotations

import math
from collections.abc import Sequence
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np

from yawbench.events.kinds import events_in
from yawbench.fmus.archive import open_fmu, runs_as
from yawbench.fmus.fmu import Fmu
from yawbench.foundation.errors import Diagnostic, ModelDescriptionError, ResultsError, ScenarioError
from yawbench.foundation.messages import star
from yawbench.metrics.expressions import (
    STANDARD,
    MetricValue,
    angles_in,
    columns_for,
    columns_of,
    evaluate,
    evaluate_all,
    metric,
    motion_of,
)
from yawbench.metrics.measures import catalogue as measures
from yawbench.metrics.measures import si_of, symbol
from yawbench.orchestrator.plan import Plan
from yawbench.orchestrator.results.reader import FoundRun, Results, load_results
from yawbench.orchestrator.scenario import catalogue
from yawbench.orchestrator.scenario.overrides import changed, with_changes
from yawbench.vocabulary.motion import LEAST_SPEED
from yawbench.vocabulary.wheels import WHEELS

from .tables import Cell, Column, Table


def metrics_of_run(results: Results, names: Sequence[str]) -> Table:
    """Return a table of a run's metrics, one row each, without those whose signals it lacks."""
    values = evaluate_all(results, names)
    rows: list[Sequence[Cell]] = [
        [metric(name).title, metric(name).formula, value] for name, value in values.items()
    ]
    title = with_changes(results.record.title or str(results.folder), results.record.overrides)
    missing = [name for name in names if name not in values]
    notes = [f"No number for {', '.join(missing)}."] if missing else []
    return Table(title, ["metric", "", "value"], rows, notes)


def events_table(results: Results) -> Table:
    """Return a table of a run's events in the order of their begin, one row each."""
    columns = [Column(name, "float64", {"unit": "s"}) for name in ("time", "until")]
    columns += [Column(name, "string") for name in ("event", "where")]
    columns += [Column(name, "float64") for name in ("value", "limit")]
    columns += [Column(name, "string") for name in ("unit", "signal")]
    rows: list[Sequence[Cell]] = [
        [one.time, one.until, one.kind, one.where, one.value, one.limit, one.unit, one.signal]
        for one in events_in(results)
    ]
    return Table("Events", columns, rows)


PEAKS = ("sideslip", "yaw_rate", "acceleration_y")
"""Signals whose peaks summarise a run in a list."""


def runs_table(runs: Sequence[FoundRun]) -> Table:
    """Return a table of runs: start, scenario, overrides, status, a few peaks."""
    peaks = [metric(f"peak({signal})") for signal in PEAKS]
    headings = ["run", "begun", "scenario", "changed", "status", *(measure.formula for measure in peaks)]
    table = Table("", headings)
    for run in runs:
        file = Path(run.record.scenario_file)
        scenario = "/".join([*file.parts[-2:-1], file.stem])
        cells: list[Cell] = [
            str(run.folder), _local(run.record.started), scenario or None,
            changed(run.record.overrides) or None, run.status.value, *(_peak(run, s) for s in PEAKS),
        ]  # fmt: skip
        table.rows.append(cells)
    table.notes = [f"{run.folder}: {_one_line(run.problem)}" for run in runs if run.problem]
    return table


def _local(started: Any) -> str | None:
    """Return an ISO timestamp in local time; None if it is invalid."""
    try:
        return datetime.fromisoformat(str(started)).astimezone().strftime("%Y-%m-%d %H:%M")
    except ValueError:
        return None


def _peak(run: FoundRun, signal: str) -> MetricValue | None:
    """Return the peak of a signal from the run record; from the results if the car stood meanwhile."""
    record = run.record
    units = {name: unit or "" for name, unit in record.units.items()}
    columns = {name: np.empty(0) for name in units if name != "time"}
    known = Results(Path(), np.empty(0), columns, units, record)
    names = columns_of(known, signal)
    ends = [of_column.get(name) for name in names for of_column in (record.smallest, record.largest)]
    numbers = [float(end) for end in ends if end is not None]
    if not numbers or any(map(math.isnan, numbers)):
        return None
    if names[0] in angles_in(known) and _may_stand(known, names[0]):
        chosen = metric(f"peak({signal})")
        try:
            return evaluate(
                load_results(run.folder, only=lambda one: columns_for(one, [chosen.name])), chosen
            )
        except ResultsError:
            return None
    return MetricValue(max(map(abs, numbers)), units[names[0]] or "1")


def _may_stand(run: Results, column: str) -> bool:
    """Return whether the longitudinal velocity alone leaves open that the car stood, from the run record."""
    speed = motion_of(run, column).get("velocity_x")
    ends = [of_column.get(speed or "") for of_column in (run.record.smallest, run.record.largest)]
    low, high = (
        si_of(run.units[speed])[1] * float(end) if speed and end is not None else 0.0 for end in ends
    )
    return speed is not None and low < LEAST_SPEED and high > -LEAST_SPEED


def files_table(folder: Path | None, kinds: Sequence[str]) -> Table:
    """Return a table of YAML files of some kinds (`validation.KINDS`) and SSP archives.

    Files below a folder are listed by path; without a folder, the catalogue's by name.

    Raises:
        ScenarioError: the folder does not exist, or has no such files.
    """
    if folder is not None and not folder.is_dir():
        raise ScenarioError(f"{folder}: there is no such folder", code="file-missing")
    table = Table("", ["name" if folder is None else "file", "kind", "title"])
    rows: dict[str, Sequence[Cell]] = {}
    for base in catalogue.folders() if folder is None else [folder]:
        for path, kind in catalogue.files(base, kinds):
            archive = path.suffix == ".ssp"
            title = "" if archive else catalogue.title_of(path)
            by_name = folder is None and kind in catalogue.COMMANDS
            name = path.relative_to(base).with_suffix("").as_posix() if by_name else str(path)
            rows.setdefault(name, [name, "SSP archive" if archive else kind.partition(" ")[2], title or None])
    table.rows = [*rows.values()]
    if not table.rows:
        where = folder or " and ".join(map(str, catalogue.folders()))
        raise ScenarioError(f"{where}: holds no file that is {' or '.join(kinds)}", code="file-wrong-kind")
    return table


def fmus_in(*folders: Path) -> tuple[list[Fmu], list[Diagnostic]]:
    """Return the FMUs in folders, and the errors of those that cannot be used; of a name, the first."""
    opened: list[Fmu] = []
    errors: list[Diagnostic] = []
    archives = {path.name: path for folder in reversed(folders) for path in sorted(folder.glob("*.fmu"))}
    for _, path in sorted(archives.items()):
        try:
            opened.append(open_fmu(path))
        except ModelDescriptionError as error:  # noqa: PERF203 - the others are listed all the same
            errors += error.diagnostics
    return opened, errors


def fmus_table(fmus: Sequence[Fmu], errors: Sequence[Diagnostic]) -> Table:
    """Return a table of FMUs."""
    table = Table(
        "", ["FMU", "description", "parameters", "made by"], notes=list(map(str, errors)), numbers={2}
    )
    for fmu in fmus:
        count = str(len(fmu.of("parameter")))
        table.rows.append([fmu.name, _one_line(fmu.description) or None, count, fmu.generation_tool or None])
    return table


def units_table(fmus: Sequence[Fmu]) -> Table:
    """Return a table of how FMUs that were built here run: natively, or in Python and why."""
    table = Table("", ["FMU", "runs as"])
    for fmu in fmus:
        how = runs_as(fmu.path)
        table.rows.append([fmu.name, f"{how}; {how.note}" if how and how.note else str(how) if how else None])
    return table


def signals_table(fmus: Sequence[Fmu]) -> Table:
    """Return a table of the signals that FMUs exchange, with sources and users; wheels share a row."""
    producers: dict[str, list[str]] = {}
    consumers: dict[str, list[str]] = {}
    about: dict[str, tuple[str, str]] = {}
    for fmu in fmus:
        for users, causality in ((producers, "output"), (consumers, "input")):
            for variable in fmu.of(causality):
                name = star(variable.name) if variable.name.endswith(WHEELS) else variable.name
                about.setdefault(name, (variable.unit or "", star(_one_line(variable.description))))
                users.setdefault(name, []).append(fmu.name)
    table = Table("", ["signal", "", "unit", "given by", "taken by", "description"])
    for name in sorted(about):
        unit, text = about[name]
        users_of = [_some(dict.fromkeys(users.get(name, ()))) for users in (producers, consumers)]
        sign = symbol(name)
        table.rows.append([name, sign if sign != name else None, unit or None, *users_of, text or None])
    return table


def recorded_table(plan: Plan) -> Table:
    """Return a table of the signals that a run of a plan records."""
    table = Table(plan.title, ["signal", "", "unit", "description"])
    instances = {instance.name: instance for instance in plan.instances}
    for instance, name in plan.record:
        variable, sign = instances[instance].fmu.variables[name], symbol(name)
        text = _one_line(variable.description) or None
        table.rows.append([f"{instance}.{name}", sign if sign != name else None, variable.unit, text])
    return table


def metrics_table() -> Table:
    """Return a table of all measures of a signal x."""
    table = Table("", ["metric", "meaning", "", "unit", "needs"])
    for measure in measures():
        table.rows.append(
            [f"{measure.name}(x)", measure.definition, measure.formula, measure.unit, measure.needs or None]
        )
    table.notes = [f"'standard' stands for {', '.join(STANDARD)}."]
    return table


def _some(names: Sequence[str] | dict[str, None]) -> str | None:
    """Return names as a list in words, the first two of more than three."""
    listed = list(names)
    more = f" and {len(listed) - 2} more" if len(listed) > 3 else ""
    return ", ".join(listed[:2] if more else listed) + more or None


def _one_line(text: str) -> str:
    return " ".join(text.split())
