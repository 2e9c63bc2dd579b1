"""Commands killed at random moments, a sample; `python -m campaigns.kills` kills more."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from campaigns.kills import COMMANDS, trial
from tests.commands.test_batch_commands import UNITS
from yawbench.fmus.build import build_all


@pytest.mark.skipif(sys.platform == "win32", reason="needs signals")
@pytest.mark.exhaustive  # tests/orchestrator/test_folder.py lets runs die, studies/test_sweep.py sweeps
@pytest.mark.parametrize("command", COMMANDS)
def test_a_killed_command_passes_nothing_half_for_whole_and_the_next_call_repairs_all(
    command: str, tmp_path: Path
) -> None:
    build_all(tmp_path / "fmus", components=UNITS)
    counts, notes = trial(command, 1, 5, tmp_path, tmp_path / "fmus")
    assert notes == []
    assert counts["held"] == 1
