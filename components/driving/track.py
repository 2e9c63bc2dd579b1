"""Track of a double lane change: path through the lanes, and overrun of the cones.

The lanes are those of ISO 3888 (`vocabulary.lane_change`); x = 0 is the start of the car. The path follows
the middles of lanes 1 and 5 and, in lane 3, is at the lane offset from the middle of lane 1: in part 1 that
is right of lane 3's middle by 5 % of the vehicle width, since cars run wide to the left there. In the
transitions 2 and 4 it is a half cosine. Paper C gives neither path nor lanes.
"""

from dataclasses import dataclass
from math import cos, hypot, pi, sin
from typing import NamedTuple

from yawbench.vocabulary.lane_change import PART_1, PART_2, lanes

from ..fmi.variables import output, parameter

TRACK_OUTPUTS = (
    output("path_offset", "position_x", "position_y", unit="m", text="Distance from the path, positive left"),
    output(
        "cone_overrun",
        *("position_x", "position_y", "yaw_angle"),
        unit="m",
        text="Distance of the car's outline beyond the cones, 0 inside",
    ),
)
"""Outputs of a driver on a track."""


class Outline(NamedTuple):
    """Outline of a car from above: front and rear end from the centre of mass, half the width [m]."""

    front: float
    rear: float
    half_width: float


@dataclass(frozen=True)
class LaneChangeParameters:
    """Parameters of the track and of the car's outline."""

    vehicle_width: float = parameter(
        1.85, "m", "Vehicle width, from which lane widths follow", "chosen: large saloon", minimum=0.5
    )
    cg_to_front_end: float = parameter(
        2.25, "m", "Front end from the centre of mass", "chosen: large saloon of 4.9 m", minimum=0.1
    )
    cg_to_rear_end: float = parameter(
        2.65, "m", "Rear end from the centre of mass", "chosen: large saloon of 4.9 m", minimum=0.1
    )
    track_start: float = parameter(
        25.0, "m", "Position x of the first cones", "chosen: 1 s at 90 km/h straight ahead"
    )
    lane_offset: float = parameter(
        3.5, "m", "Offset of lane 3, to the right if negative", "ISO 3888-1", minimum=-20.0, maximum=20.0
    )
    transition_scale: float = parameter(
        1.0, "1", "Length of the transitions over that of the standard", "ISO 3888-1", minimum=0.1
    )
    track_standard: str = parameter(
        PART_1,
        None,
        "Standard that defines the lanes; in part 2 only the sign of lane_offset counts",
        "chosen: part 1",
        choices=(PART_1, PART_2),
    )


class Track:
    """Three lanes between cones, and the path through them."""

    def __init__(self, p: LaneChangeParameters) -> None:
        self.lanes = lanes(
            vehicle_width=p.vehicle_width,
            track_start=p.track_start,
            lane_offset=p.lane_offset,
            transition_scale=p.transition_scale,
            standard=p.track_standard,
        )
        self.offset = p.lane_offset if p.track_standard == PART_1 else self.lanes[1].middle
        self.outline = Outline(p.cg_to_front_end, p.cg_to_rear_end, 0.5 * p.vehicle_width)

    def path(self, x: float) -> float:
        """Return the y [m] of the path at `x` [m]."""
        first, second, third = self.lanes
        if x <= second.start:
            return transition(x, first.end, second.start, first.middle, self.offset)
        return transition(x, second.end, third.start, self.offset, third.middle)

    def overrun(self, x: float, y: float, psi: float) -> float:
        """Return the distance [m] of a car at `x`, `y` [m], `psi` [rad] beyond the cones; 0 inside."""
        front, rear, half = self.outline
        reach = hypot(max(front, rear), half)
        worst = 0.0
        for lane in self.lanes:
            if x + reach < lane.start or x - reach > lane.end:
                continue
            c, s = cos(psi), sin(psi)
            for along, across in ((front, half), (front, -half), (-rear, half), (-rear, -half)):
                if lane.start <= x + along * c - across * s <= lane.end:
                    corner = y + along * s + across * c
                    worst = max(worst, corner - lane.left, lane.right - corner)
            for end in (lane.start, lane.end):
                for border, side in ((lane.left, 1.0), (lane.right, -1.0)):
                    along = (end - x) * c + (border - y) * s
                    across = side * ((border - y) * c - (end - x) * s)
                    if -rear <= along <= front and across > -half:
                        worst = max(worst, half - across)
        return worst


def transition(x: float, start: float, end: float, y_start: float, y_end: float) -> float:
    """Return the y [m] at `x` [m] of a half cosine from `start`, `y_start` to `end`, `y_end` [m]."""
    part = min(max((x - start) / (end - start), 0.0), 1.0)
    return y_start + (y_end - y_start) * 0.5 * (1.0 - cos(pi * part))
