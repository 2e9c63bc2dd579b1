"""Segments of measurements: signals over time, their filter, resampling and removal of spikes.

A rigid body's point at (x, y, z) from the centre of mass has, with roll, pitch and yaw rates p, q, r,

    v = v_G + omega x (x, y, z)        a = a_G + d omega/dt x (x, y, z) + omega x (omega x (x, y, z))

where terms with p and q are used if these rates are recorded. The component of gravity that an accelerometer
measures while the car rolls is not removed, as all sensors measure it.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache
from itertools import pairwise

import numpy as np

from yawbench.foundation.errors import InvalidValueError
from yawbench.foundation.messages import span
from yawbench.orchestrator.recordings.gaps import Gap, outside, parts_between
from yawbench.vocabulary.motion import LEAST_SPEED

Position = tuple[float, float, float]
"""x, y, z [m] relative to the centre of mass, vehicle axes."""
POLES = 12
"""Poles of the low pass: GTR 8, "a 12-pole phaseless Butterworth filter", those of both directions."""
UNEVEN = 1e-6
"""Relative difference of time steps up to which sampling counts as even; chosen: rounding in files."""
WINDOW = 7
"""Samples of the running median that spikes are measured from. Chosen: spikes of up to three samples."""
OF_ROTATION = 6.0
"""Cut-off of the low pass of rates before they are differentiated [Hz]: that of GTR 8 for yaw rates."""
MOVED = ("velocity_x", "velocity_y", "sideslip", "acceleration_x", "acceleration_y")
"""Signals that depend on the position of their sensor."""


@dataclass(frozen=True)
class LowPass:
    """A Butterworth low pass; phaseless: half of the poles forward, half of them backward."""

    cut_off: float  # [Hz]
    order: int = POLES
    phaseless: bool = True

    def __call__(self, x: np.ndarray, rate: float) -> np.ndarray:
        """Return x filtered; shape (rows,), evenly sampled at `rate` [Hz]."""
        from scipy.signal import sosfilt, sosfilt_zi, sosfiltfilt

        if self.phaseless:
            sections = _sections(self.order // 2, self.cut_off, rate)
            return np.asarray(sosfiltfilt(sections, x, padlen=min(len(x) - 1, int(rate))))
        sections = _sections(self.order, self.cut_off, rate)
        return np.asarray(sosfilt(sections, x, zi=sosfilt_zi(sections) * x[0])[0])


@lru_cache(maxsize=64)  # chosen: more than the filters and rates of a campaign, whose runs share them
def _sections(order: int, cut_off: float, rate: float) -> np.ndarray:
    """Return the second-order sections of a Butterworth low pass."""
    from scipy.signal import butter

    return np.asarray(butter(order, cut_off, fs=rate, output="sos"))


MOST = 10_000_000
"""Samples up to which a recording is brought to even times, or four times those that it has. Chosen: a day at
100 Hz, 80 MB per signal."""


def even_grid(time: np.ndarray, step: float | None = None) -> np.ndarray:
    """Return evenly spaced times, at their median step [s] if they are uneven; shape (rows,).

    Raises:
        InvalidValueError: a jump of the clock would make too many of them.
    """
    steps = np.diff(time)
    wanted = float(np.median(steps)) if step is None else step
    if np.all(np.abs(steps - wanted) <= UNEVEN * max(wanted, 1e-12) + 1e-9):
        return time
    refuse_jump(time, wanted)
    return np.asarray(time[0] + wanted * np.arange(int((time[-1] - time[0]) / wanted + 1e-9) + 1))


def refuse_jump(time: np.ndarray, step: float | None = None) -> None:
    """Raise InvalidValueError if times at even steps [s], by default their median, would be too many."""
    steps = np.diff(time)
    count = (time[-1] - time[0]) / (float(np.median(steps)) if step is None else step)
    if count > max(MOST, 4 * time.size):
        row = int(np.argmax(steps))
        raise InvalidValueError(
            f"time jumps from {span(time[row], time[row + 1])} s (value {row + 2}), as if the clock had "
            f"been set while recording: {count:.2g} samples would lie between its first and last value at "
            "even steps; delete the rows ahead of the jump or behind it",
            code="measurement-time",
        )


def common_times(recorded: Mapping[str, np.ndarray], clocks: Mapping[str, np.ndarray]) -> np.ndarray:
    """Return the times at which all signals of a segment are taken.

    They are those of the signal with the most samples in the span that all signals share; of several with
    as many, the first by name.

    Args:
        recorded: signal -> times of its samples.
        clocks: likewise, less the delay of the signal.

    Raises:
        InvalidValueError: there are less than two, or the clock jumps (see `refuse_jump`).
    """
    late = max(clocks, key=lambda name: (clocks[name][0], name))
    early = min(clocks, key=lambda name: (clocks[name][-1], name))
    begin, end = clocks[late][0], clocks[early][-1]
    inside = {name: t[(t >= begin) & (t <= end)] for name, t in sorted(recorded.items())}
    time: np.ndarray = max(inside.values(), key=len)
    if time.size < 2:
        raise InvalidValueError(
            "its signals have less than two samples at the same times: "
            f"{late} begins at {begin:.10g} s, {early} ends at {end:.10g} s",
            code="measurement-time",
        )
    refuse_jump(time)
    return time


def resample(grid: np.ndarray, time: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Return x interpolated to a grid by a monotone cubic; x itself if the grid is `time`."""
    if grid is time:
        return x
    from scipy.interpolate import PchipInterpolator

    return np.asarray(PchipInterpolator(time, x)(grid))


