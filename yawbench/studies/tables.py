"""Tables, shown on the terminal and on pages and written to files."""

from __future__ import annotations

import csv
import io
import math
import re
from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import chain, zip_longest
from typing import TYPE_CHECKING, Any, Literal

from yawbench.events.kinds import events_in
from yawbench.events.why import lost_among
from yawbench.figures.display import shown_value
from yawbench.figures.latex import escaped
from yawbench.foundation.errors import text_of
from yawbench.foundation.messages import printable
from yawbench.metrics.expressions import MetricValue
from yawbench.metrics.verdict import VerdictText
from yawbench.orchestrator.results.reader import Results
from yawbench.orchestrator.results.run_record import EventRecord

if TYPE_CHECKING:
    import pandas as pd
    import rich.console
    import rich.segment

MARK = "†"
"""Mark after the name of a run with plausibility warnings."""
MIN_HEADING = 12
"""Characters after which a heading over numbers is wrapped."""
NAME = 32
"""Widest text on the terminal that is not broken over lines without need. Chosen: most names."""
WORDS = 20
"""Widest text that is not broken at all, and the narrowest column of longer ones. Chosen: all verdicts."""
GAP = 3
"""Distance between columns on the terminal."""
RULE = "─"
"""The line below headings on the terminal."""

Cell = str | MetricValue | float | None
"""A table cell: text, a number with its unit or in that of its column, or None if empty."""
Kind = Literal["int64", "float64", "string"]
"""Kind of the cells of a column, for data frames and files."""


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
        units = {cell.unit if isinstance(cell, MetricValue) else None for cell in cells}
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
        return cell if isinstance(cell, VerdictText) else printable(cell)
    if isinstance(cell, int):
        return str(cell)
    value = cell if isinstance(cell, MetricValue) else MetricValue(cell, unit or "1")
    return shown_value(value)


def for_terminal(table: Table) -> TerminalTable:
    """Return the table for a rich console, which lays it out for its width."""
    return TerminalTable(table)


@dataclass(frozen=True)
class TerminalTable:
    """A table on a console of any width, on which no word and no number with its unit is cut or broken.

    Long texts are broken between words. If the columns still do not fit beside each other, they follow in
    several grids, each of which begins with the columns that tell the rows apart. If these are long texts
    themselves, each row becomes a list of headings and cells. A word longer than a line runs beyond it.
    """

    table: Table

    def __rich_console__(
        self, console: rich.console.Console, options: rich.console.ConsoleOptions
    ) -> Iterator[rich.segment.Segment]:
        from rich.segment import Segment
        from rich.style import Style

        width, table = options.max_width, self.table
        title = _wrapped(printable(table.title), width) if table.title else []
        notes = [line for note in table.notes for line in _wrapped(printable(note), width)]
        for line in title:
            yield Segment(line, Style(bold=True))
            yield Segment.line()
        for line in [*[""][: len(title)], *_laid_out(table, width), *[""][: len(notes)], *notes]:
            yield Segment(line.rstrip().replace(RULE, "-") if options.ascii_only else line.rstrip())
            yield Segment.line()


@dataclass(frozen=True)
class _Strip:
    """A column on the terminal: its cells, its narrowest widths, tight and not, and its preferred one."""

    heading: str
    cells: Sequence[str]
    number: bool
    tight: int
    least: int
    most: int

    @classmethod
    def of(cls, heading: str, cells: Sequence[str], *, number: bool, whole: int) -> _Strip:
        """Return the column of a heading and its cells; a long heading does not widen one of numbers.

        `whole`: the widest text that is not broken even if the room is needed.
        """
        lines = [line for cell in cells for line in cell.splitlines()]
        widest = _widest(lines)

        def narrowest(whole: int) -> int:
            parts = (([line] if _width(line) <= whole else _words(line)) for line in lines)
            return max(_widest([*chain.from_iterable(parts), *_words(heading)]), min(widest, whole))

        tight, least = narrowest(whole), narrowest(max(whole, NAME))
        broken = _wrapped(heading, max(MIN_HEADING, widest)) if number else [heading]
        return cls(heading, cells, number, tight, least, max(least, widest, _widest(broken)))

    def lines(self, text: str, width: int) -> list[str]:
        """Return the lines of a cell or of the heading, each as wide as the column."""
        filled = [(line, " " * (width - _width(line))) for line in _wrapped(text, width)]
        return [fill + line if self.number else line + fill for line, fill in filled]


