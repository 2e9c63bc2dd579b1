"""Folders of results from somebody else; `python -m campaigns.result_folders` reads more of them."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from campaigns.result_folders import cases, trial

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="needs links and pipes")


@pytest.mark.parametrize("every", [pytest.param(4, marks=pytest.mark.exhaustive), 397])
def test_what_reads_a_folder_of_somebody_else_answers_and_changes_nothing(every: int, tmp_path: Path) -> None:
    chosen = cases()[::every]
    tally = trial(chosen, tmp_path)
    assert tally.notes == []
    assert tally.folders == len(chosen)
    assert min(tally.calls["a result"], tally.calls["a sentence"]) > len(chosen) / 4


def test_the_trial_has_a_thousand_folders_and_tells_each_by_its_name() -> None:
    names = [case.name for case in cases()]
    assert len(names[::4]) >= 1000
    assert len(set(names)) == len(names)
