"""The sliding-mode law: the printed equations, its switching functions, its sign, its limits."""

from __future__ import annotations

import random

import pytest

from yawbench.components.control_laws.sliding_surface import ERRORS, saturation, sign
from yawbench.components.controllers.sliding_mode import SlidingMode

from .stand import Stand

I_Z = 1343.1


def signals(*values: float, speed: float = 20.0) -> dict[str, float]:
    return dict(zip(ERRORS, values, strict=True)) | {"velocity_x": speed}


def outputs(stand: Stand, *values: float, speed: float = 20.0) -> tuple[float, float]:
    y = stand.step(0.005, **signals(*values, speed=speed))
    return y["yaw_moment"], y["sliding_surface"]


@pytest.mark.parametrize("switching", ["sign", "saturation"])
def test_the_moment_is_that_of_the_printed_law(switching):
    rng = random.Random(1)
    stand = Stand(SlidingMode, switching=switching, moment_limit=1e6)
    stand.start()
    for _ in range(200):
        r_ref, beta_ref, dr_ref, dbeta_ref, r, beta, dbeta = (rng.uniform(-0.3, 0.3) for _ in ERRORS)
        s = (r_ref - r) - 0.25 * (beta_ref - beta)
        switched = (s > 0) - (s < 0) if switching == "sign" else min(max(s / 0.1, -1.0), 1.0)
        expected = I_Z * (dr_ref + 1.0 * switched + 10.0 * s - 0.25 * (dbeta_ref - dbeta))
        moment, surface = outputs(stand, r_ref, beta_ref, dr_ref, dbeta_ref, r, beta, dbeta)
        assert surface == pytest.approx(s, rel=1e-12)
        assert moment == pytest.approx(expected, rel=1e-9, abs=1e-9)


def test_the_switching_functions_differ_only_inside_the_boundary_layer():
    assert [sign(x) for x in (-2.0, -1e-9, 0.0, 1e-9, 2.0)] == [-1.0, -1.0, 0.0, 1.0, 1.0]
    assert [saturation(x, 0.1) for x in (-2.0, -0.1, -0.05, 0.0, 0.05, 0.1, 2.0)] == [
        -1.0,
        -1.0,
        -0.5,
        0.0,
        0.5,
        1.0,
        1.0,
    ]
    assert saturation(1e-9, 0.0) == 1.0
    assert saturation(0.0, 0.0) == 0.0


def test_the_moment_fades_out_at_walking_pace():
    stand = Stand(SlidingMode)
    stand.start()
    small = (0.01, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    whole = outputs(stand, *small)[0]
    assert outputs(stand, *small, speed=0.5)[0] == pytest.approx(0.25 * whole)
    assert outputs(stand, *small, speed=0.0)[0] == 0.0
    assert outputs(stand, *small, speed=-5.0)[0] == 0.0
