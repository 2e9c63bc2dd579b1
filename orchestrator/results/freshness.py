"""Freshness: whether recorded results are those of a plan.

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

from yawbench.fmus.fmu import Fmu
from yawbench.foundation.cache import OF_RESULTS, sources_hash
from yawbench.foundation.errors import ResultsError

from ..plan import Plan
from .record_of_plan import PROGRAMS, WIRES, run_record, version_of
from .run_folder import is_dead, load_record
from .run_record import RUN_FILE, FmuRecord, RunRecord, RunStatus


def key_of(plan: Plan, also: Any = None) -> str:
    """Return the key of the run that a plan describes; runs with the same key give the same results.

    It is a hash of the FMUs (`_made_of`), all parameters and constants, wires, faults, the time grid, the
    algorithm, the recorded columns, the title, and the program's versions and code.

    Args:
        plan: plan of the run.
        also: other data that the numbers depend on, such as the metrics computed from the results.
    """
    content = {
        "versions": [*map(version_of, PROGRAMS), sources_hash(OF_RESULTS)],
        "title": plan.title,
        "units": [
            [u.name, _made_of(u.fmu), u.period, u.tolerance, u.parameters, u.constants]
            for u in plan.instances
        ],
        "series": [
            [u.name, name, s.sha256, s.column, s.held] for u in plan.instances for name, s in u.series.items()
        ],
        "wires": WIRES.of(plan)[1],
        "faults": [list(astuple(signal)) for signal in plan.faults],
        "record": plan.record,
        "time": [str(plan.start), str(plan.step), plan.n_steps],
        "algorithm": plan.algorithm,
        "also": also,
    }
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()[:32]


def _made_of(fmu: Fmu) -> str:
    """Return a hash of what an FMU computes by: of its sources if it is built of them, else of the archive.

    A component that was built in a hurry runs in Python, and later as native code that was compared with it:
    its archive is another then, but neither its sources nor its results. That it is built of them is what its
    stamp says: an archive that was edited since, with its stamp kept, passes for one that was not.
    """
    if fmu.built is None or not fmu.built.current:
        return fmu.sha256
    return fmu.built.key.partition("-")[0]  # see `BuildStamp.is_unfinished`


OF_RUN = (
    *("algorithm", "step_size", "start_time", "stop_time", "evaluation_order", "connections", "faults"),
    *("units", "title"),
)
OF_INSTANCE = ("parameters", "constants", "series", "step_size", "tolerance")
"""Keys of a record, and of an instance in it, that say what differs from a plan."""


def staleness(plan: Plan, folder: Path) -> str | None:
    """Return why the results in a folder are not those of the plan; None if their keys are equal."""
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
    if results.stat().st_size != recorded.size:
        return "the results were changed or cut off"
    return None if recorded.key == key_of(plan) else _reason(plan, recorded)


def _reason(plan: Plan, recorded: RunRecord) -> str:
    """Return in words why the key of a record differs from that of a plan."""
    planned = run_record(plan, status=RunStatus.COMPLETED, started=datetime.now(timezone.utc))
    for key in OF_RUN:
        if getattr(recorded, key) != getattr(planned, key):
            return f"{key.replace('_', ' ')}: changed"
    for instance, fmu in planned.fmus.items():
        known = recorded.fmus.get(instance, FmuRecord())
        for key in OF_INSTANCE if known.name == fmu.name else ():
            if getattr(known, key) != getattr(fmu, key):
                return f"{instance}: {key.replace('_', ' ')} changed"
        if known.sha256 != fmu.sha256:
            return f"{instance}: another {fmu.name}.fmu"
    for program in (*PROGRAMS, "orchestrator"):
        version, earlier = planned.versions[program], recorded.versions.get(program, "an unknown one")
        if version != earlier:
            return f"{program} {version} in place of {earlier}"
    return "its record is of an earlier version"
