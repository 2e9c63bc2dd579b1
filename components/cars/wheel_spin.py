"""The spin of the wheels from drive or brake torque, rolling resistance and tyre force, down to standstill.

    J dw/dt = T - F_x R - M w / |w|             T > 0 drives forward, T < 0 brakes; M >= 0 resists

A torque below zero is friction, as M is: it acts against the rotation, stops the wheel and never reverses
it. A wheel at rest stays at rest until tyre and drive overcome friction.

Slip decays with the rate lambda = C R^2 / (J v), C = dF_x/dkappa, which grows without bound as the car
slows: at walking pace a tyre force that is held over the step swings up. There are two remedies.

A tyre that says how its force follows slip: the slip kappa_t that belongs to the force F_x, and the local
stiffness C > 0 there (signals tyre_slip_ratio, slip_stiffness). The wheel then is integrated with

    F_x + C (kappa(t) - kappa_t),    kappa(t) = kappa_0 + kappa_w (w - w_0) + kappa_v (v - v_0)

and v linear over the step, exactly:

    w_end = w_0 + h phi_1 (T - M - R F_0) / J - h phi_2 (R C / J) kappa_v (v_end - v_0)
    z = h (R C / J) kappa_w,  phi_1 = (1 - exp(-z)) / z,  phi_2 = (1 - phi_1) / z

(the exponential Rosenbrock-Euler step), F_0 the force at kappa_0. It is stable for every z, of second order
in the step like a force held at its middle, and nearer to the true wheel: only what is left of the
force beside its tangent is taken from the last two steps. A master hands F_x, C and kappa_t over by the
same rule, so they belong together whatever the rule is.

A tyre that does not (C = 0, and C < 0 beyond the peak, where nothing settles): its stiffness is guessed as
stiffness_per_load F_z / (1 + (kappa / 0.1)^2), and the slip speed u = w R - v takes only the part of
its change that a force held over the step can bear,

    u_end = u_same + gamma (u_free - u_same),     gamma = min(1, 0.6 / (lambda h)),

u_free from the equation above, u_same = u v_end / v that of the same slip at the new speed. A steady
slip stays exact (gamma multiplies what vanishes there) and the rolling motion is untouched: the wheel
follows the car without delay, the slip settles within a few steps, later than the true wheel but far
faster than the car. Above lambda h = 0.6, on 1 ms steps below some 6 to 10 m/s, this trades the
exactness of the slip's own fast motion for stability; at higher speed or smaller steps gamma = 1
and nothing is changed.
"""

from math import expm1

BEARABLE = 0.6
"""lambda h that a force taken from the last two steps can bear well; above 1 it swings up."""


def spin(
    w: float,
    h: float,
    torque: float,
    resistance: float,
    f_x: float,
    v: float,
    v_end: float,
    stiffness: float,
    radius: float,
    inertia: float,
    v_low: float,
    slip_stiffness: float = 0.0,
    tyre_slip: float = 0.0,
) -> float:
    """Return the angular velocity [rad/s] after `h` [s].

    Args:
        w: angular velocity [rad/s].
        torque: wheel torque T [N.m], below zero a friction torque.
        resistance: moment M of rolling resistance [N.m], >= 0, a friction torque too.
        f_x: longitudinal tyre force [N], held.
        v, v_end: longitudinal velocity of the wheel at start and end of the step, wheel axes [m/s].
        stiffness: about the tyre's slip stiffness dF_x/dkappa at its load [N], where it does not say.
        radius, inertia: R [m], J [kg.m2].
        v_low: speed to which the slip of a slower wheel refers [m/s].
        slip_stiffness: the tyre's own C = dF_x/dkappa [N]; 0 if it does not say.
        tyre_slip: the slip that `f_x` and `slip_stiffness` belong to [1].
    """
    rolling = w * radius
    size, speed = abs(rolling), abs(v)
    reference = max(size, speed, v_low)
    kappa = (rolling - v) / reference
    linear = slip_stiffness > 0.0
    moment = -radius * (f_x + slip_stiffness * (kappa - tyre_slip) if linear else f_x)
    friction = resistance
    if torque < 0.0:
        friction -= torque
    else:
        moment += torque
    if w > 0.0:
        moment -= friction
    elif w < 0.0:
        moment += friction
    elif friction:
        if abs(moment) <= friction:
            return 0.0
        moment -= friction if moment > 0.0 else -friction
    if linear:
        # Slopes of kappa(w R, v), at the same slip and the speed in the middle of the step.
        if speed > v_low:
            stretch = max(0.5 * (1.0 + v_end / v), 0.5)
            reference *= stretch
            rolling *= stretch
        if size > speed and size > v_low:
            per_rolling = (v if speed <= v_low else stretch * v) / (rolling * reference)
            per_v = -1.0 / reference
        elif speed > v_low:
            per_rolling = 1.0 / reference
            per_v = -rolling / (stretch * v * reference)
        else:
            per_rolling = 1.0 / v_low
            per_v = -per_rolling
        gain = h * radius * slip_stiffness / inertia
        z = gain * radius * per_rolling
        if z > 1e-4:
            phi_1 = -expm1(-z) / z
            phi_2 = (1.0 - phi_1) / z
        else:  # negative where a wheel turns against its travel: nothing settles there
            z = max(z, 0.0)
            phi_1 = 1.0 - 0.5 * z
            phi_2 = 0.5 - z / 6.0
        w_end = w + h * phi_1 * moment / inertia - gain * phi_2 * per_v * (v_end - v)
    else:
        w_end = w + h * moment / inertia
        slip = 10.0 * (rolling - v) / reference
        rate = stiffness * radius * radius / (inertia * reference * (1.0 + slip * slip))
        if rate * h > BEARABLE:
            u = rolling - v
            if speed > v_low:
                u *= v_end / v
            w_end = (v_end + (u + BEARABLE / (rate * h) * (w_end * radius - v_end - u))) / radius
    if friction and (w * w_end < 0.0 or (w == 0.0 and w_end * moment < 0.0)):
        return 0.0
    return w_end
