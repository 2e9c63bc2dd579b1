"""State shared by all steps of wiring: the scenario, its opened FMUs, errors and notes so far.

`reached` and `found_at` return what the target of an override, such as a fact, sets in a plan.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

from yawbench.fmus.fmu import Fmu, Value, Variable
from yawbench.foundation.errors import Diagnostic, Location, Severity, WiringError
from yawbench.foundation.messages import fold_sentences
from yawbench.vocabulary.facts import FACTS, Fact

from ..plan import PARAMETERS, Given, Instance, Plan
from ..scenario.loader import LoadedScenario
from ..scenario.yaml_lines import MOST_ERRORS, KeyPath
from ..signal_names import OF_RUN, SignalName, Target, match, matching

MOST_REPORTED = 4 * MOST_ERRORS
"""Errors after which wiring ends. Chosen: those of inputs that differ by a wheel are told as one."""


def facts_of(scenario: LoadedScenario) -> Iterator[tuple[str, Fact, Given[Value]]]:
    """Yield the facts of a scenario: name, fact, value."""
    for name, fact in FACTS.items():
        given = getattr(scenario, name)
        if given is not None:
            yield name, fact, given


ByUnit = dict[str, dict[str, Variable]]
"""Instance -> name -> variable."""


@dataclass
class WiringContext:
    """The scenario that is being wired, its FMUs, and the errors and notes so far.

    A value for an FMU that an override has replaced is not an error if the replaced FMU has such a variable
    (`had`): it is ignored, with a note.
    """

    scenario: LoadedScenario
    fmus: Mapping[str, Fmu]
    replaced: Callable[[str], Fmu | None]
    """Returns the replaced FMU of an instance, None if it does not exist."""
    notes: list[Diagnostic] = field(default_factory=list)
    """Diagnostics that are not errors, for the plan."""
    reported: list[tuple[tuple[Location, str], str]] = field(default_factory=list)
    """Errors: place and code, sentence."""

    @cached_property
    def given(self) -> dict[str, dict[str, Given[Any]]]:
        """Instance -> parameter or constant -> its value as given, at first the start value of the FMU."""
        return {
            instance: {v.name: Given(v.start) for kind in PARAMETERS for v in fmu.of(kind)}
            for instance, fmu in self.fmus.items()
        }

    @cached_property
    def inputs(self) -> ByUnit:
        """All inputs by instance and name."""
        return {instance: {v.name: v for v in fmu.of("input")} for instance, fmu in self.fmus.items()}

    @cached_property
    def aliases(self) -> dict[str, dict[str, str]]:
        """Other names of inputs by instance: alias -> name."""
        return {instance: fmu.aliases() for instance, fmu in self.fmus.items()}

    def matching_inputs(self, instance: str, pattern: str) -> dict[str, str]:
        """Return the inputs of which a name matches a pattern, as part matched by `*` -> name."""
        names = matching(pattern, self.inputs[instance])
        for part, alias in matching(pattern, self.aliases[instance]).items():
            if self.aliases[instance][alias] not in names.values():
                names.setdefault(part, self.aliases[instance][alias])
        return names

    @cached_property
    def outputs(self) -> ByUnit:
        """All outputs by instance and name."""
        return {instance: {v.name: v for v in fmu.of("output")} for instance, fmu in self.fmus.items()}

    def before(self, instances: Iterable[str] | None = None) -> Iterator[Fmu]:
        """Yield the existing FMUs that overrides have replaced, of some instances or of all."""
        for instance in self.fmus if instances is None else instances:
            if instance in self.scenario.replaced and (fmu := self.replaced(instance)) is not None:
                yield fmu

    def had(self, instances: Iterable[str], pattern: str, causality: str | None = None) -> bool:
        """Return whether a replaced FMU of one of the instances has such a variable.

        Args:
            instances: their names.
            pattern: of the variable's name.
            causality: of the variable; None: any.
        """
        return any(
            match(pattern, variable.name) is not None and causality in (None, variable.causality)
            for fmu in self.before(instances)
            for variable in fmu.variables.values()
        )

    def note(self, code: str, sentence: str, severity: Severity = "info") -> None:
        """Add a diagnostic that is not an error."""
        self.notes.append(Diagnostic(code, sentence, severity))

    def left_out(self, what: str, why: str) -> None:
        """Note what was meant for a replaced FMU, and is ignored."""
        self.note("left-out-after-swap", f"{what} is left out: {why}")

    def report(self, where: KeyPath | Location, sentence: str, code: str = "value-invalid") -> None:
        """Report an error about a value: at a key of the scenario, or at a place.

        Raises:
            WiringError: there are too many errors to continue.
        """
        where = where if isinstance(where, Location) else self.scenario.document.location(where)
        self.reported.append(((where, code), sentence))
        if len(self.reported) >= MOST_REPORTED:
            raise WiringError(self.errors())

    def errors(self) -> list[Diagnostic]:
        """Return all errors in the order of the files' lines, with those of the four wheels merged."""
        errors = [Diagnostic(code, text, location=at) for (at, code), text in fold_sentences(self.reported)]
        vehicle = self.scenario.vehicle_document.path
        return sorted(dict.fromkeys(errors), key=lambda e: (e.location.file == vehicle, e.location.line or 0))


def reached(plan: Plan, target: Target) -> Iterator[tuple[Instance, Variable]]:
    """Yield the parameters, or the constant inputs, that a target sets in a plan."""
    by_name = {instance.name: instance for instance in plan.instances}
    if target.kind == "input":
        pattern = SignalName.parse_input(target.variable, by_name)
        for instance in plan.instances:
            for name, variable in instance.fmu.variables.items():
                if name in instance.constants and pattern.matches(instance.name, name):
                    yield instance, variable
    elif target.kind == "fact":
        fact = FACTS[target.variable]
        for instance in plan.instances:
            for name, variable in instance.fmu.variables.items():
                if fact.counts(instance, name) or (name in fact.inputs and name in instance.constants):
                    yield instance, variable
    elif target.kind in ("parameter", "vehicle_parameter"):
        for instance in plan.instances:
            own = instance.fmu.variables.get(target.variable)
            if target.instance in ("", instance.name) and own and own.causality in PARAMETERS:
                yield instance, own


def found_at(plan: Plan, target: Target) -> tuple[Value, str] | None:
    """Return the value and unit that an override target has in a plan; None if it has no such target."""
    instance = next((planned for planned in plan.instances if planned.name == target.instance), None)
    if target.kind == "fmu":
        return (instance.fmu.name, "") if instance else None
    if target.kind == "vehicle_file":
        return (str(plan.scenario["vehicle"]), "") if plan.scenario.get("vehicle") else None
    if target.kind == "tyres":
        files = {axle: str(file["file"]) for axle, file in plan.scenario.get("tyre_files", {}).items()}
        return (files[target.variable or "front"], "") if files else None
    if target.kind == "run":
        times = float(plan.start), plan.time(plan.n_steps), float(plan.step)
        values: dict[str, Value] = dict(zip(OF_RUN, (*times, plan.algorithm), strict=True))
        return values[target.variable], "s"
    if target.kind == "setting" and target.is_time and instance:
        return float(instance.period * plan.step), "s"
    for instance, variable in reached(plan, target):
        value = {**instance.parameters, **instance.constants}.get(variable.name, variable.start)
        of_vehicle = instance.origin(variable.name).kind == "vehicle"
        if value is not None and (of_vehicle or target.kind != "vehicle_parameter"):
            return value, variable.unit or ""
    return None
