"""The icons of the FMUs, one per role: `python -m docs.generate.icons` draws them into fmus/icons/."""

from __future__ import annotations

from collections.abc import Callable

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Circle, FancyArrow, FancyBboxPatch, Rectangle

from yawbench.fmus.presentation import ICONS

INK, ACCENT = "#1f3a5f", "#d1495b"


def _box(ax: Axes, x: float, y: float, w: float, h: float, color: str = INK) -> None:
    ax.add_patch(FancyBboxPatch((x, y), w, h, "round,pad=0,rounding_size=0.08", fc="none", ec=color, lw=4))


def _arrow(ax: Axes, x: float, y: float, dx: float, dy: float, color: str = ACCENT) -> None:
    ax.add_patch(FancyArrow(x, y, dx, dy, width=0.03, head_width=0.16, head_length=0.14, fc=color, ec=color))


def driver(ax: Axes) -> None:
    ax.add_patch(Circle((0, 0), 0.75, fc="none", ec=INK, lw=7))
    ax.add_patch(Circle((0, 0), 0.17, fc=ACCENT, ec="none"))
    for angle in np.radians([0, 180, 270]):
        ax.plot(
            [0.17 * np.cos(angle), 0.75 * np.cos(angle)],
            [0.17 * np.sin(angle), 0.75 * np.sin(angle)],
            INK,
            lw=6,
        )


def reference(ax: Axes) -> None:
    t = np.linspace(-0.85, 0.85, 60)
    ax.plot(t, 0.55 * np.tanh(3 * t), ACCENT, lw=5, ls=(0, (2, 1)))
    ax.plot([-0.85, -0.85, 0.9], [0.85, -0.8, -0.8], INK, lw=4)


def controller(ax: Axes) -> None:
    _box(ax, -0.4, -0.15, 0.8, 0.7)
    _arrow(ax, -0.95, 0.2, 0.38, 0)
    _arrow(ax, 0.45, 0.2, 0.38, 0)
    ax.plot([0.7, 0.7, -0.75, -0.75], [0.2, -0.65, -0.65, 0.1], INK, lw=4)


def allocator(ax: Axes) -> None:
    for x, y in ((-0.6, 0.6), (0.6, 0.6), (-0.6, -0.6), (0.6, -0.6)):
        _arrow(ax, 0.15 * np.sign(x), 0.15 * np.sign(y), 0.7 * x, 0.7 * y)
    ax.add_patch(Circle((0, 0), 0.16, fc=INK, ec="none"))


def _wheel(ax: Axes) -> None:
    ax.add_patch(Circle((0, 0), 0.8, fc="none", ec=INK, lw=10))
    ax.add_patch(Circle((0, 0), 0.22, fc="none", ec=INK, lw=4))


def wheel_control(ax: Axes) -> None:
    _wheel(ax)
    angles = np.radians(np.linspace(40, 140, 30))
    ax.plot(0.5 * np.cos(angles), 0.5 * np.sin(angles), ACCENT, lw=5)
    ax.plot([0, 0.3], [0, 0.42], ACCENT, lw=4)


def actuator(ax: Axes) -> None:
    _wheel(ax)
    ax.add_patch(Rectangle((0.38, -0.28), 0.34, 0.56, fc=ACCENT, ec="none"))


def plant(ax: Axes) -> None:
    _box(ax, -0.42, -0.85, 0.84, 1.7)
    ax.plot([-0.28, -0.2, 0.2, 0.28], [0.25, 0.45, 0.45, 0.25], INK, lw=4)
    for x in (-0.62, 0.5):
        for y in (0.4, -0.7):
            ax.add_patch(Rectangle((x, y), 0.12, 0.34, fc=ACCENT, ec="none"))


def tyre(ax: Axes) -> None:
    x = np.linspace(-0.85, 0.85, 80)
    ax.plot([-0.9, 0.9], [0, 0], INK, lw=3)
    ax.plot([0, 0], [-0.85, 0.85], INK, lw=3)
    ax.plot(x, 0.7 * np.sin(1.5 * np.arctan(5 * x)), ACCENT, lw=6)


def road(ax: Axes) -> None:
    ax.fill([-0.75, -0.2, 0.2, 0.75], [-0.85, 0.8, 0.8, -0.85], INK)
    for y, h in ((-0.75, 0.4), (-0.1, 0.28), (0.42, 0.18)):
        ax.add_patch(Rectangle((-0.05, y), 0.1, h, fc="white", ec="none"))


def sensor(ax: Axes) -> None:
    ax.add_patch(Circle((-0.45, -0.45), 0.2, fc=ACCENT, ec="none"))
    angles = np.radians(np.linspace(5, 85, 40))
    for radius in (0.5, 0.85, 1.2):
        ax.plot(-0.45 + radius * np.cos(angles), -0.45 + radius * np.sin(angles), INK, lw=6)


def estimator(ax: Axes) -> None:
    t = np.linspace(-0.9, 0.9, 80)
    shape = 0.6 * np.exp(-4 * t * t)
    ax.fill_between(t, -0.5, shape - 0.5, color=ACCENT, alpha=0.35, lw=0)
    ax.plot(t, shape - 0.5, ACCENT, lw=5)
    ax.plot([-0.9, 0.9], [-0.5, -0.5], INK, lw=5)
    ax.plot([0, 0], [-0.5, 0.75], INK, lw=5, ls=(0, (2, 1)))


def monitor(ax: Axes) -> None:
    ax.plot([-0.9, -0.35, -0.2, 0.05, 0.2, 0.9], [0, 0, 0.6, -0.6, 0, 0], INK, lw=6)
    ax.add_patch(Circle((0.55, 0.55), 0.25, fc=ACCENT, ec="none"))


def steering_actuator(ax: Axes) -> None:
    for angle, color in ((0.0, INK), (0.45, ACCENT)):
        ax.plot(
            [-0.7 * np.sin(angle), 0.7 * np.sin(angle)],
            [-0.7 * np.cos(angle), 0.7 * np.cos(angle)],
            color,
            lw=9,
        )
    _arrow(ax, 0.05, 0.85, 0.35, -0.08)


ROLES: tuple[Callable[[Axes], None], ...] = (
    driver, reference, controller, allocator, wheel_control, actuator, plant, tyre, road, sensor, estimator,
    monitor, steering_actuator,
)  # fmt: skip


def main() -> None:
    """Draw them all."""
    for draw in ROLES:
        figure = plt.figure(figsize=(1.28, 1.28), dpi=100)
        axes = figure.add_axes((0, 0, 1, 1), xlim=(-1, 1), ylim=(-1, 1), aspect="equal")
        axes.axis("off")
        draw(axes)
        figure.savefig(ICONS / f"{draw.__name__}.png", transparent=True, metadata={"Software": None})
        plt.close(figure)


if __name__ == "__main__":
    main()
