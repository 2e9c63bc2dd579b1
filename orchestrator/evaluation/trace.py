"""Signals that a test is evaluated over, recorded or measured: by their names, in SI, over one time.

A trace of a run here finds its signals by their names in the vocabulary. Of a measurement a mapping says
which column is which:

    time: {column: Zeit, unit: ms}            # a number with its own unit, if the header names none
    signals:
      steering_wheel_angle: {column: LRW, unit: deg, sign: -1}     # -1: positive to the right there
      yaw_rate: Gierrate                      # the header names the unit: "Gierrate [deg/s]"
    mass: 1650 kg
"""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BeforeValidator, Field

from vocabulary.signals import SIGNALS

from ..errors import ResultsError, ScenarioError
from ..files import reads
from ..metrics.run_metrics import columns_of
from ..metrics.symbols import si_of
from ..results.read import Results, load_results
from ..scenario import yaml_lines
from ..scenario.measurement_units import conversion, measure_of
from ..scenario.quantities import convert
from ..scenario.strict import Strict, validate
from ..titles import changes_in, with_changes
from ..wiring.series_file import SeriesFile
from ..wording import hint
from .filters import even_grid, resample


@dataclass(frozen=True)
class Trace:
    """What was recorded or measured in one run."""

    label: str
    time: np.ndarray  # shape (rows,) [s], increasing
    signals: dict[str, np.ndarray]  # name in the vocabulary -> shape (rows,), in SI
    mass: float | None = None  # of the car [kg]
    friction: float | None = None  # of the road, the lowest
    facts: dict[str, Any] = field(default_factory=dict)  # other parameters of the run: name -> value
    folder: Path | None = None  # where it lies
    title: str = ""

    def __contains__(self, name: object) -> bool:
        return name in self.signals

    def __getitem__(self, name: str) -> np.ndarray:
        """Return a signal, shape (rows,).

        Raises:
            ResultsError: it is not there.
        """
        if name not in self.signals:
            have = ", ".join(self.signals) or "nothing"
            raise ResultsError(f"{self.label}: has no signal {name!r}, which this test needs; it has {have}")
        return self.signals[name]

    @cached_property
    def even(self) -> Trace:
        """The same sampled evenly, itself if it is."""
        grid = even_grid(self.time)
        signals = {name: resample(grid, self.time, x) for name, x in self.signals.items()}
        return Trace(self.label, grid, signals, self.mass, self.friction, self.facts, self.folder, self.title)

    @property
    def rate(self) -> float:
        """Sampling rate, the median [Hz]."""
        return 1.0 / float(np.median(np.diff(self.time)))


def trace_of(results: Results, label: str = "", mass: float | None = None) -> Trace:
    """Return what a run has recorded of the vocabulary; mass and friction as its units were told."""
    signals = {}
    for name in SIGNALS:
        if "*" in name:
            continue
        found = columns_of(results, name)
        if found:
            signals[name] = results.columns[found[0]] * si_of(results.units[found[0]])[1]
    own = Counter(column.partition(".")[2] for column in results)
    for column, values in results.columns.items():  # what only one unit has, such as overruns of cones
        name = column.partition(".")[2]
        if name not in signals and own[name] == 1 and np.issubdtype(values.dtype, np.number):
            signals[name] = values
    fmus = results.run.get("fmus", {})
    facts = {name: value for fmu in fmus.values() for name, value in _parameters(fmu).items()}
    for role in ("driver", "plant"):  # of the test and of the car they know best
        for unit in results.units_of_role(role):
            facts |= _parameters(fmus.get(unit))
    mass = mass if mass is not None else _of_plant(results, "mass")
    return Trace(
        label or str(results.folder),
        results.time,
        signals,
        mass,
        _friction(results),
        facts,
        results.folder,
        with_changes(str(results.run.get("title") or ""), changes_in(results.run)),
    )


def _parameters(fmu: Any) -> dict[str, Any]:
    return {**fmu.get("defaults", {}), **fmu.get("parameters", {})} if isinstance(fmu, dict) else {}


def _constants(fmu: Any) -> Iterator[tuple[str, float]]:
    given = fmu.get("constants", {}) if isinstance(fmu, dict) else {}
    return ((name, value) for name, value in given.items() if isinstance(value, (int, float)))


def _friction(results: Results) -> float | None:
    """Return the lowest friction that any wheel met: as recorded, else as roads or tyres were told."""
    if columns := columns_of(results, "friction_*"):
        return float(min(results.columns[column].min() for column in columns))
    fmus = results.run.get("fmus", {})
    roads = (_parameters(fmus.get(unit)).get("base_friction") for unit in results.units_of_role("road"))
    told = [float(value) for value in roads if isinstance(value, (int, float))]
    told += [
        value for fmu in fmus.values() for name, value in _constants(fmu) if name.startswith("friction_")
    ]
    return min(told, default=None)


