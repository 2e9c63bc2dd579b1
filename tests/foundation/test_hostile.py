"""FMUs that do harm: a sample of `campaigns.hostile_fmus`, and what is written into a pipe."""

from __future__ import annotations

import os
import shutil
import sys
import time

import pytest

from campaigns.hostile_fmus import Case, attack
from yawbench.foundation import processes
from yawbench.foundation.processes import ProcessLost, Worker

pytestmark = [
    pytest.mark.skipif(sys.platform != "linux", reason="compiles for Linux"),
    pytest.mark.skipif(shutil.which("cc") is None, reason="there is no C compiler"),
]
TOGETHER = (
    "load:exit", "enter:segfault", "step:exit", "step:_exit", "step:kill", "step:execute", "step:hang",
    "step:deaf", "step:leave_thread", "step:garbage", "step:close", "step:rounding",
    "leave:trap", "enter:flush", "step:signals", "set:flood", "terminate:segfault",
    "free:_exit", "free:thread", "free:log_after", "value:nan", "value:huge_text",
)  # fmt: skip
OF_EACH_KIND = (
    "step:_exit", "step:garbage", "step:close", "step:rounding", "step:escape", "free:thread", "value:nan",
)  # fmt: skip
"""A few of them, for the first tier; one that does not come back is in test_run.py."""
APART = (
    "load:exit", "enter:segfault", "step:_exit", "step:hang", "step:child_crash", "step:garbage",
    "step:close", "get:stop", "set:flood", "terminate:kill", "free:hang", "value:nan", "value:huge_text",
    "step:status_minus", "leave:long",
)  # fmt: skip


@pytest.mark.parametrize(
    ("isolated", "harm"),
    [
        pytest.param(False, OF_EACH_KIND, id="some"),
        pytest.param(False, TOGETHER, id="together", marks=pytest.mark.exhaustive),
        pytest.param(True, APART, id="apart", marks=pytest.mark.exhaustive),
    ],
)
def test_a_unit_that_does_harm_ends_its_run_with_a_sentence_and_the_results_so_far(isolated, harm, tmp_path):
    cases = [Case(does, isolated) for does in harm]
    assert attack(cases, tmp_path) == {case: [] for case in cases}


@pytest.mark.parametrize(
    "said", [b"", b"hello", bytes(9), b"garbage that is no record", bytes([3]) + bytes(7) + b"abc"]
)
@pytest.mark.parametrize("stays", [True, False])
def test_what_comes_through_the_pipe_and_is_no_answer_is_a_sentence(said, stays):
    worker = Worker(())
    worker.give(_say, (said, stays))
    worker._deadline = time.monotonic() + 0.3
    with pytest.raises(ProcessLost) as lost:
        worker.answer()
    assert any(words in str(lost.value) for words in ("wrote", "not respond", "status 0"))
    assert worker.child.ended()


def _say(said, stays):
    """Write bytes into the pipe in place of an answer, and wait or exit."""
    os.write(processes.asking.writing, said)
    if stays:
        time.sleep(60)
    os._exit(0)
