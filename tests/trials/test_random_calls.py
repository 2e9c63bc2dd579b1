"""Random calls are answered alike natively and in Python, a sample; `campaigns.random_calls` makes more."""

from __future__ import annotations

import sys
from collections import Counter

import pytest

from campaigns.random_calls import SAME, trial
from yawbench.fmus.build import HERE as FMUS
from yawbench.fmus.build import build_all

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="needs processes that fork")


@pytest.mark.parametrize("unit", ["controller_pid", "wheel_control_slip"])
@pytest.mark.sampled(1)
def test_a_few_random_calls_are_answered_alike(unit: str) -> None:
    build_all(FMUS, components=[unit])
    tally = trial(FMUS / f"{unit}.fmu", range(2), 100)
    assert not tally.notes, "\n".join(tally.notes)
    assert (tally.counts, tally.calls) == (Counter({SAME: 2}), 200)
