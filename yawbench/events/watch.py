"""Finding events in the rows of a run: `EventWatch` while it is made, `events_of` afterwards.

An event is an interval in which a value computed from recorded signals, in SI, lies beyond a limit. Signals
are looked at block by block, so that runs of any length can be searched. Angles of a velocity count only
while the car moves (`vehicles.motion`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from yawbench.foundation.errors import Diagnostic, Location
from yawbench.metrics.expressions import angles_in, motion_of
from yawbench.metrics.measures import si_of
from yawbench.orchestrator.results.reader import Results
from yawbench.orchestrator.results.run_record import EventRecord
from yawbench.vehicles.motion import BACKWARDS, standing

SignalArrays = Sequence[np.ndarray]
"""The values of an event's signals over a block, in their order; shape (rows,) each."""
MOST = 100
"""Intervals of one kind at one place that are told apart; later ones extend the last. Chosen: more than a
person reads."""
BLOCK = 65536
"""Rows of recorded results looked at together."""


class Sought(NamedTuple):
    """An event to look for: the signals of one wheel, axle or car, and the limit there."""

    columns: tuple[str, ...]
    value: Callable[[SignalArrays], np.ndarray]
    limit: float | None  # in the unit of the kind; None: of the kind
    where: str = ""  # "front axle", "rear left wheel"; "" for the whole car


@dataclass(frozen=True)
class EventKind:
    """A kind of event: its name, words and limit, and where to look for it.

    `warning` may contain `{limit}`, `{value}`, `{size}` (absolute value), `{time}`, `{column}` and `{where}`.
    """

    name: str
    words: str  # what happens, after its place
    find: Callable[[Results], Iterable[Sought]]
    limit: float  # values above it are an event
    unit: str  # of limit and value
    why: str  # source of the limit
    below: bool = False  # values below the limit instead
    lasting: float = 0.0  # shorter ones are none [s]
    merge: float = 0.05  # intervals that follow within it [s] are one; chosen: shorter than a driver notices
    warning: str = ""  # sentence for a run in which it happens; "": it is no warning
    si: bool = True  # signals are looked at in SI, else as recorded
    from_setting_off: bool = False  # of a sideslip: counted from straight back for a car that reverses


class EventWatch:
    """Looks for events in the rows of a run as they are recorded.

    Args:
        results: with the record and the columns of the run; its rows are not looked at.
        kinds: what to look for.
    """

    def __init__(self, results: Results, kinds: Iterable[EventKind]) -> None:
        reals = [name for name, values in results.columns.items() if values.dtype.kind == "f"]
        index = {column: 1 + k for k, column in enumerate(reals)}
        angles = angles_in(results)

        def place(column: str, si: bool = True) -> _Place:
            return _Place(index[column], si_of(results.units.get(column, ""))[1] if si else 1.0)

        self.reals = reals
        self._states: list[_State] = []
        for kind in kinds:
            for sought in kind.find(results):
                if not all(column in index for column in sought.columns):
                    continue
                first = sought.columns[0]
                motion = motion_of(results, first).items() if first in angles else ()
                moving = {name: place(column) for name, column in motion if column in index}
                places = [place(column, kind.si) for column in sought.columns]
                self._states.append(_State(kind, sought, places, moving))

    @np.errstate(all="ignore")
    def look(self, rows: np.ndarray) -> None:
        """Look at rows: shape (n, 1 + Real columns), time first."""
        if rows.size:
            for state in self._states:
                state.look(rows)

    def warnings(self) -> tuple[Diagnostic, ...]:
        """Return the warnings so far, in the order of the kinds."""
        return tuple(filter(None, (state.warning() for state in self._states)))

    def found(self) -> list[EventRecord]:
        """Return the events so far, in the order of their begin."""
        return sorted(
            (event for state in self._states for event in state.events()), key=lambda event: event.time
        )


def events_of(results: Results, kinds: Iterable[EventKind]) -> list[EventRecord]:
    """Return the events of recorded results, in the order of their begin."""
    watch = EventWatch(results, kinds)
    columns = [results.time, *(results.columns[name] for name in watch.reals)]
    for begin in range(0, results.time.size, BLOCK):
        watch.look(np.column_stack([column[begin : begin + BLOCK] for column in columns]))
    return watch.found()


