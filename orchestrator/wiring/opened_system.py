"""A scenario with its FMUs opened, and what is found while it is wired."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property

from vocabulary.wheels import WHEELS

from ..errors import Problem, WiringError
from ..plan import Fmu, ValueOrigin, Variable
from ..scenario.load import Scenario
from ..scenario.yaml_lines import PROBLEMS, Document, Key
from ..wording import fold_sentences
from .patterns import match

ByUnit = dict[str, dict[str, Variable]]
"""Unit -> name -> variable."""


@dataclass
class System:
    """What all that wire a scenario have in common.

    A value that is meant for an FMU which a change has replaced is no mistake if that FMU has a use for it
    (`had`): it is left out, with a note.
    """

    scenario: Scenario
    fmus: Mapping[str, Fmu]
    replaced: Callable[[str], Fmu | None]
    """Returns the FMU of a unit that a change has replaced, None if it is not there."""
    notes: list[str] = field(default_factory=list)
    """Remarks on what is no mistake, for the plan."""
    found: list[tuple[tuple[bool, Key], str]] = field(default_factory=list)
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

    def report(self, key: Key, sentence: str, document: Document | None = None) -> None:
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
