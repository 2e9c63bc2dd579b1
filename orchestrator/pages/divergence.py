"""Where two runs part: for every recorded signal the first moment at which they differ, and by how much."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from vocabulary.wheels import WHEELS

from ..results.read import Results
from ..wording import star

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
