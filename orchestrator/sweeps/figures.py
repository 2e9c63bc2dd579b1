"""Figures of a sweep: curves, maps, and how far an axis may go."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from ..figures.style import RC, ROW, frame, literal
from ..titles import changed
from .drawing import Drawing
from .limit_drawing import Limits
from .metric_drawing import Curves, Map
from .schema import FigureSpec
from .table import Swept

if TYPE_CHECKING:
    from matplotlib.figure import Figure

KINDS: dict[str, type[Drawing]] = {"curve": Curves, "map": Map, "limit": Limits}
PANELS_IN_A_ROW = 3


def draw(swept: Swept, spec: FigureSpec) -> Figure:
    """Return a figure of a sweep.

    Raises:
        ResultsError: there is nothing to draw.
    """
    import matplotlib
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    drawing = KINDS[spec.kind](swept, spec)
    panels = drawing.panels()
    columns = min(len(panels), PANELS_IN_A_ROW)
    rows = math.ceil(len(panels) / columns)
    height = rows * (1.7 if columns == 1 else 1.4) * ROW
    with matplotlib.rc_context(RC):
        figure = Figure(layout="constrained")
        FigureCanvasAgg(figure)
        grid = figure.subplots(rows, columns, squeeze=False, sharex=True, sharey=True)
        drawn = list(grid.flat[: len(panels)])
        for axes in grid.flat[len(panels) :]:
            axes.remove()
        for axes, (heading, runs) in zip(drawn, panels, strict=True):
            drawing.fill(axes, runs)
            axes.set_title(literal(heading))
        for k, axes in enumerate(drawn):
            if k + columns >= len(drawn):  # none stands below
                axes.set_xlabel(literal(drawing.label(spec.x)))
                axes.tick_params(labelbottom=True)
        drawing.finish(figure, drawn, drawn[::columns])
        options = changed(swept.planned.sweep.by_options)
        frame(figure, height, drawing.handles(), spec.title or drawing.what, _provenance(swept), options)
    return figure


def _provenance(swept: Swept) -> str:
    planned, spec = swept.planned, swept.planned.sweep.spec
    fmus = sorted(f"{fmu.name} {digest[:8]}" for digest, fmu in planned.fmus.items())
    parts = [f"{len(planned.runs)} runs of {spec.scenario}", f"FMUs: {', '.join(fmus)}"]
    parts += [f"changed in all runs: {words}"] if (words := changed(planned.sweep.for_all)) else []
    return " · ".join([spec.source, *parts] if spec.source else parts)
