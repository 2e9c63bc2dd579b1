"""Conversion of a yaw moment into longitudinal wheel forces, for any shares of the wheels.

    F_i = s_i M_z / arm_i,    sum(s_i) = 1,    so sum(F_i arm_i) = M_z

A wheel whose arm is nearly zero would need an enormous force for its share. Below `least_arm` the share
fades with (arm / least_arm)^2 and the other wheels take over; the force then goes to zero continuously with
the arm, and the sum remains M_z. The sum falls short of M_z only where the other wheels have hardly any
share, so that less than `LEAST_CARRIED` of the shares is left.
"""

from collections.abc import Sequence

from yawbench.vocabulary.wheels import Four

LEAST_CARRIED = 0.05

NO_FORCE: Four = (0.0, 0.0, 0.0, 0.0)


def share_moment(moment: float, weights: Four, arms: Four, least_arm: float) -> Four:
    """Return longitudinal forces [N] of fl, fr, rl, rr with sum(F_i arm_i) = moment.

    Args:
        moment: yaw moment M_z [N.m].
        weights: non-negative weights, to which the shares are proportional, in any unit.
        arms: lever arms [m], from `wheel_kinematics.lever_arms`.
        least_arm: arm below which a wheel's share fades [m], positive.

    Returns:
        Zero forces if all weights are zero.
    """
    a_fl, a_fr, a_rl, a_rr = arms
    w_fl, w_fr, w_rl, w_rr = weights
    if min(abs(a_fl), abs(a_fr), abs(a_rl), abs(a_rr)) < least_arm:
        return _share_faded(moment, weights, arms, least_arm)
    total = (w_fl + w_fr) + (w_rl + w_rr)
    if total <= 0.0:
        return NO_FORCE
    k = moment / total
    return k * w_fl / a_fl, k * w_fr / a_fr, k * w_rl / a_rl, k * w_rr / a_rr


def _share_faded(moment: float, weights: Sequence[float], arms: Sequence[float], least_arm: float) -> Four:
    # Faded weight divided by the arm, finite at arm = 0.
    per_arm = [
        w / arm if abs(arm) >= least_arm else w * arm / least_arm**2
        for w, arm in zip(weights, arms, strict=True)
    ]
    fl, fr, rl, rr = (x * arm for x, arm in zip(per_arm, arms, strict=True))
    whole = (weights[0] + weights[1]) + (weights[2] + weights[3])
    if whole <= 0.0:
        return NO_FORCE
    k = moment / max((fl + fr) + (rl + rr), LEAST_CARRIED * whole)
    return k * per_arm[0], k * per_arm[1], k * per_arm[2], k * per_arm[3]


def add_drive_force(forces: Four, drive: float, front_share: float) -> Four:
    """Return the forces [N] plus the driver's, equal left and right on each axle.

    Args:
        forces: longitudinal forces of fl, fr, rl, rr [N].
        drive: sum of the driver's forces [N], negative when braking.
        front_share: share of `drive` on the front axle [1].
    """
    front = 0.5 * drive * front_share
    rear = 0.5 * drive * (1.0 - front_share)
    return forces[0] + front, forces[1] + front, forces[2] + rear, forces[3] + rear
