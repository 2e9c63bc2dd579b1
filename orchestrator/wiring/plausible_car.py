"""Remarks on cars that cannot be: a mass in grams, a wheelbase in mm, a yaw inertia that no mass has.

Ranges are beside the quantities (`vocabulary.vehicle`). What an FMU begins with is not looked at: it is its
author's.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import NamedTuple

from vocabulary.vehicle import CAR, DYNAMIC_INDEX

from ..plan import DEFAULT, Finding, Unit, Value
from ..scenario.load import Scenario
from ..scenario.quantities import meant_unit, number_and_unit
from .parameters import known_car

KIND = "no car"
INERTIA = ("yaw_inertia", "mass", "cg_to_front_axle", "cg_to_rear_axle")
"""What the dynamic index follows from."""


class _Given(NamedTuple):
    """A quantity of the car as it is given, in a place."""

    place: str
    name: str
    value: float  # in SI
    raw: object  # as written


def remarks_on_car(scenario: Scenario, units: Mapping[str, Unit]) -> list[Finding]:
    """Return a remark for every quantity of the car that no car has, and for inertias that do not fit."""
    of_file = remarks_on_values(scenario.vehicle_file.parameters)
    told = {(one.name, one.value) for one in _of_file(scenario.vehicle_file.parameters)}
    own = [one for one in _of_units(scenario, units) if (one.name, one.value) not in told]
    return [*of_file, *filter(None, map(_beyond, own)), *_index(units)]


def remarks_on_values(parameters: Mapping[str, Value]) -> list[Finding]:
    """Return a remark for every value of a vehicle file that no car has."""
    return [*filter(None, map(_beyond, _of_file(parameters)))]


def _of_file(parameters: Mapping[str, Value]) -> Iterator[_Given]:
    for name, raw in parameters.items():
        if name in CAR:
            try:
                yield _Given(f"vehicle.{name}", name, known_car({name: raw}).values[name], raw)
            except ValueError:  # in a unit that an FMU alone knows
                continue


def _of_units(scenario: Scenario, units: Mapping[str, Unit]) -> Iterator[_Given]:
    """Yield what single units are given, by the scenario or by a change."""
    for unit in units.values():
        for name, value in unit.parameters.items():
            origin = unit.origins.get(name, DEFAULT).kind
            as_said = unit.fmu.variables[name].unit == CAR[name].unit if name in CAR else False
            if as_said and origin not in ("default", "vehicle", "derived") and isinstance(value, float):
                raw = scenario.units[unit.name].parameters.get(name, value)
                yield _Given(f"{unit.name}.{name}", name, value, raw)


def _beyond(one: _Given) -> Finding | None:
    """Return a remark on a value outside its range, None if it is inside or has none."""
    quantity = CAR[one.name]
    if quantity.plausible is None:
        return None
    low, high = quantity.plausible
    if low <= one.value <= high or one.value == 0.0:
        return None
    written = number_and_unit(one.raw) if isinstance(one.raw, str) else None
    number, given = written or (f"{one.value:.10g}", quantity.unit)
    likely = meant_unit(float(number), given, quantity.unit, lambda value: low <= value <= high)
    unit = f" {quantity.unit}" if quantity.unit != "1" else ""
    says = f"{one.place}: {one.value:.10g}{unit} is no car's, {low:g} to {high:g}{unit} is plausible" + (
        f"; did you mean '{number} {likely}'?" if likely else ""
    )
    return Finding(KIND, one.place, one.value, None, says)


def _index(units: Mapping[str, Unit]) -> Iterator[Finding]:
    """Yield a remark on the first unit whose yaw inertia does not fit its mass and wheelbase.

    Not where one of them is no car's by itself, or all are the FMU's own.
    """
    for unit in units.values():
        values = {name: unit.parameter(name) for name in INERTIA if name in unit.fmu.variables}
        numbers = [value for value in values.values() if isinstance(value, float)]
        given = any(unit.origins.get(name, DEFAULT) != DEFAULT for name in INERTIA)
        if not given or len(numbers) < len(INERTIA):
            continue
        told = (_Given("", name, number, number) for name, number in zip(INERTIA, numbers, strict=True))
        if any(map(_beyond, told)):
            continue
        inertia, mass, front, rear = numbers
        index = inertia / (mass * front * rear)
        low, high = DYNAMIC_INDEX
        if not low <= index <= high:
            says = (
                f"{unit.name}: the yaw inertia, {inertia:.6g} kg.m2, is {index:.3g} times mass times the "
                f"distances of both axles from the centre of mass; that of cars is {low:g} to {high:g} times"
            )
            yield Finding(KIND, f"{unit.name}.yaw_inertia", inertia, None, says)
            return
