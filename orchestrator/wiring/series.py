"""Time series for inputs: in the unit and type of the input, and complete for the run."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import ScenarioError
from ..files import reading
from ..plan import Series, Value, Variable
from ..scenario.load import Scenario
from ..scenario.measurement_units import Measure, measure_of
from ..scenario.quantities import gain_and_offset
from ..scenario.scenario_schema import SeriesSpec
from .parameters import value_for
from .series_file import SeriesFile

Reader = Callable[[SeriesSpec, str, Variable], Series]
"""Gives an input what a specification says, for what the `*` of its key stands for ("" without one)."""

SECOND = measure_of("s")


def series_reader(scenario: Scenario) -> Reader:
    """Return what reads the time series of a scenario, every file once.

    It raises ValueError with a sentence: the file or a column is missing or no use, the unit does not
    fit, the times do not cover the run.
    """

    @cache
    def opened(file: str) -> SeriesFile:
        path = Path(os.path.normpath(scenario.path.parent / file))
        with reading_series(path):
            return SeriesFile(path)

    def read(spec: SeriesSpec, part: str, variable: Variable) -> Series:
        file = opened(spec.file)
        name = (spec.column or variable.name).replace("*", part)
        with reading_series(spec.file):
            column = file.column(name, spec.time)
            times = numbers_in(column.times, column.time_unit, SECOND, "s", f"time {spec.time!r}")
            values = _values(column.values, column.unit, name, variable)
            _check_times(times, scenario, spec)
        held = spec.interpolation == "held" or variable.type != "Real"
        return Series(spec.file, name, file.sha256, held, times, values)

    return read


@contextlib.contextmanager
def reading_series(path: Path | str) -> Iterator[None]:
    """As `files.reading` a file of time series, with ValueError for every sentence."""
    try:
        with reading("file of time series", path, ScenarioError):
            try:
                yield
            except ValueError as error:
                raise ScenarioError(f"{path}: {error}") from None
    except ScenarioError as error:
        raise ValueError(error.problems[0]) from error.__cause__


def numbers_in(
    column: np.ndarray, unit: str | None, wanted: Measure | None, says: str, what: str
) -> np.ndarray:
    """Return a column as finite numbers in the unit that is wanted; without one of its own it is in that.

    Args:
        column: numbers or text.
        unit: of the column.
        wanted, says: the unit that is wanted, and in words.
        what: the column is, for sentences.

    Raises:
        ValueError: a sentence.
    """
    numbers = _numbers(column, what)
    if unit is None or wanted is None:
        return numbers
    between = gain_and_offset(unit, wanted)
    if between is None:
        raise ValueError(f"{what}: its unit {unit!r} does not fit: {says} is wanted")
    gain, offset = between
    return numbers if between == (1.0, 0.0) else gain * numbers + offset


def _numbers(column: np.ndarray, what: str) -> np.ndarray:
    """Return a column as finite numbers."""
    try:
        numbers = column.astype(float)
    except (TypeError, ValueError):
        for row, cell in enumerate(column, start=1):
            try:
                float(cell)
            except (TypeError, ValueError):  # noqa: PERF203 - it is the first
                raise ValueError(f"{what}: value {row} is no number ({cell!r})") from None
        raise
    bad = np.flatnonzero(~np.isfinite(numbers))
    if bad.size:
        raise ValueError(f"{what}: value {bad[0] + 1} is not finite ({numbers[bad[0]]:g})")
    return numbers


def _values(column: np.ndarray, unit: str | None, name: str, variable: Variable) -> np.ndarray:
    """Return a column's values as the variable takes them."""
    if variable.type == "Real":
        wanted = measure_of(variable.unit, variable.definition)
        numbers = numbers_in(column, unit, wanted, variable.unit or "none", f"column {name!r}")
        for extreme in (numbers.min(), numbers.max()):
            value_for(variable, float(extreme))
        return numbers
    taken = np.empty(len(column), dtype=object)
    for i, cell in enumerate(column.tolist()):
        try:
            taken[i] = value_for(variable, _plain(cell, variable))
        except ValueError as error:  # noqa: PERF203 - the first is told
            raise ValueError(f"column {name!r}: value {i + 1} {error}") from None
    return taken


def _plain(cell: Any, variable: Variable) -> Value:
    """Return a cell as a scenario would say it: files know no whole numbers, and truth as 1."""
    if variable.type == "Boolean" and cell in (0, 1):
        return bool(cell)
    return int(cell) if isinstance(cell, float) and cell.is_integer() else cell


def _check_times(times: np.ndarray, scenario: Scenario, spec: SeriesSpec) -> None:
    back = np.flatnonzero(np.diff(times) <= 0)
    if back.size:
        at = int(back[0]) + 1
        raise ValueError(f"time must increase: {times[at]:g} s follows {times[at - 1]:g} s (value {at + 1})")
    if spec.extrapolate == "hold":
        return
    start, stop = float(scenario.start_time), float(scenario.stop_time)
    slack = 1e-9 * max(abs(start), abs(stop))
    last = float(times[-1])
    if spec.interpolation == "held" and len(times) > 1:
        last += float(times[-1] - times[-2])  # its last value holds as long as the one before
    if times[0] > start + slack or last < stop - slack:
        raise ValueError(
            f"covers {times[0]:g} to {times[-1]:g} s of a run from {start:g} to {stop:g} s; "
            "'extrapolate: hold' would hold its ends"
        )
