"""Distributes parameters to instances, and checks values by type, unit, limits and choices of the FMU.

A vehicle file describes a car for all plants: quantities of a car (`vocabulary.vehicle`) that no instance
takes are ignored, and those that an instance lacks are derived (`derivations`). An instance that takes some
quantities of the car must get all of them, because the defaults of its FMU describe a different car.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import replace
from functools import cache, lru_cache
from pathlib import Path

from yawbench.fmus.fmu import Fmu, Value, Variable, integer_limits
from yawbench.foundation.errors import code_of
from yawbench.foundation.messages import closest, fold, hint, listed, short
from yawbench.foundation.safe_files import TEXT, read_bytes
from yawbench.vocabulary.friction_table import table_of
from yawbench.vocabulary.patches import patches_of
from yawbench.vocabulary.vehicle import CAR

from ..plan import DEFAULT, LITERATURE, VARIED, OriginKind, ValueOrigin, ValueSource
from ..scenario import quantities
from ..scenario.loader import LoadedScenario
from ..scenario.schema import TextSpec
from ..scenario.yaml_lines import Document, KeyPath
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


def origin(scenario: LoadedScenario, key: KeyPath, *, unit: str | None = None) -> ValueOrigin:
    """Return where the value at a key comes from: the override, or the file with the comment on the value.

    A comment above an instance is on all its values; without any, the source is that of the file.

    Args:
        scenario: of the file; keys that begin with "parameters" are of its vehicle file.
        key: of the value.
        unit: measurement unit of a vehicle file's value, with which its comment may begin.
    """
    of_vehicle = key[0] == "parameters"
    document = scenario.vehicle_document if of_vehicle else scenario.document
    change = document.override(key)
    if change is not None:
        return ValueOrigin(change.origin, source=ValueSource(VARIED, change.origin))
    comment, of_file, line = document.comment(key), scenario.source, document.lines.get(key, 0)
    if of_vehicle:
        return _in_vehicle_file(comment, unit or "1", scenario.vehicle_file.source, str(document.path), line)
    comment = comment or (document.comment_above(key[:2]) if key[0] == "units" else "") or of_file
    return _in_file("scenario", comment, of_file, str(document.path), line)


@lru_cache(maxsize=10_000)
def _in_vehicle_file(comment: str, unit: str, of_file: str, path: str, line: int) -> ValueOrigin:
    words = re.sub(rf"^{re.escape(unit)}(?![\w/.])[,;]?\s*", "", comment)
    return _in_file("vehicle", words, of_file, path, line)


@lru_cache(maxsize=10_000)
def _in_file(kind: OriginKind, comment: str, of_file: str, path: str, line: int) -> ValueOrigin:
    source = ValueSource.of_comment(comment, of_file)
    return ValueOrigin(kind, source=replace(source, file=path, line=line))


class Parameters:
    """The parameters of all instances: their own, else facts, the vehicle's and the tyre files' values."""

    def __init__(self, system: WiringContext) -> None:
        self._system = system
        self._scenario = system.scenario
        self._fmus = system.fmus
        self._given: dict[str, dict[str, Value]] = {instance: {} for instance in system.fmus}
        self.car = CarQuantities({})
        self.lacking: dict[str, list[str]] = {}
        """Instance -> those of its `STIFFNESSES` that have to be measured on the tyres at static loads."""

    def of_instances(self) -> dict[str, dict[str, Value]]:
        """Return the parameter values of each instance."""
        for instance, fmu in self._fmus.items():
            self._system.origins[instance].update(
                (variable.name, DEFAULT) for variable in fmu.of("parameter")
            )
        self._from_tyre_files()
        self._from_vehicle()
        by_change = self._from_facts()
        of_car = {instance: dict(given) for instance, given in self._given.items()}
        for instance in self._fmus:
            for name, raw in self._scenario.units[instance].parameters.items():
                key = ("units", instance, "parameters", name)
                if (instance, name) not in by_change or self._scenario.document.override(key):
                    self._give_own(instance, name, raw, key)
            self._give_way(instance, of_car[instance])
        self._settle_stiffnesses()
        self._refuse_half_a_car()
        return self._given

    def _give(
        self,
        instance: str,
        name: str,
        raw: Value,
        place: tuple[Document, KeyPath],
        came: ValueOrigin | None = None,
        says: str = "",
    ) -> None:
        """Set a parameter of an instance; report errors at `place`, with the prefix `says`."""
        document, key = place
        try:
            self._given[instance][name] = value_for(self._fmus[instance].variables[name], raw)
        except ValueError as error:
            self._system.report(key, f"{says}{error}", code_of(error), document)
        unit_of = self._fmus[instance].variables[name].unit
        self._system.origins[instance][name] = came or origin(self._scenario, key, unit=unit_of)

    def _takers(self, name: str) -> list[str]:
        return [instance for instance, fmu in self._fmus.items() if _is_parameter(fmu, name)]

    def _give_own(self, instance: str, name: str, raw: Value | TextSpec, key: KeyPath) -> None:
        """Set a parameter listed under its instance: to a value, or the text of a file."""
        fmu, place = self._fmus[instance], (self._scenario.document, key)
        if not _is_parameter(fmu, name):
            if self._is_left_out(instance, name, key):
                sentence = f"{instance}.{name} is left out: {fmu.name} has no such parameter"
                self._system.note("left-out-after-swap", sentence)
            else:
                self._system.report(key, _unknown(instance, fmu, name), "parameter-unknown")
        elif not isinstance(raw, TextSpec):
            self._give(instance, name, raw, place)
        elif fmu.variables[name].type != "String":
            self._system.report(
                key, "takes a value: only parameters that are text take a file", "value-wrong-type"
            )
        else:
            try:
                text = _text_of(self._scenario.path.parent / raw.file)
            except ValueError as error:
                self._system.report(key, f"{raw.file}: {error}", "file-unreadable")
            else:
                came = _from_file(raw.file, f"file {raw.file}", place)
                self._give(instance, name, text, place, came, f"{raw.file}: ")

    def _give_way(self, instance: str, of_car: Mapping[str, Value]) -> None:
        """Keep the wheels of an instance's car where only its mass, or only its sprung mass, is changed.

        Args:
            instance: its name.
            of_car: its parameters by the vehicle file.
        """
        fmu, given, document = self._fmus[instance], self._given[instance], self._scenario.document
        for name, (yielding, stays) in GIVES_WAY.items():
            key, other = (("units", instance, "parameters", each) for each in (name, yielding))
            change = document.override(key)
            if not change or document.override(other) or name not in given or _is_parameter(fmu, stays):
                continue
            if not _is_parameter(fmu, yielding):
                continue
            raw = document.before.get(key)
            before = of_car.get(name, fmu.variables[name].start) if raw is None else raw
            was = given.get(yielding, fmu.variables[yielding].start)
            if before is None or was is None:
                continue
            try:
                added = float(given[name]) - float(value_for(fmu.variables[name], before))
                moved = float(was) + added
            except ValueError:
                continue  # of a value that is not valid, which is reported elsewhere
            if added:
                came = ValueOrigin.derived(f"the wheels keep their mass, {added:+.6g} kg as {name}")
                self._give(instance, yielding, moved, (document, key), came, f"{yielding}: ")
                self._system.note(
                    "quantity-follows",
                    f"{instance}.{name} = {given[name]:.6g} kg: the wheels keep their mass, so {yielding} "
                    f"becomes {moved:.6g} kg ({was:.6g} kg before)",
                )

    def _from_facts(self) -> set[tuple[str, str]]:
        """Set the parameters that facts reach; return the (instance, parameter) of overridden facts."""
        by_change: set[tuple[str, str]] = set()
        for fact_name, fact, raw, changed in facts_of(self._scenario):
            takers = [(instance, name) for name in fact.parameters for instance in self._takers(name)]
            for instance, name in takers:
                self._give(instance, name, raw, (self._scenario.document, (fact_name,)))
            by_change.update(takers if changed else ())
            if not fact.parameters or fact.inputs or takers:
                continue  # for a fact with inputs, `constants` reports whether it has an effect
            before = any(self._system.had(self._fmus, name, "parameter") for name in fact.parameters)
            if before and not changed:
                self._system.note(
                    "left-out-after-swap",
                    f"{fact_name} is left out: no instance has such a parameter after the swap",
                )
            else:
                sentence = f"no instance has a parameter {listed(fact.parameters, last='or')}"
                self._system.report((fact_name,), sentence, "parameter-unknown")
        return by_change

    def _from_tyre_files(self) -> None:
        """Set the coefficients of tyre property files in every instance that declares them."""
        place = self._scenario.tyres_place
        for axle, file in self._scenario.tyre_files.items():
            came = _from_file(file.path.name, f"tyre property file {file.path.name}", place)
            for name, value in file.values.items():
                for instance in self._takers(f"{name}_{axle}"):
                    self._give(
                        instance, f"{name}_{axle}", value, place, came, f"{file.path}: {name.upper()}: "
                    )
        if self._scenario.tyre_files and not any(map(_takes_tyre_files, self._fmus.values())):
            if any(map(_takes_tyre_files, self._system.before())):
                self._system.note(
                    "left-out-after-swap", "tyres are left out: no tyre takes such files after the swap"
                )
            else:
                document, key = place
                sentence = "no instance is a tyre that takes such files; tyre_magic_formula_62 does"
                self._system.report(key, sentence, "tyre-file-unused", document)

    def _from_vehicle(self) -> None:
        document = self._scenario.vehicle_document
        numbers: dict[str, float] = {}
        idle: list[str] = []
        for name, raw in self._scenario.vehicle_file.parameters.items():
            key = ("parameters", name)
            takers = self._takers(name)
            for instance in takers:
                self._give(instance, name, raw, (document, key))
            if name in CAR:
                try:
                    numbers[name] = float(value_for(_quantity(name), raw))
                except ValueError as error:
                    if not takers:
                        self._system.report(key, str(error), code_of(error), document)
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
                    key, f"no instance has a parameter {name!r}{guess}", "parameter-unknown", document
                )
        numbers = self._adapted(numbers)
        for name, sentence in contradictions(numbers):
            self._system.report(("parameters", name), sentence, "vehicle-contradictory", document)
        self.car = car_of(numbers)
        for name, formula in self.car.formulas.items():
            for instance in self._takers(name):
                came, says = ValueOrigin.derived(formula), f"{instance}.{name} = {formula}: "
                self._give(instance, name, self.car.values[name], (document, ("parameters",)), came, says)
        for name in idle:
            if name not in self.car.used and document.override(("parameters", name)):
                self._system.note(
                    "value-unused", f"vehicle.{name} changes nothing: no instance takes it or what follows"
                )

    def _adapted(self, given: Mapping[str, float]) -> dict[str, float]:
        """Return the vehicle file's quantities after changes, with those that follow; note them."""
        document, before = self._scenario.vehicle_document, {**given}
        changed = [name for name in given if document.override(("parameters", name))]
        for name in changed:
            del before[name]
            if (raw := document.before.get(("parameters", name))) is not None:
                with suppress(ValueError):  # of a value that is not valid
                    before[name] = float(value_for(_quantity(name), raw))
        after, notes = adapted(given, before, changed)
        for sentence in notes:
            self._system.note("quantity-follows", sentence)
        for name, value in after.items():
            if value != given.get(name):
                for instance in self._takers(name):
                    came = ValueOrigin.derived(f"follows from {listed(changed)}")
                    self._give(instance, name, value, (document, ("parameters",)), came, f"{name}: ")
        return after

    def _settle_stiffnesses(self) -> None:
        """Leave out the vehicle file's stiffness of an axle where the scenario gives that of one tyre."""
        for instance in self._takers("cornering_stiffness"):
            origins = self._system.origins[instance]
            own = _level(origins["cornering_stiffness"])
            for name in STIFFNESSES:
                if name in self._given[instance] and own > _level(origins[name]):
                    del self._given[instance][name]
                    origins[name] = DEFAULT

    def _refuse_half_a_car(self) -> None:
        """Report instances that get only part of their car; store which stiffnesses tyres must supply.

        A vehicle file from which not even static loads follow does not describe a car: it only replaces some
        defaults of the FMUs.
        """
        wrong = any(of_vehicle for (of_vehicle, *_), _ in self._system.reported)
        if wrong or not self.car.values.keys() >= {*STATIC_LOADS}:
            return
        for instance, fmu in self._fmus.items():
            by_name = self._given[instance]
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

    def _is_left_out(self, instance: str, name: str, key: KeyPath) -> bool:
        """Return whether a value was meant for the replaced FMU of an instance."""
        if instance not in self._scenario.replaced or self._scenario.document.override(key):
            return False
        before = self._system.replaced(instance)
        return before is None or _is_parameter(before, name)


def _level(came: ValueOrigin) -> int:
    """Return the precedence of an origin: that of a default, the vehicle file, the scenario, an override."""
    return {"default": 0, "vehicle": 1, "derived": 1, "scenario": 2, "file": 2}.get(came.kind, 3)


def _from_file(name: str, says: str, place: tuple[Document, KeyPath]) -> ValueOrigin:
    """Return the origin of values in a file that is named at a place."""
    document, key = place
    return ValueOrigin(
        "file", name, ValueSource(LITERATURE, says, str(document.path), document.lines.get(key, 0))
    )


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
