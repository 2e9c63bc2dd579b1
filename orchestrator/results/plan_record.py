"""The run record as known when a run starts, from its plan: FMUs, values and their sources, versions."""

from __future__ import annotations

import math
import platform
from collections.abc import Mapping
from dataclasses import asdict
from datetime import datetime
from functools import cache
from importlib.metadata import PackageNotFoundError, version

from ..cache import OF_RESULTS, sources_hash
from ..fmu.binary import runs_as
from ..names import SignalName
from ..plan import DEFAULT, InputSeries, Instance, Plan, ValueSource, Wire
from .run_record import (
    ConnectionRecord,
    DiagnosticRecord,
    FaultRecord,
    FmuRecord,
    OverrideRecord,
    RunRecord,
    SeriesRecord,
    SourceRecord,
)

PROGRAMS = ("yawbench", "fmpy", "pythonfmu", "numpy")
"""Packages that influence the numbers."""


def run_record(plan: Plan, *, status: str, started: datetime) -> RunRecord:
    """Return the record of a run as known at its start: no wall time, error, rows or warnings yet.

    Args:
        status: "completed", "failed" or "interrupted".
        started: when the run began, with a time zone.
    """
    units = {unit.name: unit for unit in plan.instances}
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
        evaluation_order=list(units),
        units=units_of(plan),
        texts=[str(n) for n in plan.record if units[n.instance].fmu.variables[n.variable].type == "String"],
        fmus={name: _fmu(unit, plan, sources) for name, unit in units.items()},
        sources=[SourceRecord(**asdict(source)) for source in sources],
        changes=[OverrideRecord.model_validate(change.record) for change in plan.changes],
        connections=connections_of(plan),
        scenario=plan.scenario,
        diagnostics=[*map(DiagnosticRecord.of, plan.diagnostics)],
        versions=versions(),
    )
    if plan.faults:
        record.faults = faults_of(plan)
    return record


def units_of(plan: Plan) -> dict[str, str | None]:
    """Return the units of time and of all recorded columns."""
    units = {unit.name: unit for unit in plan.instances}
    columns = {str(one): units[one.instance].fmu.variables[one.variable].unit for one in plan.record}
    return {"time": "s", **columns}


def connections_of(plan: Plan) -> list[ConnectionRecord]:
    """Return the wires of a plan: source, target, and the conversion if there is one."""
    units = {unit.name: unit for unit in plan.instances}
    return [_connection(wire, units) for wire in plan.wires]


def faults_of(plan: Plan) -> list[FaultRecord]:
    """Return the faults of a plan as the scenario states them, with their times [s] and variables."""
    found: dict[tuple[str, str], FaultRecord] = {}
    for signal in plan.faults:
        place, says = str(signal.fault.on), str(signal.fault)
        begin, end = (t if math.isfinite(t) else None for t in (signal.fault.begin, signal.fault.end))
        new = FaultRecord(on=place, fault=says, begin=begin, until=end, at=[])
        found.setdefault((place, says), new).at.append(f"{signal.instance}.{signal.variable}")
    return list(found.values())


def _connection(wire: Wire, units: Mapping[str, Instance]) -> ConnectionRecord:
    ends = ConnectionRecord(
        source=SignalName(wire.source, wire.output), target=SignalName(wire.target, wire.input)
    )
    if wire.converts:
        ends.gain, ends.offset = wire.gain, wire.offset
        if unit := units[wire.target].fmu.variables[wire.input].unit:
            ends.unit = unit
    return ends


def _fmu(unit: Instance, plan: Plan, sources: dict[ValueSource, int]) -> FmuRecord:
    """Return the record of an instance; adds the sources of its values, with their index."""
    fmu = unit.fmu
    given = {name: origin.source for name, origin in unit.origins.items() if origin.source is not None}
    record = FmuRecord(
        name=fmu.name,
        role=unit.role,
        file=fmu.path.name,
        sha256=fmu.sha256,
        guid=fmu.guid,
        generation_tool=fmu.generation_tool,
        fmi_version=f"{fmu.fmi}.0",
        built=None if fmu.built is None else asdict(fmu.built),
        runs_as=runs_as(fmu.path),
        step_size=float(unit.period * plan.step),
        tolerance=unit.tolerance or fmu.tolerance,
        parameters=dict(unit.parameters),
        origins={name: str(origin) for name, origin in unit.origins.items() if origin != DEFAULT},
        sources={name: sources.setdefault(source, len(sources)) for name, source in given.items()},
        defaults={v.name: v.start for v in fmu.of("parameter") if v.name not in unit.parameters},
        constants={name: value for name, value in unit.constants.items() if name not in unit.series},
    )
    if unit.series:
        record.series = {name: _series(series) for name, series in unit.series.items()}
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
    """Return the version of an installed package, else "unknown". Cached: a lookup takes a millisecond."""
    try:
        return version(package)
    except PackageNotFoundError:
        return "unknown"
