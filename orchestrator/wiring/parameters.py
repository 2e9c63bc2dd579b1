"""Values for parameters and constants: type, unit, limits and choices checked against the FMU.

A vehicle file describes a car for all plants: what no unit here takes of it is left alone if it is a quantity
that some unit may know (`vocabulary.vehicle`), and what a unit lacks is derived (`derivations`). A unit that
takes part of a car takes all of it: the rest of another car, which its FMU begins with, is no answer.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping

from vocabulary.friction_table import table_of
from vocabulary.patches import patches_of
from vocabulary.vehicle import CAR

from ..fmu.binary import integer_limits
from ..plan import DEFAULT, Fmu, Value, ValueOrigin, Variable
from ..scenario import quantities
from ..scenario.load import Scenario
from ..scenario.scenario_schema import TextSpec
from ..scenario.yaml_lines import Document, Key
from ..wording import closest, fold, hint, listed, short
from .derivations import Car, car_of, contradictions
from .patterns import had
from .shared_facts import facts_of
from .text_file import text_of

STIFFNESSES = ("cornering_stiffness_front", "cornering_stiffness_rear")
STATIC_LOADS = ("static_load_front", "static_load_rear")
"""What follows from tyres, and what of the car that takes (see `make_plan`)."""
WRITTEN: dict[str, Callable[[str], object]] = {"patches": patches_of, "friction_table": table_of}
"""Parameters that are text of a form of its own, and what reads it: its mistakes are told before a run."""
LARGEST, LARGEST_SINGLE = sys.float_info.max, (2 - 2**-23) * 2.0**127
"""Numbers of double and single precision."""


def value_for(variable: Variable, given: Value) -> Value:
    """Return what the scenario gives for a variable, in the variable's type and unit.

    Raises:
        ValueError: a sentence that says what is allowed.
    """
    convert = {"Real": _real, "Integer": _integer, "Enumeration": _enumeration}.get(variable.type, _other)
    value = convert(variable, given)
    unit = f" {variable.unit}" if variable.unit and variable.unit != "1" else ""
    if variable.choices is not None and value not in variable.choices:
        likely = closest(str(value), variable.choices)
        guess = f"; did you mean {likely!r}?" if likely else ""
        raise ValueError(f"must be one of {listed(variable.choices, last='or')} (got {short(given)}){guess}")
    if isinstance(value, (int, float)) and not isinstance(value, bool):
        if variable.minimum is not None and value < variable.minimum:
            raise ValueError(f"must be at least {variable.minimum:g}{unit} (got {short(given)})")
        if variable.maximum is not None and value > variable.maximum:
            raise ValueError(f"must be at most {variable.maximum:g}{unit} (got {short(given)})")
    return value


def _real(variable: Variable, given: Value) -> float:
    in_unit = f" in {variable.unit}" if variable.unit and variable.unit != "1" else ""
    if isinstance(given, bool):
        raise ValueError(f"must be a number{in_unit} (got {str(given).lower()})")
    value = float(
        quantities.convert(given, variable.unit, variable.definition) if isinstance(given, str) else given
    )
    if not abs(value) <= (LARGEST_SINGLE if variable.encoding == "Float32" else LARGEST):
        raise ValueError(f"must be a finite number{in_unit} (got {short(given)})")
    return value


def _integer(variable: Variable, given: Value) -> int:
    if isinstance(given, bool) or not isinstance(given, int):
        raise ValueError(f"must be a whole number (got {short(given)})")
    lowest, highest = integer_limits(variable.encoding or "Int32")
    if not lowest <= given <= highest:
        raise ValueError(f"must be a whole number from {lowest} to {highest} (got {short(given)})")
    return given


def _enumeration(variable: Variable, given: Value) -> int:
    items = variable.items or {}
    if isinstance(given, str) and given in items:
        return items[given]
    if given in items.values() and not isinstance(given, (bool, float)):
        return int(given)
    raise ValueError(f"must be one of {listed(items, last='or')} (got {short(given)})")


def _other(variable: Variable, given: Value) -> Value:
    if variable.type == "Boolean" and not isinstance(given, bool):
        raise ValueError(f"must be true or false (got {short(given)})")
    if variable.type == "String" and not isinstance(given, str):
        raise ValueError(f"must be text (got {short(given)}): put it in quotes")
    if isinstance(given, str) and variable.name in WRITTEN:
        WRITTEN[variable.name](given)
    return given


def origin(document: Document, key: Key) -> ValueOrigin:
    """Return where the value at a key comes from: the file's kind, or what changed it."""
    change = document.override(key)
    return ValueOrigin(change.origin if change else "vehicle" if key[0] == "parameters" else "scenario")


