"""Why a car was lost: sentences made from the events of a run.

`why` finds the loss (a spin, a cone, a sideslip past its bound) and what came before it. The first sentence
names the cause: the first of `CAUSES` that was at work before the loss. They stand in the order in which one
explains the other: a fault explains a wrong moment, a wrong moment explains a late one, and an axle at its
grip explains a spin only where nothing else does. The sentences after it say what followed, in the order of
time, and how the loss looked.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from yawbench.orchestrator.results.run_record import EventRecord

from .kinds import KINDS

LOSSES = ("car-spins", "car-rolls-over", "cone-hit", "sideslip-past")
"""Kinds of events that are losses; of those in a run the first counts."""
LATE = 0.1
"""How much later than an axle at its grip an intervention is late [s]. Chosen: a driver's quickest answer is
five times that."""
SATURATED = 0.5
"""Share of the time from grip to loss for which a moment at its limit is the cause; chosen: half of it."""


@dataclass(frozen=True)
class Reason:
    """A sentence on a run, with the event that it is made from."""

    sentence: str
    event: EventRecord | None = None
    beside: bool = False  # whether the event is one of the best run

    def __str__(self) -> str:
        return self.sentence


@dataclass(frozen=True)
class Course:
    """The events of a run, as far as they came before its loss."""

    events: Sequence[EventRecord]
    loss: EventRecord

    def of(self, *kinds: str) -> list[EventRecord]:
        """Return the events of some kinds that began before the loss."""
        return [event for event in self.events if event.kind in kinds and event.time < self.loss.time]

    def first(self, *kinds: str) -> EventRecord | None:
        return next(iter(self.of(*kinds)), None)

    @property
    def begin(self) -> float:
        """When the loss began to build up [s]: with an axle at its grip, or the steering."""
        first = self.first("axle-at-grip") or self.first("yaw-rate-past", "steering")
        return first.time if first else self.loss.time

    def share(self, kind: str, begin: float, end: float) -> float:
        """Return the share of a span of time [s] in which events of a kind lasted."""
        if end <= begin:
            return 0.0
        total = 0.0
        for event in self.events:
            if event.kind == kind:
                until = end if event.until is None else event.until
                total += max(0.0, min(until, end) - max(event.time, begin))
        return total / (end - begin)


Cause = Callable[[Course], Reason | None]


def _first(kind: str, words: Callable[[EventRecord], str]) -> Cause:
    """Return the cause that is the first event of a kind, in words."""

    def cause(course: Course) -> Reason | None:
        event = course.first(kind)
        return Reason(words(event), event) if event else None

    return cause


def _against(course: Course) -> Reason | None:
    """A moment that turns the car further away, for most of the time in which there was one."""
    against, acts = course.of("moment-against"), course.of("intervention")
    if not against or not acts:
        return None
    begin = max(acts[0].time, against[0].time - 0.5)
    wrong = course.share("moment-against", begin, course.loss.time)
    acting = course.share("intervention", begin, course.loss.time)
    if wrong < 0.25 or wrong < SATURATED * acting * 0.5:
        return None
    worst = max(against, key=lambda event: event.value or 0.0)
    says = f"the yaw moment has the wrong sign: it turns the car further away from {_at(against[0])}"
    return Reason(f"{says}, with up to {_quantity(worst)}", against[0])


def _misjudged(course: Course) -> Reason | None:
    told, asked = course.first("friction-misjudged"), course.first("reference-past")
    if told is None or asked is None:
        return None
    says = f"control is told {_number(told.value)} % more friction than there is, and asks from {_at(asked)} "
    return Reason(f"{says}for {_number(asked.value)} % of the yaw rate that grip can hold", told)


def _nothing(course: Course) -> Reason | None:
    if course.of("intervention"):
        return None
    return Reason(f"nothing acts: no controller asks for a yaw moment until {_at(course.loss)}", None)


def _unmet(course: Course) -> Reason | None:
    """Wheels that give less than half of what is asked for: they slip, or their actuators are late."""
    unmet = [event for event in course.of("request-unmet") if _reaches(event, course)]
    if not unmet:
        return None
    first = unmet[0]
    lacking = course.share("request-unmet", first.time, course.loss.time)
    if lacking < SATURATED:
        return None
    most = max(event.value or 0.0 for event in unmet)
    lacks = f"from {_at(first)} the forces asked for are missed by up to {_number(most)} %"
    slips = [event for event in course.of("wheel-slips") if event.until is None or event.until > first.time]
    slipping = course.share("wheel-slips", first.time, course.loss.time)
    if slips and slipping > SATURATED * lacking:
        where, limit = slips[0].where, _number(slips[0].limit)
        return Reason(
            f"the brakes are released: the {where} slips by more than {limit} %, and {lacks}", slips[0]
        )
    return Reason(f"the wheels are late: {lacks}", first)


def _late(course: Course) -> Reason | None:
    """An intervention that begins well after an axle is at its grip, or after the car turns too fast."""
    acts = course.first("intervention")
    need = course.first("axle-at-grip", "yaw-rate-past")
    if acts is None or need is None or acts.time - need.time < LATE:
        return None
    says = f"the controller acts late: from {_at(acts)}, {acts.time - need.time:.2f} s after {_place(need)}"
    return Reason(says, acts)


def _saturated(course: Course) -> Reason | None:
    limits = [event for event in course.of("moment-at-limit", "torque-at-limit") if _reaches(event, course)]
    if not limits:
        return None
    first = limits[0]
    if course.share(first.kind, max(course.begin, first.time), course.loss.time) < SATURATED:
        return None
    what = f"the yaw moment is at its limit of {_quantity(first)}"
    if first.kind == "torque-at-limit":
        what = f"the {first.where} is at the limit of its brake or motor"
    return Reason(f"{what} from {_at(first)}", first)


def _reaches(event: EventRecord, course: Course) -> bool:
    """Whether an event lasts into the time in which the loss builds up."""
    return event.until is None or event.until > course.begin


def _slips(course: Course) -> Reason | None:
    slips = [event for event in course.of("wheel-slips") if (event.value or 0.0) > LOCKED]
    if not slips:
        return None
    first = slips[0]
    return Reason(f"the {first.where} slips from {_at(first)}, by up to {_number(first.value)} %", first)


LOCKED = 50.0
"""Slip from which a wheel has lost its side force [%]; chosen: well past the largest force of any tyre."""


CAUSES: tuple[Cause, ...] = (
    _first("fault", lambda fault: f"the fault in {fault.where} acts from {_at(fault)}"),
    _first(
        "sensor-off",
        lambda off: f"the measured {off.where} is wrong from {_at(off)}, by up to {_number(off.value)}",
    ),
    _against,
    _first(
        "friction-falls",
        lambda falls: (
            f"the friction under a wheel falls at {_at(falls)}, to {_number(falls.value)} % of what it was"
        ),
    ),
    _misjudged,
    _nothing,
    _late,
    _slips,
    _unmet,
    _saturated,
    _first("wind", lambda wind: f"side wind of up to {_quantity(wind)} from {_at(wind)}"),
    _first("axle-at-grip", lambda grip: f"the {grip.where} is at its grip from {_at(grip)}"),
    _first(
        "reference-past",
        lambda asked: (
            f"more yaw rate is asked for than grip can hold, {_number(asked.value)} % of it from {_at(asked)}"
        ),
    ),
)
"""Causes in the order in which one explains the next."""


def why(events: Sequence[EventRecord], best: Sequence[EventRecord] | None = None) -> list[Reason]:
    """Return at most three sentences on why a car was lost, the cause first; empty if it was not.

    Args:
        events: of the run, in the order of their begin.
        best: those of the run that did best under the same conditions, to compare with.
    """
    loss = next((event for event in events if event.kind in LOSSES), None)
    if loss is None:
        return []
    course = Course(events, loss)
    found = [reason for cause in CAUSES if (reason := cause(course)) is not None]
    first, rest = found[:1], found[1:]
    follows = sorted((reason for reason in rest if reason.event), key=lambda reason: reason.event.time)  # type: ignore[union-attr]
    lost = Reason(_lost(course), loss)
    beside = list(_beside(course, best)) if best is not None else []
    middle = beside or follows[:1]
    return [*first, *middle, lost][:3]


class Lost(NamedTuple):
    """A run whose car was lost: its number, why, and the number of the run that did best beside it."""

    run: int
    reasons: list[Reason]
    best: int | None


def lost_among(runs: Sequence[Sequence[EventRecord]], *, comparable: bool = True) -> list[Lost]:
    """Return the runs, of several given by their events, whose cars were lost, and why.

    Args:
        runs: their events.
        comparable: whether they are runs under the same conditions; then the one that turned aside least of
            those that were not lost stands beside.
    """
    held = [number for number, events in enumerate(runs) if comparable and not lost(events)]
    best = min(held, key=lambda number: furthest_aside(runs[number]), default=None)
    found = (
        Lost(number, why(events, None if best is None else runs[best]), best)
        for number, events in enumerate(runs)
    )
    return [one for one in found if one.reasons]


def lost(events: Sequence[EventRecord]) -> bool:
    """Return whether a car was lost."""
    return any(event.kind in LOSSES for event in events)


def furthest_aside(events: Sequence[EventRecord]) -> float:
    """Return how far beyond grip a car turned [%], 0 if it never did: runs with less did better."""
    return max((event.value or 0.0 for event in events if event.kind == "yaw-rate-past"), default=0.0)


def _beside(course: Course, best: Sequence[EventRecord]) -> Iterator[Reason]:
    """Yield how the best run differs in when its controller begins to act after the steering."""
    own = course.first("intervention")
    other = next((event for event in best if event.kind == "intervention"), None)
    if other is None:
        return
    if own is None:
        yield Reason(f"the best controller acts from {_at(other)}", other, beside=True)
        return
    earlier = own.time - other.time
    if abs(earlier) >= 0.01:
        when = f"{abs(earlier):.2f} s {'earlier' if earlier > 0 else 'later'}"
        yield Reason(f"the best controller begins to act {when}, at {_at(other)}", other, beside=True)
    else:
        strongest = max((e.value or 0.0 for e in best if e.kind == "intervention"), default=0.0)
        mine = max((e.value or 0.0 for e in course.of("intervention")), default=0.0)
        if mine and strongest > 1.1 * mine:
            unit = other.unit
            yield Reason(
                f"the best controller begins at the same time, but asks for up to {_value(strongest, unit)} "
                f"instead of {_value(mine, unit)}",
                other,
                beside=True,
            )


def _lost(course: Course) -> str:
    loss = course.loss
    spins = next((event for event in course.events if event.kind == "car-spins"), None)
    if loss.kind == "cone-hit":
        return f"a cone is hit at {_at(loss)}, by {_number(loss.value)} m"
    if loss.kind == "car-rolls-over":
        return f"the car leans more than {_number(loss.limit)} degrees from {_at(loss)}"
    says = f"the sideslip passes {_number(loss.limit)} degrees at {_at(loss)}"
    if spins is not None and loss.kind != "car-spins":
        return f"{says}, and the car spins from {_at(spins)}"
    return f"{says}, and reaches {_number(loss.value)}"


def _place(event: EventRecord) -> str:
    where = f"the {event.where} " if event.where else ""
    return f"{where}{KINDS[event.kind].words}"


def label_of(event: EventRecord) -> str:
    """Return where an event happens, and what."""
    if event.kind == "fault":
        return f"fault: {event.where}"
    words = KINDS[event.kind].words if event.kind in KINDS else event.kind
    return f"{event.where} {words}".strip()


def far_of(event: EventRecord, unit: str) -> str:
    """Return how far an event goes, in a unit; "" if it tells no value."""
    return _value(event.value, unit)


def sentence(event: EventRecord) -> str:
    """Return an event in words: where, what happens, from when to when, how far."""
    until = "" if event.until is None else f" to {event.until:.2f} s"
    far = far_of(event, event.unit)
    return f"{label_of(event)} from {_at(event)}{until}{far and f': {far}'}"


def _at(event: EventRecord) -> str:
    return f"{event.time:.2f} s"


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:.3g}"


def _quantity(event: EventRecord) -> str:
    return _value(event.value, event.unit)


def _value(value: float | None, unit: str) -> str:
    if value is None:
        return ""
    if unit in ("N.m", "N") and abs(value) >= 999.5:
        return f"{value / 1000:.3g} k{unit}"
    return f"{value:.3g} {'' if unit in ('1', 'SI') else unit}".strip()
