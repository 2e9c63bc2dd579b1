"""Random calls are answered alike natively and in Python, a sample; `campaigns.random_calls` makes more."""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Sequence

import pytest

from campaigns.random_calls import SAME, Tally, trial
from yawbench.fmus.build import HERE as FMUS
from yawbench.fmus.build import build_all

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="needs processes that fork")
SMALL = ("controller_pid", "wheel_control_slip")


def made(unit: str, seeds: Sequence[int], calls: int) -> Tally:
    """Return what random calls of a unit come to; it is built if that is still to be done."""
    build_all(FMUS, components=[unit])
    return trial(FMUS / f"{unit}.fmu", seeds, calls)


@pytest.mark.parametrize("unit", SMALL)
@pytest.mark.sampled(1)
def test_a_few_random_calls_are_answered_alike(unit: str) -> None:
    tally = made(unit, range(2), 100)
    assert not tally.notes, "\n".join(tally.notes)
    assert (tally.counts, tally.calls) == (Counter({SAME: 2}), 200)
