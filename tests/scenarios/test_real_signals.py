"""What estimators miss, open loop, and who sees what in the scenarios of real signals."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import yawbench as yb
from orchestrator.cli import main

from .open_loop import MANOEUVRES, SPEED, missed, row
from .real_signals_tables import kept, late

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
    assert len(yb.load(f"real_signals/{name}").loaded.connections) <= 4


@pytest.mark.parametrize("name", FILES)
def test_no_input_of_the_control_side_is_exact_but_the_drivers_wish(name):
    plan = yb.load(f"real_signals/{name}").plan()
    truth = {"driver", "plant"}
    control = {"estimator", "reference", "controller", "allocator", "wheel_control"}
    seen = {(w.source, w.output) for w in plan.wires if w.target in control and w.source in truth}
    assert seen <= {("driver", "drive_force")}
    assert not [w for w in plan.wires if w.target == "tyre" and w.source == "estimator"]


@pytest.mark.exhaustive
@pytest.mark.parametrize(("name", "rows"), [("closed_loop", kept), ("latency", late)])
def test_the_documentation_has_what_the_studies_measure(name, rows, tmp_path):
    with pytest.raises(SystemExit) as exit_:
        main(["study", str(ROOT / f"scenarios/real_signals/{name}.yaml"), "--quick", "--out", str(tmp_path)])
    assert not exit_.value.code
    study = json.loads((tmp_path / "experiment.json").read_text("utf-8"))
    written = (ROOT / "docs" / "estimators.md").read_text("utf-8")
    assert [row for row in rows(study) if row not in written] == []
