"""The run record made from a plan, and freshness: whether recorded results are those of a plan.

`run_record` holds FMUs, values and their sources, and versions, as known when a run starts. `key_of` hashes
everything that the numbers of a run depend on; results are up to date if their key is that of the plan.
"""

from __future__ import annotations

import hashlib
import json
import math
import platform
from collections.abc import Hashable, Mapping
from dataclasses import asdict, astuple
from datetime import datetime, timezone
from functools import cache, lru_cache
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path
from typing import Any, cast

from yawbench.fmus.archive import runs_as
from yawbench.fmus.fmu import Fmu, Variable
from yawbench.foundation.cache import OF_RESULTS, checksum, sources_hash
from yawbench.foundation.errors import ResultsError

from ..plan import DEFAULT, InputSeries, Instance, Plan, ValueSource, Wire
from ..signal_names import SignalName
from .reader import load_results
from .run_folder import RUN_FILE, RunStatus, is_dead
from .run_record import (
    ConnectionRecord,
    DiagnosticRecord,
    FaultRecord,
    FmuRecord,
    OverrideRecord,
    RecordedScenario,
    RunRecord,
    SeriesRecord,
    SourceRecord,
    load_record,
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
        diagnostics=[*map(DiagnosticRecord.of, plan.diagnostics)],
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
    return [*_WIRES.of(plan)[0]]


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


def key_of(plan: Plan, also: Any = None) -> str:
    """Return the key of the run that a plan describes; runs with the same key give the same results.

    It is a hash of the content of the FMUs, all parameters and constants, wires, faults, the time grid, the
    algorithm, the recorded columns, the title, and the program's versions and code.

    Args:
        plan: plan of the run.
        also: other data that the numbers depend on, such as the metrics computed from the results.
    """
    content = {
        "versions": [*map(version_of, PROGRAMS), sources_hash(OF_RESULTS)],
        "title": plan.title,
        "units": [
            [u.name, u.fmu.sha256, u.period, u.tolerance, u.parameters, u.constants] for u in plan.instances
        ],
        "series": [
            [u.name, name, s.sha256, s.column, s.held] for u in plan.instances for name, s in u.series.items()
        ],
        "wires": _WIRES.of(plan)[1],
        "faults": [list(astuple(signal)) for signal in plan.faults],
        "record": plan.record,
        "time": [str(plan.start), str(plan.step), plan.n_steps],
        "algorithm": plan.algorithm,
        "also": also,
    }
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()[:32]


class _DescribedWires:
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


_WIRES = _DescribedWires()

COMPARED = {
    "algorithm": "the algorithm has changed",
    "step_size": "the communication step has changed",
    "start_time": "the start time has changed",
    "stop_time": "the stop time has changed",
    "evaluation_order": "the order of the instances has changed",
    "connections": "the wires have changed",
    "faults": "the faults have changed",
    "units": "the recorded signals have changed",
    "title": "the scenario has changed",
}
"""Key of the run record -> explanation if it differs from the plan."""
_OF_UNIT = {
    "parameters": "parameters",
    "constants": "constants",
    "series": "time series",
    "step_size": "step",
    "tolerance": "tolerance",
}


def staleness(plan: Plan, folder: Path) -> str | None:
    """Return why the results in a folder are not those of the plan; None if their keys are equal.

    Results without checksums, such as those of earlier versions, always count as out of date.
    """
    if not (folder / RUN_FILE).is_file():
        return "no results yet"
    try:
        recorded = load_record(folder)
    except ResultsError as error:
        return "the last run has died" if is_dead(folder) else str(error)
    if recorded.status is not RunStatus.COMPLETED:
        return "the run did not reach its end"
    results = folder / recorded.results
    if not results.is_file():
        return "the results are missing"
    if not _whole(results, recorded):
        return "the results were changed or cut off"
    if recorded.key != key_of(plan):
        return _reason(plan, recorded)
    if recorded.units != units_of(plan):
        return "the units of its record are not those of the FMUs"
    return None if recorded.has_checksums else "the record has no checksums"


def altered(folder: Path) -> str:
    """Return a sentence on changes in a folder since its run wrote it, "" if there are none."""
    if not (folder / RUN_FILE).is_file() or is_dead(folder):
        return ""
    try:
        recorded = load_record(folder)
        results = folder / recorded.results
        if results.is_file() and not _whole(results, recorded):
            return f"{results}: was changed or truncated"
    except ResultsError as error:
        return str(error)
    return "" if recorded.has_checksums else f"{folder / RUN_FILE}: has no checksums"


def _reason(plan: Plan, recorded: RunRecord) -> str:
    """Return in words why the key of a record differs from that of a plan."""
    planned = run_record(plan, status=RunStatus.COMPLETED, started=datetime.now(timezone.utc))
    for key, sentence in COMPARED.items():
        if getattr(recorded, key) != getattr(planned, key):
            return sentence
    for instance, fmu in planned.fmus.items():
        known = recorded.fmus.get(instance, FmuRecord())
        if known.sha256 != fmu.sha256:
            return f"{instance}: another {fmu.name}.fmu"
        for key, words in _OF_UNIT.items():
            if getattr(known, key) != getattr(fmu, key):
                return f"{instance}: other {words}"
    for program in (*PROGRAMS, "orchestrator"):
        version, earlier = planned.versions[program], recorded.versions.get(program, "an unknown one")
        if version != earlier:
            return f"{program} {version} in place of {earlier}"
    return "its record is of an earlier version"


def _whole(results: Path, recorded: RunRecord) -> bool:
    """Return whether a results file is unchanged since its run wrote it."""
    try:
        if recorded.checksum:
            return recorded.checksum == checksum(results)
        return load_results(results.parent).time.size >= recorded.rows
    except (OSError, ResultsError):
        return False
