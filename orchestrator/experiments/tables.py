"""Tables, shown on the terminal and on pages and written to files; listings of runs, files, FMUs, signals."""

from __future__ import annotations

import csv
import io
import math
import textwrap
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from vocabulary.wheels import WHEELS

from ..errors import Diagnostic, ModelDescriptionError, ScenarioError, text_of
from ..figures.style import shown
from ..fmu.archive import open_fmu, runs_as
from ..fmu.fmu import Fmu
from ..messages import printable, star
from ..metrics.expressions import STANDARD, MetricValue, columns_of, evaluate_all, metric
from ..metrics.measures import catalogue as measures
from ..metrics.measures import si, symbol
from ..plan import Plan
from ..results.reader import FoundRun, Results
from ..results.run_record import RunRecord
from ..scenario import loader
from ..scenario.overrides import changed, with_changes

if TYPE_CHECKING:
    import pandas as pd
    import rich.console

    from ..results.reader import Results


MARK = "†"
"""Mark after the name of a run with plausibility warnings."""
MIN_HEADING = 12
"""Characters after which a heading over numbers is wrapped."""

Cell = str | MetricValue | float | None
"""A table cell: text, a number with its unit or in that of its column, or None if empty."""
Kind = Literal["int64", "float64", "string"]


@dataclass(frozen=True)
class Column:
    """A column of a table, without its cells."""

    heading: str
    kind: Kind | None = None  # of all cells; None: as they are
    about: dict[str, str] = field(default_factory=dict)  # for programs; `unit`: SI unit of plain numbers
    number: bool = False  # numbers formatted as text, aligned right


class Table:
    """A table, shown on the terminal and on pages, and written as CSV, Parquet and data frames.

    Args:
        title: above it.
        columns: columns, or headings of columns of any cells.
        rows: a cell per column.
        notes: below it.
        numbers: indices of the headings over numbers that are formatted as text.
    """

    def __init__(
        self,
        title: str,
        columns: Iterable[str | Column],
        rows: Iterable[Sequence[Cell]] = (),
        notes: Iterable[str] = (),
        numbers: Collection[int] = (),
    ) -> None:
        self.title = title
        self.columns = [
            entry if isinstance(entry, Column) else Column(entry, number=k in numbers)
            for k, entry in enumerate(columns)
        ]
        self.rows = list(rows)
        self.notes = list(notes)

    @classmethod
    def of_columns(cls, columns: Iterable[tuple[Column, Sequence[Cell]]]) -> Table:
        """Return a table of columns with their cells."""
        listed = list(columns)
        return cls("", [about for about, _ in listed], zip(*(cells for _, cells in listed), strict=True))

    @property
    def headings(self) -> list[str]:
        """The headings of all columns."""
        return [column.heading for column in self.columns]

    def text(self) -> list[list[str]]:
        """Return the cells of all rows as text."""
        units = [column.about.get("unit", "") for column in self.columns]
        return [[_shown(cell, unit) for cell, unit in zip(row, units, strict=True)] for row in self.rows]

    def is_number(self, column: int) -> bool:
        """Return whether a column has numbers, and so is aligned right."""
        return self.columns[column].number or any(
            isinstance(row[column], (MetricValue, float, int)) for row in self.rows
        )

    def unit(self, column: int) -> str | None:
        """Return the SI unit of a column's numbers; None if it has none, or several."""
        if unit := self.columns[column].about.get("unit"):
            return unit
        cells = [row[column] for row in self.rows if row[column] is not None]
        units = {si(cell.unit) if isinstance(cell, MetricValue) else None for cell in cells}
        return units.pop() if len(units) == 1 else None

    def values(self, column: int) -> list[str | float | None]:
        """Return a column for programs: numbers in SI units if all have the same, else text."""
        cells = [row[column] for row in self.rows]
        if self.unit(column) is None:
            return [_shown(cell) if isinstance(cell, MetricValue) else cell for cell in cells]
        return [cell.number if isinstance(cell, MetricValue) else cell for cell in cells]

    def kind(self, column: int) -> Kind:
        """Return the kind of a column's values."""
        known = [value for value in self.values(column) if value is not None]
        numbers = bool(known) and not any(isinstance(value, str) for value in known)
        return self.columns[column].kind or ("float64" if numbers else "string")


def column(
    heading: str, kind: Kind, cells: Sequence[Cell], about: dict[str, str] | None = None
) -> tuple[Column, Sequence[Cell]]:
    """Return a column of one kind with its cells, for `Table.of_columns`."""
    return Column(heading, kind, about or {}), cells


