"""Reading back what a run has recorded: run.json of one folder, and the results beside it.

The runs whose results stand below a folder.

Long results thinned while they are read, for drawings in which every peak stays.

Of each stretch of rows those are kept in which a column, or a signal's distance from its reference, is
smallest or largest, and the first and last. The rows are kept whole: values of one moment stay together.
"""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from ..checksums import checksum
from ..errors import ResultsError
from ..files import check_regular, reads, reason
from ..messages import fold, listed, short
from ..scenario.quantities import conversion, measure_of
from .folder import COMPLETED, DIED, PART, RUN_FILE, RUNNING, is_dead, unfinished
from .formats import FILES, RESULTS_FILE, source_of
from .run_record import ConnectionRecord, RunRecord, check_record, load_record, warn_if_unchecked

UNREADABLE = "unreadable"
"""Status of a run whose record cannot be read, or is not as it was written."""


@dataclass(frozen=True)
class FoundRun:
    """A run by its folder and its record."""

    folder: Path
    status: str  # "completed", "failed", "interrupted", "running", "died", or UNREADABLE
    record: dict[str, Any]
    problem: str = ""  # why it has no results, or none to the end


def found_runs(folder: Path) -> list[FoundRun]:
    """Return all runs in and below a folder, the earliest first.

    Raises:
        ResultsError: there is no such folder, or no run in it.
    """
    if not folder.is_dir():
        raise ResultsError(f"{folder}: there is no such folder; name one that holds results")
    found = [run for place in _folders(folder) for run in _runs_in(place)]
    if not found:
        raise ResultsError(f"{folder}: holds no results; make some with 'yawbench run SCENARIO'")
    return sorted(found, key=lambda run: (str(run.record.get("started") or ""), run.folder))


def _folders(folder: Path) -> Iterator[Path]:
    for place, below, files in os.walk(folder):
        below.sort()
        if not {RUN_FILE, f"{RUN_FILE}{PART}"}.isdisjoint(files):
            yield Path(place)


def _runs_in(folder: Path) -> Iterator[FoundRun]:
    """Yield the run whose results stand in a folder, and the one that goes on or has died there."""
    going = unfinished(folder)
    if going is not None:
        dead = is_dead(folder)
        try:
            record = check_record(going, folder / f"{RUN_FILE}{PART}")
        except ResultsError:  # of a run that has died, perhaps before it had written its record
            record = {}
        yield FoundRun(folder, DIED if dead else RUNNING, record, "it ended without a word" if dead else "")
    if going is not None and not os.path.lexists(folder / RUN_FILE):
        return
    try:
        record = load_record(folder, settled=going is not None)
        warn_if_unchecked(record, folder)
    except ResultsError as error:
        yield FoundRun(folder, UNREADABLE, {}, str(error))
        return
    problem = str((record.get("error") or {}).get("message") or "")
    yield FoundRun(folder, str(record.get("status") or ""), record, problem)


LONG = 200_000
"""Rows from which on results are thinned; chosen: ten times those of the papers' longest run."""
STRETCHES = 1500
"""Stretches that a run is divided into: as many as a line drawn over the width of a page has points."""


