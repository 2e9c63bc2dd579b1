"""A recording drives cars: speed and steering are followed; axles have their own stiffness and grip."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import yawbench as yb
from tests.checkout import ROOT

UNITS = (
    "driver_measured", "reference_single_track", "controller_off", "allocator_load_proportional",
    "wheel_control_direct", "plant_two_dof", "plant_seven_dof", "plant_eight_dof", "plant_fourteen_dof",
    "tyre_magic_formula", "tyre_linear", "tyre_dugoff",
)  # fmt: skip
TIME = np.arange(0.0, 20.001, 0.01)
LAP = """
title: A lap as recorded
vehicle: {vehicle}
speed: 25
friction: 1
stop_time: 20
step_size: 0.002
units:
  driver: {{fmu: driver_measured}}
  reference: {{fmu: reference_single_track}}
  controller: {{fmu: controller_off}}
  allocator: {{fmu: allocator_load_proportional}}
  wheel_control: {{fmu: wheel_control_direct}}
  plant: {{fmu: {plant}}}
  tyre: {{fmu: {tyre}}}
connections:
  - {{from: wheel_control.torque_request_*, to: plant.wheel_torque_*}}
inputs:
  driver.steering_wheel_angle_measured: {{file: lap.csv, column: hand}}
  driver.velocity_x_measured: {{file: lap.csv, column: speed}}
  driver.acceleration_x_measured: {{file: lap.csv, column: a_x}}
"""


def write_lap(folder: Path, hand: np.ndarray, speed: np.ndarray, a_x: np.ndarray) -> None:
    """Write a recording."""
    table = np.column_stack([TIME, hand, speed, a_x])
    header = "time [s],hand [rad],speed [m/s],a_x [m/s2]"
    np.savetxt(folder / "lap.csv", table, "%.9g", ",", header=header, comments="")


def drive(folder: Path, plant: str, tyre: str = "tyre_magic_formula") -> yb.Run:
    """Drive a car as lap.csv says."""
    text = LAP.format(vehicle=ROOT / "scenarios/vehicles/mid_size.yaml", plant=plant, tyre=tyre)
    path = folder / f"{plant}_{tyre}.yaml"
    path.write_text(text)
    return yb.load(path).run()


def demand() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return hand-wheel angle, speed and acceleration of a lap: bends taken slower than straights."""
    hand = 1.1 * np.sin(0.8 * TIME) * np.sin(0.27 * TIME)
    speed = 25.0 - 4.0 * (1.0 - np.cos(0.5 * TIME)) + 1.5 * np.sin(0.9 * TIME) - 1.35 * np.sin(TIME)
    return hand, speed, np.gradient(speed, TIME)


@pytest.mark.parametrize("plant", ["plant_seven_dof", "plant_eight_dof", "plant_fourteen_dof"])
@pytest.mark.sampled(1)
def test_a_noisy_lap_is_driven_within_a_tenth_of_a_metre_per_second(plant, tmp_path):
    write_lap(tmp_path, *demand())
    truth = drive(tmp_path, "plant_fourteen_dof")
    assert truth["acceleration_y"].max() > 4.0 and np.ptp(truth["velocity_x"]) > 5.0
    hand, speed, a_x = (
        np.interp(TIME, truth.time, truth[name])
        for name in ("driver.steering_wheel_angle", "plant.velocity_x", "plant.acceleration_x")
    )
    noise = np.random.default_rng(1)
    write_lap(
        tmp_path,
        hand + noise.normal(0.0, np.radians(0.1), TIME.size),
        speed + noise.normal(0.0, 0.05, TIME.size),
        a_x + noise.normal(0.0, 0.05, TIME.size),
    )
    run = drive(tmp_path, plant)
    error = run["plant.velocity_x"] - np.interp(run.time, TIME, speed)
    assert np.sqrt(np.mean(error**2)) < 0.1
    assert np.corrcoef(run["plant.yaw_rate"], truth["plant.yaw_rate"])[0, 1] > 0.99


