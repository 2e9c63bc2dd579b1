"""Wheel spin dynamics, stable down to standstill.

    J dw/dt = T - F_x R - M w / |w|             T > 0 drives forward, T < 0 brakes; M >= 0 resists

T is the drive or brake torque, F_x the tyre force, M the moment of rolling resistance. A negative torque is
friction, as is M: it opposes the rotation, stops the wheel and never reverses it. A wheel at rest stays at
rest until tyre and drive overcome friction.

Slip decays with the rate lambda = C R^2 / (J v), C = dF_x/dkappa, which grows without bound as the car
slows down: at walking pace a tyre force held over the step makes the integration unstable. There are two
remedies.

Tyre with known slip stiffness: it outputs the slip kappa_t that belongs to the force F_x, and the local
stiffness C > 0 there (signals tyre_slip_ratio, slip_stiffness). The wheel is then integrated with

    F_x + C (kappa(t) - kappa_t),    kappa(t) = kappa_0 + kappa_w (w - w_0) + kappa_v (v - v_0)

and v linear over the step, exactly:

    w_end = w_0 + h phi_1 (T - M - R F_0) / J - h phi_2 (R C / J) kappa_v (v_end - v_0)
    z = h (R C / J) kappa_w,  phi_1 = (1 - exp(-z)) / z,  phi_2 = (1 - phi_1) / z

(the exponential Rosenbrock-Euler step), with F_0 the force at kappa_0. It is stable for every z, of second
order in the step like a force held at its middle, and more accurate: only the deviation of the force from its
tangent is extrapolated from the last two steps. A master transfers F_x, C and kappa_t by the same coupling
algorithm, so they belong together, whatever the algorithm.

Tyre without it (C = 0, or C < 0 beyond the peak, where slip does not settle): the stiffness is estimated as
stiffness_per_load F_z / (1 + (kappa / 0.1)^2), and the change of the slip speed u = w R - v is reduced to
what is stable with a force held over the step,

    u_end = u_same + gamma (u_free - u_same),     gamma = min(1, 0.6 / (lambda h)),

where u_free follows from the first equation and u_same = u v_end / v is the slip speed of the same slip at
the new speed. A steady slip stays exact (u_free = u_same), and the rolling motion is not affected: the wheel
follows the car without delay, and the slip settles within a few steps, later than that of the true wheel but
far faster than the car. Above lambda h = 0.6, which is below about 6 to 10 m/s with steps of 1 ms, accuracy
of the fast slip transient is traded for stability; at higher speed or with smaller steps gamma = 1 and the
step is unchanged.
"""

from math import expm1

BEARABLE = 0.6
"""Largest lambda h for a force extrapolated from the last two steps; above 1 the slip is unstable."""


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
        torque: wheel torque T [N.m]; if negative, a friction torque.
        resistance: moment M of rolling resistance [N.m], >= 0, also a friction torque.
        f_x: longitudinal tyre force [N], held.
        v, v_end: longitudinal velocity of the wheel at start and end of the step, wheel axes [m/s].
        stiffness: estimate of dF_x/dkappa at the present load [N], for a tyre without `slip_stiffness`.
        radius, inertia: R [m], J [kg.m2].
        v_low: reference speed of slip for slower wheels [m/s].
        slip_stiffness: C = dF_x/dkappa as output by the tyre [N]; 0 if unknown.
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
        else:  # negative for a wheel that turns against its travel: slip does not settle there
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
