"""Ride of a sprung body on four unsprung masses: heave, roll, pitch and wheel travel, coupled with yaw.

Coordinates, all zero at rest: heave z [m] of the sprung mass's centre, roll phi, pitch theta [rad], heights
u_i [m] of the unsprung masses; x_i, y_i is the position of a wheel from the sprung mass's centre. Wheel
travel and contact point, with the lateral slope p_i of the wheel's path, the height h_ci of its roll centre
and h of the car's centre of mass:

    c_i = u_i - z - y_i phi + x_i theta                                                    (1)
    X_i = x_i - h theta,  Y_i = y_i + h phi + p_i c_i          from the centre of mass      (2)

The slope expresses the roll centre: with p_i = (roll centre height) / y_i the contact point does not move
while the body rolls about that height. Forces of spring, damper and anti-roll bar, of the links (by virtual
work of the contact forces f_x, f_y), and of a tyre that cannot pull:

    e_i = k c_i + d dc_i + s (c_i - c_other) - p_i f_yi        upward on the body, beyond static   (3)
    N_i = max(N_i0 - k_t u_i, 0)                                                          (4)

    m_s ddz   = sum(e_i)                          m_u ddu_i = N_i - N_i0 - e_i             (5)
    Q_phi     =  sum(y_i e_i) + h Y + sum(N_i0 (h - h_ci)) sin(phi)                        (6)
    Q_theta   = -sum(x_i e_i) - h X + m g h sin(theta)                                     (7)
    M         = sum(X_i f_yi - Y_i f_xi)                                                   (8)

Roll, pitch and yaw follow from Lagrange's equations with the kinetic energy to second order in the small
angles, for any yaw rate r. A, B are roll and pitch inertia about the centre of mass, I_z the yaw
inertia, D that of the sprung mass, E = B - D; eta = theta + I_xz / A is measured from the principal axis:

    T = A/2 (dphi - r eta)^2 + B/2 (dtheta + r phi)^2 + (I_z - I_xz^2 / A)/2 r^2
        - D (r phi dtheta + r^2 (phi^2 + theta^2) / 2)

    A ddphi   = Q_phi + A eta dr + (A + E) r dtheta + E r^2 phi                            (9)
    B ddtheta = Q_theta - E phi dr - (A + E) r dphi + r^2 (A eta - D theta)               (10)
    (I_z - I_xz^2 / A + A eta^2 - D theta^2 + E phi^2) dr - A eta ddphi + E phi ddtheta
              = M + (A - E) dphi dtheta - 2 r ((A eta - D theta) dtheta + E phi dphi)     (11)

Without damping the energy changes only by the work of the contact forces. The derivation is in
docs/plant_fourteen_dof.md.
"""

from collections.abc import Sequence
from math import ceil, sin, sqrt
from typing import NamedTuple

from yawbench.vocabulary.gravity import G

from ..mathematics.integrators import rk4

RESOLVED = 0.5
"""Largest product of substep and fastest rate: an error of 3e-4 per radian of wheel hop."""

AT_REST = (0.0,) * 14
"""State at rest: z, phi, theta, u_fl, u_fr, u_rl, u_rr [m], [rad], then their rates."""


class Ride(NamedTuple):
    """Constants of body, suspension and tyre springs, in SI units."""

    m_s: float
    m_f: float  # unsprung mass of a front wheel
    m_r: float
    a: float  # distances of the axles from the sprung mass's centre
    b: float
    half_track: float
    h: float  # height of the car's centre of mass
    k_f: float
    k_r: float
    d_f: float
    d_r: float
    s_f: float  # anti-roll bar: force at a wheel per difference of travel
    s_r: float
    p_f: float  # slope of the left wheel's path; the right wheel's is -p
    p_r: float
    k_t: float
    load_f: float  # static load N_0 of a wheel
    load_r: float
    gravity_roll: float  # sum of N_i0 (h - h_ci) [N.m/rad]
    gravity_pitch: float  # m g h
    roll: float  # inertia A
    pitch: float  # B
    yaw_sprung: float  # D
    yaw: float  # I_z - I_xz^2 / A
    tilt: float  # I_xz / A [rad]

    def fastest(self) -> float:
        """Return an upper bound of the natural frequencies and decay rates [1/s]."""
        k = max(self.k_f + 2.0 * abs(self.s_f), self.k_r + 2.0 * abs(self.s_r))
        d = max(self.d_f, self.d_r)
        arm = max(self.a, self.b)
        body = 4.0 * (1.0 / self.m_s + self.half_track**2 / self.roll + arm * arm / self.pitch)
        wheel = 1.0 / min(self.m_f, self.m_r)
        return max(sqrt((k + self.k_t) * wheel + k * body), d * (wheel + body))


class Contact(NamedTuple):
    """Horizontal tyre forces [N] in vehicle axes, f_x then f_y, and their resultants."""

    x_fl: float
    x_fr: float
    x_rl: float
    x_rr: float
    y_fl: float
    y_fr: float
    y_rl: float
    y_rr: float
    x: float  # sum of f_x
    y: float
    moment: float  # about the vertical axis at rest [N.m]


