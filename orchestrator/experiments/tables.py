"""Tables for people (`Table`) and for programs (`TableColumn`); listings of runs, files, FMUs and signals."""

from __future__ import annotations

import csv
import io
import math
import textwrap
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from vocabulary.wheels import WHEELS

from ..errors import Diagnostic, ModelDescriptionError, ScenarioError, text_of
from ..figures.style import shown
from ..fmu.archive import open_fmu
from ..fmu.binary import runs_as
from ..messages import changed, printable, star, with_changes
from ..metrics.measures import catalogue as measures
from ..metrics.measures import symbol
from ..metrics.run_metrics import STANDARD, MetricValue, columns_of, evaluate_all, metric
from ..plan import Fmu, Plan
from ..results.read_and_salvage import FoundRun, Results
from ..results.run_record import RunRecord
from ..scenario import find_and_load, yaml_lines

if TYPE_CHECKING:
    import pandas as pd
    import rich.console

    from ..results.read_and_salvage import Results


MARK = "†"
"""Mark after the name of a run with plausibility warnings."""
MIN_HEADING = 12
"""Characters after which a heading over numbers is wrapped."""

Cell = str | MetricValue | None
"""A table cell: text, a number with its unit, or None if empty."""


@dataclass
class Table:
    """A table: headings, rows of cells, and notes below."""

    title: str
    headings: list[str]
    rows: list[Sequence[Cell]] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    numbers: set[int] = field(default_factory=set)  # columns of numbers formatted as text

    def text(self) -> list[list[str]]:
        """Return the cells of all rows as text."""
        return [[_shown(cell) for cell in row] for row in self.rows]

    def is_number(self, column: int) -> bool:
        """Return whether a column has numbers, and so is aligned right."""
        return column in self.numbers or any(isinstance(row[column], MetricValue) for row in self.rows)


def _shown(cell: Cell) -> str:
    if cell is None:
        return "-"
    return shown(cell.number, cell.unit, half=cell.half) if isinstance(cell, MetricValue) else printable(cell)


def for_terminal(table: Table) -> rich.console.Group:
    """Return the table for a rich console; title and notes may be wider than the columns."""
    import rich.table
    from rich import box
    from rich.console import Group
    from rich.text import Text

    shape = rich.table.Table(box=box.SIMPLE_HEAD, pad_edge=False)
    rows = table.text()
    for i, heading in enumerate(table.headings):
        number = table.is_number(i)
        if number:  # keep long headings from widening the column
            widest = max(MIN_HEADING, *(len(row[i]) for row in rows))
            heading = "\n".join(textwrap.wrap(heading, widest, break_long_words=False)) or heading
        side: Literal["left", "right"] = "right" if number else "left"
        shape.add_column(Text(printable(heading)), justify=side, no_wrap=number, overflow="fold")
    for row in rows:
        shape.add_row(*(Text(cell) for cell in row))
    notes = [Text(printable(note)) for note in table.notes]
    return Group(*([Text(printable(table.title), "bold")] if table.title else []), shape, *notes)


@dataclass(frozen=True)
class TableColumn:
    """A column of a table for programs; numbers are in SI units, named in `about`."""

    name: str
    kind: Literal["int64", "float64", "string"]
    values: Sequence[Any]
    about: dict[str, str] = field(default_factory=dict)


def to_pandas(columns: Sequence[TableColumn]) -> pd.DataFrame:
    """Return columns as a data frame; `attrs["units"]` has the units of its numbers."""
    import pandas as pd

    frame = pd.DataFrame({one.name: pd.Series(one.values, dtype=_dtype(one)) for one in columns})
    frame.attrs["units"] = {one.name: one.about["unit"] for one in columns if "unit" in one.about}
    return frame


def _dtype(column: TableColumn) -> str:
    return "object" if column.kind == "string" else column.kind


