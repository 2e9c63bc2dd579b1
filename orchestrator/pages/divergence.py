"""What differs between two runs: what they were made of; in which signals, when and how far they part."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from vocabulary.wheels import WHEELS

from ..experiments.tables import Table
from ..metrics.run_metrics import Value
from ..results.read import Results
from ..titles import changed, changes_in
from ..wording import counted, star

SAME = 1e-9
"""A difference over the signal's peak that is none; chosen: far above rounding, far below any physics."""
SEEN = 0.01
"""A difference over the signal's peak that a reader of curves sees; chosen: a line's width in a figure."""


@dataclass(frozen=True)
class Parting:
    """A signal that two runs do not share: when they part, and how far apart they get."""

    signal: str  # unit.variable, four wheels as one with `*`
    targets: tuple[str, ...]  # units that take it as an input
    first: float  # s
    seen: float | None  # s; when they differ by SEEN of the signal's peak; None: never
    largest: float  # in the signal's unit
    largest_at: float  # s
    unit: str
    relative: float = 1.0  # the largest difference over the signal's peak


@dataclass(frozen=True)
class Divergence:
    """All signals that differ, those that part first in front; and what could not be compared."""

    partings: tuple[Parting, ...]
    compared: int  # signals
    notes: tuple[str, ...]


def divergence(one: Results, other: Results) -> Divergence:
    """Compare all signals that both runs recorded, at the times that both have.

    Signals that part at the same time stand in the order of evaluation, so that causes come first.
    """
    rows, others = _common(one.time, other.time)
    notes = [
        f"only {which} recorded {', '.join(dict.fromkeys(star(name) for name in missing))}"
        for which, missing in (
            ("the first", [name for name in one if name not in other]),
            ("the other", [name for name in other if name not in one]),
        )
        if missing
    ]
    if rows.size < max(one.time.size, other.time.size):
        notes.append(f"compared at the {rows.size} times that both runs have")
    shared = [name for name in one if name in other]
    time = one.time[rows]
    found: dict[str, Parting] = {}
    for name in shared if rows.size else []:
        parting = _parting(name, time, one.columns[name][rows], other.columns[name][others], one)
        if parting is not None:
            known = found.get(parting.signal)
            found[parting.signal] = parting if known is None else _together(known, parting)
    order = {unit: i for i, unit in enumerate(one.run.get("evaluation_order", []))}
    ranked = sorted(
        found.values(), key=lambda p: (p.first, order.get(p.signal.partition(".")[0], len(order)))
    )
    return Divergence(tuple(ranked), len(shared), tuple(notes))


