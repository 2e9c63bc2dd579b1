"""What tyre people expect to see of a tyre, in one figure."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ..figures.style import QUIET, ROW, frame, line_style, new_figure
from .stand import Stand, State, stiffnesses

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

OF_NOMINAL = (0.5, 1.0, 1.5, 2.0)
"""Loads of the curves over the nominal one."""
ANGLES = (0.0, 2.0, 4.0, 7.0, 12.0)
"""Slip angles of the friction ellipse [deg]."""
LARGEST_ANGLE, LARGEST_SLIP = np.radians(15.0), 0.5
"""Ends of the curves [rad], [1]."""
POINTS = 151


def draw_tyre(stand: Stand, title: str, note: str) -> Figure:
    """Return the figure of a tyre: forces, aligning moment, friction ellipse, stiffnesses, relaxation.

    Raises:
        SimulationError: the FMU failed.
    """
    nominal = stand.nominal_load
    loads = [share * nominal for share in OF_NOMINAL]
    angles = np.linspace(-LARGEST_ANGLE, LARGEST_ANGLE, POINTS)
    slips = np.linspace(-LARGEST_SLIP, LARGEST_SLIP, POINTS)
    around = np.sort(
        np.concatenate([-np.geomspace(1e-3, 0.98, POINTS), [0.0], np.geomspace(1e-3, 0.95, POINTS)])
    )
    with new_figure() as figure:
        grid = figure.add_gridspec(3, 2)
        axes = [figure.add_subplot(grid[i // 2, i % 2]) for i in range(6)]
        over_angle = [stand.measure([State(alpha, 0.0, load) for alpha in angles]) for load in loads]
        over_slip = [stand.measure([State(0.0, kappa, load) for kappa in slips]) for load in loads]
        names = [f"F_z = {load / 1e3:.3g} kN" for load in loads]
        degrees = np.degrees(angles)
        _curves(axes[0], degrees, [y["tyre_force_y"] / 1e3 for y in over_angle], names)
        axes[0].set(title="Lateral force", xlabel="slip angle [°]", ylabel="F_y [kN]")
        if "aligning_moment" in over_angle[0]:
            _curves(axes[1], degrees, [y["aligning_moment"] for y in over_angle], names)
        else:
            _nothing(axes[1], "this tyre tells no aligning moment")
        axes[1].set(title="Aligning moment", xlabel="slip angle [°]", ylabel="M_z [N·m]")
        _curves(axes[2], slips, [y["tyre_force_x"] / 1e3 for y in over_slip], names)
        axes[2].set(title="Longitudinal force", xlabel="slip κ [1]", ylabel="F_x [kN]")
        for number, angle in enumerate(ANGLES):
            y = stand.measure([State(np.radians(angle), kappa, nominal) for kappa in around])
            style = line_style(number)
            axes[3].plot(y["tyre_force_x"] / 1e3, -y["tyre_force_y"] / 1e3, **style, label=f"{angle:g}°")
        inside: dict[str, Any] = {"loc": "lower center", "bbox_to_anchor": (0.5, 0.17), "ncols": 3}
        axes[3].legend(title="slip angle", fontsize=7.5, title_fontsize=7.5, **inside)
        axes[3].set(title=f"Combined slip at {nominal / 1e3:.3g} kN", xlabel="F_x [kN]", ylabel="-F_y [kN]")
        _over_load(stand, axes[4], axes[5], np.linspace(0.05, OF_NOMINAL[-1], 60) * nominal)
        handles = [axes[0].plot([], [], **line_style(i), label=name)[0] for i, name in enumerate(names)]
        frame(figure, 3 * 1.25 * ROW, handles, title, note)
    return figure


def _over_load(stand: Stand, left: Axes, right: Axes, loads: np.ndarray) -> None:
    k_x, k_y = stiffnesses(stand, list(loads))
    left.plot(loads / 1e3, k_x / 1e3, **line_style(0), label="∂F_x/∂κ [kN]")
    left.plot(loads / 1e3, k_y / 1e3, **line_style(1), label="-∂F_y/∂α [kN/rad]")
    left.legend(fontsize=7.5, loc="upper left")
    left.set(title="Stiffnesses at zero slip", xlabel="load F_z [kN]", ylabel="")
    at_rest = stand.measure([State(0.0, 0.0, load) for load in loads])
    lengths = [(f"relaxation_length_{axis}", f"σ_{axis}") for axis in "xy"]
    for number, (name, label) in enumerate(lengths):
        if name in at_rest:
            right.plot(loads / 1e3, at_rest[name], **line_style(number), label=label)
    if right.get_lines():
        right.legend(fontsize=7.5, loc="upper left")
        right.set_ylim(bottom=0.0)
    else:
        _nothing(right, "this tyre's forces do not lag")
    right.set(title="Relaxation lengths", xlabel="load F_z [kN]", ylabel="σ [m]")


def _curves(axes: Axes, x: np.ndarray, every: Sequence[np.ndarray], names: Sequence[str]) -> None:
    for number, (y, name) in enumerate(zip(every, names, strict=True)):
        axes.plot(x, y, **line_style(number), label=name)


def _nothing(axes: Axes, why: str) -> None:
    axes.text(0.5, 0.5, why, transform=axes.transAxes, ha="center", color=QUIET)
    axes.xaxis.set_visible(False)
    axes.yaxis.set_visible(False)
