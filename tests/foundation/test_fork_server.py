"""Processes that this program starts run nothing that lies in the working folder."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from yawbench.foundation import processes
from yawbench.foundation.processes import ProcessLost, Worker, python

SCENARIO = "fuzzy_feedback/single_sine"
SHADOWED = ("json", "numpy", "socket", "selectors", "struct", "signal", "pickle", "multiprocessing", "random")
"""Modules that a process needs early."""


@pytest.fixture
def trap(tmp_path):
    """A working folder with modules that would be taken for others, and say so."""
    for name in SHADOWED:
        (tmp_path / f"{name}.py").write_text("open('taken', 'w').close()\nraise SystemExit('hostile')\n")
    return tmp_path


def yawbench(folder, *arguments):
    command = shutil.which("yawbench", path=str(Path(sys.executable).parent))
    assert command
    return subprocess.run([command, *arguments], cwd=folder, capture_output=True, text=True, check=False)


@pytest.mark.parametrize(
    "arguments",
    [
        ("run", SCENARIO, "--isolate"),
        ("second-opinion", SCENARIO, "--no-one-core", "--master", "fmpy"),
        ("compare", SCENARIO, "--swap", "controller=controller_off"),
    ],
)
@pytest.mark.sampled(1)
def test_modules_in_the_working_folder_are_left_alone(trap, arguments):
    done = yawbench(trap, *arguments, "--set", "stop_time=0.01")
    assert not (trap / "taken").exists()
    assert done.returncode == 0, done.stderr


@pytest.fixture
def call():
    """Have a process of the fork server call a function; return what it returns, or how the process ended."""

    def call_one(function, *arguments):
        worker = Worker(())
        worker.give(function, arguments)
        try:
            value, error = worker.answer()
        except ProcessLost as lost:
            return str(lost)
        finally:
            worker.close(kill=True)
        if error is not None:
            raise error
        return value

    return call_one


def test_a_forked_process_has_the_environment_and_output_of_its_caller_as_they_are_now(
    call, monkeypatch, capfd
):
    call(os.getpid)
    monkeypatch.setenv("MOOD", "good")
    assert call(os.getenv, "MOOD") == "good"
    call(os.write, 1, b"hello\n")
    assert capfd.readouterr().out == "hello\n"
    monkeypatch.delenv("MOOD")
    assert call(os.getenv, "MOOD") is None


def test_how_a_forked_process_ended_is_known(call):
    assert "SIGSEGV" in call(signal.raise_signal, signal.SIGSEGV)
    assert "status 3" in call(os._exit, 3)
    with pytest.raises(ValueError, match="literal"):
        call(int, "no")


def test_a_server_that_is_killed_takes_its_children_along_and_is_replaced(call):
    waiting = Worker(())
    server = processes.server.process
    server.kill()
    assert waiting.child.ended(10)
    assert waiting.close() == -signal.SIGKILL
    assert call(os.getppid) != server.pid
    assert processes.server.process is not server


def test_what_a_process_has_started_ends_with_it(call, tmp_path):
    started = tmp_path / "started"
    call(os.system, f"sleep 60 & echo $! > {started}")
    number = int(started.read_text())
    for _ in range(1000):
        if not _runs(number):
            return
        time.sleep(0.01)
    raise AssertionError(number)


def _runs(number):
    """Return whether a process runs; one that has ended and that nobody has waited for does not."""
    try:
        return Path(f"/proc/{number}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def test_a_program_finds_what_this_one_finds(trap, tmp_path, monkeypatch):
    (tmp_path / "modules").mkdir()
    program = "import json, socket\ndef main(*words):\n    print(*words)\n"
    (tmp_path / "modules" / "told.py").write_text(program)
    monkeypatch.syspath_prepend(tmp_path / "modules")
    monkeypatch.setattr(sys, "path", [folder for folder in sys.path if folder])
    done = subprocess.run(python("told", 1, "b c"), capture_output=True, text=True, check=True, cwd=trap)
    assert done.stdout == "1 b c\n"