def _common(one: np.ndarray, other: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the rows of both at which the times are the same to a nanosecond."""
    _, rows, others = np.intersect1d(
        np.round(one * 1e9).astype(np.int64), np.round(other * 1e9).astype(np.int64), return_indices=True
    )
    return rows, others


def _parting(name: str, time: np.ndarray, a: np.ndarray, b: np.ndarray, run: Results) -> Parting | None:
    if not (np.issubdtype(a.dtype, np.number) and np.issubdtype(b.dtype, np.number)):
        unlike = np.flatnonzero(a.astype(str) != b.astype(str))
        if not unlike.size:
            return None
        first = float(time[unlike[0]])
        return Parting(star(name), targets_of(run.run, name), first, first, float("nan"), first, "")
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
    return Parting(
        signal=star(name) if name[-2:] in WHEELS else name,
        targets=targets_of(run.run, name),
        first=float(time[unlike[0]]),
        seen=float(time[visible[0]]) if visible.size else None,
        largest=float(apart[largest]),
        largest_at=float(time[largest]),
        unit=run.units[name],
        relative=float(apart[largest]) / peak,
    )


def _together(one: Parting, other: Parting) -> Parting:
    """Return one parting of two wheels: the earliest moments, the largest difference."""
    widest = max(one, other, key=lambda parting: parting.largest)
    seen = [parting.seen for parting in (one, other) if parting.seen is not None]
    return Parting(
        one.signal, one.targets, min(one.first, other.first), min(seen, default=None),
        widest.largest, widest.largest_at, one.unit, widest.relative,
    )  # fmt: skip


def targets_of(run: Mapping[str, Any], signal: str) -> tuple[str, ...]:
    """Return the units that take a recorded signal, as the run's record says."""
    wires = run.get("connections", [])
    return tuple(dict.fromkeys(wire["to"].partition(".")[0] for wire in wires if wire["from"] == signal))


OF_RUN = ("status", "title", "algorithm", "step_size", "stop_time", "rows")
"""Parts of a record that stand in the table by themselves."""


class Difference(NamedTuple):
    """A part of two records that is not the same; None where a record has no such part."""

    place: str
    one: Any
    other: Any


def differences(one: Mapping[str, Any], other: Mapping[str, Any]) -> list[Difference]:
    """Return what differs between the records of two runs: scenario, units, wires, versions."""
    first, second = dict(_facts(one)), dict(_facts(other))
    exchanged = tuple(f"{unit}." for unit in _names(one) if _names(one)[unit] != _names(other).get(unit))
    both = first.keys() & second.keys()
    return [
        Difference(place, first.get(place), second.get(place))
        for place in dict.fromkeys([*first, *second])
        # units of two kinds share few parameters; that one of them has others is no news
        if first.get(place) != second.get(place) and (place in both or not place.startswith(exchanged))
    ]


def _names(run: Mapping[str, Any]) -> dict[str, Any]:
    return {unit: fmu.get("name") for unit, fmu in run.get("fmus", {}).items()}


def _facts(run: Mapping[str, Any]) -> Iterator[tuple[str, Any]]:
    """Yield place and value of everything that may differ."""
    scenario = run.get("scenario", {})
    yield "scenario", scenario.get("file")
    yield "vehicle file", scenario.get("vehicle")
    yield "changed", changed(changes_in(run)) or None
    for key in OF_RUN:
        yield key, run.get(key)
    for unit, fmu in run.get("fmus", {}).items():
        yield unit, f"{fmu.get('name')} ({str(fmu.get('sha256', ''))[:8]})"
        yield f"{unit}.step_size", fmu.get("step_size")
        for kind in ("defaults", "parameters", "constants"):
            for name, value in fmu.get(kind, {}).items():
                yield f"{unit}.{name}", value
    for wire in run.get("connections", []):
        text = wire if isinstance(wire, str) else f"{wire.get('from')} -> {wire.get('to')}"
        yield text, "connected"
    for fault in run.get("faults", []):
        yield f"fault of {fault.get('on')}", fault.get("fault")
    yield from run.get("versions", {}).items()


def differences_table(found: list[Difference], one: str, other: str) -> Table:
    """Return the table of what differs between two runs called so."""
    rows: list[Any] = [[place, _text(a), _text(b)] for place, a, b in found]
    return Table("What the runs were made of", ["", one, other], rows)


def _text(value: Any) -> str | None:
    if isinstance(value, bool) or not isinstance(value, float):
        return None if value is None else str(value)
    return f"{value:.10g}"


def partings_table(found: Divergence, one: Results, other: Results) -> Table:
    """Return the table of signals in which the results of two runs part, the earliest first."""
    headings = ["signal", "differs from", "visibly from", "largest difference", "at"]
    table = Table("What came out", headings, notes=list(found.notes))
    for parting in found.partings:
        table.rows.append([
            parting.signal,
            Value(parting.first, "s"),
            None if parting.seen is None else Value(parting.seen, "s"),
            None if math.isnan(parting.largest) else Value(parting.largest, parting.unit or "1"),
            Value(parting.largest_at, "s"),
        ])  # fmt: skip
    ends = {f"{run.time[-1]:.6g} s" for run in (one, other) if run.time.size}
    table.notes += [f"The runs end at {' and '.join(sorted(ends))}."] if len(ends) > 1 else []
    table.notes.append(f"{counted(found.compared, 'signal')} compared; the others are the same to the end.")
    return table