class Parameters:
    """The parameters of all units: their own, then the vehicle's for those that declare them.

    Problems go to the documents of the scenario, where values come from to `origins`, what was left out
    after a swap to `notes`: a value meant for the FMU that was replaced is no mistake if that FMU
    declares it.
    """

    def __init__(
        self,
        scenario: Scenario,
        fmus: Mapping[str, Fmu],
        replaced: Callable[[str], Fmu | None],
        notes: list[str],
        origins: Mapping[str, dict[str, ValueOrigin]],
    ) -> None:
        self._scenario = scenario
        self._fmus = fmus
        self._replaced = replaced
        self._notes = notes
        self._origins = origins
        self.car = Car({})
        self.lacking: dict[str, list[str]] = {}
        """Unit -> those of `STIFFNESSES` that only the tyres at their static loads can tell it."""

    def of_units(self) -> dict[str, dict[str, Value]]:
        """Return each unit's values."""
        given: dict[str, dict[str, Value]] = {unit: {} for unit in self._fmus}
        for unit, fmu in self._fmus.items():
            self._origins[unit].update((variable.name, DEFAULT) for variable in fmu.of("parameter"))
        self._from_tyre_files(given)
        self._from_vehicle(given)
        by_change = self._from_facts(given)
        for unit, fmu in self._fmus.items():
            for name, raw in self._scenario.units[unit].parameters.items():
                key = ("units", unit, "parameters", name)
                if (unit, name) in by_change and not self._scenario.document.override(key):
                    continue
                if _is_parameter(fmu, name):
                    self._put_own(given, unit, name, raw, key)
                elif self._left_out(unit, name, key):
                    self._notes.append(f"{unit}.{name} is left out: {fmu.name} has no such parameter")
                else:
                    sentence = _unknown(unit, fmu, name)
                    self._scenario.document.report(key, sentence)
        self._refuse_half_a_car(given)
        return given

    def _put_own(
        self, given: dict[str, dict[str, Value]], unit: str, name: str, raw: Value | TextSpec, key: Key
    ) -> None:
        """Give a unit's own value, or the text of a file."""
        document = self._scenario.document
        if not isinstance(raw, TextSpec):
            self._put(given, unit, name, raw, document, key)
            return
        variable = self._fmus[unit].variables[name]
        try:
            text = text_of(raw, self._scenario.path.parent, variable)
        except ValueError as error:
            document.report(key, str(error))
            return
        try:
            given[unit][name] = value_for(variable, text)
        except ValueError as error:
            document.report(key, f"{raw.file}: {error}")
        self._origins[unit][name] = ValueOrigin("file", raw.file)

    def _from_facts(self, given: dict[str, dict[str, Value]]) -> set[tuple[str, str]]:
        """Give what facts tell; return the (unit, parameter) whose fact was changed."""
        by_change: set[tuple[str, str]] = set()
        for fact_name, fact, raw, changed in facts_of(self._scenario):
            takers = [
                (unit, name)
                for unit, fmu in self._fmus.items()
                for name in fact.parameters
                if _is_parameter(fmu, name)
            ]
            for unit, name in takers:
                self._put(given, unit, name, raw, self._scenario.document, (fact_name,))
            by_change.update(takers if changed else ())
            if not fact.parameters or fact.inputs or takers:
                continue  # a fact with inputs is judged by these
            before = [
                had(self._scenario, self._replaced, self._fmus, name, "parameter") for name in fact.parameters
            ]
            if any(before) and not changed:
                self._notes.append(f"{fact_name} is left out: no unit has such a parameter after the swap")
            else:
                sentence = f"no unit has a parameter {listed(fact.parameters, last='or')}"
                self._scenario.document.report((fact_name,), sentence)
        return by_change

    def _from_tyre_files(self, given: dict[str, dict[str, Value]]) -> None:
        """Give the coefficients of tyre property files to every unit that declares them."""
        document, key = self._scenario.tyres_place
        for axle, file in self._scenario.tyre_files.items():
            for unit, fmu in self._fmus.items():
                for name, value in file.values.items():
                    parameter = f"{name}_{axle}"
                    if not _is_parameter(fmu, parameter):
                        continue
                    try:
                        given[unit][parameter] = value_for(fmu.variables[parameter], value)
                    except ValueError as error:
                        document.report(key, f"{file.path}: {name.upper()}: {error}")
                    self._origins[unit][parameter] = ValueOrigin("file", file.path.name)
        if self._scenario.tyre_files and not any(map(_takes_tyre_files, self._fmus.values())):
            before = (self._replaced(unit) for unit in self._scenario.replaced)
            if any(fmu is not None and _takes_tyre_files(fmu) for fmu in before):
                self._notes.append("tyres are left out: no tyre takes such files after the swap")
            else:
                document.report(key, "no unit is a tyre that takes such files; tyre_magic_formula_62 does")

    def _from_vehicle(self, given: dict[str, dict[str, Value]]) -> None:
        document = self._scenario.vehicle_document
        numbers: dict[str, float] = {}
        idle: list[str] = []
        for name, raw in self._scenario.vehicle_parameters.items():
            key = ("parameters", name)
            takers = [unit for unit, fmu in self._fmus.items() if _is_parameter(fmu, name)]
            for unit in takers:
                self._put(given, unit, name, raw, document, key)
            if name in CAR:
                try:
                    numbers[name] = float(value_for(_quantity(name), raw))
                except ValueError as error:
                    if not takers:
                        document.report(key, str(error))
            if takers or name in CAR:
                idle += [] if takers else [name]
                continue
            before = (self._replaced(unit) for unit in self._scenario.replaced)
            if any(fmu is not None and _is_parameter(fmu, name) for fmu in before):
                self._notes.append(f"vehicle.{name} is left out: no unit has such a parameter after the swap")
                continue
            known = {v.name for fmu in self._fmus.values() for v in fmu.of("parameter")}
            likely = closest(name, sorted(known | CAR.keys()))
            guess = f"; did you mean {likely!r}?" if likely else ""
            document.report(key, f"no unit has a parameter {name!r}{guess}")
        for name, sentence in contradictions(numbers):
            document.report(("parameters", name), sentence)
        self.car = car_of(numbers)
        self._derive(given)
        for name in idle:
            if name not in self.car.used and document.override(("parameters", name)):
                self._notes.append(f"vehicle.{name} changes nothing: no unit here takes it or what follows")

    def _derive(self, given: dict[str, dict[str, Value]]) -> None:
        """Give every unit what it declares of the car and the file does not say."""
        for name, formula in self.car.formulas.items():
            for unit, fmu in self._fmus.items():
                if not _is_parameter(fmu, name):
                    continue
                try:
                    given[unit][name] = value_for(fmu.variables[name], self.car.values[name])
                except ValueError as error:
                    place = ("parameters",)
                    self._scenario.vehicle_document.report(place, f"{unit}.{name} = {formula}: {error}")
                self._origins[unit][name] = ValueOrigin("derived", formula)

    def _refuse_half_a_car(self, given: Mapping[str, Mapping[str, Value]]) -> None:
        """Report units that the vehicle file gives part of a car; note what tyres have to tell.

        A file that not even static loads follow from is no car, but some values for the FMUs' own.
        """
        if self._scenario.vehicle_document.problems or not self.car.values.keys() >= {*STATIC_LOADS}:
            return
        for unit, fmu in self._fmus.items():
            lacks = [v.name for v in fmu.of("parameter") if v.name in CAR and v.name not in given[unit]]
            if of_tyres := [name for name in lacks if name in STIFFNESSES]:
                self.lacking[unit] = of_tyres
            needed = [name for name in lacks if CAR[name].needed]
            if needed and any(name in self.car.values for name in given[unit]):
                self._scenario.document.report(
                    ("units", unit),
                    f"{fmu.name} takes its car from the vehicle file, which gives neither "
                    f"{listed(needed, last='nor')} nor what {'they' if len(needed) > 1 else 'it'} would "
                    "follow from: give them there, or to this unit",
                )

    def _left_out(self, unit: str, name: str, key: Key) -> bool:
        """Return whether a value was meant for the FMU that an option has replaced."""
        if unit not in self._scenario.replaced or self._scenario.document.override(key):
            return False
        before = self._replaced(unit)
        return before is None or _is_parameter(before, name)

    def _put(
        self,
        given: dict[str, dict[str, Value]],
        unit: str,
        name: str,
        raw: Value,
        document: Document,
        key: Key,
    ) -> None:
        try:
            given[unit][name] = value_for(self._fmus[unit].variables[name], raw)
        except ValueError as error:
            document.report(key, str(error))
        self._origins[unit][name] = origin(document, key)


