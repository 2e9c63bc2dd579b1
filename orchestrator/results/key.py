"""What tells two runs apart: a hash of everything that their numbers follow from."""

from __future__ import annotations

import hashlib
import json
from dataclasses import astuple
from typing import Any

from ..plan import Plan
from ..sources import OF_RESULTS, sources_hash
from .run_record import PROGRAMS, connections_of, version_of


def key_of(plan: Plan, also: Any = None) -> str:
    """Return the key of the run that a plan describes; runs of one key are one run.

    It is made of the content of its FMUs, all parameters and constants, wires, faults, the time grid, the
    algorithm, what is recorded under which title, and the program's versions and code.

    Args:
        plan: of the run.
        also: what else the numbers follow from, such as the metrics made of the results.
    """
    content = {
        "versions": [*map(version_of, PROGRAMS), sources_hash(OF_RESULTS)],
        "title": plan.title,
        "units": [
            [u.name, u.fmu.sha256, u.period, u.tolerance, u.parameters, u.constants] for u in plan.units
        ],
        "series": [
            [u.name, name, s.sha256, s.column, s.held] for u in plan.units for name, s in u.series.items()
        ],
        "wires": connections_of(plan),
        "faults": [list(astuple(fault)) for fault in plan.faults],
        "record": plan.record,
        "time": [str(plan.start), str(plan.step), plan.n_steps],
        "algorithm": plan.algorithm,
        "also": also,
    }
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()[:32]
