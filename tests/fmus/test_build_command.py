"""`yawbench build`: what it builds, what it prints, how it ends."""

from __future__ import annotations

import subprocess
import sys

import typer
from typer.testing import CliRunner

from tests.refusals import each_mentions, mentions
from yawbench.commands.build import build
from yawbench.foundation.workers import Pool

APP = typer.Typer()
APP.command()(build)


def run(*arguments):
    return CliRunner().invoke(APP, [str(argument) for argument in arguments])


class Backwards(Pool):
    """A pool whose calls end in the opposite order."""

    def each(self, function, calls):
        return reversed([*super().each(function, calls)])


def test_it_builds_what_is_named_once_and_says_so_in_the_order_asked_for(tmp_path, monkeypatch):
    monkeypatch.setattr("yawbench.fmus.build.Pool", Backwards)
    build_both = ("controller_off", "driver_sine", "--out", tmp_path)
    done = run(*build_both)
    assert (done.exit_code, done.stdout) == (0, "")
    said = "\n".join(line for line in done.stderr.splitlines() if "library for Windows" not in line)
    assert each_mentions(
        said, ("controller_off", "built"), ("driver_sine", "built"), ("driver_sine", "never compared")
    )
    assert {file.name for file in tmp_path.iterdir()} == {"controller_off.fmu", "driver_sine.fmu"}
    assert each_mentions(run(*build_both).stderr, ("2", "date"))
    assert mentions(run("controller_off", "--out", tmp_path, "--force").stderr, "controller_off", "built")


def test_a_name_that_is_no_component_is_wrong_input(tmp_path):
    done = run("driver_sin", "--out", tmp_path)
    assert done.exit_code == 2
    assert mentions(" ".join(done.stderr.replace("│", " ").split()), "'driver_sin'", "component")


def test_a_component_that_cannot_be_built_ends_with_status_1_and_one_sentence(tmp_path):
    file = tmp_path / "controller_bad.py"
    file.write_text("import numpy\n")
    command = [sys.executable, "-m", "yawbench", "build", str(file), "--out", str(tmp_path / "out")]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert mentions(done.stderr, "controller_bad", "standard", "library")
    assert done.stderr.count("\n") == 1
    assert "Traceback" not in done.stderr


def test_without_a_compiler_it_warns(tmp_path, monkeypatch):
    monkeypatch.setenv("CC", "no-such-compiler")
    done = run("controller_off", "--out", tmp_path)
    assert done.exit_code == 0
    assert "warning: " in done.stderr
    assert mentions(done.stderr, "no-such-compiler", "compiler")


def test_the_builder_is_loaded_only_when_it_is_needed():
    script = (
        "import sys, yawbench.commands.build\n"
        "print('yawbench.fmus.build' in sys.modules or 'pythonfmu' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout == "False\n"
