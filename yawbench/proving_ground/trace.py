"""Signals for standard tests: `Trace` of a run or a measurement, and its sampling, filtering and sign checks.

A `Trace` has signals by their names in the vocabulary, in SI, over one time axis. In results the signals are
found by name; a measurement file (`measured.measurement`) assigns the columns of recordings to them.

Signals are prepared as regulations require: even sampling, zero-phase low pass. The low pass is a Butterworth
filter of sixth order, forward and backward, which has twelve poles and no phase (at the cut-off frequency the
amplitude is halved). GTR 8 requires "a 12-pole phaseless Butterworth filter"; that its twelve poles are those
of both directions together is our reading. Unfiltered signals change a yaw-rate ratio of sine with dwell by
up to 0.8 points, another order or cut-off by 0.1 points at most.

Measured columns often have signs other than those of ISO 8855. A yaw rate or a lateral acceleration that
opposes the hand wheel is an error in the data, not a property of the car, and such runs are not judged.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from yawbench.foundation.errors import ResultsError
from yawbench.measurements.segment import LowPass, even_grid, resample
from yawbench.metrics.expressions import columns_of
from yawbench.metrics.measures import si_of
from yawbench.metrics.verdict import NotJudged
from yawbench.orchestrator.recordings.gaps import gaps_noted
from yawbench.orchestrator.results.reader import Results
from yawbench.orchestrator.results.run_record import FmuRecord
from yawbench.orchestrator.scenario.overrides import with_changes
from yawbench.vehicles import motion
from yawbench.vocabulary.signals import SIGNALS

CUT_OFF = {"steering_wheel_angle": 10.0, "yaw_rate": 6.0, "acceleration_y": 6.0}
"""Cut-off frequencies of the low pass [Hz]: GTR 8."""
SHORTEST = 1.0
"""Least length of a record that can be filtered [s]."""
SLOWEST = 50.0
"""Least sampling rate [Hz]. Chosen: 2.5 times what a low pass of 10 Hz needs."""


def prepared(trace: Trace, names: Iterable[str]) -> dict[str, np.ndarray]:
    """Return filtered signals of a trace by name, and their `time`.

    Raises:
        NotJudged: the record is too short or too coarse.
        ResultsError: a signal is missing.
    """
    wanted = [(name, trace[name]) for name in names]
    if trace.time.size < 2 or trace.time[-1] - trace.time[0] < SHORTEST:
        raise NotJudged(f"the record is shorter than {SHORTEST:g} s")
    if trace.rate < SLOWEST:
        raise NotJudged(f"sampled at {trace.rate:.3g} Hz; at least {SLOWEST:g} Hz are needed")
    even = trace.even
    filtered = {name: LowPass(CUT_OFF[name])(even[name], even.rate) for name, _ in wanted}
    return {"time": even.time, **filtered}


def running_mean(x: np.ndarray, width: float, rate: float) -> np.ndarray:
    """Return the centred mean over `width` [s]; near the ends, over the samples that exist."""
    half = round(0.5 * width * rate)
    total = np.concatenate([[0.0], np.cumsum(x)])
    first = np.maximum(np.arange(len(x)) - half, 0)
    last = np.minimum(np.arange(len(x)) + half + 1, len(x))
    return np.asarray((total[last] - total[first]) / (last - first))


def first_crossing(time: np.ndarray, x: np.ndarray, threshold: float, after: float) -> float | None:
    """Return the first instant [s] from `after` on at which x has risen to `threshold`, None if never.

    x is interpolated linearly between samples.
    """
    reached = np.flatnonzero((x >= threshold) & (time >= after))
    if not reached.size:
        return None
    k = int(reached[0])
    if k == 0 or x[k - 1] >= threshold:
        return max(float(time[k - 1]) if k else float(time[0]), after)
    share = (threshold - x[k - 1]) / (x[k] - x[k - 1])
    return max(float(time[k - 1] + share * (time[k] - time[k - 1])), after)


def at(time: np.ndarray, x: np.ndarray, instant: float) -> float:
    """Return x at an instant [s], interpolated linearly."""
    return float(np.interp(instant, time, x))


def known(value: float) -> float | None:
    """Return a value, None for NaN."""
    return None if math.isnan(value) else value


@dataclass(frozen=True)
class Trace:
    """The signals of one run or measurement."""

    label: str
    time: np.ndarray  # shape (rows,) [s], increasing
    signals: dict[str, np.ndarray]  # vocabulary name -> shape (rows,), in SI
    mass: float | None = None  # of the car [kg]
    friction: float | None = None  # lowest of the road
    facts: dict[str, Any] = field(default_factory=dict)  # other parameters of the run: name -> value
    folder: Path | None = None  # of the results
    title: str = ""
    gaps: Mapping[str, str] = field(default_factory=dict)  # signal, "": all -> which samples are missing
    judged: bool = False  # signals with gaps are refused: what is read from them is judged

    @property
    def name(self) -> str:
        """The name used in figures: that of the folder, or the label."""
        return (self.folder.name if self.folder else "") or self.label

    def __contains__(self, name: object) -> bool:
        return name in self.signals

    def __getitem__(self, name: str) -> np.ndarray:
        """Return a signal, shape (rows,).

        Raises:
            ResultsError: the trace does not have it.
            NotJudged: it has gaps, and the trace is judged.
        """
        if name not in self.signals:
            have = ", ".join(self.signals) or "nothing"
            raise ResultsError(
                f"{self.label}: the signal {name!r} is missing, which this test needs; recorded: {have}",
                code="signal-unknown",
            )
        if self.judged and (lacking := self.gaps.get(name) or self.gaps.get("")):
            raise NotJudged(f"{lacking}: 'segments: {{by: gaps}}' divides a recording there")
        return self.signals[name]

    def parameter(self, name: str, meaning: str = "") -> float:
        """Return a numeric parameter of the recorded run.

        Raises:
            NotJudged: the run has no such parameter; `meaning` explains it in the message.
        """
        value = self.facts.get(name)
        if not isinstance(value, (int, float)) or isinstance(value, bool):
            raise NotJudged(f"the run has no parameter {name}{f', {meaning}' if meaning else ''}")
        return float(value)

    @cached_property
    def standing(self) -> np.ndarray:
        """Whether the car stands, as far as angles of its velocity are concerned; shape (rows,)."""
        stands = motion.standing(self.signals)
        return np.zeros(self.time.shape, bool) if stands is None else stands

    def while_moving(self, name: str) -> np.ndarray:
        """Return an angle of the velocity, NaN while the car stands; shape (rows,)."""
        return np.where(self.standing, np.nan, self[name]) if self.standing.any() else self[name]

    @cached_property
    def even(self) -> Trace:
        """This trace sampled evenly; itself if it already is."""
        grid = even_grid(self.time)
        signals = {name: resample(grid, self.time, x) for name, x in self.signals.items()}
        return replace(self, time=grid, signals=signals)

    @property
    def rate(self) -> float:
        """Median sampling rate [Hz]."""
        return 1.0 / float(np.median(np.diff(self.time)))


def trace_of(results: Results, label: str = "") -> Trace:
    """Return the trace of recorded results; mass and friction come from the parameters of the instances."""
    signals = {}
    for name in SIGNALS:
        if "*" in name:
            continue
        columns = columns_of(results, name)
        if columns:
            signals[name] = results.columns[columns[0]] * si_of(results.units[columns[0]])[1]
    own = Counter(name.variable for name in results.names.values())
    for column, values in results.columns.items():  # signals of a single instance, such as overruns of cones
        name = results.names[column].variable
        if name not in signals and own[name] == 1 and np.issubdtype(values.dtype, np.number):
            signals[name] = values
    fmus = results.record.fmus
    parameters = {instance: {**fmu.defaults, **fmu.parameters} for instance, fmu in fmus.items()}
    best = [
        instance for role in ("driver", "plant") for instance in results.instances_of_role(role)
    ]  # their parameters win over others of the same name
    facts = {
        name: value
        for instance in (*parameters, *best)
        for name, value in parameters.get(instance, {}).items()
    }
    plants = [parameters.get(instance, {}) for instance in results.instances_of_role("plant")]
    mass = next((values["mass"] for values in reversed(plants) if "mass" in values), None)
    return Trace(
        label or str(results.folder),
        results.time,
        signals,
        float(mass) if isinstance(mass, (int, float)) else None,
        _friction(results, fmus, parameters),
        facts,
        results.folder if results.record.results else None,
        with_changes(results.record.title or "", results.record.overrides),
        dict(_gaps(results)),
    )


def _gaps(results: Results) -> Iterator[tuple[str, str]]:
    """Yield the signals of a recording that have gaps, "" for all of them, and the sentence on the first."""
    for names, gap in reversed([*gaps_noted(results.record.all_diagnostics)]):
        for name in names.split(", "):
            yield name, f"there are no samples{f' of {name}' * bool(name)} from {gap}"


def _friction(results: Results, fmus: Mapping[str, FmuRecord], parameters: Mapping[str, Any]) -> float | None:
    """Return the lowest friction at any wheel: as recorded, else from the parameters of road and tyres."""
    if columns := columns_of(results, "friction_*"):
        return float(min(results.columns[column].min() for column in columns))
    frictions = [
        parameters.get(instance, {}).get("base_friction") for instance in results.instances_of_role("road")
    ]
    frictions += [values.get("friction") for values in parameters.values()]
    for fmu in fmus.values():
        frictions += [value for name, value in fmu.constants.items() if name.startswith("friction_")]
    return min((float(value) for value in frictions if isinstance(value, (int, float))), default=None)


def likeness(hand: np.ndarray, answer: np.ndarray) -> float:
    """Return the normalized product of two sampled signals, from -1 to 1; 0 if one of them is zero."""
    size = float(np.sqrt(np.sum(hand**2) * np.sum(answer**2)))
    return float(np.sum(hand * answer)) / size if size else 0.0


def refuse_opposed(hand: np.ndarray, answer: np.ndarray, name: str) -> None:
    """Raise NotJudged if a response is mostly to the opposite side of the hand wheel.

    Args:
        hand: hand-wheel angle over the samples in question; zero straight ahead.
        answer: the response over the same samples.
        name: name of the response, in words.
    """
    if likeness(hand, answer) < 0.0:
        raise opposed(name)


def opposed(name: str) -> NotJudged:
    """Return the exception for a run whose response opposes the steering."""
    return NotJudged(
        f"the {name} opposes the steering: both are positive to the left, so one of them has the wrong sign "
        "('sign: -1' in a measurement file turns it)"
    )
