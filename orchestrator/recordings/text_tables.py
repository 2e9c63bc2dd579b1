"""Tables of numbers in text files: CSV as loggers and their programs write it, and .vbo of Racelogic.

pyarrow splits the rows. Found here is what surrounds them: encoding, separator, the head of the logger, the
names of the columns, rows of units and of sources below them, comments, a footer; and the decimal mark,
which belongs to the file, not to a cell.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from .clocks import PACKED
from .units_of_loggers import stated_unit, unit_in_file

if TYPE_CHECKING:
    import pyarrow as pa

Mark = Literal[".", ","]
"""A decimal mark."""
SEPARATORS = ("\t", ";", "|", ",", " ")
"""Separators of columns; a space stands for any number of spaces."""
HEAD = 1_000_000, 400
"""Characters and lines in which the first rows of the table lie. Chosen: heads have up to 100 lines."""
FOOTER = 50
"""Lines of a footer at most; chosen: as much as a short table of laps."""
COMMENTS = ("#", "%", "//")
MISSING = frozenset(
    (
        "", "-", "--", "---", "—", "?", "nan", "+nan", "-nan", "nan(ind)", "-nan(ind)", "null", "none", "nat",
        "na", "n/a", "#n/a", "<na>", "1.#qnan", "-1.#qnan", "1.#ind", "-1.#ind",
    )
)  # fmt: skip
"""Texts, in small letters, of cells without a value."""


def _with(mark: Mark) -> str:
    """Return the pattern of a number with this decimal mark."""
    return rf"[+-]?(\d+[{mark}]\d*|[{mark}]\d+)([eE][+-]?\d+)?"


def _grouped(by: str) -> str:
    """Return the pattern of a whole number in groups of three digits, as in 1,250."""
    return rf"[+-]?[1-9]\d{{0,2}}([{by}]\d{{3}})+"


_APART = " '’\u00a0\u202f"
"""Marks between groups of digits that are never decimal marks."""
_WHOLE = r"[+-]?(\d+([eE][+-]?\d+)?|inf)"
_NUMBER = re.compile(
    "|".join((_WHOLE, *map(_with, ".,"), *(_grouped(by) + r"([.,]\d*)?" for by in (",", ".", _APART[1:])))),  # type: ignore[arg-type]
    re.I,
)
_CLOCK = re.compile(r".*\d:\d\d.*")


@dataclass(frozen=True)
class TextTable:
    """The table of a text file; its cells are text."""

    headers: list[str]
    units: list[str | None]
    sources: list[str]  # such as "100: gps", from a row between names and numbers
    cells: pa.Table
    decimal: Mark | None  # None: a comma may separate groups of digits as well as be the decimal mark
    notes: list[str]

    def column(self, at: int) -> np.ndarray:
        """Return a column: numbers with NaN where a cell has no value, or text with None there.

        Raises:
            ValueError: its numbers can be read in two ways.
        """
        import pyarrow.compute as pc

        cells = pc.utf8_trim_whitespace(self.cells.column(at)).to_pylist()
        try:
            if any("_" in cell for cell in cells):  # Python would read it as a number
                raise ValueError
            return np.array([np.nan if cell.lower() in MISSING else self._number(cell) for cell in cells])
        except AmbiguousMarkError as error:
            raise ValueError(f"column {self.headers[at]!r}: {error}") from None
        except ValueError:
            return np.array([None if cell.lower() in MISSING else cell for cell in cells], dtype=object)

    def _number(self, cell: str) -> float:
        if self.decimal == "." and "," not in cell:
            try:
                return float(cell)
            except ValueError:
                pass
        if self.decimal is None and re.fullmatch(f"{_grouped(',')}|{_grouped('.')}", cell):
            raise AmbiguousMarkError(f"{cell!r} may have a decimal mark or groups of digits: {STATE}")
        mark, other = (",", ".") if self.decimal == "," else (".", ",")
        whole = re.match(rf"{_grouped(other + _APART)}(?!\d)", cell)
        if whole is not None:
            cell = re.sub(f"[{other}{_APART}]", "", whole[0]) + cell[whole.end() :]
        if other in cell:
            raise ValueError(cell)
        return float(cell.replace(mark, "."))


STATE = "write 'decimal: \",\"' or 'decimal: \".\"' in the measurement file"


class AmbiguousMarkError(ValueError):
    """A number can be read in two ways."""


def read_text_table(
    raw: bytes, *, asked: Collection[str] = (), header: int | None = None, decimal: Mark | None = None
) -> TextTable:
    """Read the table of a text file.

    Args:
        raw: content of the file.
        asked: names of columns that it probably has.
        header: the line of the names of columns; None: they are looked for.
        decimal: its decimal mark; None: as the numbers show.

    Raises:
        ValueError: there is no table, or it is damaged.
    """
    text = raw.decode(encoding_of(raw))
    if "\r" in text:
        text = text.replace("\r\n", "\n").replace("\r", "\n")
    first = HEAD[1] + (header or 0)
    lines = text[: HEAD[0]].split("\n")[:first]
    if len(text) > HEAD[0] and len(lines) < first:
        lines = lines[:-1]
    if any(line.strip().lower() == "[data]" for line in lines):
        frame = _of_vbo(lines)
    else:
        frame = _frame(lines, asked, header)
    end, notes = _end(text, frame)
    text = text[sum(len(line) + 1 for line in lines[: frame.begin]) : end]
    cells = _cells(text, frame)
    return TextTable(frame.names, frame.units, frame.sources, cells, decimal or _decimal(cells), notes)


def encoding_of(raw: bytes) -> str:
    """Return the encoding of a text.

    Raises:
        ValueError: not a text.
    """
    if raw.startswith((b"\xff\xfe", b"\xfe\xff")):
        return "utf-16"
    if b"\0" in raw:
        begin = raw[:1000]
        for code, zeros in (("utf-16-le", begin[1::2]), ("utf-16-be", begin[::2])):
            if len(zeros) > 1 and zeros.count(0) > 0.9 * len(zeros):
                return code
        raise ValueError("is not text")
    try:
        raw.decode("utf-8")
    except UnicodeDecodeError:
        return "cp1252" if not _UNDEFINED.intersection(raw) else "latin-1"
    return "utf-8-sig"


_UNDEFINED = frozenset(b"\x81\x8d\x8f\x90\x9d")
"""Bytes that Windows-1252 does not define; Latin-1 does."""
_Row = tuple[list[str], str]
"""Cells of a line, and their kinds, see `_kind`."""


@dataclass
class _Frame:
    """What surrounds the numbers of a table."""

    separator: str
    names: list[str]
    units: list[str | None]
    sources: list[str]
    begin: int  # index of the first line of numbers
    kinds: str  # of its columns, see `_kind`
    repeated: list[str] = field(default_factory=list)  # lines that loggers write again where they go on


def _split(line: str, separator: str) -> list[str]:
    if separator == " ":
        return line.split()
    (cells,) = csv.reader([line], delimiter=separator, skipinitialspace=True) if line.strip() else ([],)
    return [cell.strip() for cell in cells]


def _kind(cell: str) -> str:
    """Return n for a number or a time, t for other text, a blank for a cell without a value."""
    if cell.lower() in MISSING:
        return " "
    return "n" if _NUMBER.fullmatch(cell) or _CLOCK.fullmatch(cell) else "t"


def _alike(kinds: str, others: str) -> bool:
    """Return whether a row may be of the same table as others: numbers stand below numbers."""
    if len(kinds) != len(others) or "n" not in kinds:
        return False
    pairs = list(zip(kinds, others, strict=True))
    first = others.find("n")
    return pairs.count(("n", "n")) > sum({"n", "t"} == {*pair} for pair in pairs) and kinds[first] != "t"


def _rows(lines: Sequence[str], separator: str) -> list[_Row]:
    """Return cells and their kinds of all lines; comments and empty lines have no cells."""
    rows = []
    for line in lines:
        cells = [] if line.lstrip().startswith(COMMENTS) else _split(line, separator)
        kinds = "".join(map(_kind, cells))
        rows.append((cells, kinds) if kinds.strip() else ([], ""))
    return rows


def _longest(rows: Sequence[_Row]) -> tuple[tuple[int, int], str]:
    """Return how many numbers and (negative) texts the longest run of rows alike has, and its kinds."""
    best, run, numbers, texts = ((0, 0), ""), "", 0, 0
    for _, kinds in rows:
        if not kinds:
            continue
        if run and _alike(kinds, run):
            run = "".join(old if old != " " else new for old, new in zip(run, kinds, strict=True))
        elif "n" in kinds and len(kinds) > 1:
            run, numbers, texts = kinds, 0, 0
        else:
            run = ""
            continue
        numbers, texts = numbers + kinds.count("n"), texts - kinds.count("t")
        best = max(best, ((numbers, texts), run), key=lambda pair: pair[0])
    return best


def _frame(lines: list[str], asked: Collection[str], header: int | None) -> _Frame:
    """Find the table in the first lines of a file."""
    stated = re.fullmatch(r"\s*\"?sep=(.)\"?\s*", lines[0], re.I)
    first = 1 if stated else 0
    separators = [stated[1]] if stated else SEPARATORS
    rows: list[_Row] = []
    separator, most, kinds = ",", (0, 0), ""
    for candidate in separators:
        none: list[_Row] = [([], "")] * first
        split = none + _rows(lines[first:], candidate)
        found = _longest(split)
        if found[0] > most:
            rows, separator, (most, kinds) = split, candidate, found
    if not kinds:
        few = sum(bool(line.strip()) for line in lines) < 3
        where = "; if it begins below, write 'header: ...', the line of its names"
        raise ValueError("has no rows" if few else f"has no table in its first {len(lines)} lines{where}")
    if header is not None and not 0 < header < len(lines):
        raise ValueError(f"has no names of columns in line {header} (key 'header')")
    at = header - 1 if header else _line_asked_for(lines, rows, kinds, separator, asked)
    after = range(0 if at is None else at + 1, len(rows))
    begin = next((row for row in after if _alike(rows[row][1], kinds)), None)
    if begin is None:
        raise ValueError(f"has no numbers below line {(at or 0) + 1}")
    if at is None:
        at = _line_of_names(lines, rows, begin, kinds, separator)
    names = _cells_of_name(lines[at], separator)
    below = [cells for cells, _ in rows[at + 1 : begin] if cells and len(cells) > 1]
    units, sources = _units_and_sources(below, len(names))
    repeated = [lines[row] for row in range(at, begin) if rows[row][0]]
    return _Frame(separator, names, units, sources, begin, kinds, repeated)


def _cells_of_name(line: str, separator: str) -> list[str]:
    plain = line.strip()
    if plain.startswith(COMMENTS):
        plain = plain.lstrip("#%/").lstrip(" ")
    cells = _split(plain, separator)
    while cells and not cells[-1]:
        del cells[-1]
    return cells


def _line_asked_for(
    lines: list[str], rows: list[_Row], kinds: str, separator: str, asked: Collection[str]
) -> int | None:
    """Return the index of the first line with most of the names asked for, None if there is none with any.

    Comments come last.
    """
    wanted = {name.partition("#")[0].strip() for name in asked}
    there = {}
    for row, (cells, of_row) in enumerate(rows):
        if not _alike(of_row, kinds) and _fits(lines[row], kinds, separator):
            names = _cells_of_name(lines[row], separator)
            known = wanted.intersection((*names, *(split_header(name)[0] for name in names)))
            there[row] = len(known), bool(cells)
    most = max(there.values(), default=(0, False))
    return next(row for row, count in there.items() if count == most) if most[0] else None


def _fits(line: str, kinds: str, separator: str) -> bool:
    """Return whether a line may have a name for each column."""
    return len(kinds.rstrip()) <= len(_cells_of_name(line, separator)) <= len(kinds)


def _line_of_names(lines: list[str], rows: list[_Row], begin: int, kinds: str, separator: str) -> int:
    """Return the index of the line with the names of the columns, by its place.

    It is the first of the rows of text just above the numbers, or the one above a row of units.
    """
    fits = [row for row in range(begin) if _fits(lines[row], kinds, separator)]
    if not fits:
        raise ValueError(_no_names(lines, rows, begin, kinds, separator))
    group = [row for row in fits if rows[row][0]] or fits
    at = group[-1]
    while at - 1 in group:
        at -= 1
    of_units = [row for row in range(at + 1, group[-1] + 1) if _share_of_units(rows[row][0]) >= 0.5]
    return of_units[-1] - 1 if of_units else at


def _no_names(lines: list[str], rows: list[_Row], begin: int, kinds: str, separator: str) -> str:
    nearest = next((row for row in reversed(range(begin)) if rows[row][0]), None)
    if nearest is None:
        return f"has no names of columns above its numbers, which begin in line {begin + 1}"
    count = len(_cells_of_name(lines[nearest], separator))
    values = len(kinds.rstrip())
    return f"row {begin + 1} has {values} values for {count} columns, the names in line {nearest + 1}"


_HEADER = re.compile(r"(?P<name>.*?)\s*\[(?P<unit>[^\[\]]*)\]\s*")
_IN_BRACKETS = re.compile(r"(?P<name>.*\S)\s*(?P<unit>\([^()]*\)|\{[^{}]*\}|\"[^\"]*\"|'[^']*')\s*")


def split_header(header: str) -> tuple[str, str | None]:
    """Return name and unit of a header: `delta [deg]`; `delta (deg)` only if the unit is a known one."""
    if parts := _HEADER.fullmatch(header):
        return parts["name"], stated_unit(parts["unit"])
    if parts := _IN_BRACKETS.fullmatch(header):
        unit = parts["unit"][1:-1].strip()
        if unit and not unit.isdigit() and unit_in_file(unit) is not None:
            return parts["name"], unit
    return header.strip(), None


def _share_of_units(cells: Sequence[str]) -> float:
    """Return the share of units among the cells that are filled."""
    units = [unit for cell in cells if (unit := stated_unit(cell)) is not None]
    return sum(unit_in_file(unit) is not None for unit in units) / len(units) if units else 0.0


def _units_and_sources(below: list[list[str]], width: int) -> tuple[list[str | None], list[str]]:
    """Return units and sources from the rows of text between names and numbers."""
    best = max(below, key=_share_of_units, default=[])
    if best and not any(map(stated_unit, best)):
        best = []
    others = [row for row in below if row is not best]
    sources = [cell for cell in (others[0] if others else [])][:width]
    units = [stated_unit(cell) for cell in best][:width]
    return units + [None] * (width - len(units)), sources + [""] * (width - len(sources))


STANDARD_OF_VBO = frozenset(
    (
        "sats", "satellites", "time", "lat", "latitude", "long", "longitude", "velocity", "heading", "height",
        "vert-vel", "vertvel", "tsample", "sampleperiod", "event", "event-1", "event-2", "event1", "event2",
        "solution", "solution_type", "glonass_sats", "gps_sats", "avifileindex", "avitime", "avisynctime",
    )
)  # fmt: skip
"""Columns of .vbo files whose units are in the head or fixed, not in the section of units."""


def _of_vbo(lines: list[str]) -> _Frame:
    """Return the frame of a .vbo file, which has sections such as [header], [column names] and [data]."""
    sections: dict[str, list[str]] = {}
    section: list[str] = []
    begin = 1 + next(at for at, line in enumerate(lines) if line.strip().lower() == "[data]")
    for line in lines[: begin - 1]:
        if re.fullmatch(r"\s*\[[^\]]+\]\s*", line):
            section = sections.setdefault(line.strip().lower()[1:-1], [])
        elif line.strip():
            section.append(line.strip())
    head = sections.get("header", [])
    names = " ".join(sections.get("column names", [])).split() or [line.replace(" ", "_") for line in head]
    units: list[str | None] = [None] * len(names)
    if len(head) == len(names):
        for at, line in enumerate(head):
            unit = line.split()[-1]
            units[at] = unit if " " in line and unit_in_file(unit) is not None else None
    stated = sections.get("channel units", [])
    others = names[len(names) - len(stated) :] if len(stated) <= len(names) else []
    if others and STANDARD_OF_VBO.issuperset(name.lower() for name in names[: -len(others)]):
        for at, text in enumerate(stated, start=len(names) - len(stated)):
            units[at] = stated_unit(text) or units[at]
    units = [PACKED if name.lower() == "time" else unit for name, unit in zip(names, units, strict=True)]
    if not names:
        raise ValueError("has no names of columns: a section [column names] or [header]")
    return _Frame(" ", names, units, [""] * len(names), begin, "n" * len(names))


def _end(text: str, frame: _Frame) -> tuple[int, list[str]]:
    """Return where the table ends, ahead of a footer or a last line that was cut off, and notes of them."""
    kinds, notes, end = frame.kinds, [], len(text)
    for _ in range(FOOTER):
        while end and text[end - 1].isspace():
            end -= 1
        begin = text.rfind("\n", 0, end) + 1
        line = text[begin:end]
        cells = _split(line, frame.separator)
        cut = end == len(text) and len(cells) < len(kinds.rstrip())
        behind = kinds[0] == "n" and bool(cells) and _kind(cells[0]) == "t" and line not in frame.repeated
        if not cut and not behind:
            break
        what = "is cut off" if cut else "is no row of numbers"
        notes.append(
            f"line {text.count(chr(10), 0, begin) + 1} {what} and is not used: {line.strip()[:40]!r}"
        )
        end = begin
    return end, notes


def _cells(text: str, frame: _Frame) -> pa.Table:
    """Return the cells of all rows, as text.

    Raises:
        ValueError: a row has more or fewer cells than there are columns.
    """
    import pyarrow as pa
    import pyarrow.csv

    skipped = "|".join(
        (r"[ \t]+", *(rf"[ \t]*{mark}.*" for mark in COMMENTS), *map(re.escape, frame.repeated))
    )
    text = re.sub(rf"(?m)^(?:{skipped})$", "", text)
    separator = frame.separator
    if separator == " ":
        text, separator = re.sub(r"[ \t]+", "\t", re.sub(r"(?m)^[ \t]+|[ \t]+$", "", text)), "\t"
    elif f'{separator} "' in text:
        text = re.sub(rf'(?<={re.escape(separator)}) +(?=")', "", text)
    width, named = max(len(frame.kinds), len(frame.names)), len(frame.names)
    bad: list[tuple[int, int]] = []

    def skip(row: Any) -> str:
        bad.append((row.number, row.actual_columns))
        return "skip"

    columns = [str(at) for at in range(width)]
    content = text.encode()
    try:
        table = pyarrow.csv.read_csv(
            pa.BufferReader(content),
            read_options=pyarrow.csv.ReadOptions(
                column_names=columns, use_threads=False, block_size=len(content) + 1
            ),
            parse_options=pyarrow.csv.ParseOptions(
                delimiter=separator,
                quote_char=False if frame.separator == " " else '"',
                invalid_row_handler=skip,
            ),
            convert_options=pyarrow.csv.ConvertOptions(
                column_types=dict.fromkeys(columns, pa.string()), strings_can_be_null=False
            ),
        )
    except pa.ArrowInvalid as error:
        raise ValueError(f"its rows cannot be read: {error}" if text.strip() else "has no rows") from None
    for at in range(named, width):
        there = [row for row, cell in enumerate(table.column(at).to_pylist(), start=1) if cell.strip()]
        bad += [(row, at + 1) for row in there[:1]]
    if bad:
        row, count = bad[0]
        numbers = [number for number, line in enumerate(text.split("\n"), start=frame.begin + 1) if line]
        raise ValueError(f"row {numbers[row - 1]} has {count} values for {named} columns")
    if not table.num_rows:
        raise ValueError("has no rows")
    return table


def _decimal(cells: pa.Table) -> Mark | None:
    """Return the decimal mark that the numbers of a table show; None if commas among them may be either.

    Raises:
        ValueError: they show both.
    """
    import pyarrow.compute as pc

    columns = [pc.utf8_trim_whitespace(column) for column in cells.columns]
    if not any(pc.any(pc.match_substring(column, ",")).as_py() for column in columns):
        return "."
    shown: dict[Mark, str] = {}
    marks: tuple[tuple[Mark, Mark], ...] = ((".", ","), (",", "."))
    unclear = False
    for column in columns:
        texts = pc.unique(column)
        unclear = unclear or bool(pc.any(pc.match_substring_regex(texts, f"^{_grouped(',')}$")).as_py())
        for mark, other in marks:
            either = pc.match_substring_regex(texts, f"^{_grouped(mark)}$")
            sure = [
                pc.and_not(pc.match_substring_regex(texts, f"^({_with(mark)})$"), either),
                pc.match_substring_regex(texts, rf"^{_grouped(other + _APART)}[{mark}]\d*$"),
                pc.match_substring_regex(texts, rf"^[+-]?[1-9]\d{{0,2}}([{other}]\d{{3}}){{2,}}$"),
            ]
            found = texts.filter(pc.or_(pc.or_(sure[0], sure[1]), sure[2]))
            if len(found):
                shown.setdefault(mark, found[0].as_py())
    if len(shown) == 2:
        raise ValueError(f"has decimal points ({shown['.']!r}) and decimal commas ({shown[',']!r}): {STATE}")
    return next(iter(shown), None if unclear else ".")
