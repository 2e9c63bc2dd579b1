"""Yaw-moment allocation as one longitudinal force per side, split front to rear in fixed shares.

Law: `control_laws.side_forces`. The driver's force: `control_laws.allocator`.

Source: paper B, equations (25)-(28).
"""

from dataclasses import dataclass

from yawbench.vocabulary.wheels import Four

from ..cars.published_cars import PaperB
from ..control_laws.allocator import Allocator, DriveParameters
from ..control_laws.side_forces import SIDE_FORCES, share_sides
from ..fmi.variables import like, parameter


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
    drive_front_share: float = like(DriveParameters, "drive_front_share")
    brake_front_share: float = like(DriveParameters, "brake_front_share")


class SideShare(Allocator):
    """Yaw-moment allocation as one longitudinal force per side, split front to rear in fixed shares."""

    Parameters = SideShareParameters

    def share(self, u: list[float], arms: Four) -> Four:
        p = self.p
        return share_sides(
            u[0],
            p.side_forces,
            front_left=p.front_share_left,
            front_right=p.front_share_right,
            arms=arms,
            least_arm=self.least_arm,
        )
