"""Gain-scheduled H-infinity control: its defaults computed again, its bound by a sweep over frequencies."""

from __future__ import annotations

import numpy as np
import pytest

from docs.generate.gain_scheduled import (
    ENTERING,
    MOMENTS,
    SQUARES,
    STEERED,
    WEIGHTED,
    bounded_real,
    plants,
    synthesize,
)
from yawbench.components.controllers.gain_scheduled import GainScheduled

from .stand import Stand

FOUND = synthesize()
UNITS = np.diag([STEERED, MOMENTS[1]])
STATES = ("sideslip", "yaw_rate", "integral")


def defaults(end: str) -> np.ndarray:
    """Return the gains K of an end that the component declares, in its own units."""
    p = GainScheduled.Parameters()
    return np.array([[getattr(p, f"{row}_{x}_gain_{end}") for x in STATES] for row in ("steer", "moment")])


@pytest.mark.parametrize(("place", "end"), [(0, "stable"), (1, "limit")])
def test_the_defaults_are_those_of_the_synthesis(place, end):
    assert defaults(end) == pytest.approx(FOUND.gains[place], rel=1e-3)


@pytest.mark.parametrize("rho", [0.0, 0.3, 0.7, 1.0])
def test_the_gain_from_disturbances_is_below_the_bound_at_every_frequency(rho):
    k = np.linalg.inv(UNITS) @ ((1.0 - rho) * defaults("stable") + rho * defaults("limit"))
    s = (1.0 - rho) * SQUARES[0] + rho * SQUARES[1]
    c = np.vstack([WEIGHTED, np.diag(np.diag(s) ** -0.5) @ k])
    for a, b in plants():
        closed = a + b @ k
        assert max(np.linalg.eigvals(closed).real) < 0.0
        peak = max(
            np.linalg.norm(c @ np.linalg.solve(1j * w * np.eye(3) - closed, ENTERING), 2)
            for w in np.concatenate([[0.0], np.logspace(-2, 3, 400)])
        )
        assert peak < FOUND.gamma * 1.001


def test_one_lyapunov_function_serves_the_whole_schedule():
    q = FOUND.q
    assert min(np.linalg.eigvalsh(q)) > 0.0
    for rho in np.linspace(0.0, 1.0, 5):
        y = np.linalg.inv(UNITS) @ ((1.0 - rho) * FOUND.gains[0] + rho * FOUND.gains[1]) @ q
        s = (1.0 - rho) * SQUARES[0] + rho * SQUARES[1]
        for a, b in plants():
            assert max(np.linalg.eigvalsh(bounded_real(a, b, q, y, s, FOUND.gamma))) < 0.0


def test_brakes_come_in_with_the_schedule():
    stand = Stand(GainScheduled)
    calm = {"yaw_rate_ref": 0.2, "yaw_rate": 0.15, "velocity_x": 25.0, "friction": 1.0}
    y = stand.start(**calm)
    assert y["scheduling"] == 0.0
    assert abs(y["yaw_moment"]) < 10.0
    assert y["added_steer_angle_request"] == pytest.approx(0.2964 * 0.05)
    y = stand.step(1e-9, **calm | {"sideslip": -0.105})
    assert y["scheduling"] == 1.0
    assert y["yaw_moment"] == pytest.approx(-0.105 * 20270.0 + 0.05 * 64050.0, rel=1e-6)
    assert stand.step(1e-9, **calm | {"sideslip": 0.07875})["scheduling"] == pytest.approx(0.5)
