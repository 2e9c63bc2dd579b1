"""Commands killed or on a full disk, and altered files of users, a sample; more by
`python -m campaigns.kills` and `python -m campaigns.altered`.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from campaigns import altered, kills
from campaigns.kills import COMMANDS
from yawbench.fmus.build import build_all

pytestmark = [
    pytest.mark.skipif(sys.platform != "linux", reason="needs signals, forks and limits of a child"),
    pytest.mark.exhaustive,  # tests/orchestrator and tests/commands let runs die, fill disks and alter files
]


@pytest.mark.parametrize("fate", [kills.killed, kills.on_a_full_disk])
@pytest.mark.parametrize("command", COMMANDS)
def test_a_command_that_ends_early_passes_nothing_half_for_whole_and_the_next_call_gives_all(
    command: str, fate: Callable[..., kills.Disturb], tmp_path: Path
) -> None:
    build_all(tmp_path / "fmus", components=kills.UNITS)
    counts, notes = kills.trial(command, 1, 5, tmp_path, tmp_path / "fmus", fate)
    assert notes == []
    assert counts["held"] == 1


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> altered.Folder:
    return altered.base(tmp_path_factory.mktemp("altered") / "base")


@pytest.mark.parametrize("group", altered.GROUPS)
def test_altered_values_are_computed_with_or_answered_in_a_sentence(
    group: str, folder: altered.Folder
) -> None:
    counts, notes = altered.trial(group, [0, 1, 2], 1, folder, 1)
    assert notes == []
    assert sum(counts.values()) == 3
