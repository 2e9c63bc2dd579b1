"""Step steer, understeer gradient, lane change: closed forms, and the theory for every plant."""

from __future__ import annotations

from cmath import phase
from math import atan2, exp, log, pi, sqrt
from pathlib import Path

import numpy as np
import pytest

import yawbench as yb
from tests.cars import load_scenario, make_plan
from tests.proving_ground.test_sine_with_dwell import SAMPLING, as_sampled
from tests.refusals import each_mentions, mentions
from yawbench.components.drivers.sine_sweep import SineSweepParameters, sweep
from yawbench.metrics.verdict import Status, Verdict
from yawbench.orchestrator.results.reader import Results
from yawbench.orchestrator.results.run_record import RunRecord
from yawbench.orchestrator.scenario.catalogue import SHIPPED
from yawbench.proving_ground.braking_and_wind import evaluate_turn
from yawbench.proving_ground.double_lane_change import evaluate_lane_change, judge_entry_speeds
from yawbench.proving_ground.standard_tests import Evaluation
from yawbench.proving_ground.steady_state_steering import evaluate_understeer
from yawbench.proving_ground.steering_response import evaluate_step, evaluate_sweep
from yawbench.proving_ground.trace import Trace, trace_of
from yawbench.tyre_stand import cornering_stiffness
from yawbench.vocabulary.wheels import WHEELS

SINGLE_TRACK = ("plant_two_dof", "plant_seven_dof", "plant_eight_dof", "plant_fourteen_dof")
NO_DRAG = {
    "vehicle.drag_coefficient": 0.0,
    "vehicle.rolling_resistance": 0.0,
    "driver.constant_drive_force": 0.0,
}
STEP, GAIN, DAMPING, FREQUENCY = 0.8, 0.25, 0.5, 8.0  # hand wheel [rad], of the yaw rate [1/s], [1], [rad/s]


def step_trace(sampling) -> Trace:
    """Return a car whose yaw rate is an oscillator's answer to a step at 1 s, to the right."""
    t = sampling(7.0)
    s = np.maximum(t - 1.0, 0.0)
    damped = FREQUENCY * sqrt(1.0 - DAMPING**2)
    phase = atan2(sqrt(1.0 - DAMPING**2), DAMPING)
    fading = np.exp(-DAMPING * FREQUENCY * s) / sqrt(1.0 - DAMPING**2)
    answer = np.where(t >= 1.0, 1.0 - fading * np.sin(damped * s + phase), 0.0)
    return Trace(
        "step",
        t,
        {
            "steering_wheel_angle": -STEP * np.clip((t - 0.9) / 0.2, 0.0, 1.0),
            "yaw_rate": -GAIN * STEP * answer,
            "acceleration_y": -5.0 * (1.0 - np.exp(-s / 0.2)),
            "sideslip": 0.02 * (1.0 - np.exp(-s / 0.2)),
            "velocity_x": np.full_like(t, 25.0),
        },
    )


@as_sampled
def test_a_step_steer_gives_gain_response_time_and_overshoot_of_its_closed_form(sampling):
    judged = evaluate_step(step_trace(sampling))
    assert judged.diagnostics == []
    assert judged["step"] == pytest.approx(-STEP)
    assert judged["zero"] == pytest.approx(1.0, abs=1e-9)
    assert judged["yaw_rate_gain"] == pytest.approx(GAIN, rel=1e-5)
    assert judged["yaw_rate_overshoot"] == pytest.approx(exp(-pi * DAMPING / sqrt(1 - DAMPING**2)), abs=2e-4)
    assert judged["yaw_rate_peak"] == pytest.approx(pi / (FREQUENCY * sqrt(1 - DAMPING**2)), abs=0.006)
    assert judged["acceleration_y_gain"] == pytest.approx(5.0 / STEP, rel=1e-5)
    assert judged["acceleration_y_response"] == pytest.approx(0.2 * log(10.0), abs=2e-4)
    assert judged["t_beta"] == pytest.approx(0.02 * judged["yaw_rate_peak"], rel=1e-5)


