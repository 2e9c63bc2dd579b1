"""Scenarios as immutable values: loaded, changed, run."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

from yawbench.events.kinds import WarningWatch
from yawbench.fmus.fmu import Fmu, RunsAs, Value
from yawbench.foundation.errors import (
    Diagnostic,
    Location,
    ScenarioError,
    SimulationError,
    YawbenchWarning,
    code_of,
    text_of,
    warnings_in,
)
from yawbench.foundation.messages import hint, short
from yawbench.foundation.progress import bar
from yawbench.orchestrator.fault_kinds import FaultList, FaultName
from yawbench.orchestrator.master.simulate import simulate_in_memory
from yawbench.orchestrator.plan import Override, Plan
from yawbench.orchestrator.scenario import catalogue
from yawbench.orchestrator.scenario.overrides import faults_at, setting, with_changes
from yawbench.orchestrator.scenario.schema import LoadedScenario
from yawbench.orchestrator.signal_names import Target
from yawbench.vehicles.quantities import CAR
from yawbench.vocabulary.facts import FACTS
from yawbench.vocabulary.roles import role_of

from . import arguments
from ._controller import ControllerLike, PythonComponent
from ._known_fmus import KnownFmus
from ._run import Run
from ._run_many import Opened, opener_of, planner_of
from .planner import Planner

if TYPE_CHECKING:
    from ._stepping import SteppedRun


def load(source: str | Path) -> Scenario:
    """Load a scenario by name or path.

        >>> yb.load("fnn_sideslip/25mps").title
        'Sideslip tracking at 25 m/s, mu 0.65'

    Args:
        source: a name in the nearest folder `scenarios` or in that of yawbench, or the path of a YAML
            file or an SSP archive.

    Raises:
        ScenarioError: the scenario does not exist or is invalid.
    """
    scenario = Scenario(catalogue.find(arguments.path(source, "source"), "a scenario").absolute())
    scenario._loaded  # noqa: B018 - raises now if it is invalid
    return scenario


@dataclass(frozen=True)
class Scenario:
    """Immutable scenario with overrides; created by `load`.

        >>> base = yb.load("fnn_sideslip/25mps")
        >>> run = base.swap(controller="controller_off").set({"plant.initial_speed": "80 km/h"}).run()
        >>> [str(change.target) for change in run.changes]
        ['controller', 'plant.initial_speed']

    Attributes:
        path: the file.
        changes: overrides of the file.
    """

    path: Path
    changes: tuple[Override, ...] = ()
    _programs: Mapping[Path, PythonComponent] = field(default_factory=dict, repr=False)
    """Components in plain Python, by their virtual paths."""

    def swap(
        self, replacements: Mapping[str, ControllerLike] | None = None, /, **instances: ControllerLike
    ) -> Scenario:
        """Return the scenario with instances replaced by other FMUs or plain Python.

            >>> linear = base.swap(tyre="tyre_linear")
            >>> follow = base.swap(controller=lambda yaw_rate_ref, yaw_rate: 2e4 * (yaw_rate_ref - yaw_rate))
            >>> [one.run().metric("rms_error(yaw_rate)") < 0.1 for one in (linear, follow)]
            [True, True]

        Args:
            replacements, units: instance of the scenario -> name or path of an FMU, or plain Python, in a
                mapping as for `set` or by name. Plain Python is a function whose arguments have the names
                of signals (`t` is the time in s); an object with `inputs`, `outputs` and `output(t, u)`,
                and optionally `advance(t, h, u)`, `start(t, u)` and `step_size`; or a component class.
                Every run uses a copy of the object. Arguments with a default value, and constructor
                arguments of the object, are parameters for `set`.

        Raises:
            ScenarioError: the instance is unknown, or its replacement invalid.
        """
        wanted = "a mapping of instances to FMUs, {'tyre': 'tyre_linear'}"
        with arguments.as_scenario_errors("swap"):
            entries = {} if replacements is None else arguments.mapping(replacements, "replacements", wanted)
        return self._swapped({**entries, **instances})

    def _swapped(self, instances: Mapping[str, ControllerLike], label: str = "") -> Scenario:
        """Return the scenario with instances replaced; a label, if any, names plain Python."""
        existing = self._loaded.units
        changes, programs = [*self._unswapped(instances).changes], dict(self._programs)
        for instance, wanted in instances.items():
            if instance not in existing:
                text = f"there is no instance {short(instance)}{hint(instance, existing, lead='instances')}"
                raise ScenarioError(Diagnostic("instance-unknown", text, location=Location(self.path)))
            if arguments.names_file(wanted):
                fmu = fmu_of(wanted, instance)
                change = Override(Target.of_instance(instance), fmu, "swap")
                self._known_fmus.find(change)
                changes.append(change)
                continue
            role = role_of(instance, Path(self._loaded.replaced.get(instance, existing[instance].fmu)).stem)
            program = PythonComponent(wanted, instance=instance, role=role, label=label)
            programs[program.path] = program
            changes.append(Override(Target.of_instance(instance), str(program.path), "swap"))
            if program.step_size is not None:
                step_size = Target.of_instance(instance, "step_size")
                changes.append(Override(step_size, program.step_size, "swap"))
            changes += self._kept(instance, program)
        return replace(self, changes=tuple(changes), _programs=programs)

    def _kept(self, instance: str, program: PythonComponent) -> Iterator[Override]:
        """Yield overrides with a program's own values for parameters that the scenario would set."""
        loaded, facts = self._loaded, [name for fact in FACTS.values() for name in fact.parameters]
        by_scenario = {*CAR, *facts, *loaded.vehicle_file.parameters, *loaded.units[instance].parameters}
        requested = {change.target for change in self.changes if change.origin == "set"}
        for name, value in program.parameters.items():
            target = Target.of_instance(instance, name)
            if name in by_scenario and target not in requested:
                yield Override(target, value, "swap")

    def _unswapped(self, instances: Iterable[str]) -> Scenario:
        """Return the scenario without earlier swaps of instances and the values of their programs."""
        swapped = set(instances)
        kept = (
            change
            for change in self.changes
            if change.origin != "swap" or change.target.instance not in swapped
        )
        return replace(self, changes=tuple(kept))

    def set(self, values: Mapping[str, Value]) -> Scenario:
        """Return the scenario with other values.

            >>> changes = {"vehicle.mass": 1200, "plant.initial_speed": "80 km/h", "inputs.friction*": 0.3}
            >>> print(base.set(changes).run()["plant.velocity_x"][0].round(2))
            22.22
            >>> def follow(yaw_rate_ref, yaw_rate, gain=2e4):
            ...     return gain * (yaw_rate_ref - yaw_rate)
            >>> firm = base.swap(controller=follow).set({"controller.gain": 4e4})

        Args:
            values: target -> value, in SI or with its unit. Targets are those of `--set`:
                `instance.parameter`, `vehicle.parameter`, `inputs.pattern`, `instance.step_size`,
                `stop_time`, `step_size` or `algorithm`.

        Raises:
            ScenarioError: a target or value is invalid.
        """
        entries = arguments.mapping(values, "values", "a mapping of targets to values, {'stop_time': 2}")
        with arguments.as_scenario_errors("set"):
            targets = {name: Target.parse(name) for name in entries}
            plain = {targets[name]: _plain(targets[name], value) for name, value in entries.items()}
        changed = [setting(target, value, "set") for target, value in plain.items()]
        scenario = replace(self, changes=(*self.changes, *changed))
        scenario._check(changed)
        return scenario

    def _check(self, changes: Sequence[Override]) -> None:
        """Check overrides of values, as far as the FMUs that are up to date tell.

        Raises:
            ScenarioError: a target or value is invalid; lists all errors.
        """
        loaded, errors = self._loaded, []
        for change in changes:
            try:
                self._known_fmus.check(change, loaded)
            except ValueError as error:  # noqa: PERF203 - all errors are collected
                where = Location(target=str(change))
                errors.append(Diagnostic(code_of(error), str(error), location=where))
        if errors:
            raise ScenarioError(errors)

    @cached_property
    def _known_fmus(self) -> KnownFmus:
        return KnownFmus(self.path)

    def fault(
        self,
        target: str,
        *,
        kind: FaultName,
        value: float | str | None = None,
        start: float | str | None = None,
        until: float | str | None = None,
        share: float | None = None,
        every: float | str | None = None,
        seed: int | None = None,
    ) -> Scenario:
        """Return the scenario with a fault; several at the same target apply in order.

            >>> blind = base.fault("plant.sideslip", kind="freeze", start=1.5)
            >>> blind = blind.fault("plant.sideslip -> controller", kind="bias", value="0.5 deg", until=3)
            >>> [fault["fault"] for fault in blind.run().record["faults"]]
            ['freeze from 1.5 s', 'bias 0.5 deg until 3 s']

        Args:
            target: `instance.output` for all receivers and the results, `instance.output -> instance` for a
                single receiver, or `instance.input`; `*` matches several signals.
            kind: such as bias or freeze; the reference of scenario files lists all kinds.
            value: value of the fault, in SI or with its unit.
            start, until: start and end [s]; default: those of the run.
            share: fraction of the messages that are affected.
            every: time between two messages [s].
            seed: of the random numbers.

        Raises:
            ScenarioError: the target or kind is unknown, or an argument does not fit the kind.
        """
        where, name = arguments.text(target, "target"), arguments.text(kind, "kind")
        settings = {"kind": name, "value": value, "share": share, "every": every, "seed": seed}
        settings |= {"from": start, "until": until}
        with arguments.as_scenario_errors("fault"):
            item = {name: arguments.scalar(x, name) for name, x in settings.items() if x is not None}
        new = faults_at(where, item, "fault")
        earlier = next((c for c in self.changes if (c.target, c.origin) == (new.target, "fault")), None)
        both = FaultList((*(earlier.faults if earlier else ()), *new.faults))
        others = [change for change in self.changes if change is not earlier]
        scenario = replace(self, changes=(*others, replace(new, value=both)))
        scenario._loaded  # noqa: B018 - raises now if it is invalid
        return scenario

    @cached_property
    def _loaded(self) -> LoadedScenario:
        """The validated scenario with all overrides applied; the file is read once."""
        return Planner().load(self.path, self.changes)

    def plan(self) -> Plan:
        """Return the plan of a run: instances in order, wires, constants, time grid.

        Raises:
            YawbenchError: an FMU is missing, a component whose source has changed cannot be built, or
                the instances cannot be connected.
        """
        plan = planner_of(self._programs).plan(self._loaded)
        return replace(plan, diagnostics=plan.diagnostics + self._notes(plan))

    def _notes(self, plan: Plan) -> tuple[Diagnostic, ...]:
        """Return how the instances in plain Python run."""
        return tuple(
            Diagnostic(
                "instance-in-python",
                f"{instance.name}: {instance.fmu.name} is plain Python of this process, not an FMU; "
                f"{_how_it_runs(instance.fmu)}",
                "info",
            )
            for instance in plan.instances
            if instance.fmu.path in self._programs
        )

    def run(self, *, progress: Callable[[int, int], None] | bool | None = None) -> Run:
        """Run the scenario in this process and return its results; nothing is written.

        All warnings about the run are issued as one `YawbenchWarning`.

        Args:
            progress: called a few times per second with the numbers of completed and all steps; or whether
                to show a bar; default: in a terminal or a notebook, after two seconds.

        Raises:
            SimulationError: an instance failed; an exception of Python code is its `__cause__`.
        """
        wanted, called = arguments.plain(progress), None
        if wanted is not None and type(wanted) is not bool:
            wanted, called = False, arguments.function(progress, "progress", "done", "total")
        opener = Opened(opener_of(self._programs))
        with bar(self.title, wanted=wanted) as shown:
            plan, report = self.plan(), called or shown.update
            try:
                try:
                    watch = WarningWatch(plan)
                    run = Run(simulate_in_memory(plan, opener=opener, watch=watch, progress=report))
                except SimulationError as error:
                    if (again := self._in_python(plan, str(error))) == plan:
                        raise
                    opener.instances.clear()
                    # It ends, or fails again, with the exception.
                    run = Run(simulate_in_memory(again, opener=opener, watch=WarningWatch(again)))
            except SimulationError as error:
                warn(with_changes(plan.title, plan.changes), (*plan.diagnostics, *error.warnings))
                raise error from opener.cause(error)
        warn(run._full_title, run.diagnostics)
        return run

    def start(self) -> SteppedRun:
        """Return a run that is initialized and waits to be stepped.

            >>> with base.start() as s:
            ...     s.step()
            ...     s.run_to(0.5)
            0.001
            0.5

        A native law that fails is not repeated in Python, as it is by `run`.

        Raises:
            SimulationError: the run cannot be initialized.
        """
        from ._stepping import SteppedRun

        return SteppedRun(self.plan(), opener_of(self._programs))

    def _in_python(self, plan: Plan, why: str) -> Plan:
        """Return a plan in which plain Python runs as Python, because it failed natively."""
        instances = []
        for instance in plan.instances:
            how = instance.fmu.runs_as
            if instance.fmu.path in self._programs and how is not None and how.native:
                fmu = replace(self._programs[instance.fmu.path].fmu, runs_as=RunsAs(f"natively, {why}"))
                instances.append(replace(instance, fmu=fmu))
            else:
                instances.append(instance)
        again = replace(plan, instances=tuple(instances))
        others = tuple(note for note in plan.diagnostics if note not in self._notes(plan))
        return replace(again, diagnostics=others + self._notes(again))

    @property
    def title(self) -> str:
        """The scenario's title."""
        return self._loaded.title

    def _repr_html_(self) -> str:
        plan = self.plan()
        rows = "".join(
            f"<tr><td>{escape(instance.name)}</td><td>{escape(instance.fmu.name)}</td>"
            f"<td>{escape(instance.fmu.description)}</td></tr>"
            for instance in plan.instances
        )
        changed = "".join(f"<br>{escape(str(change))}" for change in self.changes)
        return f"<b>{escape(plan.title)}</b>{changed}<table>{rows}</table>"


def _how_it_runs(fmu: Fmu) -> str:
    if fmu.runs_as is None or fmu.runs_as.native:
        note = fmu.runs_as.note if fmu.runs_as else ""
        return f"runs natively; {note}, in which the run is repeated in Python" if note else "runs natively"
    return f"runs in Python: {fmu.runs_as.why}"


def warn(title: str, diagnostics: Iterable[Diagnostic]) -> None:
    """Issue all warnings among diagnostics, if any, as a single warning of the caller's caller."""
    if text := text_of(warnings_in(diagnostics)):
        warnings.warn(f"{title}: {text}", YawbenchWarning, stacklevel=3)


def fmu_of(wanted: str | Path, name: str) -> str:
    """Return the FMU of an argument: a name unchanged, a path made absolute."""
    path = arguments.path(wanted, name)
    if path.suffix == ".fmu":
        return str(path.absolute())
    return arguments.text(wanted, name) if isinstance(wanted, str) else str(path)


def _plain(target: Target, value: Any) -> Value:
    """Return the value for a target as plain Python."""
    of_file = target.kind in ("vehicle_file", "tyres")
    return str(arguments.path(value, str(target))) if of_file else arguments.scalar(value, str(target))
