"""Fit files, and the runs of a scenario as a model that is fitted to a measurement.

    title: A saloon fitted to two sine sweeps
    scenario: sweep.yaml                 # with `inputs: {steer_angle: {file: measured.yaml}}`
    measured: measured.yaml
    training:                            # stretches, cut into windows that are simulated one by one
      - {segment: 1, begin: 0, end: 30 s, window: 10 s}
    held_out:                            # likewise; never the same seconds
      - {segment: 2, begin: 0, end: 30 s, window: 10 s}
    compared: {yaw_rate: 0.1 deg/s, acceleration_y: 0.05 m/s2}      # signal -> expected difference
    free:                                # targets as of --set, and of the measurement
      vehicle.yaw_inertia: {low: 1000, high: 4000, start: 2000, prior: {mean: 2100, deviation: 300}}
      measured.yaw_rate.offset: {low: -1 deg/s, high: 1 deg/s}
      measured.steer_angle.delay: {low: -50 ms, high: 50 ms}

A window starts from the measured speed, yaw rate and sideslip, as far as they are recorded, and its first
`settling` seconds are not compared. Inputs follow the measurement unfiltered; what is compared is filtered,
simulated signals like measured ones. `measured.SIGNAL.delay` and `.offset` belong to the recording: at time t
it shows what the car had at t - delay, plus the offset. Those of an input change the runs, those of a
compared signal need none.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from pathlib import Path
from typing import Literal

import numpy as np
from pydantic import Field

from yawbench.fmus.fmu import Value, Variable
from yawbench.foundation.errors import ScenarioError, YawbenchError, code_of, text_of
from yawbench.foundation.messages import hint, span
from yawbench.foundation.safe_files import reads
from yawbench.foundation.workers import Pool
from yawbench.orchestrator.plan import InputSeries, Instance, Override
from yawbench.orchestrator.recordings.gaps import by_signals
from yawbench.orchestrator.recordings.measurement import Measurement, load_measurement
from yawbench.orchestrator.recordings.segment import LowPass, Segment
from yawbench.orchestrator.results.freshness import key_of
from yawbench.orchestrator.scenario import yaml_lines
from yawbench.orchestrator.scenario.quantities import convert, gain_and_offset, unit_of
from yawbench.orchestrator.scenario.schema import Scalar, SeriesSpec
from yawbench.orchestrator.scenario.schema_validation import Instant, StrictModel, Time, validated
from yawbench.orchestrator.scenario.yaml_lines import Document
from yawbench.orchestrator.signal_names import INPUTS, SignalName, match
from yawbench.planner import Planner
from yawbench.studies.jobs import Job, execute
from yawbench.vehicles.motion import standing
from yawbench.vocabulary.motion import ANGLES, LEAST_SPEED
from yawbench.vocabulary.signals import SIGNALS

from .least_squares import Simulated, Window
from .single_track import start_states

MEASURED = "measured"
"""Prefix of the free parameters of a measurement."""
MARGIN = 0.5
"""Time before and after a window [s] for which inputs are kept; chosen: longer than any delay."""
LARGEST = 1e9
"""Largest measured value over its expected difference. Chosen: sums of their squares keep some digits."""
TRANSIENT = 2.0
"""Periods of the filter's cut-off by which a run is longer than its window; chosen: its end has died away."""


class PriorSpec(StrictModel):
    """Prior of a parameter."""

    mean: Scalar
    deviation: Scalar = Field(description="Standard deviation; weighs as much as one sample at its error")


class FreeSpec(StrictModel):
    """A free parameter; numbers in SI or with a unit."""

    low: Scalar = Field(description="Lower bound")
    high: Scalar = Field(description="Upper bound")
    start: Scalar | None = Field(None, description="Default: the scenario's value; of the measurement: 0")
    prior: PriorSpec | None = None


