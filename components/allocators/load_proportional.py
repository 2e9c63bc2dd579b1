"""Share the yaw moment among the wheels in proportion to their vertical loads.

    F_i = F_zi / sum(F_z) M_z / arm_i      arm_fl = a sin(delta) - d/2 cos(delta)    arm_rl = -d/2
                                           arm_fr = a sin(delta) + d/2 cos(delta)    arm_rr =  d/2

so sum(F_i arm_i) = M_z; see `core.moment_sharing` for arms near zero. The driver's force comes on
top, equal left and right as from one pedal, shared between the axles like their loads. A car
without any load on its wheels asks for no force.

Source: Yuan, Chen, Huang, Shi, Adaptive lateral stability control of electric vehicle based on
FNN, equations (36)-(39). Errata: the front-left arm is printed with the wrong sign of a sin(delta);
(38), (39) give both rear wheels the same sign; "2d" is 2/d.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from ..core.component import Component
from ..core.moment_sharing import NO_FORCE, Four, add_drive_force, share_moment
from ..core.roles import wheels
from ..core.variables import output, parameter
from ..core.wheel_kinematics import lever_arms


@dataclass(frozen=True)
class LoadProportionalParameters:
    """Geometry of the car."""

    cg_to_front_axle: float = parameter(
        1.256, "m", "Distance a of the centre of mass from the front axle; paper A, table 1", minimum=0.1
    )
    track_width: float = parameter(1.65, "m", "Track width d; paper A, table 1", minimum=0.1)


def share_by_load(
    moment: float, drive: float, *, delta: float, loads: Sequence[float], a: float, half_track: float
) -> Four:
    """Return the longitudinal forces [N] of fl, fr, rl, rr; equations (36)-(39).

    Args:
        moment, drive: yaw moment [N.m] and sum of the driver's forces [N].
        delta: steer angle [rad].
        loads: vertical loads of fl, fr, rl, rr [N]; a negative one counts as none.
        a, half_track: distances of front axle and wheels from the centre of mass [m].
    """
    f_fl, f_fr, f_rl, f_rr = loads
    if min(f_fl, f_fr, f_rl, f_rr) < 0.0:
        f_fl, f_fr, f_rl, f_rr = max(f_fl, 0.0), max(f_fr, 0.0), max(f_rl, 0.0), max(f_rr, 0.0)
    front = f_fl + f_fr
    total = front + (f_rl + f_rr)
    if total <= 0.0:
        return NO_FORCE
    arms = lever_arms(delta, a, half_track)
    forces = share_moment(moment, (f_fl, f_fr, f_rl, f_rr), arms, 0.25 * half_track)
    return forces if drive == 0.0 else add_drive_force(forces, drive, front / total)


class LoadProportional(Component):
    """Yaw moment shared among the wheels in proportion to their vertical loads."""

    Parameters = LoadProportionalParameters
    inputs = ("yaw_moment", "drive_force", "steer_angle", "vertical_load_*")
    outputs = (
        output("force_request_*", "yaw_moment", "drive_force", "steer_angle", *wheels("vertical_load_*")),
    )
    sampled = True

    def output(self, t, u):
        p = self.p
        half_track = 0.5 * p.track_width
        return share_by_load(u[0], u[1], delta=u[2], loads=u[3:], a=p.cg_to_front_axle, half_track=half_track)
