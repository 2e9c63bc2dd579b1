"""Paper A's car as one system of equations, written down anew, for scipy to solve.

Independent of the components: equations (5)-(18) and (9)-(12) of the paper with the errata of their
docstrings, in Dugoff's printed form, and with the loop load -> force -> acceleration -> load
solved at every instant.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise
from math import cos, pi, sin, sqrt, tan

import numpy as np
from scipy.integrate import solve_ivp

M, I_Z, A, B, D, H, R, J = 1100.0, 1249.0, 1.256, 1.368, 1.65, 0.7, 0.31, 2.1
C_X, C_Y, GRAVITY = 40000.0, 50000.0, 9.81
LENGTH = A + B
PLACES = ((A, D / 2), (A, -D / 2), (-B, D / 2), (-B, -D / 2))  # of fl, fr, rl, rr in the car


def sine(amplitude: float, frequency: float, start: float, periods: float) -> Callable[[float], float]:
    def steer(t: float) -> float:
        inside = start < t < start + periods / frequency
        return amplitude * sin(2 * pi * frequency * (t - start)) if inside else 0.0

    return steer


def pieces(
    derivatives: Callable[[float, np.ndarray], Sequence[float] | np.ndarray],
    state: Sequence[float] | np.ndarray,
    times: np.ndarray,
    *,
    kinks: Sequence[float] = (),
    tolerance: float,
    scale: np.ndarray | float = 1.0,
) -> np.ndarray:
    """Return the states (rows) at `times` (columns) of a system that is smooth but at `kinks`."""
    columns = np.empty((len(state), len(times)))
    edges = [times[0], *sorted(k for k in kinks if times[0] < k < times[-1]), times[-1]]
    for span in pairwise(edges):
        piece = solve_ivp(
            derivatives,
            span,
            state,
            method="DOP853",
            rtol=tolerance,
            atol=tolerance * scale,
            dense_output=True,
        )
        inside = (times >= span[0]) & (times <= span[1])
        columns[:, inside] = piece.sol(times[inside])
        state = piece.y[:, -1]
    return columns


def tyre(alpha: float, kappa: float, load: float, mu: float) -> tuple[float, float]:
    root = sqrt((C_X * kappa) ** 2 + (C_Y * tan(alpha)) ** 2)
    if load <= 0.0 or root == 0.0:
        return 0.0, 0.0
    s = mu * load * (1 + kappa) / (2 * root)
    f = s * (2 - s) if s < 1 else 1.0
    return C_X * kappa / (1 + kappa) * f, -C_Y * tan(alpha) / (1 + kappa) * f


def loads(a_x: float, a_y: float) -> list[float]:
    front = M * GRAVITY * B / (2 * LENGTH) - M * H * a_x / (2 * LENGTH)
    rear = M * GRAVITY * A / (2 * LENGTH) + M * H * a_x / (2 * LENGTH)
    f, r = B * M * H * a_y / (LENGTH * D), A * M * H * a_y / (LENGTH * D)
    return [front - f, front + f, rear - r, rear + r]


def balance(
    state: Sequence[float], delta: float, mu: Sequence[float]
) -> tuple[float, float, float, list[float], list[float]]:
    """Return a_x, a_y, yaw acceleration, longitudinal tyre forces and loads, all consistent."""
    v_x, v_y, r = state[:3]
    spin = state[6:10]
    slips = []
    for (x, y), w, angle in zip(PLACES, spin, (delta, delta, 0.0, 0.0), strict=True):
        forward, side = v_x - r * y, v_y + r * x
        v = forward * cos(angle) + side * sin(angle)
        alpha = np.arctan2(side, forward) - angle
        slips.append((float(alpha), (w * R - v) / max(w * R, v), angle))
    a_x = a_y = 0.0
    for _ in range(200):
        f_z = loads(a_x, a_y)
        total_x = total_y = moment = 0.0
        longitudinal = []
        for (alpha, kappa, angle), f, grip, (x, y) in zip(slips, f_z, mu, PLACES, strict=True):
            f_x, f_y = tyre(alpha, kappa, f, grip)
            longitudinal.append(f_x)
            x_car = f_x * cos(angle) - f_y * sin(angle)
            y_car = f_x * sin(angle) + f_y * cos(angle)
            total_x += x_car
            total_y += y_car
            moment += x * y_car - y * x_car
        change = max(abs(total_x / M - a_x), abs(total_y / M - a_y))
        a_x, a_y = total_x / M, total_y / M
        if change < 1e-12:
            return a_x, a_y, moment / I_Z, longitudinal, f_z
    raise AssertionError("the load loop does not converge")


def solve(
    times: np.ndarray,
    *,
    steer: Callable[[float], float],
    speed: float,
    mu: Sequence[float],
    torque: Callable[[float], Sequence[float]] = lambda t: (0.0, 0.0, 0.0, 0.0),
    kinks: Sequence[float] = (),
    tolerance: float = 1e-10,
) -> np.ndarray:
    """Return v_x, v_y, r, x, y, psi and the four wheel speeds (rows) at `times` (columns)."""

    def derivatives(t: float, state: np.ndarray) -> list[float]:
        a_x, a_y, turn, longitudinal, _ = balance(state, steer(t), mu)
        v_x, v_y, r, _, _, psi = state[:6]
        moved = [v_x * cos(psi) - v_y * sin(psi), v_x * sin(psi) + v_y * cos(psi), r]
        spun = [(t_w - f_x * R) / J for t_w, f_x in zip(torque(t), longitudinal, strict=True)]
        return [a_x + v_y * r, a_y - v_x * r, turn, *moved, *spun]

    state = np.array([speed, 0.0, 0.0, 0.0, 0.0, 0.0, *[speed / R] * 4])
    scale = np.array([1.0, 0.1, 0.01, 1.0, 1.0, 0.01, 10.0, 10.0, 10.0, 10.0])
    return pieces(derivatives, state, times, kinks=kinks, tolerance=tolerance, scale=scale)
