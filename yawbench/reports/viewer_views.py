"""What a viewer can be told to show: views of runs and signals, and what is dashed in them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from yawbench.figures.phase_portrait import signals_of

PANELS = ("sideslip", "yaw_rate", "acceleration_y", "yaw_moment", "steer_angle")
"""Signals shown first, with their references; chosen: what all four papers draw."""


@dataclass(frozen=True)
class View:
    """A selection of runs and signals that the reader can choose.

    Attributes:
        title: of the choice.
        panels: signals, `instance.variable` or the variable alone, `x_error` for its error, `x - y`; a comma
            overlays further ones.
        shown: numbers of the runs; None: all, up to `FIRST`.
        x: signal on the horizontal axis, or time.
    """

    title: str = "Signals over time"
    panels: Sequence[str] = PANELS
    shown: Sequence[int] | None = None
    x: str = "time"


def views_of(panels: Sequence[str], title: str = "", shown: Sequence[int] | None = None) -> Iterator[View]:
    """Yield the views that show panels of a figure: its signals over time, and each portrait `y(x)`.

    The path needs none: a page draws the road.
    """
    portraits = [(name, pair) for name in panels if (pair := signals_of(name))]
    over_time = tuple(name for name in panels if name != "path" and not signals_of(name))
    if over_time or not portraits:
        yield View(title or View.title, over_time or PANELS, shown)
    for name, (x, y) in portraits:
        yield View(": ".join(filter(None, (title, name))), (y,), shown, x)


class Mark(NamedTuple):
    """An instant [s] with its text, as a vertical line; `run`: number of the run that has it, None: all."""

    time: float
    text: str
    run: int | None = None


class Bound(NamedTuple):
    """A bound of a signal in SI units with its text, as a horizontal line; `run`: as of a `Mark`."""

    signal: str
    value: float
    text: str
    run: int | None = None


class Curve(NamedTuple):
    """A curve in the plane of two signals, in their SI units, with its text; `run`: as of a `Mark`."""

    x: str
    y: str
    text: str
    xs: Sequence[float]
    ys: Sequence[float]
    run: int | None = None
