"""Turning a yaw moment into longitudinal wheel forces, whatever the rule that shares it out.

    F_i = s_i M_z / arm_i,    sum(s_i) = 1,    so sum(F_i arm_i) = M_z

A wheel whose arm is nearly zero could carry its share only with an enormous force. Below `least_arm`
its share fades with (arm / least_arm)^2 and the others take over; the force then goes to zero
with the arm, without a jump, and the sum stays M_z. Only where the others had no share to begin with,
so that less than `LEAST_CARRIED` of the shares is left, the sum falls short of M_z.
"""

from collections.abc import Sequence

from vocabulary.wheels import Four

LEAST_CARRIED = 0.05

NO_FORCE: Four = (0.0, 0.0, 0.0, 0.0)


def share_moment(moment: float, weights: Four, arms: Four, least_arm: float) -> Four:
    """Return longitudinal forces [N] of fl, fr, rl, rr with sum(F_i arm_i) = moment.

    Args:
        moment: yaw moment M_z [N.m].
        weights: what each wheel's share is proportional to, not negative, any unit.
        arms: lever arms [m], from `wheel_kinematics.lever_arms`.
        least_arm: arm below which a wheel's share fades [m], positive.

    Returns:
        No forces where all weights vanish: there is no wheel that could carry anything.
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
    # Weight per arm, which is finite at arm = 0 where the weight has faded.
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
        front_share: part of `drive` on the front axle [1].
    """
    front = 0.5 * drive * front_share
    rear = 0.5 * drive * (1.0 - front_share)
    return forces[0] + front, forces[1] + front, forces[2] + rear, forces[3] + rear
