"""Reader of recorded runs: `Results` of one folder, all runs below a folder.

`thinned` drops rows of long results while they are read, for figures. In each stretch of rows it keeps the
first, the last and those in which a column, or the distance of a signal from its reference, is smallest or
largest, so that every peak stays. Rows are kept whole: values of one instant stay together.
"""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from functools import cached_property
from pathlib import Path

import numpy as np

from yawbench.foundation.errors import ResultsError
from yawbench.foundation.messages import fold, listed, short
from yawbench.foundation.safe_files import check_regular, reads, reason

from ..scenario.quantities import conversion, measure_of
from ..signal_names import SignalName
from .file_formats import FILES, FORMATS, ResultsSource, load_class
from .run_folder import PART, is_dead, load_record, unfinished
from .run_record import RUN_FILE, ConnectionRecord, RunRecord, RunStatus


@dataclass(frozen=True)
class FoundRun:
    """A run found on disk: its folder, status and record."""

    folder: Path
    status: RunStatus
    record: RunRecord
    problem: str = ""  # why its results are missing or incomplete


def found_runs(folder: Path) -> list[FoundRun]:
    """Return all runs in and below a folder, the earliest first.

    Raises:
        ResultsError: the folder does not exist, or there is no run in it.
    """
    if not folder.is_dir():
        raise ResultsError(f"{folder}: no such folder; name one with results", code="results-missing")
    runs = [run for each in _folders(folder) for run in _runs_in(each)]
    if not runs:
        raise ResultsError(
            f"{folder}: contains no results; 'yawbench run SCENARIO' makes some", code="results-missing"
        )
    return sorted(runs, key=lambda run: (run.record.started or "", run.folder))


def _folders(folder: Path) -> Iterator[Path]:
    for above, below, files in os.walk(folder):
        below.sort()
        if not {RUN_FILE, f"{RUN_FILE}{PART}"}.isdisjoint(files):
            yield Path(above)


def _runs_in(folder: Path) -> Iterator[FoundRun]:
    """Yield the run whose results are in a folder, and the one that is going on or has died there."""
    going = unfinished(folder)
    if going is not None:
        dead = is_dead(folder)
        status = RunStatus.DIED if dead else RunStatus.RUNNING
        yield FoundRun(folder, status, going, "it ended abnormally" if dead else "")
    if going is not None and not os.path.lexists(folder / RUN_FILE):
        return
    try:
        record = load_record(folder, settled=going is not None)
    except ResultsError as error:
        yield FoundRun(folder, RunStatus.UNREADABLE, RunRecord(), str(error))
        return
    yield FoundRun(folder, record.status, record, record.error.message if record.error else "")


LONG = 200_000
"""Number of rows above which results are thinned; chosen: ten times the papers' longest run."""
STRETCHES = 1500
"""Number of stretches that a thinned run is divided into: the points of a line across a page."""


