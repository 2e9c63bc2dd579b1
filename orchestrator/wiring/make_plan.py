"""Makes the plan of a scenario: opens FMUs, distributes parameters, connects inputs, selects what to record.

An output feeds every input of the same name in other instances. Two things take precedence over equal names,
in this order: a connection of the scenario, and a constant whose key names the instance; a list of instances
under `connections` chooses among equal names. Any other constant applies to inputs that nothing drives, one
given by name before one given by a pattern. An input without a source, or with more than one, is an error:
the start value of an input in its FMU is never used silently.

Units of measurement are compatible if they have the same dimension, and the wire converts; where an FMU
declares no unit, nothing can be checked and a note says so. Between differences (`relativeQuantity`) offsets
of units do not apply; a difference that meets an absolute quantity is refused if the offset of their units
would decide the number, and a warning if they only have the same one. Types must be equal or convert without
loss (`connections`), and an enumeration's items must all be among those of the enumeration that it feeds,
with the same numbers.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

from yawbench.fmus.description import CORE, resized
from yawbench.fmus.fmu import Fmu, Value, Variable, is_path
from yawbench.fmus.opener import (
    Opener,
    find_fmu,
    find_folder,
    hidden,
    host_needs,
    shadowed_modules,
    stale_fmus,
)
from yawbench.foundation.errors import (
    BuildError,
    Diagnostic,
    Location,
    ModelDescriptionError,
    WiringError,
)
from yawbench.foundation.messages import closest, fold, hint, listed
from yawbench.vocabulary.roles import role_in, role_of

from ..plan import Given, InputSeries, Instance, Plan, Wire
from ..scenario.loader import LoadedScenario
from ..scenario.schema import SeriesSpec
from ..signal_names import SignalName, match, matching
from .connections import Connector
from .constants import Constant, Input, constants
from .context import WiringContext
from .control_side import exact
from .domain import Domain
from .faults import faults_of
from .instance_steps import doubtful_steps
from .order import EvaluationOrder, evaluate
from .parameters import value_for


def missing_functions(
    instances: Iterable[Instance], wires: Sequence[Wire], record: Sequence[tuple[str, str]]
) -> list[Diagnostic]:
    """Return an error for every FMI function that the plan needs and an FMU's library does not export."""
    errors = []
    for instance in instances:
        if not instance.fmu.lacking:
            continue
        needed: dict[str, list[str]] = {f"fmi{instance.fmu.fmi}{name}": [] for name in CORE[instance.fmu.fmi]}
        set_names = [
            *instance.parameters,
            *instance.constants,
            *(w.input for w in wires if w.target == instance.name),
        ]
        read_names = [
            *(w.output for w in wires if w.source == instance.name),
            *(n for u, n in record if u == instance.name),
        ]
        for verb, names in (("Set", set_names), ("Get", read_names)):
            for name in dict.fromkeys(names):
                kind = instance.fmu.variables[name].ref.type
                needed.setdefault(f"fmi{instance.fmu.fmi}{verb}{kind}", []).append(name)
        for function, names in needed.items():
            if function in instance.fmu.lacking:
                purpose = f", which {listed(names)} needs" if names else ""
                sentence = f"{instance.name}: the library of {instance.fmu.name} lacks {function}{purpose}"
                errors.append(Diagnostic("fmu-function-missing", sentence))
    return errors


def recorded(system: WiringContext) -> tuple[SignalName, ...]:
    """Return the name of each recorded column, in the order of the scenario's `record`.

    Without `record`, these are all outputs except text, in the order of the instances.
    """
    fmus, record = system.fmus, system.scenario.record
    if record is None:
        return tuple(SignalName(instance, v.name) for instance, fmu in fmus.items() for v in _usual(fmu))
    chosen: dict[SignalName, None] = {}
    for i, (instance, pattern) in enumerate(record):
        instances = list(fmus) if instance == "*" else [instance]
        columns = _matching(instances, fmus, pattern, _usual) or _matching(instances, fmus, pattern, _all)
        chosen.update(dict.fromkeys(columns))
        if columns:
            continue
        if system.had(instances, pattern):
            system.left_out(f"record[{i}]", f"{instance} has no variable {pattern!r} any more")
            continue
        usual, every = ([v.name for u in instances for v in of(fmus[u])] for of in (_usual, _all))
        names = every if closest(pattern, usual) is None and closest(pattern, every) else usual
        who = "no instance has a" if instance == "*" else f"{instance} has no"
        more = hint(pattern, fold(list(dict.fromkeys(names))), lead="its outputs are")
        system.report(("record", i), f"{who} variable {pattern!r} to record{more}", "variable-unknown")
    return tuple(chosen)


