"""The parameters on a page, with the provenance of their values as the run recorded it.

The source of a value is decided when a run is planned, and is part of its record; the source of a default is
in the FMU that has it.
"""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from vocabulary.wheels import WHEEL_NAMES, WHEELS

from ..messages import fold
from ..plan import (
    CHOSEN,
    ERRATUM,
    LITERATURE,
    NEUTRAL,
    PAPER,
    VARIED,
    Instance,
    Plan,
    Value,
    ValueSource,
    Variable,
)
from ..results.run_record import NOT_RECORDED, RunRecord


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
        self,
        name: str,
        variable: Variable,
        meaning: str,
        value: str,
        origin: ValueSource | None,
        default: ValueSource,
    ) -> None:
        """Add the value of a variable in one run, and its source; None: that of the FMU's default."""
        row = self.parameters.setdefault(name, PageParameter(name, meaning, variable.unit or "", default))
        row.values[value] = None
        if origin is not None and origin.kind == VARIED:
            row.set_by_study = True
        else:
            row.given = row.given or origin


def groups_of(runs: Sequence[tuple[RunRecord, Plan]]) -> list[ParameterGroup]:
    """Return all parameters of runs: the vehicles', those of each instance's FMUs, constants.

    Args:
        runs: the record of each run, and its plan, whose FMUs describe the variables.
    """
    vehicles: dict[str, ParameterGroup] = {}
    units: dict[tuple[str, str], ParameterGroup] = {}
    constants = ParameterGroup("Constant inputs", "no unit gives them")
    order: dict[str, None] = {}
    for record, plan in runs:
        by_name = {unit.name: unit for unit in plan.instances if unit.name in record.fmus}
        given = record.scenario.get("units", {})
        for name in [name for name in given if name in by_name]:
            order[name] = None
            unit, fmu = by_name[name], record.fmus[name]
            own = units.setdefault(
                (name, fmu.name), ParameterGroup(f"{name}: {fmu.name}", unit.fmu.description)
            )
            values = fmu.defaults | fmu.parameters
            own_names = given[name].get("parameters", {})
            of_vehicle = record.scenario.get("vehicle_parameters", {}).keys() - own_names
            for variable in unit.fmu.of("parameter"):
                if variable.name not in values:
                    continue
                group = _vehicle_group(vehicles, record) if variable.name in of_vehicle else own
                default = _default(record, unit, variable)
                value, source = text_of(values[variable.name]), record.source(name, variable.name)
                group.note(variable.name, variable, variable.description, value, source, default)
            _constants(constants, record, unit)
    ordered = [units[key] for name in order for key in units if key[0] == name]
    return [group for group in (*vehicles.values(), *ordered, constants) if group.parameters]


def _default(record: RunRecord, unit: Instance, variable: Variable) -> ValueSource:
    """Return the source of a variable's default, which only the FMU of the run knows."""
    same = record.fmus[unit.name].sha256 == unit.fmu.sha256
    return ValueSource.parse(variable.source) if same else NOT_RECORDED


def _vehicle_group(vehicles: dict[str, ParameterGroup], record: RunRecord) -> ParameterGroup:
    """Return the group of a run's vehicle file."""
    told = record.scenario
    file = Path(os.path.normpath(Path(record.scenario_file).parent / str(told.get("vehicle", ""))))
    title, source = told.get("vehicle_title") or file.stem, told.get("vehicle_source", NOT_RECORDED.says)
    return vehicles.setdefault(str(file), ParameterGroup(f"The car: {title}", f"{file.name}; {source}"))


def _constants(group: ParameterGroup, record: RunRecord, unit: Instance) -> None:
    """Add the constants of an instance; four equal wheels become one name that ends with `*`."""
    fmu = record.fmus[unit.name]
    texts = {name: text_of(value) for name, value in fmu.constants.items()}
    texts |= {name: f"{series.file}: {series.column}" for name, series in fmu.series.items()}
    alike: dict[str, list[str]] = {}
    for name in dict.fromkeys((*unit.constants, *unit.fmu.variables)):
        if name in texts:
            alike.setdefault(texts[name], []).append(name)
    for value_text, names in alike.items():
        for name in fold(names):
            first = name.removesuffix("*") + WHEELS[0] if name.endswith("*") else name
            variable = unit.fmu.variables[first]
            meaning = variable.description
            if first != name:
                meaning = meaning.removesuffix(f", {WHEEL_NAMES[WHEELS[0]]}")
            source, default = record.source(unit.name, first), _default(record, unit, variable)
            group.note(f"{unit.name}.{name}", variable, meaning, value_text, source, default)


def text_of(value: Value | None) -> str:
    """Return a value as written in a scenario file, numbers with six digits."""
    if isinstance(value, bool):
        return str(value).lower()
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def count_kinds(groups: Iterable[ParameterGroup]) -> dict[str, int]:
    """Return the number of parameters by kind of provenance."""
    kinds = Counter(one.origin.kind for group in groups for one in group.parameters.values())
    return {kind: kinds[kind] for kind in (PAPER, ERRATUM, CHOSEN, LITERATURE, NEUTRAL) if kind in kinds}
