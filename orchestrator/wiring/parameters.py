"""Distributes parameters to instances, and checks values by type, unit, limits and choices of the FMU.

A vehicle file describes a car for all plants: quantities of a car (`vocabulary.vehicle`) that no instance
takes are ignored, and those that an instance lacks are derived (`derivations`). An instance that takes some
quantities of the car must get all of them, because the defaults of its FMU describe a different car.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

from yawbench.fmus.fmu import Fmu, Value, Variable, integer_limits
from yawbench.foundation.errors import code_of
from yawbench.foundation.messages import closest, fold, hint, listed, short
from yawbench.foundation.safe_files import TEXT, read_bytes
from yawbench.vocabulary.friction_table import table_of
from yawbench.vocabulary.patches import patches_of
from yawbench.vocabulary.vehicle import CAR

from ..plan import LITERATURE, Given, ValueOrigin, ValueSource
from ..scenario import quantities
from ..scenario.schema import PARAMETERS, TextSpec
from .context import WiringContext, facts_of
from .derivations import GIVES_WAY, CarQuantities, adapted, car_of, contradictions

STIFFNESSES = ("cornering_stiffness_front", "cornering_stiffness_rear")
STATIC_LOADS = ("static_load_front", "static_load_rear")
"""Quantities of the car from which `make_plan` gets the `STIFFNESSES` of the tyres."""
WRITTEN: dict[str, Callable[[str], object]] = {"patches": patches_of, "friction_table": table_of}
"""Text parameters with a format -> their parser, so that errors are reported before the run."""
LARGEST, LARGEST_SINGLE = sys.float_info.max, (2 - 2**-23) * 2.0**127
"""Largest numbers of double and single precision."""


def value_for(variable: Variable, raw: Value) -> Value:
    """Convert a value from a scenario to the type and unit of a variable.

    Raises:
        ValueError: the value is not allowed; the message says what is.
    """
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
    if variable.type == "String" and not isinstance(raw, str):
        raise ValueError(f"must be text (got {short(raw)}): put it in quotes")
    if isinstance(raw, str) and variable.name in WRITTEN:
        WRITTEN[variable.name](raw)
    return raw


class Parameters:
    """The parameters of all instances: their own, else facts, the vehicle's and the tyre files' values."""

    def __init__(self, system: WiringContext) -> None:
        self._system = system
        self._scenario = system.scenario
        self._fmus = system.fmus
        self._values: dict[str, dict[str, Value]] = {instance: {} for instance in system.fmus}
        self._where = system.scenario.vehicle_document.location((PARAMETERS,))
        self._is_wrong = False  # the vehicle file
        self.car = CarQuantities({})
        self.lacking: dict[str, list[str]] = {}
        """Instance -> those of its `STIFFNESSES` that have to be measured on the tyres at static loads."""

    def of_instances(self) -> dict[str, dict[str, Value]]:
        """Return the parameter values of each instance."""
        self._from_tyre_files()
        self._from_vehicle()
        by_change = self._from_facts()
        of_car = {instance: dict(values) for instance, values in self._values.items()}
        for instance in self._fmus:
            for name, given in self._scenario.units[instance].parameters.items():
                if (instance, name) not in by_change or given.changed:
                    self._give_own(instance, name, given)
            self._give_way(instance, of_car[instance])
        self._settle_stiffnesses()
        self._refuse_half_a_car()
        return self._values

    def _give(self, instance: str, name: str, given: Given[Any], says: str = "") -> None:
        """Set a parameter of an instance; report errors at the place of the value, with the prefix `says`."""
        try:
            self._values[instance][name] = value_for(self._fmus[instance].variables[name], given.value)
        except ValueError as error:
            self._system.report(given.where, f"{says}{error}", code_of(error))
        self._system.given[instance][name] = given

    def _takers(self, name: str) -> list[str]:
        return [instance for instance, fmu in self._fmus.items() if _is_parameter(fmu, name)]

    def _give_own(self, instance: str, name: str, given: Given[Value | TextSpec]) -> None:
        """Set a parameter listed under its instance: to a value, or the text of a file."""
        fmu, value = self._fmus[instance], given.value
        if not _is_parameter(fmu, name):
            if self._is_left_out(instance, name, given):
                sentence = f"{instance}.{name} is left out: {fmu.name} has no such parameter"
                self._system.note("left-out-after-swap", sentence)
            else:
                self._system.report(given.where, _unknown(instance, fmu, name), "parameter-unknown")
        elif not isinstance(value, TextSpec):
            self._give(instance, name, given)
        elif fmu.variables[name].type != "String":
            self._system.report(
                given.where, "takes a value: only parameters that are text take a file", "value-wrong-type"
            )
        else:
            try:
                text = _text_of(self._scenario.path.parent / value.file)
            except ValueError as error:
                self._system.report(given.where, f"{value.file}: {error}", "file-unreadable")
            else:
                origin = _of_file(value.file, f"file {value.file}", given.origin.source)
                self._give(instance, name, Given(text, origin, given.where), f"{value.file}: ")

    def _give_way(self, instance: str, of_car: Mapping[str, Value]) -> None:
        """Keep the wheels of an instance's car where only its mass, or only its sprung mass, is changed.

        Args:
            instance: its name.
            of_car: its parameters by the vehicle file.
        """
        fmu, values, own = (
            self._fmus[instance],
            self._values[instance],
            self._scenario.units[instance].parameters,
        )
        changed = {name: given for name, given in own.items() if given.changed}
        for name, (yielding, stays) in GIVES_WAY.items():
            if name not in changed or yielding in changed or name not in values or _is_parameter(fmu, stays):
                continue
            if not _is_parameter(fmu, yielding):
                continue
            replaced = changed[name].replaces
            before = replaced.value if replaced else of_car.get(name, fmu.variables[name].start)
            was = values.get(yielding, fmu.variables[yielding].start)
            if before is None or isinstance(before, TextSpec) or was is None:
                continue
            try:
                added = float(values[name]) - float(value_for(fmu.variables[name], before))
                moved = float(was) + added
            except ValueError:
                continue  # of a value that is not valid, which is reported elsewhere
            if added:
                origin = ValueOrigin.derived(f"the wheels keep their mass, {added:+.6g} kg as {name}")
                self._give(instance, yielding, Given(moved, origin, changed[name].where), f"{yielding}: ")
                self._system.note(
                    "quantity-follows",
                    f"{instance}.{name} = {values[name]:.6g} kg: the wheels keep their mass, so {yielding} "
                    f"becomes {moved:.6g} kg ({was:.6g} kg before)",
                )

    def _from_facts(self) -> set[tuple[str, str]]:
        """Set the parameters that facts reach; return the (instance, parameter) of overridden facts."""
        by_change: set[tuple[str, str]] = set()
        for fact_name, fact, given in facts_of(self._scenario):
            takers = [(instance, name) for name in fact.parameters for instance in self._takers(name)]
            for instance, name in takers:
                self._give(instance, name, given)
            by_change.update(takers if given.changed else ())
            if not fact.parameters or fact.inputs or takers:
                continue  # for a fact with inputs, `constants` reports whether it has an effect
            before = any(self._system.had(self._fmus, name, "parameter") for name in fact.parameters)
            if before and not given.changed:
                self._system.note(
                    "left-out-after-swap",
                    f"{fact_name} is left out: no instance has such a parameter after the swap",
                )
            else:
                sentence = f"no instance has a parameter {listed(fact.parameters, last='or')}"
                self._system.report(given.where, sentence, "parameter-unknown")
        return by_change

    def _from_tyre_files(self) -> None:
        """Set the coefficients of tyre property files in every instance that declares them."""
        document, key = self._scenario.tyres_place
        where = document.location(key)
        named = ValueSource(LITERATURE, file=str(document.path), line=document.lines.get(key, 0))
        for axle, file in self._scenario.tyre_files.items():
            origin = _of_file(file.path.name, f"tyre property file {file.path.name}", named)
            for name, value in file.values.items():
                given, says = Given(value, origin, where), f"{file.path}: {name.upper()}: "
                for instance in self._takers(f"{name}_{axle}"):
                    self._give(instance, f"{name}_{axle}", given, says)
        if self._scenario.tyre_files and not any(map(_takes_tyre_files, self._fmus.values())):
            if any(map(_takes_tyre_files, self._system.before())):
                self._system.note(
                    "left-out-after-swap", "tyres are left out: no tyre takes such files after the swap"
                )
            else:
                sentence = "no instance is a tyre that takes such files; tyre_magic_formula_62 does"
                self._system.report(where, sentence, "tyre-file-unused")

    def _from_vehicle(self) -> None:
        of_car, reported = self._scenario.vehicle_file.parameters, len(self._system.reported)
        numbers: dict[str, float] = {}
        idle: list[str] = []
        for name, given in of_car.items():
            takers = self._takers(name)
            for instance in takers:
                self._give(instance, name, given)
            if name in CAR:
                try:
                    numbers[name] = float(value_for(_quantity(name), given.value))
                except ValueError as error:
                    if not takers:
                        self._system.report(given.where, str(error), code_of(error))
            if takers or name in CAR:
                idle += [] if takers else [name]
            elif any(_is_parameter(fmu, name) for fmu in self._system.before()):
                self._system.note(
                    "left-out-after-swap",
                    f"vehicle.{name} is left out: no instance has such a parameter after the swap",
                )
            else:
                known = {v.name for fmu in self._fmus.values() for v in fmu.of("parameter")}
                likely = closest(name, sorted(known | CAR.keys()))
                guess = f"; did you mean {likely!r}?" if likely else ""
                self._system.report(
                    given.where, f"no instance has a parameter {name!r}{guess}", "parameter-unknown"
                )
        numbers = self._adapted(numbers)
        for name, sentence in contradictions(numbers):
            where = of_car[name].where if name in of_car else self._where
            self._system.report(where, sentence, "vehicle-contradictory")
        self.car = car_of(numbers)
        for name, formula in self.car.formulas.items():
            given = Given(self.car.values[name], ValueOrigin.derived(formula), self._where)
            for instance in self._takers(name):
                self._give(instance, name, given, f"{instance}.{name} = {formula}: ")
        self._is_wrong = len(self._system.reported) > reported
        for name in idle:
            if name not in self.car.used and of_car[name].changed:
                self._system.note(
                    "value-unused", f"vehicle.{name} changes nothing: no instance takes it or what follows"
                )

    def _adapted(self, given: Mapping[str, float]) -> dict[str, float]:
        """Return the vehicle file's quantities after changes, with those that follow; note them."""
        before, of_car = {**given}, self._scenario.vehicle_file.parameters
        changed = [name for name in given if of_car[name].changed]
        for name in changed:
            del before[name]
            if (replaced := of_car[name].replaces) is not None:
                with suppress(ValueError):  # of a value that is not valid
                    before[name] = float(value_for(_quantity(name), replaced.value))
        after, notes = adapted(given, before, changed)
        for sentence in notes:
            self._system.note("quantity-follows", sentence)
        for name, value in after.items():
            if value != given.get(name):
                origin = ValueOrigin.derived(f"follows from {listed(changed)}")
                for instance in self._takers(name):
                    self._give(instance, name, Given(value, origin, self._where), f"{name}: ")
        return after

    def _settle_stiffnesses(self) -> None:
        """Leave out the vehicle file's stiffness of an axle where the scenario gives that of one tyre."""
        for instance in self._takers("cornering_stiffness"):
            given = self._system.given[instance]
            own = _level(given["cornering_stiffness"].origin)
            for name in STIFFNESSES:
                if name in self._values[instance] and own > _level(given[name].origin):
                    del self._values[instance][name]
                    given[name] = Given(self._fmus[instance].variables[name].start)

    def _refuse_half_a_car(self) -> None:
        """Report instances that get only part of their car; store which stiffnesses tyres must supply.

        A vehicle file from which not even static loads follow does not describe a car: it only replaces some
        defaults of the FMUs.
        """
        if self._is_wrong or not self.car.values.keys() >= {*STATIC_LOADS}:
            return
        for instance, fmu in self._fmus.items():
            by_name = self._values[instance]
            lacks = [v.name for v in fmu.of("parameter") if v.name in CAR and v.name not in by_name]
            of_tyres = [name for name in lacks if name in STIFFNESSES]
            if of_tyres and "tyre_force_y_fl" not in fmu.variables:
                self.lacking[instance] = of_tyres
            needed = [name for name in lacks if CAR[name].needed]
            if needed and any(name in self.car.values for name in by_name):
                self._system.report(
                    ("units", instance),
                    f"{fmu.name} takes its car from the vehicle file, which gives neither "
                    f"{listed(needed, last='nor')} nor what {'they' if len(needed) > 1 else 'it'} would "
                    "follow from: give them there, or to this instance",
                    "vehicle-incomplete",
                )

    def _is_left_out(self, instance: str, name: str, given: Given[Any]) -> bool:
        """Return whether a value was meant for the replaced FMU of an instance."""
        if instance not in self._scenario.replaced or given.changed:
            return False
        before = self._system.replaced(instance)
        return before is None or _is_parameter(before, name)