def _shown(cell: Cell, unit: str = "") -> str:
    if cell is None:
        return "-"
    if isinstance(cell, str):
        return printable(cell)
    if isinstance(cell, int):
        return str(cell)
    value = cell if isinstance(cell, MetricValue) else MetricValue(cell, unit or "1")
    return shown(value.number, value.unit, half=value.half, between=value.between)


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


def to_pandas(table: Table) -> pd.DataFrame:
    """Return a table as a data frame; `attrs["units"]` has the units of its numbers."""
    import pandas as pd

    kinds = {"string": "object"}
    series = {
        heading: pd.Series(table.values(k), dtype=kinds.get(table.kind(k), table.kind(k)))
        for k, heading in enumerate(table.headings)
    }
    frame = pd.DataFrame(series)
    units = {heading: table.unit(k) for k, heading in enumerate(table.headings)}
    frame.attrs["units"] = {heading: unit for heading, unit in units.items() if unit}
    return frame


def records_in(table: Table) -> list[dict[str, str | float | None]]:
    """Return the rows of a table as heading -> value, numbers in SI units."""
    columns = [table.values(k) for k in range(len(table.columns))]
    return [dict(zip(table.headings, row, strict=True)) for row in zip(*columns, strict=True)]


def to_csv(table: Table) -> str:
    """Return a table as CSV, with units in the headings."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    units = [table.unit(k) for k in range(len(table.columns))]
    writer.writerow(
        f"{heading} [{unit}]" if unit else heading
        for heading, unit in zip(table.headings, units, strict=True)
    )
    writer.writerows(map(_plain, zip(*map(table.values, range(len(table.columns))), strict=True)))
    return text.getvalue()


def to_latex(table: Table) -> str:
    """Return a table for LaTeX with the package booktabs; its notes as a paragraph below."""
    shape = "".join("r" if table.is_number(k) else "l" for k in range(len(table.columns)))
    rows = [" & ".join(map(_latex, row)) + r" \\" for row in table.text()]
    lines = [
        *([rf"\caption{{{_latex(table.title)}}}"] if table.title else []),
        rf"\begin{{tabular}}{{{shape}}}", r"\toprule",
        " & ".join(map(_latex, table.headings)) + r" \\", r"\midrule",
        *rows, r"\bottomrule", r"\end{tabular}",
        *(rf"\par {_latex(note)}" for note in table.notes),
    ]  # fmt: skip
    return "\n".join([r"\begin{table}", r"\centering", *lines, r"\end{table}", ""])


_LATEX = str.maketrans({
    "\\": r"\textbackslash{}", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}", "\n": r" \newline ",
    **{sign: f"\\{sign}" for sign in "&%$#_{}"},
})  # fmt: skip


def _latex(text: str) -> str:
    """Return text with the characters escaped that mean something to LaTeX."""
    return text.translate(_LATEX)


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
    headings = ["run", "begun", "scenario", "changed", "status", *(measure.formula for measure in peaks)]
    table = Table("", headings)
    for run in runs:
        file = Path(run.record.scenario_file)
        scenario = "/".join([*file.parts[-2:-1], file.stem])
        cells: list[Cell] = [
            str(run.folder), _local(run.record.started), scenario or None,
            changed(run.record.overrides) or None, run.status.value, *(_peak(run.record, s) for s in PEAKS),
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
    names = columns_of(Results(Path(), np.empty(0), columns, units, record), signal)
    ends = [of_column.get(name) for name in names for of_column in (record.smallest, record.largest)]
    numbers = [float(end) for end in ends if end is not None]
    if not numbers or any(map(math.isnan, numbers)):
        return None
    return MetricValue(max(map(abs, numbers)), units[names[0]] or "1")


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
    for base in loader.folders() if folder is None else [folder]:
        for path, kind in loader.files(base, kinds):
            archive = path.suffix == ".ssp"
            title = "" if archive else loader.title_of(path)
            by_name = folder is None and kind in loader.COMMANDS
            name = path.relative_to(base).with_suffix("").as_posix() if by_name else str(path)
            rows.setdefault(name, [name, "SSP archive" if archive else kind.partition(" ")[2], title or None])
    table.rows = [*rows.values()]
    if not table.rows:
        where = folder or " and ".join(map(str, loader.folders()))
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
        table.rows.append([fmu.name, str(how) if how else None])
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