class StretchSpec(StrictModel):
    """A stretch of a segment, cut into windows."""

    segment: int | None = Field(None, description="Number of the segment, from 1; default: the only one")
    begin: Instant = Field(description="s, in the segment's time")
    end: Time = Field(description="s")
    window: Time | None = Field(None, description="s, longest duration of a window; default: all of it")


class FitSpec(StrictModel):
    """A fit file."""

    title: str = Field(min_length=1)
    source: str = Field("", description="Where the choices of this file come from")
    scenario: str = Field(min_length=1, description="Relative to this file")
    measured: str = Field(min_length=1, description="Measurement file, relative to this file")
    training: list[StretchSpec] = Field(min_length=1, description="What parameters are fitted to")
    held_out: list[StretchSpec] = Field([], description="What the fitted models are judged by")
    compared: dict[str, Scalar] = Field(
        min_length=1, description="Signal of the plant -> expected difference"
    )
    free: dict[str, FreeSpec] = Field(min_length=1, description="Free parameters: target -> range")
    settling: Time = Field(Fraction(1, 2), description="s, not compared at the start of each window")
    most_sets: int = Field(300, ge=2, description="Sets of values after which the search stops")


Part = Literal["training", "held_out"]
PARTS: tuple[Part, ...] = ("training", "held_out")


@dataclass(frozen=True)
class FitWindow:
    """A window, and the segment that it is cut from: filtered for comparison, unfiltered for inputs."""

    window: Window
    filtered: Segment
    raw: Segment


@dataclass(frozen=True)
class LoadedFit:
    """A fit file with its measurement."""

    path: Path
    spec: FitSpec
    measurement: Measurement
    errors: Mapping[str, float]  # compared signal -> expected difference, in SI
    training: Sequence[FitWindow]
    held_out: Sequence[FitWindow]

    @property
    def scenario(self) -> Path:
        """The scenario file."""
        return self.path.parent / self.spec.scenario

    @property
    def parts(self) -> dict[str, Sequence[FitWindow]]:
        """Part -> its windows."""
        return {"training": self.training, "held_out": self.held_out}

    @property
    def deciding(self) -> str:
        """The part that decides which model is better."""
        return "held_out" if self.held_out else "training"

    @property
    def settling(self) -> float:
        """Time that is not compared at the start of a window [s]."""
        return float(self.spec.settling)


@reads("fit file", ScenarioError)
def load_fit(path: Path | str) -> LoadedFit:
    """Load a fit file and its measurement.

    Raises:
        ScenarioError: one of them is invalid; lists all errors.
    """
    path = Path(path)
    document = yaml_lines.read(path, what="fit file")
    spec = validated(FitSpec, document)
    file = path.parent / spec.measured
    filtered = load_measurement(file)
    raw = load_measurement(file, filtered=False) if filtered.filter else filtered
    errors = {}
    for name, value in spec.compared.items():
        key = ("compared", name)
        if name not in SIGNALS or any(name not in segment.signals for segment in filtered.segments):
            known = filtered.segments[0].signals
            document.report(key, f"is not measured{hint(name, known, lead='measured are')}", "signal-unknown")
            continue
        try:
            errors[name] = number_in(value, SIGNALS[name].unit)
            if not errors[name] > 0.0:
                raise ValueError(f"must be above 0 (got {value})")
        except ValueError as error:
            document.report(key, str(error), code_of(error))
    parts = {}
    if not document.errors:
        for part in PARTS:
            parts[part] = list(_windows(document, part, spec, filtered, raw, errors))
    _refuse_overlaps(document, spec)
    document.raise_errors()
    return LoadedFit(path, spec, filtered, errors, parts["training"], parts["held_out"])


def number_in(value: Value, unit: str | None, *, relative: bool = False) -> float:
    """Return a number in SI; text has a unit, whose offset does not apply if the number is `relative`.

    Raises:
        ValueError: it is not a number, or its unit does not fit.
    """
    if isinstance(value, str):
        return float(convert(value, unit, relative=relative))
    if isinstance(value, bool):
        raise ValueError(f"must be a number (got {value})")
    return float(value)