def _usual(fmu: Fmu) -> list[Variable]:
    return [v for v in fmu.of("output") if v.type != "String"]


def _all(fmu: Fmu) -> list[Variable]:
    return list(fmu.variables.values())


def _matching(
    instances: Iterable[str], fmus: Mapping[str, Fmu], pattern: str, of: Callable[[Fmu], list[Variable]]
) -> list[SignalName]:
    return [
        SignalName(instance, v.name)
        for instance in instances
        for v in of(fmus[instance])
        if match(pattern, v.name) is not None
    ]


NOTHING = Domain()
NETWORKS = 100
"""Largest number of networks that are kept. Chosen: more than a study has, little memory."""


@dataclass
class Network:
    """The connected instances: what plans share whose scenarios differ only in values."""

    wires: list[Wire]
    kept: list[Input]  # inputs that keep their start values
    record: tuple[SignalName, ...]
    evaluation: EvaluationOrder
    in_order: tuple[Wire, ...]  # the wires, see `_sorted`
    shadowed: list[str]  # see `shadowed_modules`
    notes: list[Diagnostic]
    follows: object  # what it was made of
    exact: list[Diagnostic] | None = None  # see `exact`


def _network(
    system: WiringContext,
    by_input: Mapping[Input, Constant],
    symbols: Mapping[str, str],
    isolated: bool,
    networks: dict[Hashable, Network],
) -> Network:
    """Return the network of a system: a known one if FMUs, connections, and inputs with constants are equal.

    A network with errors is not kept.
    """
    scenario, data = system.scenario, system.scenario.document.data
    follows = *system.fmus.values(), data.get("connections"), data.get("record")
    constant = tuple((target, c.key, c.of_instance, c.of_fact) for target, c in by_input.items())
    swapped, instances = tuple(scenario.replaced.items()), tuple(system.fmus)
    key = tuple(map(id, follows)), instances, constant, swapped, scenario.explicit, isolated
    if key not in networks:
        errors, notes = len(system.reported), len(system.notes)
        wires, kept = Connector(system, symbols).connect(by_input)
        record = recorded(system)
        evaluation = evaluate(system.fmus, wires)
        in_order = _sorted(wires, evaluation.order, system.fmus)
        shadowed = shadowed_modules(system.fmus, isolated=isolated)
        made = Network(wires, kept, record, evaluation, in_order, shadowed, system.notes[notes:], follows)
        if len(system.reported) > errors:
            return made
        if len(networks) == NETWORKS:
            networks.clear()
        networks[key] = made
    else:
        system.notes += networks[key].notes
    return networks[key]


def _values(
    system: WiringContext, by_input: Mapping[Input, Constant], network: Network
) -> dict[str, dict[str, Value | InputSeries]]:
    """Return the constants, time series and start values of the inputs without a wire, by instance."""
    values: dict[str, dict[str, Value | InputSeries]] = {instance: {} for instance in system.fmus}
    wired = {(wire.target, wire.input) for wire in network.wires}
    for (instance, name), constant in by_input.items():
        if (instance, name) not in wired:
            values[instance][name] = constant.value
            system.given[instance][name] = constant.given
    for instance, name in network.kept:
        start = system.inputs[instance][name].start
        assert start is not None  # else it would have been reported
        values[instance][name] = start
        system.given[instance][name] = Given(start)
    return values


