"""Random programs give the same bytes natively as in Python, a sample; `campaigns.translated` tries more."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from campaigns.random_programs import FUNCTION, KINDS, OBJECT
from campaigns.translated import REFUSED, SAME, kind_of, law_of_classes, program_of, trial, tried

FEW = (1, 9, 17, 34)
"""Seeds of programs of all kinds that are translated, not refused."""


def check(seeds: Sequence[int], same: int, made: Any = program_of) -> None:
    """Check that no program is wrong, and that enough of them are translated."""
    tally = trial(seeds, made)
    assert not tally.bad, "\n".join(f"{one.seed}: {why}\n{one.text}" for one, why in tally.bad)
    assert tally.counts[SAME] >= same


def test_a_few_random_programs_give_the_same_bytes() -> None:
    assert {kind_of(seed) for seed in FEW} == set(KINDS)
    check(FEW, len(FEW))


def test_a_few_random_programs_of_classes_give_the_same_bytes() -> None:
    check(range(2_000_000, 2_000_012), 4, law_of_classes)


LAW = """
class Law:
    inputs, outputs = ("yaw_rate", "sideslip"), ("yaw_moment",)
    def __init__(self, gain=2.0):
        self.gain, self.seen, self.kept = gain, [1.0], Kept(2)
    def advance(self, t, h, u):
        self.seen.append(u.yaw_rate)
        self.kept.raised(Pair(u[0], 1).both)
        if len(self.seen) > 4:
            self.seen.pop(0)
    def output(self, t, u):
        return sum(Pair(1, 2)._replace(one=u[0])) + self.seen[0] + self.kept.level * self.gain
"""


def test_a_law_with_a_growing_list_a_dataclass_and_a_named_tuple_is_translated() -> None:
    assert tried(LAW, 1, OBJECT) == (SAME, "")


def test_a_law_that_may_return_true_is_refused() -> None:
    law = "def law(yaw_rate, sideslip, t):\n    return yaw_rate > 0 if t > 1 else 3\n"
    assert tried(law, 1, FUNCTION)[0] == REFUSED


def test_a_program_that_is_not_translated_is_refused() -> None:
    assert tried("def output(self, t, u):\n    import time\n    return (u[0],)\n", 1)[0] == REFUSED
