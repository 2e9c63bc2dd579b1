"""`yawbench tyre`: characteristics of a tyre."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from yawbench.commands.options import RunOptions, takes
from yawbench.commands.output import save_figure
from yawbench.commands.terminal_progress import say

TyreAction = Annotated[
    Literal["show"], typer.Argument(help="show: draw forces, moments, stiffnesses and relaxation lengths.")
]
TyreSource = Annotated[
    str,
    typer.Argument(metavar="FILE|FMU", help="Tyre property file (.tir), or name or path of a tyre FMU."),
]
TyreOutput = Annotated[
    Path | None,
    typer.Option(
        "--out",
        metavar="FILE",
        help="Figure to write, as .svg and .png. Default: results/tyres/<name>.",
    ),
]
TyreFriction = Annotated[float, typer.Option(min=0.0, help="Friction coefficient of the road.")]


@takes("fmus", "no_build")
def tyre(
    action: TyreAction,
    source: TyreSource,
    options: RunOptions,
    out: TyreOutput = None,
    friction: TyreFriction = 1.0,
) -> None:
    """Show the characteristics of a tyre.

    Steps the tyre FMU and draws a figure: lateral force and aligning moment over slip angle and
    longitudinal force over slip at four loads, forces in combined slip at five slip angles, stiffnesses
    and relaxation lengths over load.
    """
    from yawbench.orchestrator.results.folder_names import below_results
    from yawbench.tyre_stand import draw_tyre, put_on_stand

    stand = put_on_stand(source, friction=friction, fmus=options.fmus, build=options.build)
    name, fmu = Path(source).name, stand.instance.fmu
    kind, side = "", ""
    if file := stand.plan.scenario.get("tyre_files", {}).get("front"):
        kind, side = f", {file['kind']}", f", {file['side'].lower()} side"
        for warning in file["warnings"]:
            say(f"warning: {warning}")
    note = f"front left wheel, friction {friction:g}, no camber · {fmu.name} ({fmu.sha256[:8]})"
    default = below_results("tyres", Path(source).stem)
    save_figure(draw_tyre(stand, f"{name}{kind}{side}", note), out, default)
