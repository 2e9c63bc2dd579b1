"""The whole chain of the production-like stability control: holds cars that spin, leaves others alone."""

from __future__ import annotations

from math import degrees, radians

import numpy as np
import pytest

import yawbench as yb
from docs.generate.esc_times import chain_times
from yawbench._scenario import Scenario
from yawbench.metrics.verdict import Status
from yawbench.orchestrator.plan import Override
from yawbench.orchestrator.scenario.catalogue import SHIPPED
from yawbench.proving_ground.sine_with_dwell import evaluate_dwell
from yawbench.proving_ground.trace import trace_of
from yawbench.vocabulary.wheels import wheels


def on_the_road(vehicle: str, **settings: object) -> Scenario:
    base = yb.load("proving_ground/sine_with_dwell_esc")
    change = Override.of("vehicle", str(SHIPPED / "vehicles" / f"{vehicle}.yaml"), "test")
    return Scenario(base.path, (change,), base._programs).set(
        {"step_size": 0.0025, "wheel_control.step_size": 0.0025, **settings}
    )


@pytest.mark.parametrize("side", [1.0, pytest.param(-1.0, marks=pytest.mark.exhaustive)])
def test_a_car_that_spins_without_control_passes_sine_with_dwell(side):
    run = on_the_road("hard", **{"driver.amplitude": radians(side * 270.0), "stop_time": 5.5}).run()
    judged = evaluate_dwell(trace_of(run.results), radians(30.2))
    assert {verdict.status for verdict in judged.criteria.values()} == {Status.PASSED}
    assert degrees(np.abs(run["plant.sideslip"]).max()) < 8.0  # 158 without control
    assert max(run[f"wheel_control.{name}"].max() for name in wheels("brake_pressure_*")) > 5e6


def test_on_a_slippery_road_it_needs_not_be_told():
    """No unit but the slip limits knows the friction, and these are told 0.9 where there is 0.4."""
    run = on_the_road("hard", **{"inputs.tyre.friction_*": 0.4, "stop_time": 5.5}).run()
    assert degrees(np.abs(run["plant.sideslip"]).max()) < 6.0
    assert run["reference.friction_shown"].min() < 0.75


@pytest.mark.parametrize(
    "vehicle",
    [
        "hard",
        *(pytest.param(v, marks=pytest.mark.exhaustive) for v in ("saloon75", "small_car", "suv", "van")),
    ],
)
@pytest.mark.parametrize("amplitude", [10.0, 30.0])
def test_on_easy_sines_it_never_acts(vehicle, amplitude):
    """Sines of 0.8 to 0.95 m/s2 and of 2.4 to 2.8."""
    run = (
        on_the_road(vehicle)
        .swap(driver="driver_sine")
        .set({"driver.amplitude": radians(amplitude), "driver.frequency": 0.5, "stop_time": 4.0})
        .run()
    )
    assert np.abs(run["plant.acceleration_y"]).max() > 0.075 * amplitude
    assert run["controller.stability_state"].max() == 0.0
    assert run["controller.brake_preparation"].max() == 0.0
    assert max(run[f"wheel_control.{name}"].max() for name in wheels("brake_pressure_*")) == 0.0


def test_the_times_of_the_chain_begin_at_its_threshold():
    run = on_the_road("hard", **{"driver.amplitude": radians(270.0), "stop_time": 2.5}).run()
    found = chain_times(run.results)
    assert 0.0 < found["to_state"] <= 0.02 + 0.005  # confirmed for 20 ms, sampled every 5 ms
    assert found["to_state"] < found["to_1_bar"] < found["to_force"] < found["to_50_bar"] < 0.4
    assert found["rise"] == pytest.approx(24e6, rel=0.05)  # what one pump gives a front brake
