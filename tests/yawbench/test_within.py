"""Calls with a deadline: their values and errors, and what becomes of code that never returns."""

from __future__ import annotations

import os
import pickle
import signal
import sys
import time
import types

import numpy as np
import pytest

import yawbench as yb
from tests.refusals import refused


def test_a_call_has_its_value_and_changes_nothing_here():
    kept = []
    assert yb.within(60, lambda x: (kept.append(x), x + 1.0)[1], 1.5) == 2.5
    large = yb.within(60, np.arange, 1_000_000)  # more than a pipe holds
    assert kept == [] and large.tolist() == list(range(1_000_000))


def test_an_error_of_the_function_is_raised_here():
    def careless():
        class Own(Exception):
            pass

        raise Own("of its own kind")

    with pytest.raises(ZeroDivisionError):
        yb.within(60, lambda: 1 / 0)
    with pytest.raises(RuntimeError, match="of its own kind"):
        yb.within(60, careless)
    with pytest.raises((AttributeError, pickle.PicklingError), match="lambda"):
        yb.within(60, lambda: lambda: 0)


def test_what_only_the_copy_knows_is_said_so():
    def own(raising):
        module = sys.modules["submitted"] = types.ModuleType("submitted")
        exec("class Own(Exception): pass", module.__dict__)
        if raising:
            raise module.Own("of its own kind")
        return module.Own()

    with pytest.raises(RuntimeError, match="of its own kind"):
        yb.within(60, own, True)
    with pytest.raises(ModuleNotFoundError, match="submitted"):
        yb.within(60, own, False)


def test_code_that_never_returns_ends_at_the_deadline_with_what_it_has_started(tmp_path):
    def endless():
        (tmp_path / "pid").write_text(str(os.getpid()))
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
        while True:
            pass

    began = time.monotonic()
    with refused(yb.YawbenchError, "call-late", names=("endless", "1.5 s")):
        yb.within(1.5, endless)
    assert 1.5 <= time.monotonic() - began < 30.0
    with pytest.raises(ProcessLookupError):
        os.kill(int((tmp_path / "pid").read_text()), 0)


def test_code_that_ends_its_process_ends_only_the_copy():
    with refused(yb.YawbenchError, "run-process-died", names=("exit status 3",)):
        yb.within(60, os._exit, 3)
    with refused(yb.YawbenchError, "run-process-died", names=("SIGSEGV",)):
        yb.within(60, lambda: os.kill(os.getpid(), signal.SIGSEGV))


def test_runs_and_pools_of_a_call_are_made_in_the_copy():
    base = yb.load("fnn_sideslip/25mps").set({"stop_time": 0.2})

    def several():
        made = yb.experiment(base, {"driver.amplitude": [0.02, 0.03]}, metrics="peak(sideslip)").run(
            workers=2
        )
        return made.table["peak(sideslip)"].tolist()

    assert yb.within(300, several) == several()


@pytest.mark.parametrize("limit", [0, -1.0, "soon", float("inf")])
def test_a_deadline_is_a_number_above_zero(limit):
    with refused(yb.ScenarioError, "argument-invalid", names=("limit",)):
        yb.within(limit, len, ())
