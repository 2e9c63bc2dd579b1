"""What the command line says of itself."""

from __future__ import annotations

from importlib.metadata import version

import pytest

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
