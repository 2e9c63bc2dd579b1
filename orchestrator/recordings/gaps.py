"""Gaps of recordings: stretches without samples, found by the times of a signal.

Nothing is known of a signal in a gap, so nothing goes through it in silence: `measured show` names it, a
standard test that needs the signal is not judged, a fit refuses a window with it, a run whose input follows
it has a warning, comparisons leave it out, and figures show it as a span.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from yawbench.foundation.errors import Diagnostic, Location
from yawbench.foundation.messages import counted, span

GAP = 3.5
"""Step over the usual one from which it is a gap: three samples in a row are missing. Chosen: jitter of a
third of a step makes at most twice the usual one, and one sample or two do not change a curve."""
USUAL = 0.95
"""Share of steps that are at most the usual one. Chosen: a recording with two rates has no gaps."""
ONE = 0.8
"""Share of the longer of two signals' gaps that they have in common if they are one."""
ROUNDING = 1e-9
"""Distance of times that count as the same [s]; chosen: a nanosecond, far below any step."""
MOST = 20
"""Gaps of a segment that have a warning each."""
Samples = tuple[np.ndarray, np.ndarray]
"""Times [s] and values of a signal; NaN: none was taken."""


class Gap(NamedTuple):
    """A stretch without samples: the times of the last sample before and the first one after it [s]."""

    begin: float
    end: float

    def __str__(self) -> str:
        return f"{span(*self)} s"

    @property
    def length(self) -> float:
        """Its duration [s]."""
        return self.end - self.begin

    def overlaps(self, begin: float, end: float) -> bool:
        """Return whether it shares time with begin to end [s]."""
        return self.begin < end and begin < self.end

    def later(self, by: float) -> Gap:
        """Return the gap on a clock whose times are larger by so much [s]."""
        return Gap(self.begin + by, self.end + by)


def gaps_in(times: np.ndarray) -> tuple[Gap, ...]:
    """Return the gaps of increasing times [s]; shape (rows,)."""
    steps = np.diff(times)
    if steps.size < 2:
        return ()
    usual = float(np.quantile(steps, USUAL, method="lower"))
    before = np.flatnonzero(steps > GAP * usual)
    return tuple(Gap(float(times[k]), float(times[k + 1])) for k in before)


def between_gaps(read: Mapping[str, Samples]) -> list[tuple[str, dict[str, Samples]]]:
    """Return number, "" of a single one, and samples of the parts that no gap of any signal interrupts.

    Parts in which a signal has less than two samples are left out.
    """
    taken = {signal: np.unique(t[~np.isnan(x)]) for signal, (t, x) in read.items()}
    clock = np.unique(np.concatenate([*taken.values()]))
    found = []
    for rows in parts_between((gap for t in taken.values() for gap in gaps_in(t)), clock):
        first, last = clock[rows][0], clock[rows][-1]
        inside = {signal: (t >= first) & (t <= last) for signal, (t, _) in read.items()}
        part = {signal: (t[inside[signal]], x[inside[signal]]) for signal, (t, x) in read.items()}
        if all(np.count_nonzero(~np.isnan(x)) > 1 for _, x in part.values()):
            found.append(part)
    return [(str(number) if len(found) > 1 else "", part) for number, part in enumerate(found, start=1)]


def outside(gaps: Iterable[Gap], times: np.ndarray) -> np.ndarray:
    """Return which times [s] are not in gaps; their ends are samples. Shape (rows,)."""
    kept = np.ones(times.size, dtype=bool)
    for begin, end in gaps:
        kept &= (times <= begin + ROUNDING) | (times >= end - ROUNDING)
    return kept


def parts_between(gaps: Iterable[Gap], times: np.ndarray) -> Iterator[slice]:
    """Yield the rows of the parts of times [s] that no gap interrupts, without those in gaps."""
    every = list(gaps)
    number, lost = np.zeros(times.size, dtype=int), ~outside(every, times)
    for gap in every:
        number[times >= gap.end - ROUNDING] += 1
    number[lost] = -1
    edges = [0, *(int(k) + 1 for k in np.flatnonzero(np.diff(number))), times.size]
    yield from (slice(first, end) for first, end in pairwise(edges) if end > first and not lost[first])


def by_signals(gaps: Mapping[str, tuple[Gap, ...]], signals: Iterable[str]) -> list[tuple[str, Gap]]:
    """Return the gaps in their order, each with the signals that share it, as "a, b"; "": all of them.

    Args:
        gaps: signal -> its gaps.
        signals: all of the recording.
    """
    every = list(signals)
    shared: list[tuple[list[str], Gap]] = []
    for gap, name in sorted((gap, signal) for signal in every for gap in gaps.get(signal, ())):
        for k in range(len(shared) - 1, max(len(shared) - 1 - len(every), -1), -1):
            names, known = shared[k]
            if name not in names and _alike(known, gap):
                shared[k] = [*names, name], Gap(known.begin, max(known.end, gap.end))
                break
        else:
            shared.append(([name], gap))
    return [("" if len(names) == len(every) else ", ".join(names), gap) for names, gap in shared]


def _alike(a: Gap, b: Gap) -> bool:
    """Return whether gaps are one, of signals with rates or delays of their own."""
    common = min(a.end, b.end) - max(a.begin, b.begin)
    return common >= ONE * max(a.end - a.begin, b.end - b.begin)


def notes_on(
    gaps: Mapping[str, tuple[Gap, ...]], signals: Iterable[str], segment: str, start: float = 0.0
) -> list[Diagnostic]:
    """Return a warning for each gap of a segment, with its begin and its length, of many for the longest.

    Args:
        gaps: signal -> its gaps.
        signals: all of the segment.
        segment: its name.
        start: the time that becomes 0 [s].
    """
    found = by_signals(gaps, signals)
    shortest_named = sorted((gap.length for _, gap in found), reverse=True)[:MOST][-1:]
    notes = [
        Diagnostic(
            "measurement-gap",
            f"{segment}: no samples{f' of {names}' * bool(names)} from {gap.later(-start)}",
            "warning",
            Location(signal=names or None, time=gap.begin - start),
            gap.length,
        )
        for names, gap in found
        if gap.length >= shortest_named[0]
    ][:MOST]
    if len(found) > len(notes):
        rest = counted(len(found) - len(notes), "shorter stretch", "shorter stretches")
        notes.append(Diagnostic("measurement-gap", f"{segment}: {rest} without samples", "warning"))
    return notes


def gaps_noted(notes: Iterable[Diagnostic]) -> Iterator[tuple[str, Gap]]:
    """Yield the gaps that diagnostics tell of, each with its signals as "a, b"; "": all of them."""
    for note in notes:
        if note.code == "measurement-gap" and note.location.time is not None and note.value is not None:
            begin = note.location.time
            yield note.location.signal or "", Gap(begin, begin + note.value)
