"""Ctrl-C, and what is no error, in a program that uses the library."""

from __future__ import annotations

import multiprocessing
import os
import signal
import sys

import pytest

import yawbench as yb
from yawbench.components.controllers.off import Off
from yawbench.foundation.errors import Interrupted, YawbenchError

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="os.kill ends the process there")


@pytest.fixture(scope="module")
def base():
    return yb.load("fnn_sideslip/25mps").set({"stop_time": 0.05})


def raising(error):
    def law(yaw_rate, t):
        if t > 0.02:
            raise error
        return 0.0

    return law


def pressed(yaw_rate, t):
    """A law during which somebody presses Ctrl-C."""
    if 0.02 < t < 0.03:
        os.kill(os.getpid(), signal.SIGINT)
    return 0.0


def hanging(yaw_rate, t):
    """A law that does not come back, so that somebody presses Ctrl-C again."""
    os.kill(os.getpid(), signal.SIGINT)
    os.kill(os.getpid(), signal.SIGINT)
    while True:
        pass


class Class(Off):
    def output(self, t, u):
        raise KeyboardInterrupt


@pytest.mark.parametrize(
    ("controller", "error"),
    [
        (raising(KeyboardInterrupt()), KeyboardInterrupt),
        (raising(SystemExit(5)), SystemExit),
        (Class, KeyboardInterrupt),
        (pressed, Interrupted),
        (hanging, Interrupted),
    ],
)
def test_ctrl_c_and_exit_in_a_controller_reach_the_caller(base, controller, error):
    before = signal.getsignal(signal.SIGINT)
    with pytest.raises(error) as run:
        base.swap(controller=controller).run()
    experiment = yb.experiment(base, {"controller": [controller, "controller_off"]})
    with pytest.raises(error):
        experiment.run(workers=1)
    assert not isinstance(run.value, YawbenchError)
    assert isinstance(run.value, (KeyboardInterrupt, SystemExit))
    assert signal.getsignal(signal.SIGINT) is before


@pytest.mark.parametrize("controller", [pressed, raising(SystemExit(5))])
def test_an_interrupted_ranking_keeps_no_failed_run(controller, tmp_path):
    with pytest.raises((KeyboardInterrupt, SystemExit)):
        yb.rank(controller, against=[], conditions=["hard"], quick=True, out=tmp_path / "out")
    journal = (tmp_path / "out" / "runs.jsonl").read_text()
    assert journal
    assert "interrupted" not in journal
    assert all('"problems": []' in line or "failed" not in line for line in journal.splitlines())


def test_what_a_controller_cannot_do_is_an_error_of_its_run_still(base):
    with pytest.raises(yb.SimulationError, match="ZeroDivisionError"):
        base.swap(controller=raising(ZeroDivisionError())).run()


def _levels(pipe, controller):
    base = yb.load("fnn_sideslip/25mps").set({"stop_time": 0.01})
    made = yb.experiment(base.swap(controller=controller), {"driver.amplitude": [0.02, 0.03]}).run(workers=2)
    pipe.send(made.table["status"].tolist())


@pytest.mark.parametrize("how", ["fork", pytest.param("spawn", marks=pytest.mark.exhaustive)])
def test_an_experiment_runs_in_a_daemonic_process(how):
    context = multiprocessing.get_context(how)
    reading, writing = context.Pipe(duplex=False)
    process = context.Process(target=_levels, args=(writing, "controller_off"), daemon=True)
    process.start()
    writing.close()
    assert reading.recv() == ["completed", "completed"]
    process.join()
    assert process.exitcode == 0