@dataclass(frozen=True)
class _Place:
    """Where a signal stands in rows, and the factor that makes it SI."""

    index: int
    factor: float

    def of(self, rows: np.ndarray) -> np.ndarray:
        return rows[:, self.index] if self.factor == 1.0 else rows[:, self.index] * self.factor


@dataclass
class _Interval:
    """An interval in which a value lies beyond its limit."""

    begin: float
    last: float  # the last instant beyond it
    most: float  # its furthest value there, times the sign of the kind
    end: float | None = None  # the first instant that is not, None: it lasts


class _State:
    """What has been seen so far of one event sought.

    `moving`: the places of the signals of the car's speed, for the angle of a velocity.
    """

    def __init__(
        self, kind: EventKind, sought: Sought, places: Sequence[_Place], moving: Mapping[str, _Place]
    ) -> None:
        self.kind = kind
        self.sought = sought
        self.limit = kind.limit if sought.limit is None else sought.limit
        self._places = places
        self._moving = moving
        self._backwards: bool | None = None  # of the present stretch of motion; None: the car stands
        self._sign = -1.0 if kind.below else 1.0
        self._intervals: list[_Interval] = []

    def look(self, rows: np.ndarray) -> None:
        signals = [place.of(rows) for place in self._places]
        stands = standing({name: place.of(rows) for name, place in self._moving.items()})
        if self.kind.from_setting_off:
            signals = [self._from_setting_off(signals[0], stands)]
        x = self._sign * self.sought.value(signals)
        if stands is not None:
            x[stands] = -math.inf
        beyond = x > self._sign * self.limit
        time = rows[:, 0]
        open_ = self._intervals[-1] if self._intervals and self._intervals[-1].end is None else None
        if open_ and not beyond[0]:
            open_.end = float(time[0])
        if not beyond.any():
            return
        edges = np.flatnonzero(np.diff(beyond, prepend=False, append=False)).tolist()
        for first, after in zip(edges[::2], edges[1::2], strict=True):
            end = float(time[after]) if after < len(time) else None
            found = _Interval(
                float(time[first]), float(time[after - 1]), float(np.fmax.reduce(x[first:after])), end
            )
            self._add(found, follows=bool(open_ and first == 0))

    def _add(self, found: _Interval, follows: bool) -> None:
        """Add an interval; `follows`: it goes on from the block before."""
        before = self._intervals[-1] if self._intervals else None
        if before and (
            follows or found.begin - before.last <= self.kind.merge or len(self._intervals) >= MOST
        ):
            before.last, before.end, before.most = found.last, found.end, max(before.most, found.most)
        else:
            self._intervals.append(found)

    def _from_setting_off(self, sideslip: np.ndarray, stands: np.ndarray | None) -> np.ndarray:
        """Return the sideslip [rad] from straight ahead, or from straight back where the car set off so."""
        moves = np.ones(sideslip.size, bool) if stands is None else ~stands
        begins = moves & ~np.append(self._backwards is not None, moves[:-1])
        begun = np.maximum.accumulate(np.where(begins, np.arange(sideslip.size), -1))
        backwards = np.where(begun < 0, bool(self._backwards), np.abs(sideslip[begun]) > BACKWARDS)
        if sideslip.size:
            self._backwards = bool(backwards[-1]) if moves[-1] else None
        return np.where(backwards, np.pi - np.abs(sideslip), sideslip)

    def events(self) -> Iterator[EventRecord]:
        kind = self.kind
        for found in self._intervals:
            if kind.lasting and (found.last if found.end is None else found.end) - found.begin < kind.lasting:
                continue
            yield EventRecord(
                time=found.begin,
                until=found.end,
                kind=kind.name,
                where=self.sought.where,
                value=self._sign * found.most,
                limit=self.limit,
                unit=kind.unit,
                signal=self.sought.columns[0],
            )

    def warning(self) -> Diagnostic | None:
        if not self._intervals or not self.kind.warning:
            return None
        value, column = self._sign * max(found.most for found in self._intervals), self.sought.columns[0]
        begin = self._intervals[0].begin
        message = self.kind.warning.format(
            limit=f"{self.limit:g}",
            value=f"{value:.3g}",
            size=f"{abs(value):.3g}",
            time=f"{begin:.3g}",
            where=self.sought.where,
            column=column,
        )
        where = Location(signal=column, time=begin)
        return Diagnostic(self.kind.name, message, "warning", where, value)
