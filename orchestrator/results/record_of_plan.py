"""The run record of a plan: FMUs, values and their sources, and versions, as known when a run starts."""

from __future__ import annotations

import math
import platform
from collections.abc import Hashable, Mapping
from dataclasses import asdict
from datetime import datetime
from functools import cache, lru_cache
from importlib.metadata import PackageNotFoundError, distribution
from typing import Any, cast

from yawbench.fmus.archive import runs_as
from yawbench.fmus.fmu import Fmu, Variable
from yawbench.foundation.cache import OF_RESULTS, sources_hash

from ..plan import DEFAULT, InputSeries, Instance, Plan, ValueSource, Wire
from ..signal_names import SignalName
from .run_record import (
    ConnectionRecord,
    FaultRecord,
    FmuRecord,
    OverrideRecord,
    RecordedScenario,
    RunRecord,
    RunStatus,
    SeriesRecord,
    SourceRecord,
)

PROGRAMS = ("yawbench", "fmpy", "pythonfmu", "numpy")
"""Packages that influence the numbers."""


def run_record(plan: Plan, *, status: RunStatus, started: datetime) -> RunRecord:
    """Return the record of a run as known at its start: no wall time, error, rows or warnings yet.

    Args:
        status: of the run at that time.
        started: when the run began, with a time zone.
    """
    instances = {instance.name: instance for instance in plan.instances}
    sources: dict[ValueSource, int] = {}
    record = RunRecord(
        status=status,
        error=None,
        title=plan.title,
        started=started.isoformat(timespec="seconds"),
        wall_time=0.0,
        rows=0,
        algorithm=plan.algorithm,
        step_size=float(plan.step),
        start_time=plan.time(0),
        stop_time=plan.time(plan.n_steps),
        ended=None,
        evaluation_order=list(instances),
        units=units_of(plan),
        texts=[column for column, variable in recorded_variables(plan).items() if variable.type == "String"],
        fmus={name: _fmu(instance, plan, sources) for name, instance in instances.items()},
        sources=[*map(_source, sources)],
        changes=[OverrideRecord.model_validate(change.record) for change in plan.changes],
        connections=connections_of(plan),
        scenario=cast(RecordedScenario, plan.scenario),
        diagnostics=[*plan.diagnostics],
        versions=versions(),
    )
    if plan.faults:
        record.faults = faults_of(plan)
    return record


@lru_cache(4096)
def _source(source: ValueSource) -> SourceRecord:
    return SourceRecord(**asdict(source))


def recorded_variables(plan: Plan) -> dict[str, Variable]:
    """Return the variables that a plan records, by the names of their columns and in this order."""
    variables = {instance.name: instance.fmu.variables for instance in plan.instances}
    return {str(name): variables[name.instance][name.variable] for name in plan.record}


def units_of(plan: Plan) -> dict[str, str | None]:
    """Return the units of time and of all recorded columns."""
    return {"time": "s", **{column: variable.unit for column, variable in recorded_variables(plan).items()}}


def connections_of(plan: Plan) -> list[ConnectionRecord]:
    """Return the wires of a plan: source, target, and the conversion if there is one."""
    return [*WIRES.of(plan)[0]]


def faults_of(plan: Plan) -> list[FaultRecord]:
    """Return the faults of a plan as the scenario states them, with their times [s] and variables."""
    records: dict[tuple[str, str], FaultRecord] = {}
    for signal in plan.faults:
        location, says = str(signal.fault.on), str(signal.fault)
        begin, end = (t if math.isfinite(t) else None for t in (signal.fault.begin, signal.fault.end))
        new = FaultRecord(on=location, fault=says, begin=begin, until=end, at=[])
        records.setdefault((location, says), new).at.append(f"{signal.instance}.{signal.variable}")
    return list(records.values())


