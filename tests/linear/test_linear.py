"""Linear models: against closed forms and against the responses of runs."""

import numpy as np
import pytest
from scipy.linalg import expm

import yawbench as yb
from yawbench.components.cars.single_track_car import SingleTrackCar

AT = 0.3  # s, straight ahead; the drivers steer from 1 s on
STEP = 1e-4  # rad, a thousandth of what the sine steers


@pytest.fixture(scope="module")
def base():
    return yb.load("fnn_sideslip/25mps").swap(controller="controller_off")


@pytest.fixture(scope="module")
def dynamic(base):
    limits = {"reference.limit_yaw_rate": False, "reference.limit_sideslip": False}
    return base.swap(reference="reference_single_track").set({"reference.mode": "dynamic", **limits})


SHOWN = ["reference.sideslip_ref", "reference.yaw_rate_ref"]


@pytest.fixture(scope="module")
def model(dynamic):
    return yb.linearize(dynamic, at=AT, inputs=["driver.steer_angle"], outputs=SHOWN)


def test_the_single_track_model_has_its_closed_form(dynamic, model):
    unit = next(unit for unit in dynamic.plan().instances if unit.name == "reference")
    names = ("cg_to_front_axle", "cg_to_rear_axle", "cornering_stiffness_front", "cornering_stiffness_rear")
    car = SingleTrackCar(*(float(unit.parameter(name)) for name in ("mass", "yaw_inertia", *names)))
    v = 25.0
    columns = [car.derivatives(*state, delta=delta, v=v) for *state, delta in np.eye(3).tolist()]
    expected = np.array(columns).T
    assert list(model.states) == list(model.outputs) == SHOWN
    assert np.abs(model.A - expected[:, :2]).max() < 1e-6 * np.abs(expected).max()
    assert np.abs(model.B - expected[:, 2:]).max() < 1e-6 * np.abs(expected).max()
    assert np.abs(model.C - np.eye(2)).max() < 1e-9
    assert np.abs(model.D).max() < 1e-9
    assert model.states["reference.yaw_rate_ref"] == "rad/s"
    assert model.inputs == {"driver.steer_angle": "rad"}


def test_the_14_dof_model_has_the_step_response_of_its_run():
    at = 0.7  # s, when the suspension has settled
    outputs = ["plant.yaw_rate", "plant.sideslip", "plant.roll_angle"]
    car = yb.load("fuzzy_pid/sine").swap(controller="controller_off").set({"stop_time": 0.9})
    model = yb.linearize(car, at=at, inputs=["driver.steer_angle"], outputs=outputs)
    runs = [
        car.fault("driver.steer_angle", kind="bias", value=way * STEP, start=at).run() for way in (1.0, -1.0)
    ]
    # the master takes the steer angle in a line from one sample to the next: half a step early
    t = (np.arange(round(0.9 / 1e-3) - round(at / 1e-3)) + 1.5) * 1e-3
    held = np.array([expm(model.A * end) - np.eye(len(model.A)) for end in t])
    states = np.linalg.solve(model.A, held @ model.B)[:, :, 0].T
    for name, c, d in zip(outputs, model.C, model.D[:, 0], strict=True):
        moved = ((runs[0][name] - runs[1][name]) / (2.0 * STEP))[round(at / 1e-3) + 1 :]
        response = c @ states + d
        assert np.abs(response - moved).max() < 1e-3 * np.abs(moved).max(), name


@pytest.mark.parametrize(
    ("code", "arguments"),
    [
        ("argument-invalid", {"at": 9.0}),
        ("signal-unknown", {"inputs": ["driver.steering_angle"]}),
        ("signal-unknown", {"outputs": ["plant.steer_angle"]}),
    ],
)
def test_what_cannot_be_linearized_is_refused(base, code, arguments):
    usual = {"at": AT, "inputs": ["driver.steer_angle"], "outputs": SHOWN}
    with pytest.raises(yb.ScenarioError) as caught:
        yb.linearize(base, **{**usual, **arguments})
    assert caught.value.code == code


def test_python_control_takes_the_model(model):
    control = pytest.importorskip("control")
    space = model.to_control()
    assert isinstance(space, control.StateSpace)
    assert space.output_labels == ["reference_sideslip_ref", "reference_yaw_rate_ref"]
    assert np.allclose(control.poles(space), np.linalg.eigvals(model.A))
