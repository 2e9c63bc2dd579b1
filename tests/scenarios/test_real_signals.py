"""Errors of estimators, open loop, and the signals of instances in the scenarios of real signals."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import yawbench as yb
from yawbench.cli import main
from yawbench.studies.load_experiment import load_experiment

from .open_loop import MANOEUVRES, SPEED, missed, row
from .real_signals_tables import kept, late, step_by_step

ROOT = Path(__file__).parents[2]
FILES = sorted(
    file.stem for file in (ROOT / "scenarios" / "real_signals").glob("*.yaml") if "units:" in file.read_text()
)


@pytest.mark.exhaustive
@pytest.mark.parametrize("name", MANOEUVRES)
def test_the_observer_misses_no_more_than_it_may_and_the_documentation_says_what(name):
    observer = missed(name)["estimator_observer"]
    rms, largest = MANOEUVRES[name].most
    assert observer.rms <= rms
    assert observer.largest <= largest
    assert observer.speed <= SPEED
    assert row(name) in (ROOT / "docs" / "estimators.md").read_text("utf-8")


@pytest.mark.parametrize("name", FILES)
def test_four_lines_put_sensor_and_estimator_into_a_loop(name):
    more = name.startswith(("told_", "monitored_", "parity_"))  # who is told the truth, who watches
    more += name == "parity_weave"  # two monitors
    assert len(yb.load(f"real_signals/{name}")._loaded.connections) <= 4 + more


@pytest.mark.parametrize("name", [name for name in FILES if name != "blind"])  # there estimators only listen
def test_no_input_of_the_control_side_is_exact_but_the_drivers_wish(name):
    plan = yb.load(f"real_signals/{name}").plan()
    truth = {"driver", "plant"}
    control = {"estimator", "reference", "controller", "monitor", "allocator", "wheel_control"}
    wires = [w for w in plan.wires if w.target in control and w.source in truth]
    told = name.startswith("told_")  # by an estimator that is told the truth
    assert told == any(w.input.endswith("_true") for w in wires)
    seen = {(w.source, w.output) for w in wires if not (told and w.target == "estimator")}
    assert seen <= {("driver", "drive_force")}
    assert not [w for w in plan.wires if w.target == "tyre" and w.source == "estimator"]


TOLD = {
    "told_fnn": "fnn_sideslip/25mps",
    "told_lane_change": "fuzzy_sliding_mode/beyond_paper",
    "told_double_lane_change": "fuzzy_pid/double_lane_change",
    "told_single_sine": "fuzzy_feedback/single_sine",
}
EXACT = {"estimator.sample_time": 0, "reference.rate_time_constant": 0.005}


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=() if name == "told_fnn" else pytest.mark.exhaustive) for name in TOLD]
)
def test_where_all_is_told_exactly_and_at_once_a_run_is_that_of_the_paper_to_the_bit(name):
    until = {"stop_time": 1.5}
    told = yb.load(f"real_signals/{name}").swap(sensor="sensor_ideal").set({**EXACT, **until}).run()
    exact = yb.load(TOLD[name]).set(until).run()
    assert {c for c in exact if not np.array_equal(exact[c], told[c])} == set()
    assert np.ptp(told["controller.yaw_moment"]) > 0


@pytest.mark.exhaustive
@pytest.mark.parametrize(
    ("name", "rows", "page"),
    [
        ("closed_loop", kept, "estimators"),
        ("latency", late, "estimators"),
    ],
)
def test_the_documentation_has_what_the_studies_measure(name, rows, page, tmp_path):
    with pytest.raises(SystemExit) as exit_:
        main(["study", str(ROOT / f"scenarios/real_signals/{name}.yaml"), "--out", str(tmp_path)])
    assert not exit_.value.code
    study = json.loads((tmp_path / "experiment.json").read_text("utf-8"))
    assert {check["verdict"] for check in study["checks"]} <= {"holds"}
    written = (ROOT / "docs" / f"{page}.md").read_text("utf-8")
    assert [row for row in rows(study) if row not in written] == []


@pytest.mark.parametrize(("name", "noisy"), [("degradation", 6 * 4), ("faults", 177)])
def test_every_run_with_noise_that_a_mean_is_made_of_has_ten_seeds(name, noisy):
    study = load_experiment(ROOT / f"scenarios/real_signals/{name}.yaml")
    seeds: dict[str, set[object]] = {}
    for case in study.cases:
        drawn = [change.value for change in case.changes if str(change.target) == "sensor.seed"]
        seeds.setdefault(case.run.name, set()).update(drawn)
    assert sorted(map(len, seeds.values())) == [0] * (len(seeds) - noisy) + [10] * noisy
    assert len(study.short.points) == 3


@pytest.fixture(scope="module")
def page() -> str:
    return (ROOT / "docs" / "estimators.md").read_text("utf-8")


@pytest.mark.exhaustive
def test_the_page_on_real_signals_has_no_row_that_the_study_does_not_measure(tmp_path):
    with pytest.raises(SystemExit) as exit_:
        main(["study", str(ROOT / "scenarios/real_signals/degradation.yaml"), "--out", str(tmp_path)])
    assert not exit_.value.code
    study = json.loads((tmp_path / "experiment.json").read_text("utf-8"))
    measured = step_by_step(study)
    begin = tuple(" ".join(row.split(" | ")[:1]) for row in measured)
    lines = (ROOT / "docs" / "real_signals.md").read_text("utf-8").splitlines()
    numbers = [line for line in lines if line.startswith(begin) and line.count(" | ") > 1]
    assert [line for line in numbers if line not in measured] == []
