"""Runs that a program steps: the bits of a run, breakpoints, values changed and states saved on the way."""

from __future__ import annotations

import threading

import numpy as np
import pytest

import yawbench as yb
from tests.refusals import refused


@pytest.fixture(scope="module")
def base():
    return yb.load("fnn_sideslip/25mps").set({"stop_time": 2})


@pytest.fixture(scope="module")
def whole(base):
    return base.run()


def same(run, other, rows=None):
    """Whether all columns of two runs are equal to the bit, or the first rows of them."""
    assert list(run) == list(other)
    return all(np.array_equal(run[name][:rows], other[name][:rows]) for name in run) and np.array_equal(
        run.time[:rows], other.time[:rows]
    )


class Remembering:
    """A law in plain Python that keeps what it has seen, so that it cannot be made native."""

    inputs, outputs = ("yaw_rate_ref", "yaw_rate"), ("yaw_moment",)
    step_size = 0.005

    def start(self, t, u):
        self.seen = []

    def output(self, t, u):
        return 2e4 * (u.yaw_rate_ref - u.yaw_rate) + 10.0 * float(np.sum(self.seen))

    def advance(self, t, h, u):
        self.seen.append(u.yaw_rate)


@pytest.mark.parametrize("loop", ["compiled", "python"])
@pytest.mark.parametrize("law", ["controller_fnn", "python"])
def test_steps_give_the_bits_of_a_run_however_they_are_made(base, loop, law, monkeypatch):
    if loop == "python":
        monkeypatch.setenv("YAWBENCH_LOOP", "python")
    scenario = base.swap(controller=Remembering() if law == "python" else law).set({"stop_time": 1.2})
    whole = scenario.run()
    with scenario.start() as s:
        assert s.step() == whole.time[1]
        assert s.step(7) == whole.time[8]
        assert s.run_to(0.9) == pytest.approx(0.9)
        before = s.save()
        assert s.run_until(lambda: s.time > 1.0)
        s.restore(before)
        assert s.time == pytest.approx(0.9)
        assert same(s.finish(), whole)
        assert s.done


def test_what_was_recorded_so_far_is_the_beginning_of_the_run_and_values_now_its_last_row(base, whole):
    with base.start() as s:
        assert len(s.run) == 1
        s.run_to(1.3)
        part = s.run
        assert len(part) == 1301
        s.step(200)
        for name in whole:
            assert s[name] == whole[name][1500], name
        assert s["sideslip"] == whole["plant.sideslip"][1500]
        assert s["plant.mass"] == 1100.0
        assert s["plant.steer_angle"] == whole["driver.steer_angle"][1500]
        with refused(yb.ScenarioError, "signal-unknown", names=("plant.yaw_rat", "plant.yaw_rate")):
            s["plant.yaw_rat"]
        with refused(yb.ResultsError, "signal-unknown", names=("yaw_rat",)):
            s["yaw_rat"]
    assert same(part, whole, 1301)
    assert part.record["status"] == "interrupted"


def test_a_breakpoint_stops_after_the_first_step_where_it_is_true(base, whole):
    with base.start() as s:
        assert s.run_until(lambda: abs(s["plant.yaw_rate"]) > 0.1)
        assert s.time == whole.time[np.argmax(np.abs(whole["plant.yaw_rate"]) > 0.1)]
        assert not s.run_until(lambda: False, time=1.9)
        assert s.time == pytest.approx(1.9)


def test_a_tunable_parameter_and_an_input_change_from_the_next_step(base, whole):
    law = base.swap(controller="controller_pid")
    gain = "controller.yaw_rate_proportional_gain"
    steady = law.run()
    with law.start() as s:
        s.run_to(1.2)
        s.set(gain, 4e4)
        assert s[gain] == 4e4
        run = s.finish()
    assert same(run, steady, 1201)
    assert not np.array_equal(run["controller.yaw_moment"], steady["controller.yaw_moment"])
    (note,) = [d for d in run.diagnostics if d.code == "value-changed"]
    assert "4" in str(note)
    with base.start() as s:
        s.run_to(1.2)
        s.set("friction", 0.1)
        slippery = s.finish()
    assert same(slippery, whole, 1201)
    lateral = np.abs(slippery["plant.acceleration_y"][1300:]).max()
    assert lateral < 0.11 * 9.81 < np.abs(whole["plant.acceleration_y"]).max()


def test_what_a_changed_run_does_is_forgotten_with_its_rows_and_notes(base, whole):
    with base.start() as s:
        s.run_to(1.1)
        before = s.save()
        s.set("friction", 0.1)
        s.run_to(1.8)
        assert not same(s.run, whole, 1801)
        s.restore(before)
        run = s.finish()
    assert same(run, whole)
    assert not [d for d in run.diagnostics if d.code == "value-changed"]
    assert run.record["largest"] == whole.record["largest"]


REFUSED = [
    ("plant.mass", 1200, "variable-wrong-kind", ("plant.mass", "fixed")),
    ("plant.steer_angle", 0.1, "variable-wrong-kind", ("plant.steer_angle", "driver.steer_angle")),
    ("plant.yaw_rate", 0.1, "variable-wrong-kind", ("plant.yaw_rate", "output")),
    ("plant.yaw_rat", 0.1, "signal-unknown", ("plant.yaw_rat", "plant.yaw_rate")),
    ("stop_time", 3, "variable-unknown", ("stop_time",)),
    ("friction", "5 kg", "unit-mismatch", ("friction", "kg")),
    ("friction", "slippery", "argument-invalid", ("friction",)),
]


def test_what_cannot_change_is_refused_and_the_run_goes_on(base, whole):
    with base.start() as s:
        s.run_to(0.5)
        for name, value, code, names in REFUSED:
            with refused(yb.ScenarioError, code, names=names):
                s.set(name, value)
        s.run_to(0.6)
        assert same(s.run, whole, 601)


def test_times_that_have_passed_states_of_others_and_closed_runs_are_refused(base):
    with base.start() as s, base.start() as other:
        s.run_to(1.0)
        for time in (0.5, 2.5):
            with refused(yb.ScenarioError, "argument-invalid", names=("1 s", "2 s", f"{time:g}")):
                s.run_to(time)
        with refused(yb.ScenarioError, "argument-invalid", names=("another run",)):
            other.restore(s.save())
    with refused(yb.ScenarioError, "run-closed", names=("closed",)):
        s.step()
    assert len(s.run) == 1001


def test_a_run_with_faults_says_that_it_cannot_save_its_state(base):
    blind = base.fault("plant.sideslip", kind="freeze", start=1.0)
    with blind.start() as s:
        with refused(yb.ScenarioError, "state-unsaved", names=("faults",)):
            s.save()
        assert same(s.finish(), blind.run())


def test_a_law_that_fails_ends_the_run_with_its_exception(base):
    class Failing(Remembering):
        def output(self, t, u):
            if t > 0.1:
                raise LookupError("lost")
            return float(np.sum(self.seen))

    with base.swap(controller=Failing()).start() as s:
        with pytest.raises(yb.SimulationError) as error:
            s.run_to(1.0)
        assert isinstance(error.value.__cause__, LookupError)
        with refused(yb.ScenarioError, "run-closed", names=("failed", "lost")):
            s.step()
        assert 90 < len(s.run) < 120


def test_a_run_can_be_stepped_outside_the_main_thread(base, whole):
    made = []

    def make():
        with base.start() as s:
            s.run_to(1.0)
            made.append(s.finish())

    thread = threading.Thread(target=make)
    thread.start()
    thread.join()
    assert same(made[0], whole)
