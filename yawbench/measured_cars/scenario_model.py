"""The runs of a scenario in the windows of a measurement, as a model that is fitted to it.

A window starts from the measured speed, yaw rate and sideslip, as far as they are recorded, and its first
`settling` seconds are not compared. Inputs follow the measurement unfiltered; what is compared is filtered,
simulated signals like measured ones.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from pathlib import Path

import numpy as np

from yawbench.fmus.fmu import Variable
from yawbench.foundation.errors import ScenarioError, YawbenchError, text_of
from yawbench.foundation.messages import hint
from yawbench.foundation.workers import Pool
from yawbench.measurements.segment import LowPass
from yawbench.orchestrator.plan import InputSeries, Instance, Override
from yawbench.orchestrator.results.freshness import key_of
from yawbench.orchestrator.scenario.quantities import gain_and_offset, unit_of
from yawbench.orchestrator.scenario.schema import SeriesSpec
from yawbench.orchestrator.signal_names import INPUTS, SignalName, match
from yawbench.planner import Planner
from yawbench.studies.jobs import Job, execute
from yawbench.vocabulary.signals import SIGNALS

from .fit_file import MEASURED, FitWindow, LoadedFit
from .least_squares import Simulated
from .single_track import start_states

MARGIN = 0.5
"""Time before and after a window [s] for which inputs are kept; chosen: longer than any delay."""
TRANSIENT = 2.0
"""Periods of the filter's cut-off by which a run is longer than its window; chosen: its end has died away."""


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