def _laid_out(table: Table, width: int) -> list[str]:
    """Return the lines of a table's grids, or of its lists."""
    cells = [*zip(*table.text(), strict=True)] or [()] * len(table.columns)
    numbers, half = [*map(table.is_number, range(len(table.columns)))], width // 2
    strips = [
        _Strip.of(printable(heading), cells[k], number=number, whole=NAME if number else WORDS if k else half)
        for k, (heading, number) in enumerate(zip(table.headings, numbers, strict=True))
    ]
    if _across(strip.tight for strip in strips) <= width:
        return _grid(strips, width)
    counts = range(1, len(strips))
    count = next((n for n in counts if len({*zip(*cells[:n], strict=True)}) == len(table.rows)), 0)
    names, others = strips[:count], strips[count:]
    short = names and _across(strip.tight for strip in names) <= half + 1
    short = short and _across(strip.most for strip in names) <= width
    blocks: list[list[_Strip]] = []
    for strip in others:
        if not blocks or _across(strip.tight for strip in [*blocks[-1], strip]) > width:
            blocks.append(names)
        blocks[-1] = [*blocks[-1], strip]
    if not short or any(_across(strip.tight for strip in block) > width for block in blocks):
        return _lists(strips, width)
    return [line for block in blocks for line in ["", *_grid(block, width)]][1:]


def _across(widths: Iterable[int]) -> int:
    """Return the width of columns beside each other."""
    listed = [*widths]
    return 1 + sum(listed) + GAP * (len(listed) - 1)


def _grid(strips: Sequence[_Strip], width: int) -> list[str]:
    """Return the lines of columns beside each other, the widest of them narrowed until they fit."""
    roomy = _across(strip.least for strip in strips) <= width
    level = max((strip.most for strip in strips), default=0)
    while level >= 0:
        widths = [max(s.least if roomy else s.tight, min(s.most, level)) for s in strips]
        if _across(widths) <= width:
            break
        level -= 1

    def row(texts: Iterable[str], *, bottom: bool = False) -> list[str]:
        columns = [strip.lines(text, of) for strip, text, of in zip(strips, texts, widths, strict=True)]
        tallest = max(map(len, columns), default=0)
        for lines, of in zip(columns, widths, strict=True):
            missing = [" " * of] * (tallest - len(lines))
            lines[:] = [*missing, *lines] if bottom else [*lines, *missing]
        return [" " + (" " * GAP).join(pieces) for pieces in zip(*columns, strict=True)]

    head = row((strip.heading for strip in strips), bottom=True)
    rows = zip(*(strip.cells for strip in strips), strict=True)
    return [*head, " " + RULE * (_across(widths) - 1), *(line for cells in rows for line in row(cells))]


