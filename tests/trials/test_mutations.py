"""Files made wrong at random, a sample; `python -m campaigns.mutations` tries more of them."""

from __future__ import annotations

from pathlib import Path

import pytest

from campaigns.mutations import LIMIT, UNFORESEEN, bad, trial

SAMPLE = {"files": range(50), "ssp": range(10), "results": range(10), "commands": range(3)}


@pytest.mark.exhaustive
@pytest.mark.parametrize("group", SAMPLE)
def test_files_made_wrong_at_random_are_taken_or_answered_in_a_sentence(group: str, tmp_path: Path) -> None:
    ((_, tally),) = trial({group: list(SAMPLE[group])}, 11, tmp_path, LIMIT, 1)
    assert not bad(tally), "\n".join(tally.notes)
    assert sum(tally.counts.values()) == len(SAMPLE[group])
    assert not [note for note in tally.notes if note.startswith(UNFORESEEN)]
