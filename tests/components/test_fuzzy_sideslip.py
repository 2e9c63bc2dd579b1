"""Conventional fuzzy sideslip controller."""

from __future__ import annotations

import pytest

from tests.components.stand import Stand
from yawbench.components.controllers.fuzzy_sideslip import FuzzySideslip


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