def _connection(wire: Wire, instances: Mapping[str, Instance]) -> ConnectionRecord:
    ends = ConnectionRecord(
        source=SignalName(wire.source, wire.output), target=SignalName(wire.target, wire.input)
    )
    if wire.converts:
        ends.gain, ends.offset = wire.gain, wire.offset
        if unit := instances[wire.target].fmu.variables[wire.input].unit:
            ends.unit = unit
    if wire.delayed:
        ends.delay = "1 step"
    return ends


def _fmu(instance: Instance, plan: Plan, sources: dict[ValueSource, int]) -> FmuRecord:
    """Return the record of an instance; adds the sources of its values, with their index."""
    fmu = instance.fmu
    how = fmu.runs_as or runs_as(fmu.path)
    origins = {name: given.origin for name, given in instance.given.items() if given.origin != DEFAULT}
    sourced = {name: origin.source for name, origin in origins.items() if origin.source is not None}
    record = FmuRecord(
        name=fmu.name,
        role=instance.role,
        file=fmu.path.name,
        sha256=fmu.sha256,
        guid=fmu.guid,
        generation_tool=fmu.generation_tool,
        fmi_version=f"{fmu.fmi}.0",
        built=None if fmu.built is None else asdict(fmu.built),
        runs_as=str(how) if how else None,
        step_size=float(instance.period * plan.step),
        tolerance=instance.tolerance or fmu.tolerance,
        parameters=dict(instance.parameters),
        origins={name: str(origin) for name, origin in origins.items()},
        sources={name: sources.setdefault(source, len(sources)) for name, source in sourced.items()},
        defaults={v.name: v.start for v in fmu.of("parameter") if v.name not in instance.parameters},
        constants={name: value for name, value in instance.constants.items() if name not in instance.series},
    )
    if instance.series:
        record.series = {name: _series(series) for name, series in instance.series.items()}
    return record


def _series(series: InputSeries) -> SeriesRecord:
    how = "held" if series.held else "linear"
    return SeriesRecord(file=series.file, column=series.column, interpolation=how, sha256=series.sha256)


def versions() -> dict[str, str]:
    """Return the versions of everything that influences the numbers."""
    return {
        "python": platform.python_version(),
        **{package: version_of(package) for package in PROGRAMS},
        "orchestrator": f"sources {sources_hash(OF_RESULTS)}",
        "platform": f"{platform.system()} {platform.release()} {platform.machine()}",
    }


@cache
def version_of(package: str) -> str:
    """Return the version of an installed package, else "unknown".

    Only its line is read: `importlib.metadata.version` parses the whole file, a millisecond in every process.
    """
    try:
        installed = distribution(package)
    except PackageNotFoundError:
        return "unknown"
    metadata = installed.read_text("METADATA") or installed.read_text("PKG-INFO") or ""
    line = next((line for line in metadata.splitlines() if line.startswith("Version:")), "")
    return line.removeprefix("Version:").strip() or "unknown"


class DescribedWires:
    """The wires of plans as in records and in keys, kept for further plans, which often have the same."""

    MOST = 100
    """Largest number of networks that are kept. Chosen: more than a study has, little memory."""

    def __init__(self) -> None:
        self._known: dict[Hashable, tuple[list[ConnectionRecord], list[dict[str, Any]]]] = {}
        self._fmus: list[list[Fmu]] = []  # of the plans, so that no other object gets their numbers

    def of(self, plan: Plan) -> tuple[list[ConnectionRecord], list[dict[str, Any]]]:
        fmus = [instance.fmu for instance in plan.instances]
        key = plan.wires, *map(id, fmus)
        if key not in self._known:
            if len(self._known) == self.MOST:
                self._known.clear()
                self._fmus.clear()
            instances = {instance.name: instance for instance in plan.instances}
            records = [_connection(wire, instances) for wire in plan.wires]
            fields = [wire.model_dump(by_alias=True, exclude_unset=True) for wire in records]
            self._known[key] = records, fields
            self._fmus.append(fmus)
        return self._known[key]


WIRES = DescribedWires()