@pytest.mark.parametrize(
    "column, made, names",
    [
        ("steering_wheel_angle", lambda x, t: -x, ("'sign: -1'", "yaw", "rate")),
        ("yaw_rate", lambda x, t: -x, ("'sign: -1'", "yaw", "rate")),
        ("acceleration_y", lambda x, t: -x, ("'sign: -1'", "lateral", "acceleration")),
        ("steering_wheel_angle", lambda x, t: 0.1 * t, ("hand", "wheel", "record")),  # not held
    ],
)
def test_what_is_no_step_or_not_answered_gives_nothing(column, made, names):
    trace = step_trace(SAMPLING["1 kHz"])
    trace.signals[column] = made(trace.signals[column], trace.time)
    judged = evaluate_step(trace)
    assert judged.quantities == {}
    assert each_mentions(judged.diagnostics, names)


@as_sampled
@pytest.mark.parametrize("held", ["speed", "radius"])
def test_the_understeer_gradient_does_not_depend_on_what_is_held(sampling, held):
    t = sampling(30.0)
    a_y = 0.2 * t
    v = np.full_like(t, 22.0) if held == "speed" else np.sqrt(np.maximum(a_y, 1e-3) * 60.0)
    r = a_y / v
    extra = 0.004 * a_y + 1e-4 * a_y**3
    facts = {"steering_ratio": 16.0, "cg_to_front_axle": 1.2, "cg_to_rear_axle": 1.5}
    signals = {"velocity_x": v, "yaw_rate": -r, "acceleration_y": -a_y,
               "steering_wheel_angle": -16.0 * (2.7 * r / v + extra)}  # fmt: skip
    judged = evaluate_understeer(Trace("slow", t, signals, facts=facts))
    for answer in ("yaw_rate", "acceleration_y"):
        turned = evaluate_understeer(Trace("slow", t, signals | {answer: -signals[answer]}, facts=facts))
        assert turned.quantities == {}
        assert mentions(turned.diagnostics[0], "opposes the steering")
    assert judged["gradient"] == pytest.approx(0.004, rel=1e-9)
    assert judged["gradient_hand"] == pytest.approx(0.064, rel=1e-9)
    assert judged["gradient_4"] == pytest.approx(0.004 + 3e-4 * 16.0, rel=0.01)  # over 1 m/s2
    assert judged["characteristic_speed"] == pytest.approx(sqrt(2.7 / 0.004))
    assert judged["gradient_6"] is None  # 5.5 to 6.5 m/s2, the run ends at 6
    del facts["steering_ratio"]
    lacking = evaluate_understeer(Trace("slow", t, signals, facts=facts))
    assert each_mentions(lacking.diagnostics, ("steering_ratio", "parameter"))


def theory() -> tuple[float, float, float, float]:
    """Return wheelbase, stability factor K, steering ratio and speed; stiffness of the tyres."""
    plan = make_plan(load_scenario(SHIPPED / "proving_ground" / "step_steer.yaml"))
    units = {unit.name: unit for unit in plan.instances}
    car = units["plant"].parameters
    m, a, b = (car[name] for name in ("mass", "cg_to_front_axle", "cg_to_rear_axle"))
    loads = {"fl": m * 9.81 * b / (a + b) / 2, "rl": m * 9.81 * a / (a + b) / 2}
    stiffness = cornering_stiffness(units["tyre"], loads)
    k = m / (a + b) ** 2 * (b / stiffness["fl"] - a / stiffness["rl"]) / 2
    return a + b, k, units["driver"].parameters["steering_ratio"], car["initial_speed"]


@pytest.mark.exhaustive
@pytest.mark.parametrize("plant", SINGLE_TRACK)
def test_the_yaw_gain_of_a_step_of_0_2_m_per_s2_is_that_of_the_single_track_theory(plant):
    wheelbase, k, ratio, v = theory()
    gain = v / (wheelbase * (1.0 + k * v * v)) / ratio
    base = yb.load("proving_ground/step_steer").swap(plant=plant).set(NO_DRAG)
    judged = evaluate_step(trace_of(base.set({"driver.amplitude": 0.2 / (gain * v)}).run().results))
    assert judged["acceleration_y_steady"] == pytest.approx(0.2, rel=0.003)
    assert judged["yaw_rate_gain"] == pytest.approx(gain, rel=0.0005)  # 0.3 % was asked for
    assert judged.diagnostics == []


@pytest.mark.exhaustive
def test_the_understeer_gradient_of_a_slow_ramp_is_that_of_the_single_track_theory():
    wheelbase, k, _, _ = theory()
    run = yb.load("proving_ground/slow_ramp").set({"stop_time": 10.0, **NO_DRAG}).run()
    judged = evaluate_understeer(trace_of(run.results))
    assert judged["gradient"] == pytest.approx(k * wheelbase, rel=0.003)  # 1 % was asked for