def _level(origin: ValueOrigin) -> int:
    """Return the precedence of an origin: that of a default, the vehicle file, the scenario, an override."""
    return {"default": 0, "vehicle": 1, "derived": 1, "scenario": 2, "file": 2}.get(origin.kind, 3)


def _of_file(name: str, says: str, named: ValueSource | None) -> ValueOrigin:
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


def known_car(parameters: Mapping[str, Value]) -> CarQuantities:
    """Return the quantities of a car that follow from the (valid) values of a vehicle file."""
    of_car = {name: raw for name, raw in parameters.items() if name in CAR}
    return car_of({name: float(value_for(_quantity(name), raw)) for name, raw in of_car.items()})


@cache
def _quantity(name: str) -> Variable:
    """Return a parameter with the unit and limits of a quantity of a car."""
    quantity = CAR[name]
    return Variable(
        name, 0, "Real", "parameter", "fixed", quantity.unit, None, quantity.minimum, None, quantity.text
    )  # fmt: skip


def _is_parameter(fmu: Fmu, name: str) -> bool:
    return name in fmu.variables and fmu.variables[name].causality == "parameter"


def _takes_tyre_files(fmu: Fmu) -> bool:
    return _is_parameter(fmu, "pcy1_front") and "tyre_force_y_fl" in fmu.variables


def _unknown(instance: str, fmu: Fmu, name: str) -> str:
    if name in fmu.variables and fmu.variables[name].causality == "input":
        return f"{name!r} is an input of {instance}, not a parameter: give constants under 'inputs'"
    if name in fmu.variables and fmu.variables[name].causality == "structuralParameter":
        start = fmu.variables[name].start
        return (
            f"{name!r} of {instance} is a structural parameter, which can only keep its start value, {start}"
        )
    if name in fmu.refused:
        return f"{instance}.{name} {fmu.refused[name]}"
    names = fold([v.name for v in fmu.of("parameter")])
    return f"{instance} ({fmu.name}) has no parameter {name!r}" + hint(name, names, lead="it has")
