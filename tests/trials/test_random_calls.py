"""Random calls are answered alike natively and in Python: a few with all tests, all units on demand."""

from __future__ import annotations

import os
import re
import signal
import sys
from collections import Counter
from collections.abc import Callable, Sequence

import pytest

from campaigns import random_calls
from campaigns.fmi_calls import Call, Host, Save, Step
from campaigns.random_calls import DEAD, DIFFERENT, SAME, SLOW, Tally, trial
from yawbench.fmus.archive import runs_as
from yawbench.fmus.build import HERE as FMUS
from yawbench.fmus.build import build_all

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="needs processes that fork")
SMALL = ("controller_pid", "wheel_control_slip")


SEED = 1
"""Seed of a sequence in which an instance soon makes a step and is saved."""


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


@pytest.mark.exhaustive
def test_random_calls_of_all_native_units_are_answered_alike() -> None:
    build_all(FMUS)
    native = [archive for archive in sorted(FMUS.glob("*.fmu")) if runs_as(archive).native]
    tallies = [trial(archive, range(2, 7)) for archive in native]
    notes = [note for tally in tallies for note in tally.notes]
    assert not notes, "\n\n".join(notes)
    assert len(native) > 40
    assert sum(tally.calls for tally in tallies) > 700 * len(native)


def told_of_a_fault(monkeypatch: pytest.MonkeyPatch, fault: Callable[[Host, Call, str], str]) -> list[str]:
    """Return the lines that are told of a sequence in which a fault changes Python's answers."""
    answer = Host.answer

    def wrong(host: Host, call: Call) -> str:
        right = answer(host, call)
        return fault(host, call, right) if host.fmu.folder.name == "python" else right

    monkeypatch.setattr(Host, "answer", wrong)
    (note,) = made("controller_pid", [SEED], 30).notes
    return note.splitlines()


def names(calls: list[str]) -> str:
    return " ".join(call.partition("(")[0] for call in calls)


def test_a_wrong_answer_is_told_with_the_fewest_calls(monkeypatch: pytest.MonkeyPatch) -> None:
    def fault(host: Host, call: Call, right: str) -> str:
        return f"{right}, changed" if isinstance(call, Save) and right == "0" else right

    head, *calls, native, python = told_of_a_fault(monkeypatch, fault)
    assert head == f"controller_pid, seed {SEED}: {DIFFERENT}"
    assert names(calls) == "New Save"
    assert (native, python) == ("native 0", "python 0, changed")


def test_a_library_that_dies_is_told_with_the_fewest_calls(monkeypatch: pytest.MonkeyPatch) -> None:
    def fault(host: Host, call: Call, right: str) -> str:
        if isinstance(call, Step) and right == "0":
            os.kill(os.getpid(), signal.SIGKILL)
        return right

    head, *calls, why = told_of_a_fault(monkeypatch, fault)
    assert head == f"controller_pid, seed {SEED}: {DEAD}"
    assert re.fullmatch("New (Setup )?Plain Plain Step", names(calls))
    assert why == "python ends by SIGKILL"


def test_a_library_that_hangs_is_ended(monkeypatch: pytest.MonkeyPatch) -> None:
    def fault(host: Host, call: Call, right: str) -> str:
        while isinstance(call, Step):
            pass
        return right

    monkeypatch.setattr(random_calls, "SECONDS", 0.05)
    head, *calls, why = told_of_a_fault(monkeypatch, fault)
    assert head == f"controller_pid, seed {SEED}: {SLOW}"
    assert names(calls).endswith(" Step")
    assert why == "python ends by SIGPROF"
