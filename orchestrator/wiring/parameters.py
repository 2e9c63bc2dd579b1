"""Distributes parameters to instances, and checks values by type, unit, limits and choices of the FMU.

A vehicle file has values for all instances; those that are known otherwise (`Parameters.known`) may have no
instance that takes them.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Collection, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any, ClassVar

from yawbench.fmus.fmu import Fmu, Value, Variable, integer_limits
from yawbench.foundation.errors import Diagnostic, code_of
from yawbench.foundation.messages import closest, fold, hint, listed, short
from yawbench.foundation.safe_files import TEXT, read_bytes

from ..plan import LITERATURE, PARAMETERS, Given, Instance, ValueOrigin, ValueSource
from ..scenario import quantities
from ..scenario.schema import TextSpec, array_value
from .context import WiringContext, facts_of

LARGEST, LARGEST_SINGLE = sys.float_info.max, (2 - 2**-23) * 2.0**127
"""Largest numbers of double and single precision."""


def value_for(variable: Variable, raw: Value) -> Value:
    """Convert a value from a scenario to the type and unit of a variable.

    Raises:
        ValueError: the value is not allowed; the message says what is.
    """
    if isinstance(raw, list):
        raise ValueError(f"takes one value (got {short(raw)})")
    convert = {"Real": _real, "Integer": _integer, "Enumeration": _enumeration}.get(variable.type, _other)
    value = convert(variable, raw)
    unit = f" {variable.unit}" if variable.unit and variable.unit != "1" else ""
    if variable.choices is not None and value not in variable.choices:
        likely = closest(str(value), variable.choices)
        guess = f"; did you mean {likely!r}?" if likely else ""
        raise ValueError(f"must be one of {listed(variable.choices, last='or')} (got {short(raw)}){guess}")
    if isinstance(value, (int, float)) and not isinstance(value, bool):
        if variable.minimum is not None and value < variable.minimum:
            raise ValueError(f"must be at least {variable.minimum:g}{unit} (got {short(raw)})")
        if variable.maximum is not None and value > variable.maximum:
            raise ValueError(f"must be at most {variable.maximum:g}{unit} (got {short(raw)})")
    return value


def _real(variable: Variable, raw: Value) -> float:
    in_unit = f" in {variable.unit}" if variable.unit and variable.unit != "1" else ""
    if isinstance(raw, bool):
        raise ValueError(f"must be a number{in_unit} (got {str(raw).lower()})")
    value = float(
        quantities.convert(raw, variable.unit, variable.definition, relative=variable.relative)
        if isinstance(raw, str)
        else raw
    )
    if not abs(value) <= (LARGEST_SINGLE if variable.encoding == "Float32" else LARGEST):
        raise ValueError(f"must be a finite number{in_unit} (got {short(raw)})")
    return value


def _integer(variable: Variable, raw: Value) -> int:
    if isinstance(raw, bool) or not isinstance(raw, int):
        raise ValueError(f"must be a whole number (got {short(raw)})")
    lowest, highest = integer_limits(variable.encoding or "Int32")
    if not lowest <= raw <= highest:
        raise ValueError(f"must be a whole number from {lowest} to {highest} (got {short(raw)})")
    return raw


def _enumeration(variable: Variable, raw: Value) -> int:
    items = variable.items or {}
    if isinstance(raw, str) and raw in items:
        return items[raw]
    if raw in items.values() and not isinstance(raw, (bool, float)):
        return int(raw)
    raise ValueError(f"must be one of {listed(items, last='or')} (got {short(raw)})")


def _other(variable: Variable, raw: Value) -> Value:
    if variable.type == "Boolean" and not isinstance(raw, bool):
        raise ValueError(f"must be true or false (got {short(raw)})")
    if variable.items is not None and type(raw) is int:
        raw = next((name for name, number in variable.items.items() if number == raw), raw)
    if variable.type == "String" and not isinstance(raw, str):
        raise ValueError(f"must be text (got {short(raw)}): put it in quotes")
    return raw


def values_of_array(elements: Sequence[Variable], given: Given[Any]) -> dict[str, Given[Any]]:
    """Return the values of the elements of an array by name, from a list, or one with a list for every row.

    An option gives the list as text, `[[1, 2], [3, 4]]`.

    Raises:
        ValueError: it is no list, or has not as many values as the array has elements.
    """
    sizes = elements[-1].name.rpartition("[")[2][:-1].split(",")
    values = given.value
    if isinstance(values, str) and values.startswith("["):
        with suppress(ValueError):
            values = array_value(json.loads(values))
    if _shape(values) not in (tuple(map(int, sizes)), (len(elements),)):
        raise ValueError(
            f"{elements[0].array} is an array of {'x'.join(sizes)} elements and takes a list of "
            f"{len(elements)} values, row by row (got {short(given.value)})"
        )
    while isinstance(values[0], list):
        values = [one for row in values for one in row]
    return {v.name: replace(given, value=one) for v, one in zip(elements, values, strict=True)}


def _shape(value: object) -> tuple[int, ...] | None:
    """Return the shape of nested lists, () of a single value, None if rows differ in their lengths."""
    if not isinstance(value, list):
        return ()
    inner = {_shape(item) for item in value}
    row = inner.pop()
    return None if inner or row is None else (len(value), *row)


class Parameters:
    """The parameters of all instances: their own, else facts, else the vehicle file's values.

    Who knows what a scenario is about derives further ones in a subclass (see `Domain`).

    Attributes:
        known: quantities that mean something even if no instance takes them.
        written: text parameter with a format -> its parser, so that errors are reported before the run.
    """

    known: ClassVar[Collection[str]] = ()
    written: ClassVar[Mapping[str, Callable[[str], object]]] = {}

    def __init__(self, system: WiringContext) -> None:
        self.system = system
        self.scenario = system.scenario
        self.fmus = system.fmus
        self.values: dict[str, dict[str, Value]] = {instance: {} for instance in system.fmus}

    def of_instances(self) -> dict[str, dict[str, Value]]:
        """Return the parameter values of each instance."""
        self.from_vehicle()
        by_change = self._from_facts()
        shared = {instance: dict(values) for instance, values in self.values.items()}
        for instance in self.fmus:
            own = self.scenario.units[instance].parameters.items()
            for name, given in sorted(own, key=lambda item: not isinstance(item[1].value, list)):
                if (instance, name) not in by_change or given.changed:
                    self._give_own(instance, name, given)
            self._check_arrays(instance)
        self.settle(shared)
        return self.values

    def from_vehicle(self) -> None:
        """Set the vehicle file's values in all instances that take them."""
        for name, given in self.scenario.vehicle_file.parameters.items():
            takers = self.takers(name)
            for instance in takers:
                self.give(instance, name, given)
            if takers or name in self.known:
                continue
            if any(is_parameter(fmu, name) for fmu in self.system.before()):
                self.system.left_out(f"vehicle.{name}", "no instance has such a parameter after the swap")
            else:
                declared = {v.name for fmu in self.fmus.values() for v in fmu.of("parameter")}
                likely = closest(name, sorted(declared | {*self.known}))
                guess = f"; did you mean {likely!r}?" if likely else ""
                self.system.report(
                    given.where, f"no instance has a parameter {name!r}{guess}", "parameter-unknown"
                )

    def settle(self, shared: Mapping[str, Mapping[str, Value]]) -> None:
        """Derive what follows from all values, and report what is missing.

        Args:
            shared: instance -> its values without those of its own in the scenario.
        """

    def complete(self, instances: dict[str, Instance]) -> list[Diagnostic]:
        """Set parameters that follow from other instances, whose values are all known; return errors."""
        return []

    def give(self, instance: str, name: str, given: Given[Any], says: str = "") -> None:
        """Set a parameter of an instance; report errors at the place of the value, with the prefix `says`."""
        try:
            value = value_for(self.fmus[instance].variables[name], given.value)
            if isinstance(value, str) and name in self.written:
                self.written[name](value)
            self.values[instance][name] = value
        except ValueError as error:
            self.system.report(given.where, f"{says}{error}", code_of(error))
        self.system.given[instance][name] = given

    def takers(self, name: str) -> list[str]:
        """Return the instances that have a parameter."""
        return [instance for instance, fmu in self.fmus.items() if is_parameter(fmu, name)]

    def _check_arrays(self, instance: str) -> None:
        """Report arrays of which some elements have neither a value nor a start value."""
        fmu, given = self.fmus[instance], self.values[instance]
        arrays = {fmu.variables[name].array for name in given if fmu.variables[name].elements > 1}
        for array in arrays:
            elements = fmu.elements_of(array, "parameter")
            lacking = [v.name for v in elements if v.name not in given and v.start is None]
            if lacking:
                where = next(self.system.given[instance][v.name].where for v in elements if v.name in given)
                sentence = (
                    f"{instance}.{fold(lacking)[0]} has no value and no start value: give all of {array}"
                )
                self.system.report(where, sentence, "value-invalid")

    def _give_own(self, instance: str, name: str, given: Given[Value | TextSpec | list[Any]]) -> None:
        """Set a parameter listed under its instance: to a value, those of an array, or the text of a file."""
        fmu, value = self.fmus[instance], given.value
        elements = fmu.elements_of(name, "parameter")  # none for the name of a scalar
        if elements and not isinstance(value, TextSpec):
            try:
                each = values_of_array(elements, given)
            except ValueError as error:
                self.system.report(given.where, str(error), "value-invalid")
                return
            for element, one in each.items():
                self.give(instance, element, one)
        elif not is_parameter(fmu, name):
            if self._is_left_out(instance, name, given):
                self.system.left_out(f"{instance}.{name}", f"{fmu.name} has no such parameter")
            else:
                self.system.report(given.where, unknown_parameter(instance, fmu, name), "parameter-unknown")
        elif not isinstance(value, TextSpec):
            self.give(instance, name, given)
        elif fmu.variables[name].type != "String":
            self.system.report(
                given.where, "takes a value: only parameters that are text take a file", "value-wrong-type"
            )
        else:
            try:
                text = _text_of(self.scenario.path.parent / value.file)
            except ValueError as error:
                self.system.report(given.where, f"{value.file}: {error}", "file-unreadable")
            else:
                origin = of_file(value.file, f"file {value.file}", given.origin.source)
                self.give(instance, name, Given(text, origin, given.where), f"{value.file}: ")

    def _from_facts(self) -> set[tuple[str, str]]:
        """Set the parameters that facts reach; return the (instance, parameter) of overridden facts."""
        by_change: set[tuple[str, str]] = set()
        for fact_name, fact, given in facts_of(self.scenario):
            takers = [(instance, name) for name in fact.parameters for instance in self.takers(name)]
            for instance, name in takers:
                self.give(instance, name, given)
            by_change.update(takers if given.changed else ())
            if not fact.parameters or fact.inputs or takers:
                continue  # for a fact with inputs, `constants` reports whether it has an effect
            before = any(self.system.had(self.fmus, name, "parameter") for name in fact.parameters)
            if before and not given.changed:
                self.system.left_out(fact_name, "no instance has such a parameter after the swap")
            else:
                sentence = f"no instance has a parameter {listed(fact.parameters, last='or')}"
                self.system.report(given.where, sentence, "parameter-unknown")
        return by_change

    def _is_left_out(self, instance: str, name: str, given: Given[Any]) -> bool:
        """Return whether a value was meant for the replaced FMU of an instance."""
        if instance not in self.scenario.replaced or given.changed:
            return False
        before = self.system.replaced(instance)
        return before is None or is_parameter(before, name)


