"""Processes that this program starts run nothing that lies in the working folder."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from orchestrator.processes import SafeSpawnContext, _off_path, python, safe_path

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
        ("second-opinion", SCENARIO, "--no-one-core", "--master", "fmpy"),
        ("run", SCENARIO, "--isolate"),
        ("compare", SCENARIO, "--swap", "controller=controller_off"),
    ],
)
@pytest.mark.sampled(1)
def test_modules_in_the_working_folder_are_left_alone(trap, arguments):
    done = yawbench(trap, *arguments, "--set", "stop_time=0.01")
    assert not (trap / "taken").exists()
    assert done.returncode == 0, done.stderr


def test_a_process_that_starts_afresh_leaves_the_working_folder_alone(trap, monkeypatch):
    monkeypatch.chdir(trap)
    monkeypatch.setattr(sys, "path", [folder for folder in sys.path if folder])
    process = SafeSpawnContext().Process(target=os.getpid)
    process.start()
    process.join()
    assert not (trap / "taken").exists()
    assert process.exitcode == 0


def test_a_program_of_one_line_loses_the_working_folder():
    """As every Python before 3.11 needs it."""
    command = ["python", "-s", "-c", "from a import main; main(1)", "--multiprocessing-fork"]
    program = "import sys; del sys.path[0]; from a import main; main(1)"
    assert _off_path(command) == ["python", "-s", "-c", program, "--multiprocessing-fork"]


def test_a_program_finds_what_this_one_finds(tmp_path, monkeypatch):
    (tmp_path / "told.py").write_text("def main(*words):\n    print(*words)\n")
    monkeypatch.syspath_prepend(tmp_path)
    done = subprocess.run(python("told", 1, "b c"), capture_output=True, text=True, check=True, cwd="/")
    assert done.stdout == "1 b c\n"


def test_the_environment_is_afterwards_as_it_was(monkeypatch):
    monkeypatch.delenv("PYTHONSAFEPATH", raising=False)
    with safe_path():
        assert os.environ["PYTHONSAFEPATH"] == "1"
    assert "PYTHONSAFEPATH" not in os.environ
