"""Turning a yaw moment into one force per side of the car, split between front and rear.

    F_fl = n_l F_l    F_rl = (1 - n_l) F_l          F_fr = n_r F_r    F_rr = (1 - n_r) F_r
    opposite halves:   F_r = -F_l = M / d           one side braked:   F_l = -2 M / d   for M > 0
                                                                       F_r =  2 M / d   for M < 0

What "the moment asked for" means. Paper B neglects the steer angle, so that every force has the arm
d/2. Ours differs: with true arms (`wheel_kinematics.lever_arms`) sum(F_i arm_i) = M exactly at every
steer angle, and the formulas above are its value at delta = 0. The braked side of a steered car
changes its force by n a sin(delta) / (d/2), 6 % at 0.09 rad on paper B's car with n = 1/2. M is the
moment of the longitudinal forces; what lateral force the tyres lose to them is the controller's
business, as in the paper.

Source: paper B, equations (25)-(29); which of the two readings it means is open, its table 3 fits the second.
"""

from vocabulary.wheels import Four

from .moment_sharing import share_moment

SIDE_FORCES = ("opposite_halves", "one_side_braked")


def share_sides(
    moment: float, reading: str, *, front_left: float, front_right: float, arms: Four, least_arm: float
) -> Four:
    """Return longitudinal forces [N] of fl, fr, rl, rr with sum(F_i arm_i) = moment.

    Args:
        moment: yaw moment M [N.m].
        reading: one of `SIDE_FORCES`.
        front_left, front_right: front shares n_l, n_r of the side forces [1].
        arms: lever arms [m], from `wheel_kinematics.lever_arms`.
        least_arm: arm below which a wheel's share fades [m], see `moment_sharing`.
    """
    a_fl, a_fr, a_rl, a_rr = arms
    # Moments in proportion to share times arm are forces in proportion to the share.
    left = (front_left * abs(a_fl), (1.0 - front_left) * abs(a_rl))
    right = (front_right * abs(a_fr), (1.0 - front_right) * abs(a_rr))
    if reading == "one_side_braked":
        if moment > 0.0:
            right = (0.0, 0.0)
        else:
            left = (0.0, 0.0)
    return share_moment(moment, (left[0], right[0], left[1], right[1]), arms, least_arm)


def load_share(front: float, rear: float) -> float:
    """Return the front wheel's part of the load of one side [1]; half if the side is in the air."""
    front, rear = max(front, 0.0), max(rear, 0.0)
    return front / (front + rear) if front + rear > 0.0 else 0.5
