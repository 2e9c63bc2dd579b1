"""Cars and roads as viewers in three dimensions draw them: frames over time, boxes, arrows, colours."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.colors import to_rgb

from yawbench.figures.style import line_style
from yawbench.scene.outline import CarOutline
from yawbench.scene.scene import FRAMES, Scene, quaternions, samples
from yawbench.vocabulary.lane_change import Lane
from yawbench.vocabulary.wheels import WHEELS

Colour = tuple[float, float, float]

PER_NEWTON = 1 / 4000
"""Length of a force [m/N]. Chosen: the load of a wheel is about a metre, as high as a car."""
PER_SPEED = 0.15
"""Length of a velocity [s]. Chosen: 4 m at 25 m/s."""
PER_MOMENT = np.pi / 2 / 5000
"""Angle of a yaw moment [rad/(N.m)]. Chosen: a quarter turn for the moment of strong brakes."""
RADIUS = 1.6
"""Radius of the arc of a yaw moment [m]; chosen: beyond the body's width."""
AT_GRIP, HOT = 0.95, (0.84, 0.0, 0.42)
"""Share of the grip from which a force counts as at its limit, as in events, and its colour."""
CALM, ASPHALT, LANE, CONE, TYRE = (
    (0.16, 0.16, 0.16),
    (0.92, 0.92, 0.92),
    (0.88, 0.84, 0.74),
    (0.92, 0.43, 0.08),
    (0.2, 0.2, 0.21),
)
CONE_SIZE = (0.15, 0.6)
"""Radius and height of a cone [m]."""
TYRE_WIDTH = 0.2
"""Width of a tyre [m]; chosen: 205/60R15."""
SIDEWAYS = np.array([np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)])
"""Turn of a cylinder's axis from z to y."""


def strip_of(scene: Scene, points: np.ndarray, height: float) -> np.ndarray:
    """Return a path of a run as a line at a height above the road, shape (points, 3)."""
    path = points[samples(scene.time, 2 * FRAMES)]
    return np.column_stack([path, np.full(len(path), height)])


def colour_of(number: int) -> Colour:
    """Return the colour of a run by its number, as figures have it."""
    return to_rgb(line_style(number)["color"])


def ground_colour(friction: float) -> Colour:
    """Return the colour of the ground: the bluer the more slippery, as pages have it."""
    less = 1.0 - min(friction, 1.0)
    return (255 - 135 * less) / 255, (255 - 75 * less) / 255, (255 - 25 * less) / 255


class Box(NamedTuple):
    """A box: its centre and size [m], from the car's place on the road at rest."""

    centre: tuple[float, float, float]
    size: tuple[float, float, float]


def boxes_of(car: CarOutline) -> list[Box]:
    """Return the body of a car: a box up to the windows, and a cabin."""
    long, middle = car.front_end + car.rear_end, 0.5 * (car.front_end - car.rear_end)
    low, belt = 0.16 * car.height, 0.58 * car.height
    cabin = car.height - belt
    return [
        Box((middle, 0.0, 0.5 * (low + belt)), (long, car.width, belt - low)),
        Box((middle - 0.06 * long, 0.0, belt + 0.5 * cabin), (0.5 * long, 0.82 * car.width, cabin)),
    ]


def box_of(lane: Lane) -> Box:
    """Return a lane as a thin box below the road."""
    centre = 0.5 * (lane.start + lane.end), lane.middle, -0.01
    return Box(centre, (lane.end - lane.start, lane.left - lane.right, 0.02))


class Frame(NamedTuple):
    """A moving frame: its name, its parent, its place there [m], (rows, 3), and turn, (rows, 4)."""

    name: str
    parent: str
    place: np.ndarray
    turn: np.ndarray


def frames_of(label: str, scene: Scene, rows: np.ndarray, parent: str) -> Iterator[Frame]:
    """Yield the frames of a car, its body and its wheels at some rows."""
    flat = np.column_stack([scene.position[rows], np.zeros(len(rows))])
    yield Frame(label, parent, flat, quaternions(scene.yaw[rows]))
    turn = quaternions(0.0, scene.pitch[rows], scene.roll[rows])
    yield Frame(f"{label}/body", label, scene.body[rows], turn)
    for k, wheel in enumerate(WHEELS):
        turn = quaternions(scene.steer[rows, k], 0.0, scene.inclination[rows, k])
        yield Frame(f"{label}/wheel_{wheel}", label, scene.wheels[rows, k], turn)


class Arrows(NamedTuple):
    """Arrows in the frame of a car: origins and vectors [m], and colours, shape (rows, n, 3) each."""

    kind: str
    origins: np.ndarray
    vectors: np.ndarray
    colours: np.ndarray
    thick: float  # diameter [m]


def arrows_of(scene: Scene, rows: np.ndarray, colour: Colour) -> Iterator[Arrows]:
    """Yield the forces on the wheels, their loads, the velocity and the wind at some rows."""
    force, contacts, n = scene.force[rows], scene.contacts[rows], len(rows)

    def alike(colour: Sequence[float], count: int) -> np.ndarray:
        return np.broadcast_to(np.array(colour), (n, count, 3))

    used = np.nan_to_num(scene.used[rows])[:, :, None]
    tints = np.where(used > AT_GRIP, np.array(HOT), np.array(CALM))
    yield Arrows("forces", contacts + np.array([0.0, 0.0, 0.05]), force * PER_NEWTON * [1, 1, 0], tints, 0.09)
    yield Arrows("loads", contacts, force * PER_NEWTON * [0, 0, 0.5], alike((0.45, 0.45, 0.45), 4), 0.04)
    above = np.broadcast_to([0.0, 0.0, scene.car.height + 0.15], (n, 1, 3))
    speed = np.zeros((n, 1, 3))
    speed[:, 0, :2] = scene.velocity[rows] * PER_SPEED
    yield Arrows("velocity", above, speed, alike(colour, 1), 0.07)
    if scene.wind.any():
        wind = np.zeros((n, 1, 3))
        wind[:, 0, 1] = scene.wind[rows, 0] * PER_NEWTON * 2
        beside = np.broadcast_to([0.2, 0.0, 0.6 * scene.car.height], (n, 1, 3)) - wind
        beside = beside - np.sign(wind) * (0.5 * scene.car.width + 0.2)
        yield Arrows("wind", beside, wind, alike((0.16, 0.56, 0.82), 1), 0.09)


def arc_of(moment: float, height: float) -> np.ndarray:
    """Return a yaw moment as an arc about the car, shape (points, 3)."""
    angle = moment * PER_MOMENT * np.linspace(0.0, 1.0, 16)
    return np.column_stack([RADIUS * np.cos(angle), RADIUS * np.sin(angle), np.full(16, height)])


def triangles(corners: Sequence[tuple[float, float]], height: float) -> np.ndarray:
    """Return the triangles of a convex polygon on the ground, shape (3 n, 3)."""
    fan = [
        (*corner, height) for k in range(1, len(corners) - 1) for corner in (corners[0], *corners[k : k + 2])
    ]
    return np.array(fan, float).reshape(-1, 3)
