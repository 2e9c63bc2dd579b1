"""What a car is like, in one figure: understeer and roll over lateral acceleration, yaw over speed."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from ..figures.style import QUIET, ROW, frame, line_style, new_figure
from .handling import Handling

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def draw_cars(cars: Sequence[Handling], title: str, note: str) -> Figure:
    """Return the figure of a car on some plants."""
    with new_figure() as figure:
        axes = list(figure.subplots(2, 2).flat)
        for number, car in enumerate(cars):
            style = line_style(number)
            a_y, extra = car.curve
            axes[0].plot(a_y, np.degrees(extra), **style)
            speeds = [3.6 * v for v in car.gains]
            axes[1].plot(speeds, list(car.gains.values()), **style)
            if car.roll is not None:
                axes[2].plot(a_y, np.degrees(car.roll), **style)
            frequencies = [mode.frequency for mode in car.yaw.values()]
            axes[3].plot(speeds, frequencies, **style)
            axes[3].plot(speeds, [mode.damping for mode in car.yaw.values()], **style | {"alpha": 0.5})
        axes[0].set(
            title="Steering beyond geometry at 80 km/h", xlabel="a_y [m/s²]", ylabel="δ - L r / v_x [°]"
        )
        axes[1].set(title="Steady yaw gain", xlabel="speed [km/h]", ylabel="r / δ [1/s]")
        axes[2].set(title="Roll at 80 km/h", xlabel="a_y [m/s²]", ylabel="φ [°]")
        if not axes[2].get_lines():
            axes[2].text(
                0.5, 0.5, "no roll angle here", transform=axes[2].transAxes, ha="center", color=QUIET
            )
        axes[3].set(
            title="Yaw mode: natural frequency, damping ratio (pale)",
            xlabel="speed [km/h]",
            ylabel="f_n [Hz], ζ [1]",
        )
        for one in axes:
            one.set_ylim(bottom=0.0)
        handles = [axes[0].plot([], [], **line_style(i), label=car.plant)[0] for i, car in enumerate(cars)]
        frame(figure, 2 * 1.4 * ROW, handles, title, note)
    return figure
