"""Reading back what a run has recorded: run.json of one folder, and the results beside it."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Iterator
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import ResultsError
from ..files import read_bytes, reads
from ..wording import listed
from .folder import settle
from .formats import FILES, RESULTS_FILE, RUN_FILE, Table, reader_of

RECORD = 100_000_000
"""Bytes of run.json. Chosen: a thousand times what one of ours has."""

__all__ = ["RESULTS_FILE", "RUN_FILE", "Results", "load_results"]


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

    @property
    def file(self) -> Path:
        """The file that the columns come from."""
        return self.folder / str(self.run.get("results", RESULTS_FILE))

    @property
    def ended(self) -> str | None:
        """Why a unit ended the run before its stop time, None if none did."""
        ended = self.run.get("ended")
        return str(ended.get("message")) if isinstance(ended, dict) else None

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

        Args:
            variable: name of a variable; a full name `unit.variable` is given back as it is.
            role: only units of this role ("plant", "controller", ...): units whose FMU's name
                begins with `<role>_`, else the unit that is called so.

        Raises:
            ResultsError: no such column, or more than one.
        """
        if role is None and variable in self.columns:
            return variable
        found = [name for name in self.columns if name.partition(".")[2] == variable]
        if role is not None:
            units = self.units_of_role(role)
            found = [name for name in found if name.partition(".")[0] in units]
        if len(found) == 1:
            return found[0]
        if not found:
            raise ResultsError(self._unknown(variable, role))
        raise ResultsError(
            f"{self.file}: '{variable}' was recorded of more than one unit: {', '.join(found)}."
        )

    def units_of_role(self, role: str) -> list[str]:
        """Return the names of the scenario's units that have the role, in evaluation order."""
        fmus: dict[str, dict[str, Any]] = self.run.get("fmus", {})
        found = [unit for unit, fmu in fmus.items() if str(fmu.get("name", "")).startswith(role + "_")]
        return found or [unit for unit in fmus if unit == role]

    def _unknown(self, variable: str, role: str | None = None) -> str:
        of = f" of a {role}" if role else ""
        short = {name.partition(".")[2]: name for name in self.columns}
        close = get_close_matches(variable, [*self.columns, *short], n=1)
        hint = f"; did you mean '{close[0]}'?" if close else f"; recorded: {', '.join(self.columns)}."
        return f"{self.file}: no column '{variable}'{of} was recorded{hint}"


@reads("recorded run", ResultsError)
def load_results(folder: Path | str) -> Results:
    """Read the results of one run; those of a failed run too, as far as they go.

    Raises:
        ResultsError: a file is missing, unreadable, cut off or not what `yawbench run` writes.
    """
    folder = Path(folder)
    settle(folder)
    run_file = folder / RUN_FILE
    try:
        run = json.loads(read_bytes(run_file, largest=RECORD).decode())
    except FileNotFoundError:
        raise ResultsError(
            f"{folder}: no results here, {RUN_FILE} is missing; "
            f"make them with 'yawbench run SCENARIO --out {folder}'."
        ) from None
    except NotADirectoryError:
        holds = f", {folder.parent}" if folder.name in (RUN_FILE, *FILES.values()) else ""
        raise ResultsError(f"{folder}: is a file; name the folder that holds the results{holds}.") from None
    except OSError as error:
        raise ResultsError(f"{run_file}: cannot be read: {error.strerror or error}.") from None
    except ValueError as error:
        raise ResultsError(f"{run_file}: cannot be read: {error}") from None
    if not isinstance(run, dict):
        raise ResultsError(f"{run_file}: is not the record of a run.")
    file = str(run.get("results", RESULTS_FILE))
    path, reader = folder / file, reader_of(file)
    if reader is None:
        known = listed(FILES.values(), last="or")
        raise ResultsError(f"{run_file}: names {file!r} as the file of results; it must be {known}.")
    try:
        columns = reader(path)
    except FileNotFoundError:
        raise ResultsError(f"{path}: is missing, though {RUN_FILE} is there.") from None
    except (OSError, ValueError) as error:
        raise ResultsError(f"{path}: cannot be read: {error}") from None
    if next(iter(columns), "") != "time":
        raise ResultsError(f"{path}: the first column must be 'time'.")
    rows = columns["time"].size
    if run.get("status") == "completed" and rows < run.get("rows", 0):
        raise ResultsError(f"{path}: holds {rows} of the {run['rows']} rows of its run; run it again.")
    units = {name: str(run.get("units", {}).get(name) or "") for name in columns}
    return Results(folder, columns.pop("time"), columns, units, run)


def read_csv(path: Path) -> Table:
    """Return the columns of a CSV file.

    Raises:
        OSError, ValueError: it cannot be read.
    """
    with path.open(encoding="utf-8", newline="") as stream:
        names = next(csv.reader(stream), [])
    if names[:1] != ["time"]:
        return {name: np.empty(0) for name in names}
    return dict(zip(names, _read_columns(path, len(names)), strict=True))


def _read_columns(path: Path, n: int) -> list[np.ndarray]:
    """Return the columns below the header: float64, or str where a column holds text."""
    with path.open(encoding="utf-8", newline="") as stream:
        next(stream)
        rest = stream.read()
    if not rest:
        return [np.empty(0) for _ in range(n)]
    try:
        table = np.loadtxt(rest.splitlines(), delimiter=",", ndmin=2)
        if table.shape[1] != n:
            raise ValueError(f"{table.shape[1]} values in a row for {n} columns")
        return list(np.ascontiguousarray(table.T))
    except ValueError:
        rows = list(csv.reader(io.StringIO(rest, newline="")))
    uneven = [i for i, row in enumerate(rows, start=2) if len(row) != n]
    if uneven:
        raise ValueError(f"line {uneven[0]} has {len(rows[uneven[0] - 2])} values for {n} columns")
    return [_column(text) for text in zip(*rows, strict=True)]


def _column(text: tuple[str, ...]) -> np.ndarray:
    try:
        return np.array([float(item) for item in text])
    except ValueError:
        return np.array(text)
