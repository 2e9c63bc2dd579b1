"""Files of users and records altered at random, a sample; `python -m campaigns.altered` tries more."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from campaigns.altered import GROUPS, Folder, base, trial
from campaigns.kills import COMMANDS, UNITS, build_all, on_a_full_disk
from campaigns.kills import trial as trial_of_command

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="forks, and limits the child")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Folder]:
    yield base(tmp_path_factory.mktemp("altered") / "base")


@pytest.mark.exhaustive  # tests/commands/test_hostile_files.py and orchestrator/test_one_car.py alter files
@pytest.mark.parametrize("group", GROUPS)
def test_altered_values_are_computed_with_or_answered_in_a_sentence(group: str, folder: Folder) -> None:
    counts, notes = trial(group, [0, 1, 2], 1, folder, 1)
    assert notes == []
    assert sum(counts.values()) == 3


@pytest.mark.exhaustive  # tests/orchestrator/test_recorder.py and test_formats.py fill disks
@pytest.mark.parametrize("command", COMMANDS)
def test_a_command_on_a_full_disk_fails_in_a_sentence_and_the_next_call_gives_all(
    command: str, tmp_path: Path
) -> None:
    build_all(tmp_path / "fmus", components=UNITS)
    counts, notes = trial_of_command(command, 1, 5, tmp_path, tmp_path / "fmus", on_a_full_disk)
    assert notes == []
    assert counts["held"] == 1
