"""A scenario with its FMUs opened, and what is found while it is wired.

What one name tells all units that have to know it: the friction of the road, the speed of the car.

    friction: 0.65         # every parameter `base_friction` of a road, and every input `friction`,
                           # `friction_fl` .. `friction_rr` that no unit drives
    speed: 80 km/h         # every parameter `initial_speed`, `target_speed`

In a scenario a fact stands behind what is given by its own name; as a change (`--set friction=0.3`) it goes
before what the file gives, so that one change reaches all. A line more in the table is a fact more, with
a key of the same name in the schema of scenarios and in `plan.FACTS`.

Which names a pattern with a `*` means.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property

from vocabulary.wheels import WHEELS, wheels

from ..errors import Problem, WiringError
from ..messages import fold_sentences
from ..plan import FACTS as NAMES
from ..plan import Fmu, Instance, Value, ValueOrigin, Variable
from ..scenario.load import LoadedScenario
from ..scenario.yaml_lines import PROBLEMS, Document, KeyPath


@dataclass(frozen=True)
class Fact:
    """What a fact reaches."""

    unit: str
    inputs: tuple[str, ...] = ()
    parameters: dict[str, str] = field(default_factory=dict)
    """Parameter -> the one of the same unit that turns it off if it is 0; "" if it always counts."""

    def counts(self, unit: Instance, parameter: str) -> bool:
        """Return whether a unit's parameter is one of the fact's, and not turned off."""
        if parameter not in self.parameters:
            return False
        return unit.parameter(self.parameters[parameter]) != 0


FACTS = {
    "friction": Fact("1", ("friction", *wheels("friction_*")), {"base_friction": ""}),
    "speed": Fact("m/s", parameters={"initial_speed": "", "target_speed": "speed_gain"}),
}
assert tuple(FACTS) == NAMES


def facts_of(scenario: LoadedScenario) -> Iterator[tuple[str, Fact, Value, bool]]:
    """Yield name, fact, value and whether a change gave it, of all facts that a scenario tells."""
    for name, fact in FACTS.items():
        value = getattr(scenario, name)
        if value is not None:
            yield name, fact, value, scenario.document.override((name,)) is not None


def match(pattern: str, name: str) -> str | None:
    """Return what the `*` of a pattern stands for in a name, '' without `*`, None if they differ."""
    head, star, tail = pattern.partition("*")
    if not star:
        return "" if name == pattern else None
    fits = len(name) >= len(head) + len(tail) and name.startswith(head) and name.endswith(tail)
    return name[len(head) : len(name) - len(tail)] if fits else None


def matching(pattern: str, names: Collection[str]) -> dict[str, str]:
    """Return the names that fit a pattern, each under what the `*` stands for in it."""
    if "*" not in pattern:
        return {"": pattern} if pattern in names else {}
    return {part: name for name in names if (part := match(pattern, name)) is not None}


ByUnit = dict[str, dict[str, Variable]]
"""Unit -> name -> variable."""


@dataclass
class WiringContext:
    """What all that wire a scenario have in common.

    A value that is meant for an FMU which a change has replaced is no mistake if that FMU has a use for it
    (`had`): it is left out, with a note.
    """

    scenario: LoadedScenario
    fmus: Mapping[str, Fmu]
    replaced: Callable[[str], Fmu | None]
    """Returns the FMU of a unit that a change has replaced, None if it is not there."""
    notes: list[str] = field(default_factory=list)
    """Remarks on what is no mistake, for the plan."""
    found: list[tuple[tuple[bool, KeyPath], str]] = field(default_factory=list)
    """What is wrong, with its key and whether that is one of the vehicle file."""

    @cached_property
    def origins(self) -> dict[str, dict[str, ValueOrigin]]:
        """Unit -> parameter or constant -> where its value comes from, as far as that is known yet."""
        return {unit: {} for unit in self.fmus}

    @cached_property
    def inputs(self) -> ByUnit:
        """All inputs."""
        return {unit: {v.name: v for v in fmu.of("input")} for unit, fmu in self.fmus.items()}

    @cached_property
    def outputs(self) -> ByUnit:
        """All outputs."""
        return {unit: {v.name: v for v in fmu.of("output")} for unit, fmu in self.fmus.items()}

    def before(self, units: Iterable[str] | None = None) -> Iterator[Fmu]:
        """Yield the FMUs that changes have replaced, in some units or in all, as far as they are there."""
        for unit in self.fmus if units is None else units:
            if unit in self.scenario.replaced and (fmu := self.replaced(unit)) is not None:
                yield fmu

    def had(self, units: Iterable[str], pattern: str, causality: str | None = None) -> bool:
        """Return whether an FMU that a change has replaced in one of the units has such a variable.

        Args:
            units: where it was.
            pattern: of the variable's name.
            causality: of the variable; None: any.
        """
        return any(
            match(pattern, variable.name) is not None and causality in (None, variable.causality)
            for fmu in self.before(units)
            for variable in fmu.variables.values()
        )

    def report(self, key: KeyPath, sentence: str, document: Document | None = None) -> None:
        """Report a problem with what the scenario says at `key`, or the vehicle file if that is the document.

        Raises:
            WiringError: problems have become very many.
        """
        self.found.append(((document is self.scenario.vehicle_document, key), sentence))
        if len(self.found) >= len(WHEELS) * PROBLEMS:
            raise WiringError(self.problems())

    def problems(self) -> list[Problem]:
        """Return all problems from top to bottom of the files, those that are alike for four wheels once."""
        problems: list[Problem] = []
        folded = fold_sentences(self.found)
        for of_vehicle, document in enumerate((self.scenario.document, self.scenario.vehicle_document)):
            told = [document.problem(key, text) for (which, key), text in folded if which == of_vehicle]
            problems += sorted(dict.fromkeys(told), key=lambda problem: problem.line or 0)
        return problems
