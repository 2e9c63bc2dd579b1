"""Conversion of a yaw moment into one longitudinal force per side, split between front and rear.

    F_fl = n_l F_l    F_rl = (1 - n_l) F_l          F_fr = n_r F_r    F_rr = (1 - n_r) F_r
    opposite halves:   F_r = -F_l = M / d           one side braked:   F_l = -2 M / d   for M > 0
                                                                       F_r =  2 M / d   for M < 0

M is the moment of the longitudinal forces alone; the loss of lateral force is left to the controller, as in
the paper. Paper B neglects the steer angle, so that every force has the arm d/2. Ours differs: with true arms
(`wheel_kinematics.lever_arms`) sum(F_i arm_i) = M exactly at every steer angle, and the formulas above are
the values at delta = 0. The force of the braked side of a steered car changes by n a sin(delta) / (d/2), 6 %
at 0.09 rad on paper B's car with n = 1/2.

Source: paper B, equations (25)-(29). The paper leaves open which of the two readings it means; its table 3
fits the second.
"""

from yawbench.vocabulary.wheels import Four

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
        least_arm: arm below which a wheel's share fades [m] (`moment_sharing`).
    """
    a_fl, a_fr, a_rl, a_rr = arms
    # Moments proportional to share times arm give forces proportional to the share.
    left = (front_left * abs(a_fl), (1.0 - front_left) * abs(a_rl))
    right = (front_right * abs(a_fr), (1.0 - front_right) * abs(a_rr))
    if reading == "one_side_braked":
        if moment > 0.0:
            right = (0.0, 0.0)
        else:
            left = (0.0, 0.0)
    return share_moment(moment, (left[0], right[0], left[1], right[1]), arms, least_arm)


def load_share(front: float, rear: float) -> float:
    """Return the front wheel's share of the load of a side [1]; half if the side has no load."""
    front, rear = max(front, 0.0), max(rear, 0.0)
    return front / (front + rear) if front + rear > 0.0 else 0.5
