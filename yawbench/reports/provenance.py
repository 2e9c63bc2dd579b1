"""What the runs of a page consist of: FMUs, programs, parameters with the sources of their values.

The source of a parameter's value is decided when a run is planned, and is part of its record; the source of a
default is in the FMU that has it.
"""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from yawbench.fmus.fmu import Value, Variable
from yawbench.foundation.messages import fold
from yawbench.orchestrator.plan import (
    CHOSEN,
    ERRATUM,
    LITERATURE,
    NEUTRAL,
    PAPER,
    VARIED,
    Instance,
    Plan,
    ValueSource,
)
from yawbench.orchestrator.results.run_record import NOT_RECORDED, RunRecord
from yawbench.studies.tables import Table
from yawbench.vocabulary.wheels import WHEEL_NAMES, WHEELS


def fmus_of(runs: Iterable[RunRecord]) -> Table:
    """Return the table of all FMUs in the runs."""
    by_fmu: dict[tuple[str, str], dict[str, None]] = {}
    for run in runs:
        for instance, fmu in run.fmus.items():
            by_fmu.setdefault((fmu.name or instance, fmu.sha256), {})[instance] = None
    ordered = sorted(by_fmu.items(), key=lambda item: (min(item[1]), item[0][0]))
    rows = [(name, ", ".join(instances), sha256) for (name, sha256), instances in ordered]
    return Table("", ["FMU", "as", "SHA-256"], [*rows])


def programs_of(runs: Iterable[RunRecord]) -> dict[str, str]:
    """Return the versions of the programs that made the runs."""
    by_program: dict[str, dict[str, None]] = {}
    for run in runs:
        for name, version in run.versions.items():
            by_program.setdefault(name, {})[str(version)] = None
    return {name: " and ".join(several) for name, several in by_program.items()}


@dataclass
class PageParameter:
    """A parameter with its values in all runs of a study."""

    name: str
    meaning: str
    unit: str
    default: ValueSource  # of the FMU's default
    stated: ValueSource | None = None  # of the value in the scenario or vehicle file
    set_by_study: bool = False
    values: dict[str, None] = field(default_factory=dict)  # as text, each once

    @property
    def origin(self) -> ValueSource:
        """The provenance of the value that applies where the study does not override it."""
        return self.stated or self.default


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
            row.stated = row.stated or origin


def groups_of(runs: Sequence[tuple[RunRecord, Plan]]) -> list[ParameterGroup]:
    """Return all parameters of runs: the vehicles', those of each instance's FMUs, constants.

    Args:
        runs: the record of each run, and its plan, whose FMUs describe the variables.
    """
    vehicles: dict[str, ParameterGroup] = {}
    units: dict[tuple[str, str], ParameterGroup] = {}
    constants = ParameterGroup("Constant inputs", "driven by no instance")
    order: dict[str, None] = {}
    for record, plan in runs:
        by_name = {instance.name: instance for instance in plan.instances if instance.name in record.fmus}
        instances = record.scenario.get("units", {})
        for name in [name for name in instances if name in by_name]:
            order[name] = None
            instance, fmu = by_name[name], record.fmus[name]
            own = units.setdefault(
                (name, fmu.name), ParameterGroup(f"{name}: {fmu.name}", instance.fmu.description)
            )
            values = fmu.defaults | fmu.parameters
            own_names = instances[name].get("parameters", {})
            of_vehicle = record.scenario.get("vehicle_parameters", {}).keys() - own_names
            for variable in instance.fmu.of("parameter"):
                if variable.name not in values:
                    continue
                group = _vehicle_group(vehicles, record) if variable.name in of_vehicle else own
                default = _default(record, instance, variable)
                value, source = text_of(values[variable.name]), record.source(name, variable.name)
                group.note(variable.name, variable, variable.description, value, source, default)
            _constants(constants, record, instance)
    ordered = [units[key] for name in order for key in units if key[0] == name]
    return [group for group in (*vehicles.values(), *ordered, constants) if group.parameters]


def _default(record: RunRecord, instance: Instance, variable: Variable) -> ValueSource:
    """Return the source of a variable's default, which only the FMU of the run knows."""
    same = record.fmus[instance.name].sha256 == instance.fmu.sha256
    return ValueSource.parse(variable.source) if same else NOT_RECORDED


def _vehicle_group(vehicles: dict[str, ParameterGroup], record: RunRecord) -> ParameterGroup:
    """Return the group of a run's vehicle file."""
    scenario = record.scenario
    file = Path(os.path.normpath(Path(record.scenario_file).parent / str(scenario.get("vehicle", ""))))
    title, source = (
        scenario.get("vehicle_title") or file.stem,
        scenario.get("vehicle_source", NOT_RECORDED.says),
    )
    return vehicles.setdefault(str(file), ParameterGroup(f"The car: {title}", f"{file.name}; {source}"))


def _constants(group: ParameterGroup, record: RunRecord, instance: Instance) -> None:
    """Add the constants of an instance; four equal wheels become one name that ends with `*`."""
    fmu = record.fmus[instance.name]
    texts = {name: text_of(value) for name, value in fmu.constants.items()}
    texts |= {name: f"{series.file}: {series.column}" for name, series in fmu.series.items()}
    alike: dict[str, list[str]] = {}
    for name in dict.fromkeys((*instance.constants, *instance.fmu.variables)):
        if name in texts:
            alike.setdefault(texts[name], []).append(name)
    for value_text, names in alike.items():
        for name in fold(names):
            first = name.removesuffix("*") + WHEELS[0] if name.endswith("*") else name
            variable = instance.fmu.variables[first]
            meaning = variable.description
            if first != name:
                meaning = meaning.removesuffix(f", {WHEEL_NAMES[WHEELS[0]]}")
            source, default = record.source(instance.name, first), _default(record, instance, variable)
            group.note(f"{instance.name}.{name}", variable, meaning, value_text, source, default)


def text_of(value: Value | None) -> str:
    """Return a value as written in a scenario file, numbers with six digits."""
    if isinstance(value, bool):
        return str(value).lower()
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def count_kinds(groups: Iterable[ParameterGroup]) -> dict[str, int]:
    """Return the number of parameters by kind of provenance."""
    kinds = Counter(parameter.origin.kind for group in groups for parameter in group.parameters.values())
    return {kind: kinds[kind] for kind in (PAPER, ERRATUM, CHOSEN, LITERATURE, NEUTRAL) if kind in kinds}
