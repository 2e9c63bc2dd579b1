"""From a scenario to a plan: FMUs opened, parameters distributed, every input given its one source.

An output feeds every input of the same name in other units. Before equal names go, in this order, a
connection of the scenario and a constant whose key names the unit; a list of units under `connections`
chooses among equal names. Any other constant is for inputs that nothing drives, one given by name
before one given by a pattern. Whatever then has no source, or more than one, is an error: the start
value that an FMU carries for an input is never used in silence.

Units of measurement fit if they have one dimension, and the wire converts; where an FMU declares none,
nothing can be checked and a note says so. Types must be equal, and an enumeration's items must all be
among those of the input it feeds, with the same numbers.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path

from vocabulary.wheels import WHEELS

from ..errors import BuildError, ModelDescriptionError, Problem, WiringError, YawbenchError
from ..fmu.opener import Opener, find_fmu, find_folder, host_needs, stale_fmus
from ..fmu.shadowing import shadowed_modules
from ..plan import Fmu, Plan, Series, Unit, Value, ValueOrigin, Wire
from ..scenario.load import Scenario
from ..scenario.overrides import is_path
from ..wording import listed
from .agreement import remarks
from .connections import Connector
from .faults import faults_of
from .functions import missing_functions
from .opened_system import System
from .order import evaluate
from .parameters import STATIC_LOADS, STIFFNESSES, Parameters
from .recording import recorded
from .seen import exact

TYRE_FORCES = tuple(f"tyre_force_y_{wheel}" for wheel in WHEELS)
"""Outputs by which tyres are known."""
Measure = Callable[[Unit, Mapping[str, float]], Mapping[str, float]]
"""Returns the cornering stiffness [N/rad] of one tyre on some wheels: of a unit, by wheel -> load [N]."""


def make_plan(
    scenario: Scenario,
    *,
    fmus: Path | None = None,
    opener: Opener | None = None,
    isolated: bool = False,
    measure: Measure | None = None,
) -> Plan:
    """Open the scenario's FMUs and connect them.

    Args:
        scenario: as loaded.
        fmus: the folder that holds FMUs given by name; None: the nearest `fmus/` that holds any.
        opener: of the FMUs; default: one that builds nothing.
        isolated: each unit will have a process of its own (see `master.isolation`).
        measure: tells the stiffness of tyres, for units that want that of axles which the vehicle file
            does not give (see `tyres.axle_stiffness`).

    Raises:
        ModelDescriptionError: FMUs that are missing, damaged or not supported.
        BuildError: FMUs that are stale and cannot be built.
        WiringError: everything that is wrong with parameters and connections.
    """
    system = _open_all(scenario, fmus, opener or Opener())
    opened, notes = system.fmus, system.notes
    notes += [*scenario.document.notes, *stale_fmus(opened.values()), *host_needs(opened.values())]
    distributed = Parameters(system)
    parameters = distributed.of_units()
    wires, values = Connector(system).connect()
    record = recorded(system)
    faults = faults_of(system, wires, record)
    if not isolated:
        _check_instances(system)
    evaluation = evaluate(opened, wires)
    problems = system.problems()
    of_all = shadowed_modules(opened, isolated=isolated)
    of_all += [
        f"algebraic loop: {loop}; these values would define each other at one instant, so "
        "one of these units has to give an output that does not follow its input directly"
        for loop in evaluation.loops
    ]
    units = {name: _unit(system, name, parameters[name], values[name]) for name in opened}
    if not problems and not of_all:  # all variables are known
        of_all = missing_functions(units.values(), wires, record)
    if not problems and not of_all:
        problems += _take_from_tyres(scenario, units, distributed, measure)
    problems += [Problem(text, file=scenario.path) for text in of_all]
    if problems:
        raise WiringError([*_misplaced(scenario), *problems])
    notes += [
        f"possible algebraic loop: {loop}; an FMU here does not say which inputs its outputs follow, "
        "so a wire against the evaluation order uses earlier values"
        for loop in evaluation.possible_loops[:1]
    ]
    notes += exact(list(units.values()), wires)
    findings = remarks(scenario, units)
    return Plan(
        units=tuple(units[name] for name in evaluation.order),
        wires=_sorted(wires, evaluation.order, opened),
        record=record,
        step=scenario.step_size,
        n_steps=int((scenario.stop_time - scenario.start_time) / scenario.step_size),
        start=scenario.start_time,
        algorithm=scenario.algorithm,
        title=scenario.title,
        scenario=scenario.as_run(),
        notes=(*notes, *(found.says for found in findings)),
        changes=scenario.changes,
        findings=tuple(findings),
        faults=faults,
    )


def _take_from_tyres(
    scenario: Scenario, units: dict[str, Unit], distributed: Parameters, measure: Measure | None
) -> list[Problem]:
    """Give units the cornering stiffnesses of axles that tyres at static loads have; return what is wrong."""
    if not distributed.lacking:
        return []
    loads = [distributed.car.values[name] for name in STATIC_LOADS]
    tyres = [u for u in units.values() if {v.name for v in u.fmu.of("output")} >= {*TYRE_FORCES}]
    try:
        if len(tyres) != 1 or measure is None:
            raise ValueError("there is no one unit for the tyres to take it from")
        found = measure(tyres[0], dict(zip(WHEELS[::2], loads, strict=True)))
    except (ValueError, YawbenchError) as error:
        return [
            scenario.document.problem(
                ("units", unit),
                f"the vehicle file does not give {listed(names)}, and the tyres do not tell: {error}",
            )
            for unit, names in distributed.lacking.items()
        ]
    stiffness = dict(zip(STIFFNESSES, (2.0 * found[wheel] for wheel in WHEELS[::2]), strict=True))
    for unit, names in distributed.lacking.items():
        formula = {
            name: ValueOrigin("derived", f"two of {tyres[0].fmu.name} at {load:.6g} N each")
            for name, load in zip(STIFFNESSES, loads, strict=True)
        }
        units[unit] = replace(
            units[unit],
            parameters=units[unit].parameters | {name: stiffness[name] for name in names},
            origins=units[unit].origins | {name: formula[name] for name in names},
        )
    return []


def _unit(
    system: System, name: str, parameters: dict[str, Value], inputs: Mapping[str, Value | Series]
) -> Unit:
    """Return a unit with the values of its parameters and of the inputs that no unit drives."""
    spec, step, start = (
        system.scenario.units[name],
        system.scenario.step_size,
        float(system.scenario.start_time),
    )
    return Unit(
        name,
        system.fmus[name],
        period=int((spec.step_size or step) / step),
        parameters=parameters,
        constants={key: v.first(start) if isinstance(v, Series) else v for key, v in inputs.items()},
        origins=system.origins[name],
        tolerance=spec.tolerance,
        series={key: v for key, v in inputs.items() if isinstance(v, Series)},
    )


def _misplaced(scenario: Scenario) -> list[str]:
    """Return a sentence for every swap by an FMU whose name begins with that of another unit."""
    found = []
    for change in scenario.changes:
        name = Path(str(change.value)).stem
        others = [unit for unit in scenario.units if name.startswith(f"{unit}_")]
        if change.swaps and others and change.place not in others:
            found.append(f"{change}: by its name {name} is for the unit {others[0]!r}")
    return found


def _open_all(scenario: Scenario, fmus: Path | None, opener: Opener) -> System:
    """Return a scenario with the FMU of each unit."""
    document = scenario.document
    problems: dict[Problem, None] = {}
    folder = fmus or Path()
    if fmus is not None and not fmus.is_dir():
        raise ModelDescriptionError(f"--fmus {fmus}: no such folder")
    if fmus is None and not all(is_path(spec.fmu) for spec in scenario.units.values()):
        folder = find_folder(scenario.path, opener=opener)

    @cache
    def opened(fmu: str, validate: bool, build: bool = True) -> Fmu:
        path = find_fmu(fmu, scenario=scenario.path, fmus=folder, opener=opener, build=build)
        return opener.open(path, validate=validate)

    def replaced(unit: str) -> Fmu | None:
        try:
            return opened(scenario.replaced[unit], scenario.units[unit].validate_, build=False)
        except ModelDescriptionError:
            return None

    found: dict[str, Fmu] = {}
    not_built: dict[str, None] = {}
    for name, spec in scenario.units.items():
        try:
            found[name] = opened(spec.fmu, spec.validate_)
        except BuildError as error:  # noqa: PERF203 - all problems are collected
            not_built.update(dict.fromkeys(error.problems))
        except ModelDescriptionError as error:
            problems.update({document.problem(("units", name, "fmu"), one): None for one in error.problems})
    if not_built:
        raise BuildError(not_built)
    if problems:
        raise ModelDescriptionError(problems)
    return System(scenario, found, replaced)


def _check_instances(system: System) -> None:
    """Report an FMU used by two units though it allows one instance per process."""
    first: dict[str, str] = {}
    for name, fmu in system.fmus.items():
        other = first.setdefault(fmu.sha256, name)
        if fmu.once_per_process and other != name:
            system.report(
                ("units", name, "fmu"),
                f"{fmu.name} can be instantiated only once per process, and {other} uses it already; "
                "with --isolate each unit has a process of its own",
            )


def _sorted(wires: Sequence[Wire], order: Sequence[str], fmus: Mapping[str, Fmu]) -> tuple[Wire, ...]:
    """Return the wires by target in evaluation order, then by input as the FMU lists them."""
    place = {
        (unit, name): (i, j) for i, unit in enumerate(order) for j, name in enumerate(fmus[unit].variables)
    }
    return tuple(sorted(wires, key=lambda wire: place[(wire.target, wire.input)]))
