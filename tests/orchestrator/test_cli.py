"""What the command line says of itself."""

from __future__ import annotations

from importlib.metadata import version

import pytest

from orchestrator import cli
from orchestrator.cli import COMMANDS, main


def say(capsys, *arguments):
    with pytest.raises(SystemExit) as exit_:
        main(list(arguments))
    return exit_.value.code or 0, capsys.readouterr().out


def test_the_version_is_that_of_the_installed_distribution(capsys):
    assert say(capsys, "--version") == (0, f"yawbench {version('yawbench')}\n")


def test_the_help_says_in_whole_words_what_each_command_does(capsys):
    _, text = say(capsys, "--help")
    lines = [line for line in text.partition("Commands:")[2].splitlines() if line.strip()]
    assert len(lines) == len(COMMANDS)
    assert all(line.endswith(".") and not line.endswith("...") for line in lines)


def test_the_help_names_every_command(capsys):
    status, text = say(capsys, "--help")
    assert status == 0
    assert {line.split()[0] for line in text.splitlines() if line.startswith("  ")} >= set(COMMANDS)


def test_an_error_of_the_program_itself_is_a_sentence_that_says_so(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def broken(arguments: object) -> None:
        raise ZeroDivisionError("\x1b[31mof all things")

    monkeypatch.setattr(cli, "_application", lambda: broken)
    with pytest.raises(SystemExit) as ended:
        cli.main([])
    said = capsys.readouterr().err
    assert ended.value.code == 1
    assert said.startswith(
        "this is an error in yawbench itself, please report it: "
        "ZeroDivisionError: \\x1b[31mof all things (test_cli.py:"
    )
    monkeypatch.setenv(cli.TRACEBACK, "1")
    with pytest.raises(SystemExit):
        cli.main([])
    assert capsys.readouterr().err.startswith("Traceback (most recent call last):")
