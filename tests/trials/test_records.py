"""Records and journals with altered lines, a sample; `python -m campaigns.records` alters more."""

from __future__ import annotations

from pathlib import Path

import pytest

from campaigns.records import KINDS, trial
from tests.orchestrator.test_batch_commands import UNITS
from yawbench.fmus.build import build_all


def _none_wrong(counts: dict[str, int], seed: int, place: Path) -> None:
    build_all(place / "fmus", components=UNITS)
    for kind, tally, notes in trial(counts, seed, place, place / "fmus"):
        assert notes == []
        assert sum(tally.values()) == counts[kind]


def test_a_few_altered_records_and_lines_change_no_number_without_a_word(tmp_path: Path) -> None:
    _none_wrong({"record_listed": 4, "journal": 1, "entries": 3}, 2, tmp_path)


@pytest.mark.exhaustive
def test_altered_records_and_lines_change_no_number_without_a_word(tmp_path: Path) -> None:
    _none_wrong({kind: 5 if kind.endswith(("_study", "_sweep")) else 125 for kind in KINDS}, 3, tmp_path)
