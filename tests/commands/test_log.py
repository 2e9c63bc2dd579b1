"""Lines in a log, where stderr is not a terminal: how far a campaign is, at least every 30 s."""

from __future__ import annotations

import threading
import time

import pytest

from tests.command_line import status_of
from tests.commands.test_batch_commands import SCENARIO, STUDY
from yawbench.commands import terminal_progress

UNITS = ("driver_sine", "reference_steady_state", "controller_off", "controller_fuzzy_sideslip")


@pytest.fixture
def silence(monkeypatch):
    """A silence of 50 ms counts as long."""
    monkeypatch.setattr(terminal_progress, "SILENCE", 0.05)


def lines_of(capsys, enough: int) -> list[str]:
    """Wait for some lines on stderr and return them."""
    lines: list[str] = []
    deadline = time.monotonic() + 60
    while len(lines) < enough and time.monotonic() < deadline:
        lines += capsys.readouterr().err.splitlines()
        time.sleep(0.01)
    return lines


def test_a_silent_command_says_that_it_is_running(silence, capsys):
    with terminal_progress._LOG.watched():
        first, second = lines_of(capsys, 2)[:2]
    assert first.startswith("still running, ")
    assert second.endswith(" s so far")
    capsys.readouterr()
    assert not [thread for thread in threading.enumerate() if thread.name.endswith("(watch)")]


def test_it_says_which_work_how_far_and_how_much_is_left(silence, capsys):
    with terminal_progress._LOG.watched(), terminal_progress.bar("runs", 40, 10) as report:
        report(11)
        line = lines_of(capsys, 1)[0]
        assert line.startswith("runs: [11/40] ")
        assert " s left, " in line
    assert terminal_progress._LOG.progress is None


def test_no_line_is_added_while_others_are_printed(monkeypatch, capsys):
    monkeypatch.setattr(terminal_progress, "SILENCE", 5.0)
    with terminal_progress._LOG.watched():
        for number in range(20):
            terminal_progress.say(f"line {number}")
    assert capsys.readouterr().err.splitlines() == [f"line {number}" for number in range(20)]


def test_every_campaign_holds_its_folder_and_so_is_watched(monkeypatch, tmp_path, fmus, capsys):
    monkeypatch.setattr(terminal_progress, "SILENCE", 0.005)
    (tmp_path / "half.yaml").write_text(SCENARIO)
    (tmp_path / "study.yaml").write_text(STUDY)
    assert status_of("study", tmp_path / "study.yaml", "--fmus", fmus, "--out", tmp_path / "out") == 0
    assert " s so far\n" in capsys.readouterr().err
