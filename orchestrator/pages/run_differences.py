"""What differs between two runs: what they were made of, and how far their results part."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

from ..experiments.tables import Cell, Table
from ..metrics.run_metrics import Value
from ..results.read import Results
from ..titles import changed, changes_in
from ..wording import counted
from .divergence import Divergence

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
        words = math.isnan(parting.largest)
        largest: Cell = None if words else Value(parting.largest, parting.unit or "1")
        seen = None if parting.seen is None else Value(parting.seen, "s")
        moments = (Value(parting.first, "s"), seen, largest, Value(parting.largest_at, "s"))
        table.rows.append([parting.signal, *moments])
    ends = {f"{run.time[-1]:.6g} s" for run in (one, other) if run.time.size}
    table.notes += [f"The runs end at {' and '.join(sorted(ends))}."] if len(ends) > 1 else []
    table.notes.append(f"{counted(found.compared, 'signal')} compared; the others are the same to the end.")
    return table
