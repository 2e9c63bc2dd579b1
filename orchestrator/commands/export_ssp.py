"""`yawbench export-ssp`: a scenario as an archive that other programs can run."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from .batch import say
from .options import CHANGES, ScenarioFile, Wishes, takes
from .planning import plan_of_scenario

Archive = Annotated[
    Path | None, typer.Option("--out", metavar="FILE", help="The archive; default: <scenario>.ssp, here.")
]


Standard = Annotated[Literal["1.0", "2.0"], typer.Option("--standard", help="Version of SSP.")]
For = Annotated[
    Literal["all", "omsimulator"],
    typer.Option("--for", help="Leave out what OMSimulator refuses, and say what that is."),
]


@takes(*CHANGES, "fmus", "no_build")
def export_ssp(
    scenario: ScenarioFile,
    wishes: Wishes,
    out: Archive = None,
    for_: For = "all",
    standard: Standard = "1.0",
) -> None:
    """Write a scenario and its FMUs as an SSP archive.

    SSP: System Structure and Parameterization. `yawbench run` reads it back and gives the same numbers.
    """
    from ..interop.omsimulator import for_omsimulator
    from ..interop.ssp_write import write_ssp
    from ..titles import faults_of

    plan = plan_of_scenario(scenario, wishes)
    notes = list(plan.notes)
    if plan.faults:
        notes.append(f"faults are not part of the archive: {faults_of(plan)}")
    if for_ == "omsimulator":
        plan, more = for_omsimulator(plan)
        notes += more
    for note in notes:
        say(f"note: {note}")
    path = out or Path(f"{scenario.stem}.ssp")
    write_ssp(plan, path, standard, named=out is not None)
    say(f"{path}: {len(plan.units)} units, {len(plan.wires)} connections")
