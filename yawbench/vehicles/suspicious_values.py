"""Warnings about suspicious values: conflicting, left over from another car, implausible, or probably typos.

Implausible are quantities outside the ranges of `vocabulary.vehicle`: a mass in grams, a wheelbase in mm, a
yaw inertia that does not fit the mass. Defaults of FMUs are not checked: they are the responsibility of
their authors.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from fractions import Fraction
from functools import lru_cache
from itertools import product
from typing import NamedTuple

from yawbench.fmus.fmu import Value, Variable
from yawbench.foundation.errors import Diagnostic, Location
from yawbench.foundation.messages import fold, listed
from yawbench.orchestrator.plan import DEFAULT, OF_FILES, Instance, OriginKind
from yawbench.orchestrator.scenario.loader import LoadedScenario
from yawbench.orchestrator.scenario.quantities import exact_text, meant_unit, number_and_unit
from yawbench.vocabulary.facts import FACTS
from yawbench.vocabulary.roles import without_role
from yawbench.vocabulary.vehicle import CAR, DYNAMIC_INDEX

from .derivations import STIFFNESSES, known_car
from .tir import TyreFile

INERTIA = ("yaw_inertia", "mass", "cg_to_front_axle", "cg_to_rear_axle")
"""Parameters that determine the dynamic index."""


class _Given(NamedTuple):
    """A quantity of the car with its value, and where it is given."""

    where: str
    name: str
    value: float  # in SI
    raw: object  # as written


def suspicious_car(scenario: LoadedScenario, instances: Mapping[str, Instance]) -> list[Diagnostic]:
    """Return a warning for every implausible quantity of the car, and for inertias that do not fit."""
    of_file = suspicious_vehicle(scenario.vehicle_file.values)
    in_file = {(item.name, item.value) for item in _of_file(scenario.vehicle_file.values)}
    own = [item for item in _of_instances(instances) if (item.name, item.value) not in in_file]
    return [*of_file, *filter(None, map(_beyond, own)), *_index(instances)]


def suspicious_vehicle(parameters: Mapping[str, Value]) -> list[Diagnostic]:
    """Return a warning for every implausible value of a vehicle file."""
    return [*filter(None, map(_beyond, _of_file(parameters)))]


def _of_file(parameters: Mapping[str, Value]) -> Iterator[_Given]:
    items = (_quantity(name, raw) for name, raw in parameters.items() if name in CAR)
    return filter(None, items)


@lru_cache(maxsize=10_000, typed=True)
def _quantity(name: str, raw: Value) -> _Given | None:
    try:
        return _Given(f"vehicle.{name}", name, known_car({name: raw}).values[name], raw)
    except ValueError:  # in a unit that only an FMU defines
        return None


def _of_instances(instances: Mapping[str, Instance]) -> Iterator[_Given]:
    """Yield the quantities that the scenario or an override gives to single instances."""
    for instance in instances.values():
        for name, value in instance.parameters.items():
            origin = instance.origin(name).kind
            as_said = instance.fmu.variables[name].unit == CAR[name].unit if name in CAR else False
            if as_said and origin not in ("default", "vehicle", "derived") and isinstance(value, float):
                raw = instance.given[name].value
                yield _Given(f"{instance.name}.{name}", name, value, raw)


def _beyond(item: _Given) -> Diagnostic | None:
    """Return a warning about a value outside its range, None if it is inside or has no range."""
    quantity = CAR[item.name]
    if quantity.plausible is None:
        return None
    low, high = quantity.plausible
    if low <= item.value <= high or item.value == 0.0:
        return None
    written = number_and_unit(item.raw) if isinstance(item.raw, str) else None
    number, unit_written = written or (f"{item.value:.10g}", quantity.unit)
    likely = meant_unit(
        float(Fraction(number)), unit_written, quantity.unit, lambda value: low <= value <= high
    )
    unit = f" {quantity.unit}" if quantity.unit != "1" else ""
    says = (
        f"{item.where}: {item.value:.10g}{unit} is implausible for a car "
        f"(plausible: {low:g} to {high:g}{unit})" + (f"; did you mean '{number} {likely}'?" if likely else "")
    )
    return _warning("value-implausible", item.where, says, item.value)


def _index(instances: Mapping[str, Instance]) -> Iterator[Diagnostic]:
    """Yield a warning about the first instance whose yaw inertia does not fit its mass and wheelbase.

    None if one of the values is implausible by itself, or all are defaults of the FMU.
    """
    for instance in instances.values():
        values = {name: instance.parameter(name) for name in INERTIA if name in instance.fmu.variables}
        numbers = [value for value in values.values() if isinstance(value, float)]
        is_set = any(instance.origin(name) != DEFAULT for name in INERTIA)
        if not is_set or len(numbers) < len(INERTIA):
            continue
        items = (_Given("", name, number, number) for name, number in zip(INERTIA, numbers, strict=True))
        if any(map(_beyond, items)):
            continue
        inertia, mass, front, rear = numbers
        index = inertia / (mass * front * rear)
        low, high = DYNAMIC_INDEX
        if not low <= index <= high:
            says = (
                f"{instance.name}: the yaw inertia, {inertia:.6g} kg.m2, is {index:.3g} times mass times the "
                f"distances of both axles from the centre of mass; that of cars is {low:g} to {high:g} times"
            )
            yield _warning("value-implausible", f"{instance.name}.yaw_inertia", says, inertia)
            return


OF_CAR = (*(name for name, quantity in CAR.items() if quantity.needed), *STIFFNESSES, "steering_ratio")
"""Parameters that describe the car in any instance."""
IN_FACTS = {name for fact in FACTS.values() for name in (*fact.inputs, *fact.parameters)}
"""Inputs and parameters that facts set."""
SAME = 1e-9
"""Relative difference of values that count as equal: rounding of a conversion."""
RADIUS = 0.03
"""Tolerated relative difference of wheel and tyre radius. Chosen: the load changes it by 1 to 2 %."""
SLIPS = (
    ("m/s", 70.0, "km/h", 3.6),  # chosen: above the top speed of nearly all cars
    ("rad", 4 * math.pi, "deg", 180 / math.pi),  # chosen: two turns of a hand wheel
)
"""Unit, largest plausible value in it, unit that was probably meant, factor to it."""
LEAST_SLIP = min(largest for _, largest, *_ in SLIPS)


class GivenValue(NamedTuple):
    """The value of a parameter or constant of an instance, with its origin."""

    instance: str
    name: str
    value: Value
    origin: OriginKind
    variable: Variable
    unit: str = ""  # that the value names


def suspicious_values(scenario: LoadedScenario, instances: Mapping[str, Instance]) -> list[Diagnostic]:
    """Return warnings about the values of a scenario's instances."""
    parameters, constants = [*_parameters(instances.values())], [*_constants(instances.values())]
    return [
        *_two_values(instances, parameters, constants),
        *_other_cars(scenario, parameters),
        *_slips(scenario, parameters, constants),
        *_of_tyres(scenario, instances, parameters),
        *suspicious_car(scenario, instances),
        *_idle_units(scenario, instances),
        *_other_steps(scenario, instances),
    ]