def known_car(given: Mapping[str, Value]) -> Car:
    """Return what follows from the values of a vehicle file, which fit the quantities of a car."""
    of_car = {name: raw for name, raw in given.items() if name in CAR}
    return car_of({name: float(value_for(_quantity(name), raw)) for name, raw in of_car.items()})


def _quantity(name: str) -> Variable:
    """Return a quantity of a car as if it were a parameter."""
    one = CAR[name]
    return Variable(
        name, 0, "Real", "parameter", "fixed", one.unit, None, one.minimum, None, one.text
    )  # fmt: skip


def _is_parameter(fmu: Fmu, name: str) -> bool:
    return name in fmu.variables and fmu.variables[name].causality == "parameter"


def _takes_tyre_files(fmu: Fmu) -> bool:
    return _is_parameter(fmu, "pcy1_front") and "tyre_force_y_fl" in fmu.variables


def _unknown(unit: str, fmu: Fmu, name: str) -> str:
    if name in fmu.variables and fmu.variables[name].causality == "input":
        return f"{name!r} is an input of {unit}, not a parameter: give constants under 'inputs'"
    if name in fmu.variables and fmu.variables[name].causality == "structuralParameter":
        start = fmu.variables[name].start
        return f"{name!r} of {unit} is a structural parameter, which can only keep its start value, {start}"
    if name in fmu.refused:
        return f"{unit}.{name} {fmu.refused[name]}"
    names = fold([v.name for v in fmu.of("parameter")])
    return f"{unit} ({fmu.name}) has no parameter {name!r}" + hint(name, names, lead="it has")
