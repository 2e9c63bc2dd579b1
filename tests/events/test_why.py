"""Why a car was lost: runs with known causes, whose first sentence names the cause."""

from __future__ import annotations

import functools
import warnings
import zipfile

import pytest

import yawbench as yb
from tests.checkout import ROOT

SWD = "proving_ground/sine_with_dwell"
LATE_RELEASE = {
    "wheel_control.release": "slip",
    "wheel_control.release_slip": 0.2,
    "wheel_control.full_release_slip": 0.4,
}


class Proportional:
    """A yaw moment in proportion to the error of the yaw rate."""

    inputs = ("yaw_rate_ref", "yaw_rate")
    outputs = ("yaw_moment",)

    def __init__(self, gain=1e5, begin=0.0, most=1e4):
        self.gain, self.begin, self.most = gain, begin, most

    def output(self, t, u):
        if t < self.begin:
            return 0.0
        return max(-self.most, min(self.most, self.gain * (u.yaw_rate_ref - u.yaw_rate)))


HELD, LATE = Proportional(), Proportional(begin=3.0)


@functools.cache
def driven(law="off", scenario=SWD, fault=None, **changes):
    """Return the run of a car that is hard to hold, with a law and changes."""
    own = {name.replace("__", "."): value for name, value in changes.items()}
    made = yb.load(scenario).set({"vehicle": "scenarios/vehicles/hard.yaml", **own})
    if law != "off":
        made = made.swap(controller=law).set({**LATE_RELEASE, **own})
    if fault:
        made = made.fault(fault[0], **dict(fault[1:]))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return made.run()


CAUSES = {
    "no controller": (dict(), ("nothing acts",)),
    "wrong sign": (dict(law=Proportional(-1e5)), ("wrong sign",)),
    "late controller": (dict(law=LATE), ("late", "3.00 s")),
    "saturated moment": (dict(law=Proportional(most=700.0)), ("limit", "700 N.m")),
    "slow brakes": (dict(law=HELD, wheel_control__pressure_rise_limit=2e6), ("wheels are late",)),
    "moment delayed": (
        dict(law=HELD, fault=("controller.yaw_moment", ("kind", "delay"), ("value", 0.4))),
        ("fault", "controller.yaw_moment"),
    ),
    "gyro frozen": (
        dict(
            law=HELD, scenario=f"{SWD}_sensors",
            fault=("sensor.yaw_rate", ("kind", "freeze"), ("start", 1.8)),
        ),
        ("fault", "sensor.yaw_rate", "1.80 s"),
    ),
    "brakes released": (
        dict(law="controller_pid", wheel_control__release_slip=0.05, wheel_control__full_release_slip=0.1),
        ("released",),
    ),
    "friction falls": (
        dict(scenario=f"{SWD}_split", driver__amplitude="90 deg", road__patches="0.3: x > 50"),
        ("friction", "falls", "33.3 %"),
    ),
}  # fmt: skip


@pytest.mark.parametrize(("made", "named"), CAUSES.values(), ids=CAUSES)
def test_the_first_sentence_names_the_cause(made, named):
    run = driven(**made)
    first, *_ = run.why()
    assert all(word in first for word in named), run.why()
    assert len(run.why()) <= 3


def test_a_moment_that_its_controller_calls_otherwise_is_seen(fmus, tmp_path):
    with (
        zipfile.ZipFile(fmus / "controller_pid.fmu") as ours,
        zipfile.ZipFile(tmp_path / "own.fmu", "w") as own,
    ):
        for name in ours.namelist():
            own.writestr(name, ours.read(name).replace(b'name="yaw_moment"', b'name="mz"'))
    text = (ROOT / f"scenarios/{SWD}.yaml").read_text().replace("../vehicles", f"{ROOT}/scenarios/vehicles")
    text = text.replace("fmu: controller_off", f"fmu: {tmp_path / 'own.fmu'}")
    (tmp_path / "own.yaml").write_text(text + "  - {from: controller.mz, to: allocator.yaw_moment}\n")
    changes = {"vehicle": "scenarios/vehicles/hard.yaml", "controller.moment_limit": 700}
    with pytest.warns(yb.YawbenchWarning, match="spins"):
        lost = yb.load(tmp_path / "own.yaml").set(changes).run()
    first, *_ = lost.why()
    assert all(word in first for word in ("moment", "limit", "700 N.m")), lost.why()


def test_a_car_that_is_held_has_no_reason_to_be_lost():
    run = driven(HELD)
    assert run.why() == []
    assert "steering" in [row[2] for row in run.events.rows]


def test_the_best_run_beside_is_compared_with_by_when_it_acts():
    assert any("best controller begins to act" in sentence for sentence in driven(LATE).why(driven(HELD)))


def test_events_of_a_record_are_those_found_in_its_results(tmp_path):
    """What a run writes into its record while it goes on is what a look at its results finds."""
    from yawbench.events.kinds import RunWatch, events_in
    from yawbench.orchestrator.master.simulate import simulate
    from yawbench.orchestrator.results.reader import load_results

    plan = yb.load(SWD).set({"stop_time": 3.5}).plan()
    simulate(plan, tmp_path / "run", watch=RunWatch(plan))
    results = load_results(tmp_path / "run")
    written = results.record.events
    assert written
    results.record.model_fields_set.discard("events")
    assert events_in(results) == written