def to_csv(columns: Sequence[TableColumn]) -> str:
    """Return columns as CSV, with units in the headings."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(f"{c.name} [{c.about['unit']}]" if "unit" in c.about else c.name for c in columns)
    writer.writerows(map(_plain, zip(*(c.values for c in columns), strict=True)))
    return text.getvalue()


def _plain(row: Sequence[Any]) -> list[str]:
    """Return a row as text: numbers with all digits, "" for None."""
    return [
        "" if x is None else repr(x) if isinstance(x, float) and math.isfinite(x) else str(x) for x in row
    ]


def marked(label: str, results: Results) -> str:
    """Return the label of a run, with a mark if it has plausibility warnings."""
    return f"{label} {MARK}" if _remarkable(results) else label


def remarks(runs: Iterable[tuple[str, Results]]) -> list[str]:
    """Return a note for each marked run of (label, results)."""
    return [f"{MARK} {label}: {says}" for label, results in runs if (says := _remarkable(results))]


def _remarkable(results: Results) -> str:
    return text_of(results.record.course_warnings)


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


PEAKS = ("sideslip", "yaw_rate", "acceleration_y")
"""Signals whose peaks summarise a run in a list."""


def runs_table(runs: Sequence[FoundRun]) -> Table:
    """Return a table of runs: start, scenario, overrides, status, a few peaks."""
    peaks = [metric(f"peak({signal})") for signal in PEAKS]
    headings = ["run", "begun", "scenario", "changed", "status", *(one.formula for one in peaks)]
    table = Table("", headings)
    for run in runs:
        file = Path(run.record.scenario_file)
        scenario = "/".join([*file.parts[-2:-1], file.stem])
        cells: list[Cell] = [
            str(run.folder), _local(run.record.started), scenario or None,
            changed(run.record.overrides) or None, run.status, *(_peak(run.record, s) for s in PEAKS),
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


def _peak(record: RunRecord, signal: str) -> MetricValue | None:
    """Return the peak of a signal from the run record, without reading the results."""
    units = {name: unit or "" for name, unit in record.units.items()}
    columns = {name: np.empty(0) for name in units if name != "time"}
    found = columns_of(Results(Path(), np.empty(0), columns, units, record), signal)
    ends = [of_column.get(name) for name in found for of_column in (record.smallest, record.largest)]
    numbers = [float(end) for end in ends if end is not None]
    if not numbers or any(map(math.isnan, numbers)):
        return None
    return MetricValue(max(map(abs, numbers)), units[found[0]] or "1")


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
    for base in find_and_load.folders() if folder is None else [folder]:
        for path, kind in find_and_load.files(base, kinds):
            archive = path.suffix == ".ssp"
            data = None if archive else yaml_lines.read(path, what="file").data
            title = str(data.get("title") or "") if isinstance(data, dict) else ""
            by_name = folder is None and kind in find_and_load.COMMANDS
            name = path.relative_to(base).with_suffix("").as_posix() if by_name else str(path)
            rows.setdefault(name, [name, "SSP archive" if archive else kind.partition(" ")[2], title or None])
    table.rows = [*rows.values()]
    if not table.rows:
        where = folder or " and ".join(map(str, find_and_load.folders()))
        raise ScenarioError(f"{where}: holds no file that is {' or '.join(kinds)}", code="file-wrong-kind")
    return table


def fmus_in(folder: Path) -> tuple[list[Fmu], list[Diagnostic]]:
    """Return the FMUs in a folder, and the errors of those that cannot be used."""
    found: list[Fmu] = []
    errors: list[Diagnostic] = []
    for path in sorted(folder.glob("*.fmu")):
        try:
            found.append(open_fmu(path))
        except ModelDescriptionError as error:  # noqa: PERF203 - the others are listed all the same
            errors += error.diagnostics
    return found, errors


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
    table.rows += [[fmu.name, runs_as(fmu.path)] for fmu in fmus]
    return table


def signals_table(fmus: Sequence[Fmu]) -> Table:
    """Return a table of the signals that FMUs exchange, with sources and users; wheels share a row."""
    given: dict[str, list[str]] = {}
    taken: dict[str, list[str]] = {}
    about: dict[str, tuple[str, str]] = {}
    for fmu in fmus:
        for users, causality in ((given, "output"), (taken, "input")):
            for variable in fmu.of(causality):
                name = star(variable.name) if variable.name.endswith(WHEELS) else variable.name
                about.setdefault(name, (variable.unit or "", star(_one_line(variable.description))))
                users.setdefault(name, []).append(fmu.name)
    table = Table("", ["signal", "", "unit", "given by", "taken by", "description"])
    for name in sorted(about):
        unit, text = about[name]
        users_of = [_some(dict.fromkeys(users.get(name, ()))) for users in (given, taken)]
        sign = symbol(name)
        table.rows.append([name, sign if sign != name else None, unit or None, *users_of, text or None])
    return table


def recorded_table(plan: Plan) -> Table:
    """Return a table of the signals that a run of a plan records."""
    table = Table(plan.title, ["signal", "", "unit", "description"])
    units = {unit.name: unit for unit in plan.instances}
    for unit, name in plan.record:
        variable, sign = units[unit].fmu.variables[name], symbol(name)
        text = _one_line(variable.description) or None
        table.rows.append([f"{unit}.{name}", sign if sign != name else None, variable.unit, text])
    return table


def metrics_table() -> Table:
    """Return a table of all measures of a signal x."""
    table = Table("", ["metric", "what it is", "", "unit", "needs"])
    for one in measures():
        table.rows.append([f"{one.name}(x)", one.definition, one.formula, one.unit, one.needs or None])
    table.notes = [f"'standard' stands for {', '.join(STANDARD)}."]
    return table


def _some(names: Sequence[str] | dict[str, None]) -> str | None:
    """Return names as a list in words, the first two of more than three."""
    listed = list(names)
    more = f" and {len(listed) - 2} more" if len(listed) > 3 else ""
    return ", ".join(listed[:2] if more else listed) + more or None


def _one_line(text: str) -> str:
    return " ".join(text.split())
