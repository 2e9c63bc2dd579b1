"""Remarks on values that are hardly meant: two for one matter, another car's, a slip of the pen."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from itertools import product
from typing import NamedTuple

from vocabulary.vehicle import CAR

from ..plan import DEFAULT, Finding, Unit, Value, Variable
from ..scenario.load import Scenario
from ..wording import fold, listed
from .parameters import STIFFNESSES
from .plausible_car import remarks_on_car
from .shared_facts import FACTS

OF_CAR = (*(name for name, one in CAR.items() if one.needed), *STIFFNESSES, "steering_ratio")
"""Parameters that describe the car, whichever unit has to know them."""
OF_FILES = ("default", "vehicle", "derived", "scenario", "file")
"""Origins of values that no change has given."""
SAME = 1e-9
"""Relative difference of values that count as equal: rounding of a conversion."""
RADIUS = 0.03
"""Relative difference of a wheel's radius from that of its tyre. Chosen: the load changes it by 1 to 2 %."""
SLIPS = (
    ("m/s", 70.0, "km/h", 3.6),  # chosen: above the top speed of nearly all cars
    ("rad", 4 * math.pi, "deg", 180 / math.pi),  # chosen: two turns of a hand wheel
)
"""Measurement unit, the largest plausible value in it, the unit that was perhaps meant, factor to it."""


class Told(NamedTuple):
    """What a unit is told of something."""

    unit: str
    name: str
    value: Value
    origin: str  # its kind
    variable: Variable


def remarks(scenario: Scenario, units: Mapping[str, Unit]) -> list[Finding]:
    """Return remarks on the values that a scenario's units are given."""
    return [
        *_two_values(units),
        *_other_cars(scenario, units),
        *_slips(scenario, units),
        *_of_tyres(scenario, units),
        *remarks_on_car(scenario, units),
        *_idle_units(scenario, units),
    ]


def _idle_units(scenario: Scenario, units: Mapping[str, Unit]) -> Iterator[Finding]:
    """Yield a remark for every unit that would take its first step after the end of the run."""
    lasts = scenario.stop_time - scenario.start_time
    for unit in units.values():
        step = unit.period * scenario.step_size
        if step > lasts:
            says = (
                f"{unit.name} never takes a step: its step_size, {float(step):g} s, is longer than the run, "
                f"{float(lasts):g} s; it keeps what it gave at the start"
            )
            yield Finding("no step", f"{unit.name}.step_size", float(step), None, says)


def _of_tyres(scenario: Scenario, units: Mapping[str, Unit]) -> Iterator[Finding]:
    """Yield a remark for what does not go with the tyre property files."""
    tyres = [unit for unit in units.values() if "pcy1_front" in unit.parameters]
    if not tyres or not scenario.tyre_files:
        return
    law = tyres[0].fmu.name.removeprefix("tyre_").removesuffix("_transient")
    for one in _parameters(units.values()):
        if one.name == "tyre" and "pcx1_front" in units[one.unit].parameters and one.value != law:
            says = f"{one.unit}.tyre is {one.value}: it does not ask the law of {tyres[0].name}, {law}"
            yield Finding("another tyre", place=f"{one.unit}.tyre", says=says)
    radii = {str(f.path.name): f.rolling_radius for f in scenario.tyre_files.values() if f.rolling_radius}
    told = [one for one in _parameters(units.values()) if one.name == "wheel_radius"]
    for (file, radius), one in product(radii.items(), told):
        if isinstance(one.value, float) and radius and abs(one.value / radius - 1.0) > RADIUS:
            yield Finding(
                "another radius",
                place=f"{one.unit}.wheel_radius",
                value=one.value,
                says=f"{one.unit}.wheel_radius is {one.value:.4g} m, but the tyres of {file} roll on "
                f"{radius:.4g} m at nominal load",
            )


def _two_values(units: Mapping[str, Unit]) -> Iterator[Finding]:
    """Yield a remark for everything that two units are told differently.

    Not if the scenario gives both values for their units, or both are the FMUs' own of what is no
    property of the car: then they are meant. But a speed held that is not that of the start is always told.
    """
    in_facts = {name for fact in FACTS.values() for name in (*fact.inputs, *fact.parameters)}
    groups: dict[str, list[Told]] = {}
    for one in _parameters(units.values()):
        groups.setdefault(one.name, []).append(one)
    for name, told in groups.items():
        if name not in in_facts and _one_matter(name, told) and _differ(told):
            vehicle = f"--set vehicle.{name}=VALUE gives it to all of them that have no value of their own"
            yield _finding(name, told, vehicle)
    for name, fact in FACTS.items():
        told = [one for one in _parameters(units.values()) if fact.counts(units[one.unit], one.name)]
        told += [one for one in _constants(units.values()) if one.name in fact.inputs]
        meant = ({"scenario"}, {"default"}) if fact.inputs else ()  # a road may differ from wheel to wheel
        if _differ(told) and {one.origin for one in told} not in meant:
            yield _finding(name, told, f"--set {name}=VALUE gives all of them one value")


