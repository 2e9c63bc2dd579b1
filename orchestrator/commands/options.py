"""Arguments and options that several subcommands share."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

ScenarioFile = Annotated[
    Path, typer.Argument(help="Scenario file (YAML), or SSP archive.", metavar="SCENARIO")
]
Swap = Annotated[
    list[str] | None,
    typer.Option("--swap", metavar="UNIT=FMU", help="Replace a unit's FMU: a name or a path. Repeatable."),
]
Set = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="UNIT.PARAMETER=VALUE",
        help="Set a parameter of a unit; also vehicle.NAME, inputs.NAME, UNIT.step_size, stop_time, "
        "step_size, algorithm. Repeatable.",
    ),
]
Out = Annotated[Path | None, typer.Option("--out", metavar="DIR", help="Folder for the results.")]
Fmus = Annotated[
    Path | None,
    typer.Option("--fmus", metavar="DIR", help="Folder of the FMUs; default: the nearest fmus/ folder."),
]
Format = Annotated[
    str,
    typer.Option(
        "--format",
        metavar="FORMAT",
        help="Of the results: csv; parquet or mf4 (ASAM MDF 4), smaller and with units.",
    ),
]
