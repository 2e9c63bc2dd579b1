"""`run --live`, `--realtime` and `--record`: what is seen of a run meanwhile, its pace, its columns."""

from __future__ import annotations

import time

import numpy as np
import pytest

from tests.commands.test_batch_commands import SCENARIO
from tests.refusals import mentions
from yawbench.commands.live import Live, braille
from yawbench.orchestrator.results.reader import load_results
from yawbench.planner import Planner

UNITS = ("driver_sine", "reference_steady_state", "controller_fuzzy_sideslip")


@pytest.fixture
def run(yawbench, fmus, tmp_path):
    (tmp_path / "half.yaml").write_text(SCENARIO)

    def make(out, *options):
        status, said, told = yawbench(
            "run", tmp_path / "half.yaml", "--fmus", fmus, "--out", tmp_path / out, *options
        )
        return status, said + told, tmp_path / out

    return make


def test_a_paced_run_takes_its_time_and_computes_the_same(run):
    _, _, free = run("free")
    began = time.monotonic()
    status, _, paced = run("paced", "--realtime", "0.5")
    assert status == 0
    assert time.monotonic() - began >= 0.8
    assert (free / "results.csv").read_bytes() == (paced / "results.csv").read_bytes()


def test_without_a_terminal_a_live_run_says_its_values(run):
    status, told, folder = run("live", "--live")
    assert status == 0
    last = load_results(folder)["driver.steer_angle"][-1]
    assert mentions(told, "t = 0.40 s", f"(driver.steer_angle) {np.degrees(last):.4g} °")


def test_record_keeps_the_columns_that_it_names(run):
    _, _, folder = run("some", "--record", "yaw_rate_ref", "--record", "driver.*")
    kept, every = load_results(folder), load_results(run("all")[2])
    assert {"reference.yaw_rate_ref", "driver.steer_angle"} <= set(kept)
    assert all(name.startswith("driver.") or name == "reference.yaw_rate_ref" for name in kept)
    assert all(np.array_equal(kept[name], every[name]) for name in kept)


@pytest.mark.parametrize(
    ("options", "names"),
    [
        (("--record", "yaw_rat_ref"), ("'yaw_rat_ref'", "reference.yaw_rate_ref")),
        (("--realtime", "0"), ("--realtime", "above 0")),
        (("--realtime", "nan"), ("--realtime", "above 0")),
    ],
)
def test_what_is_wrong_is_a_sentence(run, options, names):
    status, told, _ = run("wrong", *options)
    assert status == 2
    assert mentions(told, *names)


def test_a_curve_has_a_dot_for_each_value():
    values = np.array([0.0, 1.0, 2.0, 3.0, np.nan, 7.0])
    lines = braille(values, values, 0.0, 7.0, 2)
    dots = {
        (4 * row + r, 2 * column + c)
        for row, line in enumerate(lines)
        for column, sign in enumerate(line)
        for r, places in enumerate(((0x01, 0x08), (0x02, 0x10), (0x04, 0x20), (0x40, 0x80)))
        for c, bit in enumerate(places)
        if (ord(sign) - 0x2800) & bit
    }
    assert dots == {(7, 0), (6, 1), (5, 2), (4, 3), (0, 5)}
    assert [len(line) for line in braille(np.zeros(8), np.full(8, 7.0), 0.0, 7.0, 2)] == [4, 4]


def test_a_picture_has_the_extremes_of_its_curves(fmus, tmp_path):
    (tmp_path / "half.yaml").write_text(SCENARIO)
    planner = Planner()
    plan = planner.plan(planner.load(tmp_path / "half.yaml"), fmus=fmus)
    live = Live(plan, terminal=True)
    rows = np.zeros((41, 1 + len(plan.record)))
    rows[:, 0] = np.linspace(0.0, 0.4, 41)
    rows[:, 1:] = np.sin(rows[:, :1])
    live.look(rows)
    text = str(live._picture())
    assert mentions(text, "t = 0.40 of 0.4 s")
    assert mentions(text, "driver.steer_angle", f"{np.degrees(np.sin(0.4)):.4g} °")
