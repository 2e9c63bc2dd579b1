"""Signals in which two runs differ: from when on, by how much, and what they go to."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from yawbench.figures.display import shown, unit_of_signal
from yawbench.foundation.messages import counted, resolved, span, star
from yawbench.measurements.measured_results import MeasuredResults
from yawbench.metrics.expressions import angles_in, standing_in
from yawbench.orchestrator.recordings.gaps import gaps_noted, outside
from yawbench.orchestrator.results.reader import Results
from yawbench.orchestrator.results.run_record import RunRecord
from yawbench.orchestrator.signal_names import SignalName
from yawbench.studies.tables import Table
from yawbench.vehicles.motion import nearest_turn
from yawbench.vocabulary.wheels import WHEELS

SAME = 1e-9
"""Differences below this, relative to the signal's peak, are ignored; chosen: far above rounding, far below
any physics."""
SEEN = 0.01
"""Difference that is visible in a figure, relative to the signal's peak; chosen: the width of a line."""


@dataclass(frozen=True)
class SignalDifference:
    """A signal that differs between two runs: from when on, and by how much."""

    signal: str  # instance.variable, four wheels as one with `*`
    targets: tuple[str, ...]  # instances that take it as an input
    first: float  # s
    seen: float | None  # [s], when they differ by SEEN of the signal's peak; None: never
    largest: float  # in the signal's unit
    largest_at: float  # s
    unit: str
    relative: float = 1.0  # largest difference over the signal's peak


@dataclass(frozen=True)
class RunComparison:
    """All signals that differ, earliest first, and those that could not be compared."""

    partings: tuple[SignalDifference, ...]
    compared: int  # number of signals
    notes: tuple[str, ...]
    times: int  # number of times at which they were compared

    @property
    def compares_nothing(self) -> bool:
        """Whether the runs have no signal or no time in common."""
        return not self.compared or not self.times


@np.errstate(all="ignore")
def divergence(first: Results, second: Results) -> RunComparison:
    """Compare all signals that both runs recorded, at their common times.

    A recording has times of its own: the other run is interpolated to them, as far as both reach and outside
    gaps. Signals that begin to differ at the same time are in evaluation order, so that causes come first.
    """
    rows, others = _common(first.time, second.time)
    measured = next((run for run in (first, second) if isinstance(run, MeasuredResults)), None)
    notes = [
        f"only {which} recorded {', '.join(dict.fromkeys(star(name) for name in missing))}"
        for which, missing in (
            ("the first", [name for name in first if name not in second]),
            ("the other", [name for name in second if name not in first]),
        )
        if missing
    ]
    shared = [name for name in first if name in second]
    if measured is not None and (inside := _inside(measured, second if measured is first else first)).size:
        time = measured.time[inside]
        values = [{name: _at(time, run, name) for name in shared} for run in (first, second)]
        if any(not np.array_equal(run.time, time) for run in (first, second)):
            where = f"of the recording, {span(time[0], time[-1])} s"
            notes.append(f"compared at {counted(time.size, 'time')} {where}")
    else:
        time = first.time[rows]
        values = [
            {name: run.columns[name][kept] for name in shared}
            for run, kept in ((first, rows), (second, others))
        ]
        if not rows.size:
            notes.append(_no_common_time(first, second))
        elif rows.size < max(first.time.size, second.time.size):
            notes.append(f"compared at the {rows.size} times that both runs have")
    by_signal: dict[str, SignalDifference] = {}
    angles = angles_in(first)
    for name in shared if time.size else []:
        ours, theirs = (run[name] for run in values)
        if name in angles:  # they mean something while both cars move
            for run in (first, second):
                if (stands := standing_in(run, name)) is not None:
                    there = np.interp(time, run.time, stands) > 0.0
                    ours, theirs = (np.where(there, np.nan, x) for x in (ours, theirs))
            if first.units[name] == second.units[name] == "rad":
                ours = nearest_turn(ours, theirs)
        parting = _parting(name, time, ours, theirs, first)
        if parting is not None:
            known = by_signal.get(parting.signal)
            by_signal[parting.signal] = parting if known is None else _together(known, parting)
    order = {instance: i for i, instance in enumerate(first.record.evaluation_order)}
    ranked = sorted(
        by_signal.values(),
        key=lambda p: (p.first, order.get(SignalName.parse(p.signal).instance, len(order))),
    )
    return RunComparison(tuple(ranked), len(shared), tuple(notes), time.size)


def _inside(measured: MeasuredResults, other: Results) -> np.ndarray:
    """Return the rows of a recording whose times lie within another run, and outside its gaps."""
    if not other.time.size:
        return np.zeros(0, dtype=int)
    time = measured.time
    inside = (time >= other.time[0] - 1e-9) & (time <= other.time[-1] + 1e-9)
    notes = (*measured.record.all_diagnostics, *other.record.all_diagnostics)
    return np.flatnonzero(inside & outside((gap for _, gap in gaps_noted(notes)), time))


def _at(time: np.ndarray, run: Results, name: str) -> np.ndarray:
    """Return a signal of a run at some times, interpolated; text as of the row before."""
    values = run.columns[name]
    if not np.issubdtype(values.dtype, np.number):
        return values[np.clip(np.searchsorted(run.time, time + 1e-9, side="right") - 1, 0, None)]
    return np.asarray(np.interp(time, run.time, values))


