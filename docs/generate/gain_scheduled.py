"""The gains of `components/controllers/gain_scheduled.py`: `python -m docs.generate.gain_scheduled`.

They solve linear matrix inequalities for one Lyapunov function, at both ends of the schedule and all speeds.
The semidefinite programs need the extra `synthesis`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from yawbench.components.cars.single_track_car import SingleTrackCar
from yawbench.components.control_laws.linear_feedback import error_dynamics

CAR = SingleTrackCar(1830.0, 3234.0, 1.4, 1.65, 81987.0, 94256.0)
"""The large saloon `scenarios/vehicles/hard.yaml`. Chosen: a car that is hard to hold."""
SPEEDS = (15.0, 25.0, 35.0)
"""Speeds [m/s] for which the gains hold. Chosen: country road to motorway."""
LEAK = 1.0
"""Decay [1/s] of the integral of the yaw-rate error. Chosen: no offset is left within seconds."""
SIDESLIP, YAW_RATE, TURNED = 0.05, 0.1, 0.05
"""Errors [rad, rad/s, rad] of equal weight. Chosen: 3 degrees, 6 degrees per second, 3 degrees."""
STEERED = 0.035
"""Added steer angle [rad] of that weight. Chosen: half of the actuator's range."""
MOMENTS = 100.0, 10000.0
"""Moment [N.m] of that weight where the car is stable, and at the limit. Chosen: hardly any; the most."""
DISTURBED = 1.0, 1.0
"""Disturbances of both errors' rates [rad/s, rad/s2] of equal size. Chosen: those of a fast lane change."""


@dataclass(frozen=True)
class Synthesis:
    """Gains K of (delta_a, M) = K (e_beta, e_r, integral of e_r), per end; the bound gamma; the matrix Q."""

    gains: tuple[np.ndarray, np.ndarray]
    gamma: float
    q: np.ndarray


def plants() -> list[tuple[np.ndarray, np.ndarray]]:
    """Return A (3, 3) and B (3, 2) of the errors at each speed, inputs in units of STEERED and 10 kN.m."""
    found = []
    for v in SPEEDS:
        a = np.zeros((3, 3))
        a[:2, :2] = error_dynamics(CAR, v)
        a[2] = 0.0, 1.0, -LEAK
        steer = CAR.derivatives(0.0, 0.0, delta=STEERED, v=v)
        found.append((a, np.array([[steer[0], 0.0], [steer[1], MOMENTS[1] / CAR.i_z], [0.0, 0.0]])))
    return found


WEIGHTED = np.diag([1.0 / SIDESLIP, 1.0 / YAW_RATE, 1.0 / TURNED])
ENTERING = np.array([[DISTURBED[0], 0.0], [0.0, DISTURBED[1]], [0.0, 0.0]])
SQUARES = tuple(np.diag([1.0, (moment / MOMENTS[1]) ** 2]) for moment in MOMENTS)
"""Squares of the inputs of weight 1, per end; linear in between."""


def bounded_real(
    a: np.ndarray, b: np.ndarray, q: np.ndarray, y: np.ndarray, s: np.ndarray, gamma: float
) -> np.ndarray:
    """Return the matrix that is negative definite if K = Y Q^-1 keeps the disturbances' gain below `gamma`.

    Args:
        a, b: A (3, 3), B (3, 2).
        q, y: Q (3, 3) and Y (2, 3).
        s: squares of the inputs of weight 1 (2, 2).
        gamma: bound.
    """
    closed = a @ q + b @ y
    z = WEIGHTED @ q
    return np.block(
        [
            [closed + closed.T, ENTERING, z.T, y.T],
            [ENTERING.T, -gamma * np.eye(2), np.zeros((2, 5))],
            [z, np.zeros((3, 2)), -gamma * np.eye(3), np.zeros((3, 2))],
            [y, np.zeros((2, 5)), -gamma * s],
        ]
    )


def synthesize() -> Synthesis:
    """Return gains whose bound is 5 % above the least one, which would need much larger gains."""
    least = _solve(None)
    return _solve(1.05 * least.gamma)


def _unpacked(x: np.ndarray) -> tuple[np.ndarray, list[np.ndarray]]:
    q = np.zeros((3, 3))
    q[np.triu_indices(3)] = x[:6]
    return q + np.triu(q, 1).T, [x[6:12].reshape(2, 3), x[12:18].reshape(2, 3)]


def _solve(gamma: float | None) -> Synthesis:
    """Solve for the least gamma, or at a given one for the smallest trace of Q's inverse bound."""
    from cvxopt import matrix, solvers

    def inequalities(x: np.ndarray) -> list[np.ndarray]:
        q, ys = _unpacked(x)
        bound = x[18] if gamma is None else gamma
        found = [
            bounded_real(a, b, q, y, s, bound) for a, b in plants() for y, s in zip(ys, SQUARES, strict=True)
        ]
        found.append(-q)
        if gamma is not None:  # [T, I; I, Q] > 0 with the trace of T minimal: gains Y Q^-1 stay small
            t = np.zeros((3, 3))
            t[np.triu_indices(3)] = x[18:24]
            found.append(-np.block([[t + np.triu(t, 1).T, np.eye(3)], [np.eye(3), q]]))
        return found

    n = 19 if gamma is None else 24
    constant = inequalities(np.zeros(n))
    slopes = [[one - none for one, none in zip(inequalities(e), constant, strict=True)] for e in np.eye(n)]
    goal = np.zeros(n)
    goal[18 if gamma is None else [18, 21, 23]] = 1.0
    margin = 1e-7
    solvers.options.update(show_progress=False, abstol=1e-9, reltol=1e-9, feastol=1e-9)
    found = solvers.sdp(
        matrix(goal),
        Gs=[matrix(np.array([s[k].ravel() for s in slopes]).T.copy()) for k in range(len(constant))],
        hs=[matrix(-c - margin * np.eye(len(c))) for c in constant],
    )
    if found["status"] != "optimal":
        raise ArithmeticError(f"the linear matrix inequalities were not solved: {found['status']}")
    x = np.array(found["x"]).ravel()
    q, ys = _unpacked(x)
    units = np.diag([STEERED, MOMENTS[1]])
    first, second = (units @ y @ np.linalg.inv(q) for y in ys)
    return Synthesis((first, second), float(x[18]) if gamma is None else gamma, q)


def main() -> None:
    """Print the gains."""
    found = synthesize()
    print(f"gamma {found.gamma:.4g}")
    for name, k in zip(("stable", "limit"), found.gains, strict=True):
        for actuator, row in zip(("steer", "moment"), k, strict=True):
            print(name, actuator, *(f"{value:.4g}" for value in row))


if __name__ == "__main__":
    main()