def of_file(name: str, says: str, named: ValueSource | None) -> ValueOrigin:
    """Return the origin of values in a file, which is named where `named` says."""
    assert named is not None, "what names a file is in a file"
    return ValueOrigin("file", name, replace(named, kind=LITERATURE, says=says))


def _text_of(path: Path) -> str:
    """Return the text of a file given instead of a value.

    Raises:
        ValueError: the file cannot be read; the message says why.
    """
    try:
        return read_bytes(path, largest=TEXT).decode("utf-8-sig")
    except UnicodeDecodeError:
        raise ValueError("the file is not UTF-8") from None
    except OSError as error:
        raise ValueError((error.strerror or "cannot be read").lower()) from None


def is_parameter(fmu: Fmu, name: str) -> bool:
    """Return whether an FMU has a parameter of this name."""
    return name in fmu.variables and fmu.variables[name].causality in PARAMETERS


def unknown_parameter(instance: str, fmu: Fmu, name: str) -> str:
    """Return the message on a name that is no parameter of an instance."""
    if name in fmu.variables and fmu.variables[name].causality == "input":
        return f"{name!r} is an input of {instance} here, not a parameter: give constants under 'inputs'"
    if name in fmu.refused:
        return f"{instance}.{name} {fmu.refused[name]}"
    names = fold([v.name for v in fmu.of("parameter")])
    return f"{instance} ({fmu.name}) has no parameter {name!r}" + hint(name, names, lead="it has")
