"""The provenance of parameter values: from a paper, an erratum, our choice, or the study itself.

It is read from where the value is: from the parameter's source in its FMU, from the comment next to it in the
scenario or vehicle file, or from that file's `source`. The first word of a source is its kind: `paper`,
`erratum`, `chosen`; anything else is literature.
"""

from __future__ import annotations

import linecache
import re
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from vocabulary.wheels import WHEEL_NAMES, WHEELS

from ..messages import fold
from ..names import SignalName
from ..plan import DEFAULT, Instance, Plan, Value, Variable
from ..scenario.load import LoadedScenario
from ..scenario.yaml_lines import Document, KeyPath
from ..wiring.context import facts_of

PAPER, LITERATURE, CHOSEN, ERRATUM, VARIED, NEUTRAL = (
    "paper", "literature", "chosen", "erratum", "varied", "neutral",
)  # fmt: skip
_COMMENT = re.compile(r"#\s*(.*?)\s*$")


@dataclass(frozen=True)
class ValueSource:
    """The provenance of a value: its kind, and the text of the source."""

    kind: str
    says: str


VARIED_BY_STUDY = ValueSource(VARIED, "set by the study")


@dataclass
class PageParameter:
    """A parameter with its values in all runs of a study."""

    name: str
    meaning: str
    unit: str
    default: ValueSource  # of the FMU's default
    given: ValueSource | None = None  # of the value in the scenario or vehicle file
    set_by_study: bool = False
    values: dict[str, None] = field(default_factory=dict)  # as text, each once

    @property
    def origin(self) -> ValueSource:
        """The provenance of the value that applies where the study does not override it."""
        return self.given or self.default


@dataclass
class ParameterGroup:
    """The parameters of a vehicle file or of an instance's FMU, or the constants of a scenario."""

    title: str
    below: str
    parameters: dict[str, PageParameter] = field(default_factory=dict)

    def note(
        self, name: str, variable: Variable, meaning: str, value: str, origin: ValueSource | None
    ) -> None:
        """Add the value of a variable in one run, and its provenance; None: the FMU's default."""
        default = origin_of(variable.source)
        row = self.parameters.setdefault(name, PageParameter(name, meaning, variable.unit or "", default))
        row.values[value] = None
        if origin is not None and origin.kind == VARIED:
            row.set_by_study = True
        else:
            row.given = row.given or origin


def origin_of(source: str, otherwise: str = "") -> ValueSource:
    """Parse a source; `otherwise` is the kind of a source that names none."""
    return ValueSource(_first_word(source) or otherwise or (LITERATURE if source else NEUTRAL), source)


def _first_word(source: str) -> str:
    word = re.match(r"[a-z]*", source)
    return word[0] if word and word[0] in (PAPER, ERRATUM, CHOSEN) else ""


def said_in(comment: str, file: str) -> ValueSource:
    """Parse a comment, "its unit, remarks; source", in a file with a source."""
    parts = comment.split("; ")
    begin = next((i for i, part in enumerate(parts) if _first_word(part)), 0)
    return origin_of("; ".join(parts[begin:]), _first_word(file) or NEUTRAL)


def groups_of(runs: Sequence[tuple[LoadedScenario, Plan]]) -> list[ParameterGroup]:
    """Return all parameters of the runs: the vehicles', those of each instance's FMUs, constants."""
    vehicles: dict[str, ParameterGroup] = {}
    units: dict[tuple[str, str], ParameterGroup] = {}
    constants = ParameterGroup("Constant inputs", "no unit gives them")
    order: dict[str, None] = {}
    linecache.checkcache()
    for scenario, plan in runs:
        by_name = {unit.name: unit for unit in plan.instances}
        for name in [name for name in scenario.units if name in by_name]:
            order[name] = None
            unit = by_name[name]
            own = units.setdefault(
                (name, unit.fmu.name), ParameterGroup(f"{name}: {unit.fmu.name}", unit.fmu.description)
            )
            for variable in unit.fmu.of("parameter"):
                from_vehicle = (
                    variable.name in scenario.vehicle_file.parameters
                    and variable.name not in scenario.units[name].parameters
                )
                value = unit.parameter(variable.name)
                group, origin = own, _origin(scenario, unit, variable.name)
                if from_vehicle:
                    file = scenario.vehicle_document.path
                    group = vehicles.setdefault(str(file), _vehicle_group(scenario, file))
                group.note(variable.name, variable, variable.description, text_of(value), origin)
            _constants(constants, scenario, unit)
    ordered = [units[key] for name in order for key in units if key[0] == name]
    return [group for group in (*vehicles.values(), *ordered, constants) if group.parameters]


