"""`yawbench tyre`: what a tyre property file or a tyre FMU is like."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from .options import Wishes, takes

What = Annotated[
    Literal["show"], typer.Argument(help="show: draw its forces, moments, stiffnesses, relaxation.")
]
Source = Annotated[
    str,
    typer.Argument(metavar="FILE|FMU", help="Tyre property file (.tir), or a tyre FMU: its name or path."),
]
Output = Annotated[
    Path | None,
    typer.Option(
        metavar="FILE",
        help="The figure, written as .svg and .png; default: results/tyres/<name>.",
    ),
]
Friction = Annotated[float, typer.Option(min=0.0, help="Coefficient of the road.")]


@takes("fmus", "no_build")
def tyre(
    action: What, source: Source, wishes: Wishes, output: Output = None, friction: Friction = 1.0
) -> None:
    """Show what a tyre is like, by stepping its FMU.

    One figure: lateral force and aligning moment over slip angle and longitudinal force over slip at four
    loads, forces in combined slip at five slip angles, stiffnesses and relaxation lengths over load.
    """
    from ..results.naming import below_results
    from ..tyres.stand import put_on_stand
    from ..tyres.tyre_drawing import draw_tyre
    from .batch import save_figure, say

    stand = put_on_stand(source, friction=friction, fmus=wishes.fmus, build=wishes.build)
    name, fmu = Path(source).name, stand.unit.fmu
    kind, side = "", ""
    if file := stand.plan.scenario.get("tyre_files", {}).get("front"):
        kind, side = f", {file['kind']}", f", {file['side'].lower()} side"
        for warning in file["warnings"]:
            say(f"warning: {warning}")
    note = f"front left wheel, friction {friction:g}, no camber · {fmu.name} ({fmu.sha256[:8]})"
    default = below_results("tyres", Path(source).stem)
    save_figure(draw_tyre(stand, f"{name}{kind}{side}", note), output, default)
