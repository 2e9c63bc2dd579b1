"""Paper C's car as one system of equations, written down anew, for scipy to solve.

Independent of the components: point masses and one rigid body, Jacobians of their velocities from the exact
Euler rates of the rotation yaw, pitch, roll; the mass matrix from these; Lagrange's equations with its
derivatives taken numerically (complex step); forces by the Jacobians of travel and contact points; rolling
resistance as a moment on each wheel.
Velocities w: v_x, v_y, r, dz, dphi, dtheta, du_fl, du_fr, du_rl, du_rr. Coordinates q: the last seven.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import atan2, cos, sin

import numpy as np

from .monolith import pieces

M, M_S, I_Z, I_XS, I_YS, A, B, D, H, H_U = 1830.0, 1650.0, 3234.0, 928.0, 2790.0, 1.4, 1.65, 1.6, 0.5093, 0.32
SPRINGS, DAMPERS, BARS, CENTRES = (34e3, 32e3), (3000.0, 2800.0), (14e3, 6e3), (0.06, 0.11)
TYRE, R, J, AIR, ROLLING, GRAVITY = 230e3, 0.33, 1.5, 0.5 * 1.2258 * 0.3 * 2.2, 0.012, 9.81

HELD = 470.0, 4000.0, 2.0, 3000.0, 0.2
"""The drive: constant force [N], gain [N.s/m], integral time [s], largest force [N], lag [s]."""

M_U = (M - M_S) / 4
H_S = (M * H - 4 * M_U * H_U) / M_S
X_S = -2 * M_U * (A - B) / M_S  # of the sprung mass's centre, from the car's
PLACES = ((A, D / 2), (A, -D / 2), (-B, D / 2), (-B, -D / 2))
SLOPES = tuple(2 * CENTRES[i // 2] / D * (1 if i % 2 == 0 else -1) for i in range(4))
I_ZS = I_Z - M_S * X_S**2 - M_U * sum(x * x + y * y for x, y in PLACES)
STATIC = [M * GRAVITY * (B if i < 2 else A) / (2 * (A + B)) for i in range(4)]

Tyre = Callable[[float, float, float, float, int], tuple[float, float]]
"""(slip angle [rad], slip [1], load [N], friction [1], wheel) -> F_x, F_y [N] in wheel axes."""


def mass_matrix(phi: complex, theta: complex) -> np.ndarray:
    cp, sp, ct, st = np.cos(phi), np.sin(phi), np.cos(theta), np.sin(theta)
    spin = np.zeros((3, 10), complex)  # angular velocity in body axes
    spin[:, 2] = (-st, ct * sp, ct * cp)
    spin[0, 4] = 1
    spin[1, 5], spin[2, 5] = cp, -sp
    total = spin.T @ np.diag([I_XS, I_YS, I_ZS]) @ spin

    def add(mass: float, x: complex, y: complex, dx: float, dy: float, vertical: int) -> None:
        """Add a point at x, y, moved by dx per theta and dy per phi."""
        v = np.zeros((3, 10), complex)
        v[0, [0, 2, 5]] = 1, -y, dx
        v[1, [1, 2, 4]] = 1, x, dy
        v[2, vertical] = 1
        nonlocal total
        total = total + mass * (v.T @ v)

    up, down = H_S - H, H - H_U
    add(M_S, X_S + up * theta, -up * phi, up, -up, 3)
    for i, (x, y) in enumerate(PLACES):
        add(M_U, x - down * theta, y + down * phi, -down, down, 6 + i)
    return total


def travel_rows() -> np.ndarray:
    """Return dc/dw of the four wheels; c is linear in q."""
    rows = np.zeros((4, 10))
    for i, (x, y) in enumerate(PLACES):
        rows[i, [3, 4, 5, 6 + i]] = -1, -y, x - X_S, 1
    return rows


TRAVEL = travel_rows()


def contact_rows(q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the longitudinal and lateral velocities of the contact points per w, vehicle axes."""
    along, across = np.zeros((4, 10)), np.zeros((4, 10))
    c = TRAVEL[:, 3:] @ q
    for i, (x, y) in enumerate(PLACES):
        along[i, [0, 2, 5]] = 1, -(y + H * q[1] + SLOPES[i] * c[i]), -H
        across[i, [1, 2, 4]] = 1, x - H * q[2], H
        across[i] += SLOPES[i] * TRAVEL[i]
    return along, across


def loads(q: np.ndarray) -> np.ndarray:
    return np.maximum(np.array(STATIC) - TYRE * q[3:], 0.0)


