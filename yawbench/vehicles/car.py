"""What the orchestrator is told of cars: parameters that follow from the vehicle file, tyre files and tyres.

A vehicle file describes a car for all plants: quantities that an instance lacks are derived (`derivations`).
An instance that takes some quantities of the car must get all of them, because the defaults of its FMU
describe a different car.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

from yawbench.fmus.fmu import Fmu, Value
from yawbench.foundation.errors import Diagnostic, YawbenchError, code_of
from yawbench.foundation.messages import listed
from yawbench.orchestrator.plan import LITERATURE, Given, Instance, ValueOrigin, ValueSource
from yawbench.orchestrator.scenario.schema import PARAMETERS
from yawbench.orchestrator.wiring.context import WiringContext
from yawbench.orchestrator.wiring.domain import Domain
from yawbench.orchestrator.wiring.parameters import Parameters, is_parameter, of_file, value_for
from yawbench.vocabulary.friction_table import table_of
from yawbench.vocabulary.patches import patches_of
from yawbench.vocabulary.signals import SYMBOLS
from yawbench.vocabulary.wheels import WHEELS

from .derivations import (
    GIVES_WAY,
    STATIC_LOADS,
    STIFFNESSES,
    CarQuantities,
    adapted,
    car_of,
    contradictions,
    quantity_of,
)
from .load import LOAD, load_of, loaded
from .quantities import BODY, CAR
from .suspicious_values import suspicious_values

if TYPE_CHECKING:
    from yawbench.measurements.measurement import Measurement

TYRE_FORCES = tuple(f"tyre_force_y_{wheel}" for wheel in WHEELS)
"""Outputs that identify an instance as tyres."""
TyreMeasurement = Callable[[Instance, Mapping[str, float]], Mapping[str, float]]
"""Callback: (instance of tyres, wheel -> load [N]) -> wheel -> cornering stiffness of one tyre [N/rad]."""


def cars(measure: TyreMeasurement | None = None) -> Domain:
    """Return what is known of cars.

    Args:
        measure: measures the cornering stiffness of tyres, for instances that need it if the vehicle file
            does not give it (see `tyre_stand.cornering_stiffness`).
    """
    return Domain(partial(CarParameters, measure=measure), suspicious_values, SYMBOLS, _measured)


def _measured(path: Path) -> Measurement:
    from yawbench.measurements.measurement import load_measurement  # NumPy takes long to import

    return load_measurement(path)


class CarParameters(Parameters):
    """The parameters of all instances, with those that follow from the car's and from tyre property files."""

    known = (*CAR, LOAD)
    written: ClassVar = {"patches": patches_of, "friction_table": table_of}

    def __init__(self, system: WiringContext, measure: TyreMeasurement | None = None) -> None:
        super().__init__(system)
        self._measure = measure
        self._of_car = self.scenario.vehicle_file.parameters
        self._where = self.scenario.vehicle_document.location((PARAMETERS,))
        self._car = CarQuantities({})
        self._car_is_wrong = False
        self._lacking: dict[str, list[str]] = {}
        """Instance -> those of its `STIFFNESSES` that have to be measured on the tyres at static loads."""

    def from_vehicle(self) -> None:
        """Set the values of tyre property files and of the vehicle file, and what follows from the latter."""
        self._from_tyre_files()
        reported = len(self.system.reported)
        super().from_vehicle()
        self._derive()
        self._car_is_wrong = len(self.system.reported) > reported

    def settle(self, shared: Mapping[str, Mapping[str, Value]]) -> None:
        """Derive what follows from changes of single instances; report instances with half a car."""
        for instance in self.fmus:
            self._give_way(instance, shared[instance])
        self._settle_stiffnesses()
        self._refuse_half_a_car()

    def _from_tyre_files(self) -> None:
        """Set the coefficients of tyre property files in every instance that declares them."""
        if not self.scenario.tyre_files:
            return
        document, key = self.scenario.tyres_place
        where = document.location(key)
        named = ValueSource(LITERATURE, file=str(document.path), line=document.lines.get(key, 0))
        for axle, file in self.scenario.tyre_files.items():
            origin = of_file(file.path.name, f"tyre property file {file.path.name}", named)
            for name, value in file.values.items():
                given, says = Given(value, origin, where), f"{file.path}: {name.upper()}: "
                for instance in self.takers(f"{name}_{axle}"):
                    self.give(instance, f"{name}_{axle}", given, says)
        if any(map(_takes_tyre_files, self.fmus.values())):
            return
        if any(map(_takes_tyre_files, self.system.before())):
            sentence = "tyres are left out: no tyre takes such files after the swap"
            self.system.note("left-out-after-swap", sentence)
        else:
            sentence = "no instance is a tyre that takes such files; tyre_magic_formula_62 does"
            self.system.report(where, sentence, "tyre-file-unused")

    def _derive(self) -> None:
        """Set the quantities that follow from those of the vehicle file."""
        numbers: dict[str, float] = {}
        idle = [name for name in self._of_car if name in CAR and not self.takers(name)]
        for name in [name for name in self._of_car if name in CAR]:
            try:
                numbers[name] = float(value_for(quantity_of(name), self._of_car[name].value))
            except ValueError as error:  # noqa: PERF203 - all are told
                if name in idle:  # else it is reported already
                    self.system.report(self._of_car[name].where, str(error), code_of(error))
        numbers = self._with_load(self._adapted(numbers))
        for name, sentence in contradictions(numbers):
            where = self._of_car[name].where if name in self._of_car else self._where
            self.system.report(where, sentence, "vehicle-contradictory")
        self._car = car_of(numbers)
        for name, formula in self._car.formulas.items():
            given = Given(self._car.values[name], ValueOrigin.derived(formula), self._where)
            for instance in self.takers(name):
                self.give(instance, name, given, f"{instance}.{name} = {formula}: ")
        for name in idle:
            if name not in self._car.used and name not in BODY and self._of_car[name].changed:
                sentence = f"vehicle.{name} changes nothing: no instance takes it or what follows"
                self.system.note("value-unused", sentence)

    def _with_load(self, numbers: dict[str, float]) -> dict[str, float]:
        """Return the vehicle file's quantities with its load, if it has one; note what it makes of them."""
        if (given := self._of_car.get(LOAD)) is None:
            return numbers
        try:
            load = load_of(given.value)
            after = loaded(numbers, load)
        except ValueError as error:
            self.system.report(given.where, str(error), code_of(error))
            return numbers
        changed = [name for name, value in after.items() if value != numbers.get(name)]
        origin = ValueOrigin.derived(f"with a load of {load}")
        for name in changed:
            for instance in self.takers(name):
                self.give(instance, name, Given(after[name], origin, self._where), f"{name}: ")
        before, now = car_of(numbers).values, car_of(after).values
        words = [
            f"{name} {now[name]:.6g} {CAR[name].unit} ({before[name]:.6g} before)"
            for name in ("mass", "cg_to_front_axle", "cg_height", "yaw_inertia")
            if name in now and name in before
        ]
        self.system.note(
            "quantity-follows", f"vehicle.load = {load}: {listed(words)}; the wheels stay as they are"
        )
        return after

    def _adapted(self, given: Mapping[str, float]) -> dict[str, float]:
        """Return the vehicle file's quantities after changes, with those that follow; note them."""
        own = self._of_car
        before = {**given}
        changed = [name for name in given if own[name].changed or own[name].replaces is not None]
        for name in changed:
            del before[name]
            replaced = own[name].replaces
            while replaced is not None and replaced.replaces is not None:
                replaced = replaced.replaces
            if replaced is not None and replaced.value is not None:
                with suppress(ValueError):  # of a value that is not valid
                    before[name] = float(value_for(quantity_of(name), replaced.value))
        after, notes = adapted(given, before, changed)
        for sentence in notes:
            self.system.note("quantity-follows", sentence)
        for name, value in after.items():
            if value != given.get(name):
                origin = ValueOrigin.derived(f"follows from {listed(changed)}")
                for instance in self.takers(name):
                    self.give(instance, name, Given(value, origin, self._where), f"{name}: ")
        return after

    def _give_way(self, instance: str, of_car: Mapping[str, Value]) -> None:
        """Keep the wheels of an instance's car where only its mass, or only its sprung mass, is changed.

        Args:
            instance: its name.
            of_car: its parameters by the vehicle file.
        """
        fmu, values, own = (
            self.fmus[instance],
            self.values[instance],
            self.scenario.units[instance].parameters,
        )
        changed = {name: given for name, given in own.items() if given.changed}
        for name, (yielding, stays) in GIVES_WAY.items():
            if name not in changed or yielding in changed or name not in values or is_parameter(fmu, stays):
                continue
            if not is_parameter(fmu, yielding):
                continue
            replaced = changed[name].replaces
            before = replaced.value if replaced else of_car.get(name, fmu.variables[name].start)
            was = values.get(yielding, fmu.variables[yielding].start)
            try:
                added = float(values[name]) - float(value_for(fmu.variables[name], before))  # type: ignore[arg-type]
                moved = float(was) + added  # type: ignore[arg-type]
            except (TypeError, ValueError):
                continue  # of a value that is missing or not valid, which is reported elsewhere
            if added:
                origin = ValueOrigin.derived(f"the wheels keep their mass, {added:+.6g} kg as {name}")
                self.give(instance, yielding, Given(moved, origin, changed[name].where), f"{yielding}: ")
                self.system.note(
                    "quantity-follows",
                    f"{instance}.{name} = {values[name]:.6g} kg: the wheels keep their mass, so {yielding} "
                    f"becomes {moved:.6g} kg ({was:.6g} kg before)",
                )

    def _settle_stiffnesses(self) -> None:
        """Leave out the vehicle file's stiffness of an axle where the scenario gives that of one tyre."""
        for instance in self.takers("cornering_stiffness"):
            given = self.system.given[instance]
            own = _level(given["cornering_stiffness"].origin)
            for name in STIFFNESSES:
                if name in self.values[instance] and own > _level(given[name].origin):
                    del self.values[instance][name]
                    given[name] = Given(self.fmus[instance].variables[name].start)

    def _refuse_half_a_car(self) -> None:
        """Report instances that get only part of their car; store which stiffnesses tyres must supply.

        A vehicle file from which not even static loads follow does not describe a car: it only replaces some
        defaults of the FMUs.
        """
        if self._car_is_wrong or not self._car.values.keys() >= {*STATIC_LOADS}:
            return
        for instance, fmu in self.fmus.items():
            by_name = self.values[instance]
            lacks = [v.name for v in fmu.of("parameter") if v.name in CAR and v.name not in by_name]
            of_tyres = [name for name in lacks if name in STIFFNESSES]
            if of_tyres and "tyre_force_y_fl" not in fmu.variables:
                self._lacking[instance] = of_tyres
            needed = [name for name in lacks if CAR[name].needed]
            if needed and any(name in self._car.values for name in by_name):
                self.system.report(
                    ("units", instance),
                    f"{fmu.name} takes its car from the vehicle file, which gives neither "
                    f"{listed(needed, last='nor')} nor what {'they' if len(needed) > 1 else 'it'} would "
                    "follow from: give them there, or to this instance",
                    "vehicle-incomplete",
                )

    def complete(self, instances: dict[str, Instance]) -> list[Diagnostic]:
        """Set missing cornering stiffnesses of axles to those of the tyres at static loads; return errors."""
        if not self._lacking:
            return []
        loads = [self._car.values[name] for name in STATIC_LOADS]
        tyres = [u for u in instances.values() if {v.name for v in u.fmu.of("output")} >= {*TYRE_FORCES}]
        try:
            if len(tyres) != 1 or self._measure is None:
                raise ValueError("this needs exactly one instance that computes the tyre forces")
            measured = self._measure(tyres[0], dict(zip(WHEELS[::2], loads, strict=True)))
        except (ValueError, YawbenchError) as error:
            failed, document = f"and measuring the tyres failed: {error}", self.scenario.document
            return [
                Diagnostic(
                    "vehicle-incomplete",
                    f"the vehicle file does not give {listed(names)}, {failed}",
                    location=document.location(("units", instance)),
                )
                for instance, names in self._lacking.items()
            ]
        of_tyres = {
            name: Given(
                2.0 * measured[wheel],
                ValueOrigin.derived(f"two of {tyres[0].fmu.name} at {load:.6g} N each"),
            )
            for name, wheel, load in zip(STIFFNESSES, WHEELS[::2], loads, strict=True)
        }
        for instance, names in self._lacking.items():
            planned = instances[instance]
            instances[instance] = replace(
                planned,
                parameters=planned.parameters | {name: of_tyres[name].value for name in names},
                given=planned.given | {name: of_tyres[name] for name in names},
            )
        return []


def _takes_tyre_files(fmu: Fmu) -> bool:
    return is_parameter(fmu, "pcy1_front") and "tyre_force_y_fl" in fmu.variables


def _level(origin: ValueOrigin) -> int:
    """Return the precedence of an origin: that of a default, the vehicle file, the scenario, an override."""
    return {"default": 0, "vehicle": 1, "derived": 1, "scenario": 2, "file": 2}.get(origin.kind, 3)