@pytest.mark.exhaustive
@pytest.mark.parametrize("name, speed", [("iso_3888_1", 80.0), ("iso_3888_1", 100.0), ("iso_3888_2", 60.0)])
def test_the_lane_changes_of_iso_3888_are_driven_clean_without_control_to_either_side(name, speed):
    base = yb.load(f"proving_ground/{name}").set({"speed": speed / 3.6, "stop_time": 8.0})
    for side in (3.5, -3.5):
        judged = evaluate_lane_change(trace_of(base.set({"driver.lane_offset": side}).run().results))
        assert judged.criteria["clean"].status is Status.PASSED
        assert judged["entry"] == pytest.approx(speed / 3.6, rel=0.005)


def test_a_lane_change_that_touches_a_cone_says_where():
    t = np.arange(0.0, 8.0, 0.01)
    signals = {
        "position_x": 20.0 * t,
        "velocity_x": 20.0 - 0.1 * t,
        "acceleration_y": np.sin(t),
        "cone_overrun": np.where(abs(t - 4.0) < 0.005, 0.12, 0.0),
    }
    facts = {"track_start": 25.0, "cg_to_front_end": 2.0, "cg_to_rear_end": 3.0, "vehicle_width": 1.8,
             "lane_offset": 3.5, "transition_scale": 1.0}  # fmt: skip
    made = Trace("cones", t, signals, facts=facts)
    judged = evaluate_lane_change(made)
    assert judged["entry"] == pytest.approx(20.0 - 0.1 * 23.0 / 20.0)
    assert judged["exit"] == pytest.approx(20.0 - 0.1 * (25.0 + 125.0 + 3.0) / 20.0, abs=0.001)
    assert mentions(judged.criteria["clean"].why, "0.120 m", "55.0 m")
    signals["cone_overrun"][:] = 0.0
    assert evaluate_lane_change(made).verdict.status is Status.PASSED
    longer = Trace("cones", t, signals, facts=facts | {"cg_to_rear_end": 10.0})
    assert mentions(evaluate_lane_change(longer).criteria["clean"].why, "record", "car", "cones")
    stopped = Trace("cones", t, {**signals, "position_x": 0.0 * t}, facts=facts)
    assert evaluate_lane_change(stopped).verdict.status is Status.NOT_JUDGED
    plain = evaluate_lane_change(Trace("no lanes", t, signals, facts={"track_start": 25.0}))
    assert plain["exit"] == pytest.approx(20.0 - 0.1 * 7.99)


def test_a_series_counts_no_clean_run_above_one_that_was_not():
    def judged(**runs: Status):
        made = []
        for speed, status in runs.items():
            made.append(Evaluation(speed))
            made[-1].add("entry", "speed", float(speed.removeprefix("v")), "m/s")
            made[-1].rule("clean", Verdict(status))
        return judge_entry_speeds(made)

    clean = Status.PASSED
    series = judged(v18=clean, v16=clean, v17=Status.NOT_JUDGED, v15=clean)
    assert series.data == {"highest_clean_entry_speed": 16.0, "lowest_not_clean": 17.0}
    assert mentions(series.summary, "57.6 km/h", "61.2 km/h", "clean", "entry")
    assert mentions(judged(v15=Status.FAILED).summary, "clean")


@as_sampled
def test_a_braked_turn_gives_the_ratios_of_its_closed_form(sampling):
    t = sampling(12.0)
    late = np.maximum(t - 9.0, 0.0)
    v = 20.0 - 4.0 * late
    more = 1.0 + 0.3 * late * np.exp(1.0 - late / 0.5) / 0.5  # 1.3 at its peak, 0.5 s after the action
    signals = {
        "velocity_x": v,
        "yaw_rate": -v / 80.0 * more,
        "acceleration_y": -(v**2) / 80.0 * more,
        "sideslip": np.radians(1.0 - late),
    }

    def evaluated(changes=(), **facts):
        return evaluate_turn(Trace("turn", t, signals | dict(changes), facts=facts))

    judged = evaluated(action_time=9.0)
    assert judged.diagnostics == []
    assert judged["radius"] == pytest.approx(-80.0)
    assert judged["deceleration"] == pytest.approx(4.0, rel=1e-3)
    assert judged["yaw_ratio"] == pytest.approx(1.0 + 0.6 * exp(-1.0), rel=1e-3)
    assert judged["yaw_ratio_peak"] == pytest.approx(1.3, rel=1e-3)
    assert judged["a_y_ratio"] == pytest.approx(1.0 + 0.6 * exp(-1.0), rel=1e-3)
    assert judged["sideslip"] == pytest.approx(-np.radians(1.0), rel=1e-3)
    assert mentions(evaluated().diagnostics[0], "action_time", "parameter", "pedals")
    (unsteady,) = evaluated(action_time=9.6).diagnostics
    assert unsteady.code == "test-not-judged" and "not steady" in str(unsteady)
    (why,) = evaluated({"steering_wheel_angle": np.full_like(t, 0.5)}, action_time=9.0).diagnostics
    assert mentions(why, "'sign: -1'", "yaw", "rate")