def make_plan(
    scenario: LoadedScenario,
    *,
    fmus: Path | None = None,
    opener: Opener | None = None,
    isolated: bool = False,
    domain: Domain = NOTHING,
    networks: dict[Hashable, Network] | None = None,
) -> Plan:
    """Open the scenario's FMUs and connect them.

    Args:
        scenario: the loaded scenario.
        fmus: folder of the FMUs given by name; None: the nearest `fmus/` that contains any.
        opener: opens the FMUs; default: an opener that builds nothing.
        isolated: whether each instance will run in its own process (see `master.isolation`).
        domain: what is known of the things that the scenario is about.
        networks: those of earlier plans, to be used again; this plan's is added.

    Raises:
        ModelDescriptionError: FMUs are missing, damaged or not supported.
        BuildError: FMUs are stale and cannot be built.
        WiringError: with all errors of parameters and connections.
    """
    system = _open_all(scenario, fmus, opener or Opener())
    opened, notes = system.fmus, system.notes
    notes += [*scenario.document.notes, *stale_fmus(opened.values()), *host_needs(opened.values())]
    _note_unusable(system)
    distributed = domain.parameters(system)
    parameters = distributed.of_instances()
    by_input = constants(system, domain)
    network = _network(system, by_input, domain.symbols, isolated, {} if networks is None else networks)
    wires, record, evaluation = network.wires, network.record, network.evaluation
    values = _values(system, by_input, network)
    faults = faults_of(system, wires, record)
    if not isolated:
        _check_instances(system)
    errors = system.errors()
    of_all = _errors_of_network(network)
    instances = {name: _instance(system, name, parameters[name], values[name]) for name in opened}
    if not errors and not of_all:  # all variables are known
        of_all = missing_functions(instances.values(), wires, record)
    if not errors and not of_all:
        errors += distributed.complete(instances)
    errors += [replace(error, location=Location(file=scenario.path)) for error in of_all]
    if errors:
        raise WiringError([*_misplaced(scenario), *errors])
    for loop in evaluation.possible_loops[:1]:
        system.note(
            "algebraic-loop-possible",
            f"possible algebraic loop: {loop}; an FMU here does not say which inputs its outputs follow, "
            "so a wire against the evaluation order uses earlier values",
        )
    if network.exact is None:
        network.exact = exact(list(instances.values()), wires)
    notes += network.exact
    return Plan(
        instances=tuple(instances[name] for name in evaluation.order),
        wires=network.in_order,
        record=record,
        step=scenario.step_size,
        n_steps=int((scenario.stop_time - scenario.start_time) / scenario.step_size),
        start=scenario.start_time,
        algorithm=scenario.algorithm,
        title=scenario.title,
        scenario=scenario.as_run(),
        changes=scenario.changes,
        diagnostics=(
            *notes,
            *domain.warnings(scenario, instances),
            *doubtful_steps(scenario, instances.values()),
        ),
        faults=faults,
    )


def _errors_of_network(network: Network) -> list[Diagnostic]:
    """Return the errors that concern all instances: modules in conflict, algebraic loops."""
    errors = [Diagnostic("fmu-modules-conflict", sentence) for sentence in network.shadowed]
    errors += [
        Diagnostic(
            "algebraic-loop",
            f"algebraic loop: {loop}; these values would define each other at one instant, so "
            "one of these instances has to give an output that does not follow its input directly, or one of "
            "the connections needs 'delay: 1 step'",
        )
        for loop in network.evaluation.loops
    ]
    return errors


def _instance(
    system: WiringContext, name: str, parameters: dict[str, Value], inputs: Mapping[str, Value | InputSeries]
) -> Instance:
    """Return an instance with the values of its parameters and of the inputs without a wire."""
    scenario = system.scenario
    spec, step, start = scenario.units[name], scenario.step_size, float(scenario.start_time)
    return Instance(
        name,
        system.fmus[name],
        period=int((spec.step_size or step) / step),
        parameters=parameters,
        constants={key: v.first(start) if isinstance(v, InputSeries) else v for key, v in inputs.items()},
        given=system.given[name],
        tolerance=spec.tolerance,
        series={key: v for key, v in inputs.items() if isinstance(v, InputSeries)},
    )


def _misplaced(scenario: LoadedScenario) -> list[Diagnostic]:
    """Return an error for every swap to an FMU whose name has the role of another instance."""
    before = {name: scenario.replaced.get(name, spec.fmu) for name, spec in scenario.units.items()}
    roles = {name: role_of(name, Path(fmu).stem) for name, fmu in before.items()}
    errors = []
    for change in scenario.changes:
        name = Path(str(change.value)).stem
        others = [instance for instance, role in roles.items() if role == role_in(name)]
        if change.swaps and others and change.target.instance not in others:
            sentence = f"by its name {name} is for the instance {others[0]!r}"
            errors.append(Diagnostic("swap-role-mismatch", sentence, location=Location(target=str(change))))
    return errors


