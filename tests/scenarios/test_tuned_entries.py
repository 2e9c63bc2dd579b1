"""The ranking's tuned entries are what the search of all laws found, within its ranges and its budget."""

from __future__ import annotations

import json
import re

import pytest
from ruamel.yaml import YAML

import yawbench as yb
from tests.checkout import ROOT
from tests.command_line import status_of
from yawbench.orchestrator.scenario.catalogue import SHIPPED
from yawbench.studies.axes import level_at
from yawbench.studies.load_experiment import load_experiment
from yawbench.studies.tuning import DIGITS, tuning_of

HERE = SHIPPED / "proving_ground"
TUNING = tuning_of(load_experiment(HERE / "tuning.yaml"))
ENTRIES = YAML(typ="safe").load((HERE / "tuned.yaml").read_text(encoding="utf-8"))["entries"]
FOUND = {entry["title"].removeprefix("tuned "): entry for entry in ENTRIES.values()}
"""Law -> its entry."""


def costs(law: str) -> list[float]:
    """Return what an entry's source says of the objective: found, and amid the ranges."""
    return [float(text) for text in re.findall(r"cost ([\d.]+), ([\d.]+) amid", FOUND[law]["source"])[0]]


def changes(law: str) -> dict[str, float]:
    """Return an entry's parameters as a scenario is given them."""
    return {f"controller.{name}": value for name, value in FOUND[law]["parameters"].items()}


def test_every_law_of_the_search_is_an_entry_with_the_same_budget_and_no_other():
    assert [*FOUND] == [*TUNING.laws]
    budget = (
        f"proving_ground/tuning.yaml: {TUNING.population * TUNING.generations} trials, seed {TUNING.seed};"
    )
    assert all(one["source"].startswith(budget) and one["gains"] == "tuned" for one in ENTRIES.values())


@pytest.mark.parametrize("law", FOUND)
def test_what_was_found_lies_in_its_ranges_about_the_authors_gains(law):
    spec, given = TUNING.laws[law], changes(law)
    sought = {str(axis.vary[0]): axis for axis in spec.axes.values()}
    assert FOUND[law]["fmu"] == spec.swap["controller"]
    fixed = {str(target): value for target, value in spec.set.items()}
    assert given.keys() == fixed.keys() | sought.keys()
    assert given == given | fixed
    plan = yb.load("proving_ground/sine_with_dwell").swap(controller=FOUND[law]["fmu"]).set(given).plan()
    (variables,) = (unit.fmu.variables for unit in plan.instances if unit.name == "controller")
    for place, axis in sought.items():
        assert given[place] == float(f"{given[place]:.{DIGITS}g}")
        assert axis.start <= given[place] <= axis.end
        default = float(variables[place.partition(".")[2]].start)
        assert level_at(axis, 0.5).value == pytest.approx(default, rel=1e-3), place
    found, amid = costs(law)
    assert found <= amid


def test_the_docs_tell_the_objective_of_every_law_the_least_first():
    page = (ROOT / "docs/proving_ground.md").read_text(encoding="utf-8")
    shown = re.findall(r"^\| ([\w -]+) \| ([\d.]+) \| ([\d.]+) \|$", page, re.MULTILINE)
    found = sorted((costs(law), law) for law in FOUND)
    assert shown == [(law, f"{amid:.1f}", f"{least:.1f}") for (least, amid), law in found]


@pytest.mark.exhaustive
@pytest.mark.parametrize("law", ["LQR", "fuzzy feedback"])
def test_the_objective_of_an_entry_is_what_its_runs_come_to(law, tmp_path):
    yaml = YAML(typ="safe")
    file = yaml.load((HERE / "tuning.yaml").read_text(encoding="utf-8"))
    del file["tuning"]
    for run in file["runs"]:
        run["scenario"], run["vehicle"] = (
            str((HERE / run[key]).resolve()) for key in ("scenario", "vehicle")
        )
        if run["name"].endswith("/tuned"):
            run |= {"swap": {"controller": FOUND[law]["fmu"]}, "set": {**run.get("set", {}), **changes(law)}}
    yaml.dump(file, tmp_path / "again.yaml")
    assert status_of("study", tmp_path / "again.yaml", "--out", tmp_path / "out", "--jobs", "1") == 0
    (made,) = json.loads((tmp_path / "out/experiment.json").read_text())["derived"].values()
    assert made["value"] == pytest.approx(costs(law)[0], rel=1e-3)