def _lists(strips: Sequence[_Strip], width: int) -> list[str]:
    """Return the lines of every row as a list of headings and cells, with an empty line after each."""
    labels = min(_widest(strip.heading for strip in strips), width // 3)
    made: list[str] = []
    for cells in zip(*(strip.cells for strip in strips), strict=True):
        for strip, cell in zip(strips, cells, strict=True):
            label, lines = _wrapped(strip.heading, labels), _wrapped(cell, width - labels - GAP - 1)
            if _widest(label) <= labels and _widest(lines) <= width - labels - GAP - 1:
                pairs = zip_longest(label, lines, fillvalue="")
                made += [f" {left}{' ' * (labels - _width(left) + GAP)}{right}" for left, right in pairs]
            else:
                made += [f" {line}" for line in _wrapped(strip.heading, width - 1)]
                made += [f"    {line}" for line in _wrapped(cell, width - 4)]
        made.append("")
    return made[:-1]


def _wrapped(text: str, width: int) -> list[str]:
    """Return the lines of a text, broken between words; a longer word has a line of its own."""
    lines: list[str] = []
    for line in text.replace("\t", "    ").splitlines() or [""]:
        if _width(line) <= width:
            lines.append(line)
            continue
        begun = ""
        for word in _words(line):
            if begun and _width(begun) + 1 + _width(word) > width:
                lines.append(begun)
                begun = word
            else:
                begun = f"{begun} {word}" if begun else word
        lines.append(begun)
    return lines


_NUMBER = re.compile(r"[^\w\s]*(\d+([.,]\d+)*(e[-+]?\d+)?[)\]]*)?")
"""What stays with the word after it: a number with its unit, a sign with its number."""


def _words(line: str) -> list[str]:
    """Return the words of a line, between which it may be broken."""
    words: list[str] = []
    for word in line.split():
        after = words and _NUMBER.fullmatch(words[-1].rpartition(" ")[2]) and words[-1].count(" ") < 3
        if after or (words and word == MARK):
            words[-1] += f" {word}"
        else:
            words.append(word)
    return words


def _widest(texts: Iterable[str]) -> int:
    return max(map(_width, texts), default=0)


def _width(text: str) -> int:
    """Return how many columns of the terminal a text takes: two for a wide character, none for an accent."""
    if text.isascii():
        return len(text)
    from rich.cells import cell_len

    return cell_len(text)


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


def to_latex(table: Table, *, label: str = "") -> str:
    """Return a table for LaTeX with the package booktabs; its notes as a paragraph below.

    `label`: for `\\ref`.
    """
    shape = "".join("r" if table.is_number(k) else "l" for k in range(len(table.columns)))
    rows = [" & ".join(map(_cell_in_latex, row)) + r" \\" for row in table.text()]
    lines = [
        *([rf"\caption{{{_in_latex(table.title)}}}"] if table.title else []),
        *([rf"\label{{{label}}}"] if label else []),
        rf"\begin{{tabular}}{{{shape}}}", r"\toprule",
        " & ".join(map(_cell_in_latex, table.headings)) + r" \\", r"\midrule",
        *rows, r"\bottomrule", r"\end{tabular}",
        *(rf"\par {_in_latex(note)}" for note in table.notes),
    ]  # fmt: skip
    return "\n".join([r"\begin{table}", r"\centering", *lines, r"\end{table}", ""])


def _in_latex(text: str) -> str:
    return escaped(" ".join(printable(text).split()))


def _cell_in_latex(text: str) -> str:
    """Return a cell for LaTeX; one of several lines is a table of its own."""
    lines = r" \\ ".join(map(_in_latex, text.splitlines()))
    return rf"\begin{{tabular}}[t]{{@{{}}l@{{}}}}{lines}\end{{tabular}}" if "\n" in text else lines


def _plain(row: Sequence[Any]) -> list[str]:
    """Return a row as text: numbers with all digits, "" for None."""
    return [
        "" if x is None else repr(x) if isinstance(x, float) and math.isfinite(x) else str(x) for x in row
    ]


def marked(label: str, results: Results) -> str:
    """Return the label of a run, with a mark if it has plausibility warnings."""
    return f"{label} {MARK}" if _remarkable(results) else label


def remarks(runs: Iterable[tuple[str, Results]]) -> list[str]:
    """Return a note for each marked run of (label, results), and why a car was lost."""
    shown = [*runs]
    notes = [f"{MARK} {label}: {says}" for label, results in shown if (says := _remarkable(results))]
    return [*notes, *lost_notes([(label, events_in(results)) for label, results in shown])]


def lost_notes(
    runs: Sequence[tuple[str, Sequence[EventRecord]]], most: int | None = None, *, comparable: bool = True
) -> list[str]:
    """Return why cars were lost, of runs as (label, events); `comparable`: see `lost_among`.

    Of more than `most`, the first have notes, and a last note says how many more there are.
    """
    found = lost_among([events for _, events in runs], comparable=comparable)
    notes = [
        f"{runs[number][0]}: lost because {'; '.join(map(str, reasons))}" for number, reasons, _ in found
    ]
    if most is None or len(notes) <= most:
        return notes
    return [*notes[:most], f"{len(notes) - most} more runs were lost; the page says why"]


def _remarkable(results: Results) -> str:
    return text_of(results.record.course_warnings)