def _windows(
    document: Document,
    name: Part,
    spec: FitSpec,
    filtered: Measurement,
    raw: Measurement,
    compared: Mapping[str, float],
) -> Iterator[FitWindow]:
    for number, stretch in enumerate(getattr(spec, name)):
        try:
            segment, unfiltered = filtered.segment(stretch.segment), raw.segment(stretch.segment)
        except ValueError as error:
            document.report((name, number), str(error), "segment-unknown")
            continue
        begin, end = float(stretch.begin), float(stretch.end)
        first, last = float(segment.time[0]), float(segment.time[-1])
        if not first - 1e-6 <= begin < end <= last + 1e-6:
            words = f"{span(begin, end)} s is not within {segment.name}, {span(first, last)} s"
            document.report((name, number), words, "fit-window")
            continue
        longest = float(stretch.window or end - begin)
        count = max(1, math.ceil((end - begin) / longest - 1e-9))
        for k in range(count):
            start = begin + k * longest
            stop = min(start + longest, end)
            gaps = by_signals(segment.gaps, segment.signals)
            if lost := next((lost for lost in gaps if lost[1].overlaps(start, stop)), None):
                of = f" of {lost[0]}" if lost[0] else ""
                words = (
                    f"{segment.name} has no samples{of} from {lost[1]}: leave that out, with two stretches"
                )
                document.report((name, number), words, "fit-window")
                break
            part = segment.between(start, stop).even()
            settling = float(spec.settling)
            if np.count_nonzero(part.time >= part.time[0] + settling - 1e-9) < 3:
                words = f"a window has less than three samples after 'settling', {settling:g} s"
                document.report((name, number), words, "fit-window")
                break
            label = f"{segment.name}, {span(part.time[0], part.time[-1])} s"
            measured = {signal: part.signals[signal] for signal in compared}
            if (angle := next((signal for signal in compared if signal in ANGLES), None)) and (
                standing(part.signals) is not None
            ):
                words = (
                    f"{label}: there the car is slower than {3.6 * LEAST_SPEED:.0f} km/h, and {angle} means "
                    "nothing; end the window before, or leave that signal out of 'compared'"
                )
                document.report((name, number), words, "fit-window")
                break
            if large := [name for name, x in measured.items() if np.abs(x / compared[name]).max() > LARGEST]:
                words = (
                    f"{large[0]} reaches more than {LARGEST:g} times the difference expected in 'compared'"
                )
                document.report((name, number), f"{words}; check its unit and that", "fit-window")
                break
            yield FitWindow(Window(label, part.time, measured), segment, unfiltered)


def _refuse_overlaps(document: Document, spec: FitSpec) -> None:
    for number, held in enumerate(spec.held_out):
        for stretch in spec.training:
            if stretch.segment == held.segment and stretch.begin < held.end and held.begin < stretch.end:
                words = f"{span(float(held.begin), float(held.end))} s shares seconds with 'training'"
                document.report(("held_out", number), words, "fit-window")


@dataclass(frozen=True)
class WindowJob(Job):
    """A run of a window, with the signals to return."""

    times: np.ndarray = field(default_factory=lambda: np.zeros(0))
    wanted: tuple[tuple[str, str], ...] = ()  # (compared signal, column)
    low_pass: LowPass | None = None


def run_window(job: Job) -> Simulated:
    """Execute the run of a window; return the compared signals, filtered, at its times."""
    from yawbench.orchestrator.master.simulate import simulate_in_memory

    assert isinstance(job, WindowJob) and job.plan is not None
    results = simulate_in_memory(job.plan)
    if results.time[-1] < job.times[-1] - 1e-6:
        return None
    signals = {}
    for name, column in job.wanted:
        values = results[column]
        if job.low_pass:
            values = job.low_pass(values, 1.0 / float(job.plan.step))
        signals[name] = np.interp(job.times, results.time, values)
    return signals