def _one_matter(name: str, told: list[Told]) -> bool:
    """Return whether a parameter of several units is meant to have one value."""
    origins = {one.origin for one in told}
    measured_alike = len({one.variable.unit or "1" for one in told}) == 1
    if len(told) < 2 or not measured_alike or origins == {"scenario"}:
        return False
    if origins == {"default"}:
        return name in OF_CAR
    return name in OF_CAR or "vehicle" in origins or not _differ(told, start=True)


def _differ(told: list[Told], *, start: bool = False) -> bool:
    """Return whether numbers differ: the values, or those that the FMUs have themselves."""
    values = [one.variable.start if start else one.value for one in told]
    if any(isinstance(value, bool) or not isinstance(value, (int, float)) for value in values):
        return False
    numbers = [float(value) for value in values]  # type: ignore[arg-type]
    return len(numbers) > 1 and max(numbers) - min(numbers) > SAME * max(map(abs, numbers))


def _parameters(units: Iterable[Unit]) -> Iterator[Told]:
    for unit in units:
        for variable in unit.fmu.of("parameter"):
            value = unit.parameter(variable.name)
            if value is not None:
                origin = unit.origins.get(variable.name, DEFAULT).kind
                yield Told(unit.name, variable.name, value, origin, variable)


def _constants(units: Iterable[Unit]) -> Iterator[Told]:
    for unit in units:
        for name, value in unit.constants.items():
            if name not in unit.series:
                origin = unit.origins.get(name, DEFAULT).kind
                yield Told(unit.name, name, value, origin, unit.fmu.variables[name])


def _finding(name: str, told: list[Told], way_out: str) -> Finding:
    alike: dict[tuple[float, str], list[Told]] = {}
    for one in told:
        alike.setdefault((float(one.value), one.origin), []).append(one)  # type: ignore[arg-type]
    parts = []
    for (value, origin), some in alike.items():
        names = fold([f"{one.unit}.{one.name}" for one in some])
        parts.append(f"{listed(names)} {_measured(value, some[0].variable)} ({origin})")
    by_change = (one for one in told if one.origin not in OF_FILES)
    first = next(by_change, told[0])
    says = f"{name} has two values: {', '.join(parts)}; {way_out}"
    return Finding("two values", f"{first.unit}.{first.name}", float(first.value), None, says)  # type: ignore[arg-type]


def _other_cars(scenario: Scenario, units: Mapping[str, Unit]) -> Iterator[Finding]:
    """Yield a remark if units have properties of the car by default beside a vehicle file.

    A ratio of 1 is no car's: it says that angles are those of the road wheels.
    """
    found = [
        one
        for one in (_parameters(units.values()) if scenario.vehicle_file.parameters else ())
        if one.name in OF_CAR and one.origin == "default" and one.value != 1
    ]
    if found:
        told = [f"{one.unit}.{one.name} {_measured(one.value, one.variable)}" for one in found]
        says = f"not in the vehicle file, so as the FMUs have it: {listed(told)}"
        first = found[0]
        yield Finding("default car", f"{first.unit}.{first.name}", float(first.value), None, says)


def _slips(scenario: Scenario, units: Mapping[str, Unit]) -> Iterator[Finding]:
    """Yield a remark for every number that was probably meant in another unit."""
    for one in _parameters(units.values()):
        spec = scenario.units[one.unit].parameters.get(one.name)
        raw = scenario.vehicle_file.parameters.get(one.name) if spec is None else spec
        told = [getattr(scenario, name) for name, fact in FACTS.items() if one.name in fact.parameters]
        with_unit = any(isinstance(given, str) for given in (raw, *told))
        if one.origin == "default" or with_unit or not isinstance(one.value, float):
            continue
        for unit, largest, meant, factor in SLIPS:
            if one.variable.unit == unit and abs(one.value) > largest:
                says = (
                    f"{one.unit}.{one.name}: {one.value:g} {unit} is {factor * one.value:.4g} {meant}; "
                    f"did you mean '{one.value:g} {meant}'?"
                )
                yield Finding("slip", f"{one.unit}.{one.name}", one.value, None, says)
    for one in _constants(units.values()):
        if one.name in FACTS["friction"].inputs and isinstance(one.value, float) and one.value > 2.0:
            place = f"{one.unit}.{one.name}"
            says = f"{place}: a friction of {one.value:g} is no road's; did you mean '{one.value:g} %'?"
            yield Finding("slip", place, one.value, None, says)
            return


def _measured(value: Value, variable: Variable) -> str:
    unit = variable.unit or "1"
    return f"{value:.6g}{f' {unit}' if unit != '1' else ''}" if not isinstance(value, str) else value
