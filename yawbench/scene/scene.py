"""The scene of a run: where the car, its body and its wheels are, and the forces on them, over time.

Three frames, with axes of ISO 8855 (x forward, y to the left, z up):

    road    z = 0 on the road, x = y = 0 where the car starts; `position`, `yaw`, lanes, ground
    car     below the centre of mass on the road, turned by yaw about z; wheels, contacts, forces, velocity
    body    the car's axes as the sprung mass carries them: pitched about y (nose down), then rolled about x
            (left side up), about a point at the height `CarOutline.pivot`, and lifted by `heave`

A model whose body stands on tyre springs (`cars.ride`) turns about the car's centre of mass, wheels included;
one that rolls about a roll axis (`cars.rolling_body`) leaves its wheels where they are. Signals that were not
recorded, such as the pitch of a model that has none, are zero, and named in `missing`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from yawbench.foundation.errors import ResultsError
from yawbench.metrics.expressions import columns_of
from yawbench.orchestrator.results.reader import Results
from yawbench.orchestrator.results.run_record import EventRecord
from yawbench.orchestrator.scenario.overrides import with_changes

from .outline import CarOutline, Places, outline_of, places_of
from .wheel_motion import friction_of, stacked, steer_of, torques_of, travel_of

FRAMES = 0.02
"""Time between two positions of a car in viewers [s]. Chosen: 50 frames a second."""
POSE = {"x": "position_x", "y": "position_y", "yaw": "yaw_angle"}
"""Signals without which there is no scene."""


@dataclass(frozen=True)
class Scene:
    """A run in space. Arrays have a row per recorded instant; four columns are the wheels fl, fr, rl, rr.

    Attributes:
        title: of the run, with its overrides.
        time: [s], shape (rows,).
        car: dimensions.
        sized: whether the plant has dimensions of its own; else those of a mid-size car are given.
        places: lanes, cones and ground.
        position: of the centre of mass on the road, road frame [m], shape (rows, 2).
        yaw, roll, pitch: angles [rad], shape (rows,) each; yaw without jumps.
        heave: of the body above its position at rest [m], shape (rows,).
        velocity: of the centre of mass, car frame [m/s], shape (rows, 2).
        steer: angles of the wheels about z [rad], shape (rows, 4).
        inclination: of the wheels about x, positive: top to the right [rad], shape (rows, 4).
        spin: angles by which the wheels have turned about their axles [rad], shape (rows, 4).
        height: of the wheels' centres above the road [m], shape (rows, 4).
        force: of the road on the wheels, car frame [N], shape (rows, 4, 3).
        grip: friction times load [N], shape (rows, 4); NaN where it is not known.
        drive_torque, brake_torque: on the wheels [N.m], neither negative as they drive and brake, shape
            (rows, 4).
        yaw_moment: requested by the controller [N.m], shape (rows,).
        wind: side force and moment about z on the car [N], [N.m], shape (rows, 2).
        path: that the driver follows, road frame [m], shape (rows, 2); None without one.
        events: in the order of their begin.
        missing: signals that were not recorded.
    """

    title: str
    time: np.ndarray
    car: CarOutline
    sized: bool
    places: Places
    position: np.ndarray
    yaw: np.ndarray
    roll: np.ndarray
    pitch: np.ndarray
    heave: np.ndarray
    velocity: np.ndarray
    steer: np.ndarray
    inclination: np.ndarray
    spin: np.ndarray
    height: np.ndarray
    force: np.ndarray
    grip: np.ndarray
    drive_torque: np.ndarray
    brake_torque: np.ndarray
    yaw_moment: np.ndarray
    wind: np.ndarray
    path: np.ndarray | None
    events: Sequence[EventRecord] = ()
    missing: Sequence[str] = ()

    @cached_property
    def body(self) -> np.ndarray:
        """Where body and car frame met at rest: that point of the body, car frame [m], shape (rows, 3).

        A point of the body is at this plus its place in the car at rest, turned by pitch and roll.
        """
        none = np.zeros_like(self.heave)
        lifted: np.ndarray = np.stack([none, none, self.car.pivot + self.heave], axis=1)
        place: np.ndarray = lifted - _turned(self.pitch, self.roll, self.car.pivot)
        return place

    @cached_property
    def wheels(self) -> np.ndarray:
        """Positions of the wheels' centres, car frame [m], shape (rows, 4, 3)."""
        car, half = self.car, 0.5 * self.car.track
        at = np.array(
            [(car.front_axle, half), (car.front_axle, -half), (-car.rear_axle, half), (-car.rear_axle, -half)]
        )
        rows = len(self.time)
        centres = np.concatenate([np.broadcast_to(at, (rows, 4, 2)), self.height[:, :, None]], axis=2)
        if car.wheels_turn:
            below = car.pivot - car.radius
            centres[:, :, 0] -= below * self.pitch[:, None]
            centres[:, :, 1] += below * self.roll[:, None]
        return centres

    @cached_property
    def contacts(self) -> np.ndarray:
        """Points below the wheels on the road at which forces act, car frame [m], shape (rows, 4, 3)."""
        points: np.ndarray = self.wheels.copy()
        if self.car.wheels_turn:  # all the way down, see `cars.ride`
            points[:, :, 0] -= self.car.radius * self.pitch[:, None]
            points[:, :, 1] += self.car.radius * self.roll[:, None]
        points[:, :, 2] = 0.0
        return points

    @property
    def used(self) -> np.ndarray:
        """Share of the grip that each wheel uses, shape (rows, 4); NaN without a grip."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(
                self.grip > 0, np.hypot(self.force[:, :, 0], self.force[:, :, 1]) / self.grip, np.nan
            )


def _turned(pitch: np.ndarray, roll: np.ndarray, height: float) -> np.ndarray:
    """Return where pitch, then roll, bring a point at a height above the pivot, shape (rows, 3)."""
    up = np.sin(pitch) * np.cos(roll), -np.sin(roll), np.cos(pitch) * np.cos(roll)
    return np.stack([height * part for part in up], axis=1)


def quaternions(
    yaw: np.ndarray | float = 0.0, pitch: np.ndarray | float = 0.0, roll: np.ndarray | float = 0.0
) -> np.ndarray:
    """Return rotations by yaw, then pitch, then roll as x, y, z, w, shape (rows, 4).

    Angles of ISO 8855 [rad]: about z, then the new y, then the new x.
    """
    half = [0.5 * np.asarray(angle, float) for angle in (yaw, pitch, roll)]
    (cz, cy, cx), (sz, sy, sx) = ([*map(function, half)] for function in (np.cos, np.sin))
    parts = (
        cz * cy * sx - sz * sy * cx,
        cz * sy * cx + sz * cy * sx,
        sz * cy * cx - cz * sy * sx,
        cz * cy * cx + sz * sy * sx,
    )
    return np.stack(np.broadcast_arrays(*parts), axis=-1)


def scene_of(run: Results, events: Sequence[EventRecord] = ()) -> Scene:
    """Return the scene of recorded results.

    Raises:
        ResultsError: position or yaw angle were not recorded.
    """
    rows = run.time.size
    missing: list[str] = []

    def one(signal: str) -> np.ndarray:
        if columns := columns_of(run, signal):
            return np.asarray(run.columns[columns[0]], float)
        missing.append(signal)
        return np.zeros(rows)

    def four(signal: str) -> np.ndarray:
        if columns := columns_of(run, signal):
            return stacked(run, columns)
        missing.append(signal)
        return np.zeros((rows, 4))

    pose = {name: one(signal) for name, signal in POSE.items()}
    if missing or not rows:
        raise ResultsError(
            f"{run.where}: a scene needs the position and the yaw angle of the car; not recorded: "
            f"{', '.join(missing) or 'any sample'}",
            code="signal-unknown",
        )
    car, sized = outline_of(run)
    roll, pitch, heave = one("roll_angle"), one("pitch_angle"), one("heave")
    along, across, load = four("tyre_force_x_*"), four("tyre_force_y_*"), four("vertical_load_*")
    held, steer = steer_of(run)
    cos, sin = np.cos(held), np.sin(held)
    friction = friction_of(run)
    drive, brake, found = torques_of(run)
    if not found:
        missing.append("wheel_torque_*")
    travel = travel_of(run)
    height = np.full((rows, 4), car.radius) if travel is None else car.radius + travel
    bounds = [(float(np.nanmin(pose[name])), float(np.nanmax(pose[name]))) for name in ("x", "y")]
    steps = np.diff(run.time, prepend=run.time[0])[:, None]
    offsets = columns_of(run, "path_offset")
    return Scene(
        with_changes(run.record.title or "", run.record.overrides),
        run.time,
        car,
        sized,
        places_of(run, *bounds),
        np.stack([pose["x"], pose["y"]], axis=1),
        np.unwrap(pose["yaw"]),
        roll,
        pitch,
        heave,
        np.stack([one("velocity_x"), one("velocity_y")], axis=1),
        steer,
        four("inclination_angle_*"),
        np.cumsum(four("wheel_speed_*") * steps, axis=0),
        height,
        np.stack([along * cos - across * sin, along * sin + across * cos, load], axis=2),
        np.full((rows, 4), np.nan) if friction is None else friction * np.maximum(load, 0.0),
        drive,
        brake,
        one("yaw_moment"),
        np.stack([one("wind_force_y"), one("wind_moment_z")], axis=1),
        np.stack([pose["x"], pose["y"] - one("path_offset")], axis=1) if offsets else None,
        events,
        tuple(missing),
    )


def samples(time: np.ndarray, every: float) -> Any:
    """Return indices of rows `every` seconds apart or hardly more, with the first and the last."""
    wanted = np.append(np.arange(time[0], time[-1], every), time[-1])
    return np.unique(np.clip(np.searchsorted(time, wanted - 1e-9), 0, time.size - 1))
