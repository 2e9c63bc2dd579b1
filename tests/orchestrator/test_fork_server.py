"""Processes that this program starts run nothing that lies in the working folder."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import uuid
from pathlib import Path

import pytest

from yawbench.foundation import fork_server
from yawbench.foundation.fork_server import ForkServer, python, start

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
def started(tmp_path, monkeypatch):
    """Have a process call `main` made of these lines; return what it writes into a pipe, and its code."""

    def start_one(*lines, start=start):
        (tmp_path / "modules").mkdir(exist_ok=True)
        name = f"made_{uuid.uuid4().hex}"
        program = "\n    ".join(["import os, signal, sys\ndef main(writing):", *lines])
        (tmp_path / "modules" / f"{name}.py").write_text(program)
        monkeypatch.syspath_prepend(tmp_path / "modules")
        reading, writing = os.pipe()
        child = start(name, writing)
        os.close(writing)
        with open(reading, encoding="utf-8") as answer:
            return answer.read(), child.collect()

    return start_one


SAY = "def say(*words): os.write(int(writing), ' '.join(map(str, words)).encode())"


def test_a_forked_process_leaves_the_working_folder_alone(trap, started, monkeypatch):
    monkeypatch.chdir(trap)
    monkeypatch.setattr(sys, "path", [folder for folder in sys.path if folder])
    server = ForkServer()
    assert started(SAY, "say(os.getcwd())", start=server.start) == (str(trap), 0)
    assert not (trap / "taken").exists()
    server.close()


def test_a_forked_process_has_the_environment_and_output_of_its_caller_as_they_are_now(
    started, monkeypatch, capfd
):
    started("pass")
    monkeypatch.setenv("MOOD", "good")
    assert started(SAY, "print('hello'); say(os.environ['MOOD'])") == ("good", 0)
    assert capfd.readouterr().out == "hello\n"
    monkeypatch.delenv("MOOD")
    assert started(SAY, "say('MOOD' in os.environ)") == ("False", 0)


def test_how_a_forked_process_ended_is_known(started, capfd):
    assert started("os.kill(os.getpid(), signal.SIGSEGV)")[1] == -signal.SIGSEGV
    assert started("os._exit(3)")[1] == 3
    assert started("raise ValueError('no')")[1] == 1
    assert "ValueError: no" in capfd.readouterr().err


def test_a_server_that_is_killed_takes_its_children_along_and_is_replaced(started):
    started("pass")
    server = fork_server._server
    reading, writing = os.pipe()
    child = start("time", writing)  # `time` has no `main`
    assert child.collect() == 1
    waiting = start("yawbench.foundation.workers", reading, writing)
    server._process.kill()
    assert waiting.ended(10)
    assert waiting.collect() == -signal.SIGKILL
    assert started(SAY, "say(1)") == ("1", 0)
    assert fork_server._server is not server
    for descriptor in (reading, writing):
        os.close(descriptor)


def test_a_program_finds_what_this_one_finds(trap, tmp_path, monkeypatch):
    (tmp_path / "modules").mkdir()
    program = "import json, socket\ndef main(*words):\n    print(*words)\n"
    (tmp_path / "modules" / "told.py").write_text(program)
    monkeypatch.syspath_prepend(tmp_path / "modules")
    monkeypatch.setattr(sys, "path", [folder for folder in sys.path if folder])
    done = subprocess.run(python("told", 1, "b c"), capture_output=True, text=True, check=True, cwd=trap)
    assert done.stdout == "1 b c\n"