def _idle_units(scenario: LoadedScenario, instances: Mapping[str, Instance]) -> Iterator[Diagnostic]:
    """Yield a warning for every instance that would take its first step after the end of the run."""
    lasts = scenario.stop_time - scenario.start_time
    steps = lasts / scenario.step_size
    for instance in instances.values():
        if instance.period > steps:
            step = instance.period * scenario.step_size
            says = (
                f"{instance.name} never takes a step: its step_size, {float(step):g} s, is longer than the "
                f"run, {float(lasts):g} s; its outputs keep their initial values"
            )
            yield _warning("instance-never-steps", f"{instance.name}.step_size", says, float(step))


STEP_TOLERANCE = 1e-6
"""Relative difference up to which two steps are the same; chosen: FMUs round theirs to as few digits."""
FINEST = 100
"""Smallest part of the communication step to propose; chosen: a run a hundred times as long helps nobody."""


def _other_steps(scenario: LoadedScenario, instances: Mapping[str, Instance]) -> Iterator[Diagnostic]:
    """Yield a warning for every instance that runs with another step than its FMU declares."""
    for instance in instances.values():
        fixed, step = instance.fmu.fixed_step, instance.period * scenario.step_size
        if fixed is None:
            continue
        times = round(float(step) / fixed) if instance.fmu.takes_multiples else 1
        if math.isclose(step, max(times, 1) * fixed, rel_tol=STEP_TOLERANCE):
            continue
        what = "an internal step" if instance.fmu.takes_multiples else "a fixed step"
        says = (
            f"{instance.name} ({instance.fmu.name}) declares {what} of {exact_text(Fraction(repr(fixed)))} s "
            f"and runs with one of {exact_text(step)} s, so its results may be wrong; "
            f"{_with_step(instance, Fraction(repr(fixed)), scenario.step_size)}"
        )
        yield _warning("instance-step-differs", f"{instance.name}.step_size", says, float(step))


