"""What the control side sees of the car: the truth, a measurement of it, or an estimate.

Whoever computes with a signal sees it as its source's role says: an estimator gives estimates, a sensor
measurements, and what comes from neither nor from the control side itself, from the plant, say, or the
driver, is the truth, exact and at once, as no car has it.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from ..plan import SENSING, Fmu, Unit, Wire
from ..wording import fold, listed

CONTROL = ("reference", "controller", "allocator", "wheel_control", "monitor")
"""Roles that decide what the car is to do."""
TRUTH = "truth"


def role_of(unit: str, fmu: Fmu) -> str:
    """Return a unit's role as far as it counts here: its FMU's name begins with it, or it is its name."""
    roles = (*SENSING, *CONTROL)
    return next((role for role in roles if fmu.name.startswith(f"{role}_")), unit)


def seen_as(wire: Wire, units: Iterable[Unit]) -> str:
    """Return "truth", "late truth", "measurement" or "estimate".

    "" for what the control side says itself, or does not see.
    """
    roles = {unit.name: role_of(unit.name, unit.fmu) for unit in units}
    if roles[wire.target] not in (*CONTROL, "estimator") or roles[wire.source] in CONTROL:
        return ""
    truth = "late truth" if wire.output.endswith("_delayed") else TRUTH
    return SENSING.get(roles[wire.source], truth)


def exact(units: Sequence[Unit], wires: Iterable[Wire]) -> list[str]:
    """Return a note on all that the control side sees exactly although there is a sensor.

    Units that only watch, such as a reference for comparison, may see the truth: nothing that the car does
    follows from them.
    """
    wires = list(wires)
    if not any(role_of(unit.name, unit.fmu) == "sensor" for unit in units):
        return []
    steering = _steering(units, wires)
    found: dict[tuple[str, str], list[str]] = {}
    for wire in wires:
        if wire.target in steering and seen_as(wire, units) == TRUTH:
            found.setdefault((wire.target, wire.source), []).append(wire.input)
    told = [f"{listed(fold(names))} of {to} (from {of})" for (to, of), names in found.items()]
    return [f"exact, though there is a sensor: {'; '.join(told)}"] if told else []


def _steering(units: Iterable[Unit], wires: Iterable[Wire]) -> set[str]:
    """Return the units from which a way along wires leads to one that is not on the control side."""
    inside = {unit.name for unit in units if role_of(unit.name, unit.fmu) in (*CONTROL, "estimator")}
    found = {unit.name for unit in units} - inside
    while more := {w.source for w in wires if w.target in found} - found:
        found |= more
    return found
