"""Warnings about suspicious values: implausible, conflicting, or left over from another car.

Implausible are values outside the ranges of `vocabulary.vehicle` and `PLAUSIBLE`: a mass in grams, a
wheelbase in mm, an angle in degrees. Defaults of FMUs are not checked: they are the responsibility of their
authors.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from fractions import Fraction
from functools import lru_cache
from itertools import product
from typing import Any, NamedTuple

from yawbench.fmus.fmu import Value, Variable
from yawbench.foundation.errors import Diagnostic, Location
from yawbench.foundation.messages import fold, listed
from yawbench.orchestrator.plan import DEFAULT, OF_FILES, Given, Instance, OriginKind
from yawbench.orchestrator.scenario.loader import LoadedScenario
from yawbench.orchestrator.scenario.quantities import meant_unit, number_and_unit
from yawbench.vocabulary.facts import FACTS
from yawbench.vocabulary.roles import without_role

from .derivations import STIFFNESSES, known_car
from .quantities import CAR
from .tir import TyreFile

PLAUSIBLE = {
    "friction": (0.0, 2.0, "%"),  # chosen: above racing tyres on dry asphalt
    "m/s": (-70.0, 70.0, "km/h"),  # chosen: above the top speed of nearly all cars
    "rad": (-4.0 * math.pi, 4.0 * math.pi, "deg"),  # chosen: two turns of a hand wheel
}
"""Fact or unit -> smallest and largest plausible value, and the unit that is meant beyond; not `324 km/h`."""
OF_CAR = (*(name for name, quantity in CAR.items() if quantity.needed), *STIFFNESSES, "steering_ratio")
"""Parameters that describe the car in any instance."""
IN_FACTS = {name for fact in FACTS.values() for name in (*fact.inputs, *fact.parameters)}
"""Inputs and parameters that facts set."""
SAME = 1e-9
"""Relative difference of values that count as equal: rounding of a conversion."""
RADIUS = 0.03
"""Tolerated relative difference of wheel and tyre radius. Chosen: the load changes it by 1 to 2 %."""


class GivenValue(NamedTuple):
    """The value of a parameter or constant of an instance, with its origin."""

    instance: str
    name: str
    value: Value
    origin: OriginKind
    variable: Variable
    given: Given[Any]  # in the file or the override

    @property
    def written(self) -> object:
        """The value as it is written."""
        return self.given.value

    @property
    def unit(self) -> str:
        """The unit that the value names; "" without one."""
        return self.given.unit

    @property
    def signal(self) -> str:
        """Its name in messages."""
        return f"{self.instance}.{self.name}"

    @property
    def shown(self) -> str:
        """The value with its unit."""
        unit = f" {self.variable.unit}" if self.variable.unit not in (None, "1") else ""
        return f"{self.value:.6g}{unit}" if not isinstance(self.value, str) else self.value


class _Quantity(NamedTuple):
    """A value with the range that it should be in."""

    where: str
    name: str
    value: float
    written: object  # in the file or the override
    unit: str
    plausible: tuple[float, float] | None
    meant: str = ""  # unit of values outside it; "": the one that puts them inside


def suspicious_values(scenario: LoadedScenario, instances: Mapping[str, Instance]) -> list[Diagnostic]:
    """Return warnings about the values of a scenario's instances."""
    parameters, constants = [*_parameters(instances.values())], [*_constants(instances.values())]
    of_car = _of_vehicle(scenario.vehicle_file.values)
    return [
        *_two_values(instances, parameters, constants),
        *_other_cars(scenario, parameters),
        *_of_tyres(scenario, instances, parameters),
        *_implausible([*of_car, *_of_instances([*parameters, *constants])]),
    ]


def suspicious_vehicle(parameters: Mapping[str, Value]) -> list[Diagnostic]:
    """Return a warning for every implausible value of a vehicle file."""
    return _implausible(_of_vehicle(parameters))


