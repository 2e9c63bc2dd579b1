"""Yaw-moment allocation in fixed shares, by default equal for all wheels.

    F_i = s_i M_z / arm_i      s_fl = s_l n_l    s_rl = s_l (1 - n_l)       n front shares per side
                               s_fr = s_r n_r    s_rr = s_r (1 - n_r)       s_l + s_r = 1

so sum(F_i arm_i) = M_z. Arms near zero: `control_laws.moment_sharing`; the driver's force:
`control_laws.allocator`.

Source: paper A, section 3.3: "equal distribution", s_i = 1/4. Ours differs: the shares are parameters.
"""

from dataclasses import dataclass

from yawbench.vocabulary.wheels import Four

from ..cars.published_cars import PaperA
from ..control_laws.allocator import Allocator, DriveParameters
from ..control_laws.moment_sharing import share_moment
from ..fmi.variables import like, parameter


@dataclass(frozen=True)
class FixedShareParameters:
    """Geometry of the car and the shares."""

    cg_to_front_axle: float = like(PaperA, "cg_to_front_axle")
    track_width: float = like(PaperA, "track_width")
    left_share: float = parameter(
        0.5, "1", "Share s_l of the moment on the left side", "paper A: half", minimum=0.0, maximum=1.0
    )
    front_share_left: float = parameter(
        0.5, "1", "Share n_l of the left side's moment in front", "paper A: half", minimum=0.0, maximum=1.0
    )
    front_share_right: float = parameter(
        0.5, "1", "Share n_r of the right side's moment in front", "paper A: half", minimum=0.0, maximum=1.0
    )
    drive_front_share: float = like(DriveParameters, "drive_front_share")
    brake_front_share: float = like(DriveParameters, "brake_front_share")


class FixedShare(Allocator):
    """Yaw-moment allocation in fixed shares, by default a quarter per wheel."""

    Parameters = FixedShareParameters

    def configure(self) -> None:
        super().configure()
        p = self.p
        left, right = p.left_share, 1.0 - p.left_share
        self.shares = (
            left * p.front_share_left,
            right * p.front_share_right,
            left * (1.0 - p.front_share_left),
            right * (1.0 - p.front_share_right),
        )

    def share(self, u: list[float], arms: Four) -> Four:
        return share_moment(u[0], self.shares, arms, self.least_arm)