def thinned(
    blocks: Iterator[list[np.ndarray]], columns: Sequence[str], rows: int
) -> Iterator[list[np.ndarray]]:
    """Yield the blocks of rows without those that a drawing can do without.

    Args:
        blocks: arrays of equal length, one for each column.
        columns: their names.
        rows: in all blocks, as far as is known; short results are left as they are.
    """
    if rows < LONG:
        yield from blocks
        return
    length = -(-rows // STRETCHES)
    place = {name: i for i, name in enumerate(columns)}
    errors = [(i, place[r]) for name, i in place.items() if (r := _reference(name, columns)) is not None]
    for block in blocks:
        numbers = [i for i, column in enumerate(block) if column.dtype.kind == "f"]
        distances = [block[i] - block[k] for i, k in errors if i in numbers and k in numbers]
        seen = np.vstack([*(block[i] for i in numbers), *distances])
        kept = np.zeros(len(block[0]), dtype=bool)
        for begin in range(0, len(kept), length):
            part = seen[:, begin : begin + length]
            gaps = np.isnan(part)
            kept[begin + np.where(gaps, np.inf, part).argmin(axis=1)] = True
            kept[begin + np.where(gaps, -np.inf, part).argmax(axis=1)] = True
            kept[begin + gaps.argmax(axis=1)] = True  # the first gap, else the first row
            kept[begin + part.shape[1] - 1] = True
        yield [column[kept] for column in block]


def _reference(name: str, columns: Sequence[str]) -> str | None:
    """Return the only column that holds the reference of a signal."""
    found = [other for other in columns if other.partition(".")[2] == f"{name.partition('.')[2]}_ref"]
    return found[0] if len(found) == 1 and name.partition(".")[2] else None


@dataclass(frozen=True)
class Results:
    """The recorded values of one run.

    `results["plant.yaw_rate"]` is a column by its full name; `results.find("yaw_rate")` is the only
    recorded variable of that name, whatever its unit is called in the scenario.
    """

    folder: Path
    time: np.ndarray  # shape (rows,) [s]
    columns: dict[str, np.ndarray]  # "<unit>.<variable>" -> shape (rows,)
    units: dict[str, str]  # "time" and "<unit>.<variable>" -> measurement unit; "" if it has none
    run: dict[str, Any]  # run.json

    @cached_property
    def record(self) -> RunRecord:
        """What `run` holds, typed; as it was when this was first asked for."""
        return RunRecord.model_validate(self.run)

    @property
    def file(self) -> Path:
        """The file that the columns come from."""
        return self.folder / self.record.results

    @property
    def where(self) -> str:
        """What a message calls them: by their file, or if they are in memory alone by their title."""
        return str(self.file) if self.folder != Path() else self.record.title or "this run"

    @property
    def ended(self) -> str | None:
        """Why a unit ended the run before its stop time, None if none did."""
        ended = self.record.ended
        return ended.message if ended else None

    def __getitem__(self, column: str) -> np.ndarray:
        try:
            return self.columns[column]
        except KeyError:
            raise ResultsError(self._unknown(column)) from None

    def __contains__(self, column: object) -> bool:
        return column in self.columns

    def __iter__(self) -> Iterator[str]:
        return iter(self.columns)

    def find(self, variable: str, *, role: str | None = None) -> np.ndarray:
        """Return the values of the only recorded variable of that name (see `column`)."""
        return self.columns[self.column(variable, role=role)]

    def column(self, variable: str, *, role: str | None = None) -> str:
        """Return the column's full name for a variable, whatever its unit is called.

        Where no unit has an output of that name, it is the output that feeds inputs of that name: the
        `Mz` of an FMU from elsewhere, connected to `plant.yaw_moment`, is the yaw moment.

        Args:
            variable: name of a variable; a full name `unit.variable` is given back as it is.
            role: only units of this role ("plant", "controller", ...): units whose FMU's name
                begins with `<role>_`, else the unit that is called so.

        Raises:
            ResultsError: no such column, or more than one.
        """
        found = self.candidates(variable, role=role)
        if len(found) == 1:
            return found[0]
        if not found:
            raise ResultsError(self._unknown(variable, role))
        raise ResultsError(
            f"{self.where}: '{variable}' was recorded of more than one unit: {', '.join(found)}."
        )

    def candidates(self, variable: str, *, role: str | None = None) -> list[str]:
        """Return the columns that a variable may stand for (see `column`): none, one or several."""
        if role is None and variable in self.columns:
            return [variable]
        found = [name for name in self.columns if name.partition(".")[2] == variable]
        if role is not None:
            units = self.units_of_role(role)
            found = [name for name in found if name.partition(".")[0] in units]
        return found if found or role is not None else self._feeding(variable)

    def _feeding(self, variable: str) -> list[str]:
        """Return the columns that feed inputs of a name as they are, but for the unit of measurement."""
        feeding = [
            wire.source
            for wire in self.record.connections
            if wire.target.partition(".")[2] == variable and _is_the_same(wire, self.units.get(wire.source))
        ]
        return [column for column in dict.fromkeys(feeding) if column in self.columns]

    def units_of_role(self, role: str) -> list[str]:
        """Return the names of the scenario's units that have the role, in evaluation order."""
        fmus = self.record.fmus
        found = [unit for unit, fmu in fmus.items() if fmu.name.startswith(role + "_")]
        return found or [unit for unit in fmus if unit == role]

    def _unknown(self, variable: str, role: str | None = None) -> str:
        of = f" of a {role}" if role else ""
        short = {name.partition(".")[2]: name for name in self.columns}
        close = get_close_matches(variable, [*self.columns, *short], n=1)
        hint = f"; did you mean '{close[0]}'?" if close else f"; recorded: {', '.join(fold([*self]))}."
        return f"{self.where}: no column '{variable}'{of} was recorded{hint}"


def _is_the_same(wire: ConnectionRecord, unit: str | None) -> bool:
    """Return whether a wire hands on what the output of this unit says: at most in another unit."""
    if wire.gain is None:
        return True
    one, other = measure_of(unit), measure_of(str(wire.unit))
    factors = conversion(one, other) if one and other else None
    return factors is not None and np.allclose(factors, (wire.gain, wire.offset))


@reads("recorded run", ResultsError)
def load_results(
    folder: Path | str,
    *,
    only: Callable[[Results], Iterable[str]] | None = None,
    thin: bool = False,
) -> Results:
    """Read the results of one run; those of a failed run too, as far as they go.

    Args:
        folder: of the results.
        only: returns which columns are read, given results without rows; default: all.
        thin: leave out rows that a drawing of a long run can do without (see `thinning`).

    Raises:
        ResultsError: a file is missing, unreadable, cut off, changed or not what `yawbench run` writes, or
            the last run in the folder has died.
    """
    folder = Path(folder)
    run = load_record(folder)
    warn_if_unchecked(run, folder)
    name = str(run.get("results", RESULTS_FILE))
    if name not in FILES.values():
        known = listed(FILES.values(), last="or")
        raise ResultsError(f"{folder / RUN_FILE}: names {name!r} as the file of results; it must be {known}.")
    path = folder / name
    try:
        check_regular(path)
        file = source_of(path, run.get("texts"))
        _check_names(file.names)
        _check_checksum(path, run)
        empty = _empty(folder, file.names, run)
        columns = list(dict.fromkeys(only(empty))) if only else file.names[1:]
        blocks = _in_order(file.blocks(["time", *columns]))
        if thin:
            blocks = thinned(blocks, ["time", *columns], run.get("rows", 0))
        time, *values = _joined(blocks, 1 + len(columns))
    except FileNotFoundError:
        raise ResultsError(f"{path}: is missing, though {RUN_FILE} is there.") from None
    except (OSError, ValueError) as error:
        raise ResultsError(f"{path}: cannot be read: {reason(error)}") from None
    if run.get("status") == COMPLETED and not thin and time.size < run.get("rows", 0):
        raise ResultsError(f"{path}: holds {time.size} of the {run['rows']} rows of its run; run it again.")
    return Results(folder, time, dict(zip(columns, values, strict=True)), empty.units, run)


def _check_names(names: Sequence[str]) -> None:
    if names[:1] != ["time"]:
        raise ValueError("the first column must be 'time'")
    twice = [name for name, count in Counter(names).items() if count > 1]
    if twice:
        raise ValueError(f"more than one column is called {short(twice[0])}")


def _empty(folder: Path, names: Sequence[str], run: dict[str, Any]) -> Results:
    """Return the results of a run without rows."""
    units = {name: str(run.get("units", {}).get(name) or "") for name in names}
    return Results(folder, np.empty(0), {name: np.empty(0) for name in names[1:]}, units, run)


def _check_checksum(path: Path, run: dict[str, Any]) -> None:
    """Make sure that a file of results is the one that its run wrote, as far as the record can tell.

    Raises:
        ValueError: it is another, or cut off.
    """
    known = run.get("checksum")
    if not known:
        return
    if known != checksum(path):
        raise ValueError(
            f"it is not what its run has written (its checksum in {RUN_FILE} is another); run it again, or "
            f"remove the checksum if you have changed the file yourself"
        )


def _in_order(blocks: Iterator[list[np.ndarray]]) -> Iterator[list[np.ndarray]]:
    """Yield the blocks after making sure that time goes on from row to row."""
    last, row = -np.inf, 0
    for block in blocks:
        time = block[0]
        if time.dtype.kind != "f":
            raise ValueError(f"row {row + 1}: time {short(str(time[0]))} is no number")
        wrong = np.flatnonzero(~(np.diff(time, prepend=last) > 0))
        if wrong.size:
            at = int(wrong[0])
            before = time[at - 1] if at else last
            raise ValueError(f"row {row + at + 1}: time {time[at]:.9g} s does not follow {before:.9g} s")
        last, row = time[-1] if time.size else last, row + time.size
        yield block


def _joined(blocks: Iterable[list[np.ndarray]], columns: int) -> list[np.ndarray]:
    """Return the columns of all blocks."""
    parts = list(blocks)
    found = []
    for k in range(columns):
        found.append(np.concatenate([part[k] for part in parts]) if parts else np.empty(0))
        for part in parts:
            part[k] = np.empty(0)  # a long run would need twice the memory
    return found
