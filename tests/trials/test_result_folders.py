"""Folders of results from somebody else; `python -m campaigns.result_folders` reads more of them."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from campaigns.result_folders import cases, trial

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="needs links and pipes")


@pytest.mark.exhaustive  # tests/orchestrator/test_hostile_folders.py and test_results.py read such folders
def test_what_reads_a_folder_of_somebody_else_answers_and_changes_nothing(tmp_path: Path) -> None:
    chosen = cases()[::397]
    tally = trial(chosen, tmp_path)
    assert tally.notes == []
    assert tally.folders == len(chosen)
    assert min(tally.calls["a result"], tally.calls["a sentence"]) > len(chosen) / 4
