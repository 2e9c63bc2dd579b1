"""Phase portraits: one signal over another, in a panel.

Every run is a curve with a dot at its end, over the curve of the references where both signals have one. A
curve that goes much further than the others may leave the axes; a note then gives how far it goes.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from yawbench.metrics.expressions import columns_of, reference_of
from yawbench.metrics.measures import variable_of, words
from yawbench.orchestrator.results.reader import Results
from yawbench.orchestrator.signal_names import VARIABLE
from yawbench.vehicles.motion import largest

from .display import LabelledRun, digits_of, in_formula, shown_unit, unit_of_signal
from .style import line_style, literal, note_beyond, reference_style

if TYPE_CHECKING:
    from matplotlib.axes import Axes


CURVE_POINTS = 4000
"""Number of samples the curve of a phase portrait is thinned to."""
FAR = 4.0
"""A curve of a portrait that goes this many times as far as another may leave the axes."""
MARGIN = 1.2
"""Limits of the axes over the extent of the curves within them."""


class PortraitCurve(NamedTuple):
    """A run's y over x in displayed units, and its references if it has both."""

    number: int
    label: str
    x: np.ndarray
    y: np.ndarray
    reference: tuple[np.ndarray, np.ndarray] | None


def signals_of(name: str) -> tuple[str, str] | None:
    """Return (x, y) of a panel's name `y(x)`, or None if it is not of that form."""
    match = re.fullmatch(rf"({VARIABLE})\(({VARIABLE})\)", name.replace(" ", ""))
    return (match[2], match[1]) if match else None


def curves_of(runs: Sequence[LabelledRun], x: str, y: str) -> list[PortraitCurve]:
    """Return the curves of the runs that recorded both signals."""
    curves = []
    for number, (label, results) in enumerate(runs):
        across, up = columns_of(results, x), columns_of(results, y)
        if not across or not up:
            continue
        x_ref, y_ref = reference_of(results, across[0]), reference_of(results, up[0])
        reference = (_shown(results, x_ref), _shown(results, y_ref)) if x_ref and y_ref else None
        curves.append(
            PortraitCurve(number, label, _shown(results, across[0]), _shown(results, up[0]), reference)
        )
    return curves


def _shown(results: Results, column: str) -> np.ndarray:
    factor = shown_unit(unit_of_signal(results.units[column]))[1]
    values: np.ndarray = results[column][spread_rows(results, CURVE_POINTS)] * factor
    return values


def spread_rows(results: Results, most: int) -> np.ndarray:
    """Return about `most` evenly spaced row indices, the last row included."""
    size = results.time.size
    return np.append(np.arange(0, size - 1, max(1, size // most)), size - 1)


def draw_portrait(axes: Axes, runs: Sequence[LabelledRun], x: str, y: str) -> None:
    """Draw y over x of all runs."""
    curves = curves_of(runs, x, y)
    drawn: list[tuple[np.ndarray, np.ndarray]] = []
    for curve in curves:
        if curve.reference and not any(_same_curve(curve.reference, other) for other in drawn):
            drawn.append(curve.reference)
            axes.plot(*curve.reference, **reference_style(), label="reference")
    for curve in curves:
        style: dict[str, Any] = line_style(curve.number)
        axes.plot(curve.x, curve.y, **style)
        end = np.flatnonzero(~np.isnan(curve.x + curve.y))[-1:]
        axes.plot(curve.x[end], curve.y[end], "o", ms=3.5, color=style["color"])
    results = next(results for _, results in runs if columns_of(results, x) and columns_of(results, y))
    units = [shown_unit(unit_of_signal(results.units[columns_of(results, name)[0]]))[0] for name in (x, y)]
    over, up = (words(variable_of(signal)) for signal in (x, y))
    axes.set_title(literal(f"{up} over {over[0].lower()}{over[1:]}"))
    axes.set_xlabel(_label(x, units[0]))
    axes.set_ylabel(_label(y, units[1]))
    _limit_portrait(axes, curves, drawn, units)


def _label(signal: str, unit: str) -> str:
    name = in_formula(signal) or literal(words(variable_of(signal)))
    return f"{name} in {unit}" if unit else name


def _same_curve(curve: tuple[np.ndarray, np.ndarray], other: tuple[np.ndarray, np.ndarray]) -> bool:
    return all(
        a.shape == b.shape and np.ptp(a - b) <= 0.01 * max(np.ptp(b), 1e-300)
        for a, b in zip(curve, other, strict=True)
    )


def _limit_portrait(
    axes: Axes,
    curves: Sequence[PortraitCurve],
    references: Sequence[tuple[np.ndarray, np.ndarray]],
    units: list[str],
) -> None:
    """Limit the axes of a portrait to the nearby curves; note how far the others go."""
    reach = [np.array([largest(curve.x) or 0.0, largest(curve.y) or 0.0]) for curve in curves]
    nearest = np.min(reach, axis=0)
    for x, y in references:
        nearest = np.maximum(nearest, [largest(x) or 0.0, largest(y) or 0.0])
    stay = [bool(np.all(far <= FAR * nearest)) for far in reach]
    if all(stay) or not any(stay):
        return
    limits = MARGIN * np.maximum(
        nearest, np.max([far for far, near in zip(reach, stay, strict=True) if near], axis=0)
    )
    axes.set_xlim(-limits[0], limits[0])
    axes.set_ylim(-limits[1], limits[1])
    note_beyond(axes, (
        (curve.label, f"{digits_of(far[0])} {units[0]} and {digits_of(far[1])} {units[1]}")
        for curve, far, near in zip(curves, reach, stay, strict=True)
        if not near
    ))  # fmt: skip
