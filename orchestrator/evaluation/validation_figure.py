"""The figure of a validation: cross plots with their bands and the measured points."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from vocabulary.signals import SIGNALS

from ..figures.style import CHANGED, frame, line_style, new_figure, shown_unit
from ..messages import counted
from ..metrics.measures import words

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from .validation import Validation

POINTS = 2000
"""Points drawn of each test; those outside are all drawn. Chosen: dense on the page."""
ELLIPSES = 500
"""Ellipses of the tolerance that are drawn around a cross plot; chosen: they look like a band."""
BAND = "#DCE9F5"
MEASURED = "#111111"


def draw(validation: Validation) -> Figure:
    """Return the cross plots of a validation."""
    from matplotlib.collections import EllipseCollection
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    unit_x, factor_x = shown_unit(SIGNALS[validation.horizontal].unit)
    with new_figure() as figure:
        panels = figure.subplots(1, max(1, len(validation.plots)), squeeze=False)[0]
        for axes, plot in zip(panels, validation.plots, strict=False):
            unit, factor = shown_unit(SIGNALS[plot.signal].unit)
            every = slice(None, None, max(1, plot.over.size // ELLIPSES))
            axes.add_collection(EllipseCollection(
                2.0 * factor_x * plot.of_over[every], 2.0 * factor * plot.of_values[every], 0.0, units="xy",
                offsets=np.column_stack([factor_x * plot.over, factor * plot.values])[every],
                offset_transform=axes.transData, facecolor=BAND, edgecolor="none", zorder=0,
            ))  # fmt: skip
            axes.plot(factor_x * plot.over, factor * plot.values, **line_style(0))
            for test in plot.tests:
                beyond = test.distance > 1.0
                some = np.zeros(beyond.size, dtype=bool)
                some[:: max(1, beyond.size // POINTS)] = True
                for chosen, colour, layer in ((some & ~beyond, MEASURED, 3), (beyond, CHANGED, 4)):
                    x, y = factor_x * test.over[chosen], factor * test.values[chosen]
                    axes.plot(x, y, ".", color=colour, markersize=1.5, zorder=layer)
            axes.margins(0.03, 0.1)
            axes.set_title(f"{words(plot.signal)} [{unit}]")
            axes.set_xlabel(f"{words(validation.horizontal)} [{unit_x}]")
        dot: dict[str, Any] = {"linestyle": "none", "marker": ".", "markersize": 7}
        handles: list[Any] = [
            Line2D([], [], label=validation.title, **line_style(0)),
            Patch(color=BAND, label="tolerance"),
            Line2D([], [], label=validation.measured, color=MEASURED, **dot),
        ]
        if any((test.distance > 1.0).any() for plot in validation.plots for test in plot.tests):
            handles.append(Line2D([], [], label="outside", color=CHANGED, **dot))
        verdicts = ", ".join(f"{words(name)} {v.status.value}" for name, v in validation.verdicts.items())
        tests = counted(len(validation.plots[0].tests), "test") if validation.plots else "no test"
        note = " · ".join(filter(None, [
            f"{validation.bands}: {validation.source}", tests, validation.origin,
            *(f"{words(name)}: {verdict.why}" for name, verdict in validation.verdicts.items()),
        ]))  # fmt: skip
        frame(figure, 4.2, handles, f"Validation: {verdicts}", note)
    return figure
