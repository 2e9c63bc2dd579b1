"""Errors of estimators, open loop, and the signals of instances in the scenarios of real signals."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest

import yawbench as yb
from tests.command_line import status_of
from tests.markdown import table_in
from tests.refusals import sentence_has
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
    assert status_of("study", ROOT / f"scenarios/real_signals/{name}.yaml", "--out", tmp_path) == 0
    study = json.loads((tmp_path / "experiment.json").read_text("utf-8"))
    assert {check["verdict"] for check in study["checks"]} <= {"holds"}
    written = (ROOT / "docs" / f"{page}.md").read_text("utf-8")
    assert [row for row in rows(study) if row not in written] == []
    if name == "latency":
        wanted = yb.open(tmp_path / "15mps/0ms/conventional")["ideal.sideslip_ref"]
        assert sentence_has(written, f"{np.degrees(np.abs(wanted).max()):.2f}°", "peak")


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


def test_the_page_says_what_the_low_pass_of_the_hand_wheel_is_worth(page):
    """The run of the closed-loop study with friction known."""
    known = {"sensor.latency": 0, "inputs.reference.friction": 0.5}
    scenario = yb.load("real_signals/single_sine").set(known)
    with_it, without = (
        100 * run.metric("relative_rms_error(yaw_rate, ideal.yaw_rate_ref)", window=(0.5, 3.5))
        for run in (scenario.run(), scenario.set({"estimator.inertial_bandwidth": 0}).run())
    )
    assert sentence_has(" ".join(page.split()), f"{without:.2f} %", f"{with_it:.2f} %")


def test_the_sentences_on_latency_follow_from_the_table_below_them(page):
    section = page.partition("## Paper A and latency")[2].partition("## ")[0]
    text = " ".join(section.split())
    table = {
        tuple(name.split(", ")): [float(cell.removesuffix(" %")) for cell in cells]
        for name, *cells in table_in(section)
        if name
    }
    fast = [row for (speed, law), row in table.items() if speed != "15 m/s" and law != "network that learns"]
    slow = [x for (speed, _), row in table.items() if speed == "15 m/s" for x in row]
    learning = [table[speed, "network that learns"] for speed in ("25 m/s", "40 m/s")]
    conventional = table["15 m/s", "conventional fuzzy"][0]
    (begin, end), (more, most) = zip(*((row[0], row[-1]) for row in learning), strict=True)
    assert sentence_has(
        text, f"{4 * len(table)} runs", f"{min(min(row) for row in table.values())} %", "best"
    )
    without, late = (sorted(row[column] for row in fast) for column in (0, -1))
    assert sentence_has(
        text,
        f"{without[0]:.0f}",
        f"{without[-1]:.0f} %",
        f"{late[0] + 0.01:.0f}",
        f"{late[-1]:.0f} %",
        f"{begin:.0f}",
        f"{end:.0f} %",
        f"{more:.0f}",
        f"{most:.0f} %",
        "20",
        "grows",
    )
    assert sentence_has(text, f"{conventional} %", "conventional", "fuzzy")
    assert sentence_has(text, f"{sorted(slow)[1]:.0f} %", "error")


def test_the_sentence_on_bounds_has_how_far_they_lie_above_what_is_measured(page):
    rows = [row for row in table_in(page.partition("## Controllers with estimates")[2]) if row[-1] == "met"]
    above = []
    for says, measured, _ in rows:
        bound = float(
            re.findall(r"([\d.]+)(?: %| deg| degrees)", says.rpartition(" at most ")[2] or says)[-1]
        )
        worst = float(re.findall(r"[\d.]+", measured)[-1])
        above.append(100 * (bound / worst - 1))
    assert sentence_has(" ".join(page.split()), f"{min(above):.0f}", f"{max(above):.0f} %", "worst", "result")


@pytest.mark.exhaustive
def test_the_page_on_real_signals_has_no_row_that_the_study_does_not_measure(tmp_path):
    assert status_of("study", ROOT / "scenarios/real_signals/degradation.yaml", "--out", tmp_path) == 0
    study = json.loads((tmp_path / "experiment.json").read_text("utf-8"))
    measured = step_by_step(study)
    begin = tuple(" ".join(row.split(" | ")[:1]) for row in measured)
    lines = (ROOT / "docs" / "real_signals.md").read_text("utf-8").splitlines()
    numbers = [line for line in lines if line.startswith(begin) and line.count(" | ") > 1]
    assert [line for line in numbers if line not in measured] == []
    text, runs = " ".join(" ".join(lines).split()), study["runs"]

    def rises(law: str) -> str:
        late, exact = (
            100 * runs[f"A/{law}/{step}"]["metrics"]["error"]["value"] for step in ("late", "exact")
        )
        return f"from {exact:.1f} to {late:.{0 if late > 100 else 1}f} %"

    assert sentence_has(text, rises("learning"), "largest", "error")
    assert sentence_has(text, rises("frozen"), "frozen", "weights")
    assert sentence_has(text, rises("conventional"), "conventional", "fuzzy")
    share = {
        name: (100 * number["value"], 100 * (number.get("half") or 0.0))
        for name, number in study["derived"].items()
    }
    for name in ("kept/A/learning/sideslip", "kept/C/friction", "kept/B/friction", "kept/D/friction"):
        value, half = share[name]
        assert f"{value:.1f} ± {half:.1f} %" in text, name
    (before, _), (after, _) = share["kept/C/friction"], share["kept/C/biases"]
    assert sentence_has(text, f"{before - after:.0f} percentage points", "Biases", "cost")
