"""Bringing all units to a common start.

Units enter initialization mode in evaluation order, each with the outputs of those before it. Then
values go round until no input changes by a single bit: closed loops (tyre forces, accelerations)
settle that way. A loop that keeps flickering in its last digits is accepted after `PASSES` passes
if nothing moves by more than `TOLERANCE` of its value; one that moves more is an error.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..errors import SimulationError
from ..plan import Value, Wire
from .memory import Memory, Station
from .unit import Status

PASSES = 100
TOLERANCE = 1e-9

Check = Callable[[str, str, Status], None]
"""Called with a unit, what was done and the status after every call; raises if that is the end."""


@dataclass
class Movement:
    """A wire whose value still changes."""

    wire: str
    old: Value
    new: Value

    @property
    def large(self) -> bool:
        if not (isinstance(self.old, float) and isinstance(self.new, float)):
            return True
        return not abs(self.new - self.old) <= TOLERANCE * max(abs(self.old), abs(self.new))

    def __str__(self) -> str:
        if isinstance(self.old, float) and isinstance(self.new, float):
            return f"{self.wire} ({self.old:.6g}, then {self.new:.6g})"
        return f"{self.wire} ({self.old!r}, then {self.new!r})"


def initialize(memory: Memory, check: Check) -> int:
    """Initialize all units and return the number of passes it took.

    Raises:
        SimulationError: the loop of a wire does not settle; and whatever `check` raises.
    """
    for station in memory.stations:
        _set_parameters(station, check)
        _set_known_inputs(memory, station, check)
        check(station.name, "initialization", station.slave.enter(memory.plan.time(memory.plan.n_steps)))
        _get(memory, station, check)
    for number in range(1, PASSES + 1):  # noqa: B007  the number is the result
        moving = [movement for s in memory.stations for movement in _renew(memory, s, check)]
        if not moving:
            break
    if any(movement.large for movement in moving):
        raise SimulationError(_unsettled(moving), unit=None, time=0.0)
    for station in memory.stations:
        check(station.name, "initialization", station.slave.exit())
        _get(memory, station, check)
    memory.start_history()
    return number


def _set_parameters(station: Station, check: Check) -> None:
    variables = [station.unit.fmu.variables[name] for name in station.unit.parameters]
    for kind in {v.type: None for v in variables}:
        chosen = [v for v in variables if v.type == kind]
        values = [station.unit.parameters[v.name] for v in chosen]
        check(
            station.name, "setting parameters", station.slave.put(kind, [v.reference for v in chosen], values)
        )


def _set_known_inputs(memory: Memory, station: Station, check: Check) -> None:
    """Set constants and the outputs of earlier units; others keep the start value of the FMU."""
    known: dict[str, dict[int, Value]] = {}
    for variable, wire, source in zip(station.inputs, station.wires, station.sources, strict=True):
        value = float(memory.pool[source])
        if _comes_before(memory, wire, station) and np.isfinite(value):
            known.setdefault("Real", {})[variable.reference] = value
    for variable, key in station.other_inputs:
        if key is None:
            known.setdefault(variable.type, {})[variable.reference] = station.unit.constants[variable.name]
        elif key in memory.others:
            known.setdefault(variable.type, {})[variable.reference] = memory.others[key]
    for kind, values in known.items():
        status = station.slave.put(kind, list(values), list(values.values()))
        check(station.name, "setting inputs", status)


def _comes_before(memory: Memory, wire: Wire | None, station: Station) -> bool:
    return wire is None or memory.of[wire.source].position < station.position


def _renew(memory: Memory, s: Station, check: Check) -> list[Movement]:
    """Bring a unit's inputs and outputs up to date; return the wires that have changed.

    A value that is not finite yet is not passed on: the loop may still heal it.
    """
    new = memory.pool[s.sources]
    new = np.where(np.isfinite(new) | np.isnan(s.u), new, s.u)
    changed = np.flatnonzero(new.view(np.int64) != s.u.view(np.int64))
    moving = [
        Movement(f"{wire.source}.{wire.output} -> {s.name}.{s.inputs[i].name}", float(s.u[i]), float(new[i]))
        for i in changed
        if (wire := s.wires[i]) is not None
    ]
    if changed.size:
        s.u[:] = new
        check(s.name, "setting inputs", s.calls.set())
    for variable, key in s.other_inputs:
        if key is not None and memory.others[key] != memory.others.get((s.name, variable.name)):
            value = memory.others[key]
            old = memory.others.get((s.name, variable.name), "")
            memory.others[s.name, variable.name] = value
            moving.append(Movement(f"{key[0]}.{key[1]} -> {s.name}.{variable.name}", old, value))
            check(s.name, "setting inputs", s.slave.put(variable.type, [variable.reference], [value]))
    if moving or changed.size:
        _get(memory, s, check)
    return moving


def _get(memory: Memory, s: Station, check: Check) -> None:
    if s.outputs:
        check(s.name, "reading outputs", s.calls.get())
    for variable in s.other_outputs:
        status, (value,) = s.slave.fetch(variable.type, [variable.reference])
        memory.others[s.name, variable.name] = value
        check(s.name, "reading outputs", status)


def _unsettled(moving: list[Movement]) -> str:
    large = [str(movement) for movement in moving if movement.large]
    more = f" and {len(large) - 4} more" if len(large) > 4 else ""
    return (
        f"initialization does not settle: after {PASSES} passes these wires still change: "
        f"{', '.join(large[:4])}{more}."
    )
