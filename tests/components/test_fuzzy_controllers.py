"""Fuzzy controllers of the sideslip: moments of their rules, gains of the printed table."""

from __future__ import annotations

import numpy as np
import pytest

from yawbench.components.control_laws.sliding_surface import ERRORS
from yawbench.components.controllers.fuzzy_sideslip import FuzzySideslip
from yawbench.components.controllers.fuzzy_sliding_mode import FuzzySlidingMode
from yawbench.components.controllers.sliding_mode import SlidingMode

from .stand import Stand


def moment(e: float, rate: float = 0.0, **parameters: float) -> float:
    stand = Stand(FuzzySideslip, error_range=0.02, error_rate_range=0.2, **parameters)
    return stand.start(sideslip_ref=e, sideslip_rate_ref=rate)["yaw_moment"]


def test_moment_of_a_rule_is_the_centroid_of_its_output_set():
    third = 5000.0 / 3.0
    assert moment(0.02 / 3.0) == pytest.approx(-third, abs=1e-9)  # PS, ZO -> PS
    assert moment(0.02 / 3.0, 0.2 / 3.0) == pytest.approx(-2.0 * third, abs=1e-9)  # PS, PS -> PM
    assert moment(0.02, -0.2) == pytest.approx(0.0, abs=1e-9)  # PB, NB -> ZO


def test_largest_moment_is_the_centroid_of_the_outermost_set():
    assert moment(1.0, 1.0) == pytest.approx(-5000.0 * 8.0 / 9.0, abs=1e-9)
    assert moment(1.0, 1.0, moment_range=900.0) == pytest.approx(-800.0, abs=1e-9)


TABLE = [
    ["SS", "SS", "S", "S", "M"],
    ["SS", "S", "M", "M", "M"],
    ["S", "M", "M", "B", "B"],
    ["S", "M", "B", "B", "BB"],
    ["M", "M", "B", "BB", "BB"],
]
# Centroids of the sets over a range of one: half triangles at the ends.
CENTROID = {"SS": 1 / 12, "S": 0.25, "M": 0.5, "B": 0.75, "BB": 11 / 12}


@pytest.fixture
def stand():
    stand = Stand(FuzzySlidingMode)
    stand.start(velocity_x=20.0)
    return stand


def gains(stand: Stand, mu: float, delta: float) -> tuple[float, float]:
    y = stand.step(0.005, friction=mu, steer_angle=delta)
    return y["reaching_rate"], y["reaching_gain"]


def test_at_the_peaks_of_the_sets_the_gains_are_those_of_the_table(stand):
    for row, cells in enumerate(TABLE):
        for column, cell in enumerate(cells):
            eps, k_d = gains(stand, 0.25 * row, 0.0225 * column)
            assert eps == pytest.approx(3.0 * CENTROID[cell], rel=1e-9)
            assert k_d == pytest.approx(10.0 * CENTROID[cell], rel=1e-9)


def test_gains_rise_with_steering_and_friction_and_hold_beyond_the_ranges(stand):
    # Between the peaks the centroid of clipped sets may dip a little: Mamdani, not interpolation.
    grid = [[gains(stand, mu, delta)[0] for delta in np.linspace(0, 0.09, 5)] for mu in np.linspace(0, 1, 5)]
    assert np.diff(grid, axis=0).min() >= -1e-12
    assert np.diff(grid, axis=1).min() >= -1e-12
    assert gains(stand, 1.4, 0.3) == gains(stand, 1.0, 0.09)
    assert gains(stand, -0.1, 0.0) == gains(stand, 0.0, 0.0)


def test_with_its_gains_as_constants_the_plain_law_gives_the_same_moment(stand):
    errors = dict(zip(ERRORS, (0.3, -0.02, 0.4, 0.05, 0.28, -0.05, 0.02), strict=True)) | {"velocity_x": 20.0}
    y = stand.step(0.005, steer_angle=0.05, friction=0.6, **errors)
    plain = Stand(
        SlidingMode,
        switching="saturation",
        reaching_rate=y["reaching_rate"],
        reaching_gain=y["reaching_gain"],
    )
    plain.start()
    other = plain.step(0.005, **errors)
    assert y["yaw_moment"] == pytest.approx(other["yaw_moment"], rel=1e-12)
    assert y["sliding_surface"] == other["sliding_surface"]
    assert abs(y["yaw_moment"]) > 100.0