def _with_step(instance: Instance, fixed: Fraction, base: Fraction) -> str:
    """Return how to give an instance its own step when the communication step is `base`."""
    own = f"--set {instance.name}.step_size={exact_text(fixed)}"
    if fixed % base == 0:
        return f"'{own}' gives it that step"
    common = Fraction(
        math.gcd(fixed.numerator * base.denominator, base.numerator * fixed.denominator),
        fixed.denominator * base.denominator,
    )
    if base / common > FINEST:
        return "it needs a communication step that divides its own"
    both = f"--set step_size={exact_text(common)}"
    return f"'{both}{f' {own}' if common != fixed or instance.period > 1 else ''}' gives it that step"


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
            says = f"{item.instance}.tyre is {item.value}: {tyres[0].name} follows {law}"
            yield _warning("tyre-mismatch", f"{item.instance}.tyre", says)
    radii = {f.path.name: f.rolling_radius for f in scenario.tyre_files.values() if isinstance(f, TyreFile)}
    wheel_radii = [item for item in parameters if item.name == "wheel_radius"]
    for (file, radius), item in product(radii.items(), wheel_radii):
        if isinstance(item.value, float) and radius and abs(item.value / radius - 1.0) > RADIUS:
            says = (
                f"{item.instance}.wheel_radius is {item.value:.4g} m, but the tyres of {file} roll on "
                f"{radius:.4g} m at nominal load"
            )
            yield _warning("wheel-radius-mismatch", f"{item.instance}.wheel_radius", says, item.value)


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
        if name in IN_FACTS or all(item.value == items[0].value for item in items):
            continue
        if _one_matter(name, items) and _differ(items):
            vehicle = f"--set vehicle.{name}=VALUE sets it in all of them without a value of their own"
            yield _values_differ(name, items, vehicle)
    for name, fact in FACTS.items():
        of_fact = [item for item in parameters if item.name in fact.parameters]
        items = [item for item in of_fact if fact.counts(instances[item.instance], item.name)]
        items += [item for item in constants if item.name in fact.inputs]
        meant = ({"scenario"}, {"default"}) if fact.inputs else ()  # a road may differ from wheel to wheel
        if _differ(items) and {item.origin for item in items} not in meant:
            yield _values_differ(name, items, f"--set {name}=VALUE sets it in all of them")


def _one_matter(name: str, items: list[GivenValue]) -> bool:
    """Return whether a parameter of several instances should have the same value in all of them."""
    origins = {item.origin for item in items}
    measured_alike = len({item.variable.unit or "1" for item in items}) == 1
    if not measured_alike or origins == {"scenario"}:
        return False
    if origins == {"default"}:
        return name in OF_CAR
    return name in OF_CAR or "vehicle" in origins or not _differ(items, start=True)


def _differ(items: list[GivenValue], *, start: bool = False) -> bool:
    """Return whether numeric values differ; `start`: whether the FMUs' start values do."""
    values = [item.variable.start if start else item.value for item in items]
    if any(isinstance(value, bool) or not isinstance(value, (int, float)) for value in values):
        return False
    numbers = [float(value) for value in values]  # type: ignore[arg-type]
    return len(numbers) > 1 and max(numbers) - min(numbers) > SAME * max(map(abs, numbers))


