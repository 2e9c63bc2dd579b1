"""`yawbench export-ssp`: a scenario as an archive that other programs can run."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from .options import Fmus, NoBuild, ScenarioFile, Set, Swap
from .planning import plan_of_scenario

Archive = Annotated[
    Path | None, typer.Option("--out", metavar="FILE", help="The archive; default: <scenario>.ssp, here.")
]


def export_ssp(
    scenario: ScenarioFile,
    swap: Swap = None,
    set_: Set = None,
    out: Archive = None,
    fmus: Fmus = None,
    no_build: NoBuild = False,
) -> None:
    """Write a scenario and its FMUs as an SSP 1.0 archive.

    SSP: System Structure and Parameterization. `yawbench run` reads it back and gives the same numbers.
    """
    from ..interop.ssp_write import write_ssp

    plan = plan_of_scenario(scenario, swap, set_, fmus=fmus, build=not no_build)
    for note in plan.notes:
        print(f"note: {note}", file=sys.stderr)
    path = out or Path(f"{scenario.stem}.ssp")
    write_ssp(plan, path)
    print(f"{path}: {len(plan.units)} units, {len(plan.wires)} connections", file=sys.stderr)
