"""What run.json says about a run: everything needed to repeat and to judge it."""

from __future__ import annotations

import math
import platform
from collections.abc import Mapping
from dataclasses import asdict
from datetime import datetime
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from typing import Any

from ..fmu.native import runs_as
from ..plan import DEFAULT, Plan, Series, Unit, Wire
from ..sources import OF_RESULTS, sources_hash

PROGRAMS = ("yawbench", "fmpy", "pythonfmu", "numpy")
"""Packages that have a say in the numbers."""


def run_record(plan: Plan, *, status: str, started: datetime) -> dict[str, Any]:
    """Return the record of a run without what comes later: wall time, error, rows and warnings.

    Args:
        status: "completed", "failed" or "interrupted".
        started: when the run began, with a time zone.
    """
    units = {unit.name: unit for unit in plan.units}
    columns = {f"{u}.{name}": units[u].fmu.variables[name].unit for u, name in plan.record}
    return {
        "status": status,
        "error": None,
        "title": plan.title,
        "started": started.isoformat(timespec="seconds"),
        "wall_time": 0.0,
        "rows": 0,
        "algorithm": plan.algorithm,
        "step_size": float(plan.step),
        "start_time": plan.time(0),
        "stop_time": plan.time(plan.n_steps),
        "ended": None,
        "evaluation_order": list(units),
        "units": {"time": "s", **columns},
        "texts": [f"{u}.{name}" for u, name in plan.record if units[u].fmu.variables[name].type == "String"],
        "fmus": {name: _fmu(unit, plan) for name, unit in units.items()},
        "changes": [asdict(change) | {"value": change.plain} for change in plan.changes],
        "connections": connections_of(plan),
        **({"faults": faults_of(plan)} if plan.faults else {}),
        "scenario": plan.scenario,
        "notes": list(plan.notes),
        "versions": versions(),
    }


def connections_of(plan: Plan) -> list[dict[str, Any]]:
    """Return the wires of a plan: from, to, and where a number is converted how and into which unit."""
    units = {unit.name: unit for unit in plan.units}
    return [_connection(wire, units) for wire in plan.wires]


def faults_of(plan: Plan) -> list[dict[str, Any]]:
    """Return the faults of a plan as they are written, each with its time [s] and all that it acts on."""
    found: dict[tuple[str, str], dict[str, Any]] = {}
    for fault in plan.faults:
        begin = None if fault.begin == -math.inf else fault.begin
        end = None if fault.end == math.inf else fault.end
        new: dict[str, Any] = {"on": fault.place, "fault": fault.says, "from": begin, "until": end, "at": []}
        found.setdefault((fault.place, fault.says), new)["at"].append(f"{fault.unit}.{fault.variable}")
    return list(found.values())


def _connection(wire: Wire, units: Mapping[str, Unit]) -> dict[str, Any]:
    ends = {"from": f"{wire.source}.{wire.output}", "to": f"{wire.target}.{wire.input}"}
    if not wire.converts:
        return ends
    unit = units[wire.target].fmu.variables[wire.input].unit
    return ends | {"gain": wire.gain, "offset": wire.offset} | ({"unit": unit} if unit else {})


def _fmu(unit: Unit, plan: Plan) -> dict[str, Any]:
    fmu = unit.fmu
    return {
        "name": fmu.name,
        "file": fmu.path.name,
        "sha256": fmu.sha256,
        "guid": fmu.guid,
        "generation_tool": fmu.generation_tool,
        "fmi_version": f"{fmu.fmi}.0",
        "built": None if fmu.built is None else asdict(fmu.built),
        "runs_as": runs_as(fmu.path),
        "step_size": float(unit.period * plan.step),
        "tolerance": unit.tolerance or fmu.tolerance,
        "parameters": dict(unit.parameters),
        "origins": {name: str(origin) for name, origin in unit.origins.items() if origin != DEFAULT},
        # what the FMU has for the others
        "defaults": {v.name: v.start for v in fmu.of("parameter") if v.name not in unit.parameters},
        "constants": {name: value for name, value in unit.constants.items() if name not in unit.series},
    } | ({"series": {name: _series(one) for name, one in unit.series.items()}} if unit.series else {})


def _series(series: Series) -> dict[str, Any]:
    how = "held" if series.held else "linear"
    return {"file": series.file, "column": series.column, "interpolation": how, "sha256": series.sha256}


def versions() -> dict[str, str]:
    """Return the versions of all that has a say in the numbers."""
    return {
        "python": platform.python_version(),
        **{package: version_of(package) for package in PROGRAMS},
        "orchestrator": f"sources {sources_hash(OF_RESULTS)}",
        "platform": f"{platform.system()} {platform.release()} {platform.machine()}",
    }


@cache
def version_of(package: str) -> str:
    """Return the version of an installed package, "unknown" if it is none; the answer costs a millisecond."""
    try:
        return version(package)
    except PackageNotFoundError:
        return "unknown"
