"""The sequential test of a share: errors of its decisions, its interval, the points that it takes."""

from __future__ import annotations

import functools
from collections import Counter
from itertools import pairwise

import numpy as np
import pytest

from tests.checkout import ROOT
from tests.markdown import table_in
from yawbench.studies.claims import ONE_IN
from yawbench.studies.confidence import share_bounds
from yawbench.studies.open_value_schema import RegionSpec
from yawbench.studies.sampling import hypercube
from yawbench.studies.sequential_test import Decision, SequentialTest

PAGE = ROOT / "docs" / "regions.md"
CLAIMS = 1000
REGION = RegionSpec.model_validate(
    {"open_values": {"a": {"vary": "a.b", "from": 0, "to": 1, "because": "chosen: to show"}}}
)
TEST = SequentialTest(REGION.looks, 1 / ONE_IN)
WRONG = {
    0.02: {Decision.ABOVE},
    0.05: {Decision.ABOVE},
    0.10: {Decision.ABOVE, Decision.BELOW},
    0.20: {Decision.BELOW},
}
"""Share of points that flip -> what would be a wrong decision."""
RANDOM, HYPERCUBE = slice(1, 4), slice(4, 7)
"""Cells of the table in docs/regions.md with the decisions at random points, and at those of a hypercube."""


def published(share: float) -> list[str]:
    """Return the row of the docs for a true share."""
    (row,) = (row for row in table_in(PAGE.read_text(encoding="utf-8")) if row[0] == f"{100 * share:g} %")
    return row


def cells(found: Counter[Decision]) -> list[str]:
    return [str(found[decision]) for decision in (Decision.BELOW, Decision.ABOVE, Decision.OPEN)]


decision = functools.cache(TEST.decision)
bounds = functools.cache(TEST.bounds)


def stop(outcomes: np.ndarray) -> int:
    """Return the number of points after which a claim is decided, or all looks are spent."""
    counts = np.cumsum(outcomes)
    decided_at = (look for look in TEST.looks if decision(int(counts[look - 1]), look) != Decision.OPEN)
    return next(decided_at, TEST.looks[-1])


def decided(outcomes: np.ndarray) -> Decision:
    number = stop(outcomes)
    return decision(int(outcomes[:number].sum()), number)


@pytest.mark.parametrize("share", WRONG)
def test_of_a_thousand_claims_at_most_one_in_twenty_is_decided_wrongly(share):
    chance = np.random.default_rng(1)
    found = Counter(decided(one) for one in chance.random((CLAIMS, TEST.looks[-1])) < share)
    assert found.total() == CLAIMS
    assert sum(found[one] for one in WRONG[share]) <= 0.05 * CLAIMS
    assert cells(found) == published(share)[RANDOM]


def test_so_it_is_at_the_points_of_the_extended_hypercube():
    chances = {share: np.random.default_rng(2) for share in WRONG}
    found = {share: Counter[Decision]() for share in WRONG}
    for seed in range(CLAIMS):
        positions = hypercube(4, REGION.points, REGION.most, seed)
        for share, chance in chances.items():
            start = chance.random(4)  # a box of this volume, wrapped around: flips depend on all open values
            sides = share ** chance.dirichlet(np.ones(4))
            found[share][decided(np.all((positions - start) % 1.0 < sides, axis=1))] += 1
    for share, wrong in WRONG.items():
        assert sum(found[share][one] for one in wrong) <= 0.05 * CLAIMS
        assert cells(found[share]) == published(share)[HYPERCUBE]


def test_the_interval_agrees_with_the_decision_and_has_its_confidence():
    for look, (low, high) in zip(TEST.looks, TEST.boundaries, strict=True):
        if low >= 0:
            assert TEST.bounds(low, look).high <= TEST.limit
        assert TEST.bounds(low + 1, look).high > TEST.limit or look < TEST.looks[-1]
        assert TEST.bounds(high, look).low >= TEST.limit
    chance, share = np.random.default_rng(5), 0.08
    missed = 0
    for outcomes in chance.random((2000, TEST.looks[-1])) < share:
        number = stop(outcomes)
        low, high = bounds(int(outcomes[:number].sum()), number)
        missed += not low <= share <= high
    assert missed <= 0.05 * 2000


def test_the_docs_tell_how_many_points_decide():
    told = {row[0].partition(":")[0]: row[1:] for row in table_in(PAGE.read_text(encoding="utf-8"))}
    assert told["points"] == [str(look) for look in TEST.looks]
    assert told["robust"] == [str(low) if low >= 0 else "-" for low, _ in TEST.boundaries]
    assert told["above 10 %"] == [str(high) for _, high in TEST.boundaries]


def test_a_single_look_has_the_interval_of_clopper_and_pearson():
    single = SequentialTest((46,), 0.1)
    for count in (0, 1, 5, 46):
        assert single.bounds(count, 46) == pytest.approx(share_bounds(count, 46), abs=1e-9)
    with pytest.raises(ValueError, match="needs a count at a look"):
        single.bounds(1, 45)


def test_a_hypercube_is_extended_without_giving_up_a_point():
    positions = hypercube(5, 16, 128, 1)
    assert np.array_equal(positions[:16], hypercube(5, 16, 16, 1))
    for number in (16, 32, 64, 128):
        parts = np.sort((positions[:number] * number).astype(int), axis=0)
        assert np.array_equal(parts, np.tile(np.arange(number)[:, None], 5))
    assert np.array_equal(positions[:112], hypercube(5, 16, 112, 1))
    assert all(a < b for a, b in pairwise(REGION.looks))
    assert REGION.looks == (16, 32, 48, 64, 80, 96, 112, 128)
