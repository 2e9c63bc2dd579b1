"""Measurements: recordings of a car, described by a file `measured.yaml`, as signals in SI.

    files: [run01.csv, run02.mf4]
    segments: {by: Lap}                  # where time restarts; `by: time`: at restarts; `by: gaps`: at gaps
    time: {column: Time, unit: ms}
    signals:
      steering_wheel_angle: {column: SWA, unit: deg, sign: -1, delay: 20 ms, spikes: 2 deg}
      yaw_rate: {column: Gyro, unit: deg/s, noise: 0.1 deg/s}
      acceleration_y: {column: Ay, unit: g, at: {x: 0.2 m, z: 0.4 m}}
      velocity_x: Speed                  # the header states the unit: "Speed [km/h]"
    filter: {low_pass: 6 Hz, order: 12, phaseless: true}
    vehicle: {mass: 1650 kg, wheelbase: 2.7 m, steering_ratio: 15.7, friction: 0.95}
    car: Saloon, 2 occupants
    source: own recording, airfield
    licence: CC-BY-4.0
    date: 2024-05-17

No unit is assumed: a column has one here, in its header, in a row of units below the header or in the file's
own description, unless its signal is a plain number. The value of a signal is

    sign gain (column - offset)    at the time of its row, less its delay

with spikes (values that differ from the median of seven by more than `spikes`) replaced by interpolation. A
cell without a value is a sample that was not taken. All signals of a segment are then interpolated, by a
monotone cubic, to the times of the one with most samples in the span that they share (`common_times`), moved
from the position of its sensor (`at`: relative to the centre of mass, ISO 8855) to the centre of mass of the
rigid body, with angular rates p, q, r as far as they are recorded, and filtered.

The filter is the Butterworth low pass of GTR 8 by default, which has no phase: half of its poles forward and
half of them backward, so that amplitudes at the cut-off frequency are halved.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import AfterValidator, BeforeValidator, Field, WithJsonSchema

from yawbench.foundation.errors import Diagnostic, InvalidValueError, Location, ScenarioError, code_of
from yawbench.foundation.messages import counted, hint, listed, short, span
from yawbench.foundation.safe_files import reads
from yawbench.orchestrator.recordings.clocks import PACKED, UNIX, holds_times, seconds_of
from yawbench.orchestrator.recordings.gaps import Gap, Samples, between_gaps, gaps_in, notes_on
from yawbench.orchestrator.recordings.recording_formats import (
    ColumnFile,
    FileColumn,
    numbers_in,
    reading_series,
    unit_of,
)
from yawbench.orchestrator.recordings.units_of_loggers import how_to_give, unit_in_file
from yawbench.orchestrator.scenario import yaml_lines
from yawbench.orchestrator.scenario.quantities import convert, meant_unit, measure_of
from yawbench.orchestrator.scenario.schema_validation import (
    StrictModel,
    quantities_in,
    text_in_unit,
    validate,
)
from yawbench.orchestrator.scenario.yaml_lines import Document, KeyPath
from yawbench.vocabulary.signals import SIGNALS, SignalEntry
from yawbench.vocabulary.vehicle import CAR
from yawbench.vocabulary.wheels import wheels

from .segment import (
    MOVED,
    POLES,
    LowPass,
    Segment,
    common_times,
    parts_of,
    resample,
    to_centre_of_mass,
    without_spikes,
)

MEASURABLE: dict[str, SignalEntry] = {name: entry for key, entry in SIGNALS.items() for name in wheels(key)}
"""Signals that a measurement may have, those of wheels one by one."""
BY_TIME = "time"
BY_GAPS = "gaps"
OF_CAR = {name: entry.unit for name, entry in CAR.items()} | {"friction": "1"}
"""Known quantities of a car and its road, with their units."""
OF_TEST = {"action_time": "s"}
"""Values that tests need beside signals and vehicle, with their units."""
SHARE_OF_SPIKES = 0.01
"""Share of samples that may exceed the largest plausible value; chosen: accelerometers have spikes."""


def _unit(text: str) -> str:
    if unit_in_file(text) is None:
        raise ValueError(f"unknown unit {short(text)}: {how_to_give('a known one')}")
    return text


def _unit_of_time(text: str) -> str:
    return text if text in (PACKED, *UNIX) else _unit(text)


def _signal(name: str) -> str:
    if name not in MEASURABLE:
        raise ValueError(f"unknown signal {name!r}{hint(name, MEASURABLE, lead='known')}")
    return name


def _column(value: object) -> object:
    return {"column": value} if isinstance(value, str) else value


def _quantity(value: object) -> str:
    """Return the text of a number with its unit, which is checked where the signal is known."""
    if not isinstance(value, str):
        raise ValueError(f"must be text with a unit, such as 20 ms (got {value!r})")
    return value


def _text(value: object) -> object:
    return str(value) if isinstance(value, int) and not isinstance(value, bool) else value


MeasurableName = Annotated[
    str, AfterValidator(_signal), WithJsonSchema({"type": "string", "enum": sorted(MEASURABLE)})
]
UnitText = Annotated[str, AfterValidator(_unit)]
UnitOfTime = Annotated[str, AfterValidator(_unit_of_time)]
Quantity = Annotated[str, BeforeValidator(_quantity)]
Length = Annotated[Quantity, WithJsonSchema(text_in_unit("m"))]
Frequency = Annotated[Quantity, WithJsonSchema(text_in_unit("Hz"))]
Duration = Annotated[Quantity, WithJsonSchema(text_in_unit("s"))]
Words = Annotated[str, BeforeValidator(_text, json_schema_input_type=str | int)]


class PositionSpec(StrictModel):
    """The position of a sensor relative to the centre of mass, vehicle axes of ISO 8855."""

    x: Length = Field("0 m", description="m, forward")
    y: Length = Field("0 m", description="m, to the left")
    z: Length = Field("0 m", description="m, up; acts only with a recorded roll_rate")


class SignalSpec(StrictModel):
    """The column of a recording that holds a signal, and how the signal follows from it."""

    column: str = Field(
        description="Its header, without the unit; of several alike 'speed#2', or 'speed#gps' by its source",
        min_length=1,
    )
    unit: UnitText | None = Field(None, description="Unit of its numbers; default: as the file says")
    sign: Literal[1, -1] = Field(1, description="-1: positive where ISO 8855 is negative")
    gain: float = Field(1.0, description="Factor of its numbers", gt=0)
    offset: Quantity | None = Field(None, description="Its value where the signal is zero")
    delay: Duration | None = Field(None, description="Time by which it lags")
    spikes: Quantity | None = Field(None, description="Values this far from the running median are replaced")
    noise: Quantity | None = Field(None, description="Standard deviation of its noise")
    at: PositionSpec | None = Field(None, description="Position of the sensor; default: the centre of mass")


class TimeSpec(StrictModel):
    """The column of times."""

    column: str = Field("time", min_length=1)
    unit: UnitOfTime | None = Field(
        None,
        description=f"Default: as the file says. {PACKED}: packed clock times; {UNIX[0]}: s or ms since 1970",
    )
    repeated: Literal["refuse", "mean"] = Field(
        "refuse", description="Rows with the same time; mean: become a row of their means"
    )


class SegmentsSpec(StrictModel):
    """Segments of a recording, each with increasing time."""

    by: str = Field(
        description="Column that changes from segment to segment; time: where time restarts; gaps: at "
        "stretches without samples"
    )


class FilterSpec(StrictModel):
    """The Butterworth low pass of all signals, measured and simulated."""

    low_pass: Frequency = Field(description="Hz, cut-off frequency")
    order: int = Field(POLES, description="Number of poles, even if phaseless", ge=1, le=24)
    phaseless: bool = Field(True, description="Half of the poles forward, half of them backward in time")


AnySignal = Annotated[SignalSpec, BeforeValidator(_column, json_schema_input_type=str | SignalSpec)]
AnyTime = Annotated[TimeSpec, BeforeValidator(_column, json_schema_input_type=str | TimeSpec)]


class MeasurementSpec(StrictModel):
    """Content of a measurement file."""

    files: list[str] = Field(description="CSV, .vbo, Parquet or MDF, relative to this file", min_length=1)
    header: int | None = Field(
        None, description="Line of the names of columns, from 1; default: it is looked for", ge=1
    )
    decimal: Literal[".", ","] | None = Field(
        None, description="Decimal mark of text files; default: as their numbers show"
    )
    segments: SegmentsSpec | None = Field(None, description="Default: a segment per file")
    time: AnyTime = Field(
        TimeSpec(column="time", unit=None, repeated="refuse"), description="Column of times"
    )
    signals: dict[MeasurableName, AnySignal] = Field(min_length=1)
    filter: FilterSpec | None = None
    vehicle: Annotated[dict[str, float | str], WithJsonSchema(quantities_in(OF_CAR))] = Field(
        {}, description="Known quantities of the car, and friction"
    )
    test: Annotated[dict[str, float | str], WithJsonSchema(quantities_in(OF_TEST))] = Field(
        {}, description=f"What tests need: {listed(OF_TEST)}"
    )
    car: Words = ""
    source: Words = ""
    licence: Words = ""
    date: Words = ""


@dataclass(frozen=True)
class Measurement:
    """Content of a measurement file, `measured.yaml`."""

    path: Path
    segments: tuple[Segment, ...]
    car: str
    source: str
    licence: str
    date: str
    vehicle: Mapping[str, float]  # quantity of the car, or "friction" -> value in SI
    test: Mapping[str, float]  # such as "action_time" -> value in SI
    noise: Mapping[str, float]  # signal -> standard deviation in SI, where it is known
    filter: LowPass | None  # already applied to the segments; for simulated signals
    sha256: str  # of this file and of all that it names
    notes: tuple[Diagnostic, ...] = ()

    @property
    def title(self) -> str:
        """The car and the date, in words."""
        return ", ".join(filter(None, (self.car or self.path.stem, self.date)))

    @property
    def origin(self) -> str:
        """Source and licence, in words."""
        return ", ".join(filter(None, (self.source, self.licence and f"licence: {self.licence}")))

    def column(self, name: str, number: int | None = None) -> FileColumn:
        """Return a signal of a segment as a column (see `segment`).

        Raises:
            ValueError: there is no such signal or segment.
        """
        segment = self.segment(number)
        if name not in segment.signals:
            raise ValueError(f"has no signal {name!r}{hint(name, segment.signals, lead='it has')}")
        return FileColumn(segment.time, segment.signals[name], "s", MEASURABLE[name].unit)

    def gaps(self, name: str, number: int | None = None) -> tuple[Gap, ...]:
        """Return where a signal of a segment has no samples (see `segment`)."""
        return tuple(self.segment(number).gaps.get(name, ()))

    def segment(self, number: int | None = None) -> Segment:
        """Return a segment by its number, counted from 1; None: the only one.

        Raises:
            ValueError: there is no such segment, or more than one to choose from.
        """
        count = len(self.segments)
        if number is None and count > 1:
            raise ValueError(f"has {count} segments: choose one by its number, 1 to {count}")
        if number is not None and not 1 <= number <= count:
            raise ValueError(f"has no segment {number}: write 1 to {count}")
        return self.segments[(number or 1) - 1]


@dataclass(frozen=True)
class _Correction:
    """The numbers of a `SignalSpec`, in SI."""

    offset: float = 0.0
    delay: float = 0.0
    spikes: float = 0.0
    noise: float = 0.0
    at: tuple[float, float, float] = (0.0, 0.0, 0.0)


@reads("measurement file", ScenarioError)
def load_measurement(path: Path | str, *, filtered: bool = True) -> Measurement:
    """Read a measurement.

    Args:
        path: the file that describes it.
        filtered: False: leave out the low pass.

    Raises:
        ScenarioError: it, or a file that it names, cannot be used; lists all errors.
    """
    path = Path(path)
    document = yaml_lines.read(path, what="measurement file")
    spec = validate(MeasurementSpec, document)
    if spec is None:
        raise ScenarioError(document.sorted_errors())
    reader = _Reader(document, spec)
    segments = [segment for number in range(len(spec.files)) for segment in reader.segments_of(number)]
    document.raise_errors()
    if filtered and reader.filter:
        for segment in segments:
            if not reader.filter.cut_off < 0.5 * segment.rate:
                wrong = (
                    f"must be below {0.5 * segment.rate:.4g} Hz, half of the rate of {segment.name}, "
                    f"{segment.rate:.4g} Hz (got {reader.filter.cut_off:g} Hz)"
                )
                document.report(("filter", "low_pass"), wrong)
        document.raise_errors()
        segments = [segment.filtered(reader.filter) for segment in segments]
    digest = hashlib.sha256(path.read_bytes() + "".join(reader.hashes).encode()).hexdigest()
    return Measurement(
        path, tuple(segments), spec.car, spec.source, spec.licence, spec.date, reader.vehicle, reader.test,
        {name: correction.noise for name, correction in reader.corrections.items() if correction.noise},
        reader.filter, digest,
        (*reader.notes, *(note for one in segments for note in notes_on(one.gaps, one.signals, one.name))),
    )  # fmt: skip


class _Reader:
    """Reads the files of a measurement; errors go to its document."""

    def __init__(self, document: Document, spec: MeasurementSpec) -> None:
        self.document, self.spec = document, spec
        self.hashes: list[str] = []
        self.notes: list[Diagnostic] = []
        self.without_times: set[str] = set()  # files of which this was said
        if missing := [key for key in ("car", "source", "licence", "date") if not getattr(spec, key)]:
            words = f"states no {listed(missing, last='and')}; reports show where a recording comes from"
            where = Location(document.path, 1)
            self.notes.append(Diagnostic("measurement-unattributed", words, "info", where))
        self.corrections = {name: self._correction(name, signal) for name, signal in spec.signals.items()}
        self.vehicle = self._values("vehicle", spec.vehicle, OF_CAR)
        self.test = self._values("test", spec.test, OF_TEST)
        self.filter = self._filter()

    def _si(self, key: KeyPath, text: object, unit: str, *, above: float | None = None) -> float:
        try:
            number = float(convert(text, unit)) if isinstance(text, str) else float(Fraction(repr(text)))
            if above is not None and not number > above:
                raise ValueError(f"must be above {above:g} (got {text})")
        except ValueError as error:
            self.document.report(key, str(error), code_of(error))
            return 0.0
        return number

    def _values(
        self, group: str, stated: Mapping[str, float | str], known: Mapping[str, str]
    ) -> dict[str, float]:
        values = {}
        for name, value in stated.items():
            if name not in known:
                unknown = f"unknown quantity{hint(name, known, lead='known')}"
                self.document.report((group, name), unknown, "key-unknown")
            elif not isinstance(value, str) and known[name] != "1":
                wrong = f"must be text with a unit, such as {known[name]} (got {value:g})"
                self.document.report((group, name), wrong)
            else:
                values[name] = self._si((group, name), value, known[name])
        return values

    def _correction(self, name: str, spec: SignalSpec) -> _Correction:
        unit, key = MEASURABLE[name].unit, ("signals", name)
        numbers: dict[str, Any] = {}
        for part, of_it, above in (
            ("offset", unit, None), ("delay", "s", None), ("spikes", unit, 0.0), ("noise", unit, 0.0)
        ):  # fmt: skip
            if (text := getattr(spec, part)) is not None:
                numbers[part] = self._si((*key, part), text, of_it, above=above)
        if spec.at is not None:
            numbers["at"] = tuple(self._si((*key, "at", axis), getattr(spec.at, axis), "m") for axis in "xyz")
            if name not in MOVED:
                what = f"a position matters for {listed(MOVED, last='and')} alone"
                self.document.report((*key, "at"), what)
        return _Correction(**numbers)

    def _filter(self) -> LowPass | None:
        spec = self.spec.filter
        if spec is None:
            return None
        if spec.phaseless and spec.order % 2:
            self.document.report(("filter", "order"), f"must be even if phaseless (got {spec.order})")
        cut_off = self._si(("filter", "low_pass"), spec.low_pass, "Hz", above=0.0)
        return LowPass(cut_off, spec.order, spec.phaseless)

    def segments_of(self, number: int) -> Iterator[Segment]:
        """Yield the segments of a file; nothing if it cannot be used."""
        name, key = self.spec.files[number], ("files", number)
        try:
            path = Path(os.path.normpath(self.document.path.parent / name))
            with reading_series(path):
                asked = [self.spec.time.column, *(signal.column for signal in self.spec.signals.values())]
                file = ColumnFile(path, asked, header=self.spec.header, decimal=self.spec.decimal)
            self.hashes.append(file.sha256)
        except ValueError as error:
            self.document.report(key, str(error), code_of(error, "series-unreadable"))
            return
        for note in file.notes:
            self._note(name, note)
        read = {signal: self._read(file, name, signal) for signal in self.spec.signals}
        labels = self._labels(file, name)
        if self.document.errors:
            return
        parts: Sequence[tuple[str, Mapping[str, Samples]]] = [("", read)]
        try:
            if self.spec.segments is not None and self.spec.segments.by == BY_GAPS:
                if not (parts := between_gaps(read)):
                    raise ValueError("no part between gaps has two samples of every signal")
            elif self.spec.segments is not None:
                parts = list(_parts(read, labels))
        except ValueError as error:
            return self.document.report(("segments",), f"{name}: {error}", "measurement-time")
        for label, samples in parts:
            called = f"{name} {label}" if label else name
            try:
                yield self._segment(called, samples)
            except ValueError as error:
                self.document.report(key, f"{called}: {error}", code_of(error, "measurement-time"))

    def _note(self, path: str, words: str) -> None:
        where = self.document.location(("files",))
        self.notes.append(Diagnostic("recording-rows", f"{path}: {words}", "info", where))

    def _times(self, path: str, column: FileColumn) -> np.ndarray:
        """Return the times of a column in s; report their errors, once per file."""
        time = self.spec.time
        stated = time.unit or column.time_unit
        try:
            if stated is None and not holds_times(column.times):
                stated = unit_of("time", time.column, None, "s")
            return seconds_of(column.times, stated, f"time {time.column!r}")
        except ValueError as error:
            if path not in self.without_times:
                self.document.report(("time",), f"{path}: {error}", code_of(error, "series-unreadable"))
            self.without_times.add(path)
            return np.full(column.times.size, np.nan)

    def _read(self, file: ColumnFile, path: str, name: str) -> Samples:
        """Return times [s] and values [SI] of a column, NaN where none was taken; report their errors."""
        spec, entry = self.spec.signals[name], MEASURABLE[name]
        try:
            column: FileColumn = file.column(spec.column, self.spec.time.column)
            unit = unit_of(name, spec.column, spec.unit or column.unit, entry.unit)
            times = self._times(path, column)
            what = f"column {spec.column!r}"
            values = numbers_in(column.values, unit, measure_of(entry.unit), entry.unit, what)
            values = spec.gain * (values - self.corrections[name].offset)
            refuse_implausible(name, entry, spec.column, column.values, values, unit)
        except ValueError as error:
            self.document.report(("signals", name), f"{path}: {error}", code_of(error, "series-unreadable"))
            return np.zeros(0), np.zeros(0)
        known = ~np.isnan(times)
        lost = int(np.count_nonzero(~known & ~np.isnan(values)))
        if lost and path not in self.without_times:
            self.without_times.add(path)
            self._note(path, f"{counted(lost, 'row')} with values but no time are not used")
        return times[known], (spec.sign * values if spec.sign < 0 else values)[known]

    def _labels(self, file: ColumnFile, path: str) -> Samples | None:
        """Return times and values of the column whose changes begin segments; None: where time restarts."""
        segments = self.spec.segments
        if segments is None or segments.by in (BY_TIME, BY_GAPS):
            return None
        try:
            column = file.column(segments.by, self.spec.time.column)
        except ValueError as error:
            self.document.report(("segments", "by"), str(error), "series-unreadable")
            return None
        times = self._times(path, column)
        known = ~np.isnan(times)
        return times[known], _held(column.values)[known]

    def _segment(self, name: str, read: Mapping[str, Samples]) -> Segment:
        recorded, clocks = {}, {}
        for signal, (times, values) in read.items():
            taken = ~np.isnan(values)
            if np.count_nonzero(taken) < 2:
                raise InvalidValueError(f"{signal} has less than two values", code="measurement-time")
            times, values = _increasing(times[taken], values[taken], self.spec.time)
            correction = self.corrections[signal]
            recorded[signal] = times
            clocks[signal] = times - correction.delay, without_spikes(times, values, correction.spikes)
        time = common_times(recorded, {signal: times for signal, (times, _) in clocks.items()})
        signals = {
            signal: values if np.array_equal(t, time) else resample(time, t, values)
            for signal, (t, values) in clocks.items()
        }
        gaps = {signal: found for signal, (t, _) in clocks.items() if (found := gaps_in(t))}
        segment = Segment(name, time, signals, gaps)
        positions = {
            signal: correction.at for signal, correction in self.corrections.items() if any(correction.at)
        }
        return replace(segment, signals=to_centre_of_mass(segment, positions)) if positions else segment


def refuse_implausible(
    name: str, entry: SignalEntry, column: str, recorded: np.ndarray, values: np.ndarray, unit: str
) -> None:
    """Raise ValueError if values of a signal are implausible for a car; suggest the unit that was meant.

    Args:
        name, entry: the signal.
        column: heading of its column.
        given: the numbers of the column, in `unit`.
        values: the same in SI.
        unit: unit of the column.
    """
    largest, wanted = entry.largest, entry.unit
    values = values[~np.isnan(values)]
    if largest is None or np.mean(np.abs(values) > largest) <= SHARE_OF_SPIKES:
        return
    number = float(np.nanquantile(np.abs(recorded.astype(float)), 1.0 - SHARE_OF_SPIKES))
    likely = meant_unit(number, unit, wanted, lambda value: abs(value) <= largest)
    value = f"{number:.4g} {unit}" if unit != "1" else f"{number:.4g}"
    raise ValueError(
        f"column {column!r}: no car reaches {name} of {value}, "
        f"at most {largest:.4g} {wanted} is allowed{f'; did you mean {likely!r}?' if likely else ''}"
    )


def _held(labels: np.ndarray) -> np.ndarray:
    """Return labels, those of cells without a value as in the row before; "-" ahead of the first."""
    missing = np.array([label is None or label != label for label in labels], dtype=bool)
    if not missing.any():
        return labels
    last = np.maximum.accumulate(np.where(missing, -1, np.arange(labels.size)))
    held = labels[np.maximum(last, 0)].astype(object)
    held[last < 0] = "-"
    return held


def _parts(
    read: Mapping[str, Samples], labels: Samples | None
) -> Iterator[tuple[str, Mapping[str, Samples]]]:
    """Yield label and samples of the segments of a file.

    Raises:
        ValueError: signals with times of their own cannot be divided.
    """
    times = next(iter(read.values()))[0]
    clock = times if labels is None else labels[0]
    if all(np.array_equal(t, clock) for t, _ in read.values()):
        for label, rows in parts_of(clock, None if labels is None else labels[1]):
            yield label, {signal: (t[rows], x[rows]) for signal, (t, x) in read.items()}
        return
    if labels is None:
        raise ValueError("channels with times of their own cannot be divided where time restarts")
    if any(np.any(np.diff(t) < 0.0) for t in (clock, *(t for t, _ in read.values()))):
        raise ValueError("channels with times of their own, which restart, cannot be divided")
    for label, rows in parts_of(clock, labels[1], least=1):
        begin = clock[rows.start] if rows.start else -np.inf
        end = clock[rows.stop] if rows.stop < clock.size else np.inf
        inside = {signal: (t >= begin) & (t < end) for signal, (t, _) in read.items()}
        yield label, {signal: (t[inside[signal]], x[inside[signal]]) for signal, (t, x) in read.items()}


def _increasing(times: np.ndarray, values: np.ndarray, spec: TimeSpec) -> tuple[np.ndarray, np.ndarray]:
    """Return times that increase, and their values; equal times become one if the file says so.

    Raises:
        ValueError: they do not increase.
    """
    back = np.flatnonzero(np.diff(times) < 0.0)
    if back.size:
        row = int(back[0])
        raise InvalidValueError(
            f"time goes back from {span(times[row], times[row + 1])} s (value {row + 2}): write "
            f"'segments: {{by: {BY_TIME}}}', or by: the column that counts laps",
            code="measurement-time",
        )
    if times.size < 2 or np.all(np.diff(times) > 0.0):
        return times, values
    if spec.repeated == "refuse":
        row = int(np.flatnonzero(np.diff(times) == 0.0)[0])
        raise InvalidValueError(
            f"{times[row]:.15g} s occurs twice (value {row + 2}): write 'time: {{column: {spec.column}, "
            "repeated: mean}' for the mean of such rows",
            code="measurement-time",
        )
    unique, rows, count = np.unique(times, return_inverse=True, return_counts=True)
    return unique, np.bincount(rows, values) / count
