"""The scene of a run: frames, forces, torques, wheels in the air, lanes and ground, sizes of cars."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from ruamel.yaml import YAML

import yawbench as yb
from tests.command_line import status_of
from tests.components.fourteen_dof import P, four
from tests.components.stand import Stand
from tests.refusals import refused
from yawbench.components.plants.fourteen_dof import FourteenDof
from yawbench.foundation.errors import ResultsError
from yawbench.orchestrator.results.reader import Results
from yawbench.orchestrator.results.run_record import FmuRecord, RunRecord
from yawbench.scene.scene import quaternions, samples, scene_of
from yawbench.scene.wheel_motion import travel_of
from yawbench.vocabulary.lane_change import lanes_of
from yawbench.vocabulary.wheels import WHEELS

VEHICLES = sorted((Path(__file__).parents[2] / "scenarios/vehicles").glob("*.yaml"))


@pytest.fixture(scope="module")
def braking():
    """A car of fourteen degrees of freedom that brakes on a road slippery on one side."""
    return yb.load("road/split_braking").run()


def test_the_forces_of_the_scene_accelerate_the_car(braking):
    scene, mass = braking.scene(), 1830.0
    drag = 0.5 * 1.2258 * 0.3 * 2.2 * braking["velocity_x"] ** 2
    along, across = scene.force[:, :, 0].sum(axis=1) - drag, scene.force[:, :, 1].sum(axis=1)
    for force, acceleration in ((along, "acceleration_x"), (across, "acceleration_y")):
        off = np.abs(force / mass - braking[acceleration])
        assert np.quantile(off, 0.99) < 0.02  # but where brakes jump: forces are those of the step's middle
        assert np.abs(braking[acceleration]).max() > 1.0


def test_drive_less_brake_is_the_torque_at_the_wheels_and_brakes_follow_the_pressure(braking):
    scene = braking.scene()
    net = np.stack([braking[f"torque_request_{wheel}"] for wheel in WHEELS], axis=1)
    assert scene.drive_torque - scene.brake_torque == pytest.approx(net, abs=1e-9)
    assert scene.brake_torque[:, 0] == pytest.approx(2.2e-4 * braking["brake_pressure_fl"], abs=1e-6)
    assert scene.brake_torque.max() > 500.0 and scene.drive_torque.min() >= 0.0


def test_motors_drive_or_brake():
    run = yb.load("fnn_sideslip/25mps").run()
    scene = run.scene()
    net = np.stack([run[f"torque_request_{wheel}"] for wheel in WHEELS], axis=1)
    assert (scene.drive_torque - scene.brake_torque == net).all()
    assert (np.minimum(scene.drive_torque, scene.brake_torque) == 0.0).all() and net.min() < 0.0 < net.max()
    assert scene.steer[:, 0] == pytest.approx(run["steer_angle"]) and (scene.steer[:, 2:] == 0.0).all()
    assert scene.force[:, 0, 2] == pytest.approx(run["vertical_load_fl"])
    assert {"roll_angle", "heave"} <= {*scene.missing}


def test_a_wheel_in_the_air_hangs_where_the_plant_has_it():
    high = {"cg_height": 0.95, "initial_speed": 20.0}
    stand = Stand(FourteenDof, **high)
    signals = ("heave", "roll_angle", "pitch_angle", *(f"vertical_load_{wheel}" for wheel in WHEELS))
    y = stand.start()
    rows, heights = [[y[name] for name in signals]], [stand.unit.body[3:7]]
    for k in range(900):
        side = 3300.0 if 100 <= k < 420 else 0.0  # as long as it takes to lift both left wheels
        y = stand.step(1e-3, **four("tyre_force_y", *([0.0, 2.0 * side] * 2)))
        rows.append([y[name] for name in signals])
        heights.append(stand.unit.body[3:7])
    columns = {f"plant.{name}": values for name, values in zip(signals, np.array(rows).T, strict=True)}
    parameters = vars(replace(P, **high)) if hasattr(P, "__dict__") else {}
    fmu = FmuRecord(name="plant_fourteen_dof", role="plant", parameters=dict(parameters))
    record = RunRecord(fmus={"plant": fmu})
    results = Results(Path(), 1e-3 * np.arange(len(rows)), columns, dict.fromkeys(columns, ""), record)
    travel, truth = travel_of(results), np.array(heights)
    lifted = np.stack([columns[f"plant.vertical_load_{wheel}"] <= 0.0 for wheel in WHEELS], axis=1)
    assert lifted.any(axis=0).sum() >= 2 and truth[lifted].max() > 0.05
    assert travel[~lifted] == pytest.approx(truth[~lifted], abs=1e-9)
    assert travel[lifted] == pytest.approx(truth[lifted], abs=0.02 * truth[lifted].max())


def test_body_and_wheels_turn_about_the_centre_of_mass_of_a_car_on_tyre_springs(braking):
    scene = braking.scene()
    row = int(np.argmax(np.abs(scene.pitch)))
    pitch, roll, h = scene.pitch[row], scene.roll[row], scene.car.centre
    down = np.array([np.sin(pitch) * np.cos(roll), -np.sin(roll), np.cos(pitch) * np.cos(roll)])
    centre = scene.body[row] + h * down  # of mass, carried by the body
    assert centre == pytest.approx([0.0, 0.0, h + scene.heave[row]], abs=1e-12)
    assert scene.contacts[row, 0, 0] == pytest.approx(scene.car.front_axle - h * pitch)
    assert scene.contacts[row, 0, 1] == pytest.approx(scene.car.track / 2 + h * roll)
    assert abs(pitch) > 0.01


def test_quaternions_turn_the_nose_down_and_the_left_side_up():
    def turned(q, v):
        axis, w = np.asarray(q[:3]), q[3]
        return v + 2.0 * np.cross(axis, np.cross(axis, v) + w * np.asarray(v))

    x, y = np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])
    assert turned(quaternions(pitch=0.1), x) == pytest.approx([np.cos(0.1), 0.0, -np.sin(0.1)])
    assert turned(quaternions(roll=0.1), y) == pytest.approx([0.0, np.cos(0.1), np.sin(0.1)])
    assert turned(quaternions(yaw=0.1), x) == pytest.approx([np.cos(0.1), np.sin(0.1), 0.0])
    both = quaternions(np.array([0.3, 0.3]), 0.2, 0.1)
    assert both.shape == (2, 4) and np.linalg.norm(both, axis=1) == pytest.approx(1.0)


def test_run_json_has_lanes_and_ground_as_geometry(tmp_path):
    for name, scenario in (("lanes", "proving_ground/iso_3888_2"), ("split", "road/split_braking")):
        assert status_of("run", scenario, "--set", "stop_time=0.5", "--out", tmp_path / name) == 0
    record = json.loads((tmp_path / "lanes/run.json").read_text())
    driver = record["fmus"]["driver"]
    lanes = lanes_of({**driver["defaults"], **driver["parameters"]})
    assert record["geometry"] == {"lanes": [lane._asdict() for lane in lanes]}
    scene = yb.open(tmp_path / "lanes").scene()
    assert list(scene.places.lanes) == lanes
    assert {y for x, y in scene.places.cones if x < lanes[1].start} == {lanes[0].left, lanes[0].right}
    split = yb.open(tmp_path / "split")
    ground = json.loads((tmp_path / "split/run.json").read_text())["geometry"]["ground"]
    assert [[*map(tuple, piece["corners"])] for piece in ground] == [
        [*piece.corners] for piece in split.scene().places.ground
    ]
    assert len({piece["friction"] for piece in ground}) == 2


def test_events_and_the_path_of_the_driver_are_in_the_scene():
    run = yb.load("proving_ground/iso_3888_2").set({"stop_time": 4.0}).run()
    scene = run.scene()
    assert len(scene.events) == len(run.events.rows) > 0
    offset = scene.position[:, 1] - scene.path[:, 1]
    assert offset == pytest.approx(run["path_offset"])


@pytest.mark.parametrize("file", VEHICLES, ids=lambda file: file.stem)
def test_vehicle_files_give_length_width_height_and_overhangs_that_fit(file):
    p = YAML(typ="safe").load(file.read_text())["parameters"]
    a = p["cg_to_front_axle"]
    wheelbase = p["wheelbase"] if "wheelbase" in p else a + p["cg_to_rear_axle"]
    parts = p["front_overhang"] + wheelbase + p["rear_overhang"]
    assert p["vehicle_length"] == pytest.approx(parts, abs=0.002)
    track = p.get("track_width") or max(p["track_width_front"], p["track_width_rear"])
    assert track < p["vehicle_width"] < track + 0.4
    assert p["vehicle_height"] > 2.0 * p["cg_height"]


def test_rows_of_a_scene_are_taken_evenly_with_both_ends():
    time = np.linspace(0.0, 1.0, 1001)
    rows = samples(time, 0.04)
    assert rows[0] == 0 and rows[-1] == 1000 and np.diff(time[rows]).max() < 0.0411


def test_a_run_without_a_position_has_no_scene(braking):
    columns = {name: values for name, values in braking.results.columns.items() if "position" not in name}
    with refused(ResultsError, "signal-unknown", names=("position_x", "position_y")):
        scene_of(replace(braking.results, columns=columns))
