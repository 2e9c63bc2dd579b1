"""Tables on a terminal of any width: columns beside each other, below each other, or rows as lists."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import chain, zip_longest
from typing import TYPE_CHECKING

from yawbench.foundation.messages import printable

from .tables import MARK, Table

if TYPE_CHECKING:
    import rich.console
    import rich.segment

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
