"""`yawbench diff` of two studies: verdicts that changed, runs, numbers by how much."""

from __future__ import annotations

import contextlib
import io
import json

import pytest

from tests.command_line import status_of
from tests.commands.test_batch_commands import SCENARIO, STUDY
from tests.refusals import mentions
from yawbench.studies.differences import differences, recorded_in

UNITS = ("driver_sine", "reference_steady_state", "controller_off", "controller_fuzzy_sideslip")
SWEEP = """
title: Half a sweep
scenario: half.yaml
axes:
  speed: {vary: "inputs.velocity_x", values: [10, 20]}
metrics:
  moment: {metric: peak(yaw_moment)}
"""


@pytest.fixture(scope="module")
def made(fmus, tmp_path_factory):
    """Make a study or a sweep, once with the same options and levels; return its folder."""
    folder = tmp_path_factory.mktemp("made")
    for name, text in {"half": SCENARIO, "study": STUDY, "sweep": SWEEP}.items():
        (folder / f"{name}.yaml").write_text(text)

    def make(kind: str, out: str, *options: str, levels: str = "[10, 20]"):
        if not (folder / out).exists():
            (folder / "sweep.yaml").write_text(SWEEP.replace("[10, 20]", levels))
            file = folder / f"{kind}.yaml"
            with contextlib.redirect_stdout(io.StringIO()):
                assert status_of(kind, file, "--fmus", fmus, "--out", folder / out, *options) == 0
        return folder / out

    return make


def test_a_study_repeated_is_identical(made, yawbench):
    first, second = made("study", "first"), made("study", "second")
    status, out, said = yawbench("diff", first, second)
    assert (status, out) == (0, "") and mentions(said, "identical", "2 verdicts", "2 numbers")


def test_numbers_differ_by_their_share_and_verdicts_by_their_words(made, yawbench):
    first = made("study", "first")
    second = made("study", "slower", "--set", "driver.amplitude=1e-7", "--set", "inputs.sideslip=0")
    ours, theirs = recorded_in(first), recorded_in(second)
    found = differences(ours, theirs)
    (pair,) = found.numbers
    assert (pair.run, pair.name, pair.unit) == ("fuzzy_sideslip", "moment", "N.m")
    numbers = [float(one.rows["fuzzy_sideslip",]["moment"]) for one in (ours, theirs)]
    assert (pair.first, pair.second) == tuple(numbers)
    assert pair.relative == pytest.approx((numbers[1] - numbers[0]) / max(numbers))
    (claim,) = found.claims
    assert claim["says"] == "Control is gentle."
    assert (claim["verdict_first"], claim["verdict_second"]) == ("does not reproduce", "holds")
    status, out, _ = yawbench("diff", first, second)
    assert status == 0
    assert mentions(out, "Control is gentle.", "does not reproduce", "holds")
    assert mentions(out, "1 of 2 numbers differ") and mentions(out, "fuzzy_sideslip", "-100 %")
    answer = json.loads(yawbench("diff", first, second, "--json")[1])
    assert answer["identical"] is False and answer["numbers"][0]["second"] == pair.second


def test_runs_of_a_sweep_are_told_apart_by_their_levels(made):
    first, second = made("sweep", "swept"), made("sweep", "faster", levels="[20, 30]")
    found = differences(recorded_in(first), recorded_in(second))
    assert (found.compared, found.numbers) == (1, [])
    assert found.statuses == [("10.0", "completed", ""), ("30.0", "", "completed")]


def test_what_has_nothing_in_common_cannot_be_compared(made, yawbench):
    status, _, said = yawbench("diff", made("study", "first"), made("sweep", "swept"))
    assert status == 1 and mentions(said, "nothing", "compared")


def test_a_damaged_record_is_refused_in_a_sentence(made, yawbench):
    first, second = made("study", "first"), made("study", "second")
    for file, damage in (("experiment.json", "[]"), ("table.csv", "run\n1\n")):
        whole = (second / file).read_text()
        (second / file).write_text(damage)
        status, _, said = yawbench("diff", first, second)
        assert status in (1, 2) and mentions(said, file) and "Traceback" not in said
        (second / file).write_text(whole)