def _implausible(quantities: Iterable[_Quantity]) -> list[Diagnostic]:
    """Return a warning for every value outside its range, once wherever it is given."""
    beyond = {
        (item.name, item.value): item
        for item in reversed([*quantities])
        if item.plausible and item.value and not item.plausible[0] <= item.value <= item.plausible[1]
    }
    return [*map(_beyond, reversed(beyond.values()))]


def _beyond(item: _Quantity) -> Diagnostic:
    assert item.plausible
    low, high = item.plausible
    given = number_and_unit(item.written) if isinstance(item.written, str) else None
    number, assumed = given or (f"{item.value:.10g}", item.unit)
    likely = item.meant or meant_unit(
        float(Fraction(number)), assumed, item.unit, lambda value: low <= value <= high
    )
    unit = f" {item.unit}" if item.unit != "1" else ""
    says = f"{item.where}: {item.value:.10g}{unit} is implausible (plausible: {low:g} to {high:g}{unit})"
    guess = f"; did you mean '{number} {likely}'?" if likely else ""
    return _warning("value-implausible", item.where, f"{says}{guess}", item.value)


def _of_vehicle(parameters: Mapping[str, Value]) -> Iterator[_Quantity]:
    for name, written in parameters.items():
        if name in CAR and (value := _in_si(name, written)) is not None:
            yield _Quantity(f"vehicle.{name}", name, value, written, CAR[name].unit, CAR[name].plausible)


@lru_cache(maxsize=10_000, typed=True)
def _in_si(name: str, written: Value) -> float | None:
    try:
        return known_car({name: written}).values[name]
    except ValueError:  # in a unit that only an FMU defines
        return None


def _of_instances(given: Iterable[GivenValue]) -> Iterator[_Quantity]:
    """Yield the values that the scenario or an override gives to instances."""
    for item in given:
        if item.origin in ("default", "vehicle", "derived") or not isinstance(item.value, float):
            continue
        name, unit = item.name, item.variable.unit or "1"
        if name in FACTS["friction"].inputs:
            name = "friction"
        if name in CAR and unit == CAR[name].unit:
            yield _Quantity(item.signal, name, item.value, item.written, unit, CAR[name].plausible)
        elif not item.unit and (known := PLAUSIBLE.get(name, PLAUSIBLE.get(unit))):
            yield _Quantity(item.signal, name, item.value, item.written, unit, known[:2], known[2])


def _of_tyres(
    scenario: LoadedScenario, instances: Mapping[str, Instance], parameters: Sequence[GivenValue]
) -> Iterator[Diagnostic]:
    """Yield a warning for every value that contradicts the tyre property files."""
    tyres = [instance for instance in instances.values() if "pcy1_front" in instance.parameters]
    if not tyres or not scenario.tyre_files:
        return
    law = without_role(tyres[0].fmu.name).removesuffix("_transient")
    for item in parameters:
        if item.name == "tyre" and "pcx1_front" in instances[item.instance].parameters and item.value != law:
            says = f"{item.signal} is {item.value}: {tyres[0].name} follows {law}"
            yield _warning("tyre-mismatch", item.signal, says)
    for file, item in product(scenario.tyre_files.values(), parameters):
        radius = file.rolling_radius if isinstance(file, TyreFile) else None
        if item.name != "wheel_radius" or not radius or not isinstance(item.value, float):
            continue
        if abs(item.value / radius - 1.0) > RADIUS:
            says = (
                f"{item.signal} is {item.value:.4g} m, but the tyres of {file.path.name} roll on "
                f"{radius:.4g} m at nominal load"
            )
            yield _warning("wheel-radius-mismatch", item.signal, says, item.value)


