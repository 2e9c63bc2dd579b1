"""Lanes of ISO 3888, double lane changes between cones: part 1, and part 2 (obstacle avoidance).

    section                1              2        3             4        5 (and 6)
    ISO 3888-1  length    15 m           30 m     25 m          25 m     15 + 15 m
                width     1.1 w + 1/4             1.2 w + 1/4            1.3 w + 1/4
    ISO 3888-2  length    12 m           13.5 m   11 m          12.5 m   12 m
                width     1.1 w + 1/4             w + 1                  1.3 w + 1/4, at least 3

with the vehicle width w [m]. The lane offset of part 1, 3.5 m, is measured between the right borders of
lanes 1 and 3; in part 2 the gap between the left border of lane 1 and the right border of lane 3 is 1 m.
Lanes 1 and 5 have the same right border. y = 0 is the middle of lane 1. A negative offset mirrors the track.

Source: ISO 3888-1, Passenger cars - Test track for a severe lane-change manoeuvre - Part 1: Double
lane-change; ISO 3888-2, Part 2: Obstacle avoidance, where the position of lane 5 is our interpretation. Our
addition: transitions of another length, for slippery roads on which the standard's speed is impossible.
"""

from collections.abc import Mapping
from math import copysign
from typing import Any, NamedTuple

PART_1, PART_2 = "iso_3888_1", "iso_3888_2"
LENGTHS = {PART_1: (15.0, 30.0, 25.0, 25.0, 30.0), PART_2: (12.0, 13.5, 11.0, 12.5, 12.0)}
"""Lengths of lane 1, transition 2, lane 3, transition 4 and lane 5, including lane 6 of part 1 [m]."""
GAP = 1.0
"""Gap between the borders of lanes 1 and 3 of part 2 [m]."""

PARAMETERS = ("vehicle_width", "track_start", "lane_offset", "transition_scale")
"""Parameters of a driver that describe the track; `track_standard` selects the part, by default part 1."""


class Lane(NamedTuple):
    """A lane between two rows of cones, from x = start to end, y = right to left [m]."""

    start: float
    end: float
    right: float
    left: float

    @property
    def middle(self) -> float:
        """Position y of the centre line [m]."""
        return 0.5 * (self.right + self.left)


def lanes(
    *,
    vehicle_width: float,
    track_start: float,
    lane_offset: float,
    transition_scale: float,
    standard: str = PART_1,
) -> tuple[Lane, Lane, Lane]:
    """Return lane 1, lane 3, and lanes 5 and 6 combined.

    Args:
        vehicle_width: w [m].
        track_start: x of the first cones [m].
        lane_offset: offset of lane 3 to the left [m]; for part 2 only its sign matters.
        transition_scale: length of the transitions relative to the standard [1].
        standard: a key of `LENGTHS`.
    """
    entry_length, first_gap, side_length, second_gap, exit_length = LENGTHS[standard]
    w = vehicle_width
    first, second, last = 1.1 * w + 0.25, 1.2 * w + 0.25, 1.3 * w + 0.25
    offset = abs(lane_offset)
    if standard == PART_2:
        second, last, offset = w + 1.0, max(last, 3.0), first + GAP
    first_gap *= transition_scale
    second_gap *= transition_scale
    side = copysign(1.0, lane_offset)
    right = -0.5 * first
    sections = []
    x = track_start
    for length, gap, width, shift in (
        (entry_length, first_gap, first, 0.0),
        (side_length, second_gap, second, offset),
        (exit_length, 0.0, last, 0.0),
    ):
        border = right + shift
        borders = (side * border, side * (border + width))
        sections.append(Lane(x, x + length, min(borders), max(borders)))
        x += length + gap
    return sections[0], sections[1], sections[2]


def lanes_of(parameters: Mapping[str, Any]) -> list[Lane]:
    """Return the lanes that a driver's parameters describe; empty without a track or an offset."""
    known = {name: parameters.get(name) for name in PARAMETERS}
    if not all(isinstance(value, (int, float)) for value in known.values()) or known["lane_offset"] == 0:
        return []
    numbers: dict[str, Any] = {name: float(value) for name, value in known.items() if value is not None}
    standard = parameters.get("track_standard", PART_1)
    return list(lanes(**numbers, standard=standard)) if standard in LENGTHS else []
