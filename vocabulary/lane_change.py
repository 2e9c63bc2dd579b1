"""The lanes of ISO 3888-1, a double lane change between cones.

    section      1      2       3      4       5, 6
    length      15 m   30 m    25 m   25 m    15 + 15 m
    lane width  1.1 w + 1/4    1.2 w + 1/4    1.3 w + 1/4      w vehicle width [m]

The lane offset, 3.5 m, is measured between the right borders of lanes 1 and 3; lane 5 begins again at
the right border of lane 1. y = 0 is the middle of lane 1. A negative offset mirrors the track.

Source: ISO 3888-1, Passenger cars - Test track for a severe lane-change manoeuvre - Part 1: Double
lane-change. Ours adds: transitions of another length, for speeds that a slippery road does not bear on
the standard's.
"""

from __future__ import annotations

from math import copysign
from typing import NamedTuple

LENGTHS = (15.0, 30.0, 25.0, 25.0, 30.0)
"""Of lane 1, transition 2, lane 3, transition 4 and lanes 5 and 6 together [m]."""


class Lane(NamedTuple):
    """A lane between two rows of cones, from x = start to end, y = right to left [m]."""

    start: float
    end: float
    right: float
    left: float

    @property
    def middle(self) -> float:
        """The y of its middle [m]."""
        return 0.5 * (self.right + self.left)


def lanes(
    *, vehicle_width: float, track_start: float, lane_offset: float, transition_scale: float
) -> tuple[Lane, Lane, Lane]:
    """Return lane 1, lane 3, and lanes 5 and 6 as one.

    Args:
        vehicle_width: w [m].
        track_start: x of the first cones [m].
        lane_offset: of lane 3 to the left [m].
        transition_scale: length of the transitions over the standard's [1].
    """
    one, two, three, four, five = LENGTHS
    two *= transition_scale
    four *= transition_scale
    side = copysign(1.0, lane_offset)
    right = -0.5 * (1.1 * vehicle_width + 0.25)
    made = []
    x = track_start
    for length, gap, factor, offset in (
        (one, two, 1.1, 0.0),
        (three, four, 1.2, abs(lane_offset)),
        (five, 0.0, 1.3, 0.0),
    ):
        border = right + offset
        borders = (side * border, side * (border + factor * vehicle_width + 0.25))
        made.append(Lane(x, x + length, min(borders), max(borders)))
        x += length + gap
    return made[0], made[1], made[2]
