"""Resolves the faults of a scenario: to outputs and inputs, with values in the units of the signals."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

from yawbench.fmus.fmu import Variable
from yawbench.foundation.errors import Location
from yawbench.foundation.messages import fold, hint, listed

from ..fault_kinds import KINDS, Fault, FaultLocation, FaultySignal
from ..plan import Given, Wire
from ..scenario.fault_schema import FaultSpec
from ..scenario.quantities import convert
from ..signal_names import match, matching
from .context import WiringContext


def faults_of(
    system: WiringContext, wires: Sequence[Wire], record: Iterable[tuple[str, str]]
) -> tuple[FaultySignal, ...]:
    """Return the signals that the faults of a scenario act on."""
    scenario = system.scenario
    signals: list[FaultySignal] = []
    record = set(record)
    for given in scenario.faults:
        fault = given.value.fault
        at = _Finder(system, wires, record, given).at(fault)
        for instance, name, of_output in at:
            variable = system.fmus[instance].variables[name]
            if variable.type != "Real":
                system.report(
                    _part(given, "on"),
                    f"{instance}.{name} is {variable.type}: faults are for Real",
                    "fault-invalid",
                )
                continue
            try:
                value = _value(fault, variable)
            except ValueError as error:
                system.report(_part(given, "value"), f"{instance}.{name}: {error}", "fault-invalid")
                continue
            before = sum(
                (f.instance, f.variable, f.of_output) == (instance, name, of_output) for f in signals
            )
            text = f"{fault.seed or 0} {instance}.{name} {of_output} {before}"
            stream = int.from_bytes(hashlib.sha256(text.encode()).digest()[:8], "big")
            drawn = KINDS[fault.kind].drawn
            signals.append(FaultySignal(fault, instance, name, of_output, value, stream if drawn else 0))
        if at and fault.begin >= scenario.stop_time:
            ends = f"the run ends at {float(scenario.stop_time):g} s"
            sentence = f"{_said(given)} never acts: it begins at {fault.begin:g} s, {ends}"
            system.note("fault-never-acts", sentence)
    return tuple(signals)


def _value(fault: Fault, variable: Variable) -> float | None:
    """Return the value of a fault, converted into the unit that its kind requires.

    Raises:
        ValueError: not a valid value for this kind and signal.
    """
    kind = KINDS[fault.kind]
    if fault.value is None:
        return kind.default
    assert kind.unit is not None
    of_signal = f"({variable.unit})" if variable.unit and "/" in variable.unit and "/" in kind.unit else None
    unit = kind.unit.replace("{x}", of_signal or variable.unit or "1")
    value = fault.value
    if isinstance(value, str):
        if "{x}" in kind.unit and variable.unit is None:
            raise ValueError(f"{value!r} names a unit, but the FMU declares none: give a plain number")
        definition = variable.definition if kind.unit == "{x}" else None
        value = float(convert(value, unit, definition, relative=kind.adds or variable.relative))
    if not math.isfinite(value):
        raise ValueError(f"must be a finite number (got {fault.value!r})")
    if (kind.least is not None and value < kind.least) or (kind.most is not None and value > kind.most):
        bounds = f"at least {kind.least:g}" + (f" and at most {kind.most:g}" if kind.most is not None else "")
        raise ValueError(f"{fault.kind} must be {bounds} {unit if unit != '1' else ''}".rstrip())
    return value


def _said(given: Given[FaultSpec]) -> str:
    return given.where.target if given.changed else f"{given.where.target} ({given.value.on})"


def _part(given: Given[FaultSpec], name: str) -> Location:
    """Return the place of an option of a fault."""
    return given.where if given.changed else replace(given.where, target=f"{given.where.target}.{name}")


@dataclass
class _Finder:
    """Finds the variables that a fault acts on."""

    system: WiringContext
    wires: Sequence[Wire]
    record: set[tuple[str, str]]
    given: Given[FaultSpec]

    def at(self, fault: Fault) -> list[tuple[str, str, bool]]:
        """Return (instance, variable, whether it is an output) of everything that the fault acts on."""
        location = fault.on
        for instance in filter(None, (location.instance, location.target)):
            if instance not in self.system.fmus:
                self._report(
                    f"there is no instance {instance!r}{hint(instance, self.system.fmus, lead='instances')}",
                    "instance-unknown",
                )
                return []
        if location.target:
            return self._on_wires(fault)
        signal = location.instance, location.variable
        return self._on_outputs(*signal) or self._on_inputs(*signal)

    def _on_outputs(self, instance: str, pattern: str) -> list[tuple[str, str, bool]]:
        names = matching(pattern, self.system.outputs[instance]).values()
        used = {(w.source, w.output) for w in self.wires} | self.record
        if names and not any((instance, name) in used for name in names):
            self._report(f"{instance}.{pattern} is neither recorded nor on a wire", "fault-without-effect")
        return [(instance, name, True) for name in names if (instance, name) in used or "*" not in pattern]

    def _on_inputs(self, instance: str, pattern: str) -> list[tuple[str, str, bool]]:
        names = self.system.matching_inputs(instance, pattern).values()
        driven = {w.input for w in self.wires if w.target == instance}
        if names and not driven & set(names):
            self._report(
                f"{instance}.{pattern} is on no wire: faults of inputs act on outputs of instances",
                "fault-without-effect",
            )
        if not names and not matching(pattern, self.system.outputs[instance]):
            self._no_such(instance, pattern)
        return [(instance, name, False) for name in names if name in driven]

    def _on_wires(self, fault: Fault) -> list[tuple[str, str, bool]]:
        location = fault.on
        between = [w for w in self.wires if (w.source, w.target) == (location.instance, location.target)]
        matching_wires = [
            w for w in between
            if match(location.variable, w.output) is not None and match(location.input, w.input) is not None
        ]  # fmt: skip
        if not matching_wires:
            if {location.instance, location.target} & self.system.scenario.replaced.keys():
                self.system.left_out(_said(self.given), "there is no such signal any more")
                return []
            self._report(
                f"no wire leads from {location.instance}.{location.variable} to {location.target}"
                f"{self._way(location)}",
                "wire-unknown",
            )
        return [(w.target, w.input, False) for w in matching_wires]

    def _way(self, location: FaultLocation) -> str:
        """Return a hint at existing wires similar to the missing one."""
        of = [w for w in self.wires if w.source == location.instance]
        if targets := dict.fromkeys(w.target for w in of if match(location.variable, w.output) is not None):
            return f"; it goes to {listed(targets)}"
        there = fold([w.output for w in of if w.target == location.target])
        return hint(location.variable, there, lead="there are") if there else "; nothing goes there"

    def _no_such(self, instance: str, pattern: str) -> None:
        if self.system.had([instance], pattern):
            self.system.left_out(_said(self.given), "there is no such signal any more")
            return
        names = fold([*self.system.outputs[instance], *self.system.inputs[instance]])
        guess = hint(pattern, names, lead="it has")
        self._report(f"{instance} has neither an output nor an input {pattern!r}{guess}", "variable-unknown")

    def _report(self, sentence: str, code: str) -> None:
        self.system.report(_part(self.given, "on"), sentence, code)
