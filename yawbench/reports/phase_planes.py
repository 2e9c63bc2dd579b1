"""Phase planes that a viewer offers, with the limits within which a car is held.

A page that would be too large with their signals goes without them.

- Sideslip rate over sideslip, with the edges of the strip of the metric `stability_index`.
- Yaw rate over sideslip, with the yaw rate that friction holds in a steady turn at the run's first speed,
  mu g / v (Rajamani, Vehicle Dynamics and Control, 2nd ed., section 8.3.2, without its factor of 0.85).
- Longitudinal over lateral acceleration (g-g), with the circle of friction times g.
- Lateral force over slip angle of each axle, with friction times the load at the begin of the run.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from yawbench.events.kinds import friction_at
from yawbench.metrics.expressions import columns_of
from yawbench.metrics.measures import BOUNDARY, RETURN_RATE
from yawbench.orchestrator.results.reader import Results
from yawbench.vocabulary.gravity import G

from .viewer_views import Curve, View

POINTS = 181
"""Points of a curve; chosen: a circle looks round."""
WIDEST = 1.5
"""Sideslip up to which lines are drawn [rad]; chosen: a car across its way."""
SLOWEST = 1.0
"""Speed below which no yaw rate is a limit [m/s]; chosen: it would be beyond any scale."""
AXLES = {"front axle": ("fl", "fr"), "rear axle": ("rl", "rr")}


PLANES = (
    View("Sideslip rate over sideslip", ["sideslip_rate"], x="sideslip"),
    View("Yaw rate over sideslip", ["yaw_rate"], x="sideslip"),
    View("g-g: longitudinal over lateral acceleration", ["acceleration_x"], x="acceleration_y"),
    *(
        View(
            f"Lateral force over slip angle, {axle}",
            [f"tyre_force_y_{left} + tyre_force_y_{right}"],
            x=f"slip_angle_{left}",
        )
        for axle, (left, right) in AXLES.items()
    ),
)


def planes_of(runs: Sequence[Results]) -> tuple[list[View], list[Curve]]:
    """Return the views of the planes whose signals any run has, and their curves."""
    views = [view for view in PLANES if any(_has(run, view) for run in runs)]
    curves = [*_stability()]
    for number, run in enumerate(runs):
        if (friction := _first_friction(run)) is not None:
            curves += [*_friction(run, friction, number), *_axles(run, friction, number)]
    return views, curves


def _has(run: Results, view: View) -> bool:
    return all(columns_of(run, name) for name in (view.x, *view.panels[0].split(" + ")))


def _stability() -> Iterator[Curve]:
    beta = np.linspace(-WIDEST, WIDEST, POINTS)
    for side in (1.0, -1.0):
        rate = side * BOUNDARY - RETURN_RATE * beta
        yield Curve("sideslip", "sideslip_rate", "stability index 1", beta.tolist(), rate.tolist())


def _friction(run: Results, friction: float, number: int) -> Iterator[Curve]:
    held = friction * G
    angle = np.linspace(0.0, 2.0 * np.pi, POINTS)
    x, y = (held * np.sin(angle)).tolist(), (held * np.cos(angle)).tolist()
    x[-1], y[-1] = x[0], y[0]  # closed to the last bit
    yield Curve("acceleration_y", "acceleration_x", "friction times g", x, y, number)
    speed = next((abs(float(run.columns[name][0])) for name in columns_of(run, "velocity_x")), 0.0)
    if speed > SLOWEST:
        beta = np.linspace(-WIDEST, WIDEST, POINTS).tolist()
        for side in (1.0, -1.0):
            text = f"friction times g / {speed:.3g} m/s"
            yield Curve("sideslip", "yaw_rate", text, beta, [side * held / speed] * POINTS, number)


def _axles(run: Results, friction: float, number: int) -> Iterator[Curve]:
    for wheels in AXLES.values():
        loads = [columns_of(run, f"vertical_load_{wheel}") for wheel in wheels]
        if not all(loads):
            continue
        grip = friction * sum(float(run.columns[column[0]][0]) for column in loads)
        slip = np.linspace(-WIDEST, WIDEST, POINTS).tolist()
        force = " + ".join(f"tyre_force_y_{wheel}" for wheel in wheels)
        for side in (1.0, -1.0):
            text = "friction times load at the begin"
            yield Curve(f"slip_angle_{wheels[0]}", force, text, slip, [side * grip] * POINTS, number)


def _first_friction(run: Results) -> float | None:
    """Return the lowest friction under a wheel at the begin; None if it is not known."""
    found = friction_at(run)
    if found is None:
        return None
    columns, constants = found
    return min(constants) if constants else min(float(run.columns[column][0]) for column in columns)