def thinned(
    blocks: Iterator[list[np.ndarray]], columns: Sequence[str], rows: int
) -> Iterator[list[np.ndarray]]:
    """Yield the blocks without the rows that a figure does not need.

    Args:
        blocks: arrays of equal length, one for each column.
        columns: their names.
        rows: number of rows in all blocks, as far as it is known; short results are not thinned.
    """
    if rows < LONG:
        yield from blocks
        return
    length = -(-rows // STRETCHES)
    column = {name: i for i, name in enumerate(columns)}
    errors = [(i, column[r]) for name, i in column.items() if (r := _reference(name, columns)) is not None]
    for block in blocks:
        numbers = [i for i, column in enumerate(block) if column.dtype.kind == "f"]
        distances = [block[i] - block[k] for i, k in errors if i in numbers and k in numbers]
        curves = np.vstack([*(block[i] for i in numbers), *distances])
        kept = np.zeros(len(block[0]), dtype=bool)
        for begin in range(0, len(kept), length):
            part = curves[:, begin : begin + length]
            gaps = np.isnan(part)
            kept[begin + np.where(gaps, np.inf, part).argmin(axis=1)] = True
            kept[begin + np.where(gaps, -np.inf, part).argmax(axis=1)] = True
            kept[begin + gaps.argmax(axis=1)] = True  # the first gap, else the first row
            kept[begin + part.shape[1] - 1] = True
        yield [column[kept] for column in block]


def _reference(name: str, columns: Sequence[str]) -> str | None:
    """Return the column of a signal's reference if there is exactly one."""
    wanted = f"{SignalName.parse(name).variable}_ref"
    matches = [other for other in columns if SignalName.parse(other).variable == wanted]
    return matches[0] if len(matches) == 1 else None


@dataclass(frozen=True)
class Results:
    """The recorded values of one run.

    `results["plant.yaw_rate"]` is a column by its full name; `results.find("yaw_rate")` is the only
    recorded variable of that name, whatever its instance is called in the scenario.
    """

    folder: Path
    time: np.ndarray  # shape (rows,) [s]
    columns: dict[str, np.ndarray]  # "<instance>.<variable>" -> shape (rows,)
    units: dict[str, str]  # "time" and "<instance>.<variable>" -> unit; "" if it has none
    record: RunRecord  # run.json

    @cached_property
    def names(self) -> dict[str, SignalName]:
        """Column -> its instance and variable."""
        return {column: SignalName.parse(column) for column in self.columns}

    @property
    def file(self) -> Path:
        """The file that the columns were read from."""
        return self.folder / self.record.results

    @property
    def where(self) -> str:
        """The name used in messages: the file, or the title for results that are only in memory."""
        return str(self.file) if self.folder != Path() else self.record.title or "this run"

    @property
    def ended(self) -> str | None:
        """Reason for which an instance ended the run before its stop time; None if none did."""
        ended = self.record.ended
        return ended.message if ended else None

    def __getitem__(self, column: str) -> np.ndarray:
        try:
            return self.columns[column]
        except KeyError:
            raise ResultsError(self._unknown(column), code="signal-unknown") from None

    def __contains__(self, column: object) -> bool:
        return column in self.columns

    def __iter__(self) -> Iterator[str]:
        return iter(self.columns)

    def find(self, variable: str, *, role: str | None = None) -> np.ndarray:
        """Return the values of the only recorded variable of that name (see `column`)."""
        return self.columns[self.column(variable, role=role)]

    def column(self, variable: str, *, role: str | None = None) -> str:
        """Return the full column name of a variable, whatever its instance is called.

        If no instance has an output of that name, it is the output that feeds inputs of that name: the
        `Mz` of an FMU from another tool, connected to `plant.yaw_moment`, is the yaw moment.

        Args:
            variable: name of a variable; a full name `instance.variable` is returned unchanged.
            role: only instances with this role ("plant", "controller", ...): see
                `vocabulary.roles.role_of`.

        Raises:
            ResultsError: no such column, or more than one.
        """
        columns = self.candidates(variable, role=role)
        if len(columns) == 1:
            return columns[0]
        if not columns:
            raise ResultsError(self._unknown(variable, role), code="signal-unknown")
        raise ResultsError(
            f"{self.where}: '{variable}' was recorded of more than one instance: {', '.join(columns)}.",
            code="signal-ambiguous",
        )

    def candidates(self, variable: str, *, role: str | None = None) -> list[str]:
        """Return all columns that `variable` may refer to (see `column`)."""
        if role is None and variable in self.columns:
            return [variable]
        columns = [column for column, name in self.names.items() if name.variable == variable]
        if role is not None:
            instances = self.instances_of_role(role)
            columns = [column for column in columns if self.names[column].instance in instances]
        return columns if columns or role is not None else self.feeding(variable)

    def feeding(self, variable: str) -> list[str]:
        """Return the columns that feed inputs of this name unchanged, apart from a conversion of units."""
        feeding = [
            str(wire.source)
            for wire in self.record.connections
            if wire.target.variable == variable and _is_the_same(wire, self.units.get(str(wire.source)))
        ]
        return [column for column in dict.fromkeys(feeding) if column in self.columns]

    def inputs_fed(self, column: str) -> list[str]:
        """Return the names of the inputs that a column feeds unchanged, by which it is known, too."""
        name, unit = self.names[column], self.units.get(column)
        fed = [
            wire.target.variable
            for wire in self.record.connections
            if wire.source == name and wire.target.variable != name.variable and _is_the_same(wire, unit)
        ]
        return [*dict.fromkeys(fed)]

    @cached_property
    def _roles(self) -> dict[str, str]:
        """Instance -> its role."""
        return {name: fmu.role_as(name) for name, fmu in self.record.fmus.items()}

    def instances_of_role(self, role: str) -> list[str]:
        """Return the names of the instances that have the role, in evaluation order."""
        return [name for name, known in self._roles.items() if known == role]

    def _unknown(self, variable: str, role: str | None = None) -> str:
        of = f" of a {role}" if role else ""
        variables = {name.variable for name in self.names.values()}
        close = get_close_matches(variable, [*self.columns, *variables], n=1)
        hint = f"; did you mean '{close[0]}'?" if close else f"; recorded: {', '.join(fold([*self]))}."
        return f"{self.where}: no column {short(variable)}{of} was recorded{hint}"


def _is_the_same(wire: ConnectionRecord, unit: str | None) -> bool:
    """Return whether a wire passes on an output of this unit as it is, at most converted to another unit."""
    if wire.gain is None:
        return True
    source, target = measure_of(unit), measure_of(str(wire.unit))
    factors = conversion(source, target) if source and target else None
    return factors is not None and np.allclose(factors, (wire.gain, wire.offset))


@reads("recorded run", ResultsError)
def load_results(
    folder: Path | str,
    *,
    only: Callable[[Results], Iterable[str]] | None = None,
    thin: bool = False,
) -> Results:
    """Read the results of one run; of a failed run, the part that was recorded.

    Args:
        folder: the results folder.
        only: selects the columns to read, given results without rows; default: all.
        thin: drop rows of a long run that a figure does not need (see `thinned`).

    Raises:
        ResultsError: a file is missing, unreadable, truncated, changed or not one that `yawbench run` writes,
            or the last run in the folder has died.
    """
    folder = Path(folder)
    record = load_record(folder)
    name = record.results
    if name not in FILES.values():
        known = listed(FILES.values(), last="or")
        raise ResultsError(f"{folder / RUN_FILE}: names {name!r} as the file of results; it must be {known}.")
    path = folder / name
    try:
        check_regular(path)
        file = source_of(path, record.texts)
        _check_names(file.names)
        if record.size not in (None, path.stat().st_size):
            raise ResultsError(
                f"{path}: was cut off or changed: its run wrote {record.size} bytes (`size` in "
                f"{RUN_FILE}), here are {path.stat().st_size}; run it again.",
                code="results-changed",
            )
        empty = _empty(folder, file.names, record)
        columns = list(dict.fromkeys(only(empty))) if only else file.names[1:]
        blocks = _in_order(file.blocks(["time", *columns]))
        if thin:
            blocks = thinned(blocks, ["time", *columns], record.rows)
        time, *values = _joined(blocks, 1 + len(columns))
    except FileNotFoundError:
        raise ResultsError(
            f"{path}: is missing, though {RUN_FILE} is there.", code="results-missing"
        ) from None
    except (OSError, ValueError) as error:
        raise ResultsError(f"{path}: cannot be read: {reason(error)}") from None
    return Results(folder, time, dict(zip(columns, values, strict=True)), empty.units, record)


def source_of(path: Path, texts: Sequence[str]) -> ResultsSource:
    """Open a results file for reading.

    Args:
        path: path of the file; its name determines the format.
        texts: columns that hold text, for formats that do not record it.

    Raises:
        OSError, ValueError: it is not a file that a run writes.
    """
    (format,) = (format for format in FORMATS.values() if format.file == path.name)
    source: ResultsSource = load_class(format.source)(path, texts)
    return source


def _check_names(names: Sequence[str]) -> None:
    if names[:1] != ["time"]:
        raise ValueError("the first column must be 'time'")
    twice = [name for name, count in Counter(names).items() if count > 1]
    if twice:
        raise ValueError(f"more than one column is called {short(twice[0])}")


def _empty(folder: Path, names: Sequence[str], record: RunRecord) -> Results:
    """Return results with these columns and no rows."""
    units = {name: record.units.get(name) or "" for name in names}
    return Results(folder, np.empty(0), {name: np.empty(0) for name in names[1:]}, units, record)


def _in_order(blocks: Iterator[list[np.ndarray]]) -> Iterator[list[np.ndarray]]:
    """Yield the blocks, checking that time increases from row to row."""
    last, row = -np.inf, 0
    for block in blocks:
        time = block[0]
        if time.dtype.kind != "f":
            raise ValueError(f"row {row + 1}: time {short(str(time[0]))} is not a number")
        wrong = np.flatnonzero(~(np.diff(time, prepend=last) > 0))
        if wrong.size:
            at = int(wrong[0])
            before = time[at - 1] if at else last
            raise ValueError(f"row {row + at + 1}: time {time[at]:.9g} s does not follow {before:.9g} s")
        last, row = time[-1] if time.size else last, row + time.size
        yield block


def _joined(blocks: Iterable[list[np.ndarray]], columns: int) -> list[np.ndarray]:
    """Return the concatenated columns of all blocks."""
    parts = list(blocks)
    arrays = []
    for k in range(columns):
        arrays.append(np.concatenate([part[k] for part in parts]) if parts else np.empty(0))
        for part in parts:
            part[k] = np.empty(0)  # free the parts, else a long run would need twice the memory
    return arrays
