"""Initialization: bring all instances to a consistent start.

Structural parameters come first, in configuration mode. Other parameters are set after the experiment is set
up, because some tools' FMUs reset the model there, and are
read back in initialization mode: a parameter that did not take its value is an error. Instances enter
initialization mode in evaluation order, each with the outputs of those before it. Then values are exchanged
in passes until no input changes by a single bit, which settles closed loops (tyre forces, accelerations). A
loop that keeps flickering in its last digits is accepted after `PASSES` passes if no value moves by more
than `TOLERANCE` of itself; a loop that moves more is an error.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from yawbench.fmus.fmu import Value, Variable
from yawbench.foundation.errors import SimulationError
from yawbench.foundation.messages import listed

from ..plan import Wire
from .instance import ExperimentSetup, Status
from .log import FATAL, OK, STATUS, WARNING, Log, known
from .signal_pool import InstanceSlot, SignalPool, by_type
from .step_program import getting

PASSES = 100
TOLERANCE = 1e-9
SINGLE = 1e-7
"""Relative difference up to which a value read back equals the value set; chosen: the rounding of an FMU
that computes in single precision."""
NAMED = 4
"""Variables named in a message."""

StatusCheck = Callable[[str, str, Status], None]
"""Called with instance, action and status after every FMI call; raises if the run cannot go on."""


@dataclass
class UnsettledWire:
    """A wire whose value changed in the last pass."""

    wire: str
    old: Value
    new: Value

    @property
    def large(self) -> bool:
        """Whether the change exceeds `TOLERANCE`."""
        if not (isinstance(self.old, float) and isinstance(self.new, float)):
            return True
        return not abs(self.new - self.old) <= TOLERANCE * max(abs(self.old), abs(self.new))

    def __str__(self) -> str:
        if isinstance(self.old, float) and isinstance(self.new, float):
            return f"{self.wire} ({self.old:.6g}, then {self.new:.6g})"
        return f"{self.wire} ({self.old!r}, then {self.new!r})"


def initialize(
    signals: SignalPool, entered: Callable[[], Iterator[InstanceSlot]], check: StatusCheck, log: Log
) -> int:
    """Initialize all instances and return the number of passes it took.

    Args:
        entered: yields the slots of `signals` in turn, and notes whose code runs.

    Raises:
        SimulationError: a parameter does not take its value or a loop does not settle; `check` may raise
            others.
    """
    plan = signals.plan
    start, stop = plan.time(0), plan.time(plan.n_steps)
    for slot in entered():
        tolerance = slot.instance.tolerance or slot.instance.fmu.tolerance
        experiment = ExperimentSetup(start, stop, tolerance)
        sizes, parameters = _split(slot)
        if sizes:
            groups = [
                ([v.ref for v in chosen], [v.encoded(sizes[v.name]) for v in chosen])
                for chosen in by_type(slot.instance.fmu.variables[name] for name in sizes)
            ]
            check(slot.name, "setting structural parameters", slot.fmu_instance.configure(groups))
        check(slot.name, "initialization", slot.fmu_instance.setup(experiment))
        _put(slot, parameters, "setting parameters", check)
        _put(slot, _known_inputs(signals, slot), "setting inputs", check)
        check(slot.name, "initialization", slot.fmu_instance.enter())
        _check_parameters(slot, check, log)
        _get(signals, slot, check)
    for number in range(1, PASSES + 1):  # noqa: B007  the number is the result
        moving = [movement for s in entered() for movement in _renew(signals, s, check)]
        if not moving:
            break
    if any(movement.large for movement in moving):
        raise SimulationError(_unsettled(moving), instance=None, time=start, code="initialization-unsettled")
    for slot in entered():
        check(slot.name, "initialization", slot.fmu_instance.exit())
        _get(signals, slot, check)
        _check_constants(slot, check, log)
    for slot in signals.slots:
        for _, wire in slot.other_inputs:
            if wire is not None:
                signals.other(wire)  # raises if the input cannot be this number
    signals.start_history()
    return number


def _split(slot: InstanceSlot) -> tuple[dict[str, Value], dict[str, Value]]:
    """Return the values of an instance's structural parameters, and those of its other parameters."""
    of, values = slot.instance.fmu.variables, slot.instance.parameters
    sizes = {name: v for name, v in values.items() if of[name].causality == "structuralParameter"}
    return sizes, {name: v for name, v in values.items() if name not in sizes}


def _put(slot: InstanceSlot, requested: Mapping[str, Value], what: str, check: StatusCheck) -> None:
    """Set variables; the other elements of an array are set to their start values."""
    variables = slot.instance.fmu.variables
    arrays = {variables[name].reference for name in requested if variables[name].elements > 1}
    others = (v for v in variables.values() if v.reference in arrays) if arrays else ()
    values = {v.name: v.start for v in others if v.start is not None} | dict(requested)
    for chosen in by_type(variables[name] for name in values):
        status = slot.fmu_instance.put([v.ref for v in chosen], [v.encoded(values[v.name]) for v in chosen])
        check(slot.name, what, status)


def _known_inputs(signals: SignalPool, slot: InstanceSlot) -> dict[str, Value]:
    """Return the inputs known so far: constants and outputs of earlier instances."""
    known: dict[str, Value] = {}
    values = signals.taken(slot).tolist()
    for variable, wire, value in zip(slot.inputs, slot.wires, values, strict=True):
        if _comes_before(signals, wire, slot) and np.isfinite(value):
            known[variable.name] = value
    return known | signals.given_others(slot)


