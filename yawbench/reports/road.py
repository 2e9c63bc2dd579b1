"""The road from above: positions of a car, its lanes and the ground, from signals and parameters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from yawbench.foundation.messages import listed
from yawbench.metrics.expressions import columns_of
from yawbench.orchestrator.results.reader import Results
from yawbench.orchestrator.results.run_record import RunStatus
from yawbench.scene.outline import outline_of, places_of
from yawbench.scene.scene import POSE
from yawbench.scene.wheel_motion import friction_columns, travel_of
from yawbench.vocabulary.wheels import WHEELS

NAMED = 6
"""Number of ground frictions listed in the legend; if there are more, only the range is given."""

MOTION = (
    "velocity_x", "velocity_y", "sideslip", "yaw_rate", "steer_angle", "yaw_moment", "cone_overrun",
    "path_offset", "roll_angle", "pitch_angle", "heave", "wind_force_y",
)  # fmt: skip
OF_WHEELS = ("force_along", "force_across", "load", "friction", "spin")
"""Signals of each wheel that `road_of` draws."""


def road_of(run: Results, grounds: list[Any]) -> dict[str, Any] | None:
    """Return the columns that the road needs, and the car's outline; None without position or yaw angle.

    Its ground is an index of `grounds`, to which a new one is added; None: none was recorded.
    """
    road: dict[str, Any] = {}
    for key, signal in POSE.items():
        columns = columns_of(run, signal)
        if not columns or not np.isfinite(run.columns[columns[0]][0]):
            return None
        road[key] = columns[0]
    road |= {signal: columns[0] for signal in MOTION if (columns := columns_of(run, signal))}
    along, across = columns_of(run, "tyre_force_x_*"), columns_of(run, "tyre_force_y_*")
    loads = columns_of(run, "vertical_load_*")
    for k, wheel in enumerate(WHEELS if along and across else ()):
        road[f"force_along_{wheel}"], road[f"force_across_{wheel}"] = along[k], across[k]
    frictions = friction_columns(run)
    if frictions is not None and along and loads:
        for wheel, load, friction in zip(WHEELS, loads, frictions, strict=True):
            road[f"load_{wheel}"], road[f"friction_{wheel}"] = load, friction
    for wheel, column in zip(WHEELS, columns_of(run, "wheel_speed_*"), strict=False):
        road[f"spin_{wheel}"] = column
    car, known = outline_of(run)
    x, y = (run.columns[road[key]] for key in ("x", "y"))
    places = places_of(run, *((float(np.nanmin(values)), float(np.nanmax(values))) for values in (x, y)))
    ground = [[piece.friction, piece.corners] for piece in places.ground]
    if ground and ground not in grounds:
        grounds.append(ground)
    road["outline"] = {"car": asdict(car), "lanes": [list(lane) for lane in places.lanes]}
    road["ground"] = grounds.index(ground) if ground else None
    road["sized"] = known
    if lifts := _lifts(run):
        road["lifts"] = lifts
    return road


LIFTED = 0.001
"""Height [m] from which a wheel counts as lifted. Chosen: less is not seen."""
PERIOD = 0.01
"""Distance of the heights of a lifted wheel in a page [s]. Chosen: an eighth of the period of wheel hop."""


def _lifts(run: Results) -> list[Any]:
    """Return where wheels are in the air: wheel, first time, period [s], heights [m]."""
    travel, found = travel_of(run), []
    if travel is None:
        return []
    for wheel, heights in zip(WHEELS, travel.T, strict=True):
        lifted = columns_of(run, f"vertical_load_{wheel}")
        above = (run.columns[lifted[0]] <= 0.0) & (heights > LIFTED)
        edges = np.flatnonzero(np.diff(above, prepend=False, append=False))
        for first, after in zip(edges[::2], edges[1::2], strict=True):
            times = np.arange(run.time[first], run.time[after - 1] + PERIOD, PERIOD)
            height = np.interp(times, run.time[first:after], heights[first:after])
            found.append([wheel, float(times[0]), PERIOD, [round(float(one), 3) for one in height]])
    return found


def without_tyres(road: Mapping[str, Any]) -> dict[str, Any]:
    """Return the columns that the road needs without forces and friction circles of the wheels."""
    return {key: column for key, column in road.items() if key[:-3] not in OF_WHEELS}


def notes_of(run: Results, road: Mapping[str, Any] | None) -> list[str]:
    """Return notes on what cannot be drawn of a run, and why it ended early."""
    notes: list[str] = []
    if road is None:
        return notes
    if "force_along_fl" not in road:
        notes.append("tyre forces not recorded")
    elif "steer_angle" not in road:
        notes.append("steer angle not recorded: front wheels drawn straight")
    if "force_along_fl" in road and "friction_fl" not in road:
        notes.append("friction or vertical loads not recorded: no friction circles")
    if not road["sized"]:
        notes.append("the plant has no dimensions; drawing a mid-size car")
    if run.record.status not in (RunStatus.UNKNOWN, RunStatus.COMPLETED):
        notes.append(f"the run failed at {run.time[-1]:.2f} s")
    elif run.ended:
        notes.append(run.ended)
    return notes


def legend_of(roads: Sequence[Mapping[str, Any] | None], grounds: Sequence[Any]) -> str:
    """Return the legend of the symbols on the road."""
    drawn = {name for road in roads for name in road or ()}
    symbols = (
        ("path_offset", "grey dashes: the driver's path"),
        ("friction_fl", "circles: friction times load"),
        ("force_along_fl", "arrows: tyre forces" + (", in % of it" if "friction_fl" in drawn else "")),
        ("sideslip", "arrow from the centre of mass: its direction of motion"),
        ("yaw_moment", "grey arc: requested yaw moment"),
    )
    parts = [text for name, text in symbols if name in drawn]
    frictions = sorted({friction for ground in grounds for friction, _ in ground})
    if frictions:
        numbers = [f"{mu:g}" for mu in frictions]
        values = listed(numbers) if len(numbers) <= NAMED else f"{numbers[0]} to {numbers[-1]}"
        parts.append(f"ground: the bluer the more slippery, friction {values}")
    key = "; ".join(parts)
    return f"{key[:1].upper()}{key[1:]}." if key else ""