@as_sampled
def test_a_sweep_gives_the_frequency_response_of_an_oscillator(sampling):
    from scipy.signal import lsim  # not at the top: it takes long, and few tests need it

    omega, damping, gain = 2 * pi * 1.2, 0.5, 0.3
    p = SineSweepParameters(amplitude=0.5)
    fine = np.arange(0.0, 36.0, 0.001)
    steered = np.array([sweep(t, p) for t in fine])
    _, answer, _ = lsim(([gain * omega**2], [1.0, 2 * damping * omega, omega**2]), steered, fine)
    t = sampling(35.9)
    signals = {"steering_wheel_angle": np.interp(t, fine, steered)}
    signals |= {name: np.interp(t, fine, answer) for name in ("yaw_rate", "acceleration_y")}
    judged = evaluate_sweep(Trace("sweep", t, signals))
    turned = evaluate_sweep(Trace("sweep", t, signals | {"yaw_rate": -signals["yaw_rate"]}))
    assert turned.quantities == {}
    assert mentions(str(turned.diagnostics[0]), "'sign: -1'", "yaw", "rate")
    for f in (0.5, 1.0, 1.5, 2.0):
        exact = gain * omega**2 / (omega**2 - (2 * pi * f) ** 2 + 2j * damping * omega * 2 * pi * f)
        assert judged[f"yaw_rate_gain_{f:g}"] == pytest.approx(abs(exact), rel=0.01), f
        assert judged[f"yaw_rate_phase_{f:g}"] == pytest.approx(phase(exact), abs=0.015), f
    # |H| is 1 / sqrt(2) where x^2 - (2 - 4 d^2) x - 1 = 0, x = (f / f_0)^2
    assert judged["yaw_rate_bandwidth"] == pytest.approx(1.2 * sqrt((1 + sqrt(5)) / 2), abs=0.04)
    assert judged["yaw_rate_peak"] == pytest.approx(1 / (2 * damping * sqrt(1 - damping**2)), rel=0.02)


def recorded(fmus) -> RunRecord:
    return RunRecord.model_validate({"fmus": fmus})


def test_a_trace_takes_the_car_from_the_plant_and_the_test_from_the_driver():
    fmus = {
        "driver": {"name": "driver_ramp", "parameters": {"steering_ratio": 17.0, "mass": 1.0}},
        "plant": {"name": "plant_two_dof", "parameters": {"mass": 1800.0}, "defaults": {"cg_height": 0.5}},
        "observer": {"name": "estimator_observer", "parameters": {"mass": 1300.0, "cg_height": 0.6}},
        "other": {"name": "monitor_redundancy", "parameters": {"steering_ratio": 1.0}},
    }
    trace = trace_of(Results(Path(), np.arange(2.0), {}, {"time": "s"}, recorded(fmus)))
    assert trace.facts == {"steering_ratio": 17.0, "mass": 1800.0, "cg_height": 0.5}
    assert trace.mass == 1800.0


def test_the_friction_of_a_run_is_the_lowest_that_a_wheel_met():
    constants = {"tyre": {"name": "tyre_a", "constants": {f"friction_{wheel}": 0.8 for wheel in WHEELS}}}
    road = {"road": {"name": "road_a", "parameters": {"base_friction": 0.7}, "constants": {}}}
    met = {f"road.friction_{wheel}": np.array([0.9, 0.3 if wheel == "rl" else 0.9]) for wheel in WHEELS}
    none = {"time": "s"}

    def friction(columns, fmus):
        units = none | dict.fromkeys(columns, "1")
        return trace_of(Results(Path(), np.arange(2.0), columns, units, recorded(fmus))).friction

    assert friction(met, constants | road) == 0.3
    assert friction({}, constants | road) == 0.7
    assert friction({}, constants) == 0.8
    assert friction({}, {}) is None
