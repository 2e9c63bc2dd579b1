"""The command line: help, version, options, signals."""

from __future__ import annotations

import importlib
import os
import signal
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path
from typing import Any

import pytest
import typer

from tests.checkout import ROOT, run_in
from tests.command_line import status_of
from tests.refusals import each_mentions, mentions
from yawbench import cli, command_help
from yawbench.cli import _application
from yawbench.foundation import plugins
from yawbench.foundation.errors import ScenarioError
from yawbench.foundation.messages import printable


def say(capsys, *arguments):
    return status_of(*arguments), capsys.readouterr().out


def test_the_version_is_that_of_the_installed_distribution(capsys):
    assert say(capsys, "--version") == (0, f"yawbench {version('yawbench')}\n")


def test_help_and_version_import_nothing_of_what_they_tell():
    for argument in ("--help", "-h", "--version"):
        program = (
            "import os, sys; import yawbench.__main__ as m\n"
            "os._exit = lambda status: sys.exit(status)\n"
            "try: m.main()\n"
            "except SystemExit: print(*sorted(sys.modules), file=sys.stderr)"
        )
        done = run_in(ROOT, "python", "-c", program, argument)
        loaded = {*done.stderr.split()}
        assert done.stdout and not loaded & {"typer", "click", "numpy", "pydantic", "yawbench.cli"}


def test_the_help_has_every_command_with_the_first_line_of_its_docstring(capsys):
    grouped = [name for names in command_help.GROUPS.values() for name in names]
    assert len(grouped) == len({*grouped}) and {*grouped} <= {*plugins.names("command")}
    status, shown = say(capsys, "--help")
    assert status == 0
    text = " ".join(shown.split())
    for name in plugins.names("command"):
        line = (plugins.find("command", name).__doc__ or "").splitlines()[0]
        assert f"{name} {line}" in text


PROGRAM = Path(sys.executable).with_name("yawbench")
BUFFERED = {name: value for name, value in os.environ.items() if name != "PYTHONUNBUFFERED"}


def listing(**streams: Any) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [PROGRAM, "list", "metrics"], stderr=subprocess.PIPE, text=True, env=BUFFERED, **streams
    )


def test_a_full_disk_behind_the_output_is_a_sentence_and_no_success():
    with open("/dev/full", "w") as full:
        done = listing(stdout=full)
    assert done.returncode == 1
    assert each_mentions(done.stderr, ("space", "left", "device"))


def test_a_reader_who_has_seen_enough_is_told_nothing():
    reading, writing = os.pipe()
    os.close(reading)
    done = listing(stdout=writing)
    os.close(writing)
    assert (done.returncode, done.stderr) == (1, "")


def test_a_command_imports_what_it_needs_itself():
    code = (
        "import sys; from yawbench.cli import main\n"
        "try: main(['list', 'metrics'])\n"
        "except SystemExit: print(*sorted(sys.modules), file=sys.stderr)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    loaded = set(done.stderr.split())
    assert "yawbench.commands.list" in loaded
    others = {plugins.find("command", name).__module__ for name in plugins.names("command")}
    assert not (others - {"yawbench.commands.list", "yawbench.commands.build"}) & loaded


def test_a_working_folder_that_is_gone_is_one_sentence(tmp_path):
    code = "import os, sys; os.rmdir(os.getcwd()); os.execv(sys.argv[1], sys.argv[1:])"
    done = subprocess.run(
        [sys.executable, "-c", code, PROGRAM, "list", "metrics"], cwd=tmp_path, capture_output=True, text=True
    )
    said = "the working folder is not there any more; change to another\n"
    assert (done.returncode, done.stdout, done.stderr) == (2, "", said)


def test_every_command_that_sets_parameters_takes_faults() -> None:
    options = {
        name: {one for parameter in command.params for one in parameter.opts}
        for name, command in typer.main.get_command(_application(whole=True)).commands.items()  # type: ignore[attr-defined]
    }
    setting = {name for name, own in options.items() if "--set" in own}
    assert len(setting) > 8
    assert {name for name in setting if "--fault" not in options[name]} == set()


@pytest.mark.skipif(sys.platform == "win32", reason="os.kill ends the process there")
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_signal_ends_a_command_with_a_word_and_the_same_status(number, monkeypatch, capsys):
    monkeypatch.setattr("yawbench.commands.list.list", lambda: os.kill(os.getpid(), number))
    before = signal.getsignal(signal.SIGTERM)
    assert status_of("list") == 128 + number
    assert capsys.readouterr().err == "Interrupted\n"
    assert signal.getsignal(signal.SIGTERM) is before


@pytest.mark.skipif(sys.platform == "win32", reason="os.kill ends the process there")
def test_a_signal_while_a_class_is_being_made_is_no_error_of_the_program(monkeypatch, capsys):
    class Stopping:
        def __set_name__(self, owner: type, name: str) -> None:
            os.kill(os.getpid(), signal.SIGTERM)

    def ended() -> None:
        type("Made", (), {"attribute": Stopping()})

    monkeypatch.setattr(importlib.import_module("yawbench.commands.cache"), "cache", ended)
    assert status_of("cache") == 143
    assert capsys.readouterr().err == "Interrupted\n"


@pytest.mark.parametrize("error", [ZeroDivisionError, OSError, ScenarioError])
def test_nothing_that_turns_the_text_reaches_the_terminal_even_in_a_traceback(error, monkeypatch, capsys):
    text = "\u202etxt.exe \x1b[31m \u2066 \x9b"

    def broken(arguments: object) -> None:
        raise error(text)

    def said() -> str:
        status = status_of("list")
        assert status == (2 if error is ScenarioError else 1)
        told = capsys.readouterr().err
        assert r"\u202etxt.exe \x1b[31m \u2066 \x9b" in told
        assert not set(text) & set(told) - set(printable(text))
        return told

    monkeypatch.setattr(cli, "_application", lambda _: broken)
    of_program = ("ZeroDivisionError", "test_cli.py") if error is ZeroDivisionError else ()
    hint = ("YAWBENCH_TRACEBACK", "1 shows") if of_program else ()
    assert each_mentions(said(), (*of_program, *hint))
    monkeypatch.setenv(cli.TRACEBACK, "1")
    lines = said().splitlines()
    assert mentions(lines, "Traceback") and mentions(lines, "test_cli.py", "broken")
    assert mentions(lines[-1], *of_program)