def _check_parameters(slot: InstanceSlot, check: StatusCheck, log: Log) -> None:
    """Read all parameters back and compare them with the values that were set.

    If the FMU cannot return a parameter, that is only a warning: its value may well be right.

    Raises:
        SimulationError: a parameter has another value.
    """
    differing: list[str] = []
    for chosen, status, lost in _read_back(slot, slot.instance.parameters, check, log):
        if status > WARNING:
            names = listed([v.name for v in chosen][:NAMED]) + (" and others" if len(chosen) > NAMED else "")
            text = f"whether {names} took the value that was set is not known: reading returned"
            log.add(slot.name, WARNING, "", f"{text} {STATUS[status]}")
        differing += [f"{name} is {actual}, not {expected}" for name, actual, expected in lost]
    if differing:
        more = f" and {len(differing) - NAMED} more" if len(differing) > NAMED else ""
        what = "a parameter" if len(differing) == 1 else "parameters"
        raise SimulationError(
            f"{slot.name}: {what} did not take the value that was set: {listed(differing[:NAMED])}{more}",
            instance=slot.name, time=log.time.value, code="fmu-ignores-value")  # fmt: skip


def _check_constants(slot: InstanceSlot, check: StatusCheck, log: Log) -> None:
    """Read constant inputs back; a difference is a warning: an FMU may legally take inputs only in a step."""
    for _, _, lost in _read_back(slot, slot.instance.constants, check, log):
        for name, actual, expected in lost:
            log.add(slot.name, WARNING, "", f"the constant {name} reads back as {actual}, not {expected}")


def _read_back(
    slot: InstanceSlot, requested: Mapping[str, Value], check: StatusCheck, log: Log
) -> Iterator[tuple[list[Variable], Status, list[tuple[str, str, str]]]]:
    """Yield variables of one type, the status of reading them, and those that differ: name, read, set."""
    for chosen in by_type(slot.instance.fmu.variables[name] for name in requested):
        with log.muted():
            raw, values = slot.fmu_instance.fetch([v.ref for v in chosen])
        status = known(raw)
        if status >= FATAL:
            check(slot.name, "reading back what was set", status)
        lost = []
        for variable, actual in zip(chosen, values, strict=True) if status <= WARNING else ():
            expected = requested[variable.name]
            if not _took(variable, actual, expected):
                lost.append((variable.name, _shown(variable, actual), _shown(variable, expected)))
        yield chosen, status, lost


def _took(variable: Variable, actual: Value, expected: Value) -> bool:
    if variable.type == "Real":
        return math.isclose(expected, actual, rel_tol=SINGLE)  # type: ignore[arg-type]
    return variable.encoded(expected) == actual


def _shown(variable: Variable, value: Value) -> str:
    if isinstance(value, float):
        return f"{value:.9g}" + (f" {variable.unit}" if variable.unit not in (None, "1") else "")
    if isinstance(value, bool):
        return str(value).lower()
    names: dict[Value, str] = {number: name for name, number in (variable.items or {}).items()}
    return names.get(value, repr(value))


def _comes_before(signals: SignalPool, wire: Wire | None, slot: InstanceSlot) -> bool:
    """Return whether an input is known before the instance is evaluated: a constant or an earlier output."""
    return wire is None or wire.delayed or signals.of[wire.source].position < slot.position


def _renew(signals: SignalPool, s: InstanceSlot, check: StatusCheck) -> list[UnsettledWire]:
    """Update the inputs and outputs of an instance; return the wires that have changed.

    A value that is not finite is not passed on yet: later passes may make it finite.
    """
    new = signals.taken(s)
    new = np.where(np.isfinite(new) | np.isnan(s.u), new, s.u)
    changed = np.flatnonzero(new.view(np.int64) != s.u.view(np.int64))
    moving = [
        UnsettledWire(
            f"{wire.source}.{wire.output} -> {s.name}.{s.inputs[i].name}", float(s.u[i]), float(new[i])
        )
        for i in changed
        if (wire := s.wires[i]) is not None
    ]
    if changed.size:
        s.u[:] = new
        check(s.name, "setting inputs", s.calls.set())
    renewed = _renew_others(signals, s, check, moving)
    if moving or changed.size or renewed:
        _get(signals, s, check)
    return moving


def _renew_others(
    signals: SignalPool, s: InstanceSlot, check: StatusCheck, moving: list[UnsettledWire]
) -> bool:
    """Do the same for inputs that are not Real: extend `moving`, return whether an input has changed."""
    changed = set()
    values = signals.given_others(s)
    for variable, wire in s.other_inputs:
        value, old = values.get(variable.name), signals.others.get((s.name, variable.name))
        if value is None or value == old:
            continue
        signals.others[s.name, variable.name] = value
        changed.add(variable.ref[:2])
        if wire is not None:
            text = f"{wire.source}.{wire.output} -> {s.name}.{variable.name}"
            moving.append(UnsettledWire(text, "" if old is None else old, value))
    if changed:  # all elements of an array are set together
        names = [v.name for v, _ in s.other_inputs if v.ref[:2] in changed and v.name in values]
        _put(s, {name: values[name] for name in names}, "setting inputs", check)
    return bool(changed)


def _get(signals: SignalPool, s: InstanceSlot, check: StatusCheck) -> None:
    """Read the outputs of an instance into the pool, with their faults."""
    for operation in getting(signals, s):
        check(s.name, "reading outputs", operation.call() or OK)
    if s.outputs and s.output_faults is not None:
        s.output_faults.begin(s.y)


def _unsettled(moving: list[UnsettledWire]) -> str:
    """Return the message for wires that do not settle."""
    large = [str(movement) for movement in moving if movement.large]
    more = f" and {len(large) - 4} more" if len(large) > 4 else ""
    return (
        f"initialization does not settle: after {PASSES} passes these wires still change: "
        f"{', '.join(large[:4])}{more}."
    )
