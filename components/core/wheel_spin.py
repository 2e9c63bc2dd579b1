"""The spin of one wheel from drive or brake torque and tyre force, down to standstill.

    J dw/dt = T - F_x R                         T > 0 drives forward, T < 0 brakes

A torque below zero is friction: it acts against the rotation, stops the wheel and never reverses it. A
wheel at rest under such a torque stays at rest until the tyre overcomes it.

Slow wheels. The slip of a wheel decays with the rate lambda = C R^2 / (J v), C the slip stiffness, which
grows without bound as the car slows: at walking pace a tyre force that is held over a step
swings up. The slip speed u = w R - v then takes only the part of its change that a force held over
the step can bear,

    u_end = u_same + gamma (u_free - u_same),     gamma = min(1, 0.6 / (lambda h)),

u_free from the equation above, u_same = u v_end / v that of the same slip at the new speed. A steady
slip stays exact (gamma multiplies what vanishes there) and the rolling motion is untouched: the wheel
follows the car without delay, the slip settles within a few steps, later than the true wheel but far
faster than the car. Above lambda h = 0.6, on 1 ms steps
below some 6 to 10 m/s, this trades the exactness of the slip's own fast motion for stability; at
higher speed or smaller steps gamma = 1 and nothing is changed. For lambda the tyre's stiffness must be
known roughly: it is taken as stiffness_per_load F_z / (1 + (kappa / 0.1)^2), so a sliding
wheel is not slowed.
"""

from __future__ import annotations

BEARABLE = 0.6
"""lambda h that a force taken from the last two steps can bear well; above 1 it swings up."""


def spin(
    w: float,
    h: float,
    *,
    torque: float,
    f_x: float,
    v: float,
    v_end: float,
    radius: float,
    inertia: float,
    stiffness: float,
    v_low: float,
) -> float:
    """Return the angular velocity [rad/s] after `h` [s].

    Args:
        w: angular velocity [rad/s].
        torque: wheel torque T [N.m], below zero a friction torque.
        f_x: longitudinal tyre force [N], held.
        v, v_end: longitudinal velocity of the wheel at start and end of the step, wheel axes [m/s].
        radius, inertia: R [m], J [kg.m2].
        stiffness: about the tyre's slip stiffness dF_x/dkappa at its load [N].
        v_low: speed to which the slip of a slower wheel refers [m/s].
    """
    moment = -radius * f_x
    braked = torque < 0.0
    if not braked or w > 0.0:
        moment += torque
    elif w < 0.0:
        moment -= torque
    elif abs(moment) <= -torque:
        return 0.0
    else:
        moment += torque if moment > 0.0 else -torque
    w_end = w + h * moment / inertia
    rolling = w * radius
    reference = max(abs(rolling), abs(v), v_low)
    slip = 10.0 * (rolling - v) / reference
    rate = stiffness * radius * radius / (inertia * reference * (1.0 + slip * slip))
    if rate * h > BEARABLE:
        u = rolling - v
        if abs(v) > v_low:
            u *= v_end / v
        w_end = (v_end + (u + BEARABLE / (rate * h) * (w_end * radius - v_end - u))) / radius
    if braked and (w * w_end < 0.0 or (w == 0.0 and w_end * moment < 0.0)):
        return 0.0
    return w_end