def rates(y: Sequence[float], held: Contact, ride: Ride, lighter: float = -0.0) -> tuple[float, ...]:
    """Return the time derivative of `y` = (r, coordinates, their rates); equations (1)-(11).

    `lighter` [m/s2] is the reduction of gravity normal to the road on an incline; -0.0 changes no bit.
    """
    r, z, phi, theta, u_fl, u_fr, u_rl, u_rr, dz, dphi, dtheta, du_fl, du_fr, du_rl, du_rr = y
    x_fl, x_fr, x_rl, x_rr, y_fl, y_fr, y_rl, y_rr, x_all, y_all, moment = held
    (
        m_s, m_f, m_r, a, b, t, h, k_f, k_r, d_f, d_r, s_f, s_r, p_f, p_r, k_t, load_f, load_r,
        gravity_roll, gravity_pitch, roll, pitch, yaw_sprung, yaw, tilt,
    ) = ride  # fmt: skip
    if lighter:
        gravity_roll *= 1.0 - lighter / G
        gravity_pitch *= 1.0 - lighter / G
    side = t * phi
    front = z - a * theta
    rear = z + b * theta
    c_fl = u_fl - front - side
    c_fr = u_fr - front + side
    c_rl = u_rl - rear - side
    c_rr = u_rr - rear + side
    side = t * dphi
    front = dz - a * dtheta
    rear = dz + b * dtheta
    bar = s_f * (c_fl - c_fr)
    e_fl = k_f * c_fl + d_f * (du_fl - front - side) + bar - p_f * y_fl
    e_fr = k_f * c_fr + d_f * (du_fr - front + side) - bar + p_f * y_fr
    bar = s_r * (c_rl - c_rr)
    e_rl = k_r * c_rl + d_r * (du_rl - rear - side) + bar - p_r * y_rl
    e_rr = k_r * c_rr + d_r * (du_rr - rear + side) - bar + p_r * y_rr
    front = e_fl + e_fr
    rear = e_rl + e_rr
    # The load of a lifted wheel is zero, which is N_0 below the static load.
    n_fl = k_t * u_fl
    n_fr = k_t * u_fr
    n_rl = k_t * u_rl
    n_rr = k_t * u_rr
    if n_fl > load_f:
        n_fl = load_f
    if n_fr > load_f:
        n_fr = load_f
    if n_rl > load_r:
        n_rl = load_r
    if n_rr > load_r:
        n_rr = load_r
    eta = theta + tilt
    e = pitch - yaw_sprung
    turn = (roll + e) * r
    leaning = roll * eta - yaw_sprung * theta
    r_2 = r * r
    q_phi = (
        t * ((e_fl - e_fr) + (e_rl - e_rr))
        + h * y_all
        + gravity_roll * sin(phi)
        + turn * dtheta
        + e * r_2 * phi
    )
    q_theta = b * rear - a * front - h * x_all + gravity_pitch * sin(theta) - turn * dphi + r_2 * leaning
    moment -= h * (theta * y_all + phi * x_all)
    moment -= p_f * (c_fl * x_fl - c_fr * x_fr) + p_r * (c_rl * x_rl - c_rr * x_rr)
    moment += (roll - e) * dphi * dtheta - 2.0 * r * (leaning * dtheta + e * phi * dphi)
    lean = e * phi / pitch
    dr = (moment + eta * q_phi - lean * q_theta) / (
        yaw - yaw_sprung * theta * theta + lean * yaw_sprung * phi
    )
    return (
        dr,
        dz,
        dphi,
        dtheta,
        du_fl,
        du_fr,
        du_rl,
        du_rr,
        (front + rear) / m_s + lighter,
        q_phi / roll + eta * dr,
        q_theta / pitch - lean * dr,
        -(n_fl + e_fl) / m_f + lighter,
        -(n_fr + e_fr) / m_f + lighter,
        -(n_rl + e_rl) / m_r + lighter,
        -(n_rr + e_rr) / m_r + lighter,
    )


def move_ride(
    r: float,
    y: Sequence[float],
    h: float,
    *,
    held: Contact,
    ride: Ride,
    longest: float,
    lighter: float = -0.0,
) -> tuple[float, ...]:
    """Return (r, coordinates, their rates) after `h` [s] of held forces, in substeps up to `longest` [s]."""
    state: tuple[float, ...] = (r, *y)

    def derivatives(t: float, y: Sequence[float]) -> tuple[float, ...]:
        return rates(y, held, ride, lighter)

    if h <= longest:
        return rk4(derivatives, 0.0, h, state)
    parts = ceil(h / longest)
    for _ in range(parts):
        state = rk4(derivatives, 0.0, h / parts, state)
    return state


def loads(y: Sequence[float], ride: Ride) -> tuple[float, float, float, float]:
    """Return the vertical loads N [N] of fl, fr, rl, rr; equation (4)."""
    k_t = ride.k_t
    front, rear = ride.load_f, ride.load_r
    n_fl = front - k_t * y[3]
    n_fr = front - k_t * y[4]
    n_rl = rear - k_t * y[5]
    n_rr = rear - k_t * y[6]
    return (
        n_fl if n_fl > 0.0 else 0.0,
        n_fr if n_fr > 0.0 else 0.0,
        n_rl if n_rl > 0.0 else 0.0,
        n_rr if n_rr > 0.0 else 0.0,
    )
