"""Turn the yaw moment into one force per side, split between front and rear in fixed parts.

The law stands in `control_laws.side_forces`. The driver's force comes on top, equal left and right, and is
no part of the moment asked for: with steered front wheels it turns the car by itself, as it does
without any control.

Source: Vehicle yaw stability control based on fuzzy sliding mode direct yaw moment, equations
(25)-(28).
"""

from __future__ import annotations

from dataclasses import dataclass

from ..cars.published_cars import PaperB
from ..cars.wheel_kinematics import lever_arms
from ..control_laws.moment_sharing import add_drive_force
from ..control_laws.side_forces import SIDE_FORCES, share_sides
from ..fmi.component import Component
from ..fmi.variables import like, output, parameter, signal


@dataclass(frozen=True)
class SideShareParameters:
    """Geometry of the car and the shares."""

    cg_to_front_axle: float = like(PaperB, "cg_to_front_axle")
    track_width: float = like(PaperB, "track_width")
    front_share_left: float = parameter(
        0.5,
        "1",
        "Front share of the left side's force",
        "paper B: 0 to 1 in quarters",
        minimum=0.0,
        maximum=1.0,
    )
    front_share_right: float = parameter(
        0.5,
        "1",
        "Front share of the right side's force",
        "paper B: 0 to 1 in quarters",
        minimum=0.0,
        maximum=1.0,
    )
    side_forces: str = parameter(
        "one_side_braked",
        None,
        "All four wheels share the moment, as in paper A, or each side has one force, as in paper B",
        "paper A",
        choices=SIDE_FORCES,
    )
    drive_front_share: float = parameter(
        0.5, "1", "Share of the driver's force in front", "chosen: equal motors", minimum=0.0, maximum=1.0
    )


class SideShare(Component):
    """Yaw moment as one longitudinal force per side, split front to rear in fixed parts."""

    Parameters = SideShareParameters
    inputs = ("yaw_moment", signal("drive_force", optional=True), "steer_angle")
    outputs = (output("force_request_*", "yaw_moment", "drive_force", "steer_angle"),)
    sampled = True

    def output(self, t: float, u: list[float]) -> tuple[float, ...] | list[float]:
        p = self.p
        moment, drive, delta = u
        half_track = 0.5 * p.track_width
        forces = share_sides(
            moment,
            p.side_forces,
            front_left=p.front_share_left,
            front_right=p.front_share_right,
            arms=lever_arms(delta, p.cg_to_front_axle, half_track),
            least_arm=0.25 * half_track,
        )
        return forces if drive == 0.0 else add_drive_force(forces, drive, p.drive_front_share)