def _parameters(instances: Iterable[Instance]) -> Iterator[GivenValue]:
    for instance in instances:
        for variable in instance.fmu.of("parameter"):
            value, given = instance.parameter(variable.name), instance.given[variable.name]
            if value is not None and (value != 0 or given.origin != DEFAULT):  # 0 by default: not given
                yield GivenValue(instance.name, variable.name, value, given.origin.kind, variable, given.unit)


def _constants(instances: Iterable[Instance]) -> Iterator[GivenValue]:
    for instance in instances:
        for name, value in instance.constants.items():
            if name not in instance.series:
                origin = instance.origin(name).kind
                yield GivenValue(instance.name, name, value, origin, instance.fmu.variables[name])


def _values_differ(name: str, items: list[GivenValue], way_out: str) -> Diagnostic:
    alike: dict[tuple[float, str], list[GivenValue]] = {}
    for item in items:
        alike.setdefault((float(item.value), item.origin), []).append(item)
    parts = []
    for (value, origin), some in alike.items():
        names = fold([f"{item.instance}.{item.name}" for item in some])
        parts.append(f"{listed(names)} {_measured(value, some[0].variable)} ({origin})")
    by_change = (item for item in items if item.origin not in OF_FILES)
    first = next(by_change, items[0])
    says = f"{name} has two values: {', '.join(parts)}; {way_out}"
    return _warning("values-differ", f"{first.instance}.{first.name}", says, float(first.value))


def _warning(code: str, signal: str, says: str, value: float | None = None) -> Diagnostic:
    return Diagnostic(code, says, "warning", Location(signal=signal), value)


def _other_cars(scenario: LoadedScenario, parameters: Sequence[GivenValue]) -> Iterator[Diagnostic]:
    """Yield a warning if there is a vehicle file, but instances use defaults for properties of the car.

    A ratio of 1 is exempt: it means that angles are those of the road wheels.
    """
    defaults = [
        item
        for item in (parameters if scenario.vehicle_file.parameters else ())
        if item.name in OF_CAR and item.origin == "default" and item.value != 1
    ]
    if defaults:
        parts = [f"{item.instance}.{item.name} {_measured(item.value, item.variable)}" for item in defaults]
        says = f"not in the vehicle file, so defaults of the FMUs apply: {listed(parts)}"
        first = defaults[0]
        yield _warning("vehicle-incomplete", f"{first.instance}.{first.name}", says, float(first.value))


def _slips(
    scenario: LoadedScenario, parameters: Sequence[GivenValue], constants: Sequence[GivenValue]
) -> Iterator[Diagnostic]:
    """Yield a warning for every number that was probably meant in another unit."""
    for item in parameters:
        if item.origin == "default" or not isinstance(item.value, float) or abs(item.value) <= LEAST_SLIP:
            continue
        if item.unit:  # as it was meant
            continue
        for unit, largest, meant, factor in SLIPS:
            if item.variable.unit == unit and abs(item.value) > largest:
                says = (
                    f"{item.instance}.{item.name}: {item.value:g} {unit} is "
                    f"{factor * item.value:.4g} {meant}; did you mean '{item.value:g} {meant}'?"
                )
                yield _warning("unit-suspicious", f"{item.instance}.{item.name}", says, item.value)
    for item in constants:
        if item.name in FACTS["friction"].inputs and isinstance(item.value, float) and item.value > 2.0:
            parameter = f"{item.instance}.{item.name}"
            number = f"{item.value:g}"
            says = (
                f"{parameter}: a friction of {number} is implausible for a road; did you mean '{number} %'?"
            )
            yield _warning("unit-suspicious", parameter, says, item.value)
            return


def _measured(value: Value, variable: Variable) -> str:
    unit = variable.unit or "1"
    return f"{value:.6g}{f' {unit}' if unit != '1' else ''}" if not isinstance(value, str) else value
