"""Work that is bounded: large systems in near-linear time, limits that are said before memory is filled."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from pathlib import Path
from types import FrameType
from typing import Any

import pytest

from campaigns.large import write_ring
from tests.cars import load_scenario, make_plan
from tests.refusals import mentions, places_of, texts_of
from yawbench.commands.check import show
from yawbench.foundation.errors import WiringError

pytestmark = pytest.mark.usefixtures("common_cache")


OURS = f"{os.sep}yawbench{os.sep}"
"""In the path of all code of the program, also of the folders beside the package, which are links in it."""


def lines_run(function: Callable[[], object]) -> int:
    """Return how many lines of the program a call executes, rounds of loops and comprehensions too."""
    count = 0

    def local(frame: FrameType, event: str, argument: Any) -> Any:
        nonlocal count
        count += event == "line"
        return local

    def trace(frame: FrameType, event: str, argument: Any) -> Any:
        return local if OURS in frame.f_code.co_filename else None

    before = sys.gettrace()
    sys.settrace(trace)
    try:
        function()
    finally:
        sys.settrace(before)
    return count


@pytest.mark.parametrize(
    "follows",
    ["all", *(pytest.param(word, marks=pytest.mark.exhaustive) for word in ("nothing", "one", "unsaid"))],
)
def test_twice_the_units_and_variables_take_twice_the_work(
    follows: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    scenarios = [
        write_ring(tmp_path / str(n), units=n, variables=20 * n, follows=follows) for n in (8, 16, 32)
    ]

    def check(scenario: Path) -> None:
        show(make_plan(load_scenario(scenario)), scenario)

    check(scenarios[0])  # modules are imported, caches filled
    small, double, fourfold = (lines_run(lambda file=file: check(file)) for file in scenarios)
    assert double - small < fourfold - double < 2.5 * (double - small)


def test_a_loop_is_said_with_its_path_which_is_cut_short_if_very_long(tmp_path: Path) -> None:
    scenario = write_ring(tmp_path, units=30, variables=120, follows="unsaid")
    (note,) = make_plan(load_scenario(scenario)).diagnostics
    assert note.code == "algebraic-loop-possible"
    path = ("unit_29.u29_y0", "unit_0.u29_y0", "unit_0.u0_y0", "unit_1.u0_y0")
    assert mentions(note, *path)
    assert "42 more -> unit_29.u29_y0;" in str(note)
    closed = write_ring(tmp_path / "closed", units=30, variables=120, follows="closed")
    with pytest.raises(WiringError) as caught:
        make_plan(load_scenario(closed))
    assert places_of(caught.value.diagnostics) == [("algebraic-loop", str(closed))] * 2
    assert [len(problem) < 1000 for problem in texts_of(caught.value)] == [True, True]
    assert mentions(caught.value, *path, "'delay: 1 step'")