def _vehicle_group(scenario: LoadedScenario, file: Path) -> ParameterGroup:
    vehicle = scenario.vehicle_file
    return ParameterGroup(f"The car: {vehicle.title or file.stem}", f"{file.name}; {vehicle.source}")


def _constants(group: ParameterGroup, scenario: LoadedScenario, unit: Instance) -> None:
    """Add the constants of an instance; four equal wheels become one name that ends with `*`."""
    alike: dict[str, list[str]] = {}
    for name, value in unit.constants.items():
        series = unit.series.get(name)
        alike.setdefault(f"{series.file}: {series.column}" if series else text_of(value), []).append(name)
    for value_text, names in alike.items():
        for name in fold(names):
            first = name.removesuffix("*") + WHEELS[0] if name.endswith("*") else name
            variable = unit.fmu.variables[first]
            meaning = variable.description
            if first != name:
                meaning = meaning.removesuffix(f", {WHEEL_NAMES[WHEELS[0]]}")
            origin = _origin_of_constant(scenario, unit, first)
            group.note(f"{unit.name}.{name}", variable, meaning, value_text, origin)


def _origin_of_constant(scenario: LoadedScenario, unit: Instance, name: str) -> ValueSource | None:
    """Return the provenance of an input's constant, None if it is the FMU's own."""
    origin = unit.origins.get(name, DEFAULT)
    if origin.kind == "scenario":
        given = [
            pattern
            for pattern in scenario.inputs
            if SignalName.parse_input(pattern, scenario.units).matches(unit.name, name)
        ]
        exact = max(given, key=lambda one: ("*" not in one, "." in one), default=None)
        return _provenance_in_scenario(scenario, ("inputs", exact) if exact else (_fact(scenario, name),))
    return None if origin == DEFAULT else VARIED_BY_STUDY


def _origin(scenario: LoadedScenario, unit: Instance, name: str) -> ValueSource | None:
    """Return the provenance of a value from the scenario or vehicle file, None if it is the FMU's own."""
    origin = unit.origins.get(name, DEFAULT)
    if origin == DEFAULT:
        return None
    if origin.kind == "vehicle":
        measure = unit.fmu.variables[name].unit or "1"
        words = _comment_on_line(scenario.vehicle_document, ("parameters", name))
        words = re.sub(rf"^{re.escape(measure)}(?![\w/.])[,;]?\s*", "", words)
        return said_in(words, scenario.vehicle_file.source)
    if origin.kind == "derived":
        return ValueSource(NEUTRAL, str(origin))
    if origin.kind == "scenario":
        own = name in scenario.units[unit.name].parameters
        key: KeyPath = ("units", unit.name, "parameters", name) if own else (_fact(scenario, name),)
        return _provenance_in_scenario(scenario, key)
    if origin.kind == "file":
        of_tyres = any(origin.detail == file.path.name for file in scenario.tyre_files.values())
        return ValueSource(LITERATURE, f"{'tyre property ' if of_tyres else ''}file {origin}")
    return VARIED_BY_STUDY


def _provenance_in_scenario(scenario: LoadedScenario, key: KeyPath) -> ValueSource:
    """Return the provenance in the scenario's comment on a value, next to it or above its instance."""
    words = _comment_on_line(scenario.document, key)
    if key[0] == "units":
        words = words or _comment_above(scenario.document, key[:2])
    return said_in(words or scenario.source, scenario.source)


def _fact(scenario: LoadedScenario, name: str) -> str:
    """Return the scenario's global value that sets a parameter or an input, "" if none does."""
    facts = (fact for fact, one, _, _ in facts_of(scenario) if name in (*one.inputs, *one.parameters))
    return next(facts, "")


def _comment_on_line(document: Document, key: KeyPath) -> str:
    """Return the comment on the line of a value, "" if there is none."""
    match = _COMMENT.search(linecache.getline(str(document.path), document.lines.get(key, 0)))
    return match[1] if match else ""


def _comment_above(document: Document, key: KeyPath) -> str:
    """Return the comment lines right above a key."""
    number = document.lines.get(key, 1) - 1
    found: list[str] = []
    while (line := linecache.getline(str(document.path), number).strip()).startswith("#"):
        found.insert(0, line.lstrip("# "))
        number -= 1
    return " ".join(found)


def text_of(value: Value | None) -> str:
    """Return a value as written in a scenario file, numbers with six digits."""
    if isinstance(value, bool):
        return str(value).lower()
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def count_kinds(groups: Iterable[ParameterGroup]) -> dict[str, int]:
    """Return the number of parameters by kind of provenance."""
    kinds = Counter(one.origin.kind for group in groups for one in group.parameters.values())
    return {kind: kinds[kind] for kind in (PAPER, ERRATUM, CHOSEN, LITERATURE, NEUTRAL) if kind in kinds}