class ScenarioModel:
    """The runs of a scenario in windows, for `measured.least_squares`.

    Args:
        fit: its scenario and measurement.
        windows: of the measurement.
        planner: makes the plans.
        pool: makes the runs.
        fmus: folder of the FMUs.

    Raises:
        YawbenchError: the scenario is wrong, or follows no measured signal.
    """

    def __init__(
        self,
        fit: LoadedFit,
        windows: Sequence[FitWindow],
        *,
        planner: Planner,
        pool: Pool,
        fmus: Path | None = None,
    ) -> None:
        self.fit, self.windows, self.planner, self.pool, self.fmus = fit, windows, planner, pool, fmus
        scenario = planner.load(fit.scenario)
        self._series = {
            key: spec
            for key, given in scenario.inputs.items()
            if isinstance(spec := given.value, SeriesSpec)
            and (fit.scenario.parent / spec.file).resolve() == fit.measurement.path.resolve()
        }
        if not self._series:
            raise ScenarioError(
                f"{fit.scenario}: no input follows {fit.spec.measured}; write "
                f"'inputs: {{steering_wheel_angle: {{file: {fit.spec.measured}}}}}'",
                code="fit-inputs",
            )
        self._still = tuple(Override.of(f"{INPUTS}.{key}", 0.0, "fit") for key in self._series)
        self.base = planner.plan(planner.load(fit.scenario, self._still), fmus=fmus)
        self.followed = dict(self._followed())
        self.plant = next((instance for instance in self.base.instances if instance.role == "plant"), None)
        if self.plant is None:
            raise ScenarioError(f"{fit.scenario}: has no plant to compare", code="fit-inputs")
        self.columns = {name: f"{self.plant.name}.{name}" for name in fit.errors}
        for column in self.columns.values():
            if column not in map(str, self.base.record):
                why = f"{fit.scenario}: {column} is compared, but not recorded"
                raise ScenarioError(why, code="signal-unknown")
        self.identity = json.dumps([
            key_of(self.base), fit.measurement.sha256, sorted(fit.errors), [w.window.name for w in windows]
        ])  # fmt: skip
        self.failure = ""  # why the last run that failed did
        self._windows = [self._of_window(window) for window in windows]

    def __call__(self, sets: Sequence[Mapping[str, float]]) -> list[list[Simulated]]:
        """Run all windows for sets of values; see `measured.least_squares.Model`."""
        simulated: list[list[Simulated]] = [[None] * len(self.windows) for _ in sets]
        jobs, windows_of = [], []
        for number, values in enumerate(sets):
            for k in range(len(self.windows)):
                try:
                    jobs.append(self._job(k, values))
                    windows_of.append((number, k))
                except YawbenchError as error:  # noqa: PERF203 - a value is out of range
                    self.failure = text_of(error.diagnostics)
        outcomes = execute(jobs, run=run_window, pool=self.pool) if jobs else []
        for (number, k), outcome in zip(windows_of, outcomes, strict=True):
            simulated[number][k] = outcome.value
            self.failure = outcome.reason or self.failure
        return simulated

    def _of_window(self, fit_window: FitWindow) -> tuple[tuple[Override, ...], Fraction, Fraction]:
        """Return the overrides of a window's runs, and their start and stop time [s]."""
        step, times = self.base.step, fit_window.window.times
        begin = Fraction(round(times[0] / float(step))) * step
        filtered = self.fit.measurement.filter
        extra = TRANSIENT / filtered.cut_off if filtered else 0.0
        end = min(times[-1] + extra, fit_window.filtered.time[-1])
        stop = begin + step * math.ceil((max(end, times[-1]) - float(begin)) / float(step) - 1e-6)
        changes = {"start_time": float(begin), "stop_time": float(stop)}
        assert self.plant is not None
        for parameter, signal in start_states(fit_window.filtered, float(begin)).items():
            if parameter in self.plant.fmu.variables:
                changes[f"{self.plant.name}.{parameter}"] = signal
        own = (Override.of(name, value, "fit") for name, value in changes.items())
        return (*self._still, *own), begin, stop

    def _job(self, k: int, values: Mapping[str, float]) -> WindowJob:
        """Return the planned job of a window with a set of values."""
        fit_window, (changes, begin, stop) = self.windows[k], self._windows[k]
        own = [
            Override.of(name, value, "fit")
            for name, value in values.items()
            if not name.startswith(f"{MEASURED}.")
        ]
        scenario = self.planner.load(self.fit.scenario, (*changes, *own))
        plan = self.planner.plan(scenario, fmus=self.fmus, record=tuple(self.columns.values()))
        plan = replace(
            plan, instances=tuple(self._following(x, fit_window, begin, stop, values) for x in plan.instances)
        )
        wanted = tuple(self.columns.items())
        return WindowJob(
            fit_window.window.name, self.fit.scenario, Path(), plan=plan, keep=False,
            times=fit_window.window.times, wanted=wanted, low_pass=self.fit.measurement.filter,
        )  # fmt: skip

    def _followed(self) -> Iterator[tuple[tuple[str, str], str]]:
        """Yield (instance, input) and the measured signal that it follows.

        Raises:
            ScenarioError: the signal is not measured, or of another kind.
        """
        instances = [instance.name for instance in self.base.instances]
        for key, spec in self._series.items():
            pattern = SignalName.parse_input(key, instances)
            for instance in self.base.instances:
                for name in instance.constants:
                    if not pattern.matches(instance.name, name):
                        continue
                    signal = (spec.column or name).replace("*", match(pattern.variable, name) or "")
                    variable = instance.fmu.variables[name]
                    if any(signal not in window.raw.signals for window in self.windows):
                        known = hint(signal, self.windows[0].raw.signals, lead="measured are")
                        raise ScenarioError(
                            f"{self.fit.scenario}: inputs.{key}: {signal} is not measured{known}",
                            code="signal-unknown",
                        )
                    if _conversion(signal, variable) is None:
                        raise ScenarioError(
                            f"{self.fit.scenario}: inputs.{key}: {signal} does not fit the input's unit "
                            f"{variable.unit}",
                            code="fit-inputs",
                        )
                    yield (instance.name, name), signal

    def _following(
        self,
        instance: Instance,
        fit_window: FitWindow,
        begin: Fraction,
        stop: Fraction,
        values: Mapping[str, float],
    ) -> Instance:
        """Return an instance whose inputs follow the measurement, corrected by a set of values."""
        series, constants = dict(instance.series), dict(instance.constants)
        part = fit_window.raw.between(float(begin) - MARGIN, float(stop) + MARGIN)
        for (name, variable), signal in self.followed.items():
            if name != instance.name:
                continue
            delay, offset = delay_and_offset(values, signal)
            gain, shift = _conversion(signal, instance.fmu.variables[variable]) or (1.0, 0.0)
            numbers = gain * (part.signals[signal] - offset) + shift
            file = self.fit.measurement
            series[variable] = InputSeries(
                file.path.name, signal, file.sha256, False, part.time - delay, numbers
            )
            constants[variable] = series[variable].first(float(begin))
        return replace(instance, series=series, constants=constants)


def delay_and_offset(values: Mapping[str, float], signal: str) -> tuple[float, float]:
    """Return the delay and offset of a measured signal in a set of values; 0 where they are not free."""
    return values.get(f"{MEASURED}.{signal}.delay", 0.0), values.get(f"{MEASURED}.{signal}.offset", 0.0)


def _conversion(signal: str, variable: Variable) -> tuple[float, float] | None:
    """Return gain and offset from a measured signal to an input, None if their units differ in kind."""
    wanted = unit_of(variable)
    return gain_and_offset(SIGNALS[signal].unit, wanted) if wanted else (1.0, 0.0)