@dataclass(frozen=True)
class Segment:
    """Signals over increasing time: a file, or a part of it."""

    name: str
    time: np.ndarray  # shape (rows,) [s], as recorded
    signals: Mapping[str, np.ndarray]  # name in the vocabulary -> shape (rows,), in SI
    gaps: Mapping[str, tuple[Gap, ...]] = field(default_factory=dict)  # signal -> its gaps, if it has any

    @property
    def rate(self) -> float:
        """Median sampling rate [Hz]."""
        return 1.0 / float(np.median(np.diff(self.time)))

    def rows(self, which: np.ndarray | slice) -> Segment:
        """Return the segment with some rows alone: those that an array marks as true, or a slice."""
        signals = {name: x[which] for name, x in self.signals.items()}
        return replace(self, time=self.time[which], signals=signals)

    def even(self, step: float | None = None) -> Segment:
        """Return the segment sampled evenly, every `step` [s]; default: its median step."""
        grid = even_grid(self.time, step)
        return replace(
            self,
            time=grid,
            signals={name: resample(grid, self.time, x) for name, x in self.signals.items()},
        )

    def filtered(self, low_pass: LowPass) -> Segment:
        """Return the segment with all signals filtered, at the same times; gaps separate parts."""
        signals = {name: x.copy() for name, x in self.signals.items()}
        for part in self.parts():
            even = part.even()
            rows = np.searchsorted(self.time, part.time)
            for name, x in even.signals.items():
                signals[name][rows] = np.interp(part.time, even.time, low_pass(x, even.rate))
        return replace(self, signals=signals)

    def sampled(self, names: Iterable[str]) -> Segment:
        """Return the rows that lie in no gap of some signals, where their values are not interpolated."""
        return self.rows(outside((gap for name in names for gap in self.gaps.get(name, ())), self.time))

    def parts(self) -> list[Segment]:
        """Return the parts of two samples or more that no gap of any signal interrupts."""
        every = [gap for gaps in self.gaps.values() for gap in gaps]
        return [
            replace(self.rows(rows), gaps={})
            for rows in (parts_between(every, self.time) if every else [slice(None)])
            if self.time[rows].size > 1
        ]

    def between(self, begin: float, end: float) -> Segment:
        """Return the part from `begin` to `end` [s], both included."""
        return self.rows((self.time >= begin - 1e-9) & (self.time <= end + 1e-9))


def parts_of(times: np.ndarray, labels: np.ndarray | None, *, least: int = 2) -> Iterator[tuple[str, slice]]:
    """Yield label and rows of the segments of a file; the label of a single segment is "".

    Args:
        times: of the rows.
        labels: a value per row whose changes begin segments; None: they begin where time goes back.
        least: rows of a segment; shorter ones are left out.
    """
    apart = np.diff(times) < 0.0 if labels is None else labels[1:] != labels[:-1]
    edges = [0, *(int(cut) + 1 for cut in np.flatnonzero(apart)), len(times)]
    for number, (begin, end) in enumerate(pairwise(edges), start=1):
        label = number if labels is None else labels[begin]
        words = f"{label:g}" if isinstance(label, (float, np.floating)) else str(label)
        if end - begin >= least:
            yield words if len(edges) > 2 else "", slice(begin, end)


def without_spikes(time: np.ndarray, x: np.ndarray, threshold: float) -> np.ndarray:
    """Return x with values that are further than `threshold` from the running median interpolated.

    Args:
        time: shape (rows,).
        x: shape (rows,).
        threshold: in the unit of x; 0: x is returned as it is.
    """
    if not threshold or x.size < WINDOW:
        return x
    kept = np.abs(x - running_median(x)) <= threshold
    return np.interp(time, time[kept], x[kept]) if kept.any() and not kept.all() else x


def running_median(x: np.ndarray) -> np.ndarray:
    """Return the median of `WINDOW` samples around each sample."""
    from scipy.ndimage import median_filter

    return np.asarray(median_filter(x, WINDOW, mode="nearest"))


def to_centre_of_mass(segment: Segment, positions: Mapping[str, Position]) -> dict[str, np.ndarray]:
    """Return the signals of a segment, those of sensors at `positions` moved to the centre of mass."""
    signals = dict(segment.signals)
    (p, dp), (q, dq), (r, dr) = (
        _rate_and_slope(segment, f"{axis}_rate") for axis in ("roll", "pitch", "yaw")
    )
    for name, (x, y, z) in positions.items():
        recorded = segment.signals[name]
        if name == "velocity_x":
            signals[name] = recorded - (q * z - r * y)
        elif name == "velocity_y":
            signals[name] = recorded - (r * x - p * z)
        elif name == "acceleration_x":
            signals[name] = recorded - (dq * z - dr * y - (q * q + r * r) * x + p * (q * y + r * z))
        elif name == "acceleration_y":
            signals[name] = recorded - (dr * x - dp * z - (p * p + r * r) * y + q * (p * x + r * z))
        elif name == "sideslip" and "velocity_x" in segment.signals:
            forward = segment.signals["velocity_x"]
            moved = np.arctan2((forward - r * y) * np.tan(recorded) - (r * x - p * z), forward)
            # at rest, and near 90 degrees, where v_x says nothing of v_y, it stays as recorded
            signals[name] = np.where(np.abs(forward) < LEAST_SPEED, recorded, moved)
    return signals


def _rate_and_slope(segment: Segment, name: str) -> tuple[np.ndarray, np.ndarray]:
    """Return an angular rate and its derivative, without noise above `OF_ROTATION`; zeros if not recorded."""
    if name not in segment.signals:
        return np.zeros(segment.time.size), np.zeros(segment.time.size)
    even = segment.even()
    rate = even.signals[name]
    smooth = LowPass(OF_ROTATION)(rate, even.rate) if even.rate > 2.5 * OF_ROTATION else rate
    slope = np.gradient(smooth, even.time)
    return np.interp(segment.time, even.time, smooth), np.interp(segment.time, even.time, slope)
