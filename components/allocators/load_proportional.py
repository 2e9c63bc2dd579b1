"""Yaw-moment allocation in proportion to the vertical loads of the wheels.

    F_i = F_zi / sum(F_z) M_z / arm_i      arm_fl = a sin(delta) - d/2 cos(delta)    arm_rl = -d/2
                                           arm_fr = a sin(delta) + d/2 cos(delta)    arm_rr =  d/2

so sum(F_i arm_i) = M_z. Arms near zero: `control_laws.moment_sharing`. The driver's force
(`control_laws.allocator`) is split between the axles in proportion to their loads. Without any wheel load
all forces are zero; a negative load counts as zero.

`side_forces` selects paper B's two alternatives for the same moment: one force per side of the car, split
between its front and rear wheel in proportion to their loads (`control_laws.side_forces`; paper B, equation
(29) without the factor 1/2 that contradicts (25), (26)).

Source: paper A, equations (36)-(39). Errata: the front-left arm is printed with the wrong sign of a
sin(delta); (38), (39) give both rear wheels the same sign; "2d" is 2/d.
"""

from dataclasses import dataclass

from yawbench.vocabulary.wheels import Four, wheels

from ..cars.published_cars import PaperA
from ..cars.wheel_kinematics import lever_arms
from ..control_laws.allocator import BASIC, Allocator
from ..control_laws.moment_sharing import NO_FORCE, add_drive_force, share_moment
from ..control_laws.side_forces import SIDE_FORCES, load_share, share_sides
from ..fmi.variables import like, output, parameter


@dataclass(frozen=True)
class LoadProportionalParameters:
    """Geometry of the car, and the split between its sides."""

    cg_to_front_axle: float = like(PaperA, "cg_to_front_axle")
    track_width: float = like(PaperA, "track_width")
    side_forces: str = parameter(
        "all_wheels",
        None,
        "All four wheels share the moment, as in paper A, or each side has one force, as in paper B",
        "paper A",
        choices=("all_wheels", *SIDE_FORCES),
    )


class LoadProportional(Allocator):
    """Yaw-moment allocation in proportion to the vertical loads of the wheels."""

    Parameters = LoadProportionalParameters
    inputs = (*Allocator.inputs, "vertical_load_*")
    outputs = (output("force_request_*", *BASIC, *wheels("vertical_load_*")),)

    def output(self, t: float, u: list[float]) -> Four:
        moment, drive, delta, f_fl, f_fr, f_rl, f_rr = u
        if min(f_fl, f_fr, f_rl, f_rr) < 0.0:
            f_fl, f_fr, f_rl, f_rr = max(f_fl, 0.0), max(f_fr, 0.0), max(f_rl, 0.0), max(f_rr, 0.0)
        front = f_fl + f_fr
        total = front + (f_rl + f_rr)
        if total <= 0.0:
            return NO_FORCE
        p = self.p
        arms = lever_arms(delta, p.cg_to_front_axle, self.half_track)
        if p.side_forces == "all_wheels":
            forces = share_moment(moment, (f_fl, f_fr, f_rl, f_rr), arms, self.least_arm)
        else:
            forces = share_sides(
                moment,
                p.side_forces,
                front_left=load_share(f_fl, f_rl),
                front_right=load_share(f_fr, f_rr),
                arms=arms,
                least_arm=self.least_arm,
            )
        return forces if drive == 0.0 else add_drive_force(forces, drive, front / total)
