"""`yawbench plot`: draw figures of recorded results, or of a scenario's run."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated

import typer

from .options import CHANGES, MAKING, Wishes, takes
from .recorded import Labels, Sources

Panels = Annotated[
    list[str] | None,
    typer.Option(
        "--panel",
        metavar="NAME",
        help="A signal (yaw_rate, plant.roll_angle, wheel_torque_*), its error (sideslip_error), one over "
        "another (yaw_rate(sideslip)) or path; repeatable. Default: all the papers draw.",
    ),
]


@takes(*CHANGES, *MAKING)
def plot(sources: Sources, wishes: Wishes, label: Labels = None, panel: Panels = None) -> None:
    """Draw runs, one or several overlaid.

    Figures are written as SVG and PNG. A scenario is run first if its results (those of `yawbench
    run` without --out) are missing or were made from another scenario or FMU. Without --out, the
    figure of one run goes into its folder, that of several into the folder that holds them all.
    """
    from ..experiments.compare import FIGURES
    from ..figures.panels import Run, check_panels, shown_by
    from ..figures.plots import OVERVIEW, draw
    from ..figures.style import save
    from ..results.read import load_results
    from .batch import say
    from .recorded import folder_of_all, labels_of, recorded

    folders = recorded(sources, wishes)
    labels = labels_of(folders, label)
    runs = [Run(name, load_results(folder, thin=True)) for name, folder in zip(labels, folders, strict=True)]
    check_panels(runs, panel or ())
    figures: dict[str, Sequence[str]] = {"overview": panel or OVERVIEW}
    if len(runs) > 1 and not panel:
        figures = {name: panels for name, panels in FIGURES.items() if shown_by(runs, panels)}
    for name, panels in figures.items():
        paths = save(draw(runs, panels), (wishes.out or folder_of_all(folders)) / name)
        say(f"{paths[0]}, {paths[1].name}")
