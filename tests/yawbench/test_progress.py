"""Progress bars: who sees one, when, and what it says."""

from __future__ import annotations

import io
import os
import subprocess
import sys
import threading
from typing import Any

import pytest
from rich.console import Console

import yawbench as yb
from tests.checkout import ROOT
from tests.commands.terminal import seen_on_terminal
from yawbench.foundation import progress as _progress


@pytest.fixture(scope="module")
def base():
    return yb.load("fnn_sideslip/25mps").set({"stop_time": 1.2})


@pytest.fixture
def terminal(monkeypatch):
    """Text that a terminal would show of bars without delay."""
    shown = io.StringIO()

    def console(*, always: bool = False) -> Console:
        return Console(file=shown, force_terminal=True, width=120, _environ={})

    monkeypatch.setattr(_progress, "DELAY", 0.0)
    monkeypatch.setattr(_progress, "_console", console)
    return shown


def damping(yaw_rate):
    return -1e3 * yaw_rate


CALLS = {
    "run": lambda base, out: base.run(),
    "experiment": lambda base, out: yb.experiment(base, {"driver.amplitude": [0.01, 0.02]}).run(workers=1),
    "rank": lambda base, out: yb.rank(against=["none"], conditions=["hard"], quick=True),
    "linearize": lambda base, out: yb.linearize(
        base.swap(controller="controller_off"),
        at=1.0,
        inputs=["driver.steer_angle"],
        outputs=["plant.yaw_rate"],
    ),
    "export": lambda base, out: yb.export_fmu(damping, out / "law.fmu"),
}
TITLES = {"rank": "controllers", "linearize": "Linearize", "export": "Export law.fmu"}


@pytest.mark.parametrize("what", CALLS)
def test_a_call_that_takes_long_shows_a_bar_with_its_title(what, base, terminal, tmp_path):
    CALLS[what](base, tmp_path)
    assert TITLES.get(what, base.title) in terminal.getvalue()
    assert not [thread for thread in threading.enumerate() if isinstance(thread, threading.Timer)]


def test_a_bar_goes_to_its_end_and_leaves_nothing_behind(base, terminal):
    yb.experiment(base, {"driver.amplitude": [0.01, 0.02]}).run(workers=1, progress=True)
    assert "100%" in terminal.getvalue()
    assert terminal.getvalue().endswith("\x1b[2K")  # the line is erased


def test_calls_within_a_call_show_no_bar_of_their_own(terminal):
    with _progress.bar("outer", wanted=True), _progress.bar("inner", wanted=True):
        pass
    assert "outer" in terminal.getvalue() and "inner" not in terminal.getvalue()


def test_a_bar_can_be_refused(base, terminal):
    base.run(progress=False)
    base.run(progress=lambda done, total: None)
    yb.experiment(base, {"driver.amplitude": [0.01]}).run(workers=1, progress=False)
    assert terminal.getvalue() == ""


PROGRAM = """
import os, sys
import yawbench as yb
from yawbench.foundation import progress as _progress
base = yb.load("fnn_sideslip/25mps").set({"stop_time": 0.1})
for delay, switch in ((60.0, ""), (0.0, "off"), (0.0, "")):
    _progress.DELAY, os.environ[_progress.SWITCH] = delay, switch
    base.run()
    print("rich.progress" in sys.modules, file=open(sys.argv[1], "a"))
"""


def test_a_terminal_sees_a_bar_after_the_delay_unless_it_is_switched_off_and_a_pipe_none(tmp_path):
    options: dict[str, Any] = {"cwd": ROOT, "env": os.environ | {"TERM": "xterm"}}
    command = [sys.executable, "-c", PROGRAM]
    shown = seen_on_terminal([*command, tmp_path / "terminal"], "stderr", **options)
    assert "Sideslip tracking" in shown
    assert (tmp_path / "terminal").read_text().split() == ["False", "False", "True"]
    silent = subprocess.run([*command, tmp_path / "pipe"], stderr=subprocess.PIPE, check=True, **options)
    assert silent.stderr == b""
    assert (tmp_path / "pipe").read_text().split() == 3 * ["False"]
