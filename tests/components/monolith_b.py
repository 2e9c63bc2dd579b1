"""Paper B's car as one system of equations, written down anew, for scipy to solve.

Independent of the components: equations (1)-(4), (8)-(13) of the paper with the errata of
`plants.eight_dof` and rolling resistance as moments on the wheels, the accelerations from one linear system
of four equations, the loop load -> force -> load solved at every instant.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import atan2, copysign, cos, sin

import numpy as np

from .monolith import pieces

M, M_S, I_Z, I_X, A, B, D, H, H_S = 1350.0, 1110.0, 1343.1, 440.6, 1.04, 1.56, 1.48, 0.54, 0.4
K, C, FRONT, H_F, H_R = 56000.0, 2600.0, 0.55, 0.14, 0.14
R, J, DRAG, ROLLING, GRAVITY = 0.313, 2.1, 0.5 * 1.2258 * 0.3 * 1.8, 0.008, 9.81
LENGTH = A + B
PLACES = ((A, D / 2), (A, -D / 2), (-B, D / 2), (-B, -D / 2))  # of fl, fr, rl, rr in the car

Tyre = Callable[[float, float, float, float], tuple[float, float]]
"""(slip angle [rad], slip [1], load [N], friction [1]) -> F_x, F_y [N] in wheel axes."""


def balance(
    state: Sequence[float],
    delta: float,
    mu: Sequence[float],
    tyre: Tyre,
    near: list[float] | None = None,
) -> tuple[np.ndarray, list[float], list[float]]:
    """Return (dv_x, dv_y, dr, ddphi), longitudinal tyre forces and loads, all consistent.

    The loads are sought from those `near` on, by default the static ones.
    """
    v_x, v_y, r, _, _, _, phi, dphi, *spins = state
    slips = []
    for (x, y), w, angle in zip(PLACES, spins, (delta, delta, 0.0, 0.0), strict=True):
        forward, side = v_x - r * y, v_y + r * x
        v = forward * cos(angle) + side * sin(angle)
        slips.append((atan2(side, forward) - angle, (w * R - v) / max(w * R, v), angle))
    f_z = near or [M * GRAVITY * (B if k < 2 else A) / (2 * LENGTH) for k in range(4)]
    for _ in range(400):
        sum_x = sum_y = moment = 0.0
        axle = [0.0, 0.0]
        longitudinal = []
        for k, ((alpha, kappa, angle), (x, y)) in enumerate(zip(slips, PLACES, strict=True)):
            f_x, f_y = tyre(alpha, kappa, f_z[k], mu[k])
            longitudinal.append(f_x)
            x_car = f_x * cos(angle) - f_y * sin(angle)
            y_car = f_x * sin(angle) + f_y * cos(angle)
            axle[k // 2] += y_car
            sum_x += x_car
            sum_y += y_car
            moment += x * y_car - y * x_car
        pitch = H * sum_x / (2 * LENGTH)
        front = (FRONT * (K * phi + C * dphi) + H_F * axle[0]) / D
        rear = ((1 - FRONT) * (K * phi + C * dphi) + H_R * axle[1]) / D
        static_front, static_rear = M * GRAVITY * B / (2 * LENGTH), M * GRAVITY * A / (2 * LENGTH)
        last, f_z = (
            f_z,
            [
                static_front - pitch - front,
                static_front - pitch + front,
                static_rear + pitch - rear,
                static_rear + pitch + rear,
            ],
        )
        if max(abs(p - q) for p, q in zip(last, f_z, strict=True)) < 1e-9:
            break
    else:
        raise AssertionError("the load loop does not converge")
    # Rows: (2), (1), (3), (4); unknowns dv_x, dv_y, dr, ddphi.
    masses = np.array(
        [
            [M, 0.0, M_S * H_S * phi, 0.0],
            [0.0, M, 0.0, -M_S * H_S],
            [0.0, 0.0, I_Z, 0.0],
            [0.0, -M_S * H_S, 0.0, I_X],
        ]
    )
    resisting = DRAG * v_x * abs(v_x)
    right = np.array(
        [
            sum_x - resisting + M * v_y * r - 2 * M_S * H_S * r * dphi,
            sum_y - M * v_x * r,
            moment,
            M_S * H_S * v_x * r + M_S * GRAVITY * H_S * sin(phi) - K * phi - C * dphi,
        ]
    )
    return np.linalg.solve(masses, right), longitudinal, f_z


def solve(
    times: np.ndarray,
    *,
    tyre: Tyre,
    steer: Callable[[float], float],
    speed: float,
    mu: Sequence[float],
    torque: Callable[[float], Sequence[float]] = lambda t: (0.0, 0.0, 0.0, 0.0),
    kinks: Sequence[float] = (),
    tolerance: float = 1e-10,
) -> np.ndarray:
    """Return v_x, v_y, r, x, y, psi, phi, dphi and the four wheel speeds (rows) at `times` (columns)."""

    loads: list[float] | None = None

    def derivatives(t: float, state: np.ndarray) -> list[float]:
        nonlocal loads
        (dv_x, dv_y, dr, ddphi), longitudinal, f_z = balance(state.tolist(), steer(t), mu, tyre, loads)
        loads = f_z
        v_x, v_y, r, _, _, psi, _, dphi = state[:8]
        moved = [v_x * cos(psi) - v_y * sin(psi), v_x * sin(psi) + v_y * cos(psi), r]
        resisting = [ROLLING * load * R * copysign(1.0, w) for load, w in zip(f_z, state[8:], strict=True)]
        wheels = zip(torque(t), longitudinal, resisting, strict=True)
        spun = [(t_w - f_x * R - m_y) / J for t_w, f_x, m_y in wheels]
        return [dv_x, dv_y, dr, *moved, dphi, ddphi, *spun]

    state = np.array([speed, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, *[speed / R] * 4])
    scale = np.array([1.0, 0.1, 0.01, 1.0, 1.0, 0.01, 0.01, 0.1, 10.0, 10.0, 10.0, 10.0])
    return pieces(derivatives, state, times, kinks=kinks, tolerance=tolerance, scale=scale)
