"""Records and journals with altered lines, a sample; `python -m campaigns.records` alters more."""

from __future__ import annotations

from pathlib import Path

from campaigns.records import trial
from tests.orchestrator.test_batch_commands import UNITS
from yawbench.fmus.build import build_all


def test_a_few_altered_records_and_lines_change_no_number_without_a_word(tmp_path: Path) -> None:
    build_all(tmp_path / "fmus", components=UNITS)
    counts = {"record_listed": 4, "journal": 1, "entries": 3}
    for kind, tally, notes in trial(counts, 2, tmp_path, tmp_path / "fmus"):
        assert notes == []
        assert sum(tally.values()) == counts[kind]
