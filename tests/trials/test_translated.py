"""Random programs give the same bytes natively as in Python: a few with all tests, hundreds on demand."""

from __future__ import annotations

from collections.abc import Sequence

import pytest

from .random_programs import program
from .translated import REFUSED, SAME, trial, tried

FEW = (0, 5, 7, 10)
"""Seeds of programs that are translated, not refused."""


def check(seeds: Sequence[int], same: int) -> None:
    """Check that no program is wrong, and that enough of them are translated."""
    tally = trial(seeds)
    assert not tally.bad, "\n".join(f"{seed}: {why}\n{program(seed)}" for seed, why in tally.bad)
    assert tally.counts[SAME] >= same


def test_a_few_random_programs_give_the_same_bytes() -> None:
    check(FEW, len(FEW))


@pytest.mark.exhaustive
def test_random_programs_give_the_same_bytes() -> None:
    check(range(100, 400), 100)


def test_a_program_that_is_not_translated_is_refused() -> None:
    assert tried("def output(self, t, u):\n    import time\n    return (u[0],)\n", 1)[0] == REFUSED
