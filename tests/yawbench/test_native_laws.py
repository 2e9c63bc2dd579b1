"""Laws whose native code was once wrong, or has branches that are reached late, give what Python gives."""

from __future__ import annotations

import math
import warnings

import numpy as np
import pytest

import yawbench as yb
from yawbench import YawbenchWarning


class Gain:
    def __init__(self, value):
        self.value = value

    @property
    def scaled(self):
        return 1000.0 * self.value

    @scaled.setter
    def scaled(self, new):
        self.value = new / 1000.0


class Watchdog:
    """Its gain is halved through a property after 2,500 samples."""

    inputs, outputs = ("yaw_rate_ref", "yaw_rate"), ("yaw_moment",)
    step_size = 0.002

    def start(self, t, u):
        self.gain = Gain(20.0)
        self.samples = 0

    def output(self, t, u):
        return self.gain.value * 1000.0 * (u.yaw_rate_ref - u.yaw_rate)

    def advance(self, t, h, u):
        self.samples += 1
        if self.samples == 2500:
            self.gain.scaled = 10000.0


class Narrow(Watchdog):
    """A branch that no search finds: for one step at 0.506 s."""

    def advance(self, t, h, u):
        self.samples += 1
        if abs(math.sin(1234.5 * (t + h)) - math.sin(1234.5 * 0.506)) < 1e-11:
            self.gain.scaled = 10000.0


@pytest.fixture(scope="module")
def base():
    return yb.load("fnn_sideslip/25mps")


def moment(run):
    return run["controller.yaw_moment"]


def test_a_property_set_after_2500_samples_is_set_natively_and_in_an_fmu(base, monkeypatch, tmp_path):
    base = base.set({"stop_time": 5.6})
    native = base.swap(controller=Watchdog()).run()
    assert native.record["fmus"]["controller"]["runs_as"] == "native"
    fmu = yb.export_fmu(Watchdog(), tmp_path / "watchdog.fmu")
    packed = base.swap(controller=str(fmu)).run()
    monkeypatch.setenv("YAWBENCH_UNITS", "python")
    in_python = base.swap(controller=Watchdog()).run()
    assert np.abs(moment(in_python)[-300:]).max() > 0.0
    for run in (native, packed):
        assert (moment(run) == moment(in_python)).all()


def test_where_nothing_was_compared_a_law_runs_again_in_python_and_its_fmu_says_so(
    base, monkeypatch, tmp_path
):
    base = base.set({"stop_time": 0.6})
    run = base.swap(controller=Narrow()).run()
    assert "never compared" not in str(run.record["fmus"]["controller"]["runs_as"])
    (note,) = (one for one in run.diagnostics if one.code == "instance-in-python")
    assert "runs in Python" in note.message and "test_native_laws.py:" in note.message
    with pytest.warns(YawbenchWarning, match=r"never compared with Python .*\d"):
        fmu = yb.export_fmu(Narrow(), tmp_path / "narrow.fmu")
    packed = base.swap(controller=str(fmu)).run()
    monkeypatch.setenv("YAWBENCH_UNITS", "python")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        in_python = base.swap(controller=Narrow()).run()
        assert (moment(base.swap(controller=str(fmu)).run()) == moment(in_python)).all()
    assert (moment(run) == moment(in_python)).all()
    assert (moment(packed) == moment(in_python)).all()