def _of_plant(results: Results, name: str) -> float | None:
    fmus = results.run.get("fmus", {})
    for unit in results.units_of_role("plant"):
        value = _parameters(fmus.get(unit)).get(name)
        if isinstance(value, (int, float)):
            return float(value)
    return None


class ColumnSpec(Strict):
    """Where a signal stands in a file."""

    column: str = Field(min_length=1, description="Its header, without the unit")
    unit: str | None = Field(None, description="Of its numbers; left out: as the header says")
    sign: Literal[1, -1] = Field(1, description="-1: positive where ISO 8855 is negative")


def _column(value: object) -> object:
    return {"column": value} if isinstance(value, str) else value


AnyColumn = Annotated[ColumnSpec, BeforeValidator(_column)]


class MappingSpec(Strict):
    """Which columns of a measurement are which signals."""

    time: AnyColumn = Field(ColumnSpec(column="time", unit=None, sign=1), description="Column of times")
    signals: dict[str, AnyColumn] = Field(min_length=1, description="Signal -> column")
    mass: str | None = Field(None, description="Of the car, with its unit")
    friction: float | None = Field(None, gt=0, description="Of the road")


@reads("mapping of signals", ScenarioError)
def load_mapping(path: Path | str) -> MappingSpec:
    """Read a mapping of signals.

    Raises:
        ScenarioError: with everything that is wrong with it.
    """
    document = yaml_lines.read(Path(path), what="mapping of signals")
    spec = validate(MappingSpec, document)
    if spec is not None:
        for name in spec.signals:
            if name not in SIGNALS or "*" in name:
                known = [one for one in SIGNALS if "*" not in one]
                document.report(("signals", name), f"{name!r} is no signal{hint(name, known, lead='known')}")
        for key, column in (("time", spec.time), *((f"signals.{n}", c) for n, c in spec.signals.items())):
            if column.unit is not None and measure_of(column.unit) is None:
                document.report(tuple(key.split(".")), f"{column.unit!r} is not a unit")
        if spec.mass is not None:
            try:
                convert(spec.mass, "kg")
            except ValueError as error:
                document.report(("mass",), str(error))
    if spec is None or document.problems:
        raise ScenarioError(document.sentences())
    return spec


def measured(path: Path, mapping: MappingSpec, label: str = "") -> Trace:
    """Return what a file of measured columns holds, CSV, Parquet or ASAM MDF 4.

    Raises:
        ResultsError: it cannot be read, lacks a column, or a unit does not fit.
    """
    with _sentences(path):
        file = SeriesFile(path)
        signals, clock = {}, None
        for name, spec in mapping.signals.items():
            column = file.column(spec.column, mapping.time.column)
            times = _si(column.times, mapping.time.unit or column.time_unit, "s", "time")
            if clock is None:
                clock = times
                if len(clock) < 2 or not np.all(np.diff(clock) > 0):
                    raise ValueError("times must increase from row to row")
            values = _si(column.values, spec.unit or column.unit, SIGNALS[name].unit, spec.column)
            if times is not clock and (times.shape != clock.shape or np.any(times != clock)):
                values = np.interp(clock, times, values)  # channels of MDF have clocks of their own
            signals[name] = spec.sign * values
    assert clock is not None
    mass = None if mapping.mass is None else float(convert(mapping.mass, "kg"))
    return Trace(label or path.name, clock, signals, mass, mapping.friction, {}, None, path.stem)


@contextmanager
def _sentences(path: Path) -> Iterator[None]:
    try:
        yield
    except ValueError as error:
        raise ResultsError(f"{path}: {error}") from None
    except OSError as error:
        raise ResultsError(f"{path}: cannot be read: {error.strerror or error}") from None


def _si(values: np.ndarray, unit: str | None, wanted: str, name: str) -> np.ndarray:
    """Return a column in the unit that is wanted; without a unit it is in that already."""
    try:
        numbers = values.astype(float)
    except (TypeError, ValueError):
        raise ValueError(f"column {name!r} holds what is no number") from None
    if not np.all(np.isfinite(numbers)):
        raise ValueError(f"column {name!r}: value {int(np.argmin(np.isfinite(numbers))) + 1} is not finite")
    if unit is None or unit == wanted:
        return numbers
    source, target = measure_of(unit), measure_of(wanted)
    factors = conversion(source, target) if source and target else None
    if factors is None:
        raise ValueError(f"column {name!r}: its unit {unit!r} does not fit: {wanted} is wanted")
    return factors[0] * numbers + factors[1]


def load_trace(path: Path, mapping: MappingSpec | None, label: str = "") -> Trace:
    """Return what a folder of results or a file of measured columns holds.

    Raises:
        ResultsError: it cannot be read, or is a file and no mapping is given.
    """
    if os.path.isdir(path):
        return trace_of(load_results(path), label)
    if mapping is None:
        raise ResultsError(
            f"{path}: is no folder of results; of a file of columns --signals says what is what"
        )
    return measured(path, mapping, label)