def _no_common_time(first: Results, second: Results) -> str:
    """Return that two runs have no time in common, and what moves a recording to the run."""
    ends = [
        f"{span(run.time[0], run.time[-1])} s" if run.time.size else "no time at all"
        for run in (first, second)
    ]
    words = f"the runs have no time in common: the first has {ends[0]}, the other {ends[1]}"
    both = first.time.size and second.time.size
    measured = next((run for run in (first, second) if isinstance(run, MeasuredResults)), None)
    if measured is None or not both:
        return words
    return f"{words}; --from '{measured.time[0]:.12g} s' begins the recording with the run"


def _common(first: np.ndarray, second: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the row indices of both arrays at which the times agree to a nanosecond."""
    _, rows, others = np.intersect1d(
        np.round(first * 1e9).astype(np.int64), np.round(second * 1e9).astype(np.int64), return_indices=True
    )
    return rows, others


def _parting(
    name: str, time: np.ndarray, a: np.ndarray, b: np.ndarray, run: Results
) -> SignalDifference | None:
    if not (np.issubdtype(a.dtype, np.number) and np.issubdtype(b.dtype, np.number)):
        unlike = np.flatnonzero(a.astype(str) != b.astype(str))
        if not unlike.size:
            return None
        first = float(time[unlike[0]])
        return SignalDifference(
            star(name), targets_of(run.record, name), first, first, float("nan"), first, ""
        )
    with np.errstate(invalid="ignore"):
        apart = np.abs(a - b)
    apart = np.where(np.isnan(a) & np.isnan(b), 0.0, np.where(np.isnan(apart), np.inf, apart))
    sizes = np.abs(np.concatenate([a, b]))
    sizes = sizes[np.isfinite(sizes)]
    peak = float(sizes.max()) if sizes.size else 0.0
    unlike = np.flatnonzero(apart > SAME * peak)
    if not unlike.size:
        return None
    visible = np.flatnonzero(apart > SEEN * peak)
    largest = int(np.argmax(apart))
    return SignalDifference(
        signal=star(name) if name[-2:] in WHEELS else name,
        targets=targets_of(run.record, name),
        first=float(time[unlike[0]]),
        seen=float(time[visible[0]]) if visible.size else None,
        largest=float(apart[largest]),
        largest_at=float(time[largest]),
        unit=run.units[name],
        relative=float(apart[largest]) / peak,
    )


def _together(first: SignalDifference, second: SignalDifference) -> SignalDifference:
    """Merge the differences of two wheels: the earliest times, the largest difference."""
    widest = max(first, second, key=lambda parting: parting.largest)
    times = [parting.seen for parting in (first, second) if parting.seen is not None]
    return SignalDifference(
        first.signal, first.targets, min(first.first, second.first), min(times, default=None),
        widest.largest, widest.largest_at, first.unit, widest.relative,
    )  # fmt: skip


def targets_of(record: RunRecord, signal: str) -> tuple[str, ...]:
    """Return the instances that a recorded signal is connected to, taken from the run record."""
    name = SignalName.parse(signal)
    return tuple(dict.fromkeys(wire.target.instance for wire in record.connections if wire.source == name))


def parting_summary(comparison: RunComparison) -> str:
    """Return a sentence on the signals that differ first."""
    if not comparison.compared:
        return "The runs have no signal in common."
    if not comparison.times:
        return "The runs have no time in common, so nothing was compared."
    if not comparison.partings:
        which = (
            "The only signal they share is"
            if comparison.compared == 1
            else f"All {comparison.compared} signals are"
        )
        return f"{which} the same throughout."
    first = comparison.partings[0]
    others = [parting.signal for parting in comparison.partings if parting.first == first.first][1:]
    more = " and others" if len(others) > 3 else ""
    then = f", then {', '.join(others[:3])}{more} in the same step" if others else ""
    visible = [(parting.seen, parting.signal) for parting in comparison.partings if parting.seen is not None]
    sentence = "The difference is not visible in any curve."
    if visible:
        at, signal = min(visible, key=lambda item: item[0])
        sentence = f"It is visible from {at:g} s on, first in {signal}."
    return f"The first to differ is {first.signal}, at {first.first:g} s{then}. {sentence}"


def partings_table(partings: Sequence[SignalDifference], title: str = "") -> Table:
    """Return the table of signals that differ between two runs, the earliest first."""
    headings = ["signal", "goes to", "differs from", "visible from", "largest difference", "at"]
    table = Table(title, headings, numbers={2, 3, 4, 5} if partings else set())
    for parting in partings:
        table.rows.append([
            parting.signal,
            ", ".join(parting.targets) or "recorded only",
            f"{parting.first:g} s",
            None if parting.seen is None else f"{parting.seen:g} s",
            None if math.isnan(parting.largest) else shown(parting.largest, unit_of_signal(parting.unit)),
            f"{parting.largest_at:g} s",
        ])  # fmt: skip
    return table


def outcome_table(comparison: RunComparison, first: Results, second: Results) -> Table:
    """Return the table of all signals that differ, with notes on what could not be compared."""
    table = partings_table(comparison.partings, "What came out")
    ended = [float(run.time[-1]) for run in (first, second) if run.time.size]
    ends = {f"{end} s" for end in resolved(*ended)}
    table.notes += comparison.notes
    table.notes += [f"The runs end at {' and '.join(sorted(ends))}."] if len(ends) > 1 else []
    if comparison.compares_nothing:
        table.notes.append("Nothing was compared.")
    else:
        compared = f"{counted(comparison.compared, 'signal')} compared at {counted(comparison.times, 'time')}"
        same = "the others are the same" if comparison.partings else "no difference"
        table.notes.append(f"{compared}; {same}.")
    return table