def accelerations(q: np.ndarray, w: np.ndarray, f_x: Sequence[float], f_y: Sequence[float]) -> np.ndarray:
    """Return dw/dt from the tyre forces in vehicle axes [N]."""
    along, across = contact_rows(q)
    force = along.T @ f_x + across.T @ f_y
    c, dc = TRAVEL[:, 3:] @ q, TRAVEL @ w
    for axle in (0, 1):
        left, right = 2 * axle, 2 * axle + 1
        bar = BARS[axle] * (c[left] - c[right])
        for i, sign in ((left, 1), (right, -1)):
            force -= TRAVEL[i] * (SPRINGS[axle] * c[i] + DAMPERS[axle] * dc[i] + sign * bar)
    # Every mass lies above the roll centre of its axle, and turns about it with the body.
    arms = [H_S - CENTRES[0], H_S - CENTRES[1], H_U - CENTRES[0], H_U - CENTRES[1]]
    masses = [M_S * (B + X_S) / (A + B), M_S * (A - X_S) / (A + B), 2 * M_U, 2 * M_U]
    force[4] += GRAVITY * np.dot(masses, arms) * sin(q[1])
    force[5] += GRAVITY * (M_S * H_S + 4 * M_U * H_U) * sin(q[2])
    force[6:] += loads(q) - STATIC
    v_x, v_y, r = w[:3]
    small = 1e-30
    mass = mass_matrix(q[1], q[2]).real
    by_phi = mass_matrix(q[1] + 1j * small, q[2]).imag / small
    by_theta = mass_matrix(q[1], q[2] + 1j * small).imag / small
    force -= (by_phi * w[4] + by_theta * w[5]) @ w
    force[4] += 0.5 * w @ by_phi @ w
    force[5] += 0.5 * w @ by_theta @ w
    momentum = mass @ w
    force[0] += r * momentum[1]
    force[1] -= r * momentum[0]
    force[2] -= v_x * momentum[1] - v_y * momentum[0]
    return np.linalg.solve(mass, force)


def balance(
    q: np.ndarray, w: np.ndarray, spins: Sequence[float], delta: float, mu: Sequence[float], tyre: Tyre
) -> tuple[np.ndarray, list[float]]:
    """Return dw/dt and the longitudinal tyre forces in wheel axes."""
    along, across = contact_rows(q)
    f_x, f_y, longitudinal = [], [], []
    f_z = loads(q)
    for i, angle in enumerate((delta, delta, 0.0, 0.0)):
        u, v = along[i] @ w, across[i] @ w
        forward = u * cos(angle) + v * sin(angle)
        rolling = spins[i] * R
        kappa = (rolling - forward) / max(rolling, forward)
        x, y = tyre(atan2(v, u) - angle, kappa, f_z[i], mu[i], i)
        longitudinal.append(x)
        f_x.append(x * cos(angle) - y * sin(angle))
        f_y.append(x * sin(angle) + y * cos(angle))
    dw = accelerations(q, w, f_x, f_y)
    dw[0] -= AIR * w[0] * abs(w[0]) / M
    return dw, longitudinal


def solve(
    times: np.ndarray,
    *,
    tyre: Tyre,
    steer: Callable[[float], float],
    speed: float,
    mu: Sequence[float],
    torque: Callable[[float], Sequence[float]] = lambda t: (0.0, 0.0, 0.0, 0.0),
    held: float | None = None,
    kinks: Sequence[float] = (),
    tolerance: float = 1e-9,
) -> np.ndarray:
    """Return x, y, psi, q (7), w (10) and the four wheel speeds (rows) at `times` (columns).

    Args:
        held: speed [m/s] that the rear wheels hold by a `HELD` drive; None if nothing drives.
    """

    def derivatives(t: float, state: np.ndarray) -> np.ndarray:
        psi, q, w, spins, (integral, force) = state[2], state[3:10], state[10:20], state[20:24], state[24:]
        dw, longitudinal = balance(q, w, spins, steer(t), mu, tyre)
        v_x, v_y, r = w[:3]
        moved = [v_x * cos(psi) - v_y * sin(psi), v_x * sin(psi) + v_y * cos(psi), r]
        turning, pedal = np.array(torque(t)), (0.0, 0.0)
        if held is not None:
            constant, gain, time, most, lag = HELD
            wanted = gain * (held - v_x) + integral
            beyond = wanted > most if held > v_x else wanted < 0.0
            pedal = 0.0 if beyond else gain / time * (held - v_x), (min(max(wanted, 0.0), most) - force) / lag
            turning = turning + np.array([0.0, 0.0, 0.5, 0.5]) * (constant + force) * R
        spun = (turning - R * np.array(longitudinal) - ROLLING * R * loads(q) * np.sign(spins)) / J
        return np.concatenate([moved, w[3:], dw, spun, pedal])

    state = np.zeros(26)
    state[10], state[20:24] = speed, speed / R
    scale = np.array([1, 1, 0.01, *[0.01] * 7, 1, 0.1, 0.01, *[0.1] * 7, *[10.0] * 4, 1e3, 1e3])
    return pieces(derivatives, state, times, kinks=kinks, tolerance=tolerance, scale=scale)[:24]
