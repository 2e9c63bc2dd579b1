"""The cones of a double lane change, from what the driver's record says of its track.

    section      1      2       3      4       5, 6
    length      15 m   30 m    25 m   25 m    15 + 15 m
    lane width  1.1 w + 1/4    1.2 w + 1/4    1.3 w + 1/4      w vehicle width [m]

The right borders of lanes 1 and 5 lie on one line, that of lane 3 by the lane offset to its left; y = 0 is
the middle of lane 1. Source: ISO 3888-1. The same track as the driver's own
(`components/driving/lane_change.py`), to which the tests hold it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

PARAMETERS = ("vehicle_width", "track_start", "lane_offset", "transition_scale")
"""Parameters of a driver that knows such a track."""
LENGTHS = (15.0, 30.0, 25.0, 25.0, 30.0)
"""Of the sections, 5 and 6 together [m]."""
WIDTHS = (1.1, 1.2, 1.3)
"""Of the lanes, over the vehicle's width."""
ROOM = 0.25
"""What is added to every lane's width [m]."""


class Lane(NamedTuple):
    """A lane between two rows of cones, from x = start to end, y = right to left [m]."""

    start: float
    end: float
    right: float
    left: float


def lanes_of(parameters: Mapping[str, Any]) -> list[Lane]:
    """Return the lanes that a driver's parameters describe; none if they are not of such a track."""
    if not all(isinstance(parameters.get(name), (int, float)) for name in PARAMETERS):
        return []
    width, x, offset, scale = (float(parameters[name]) for name in PARAMETERS)
    side = math.copysign(1.0, offset)
    right = -0.5 * (WIDTHS[0] * width + ROOM)
    one, two, three, four, five = LENGTHS
    lanes = []
    for length, gap, factor, shift in (
        (one, two * scale, WIDTHS[0], 0.0),
        (three, four * scale, WIDTHS[1], abs(offset)),
        (five, 0.0, WIDTHS[2], 0.0),
    ):
        borders = side * (right + shift), side * (right + shift + factor * width + ROOM)
        lanes.append(Lane(x, x + length, min(borders), max(borders)))
        x += length + gap
    return lanes