def _open_all(scenario: LoadedScenario, fmus: Path | None, opener: Opener) -> WiringContext:
    """Open the FMU of each instance of a scenario."""
    document = scenario.document
    errors: dict[Diagnostic, None] = {}
    folder = fmus or Path()
    if fmus is not None and not fmus.is_dir():
        raise ModelDescriptionError(f"--fmus {fmus}: no such folder", code="folder-missing")
    if fmus is None and not all(is_path(spec.fmu) for spec in scenario.units.values()):
        folder = find_folder(scenario.path, opener=opener)

    above, opened_fmus = scenario.path.absolute().parent, opener.opened_as

    def opened(fmu: str, validate: bool, build: bool = True) -> Fmu:
        known = fmu, above, folder, validate, build
        if known not in opened_fmus:
            path = find_fmu(fmu, scenario=scenario.path, fmus=folder, opener=opener, build=build)
            opened_fmus[known] = opener.open(path, validate=validate)
        return opened_fmus[known]

    def replaced(instance: str) -> Fmu | None:
        try:
            return opened(scenario.replaced[instance], scenario.units[instance].validate_, build=False)
        except ModelDescriptionError:
            return None

    def fitted(name: str, fmu: Fmu) -> Fmu:
        """Return the FMU of an instance with the sizes of its arrays, its driven parameters as inputs."""
        sizes, driven = _sizes(scenario, name, fmu), _driven(scenario, name, fmu)
        if not sizes and not driven:
            return fmu
        known = fmu.sha256, tuple(sizes.items()), driven
        if known not in opened_fmus:
            opened_fmus[known] = (resized(fmu, sizes) if sizes else fmu).driven(driven)
        return opened_fmus[known]

    fmus_by_name: dict[str, Fmu] = {}
    not_built: dict[Diagnostic, None] = {}
    for name, spec in scenario.units.items():
        try:
            fmus_by_name[name] = fitted(name, opened(spec.fmu, spec.validate_))
        except BuildError as error:  # noqa: PERF203 - all errors are collected
            not_built.update(dict.fromkeys(error.diagnostics))
        except ModelDescriptionError as error:
            where = document.location(("units", name, "fmu"))
            located = [
                Diagnostic(problem.code, str(problem), location=where) for problem in error.diagnostics
            ]
            errors.update(dict.fromkeys(located))
    if not_built:
        raise BuildError(not_built)
    if errors:
        raise ModelDescriptionError(errors)
    names = [spec.fmu for spec in scenario.units.values() if not is_path(spec.fmu)]
    return WiringContext(scenario, fmus_by_name, replaced, hidden(names, folder, packages=False))


def _sizes(scenario: LoadedScenario, instance: str, fmu: Fmu) -> dict[str, Value]:
    """Return the structural parameters of an instance that change; values not allowed are reported later."""
    sizes: dict[str, Value] = {}
    for variable in fmu.of("structuralParameter"):
        given = scenario.units[instance].parameters.get(variable.name)
        with suppress(ValueError):
            value = variable.start if given is None else value_for(variable, given.value)  # type: ignore[arg-type]
            sizes |= {variable.name: value} if value is not None and value != variable.start else {}
    return sizes


def _driven(scenario: LoadedScenario, instance: str, fmu: Fmu) -> frozenset[str]:
    """Return the tunable parameters of an instance that connections or time series drive.

    A name is taken for a parameter if it is that of no input.
    """
    series = [SignalName.parse(k) for k, v in scenario.inputs.items() if isinstance(v.value, SeriesSpec)]
    named = [c.target for c in scenario.connections if isinstance(c.target, SignalName)] + series
    patterns = {name.variable for name in named if name.instance == instance}
    tunable = {v.name: v for v in fmu.of("parameter") if v.variability == "tunable"} if patterns else {}
    if not tunable:
        return frozenset()
    inputs = {v.name for v in fmu.variables.values() if v.causality == "input"}
    driven: set[str] = set()
    for pattern in patterns:
        if not matching(pattern, inputs) and not fmu.elements_of(pattern, "input"):
            driven.update(matching(pattern, tunable).values())
            driven.update(v.name for v in fmu.elements_of(pattern, "parameter") if v.name in tunable)
    return frozenset(driven)


def _note_unusable(system: WiringContext) -> None:
    """Note variables that this master cannot use."""
    for instance, fmu in system.fmus.items():
        reasons: dict[str, list[str]] = {}
        for name, why in fmu.refused.items():
            reasons.setdefault(why, []).append(name)
        for why, names in reasons.items():
            each = "each " if len(names) > 1 else ""
            system.note("variable-unsupported", f"{instance} ({fmu.name}): {listed(fold(names))} {each}{why}")


def _check_instances(system: WiringContext) -> None:
    """Report FMUs with several instances that allow only one per process."""
    first: dict[str, str] = {}
    for name, fmu in system.fmus.items():
        other = first.setdefault(fmu.sha256, name)
        if fmu.once_per_process and other != name:
            system.report(
                ("units", name, "fmu"),
                f"{fmu.name} can be instantiated only once per process, and {other} uses it already; "
                "with --isolate each instance has a process of its own",
                "fmu-once-per-process",
            )


def _sorted(wires: Sequence[Wire], order: Sequence[str], fmus: Mapping[str, Fmu]) -> tuple[Wire, ...]:
    """Return the wires sorted by their target in evaluation order, then by input in the FMU's order."""
    place = {
        (instance, name): (i, j)
        for i, instance in enumerate(order)
        for j, name in enumerate(fmus[instance].variables)
    }
    return tuple(sorted(wires, key=lambda wire: place[(wire.target, wire.input)]))