def _two_values(
    instances: Mapping[str, Instance], parameters: Sequence[GivenValue], constants: Sequence[GivenValue]
) -> Iterator[Diagnostic]:
    """Yield a warning for every quantity that has different values in several instances.

    Exceptions are values that the scenario gives to the single instances, and defaults of FMUs for
    quantities that are not properties of the car: these are intended. A target speed that differs from the
    initial speed is always reported.
    """
    groups: dict[str, list[GivenValue]] = {}
    for item in parameters:
        groups.setdefault(item.name, []).append(item)
    for name, items in groups.items():
        if name not in IN_FACTS and _one_matter(name, items) and _differ(items):
            vehicle = f"--set vehicle.{name}=VALUE sets it in all of them without a value of their own"
            yield _values_differ(name, items, vehicle)
    for name, fact in FACTS.items():
        items = [item for item in parameters if fact.counts(instances[item.instance], item.name)]
        items += [item for item in constants if item.name in fact.inputs]
        meant = ({"scenario"}, {"default"}) if fact.inputs else ()  # a road may differ from wheel to wheel
        if _differ(items) and {item.origin for item in items} not in meant:
            yield _values_differ(name, items, f"--set {name}=VALUE sets it in all of them")


def _one_matter(name: str, items: list[GivenValue]) -> bool:
    """Return whether a parameter of several instances should have the same value in all of them."""
    origins = {item.origin for item in items}
    measured_alike = len({item.variable.unit or "1" for item in items}) == 1
    if len(items) == 1 or not measured_alike or origins == {"scenario"}:
        return False
    if name in OF_CAR or origins == {"default"}:
        return name in OF_CAR
    return "vehicle" in origins or not _differ(items, start=True)


def _differ(items: list[GivenValue], *, start: bool = False) -> bool:
    """Return whether numeric values differ; `start`: whether the FMUs' start values do."""
    values = [item.variable.start if start else item.value for item in items]
    numbers = [float(x) for x in values if isinstance(x, (int, float)) and not isinstance(x, bool)]
    if len(numbers) < max(2, len(values)):
        return False
    return max(numbers) - min(numbers) > SAME * max(map(abs, numbers))


def _parameters(instances: Iterable[Instance]) -> Iterator[GivenValue]:
    for instance in instances:
        for variable in instance.fmu.of("parameter"):
            value, given = instance.parameter(variable.name), instance.given[variable.name]
            if value is not None and (value != 0 or given.origin != DEFAULT):  # 0 by default: not given
                yield GivenValue(instance.name, variable.name, value, given.origin.kind, variable, given)


def _constants(instances: Iterable[Instance]) -> Iterator[GivenValue]:
    for instance in instances:
        for name, value in instance.constants.items():
            if name not in instance.series:
                given = instance.given.get(name, Given(value))
                yield GivenValue(
                    instance.name, name, value, given.origin.kind, instance.fmu.variables[name], given
                )


def _values_differ(name: str, items: list[GivenValue], way_out: str) -> Diagnostic:
    alike: dict[tuple[float, str], list[GivenValue]] = {}
    for item in items:
        alike.setdefault((float(item.value), item.origin), []).append(item)
    parts = [
        f"{listed(fold([item.signal for item in some]))} {some[0].shown} ({origin})"
        for (_, origin), some in alike.items()
    ]
    first = next((item for item in items if item.origin not in OF_FILES), items[0])
    says = f"{name} has two values: {', '.join(parts)}; {way_out}"
    return _warning("values-differ", first.signal, says, float(first.value))


def _other_cars(scenario: LoadedScenario, parameters: Sequence[GivenValue]) -> Iterator[Diagnostic]:
    """Yield a warning if there is a vehicle file, but instances use defaults for properties of the car.

    A ratio of 1 is exempt: it means that angles are those of the road wheels.
    """
    of_car = (item for item in parameters if item.name in OF_CAR and item.value != 1)
    defaults = [item for item in of_car if item.origin == "default"]
    if defaults and scenario.vehicle_file.parameters:
        parts = listed(f"{item.signal} {item.shown}" for item in defaults)
        says = f"not in the vehicle file, so defaults of the FMUs apply: {parts}"
        yield _warning("vehicle-incomplete", defaults[0].signal, says, float(defaults[0].value))


def _warning(code: str, signal: str, says: str, value: float | None = None) -> Diagnostic:
    return Diagnostic(code, says, "warning", Location(signal=signal), value)