SINGLE = """
vehicle: {vehicle}
friction: 1
stop_time: 6
step_size: 0.002
units:
  plant: {{fmu: plant_two_dof, parameters: {{initial_speed: 20}}}}
  tyre: {{fmu: {tyre}, parameters: {{cornering_stiffness_front: 80000, cornering_stiffness_rear: 95000}}}}
inputs:
  plant.steer_angle: 0.02
  plant.yaw_moment: 0
"""


def steady(folder: Path, tyre: str, extra: str = "", values: dict[str, float] | None = None) -> yb.Run:
    """Drive a single-track car at a constant steer angle."""
    path = folder / "single.yaml"
    path.write_text(SINGLE.format(vehicle=ROOT / "scenarios/vehicles/mid_size.yaml", tyre=tyre) + extra)
    return yb.load(path).set(values or {}).run()


@pytest.mark.parametrize("tyre", ["tyre_linear", "tyre_dugoff"])
@pytest.mark.sampled(1)
def test_the_stiffness_of_each_axle_gives_the_understeer_of_the_formula(tyre, tmp_path):
    run = steady(tmp_path, tyre)
    given = run.record["fmus"]["plant"]["parameters"]
    m, a, b = (given[name] for name in ("mass", "cg_to_front_axle", "cg_to_rear_axle"))
    v, c_f, c_r = 20.0, 80000.0, 95000.0
    gradient = m / (a + b) * (b / c_f - a / c_r)
    wanted = 0.02 * v / (a + b + gradient * v * v)
    assert run["plant.yaw_rate"][-1] == pytest.approx(wanted, rel=2e-3)


def test_a_speed_given_from_outside_is_the_cars(tmp_path):
    hand, speed, a_x = demand()
    write_lap(tmp_path, hand, speed, a_x)
    extra = "  plant.velocity_x_measured: {file: lap.csv, column: speed}\n"
    run = steady(tmp_path, "tyre_linear", extra)
    later = run.time > 0.1
    assert run["plant.velocity_x"][later] == pytest.approx(np.interp(run.time, TIME, speed)[later], abs=1e-4)
    v_x, v_y, r = (run[f"plant.{name}"] for name in ("velocity_x", "velocity_y", "yaw_rate"))
    slope = np.gradient(v_y, run.time)
    assert (slope + v_x * r)[500:-5] == pytest.approx(run["plant.acceleration_y"][500:-5], abs=5e-3)


def test_grip_limits_each_axle_on_its_own(tmp_path):
    sharp = {"inputs.plant.steer_angle": 0.3}
    free = steady(tmp_path, "tyre_dugoff", values=sharp)
    low = steady(tmp_path, "tyre_dugoff", values=sharp | {"tyre.grip_front": 0.5})
    front = [sum(np.abs(run[f"tyre.tyre_force_y_{w}"][-1]) for w in ("fl", "fr")) for run in (free, low)]
    loads = sum(low[f"plant.vertical_load_{w}"][-1] for w in ("fl", "fr"))
    assert front[1] < 0.5 * loads < front[0]


def test_what_the_scenario_says_of_a_tyre_beats_the_axles_of_the_vehicle_file(tmp_path):
    car = ROOT / "scenarios/vehicles/in_wheel_motor_car.yaml"
    path = tmp_path / "single.yaml"
    text = SINGLE.format(vehicle=car, tyre="tyre_linear")
    own = "parameters: {cornering_stiffness_front: 80000, cornering_stiffness_rear: 95000}"
    path.write_text(text.replace(f", {own}", ""))
    base = yb.load(path)
    of_file = base.run()
    assert of_file.record["fmus"]["tyre"]["parameters"]["cornering_stiffness_front"] == 100000.0
    softer = base.set({"tyre.cornering_stiffness": 40000.0}).run()
    again = base.set(
        {"tyre.cornering_stiffness_front": 80000.0, "tyre.cornering_stiffness_rear": 80000.0}
    ).run()
    assert np.array_equal(softer["plant.yaw_rate"], again["plant.yaw_rate"])
    assert not np.array_equal(softer["plant.yaw_rate"], of_file["plant.yaw_rate"])
