"""Decides whether recorded results are up to date: what a run of the plan would produce now.

`key_of` hashes everything that the numbers of a run depend on; results are up to date if their key is that
of the plan.
"""

from __future__ import annotations

import hashlib
import json
from dataclasses import astuple
from datetime import datetime, timezone
from pathlib import Path
from typing import Any

from ..cache import OF_RESULTS, sources_hash
from ..checksums import checksum
from ..errors import ResultsError
from ..plan import Plan
from .folder import COMPLETED, RUN_FILE, is_dead
from .plan_record import PROGRAMS, connections_of, run_record, units_of, version_of
from .read import load_results
from .run_record import FmuRecord, RunRecord, load_record


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
        "wires": [wire.model_dump(by_alias=True, exclude_unset=True) for wire in connections_of(plan)],
        "faults": [list(astuple(signal)) for signal in plan.faults],
        "record": plan.record,
        "time": [str(plan.start), str(plan.step), plan.n_steps],
        "algorithm": plan.algorithm,
        "also": also,
    }
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()[:32]


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
    if recorded.status != COMPLETED:
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
    """Return a sentence on what has been changed in a folder since its run wrote it, "" if nothing has."""
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
    planned = run_record(plan, status=COMPLETED, started=datetime.now(timezone.utc))
    for key, sentence in COMPARED.items():
        if getattr(recorded, key) != getattr(planned, key):
            return sentence
    for unit, fmu in planned.fmus.items():
        known = recorded.fmus.get(unit, FmuRecord())
        if known.sha256 != fmu.sha256:
            return f"{unit}: another {fmu.name}.fmu"
        for key, words in _OF_UNIT.items():
            if getattr(known, key) != getattr(fmu, key):
                return f"{unit}: other {words}"
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
