"""The study of paper D on the real master."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from fmus.build import build_all
from orchestrator.cli import main

STUDY = Path(__file__).parents[2] / "scenarios" / "fuzzy_feedback" / "study.yaml"
UNITS = (
    "driver_sine", "reference_single_track", "controller_off", "controller_fuzzy_feedback", "plant_two_dof",
    "tyre_magic_formula_1987",
)  # fmt: skip
DEGREE = 0.017453292519943295


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    """What experiment.json says."""
    folder = tmp_path_factory.mktemp("paper_d")
    build_all(folder / "fmus", components=UNITS)
    with pytest.raises(SystemExit) as exit_:
        main(["study", str(STUDY), "--quick", "--out", str(folder / "out"), "--fmus", str(folder / "fmus")])
    assert not exit_.value.code
    return json.loads((folder / "out" / "experiment.json").read_text())


@pytest.fixture
def metric(study):
    """Return a metric of a run."""
    return lambda run, name: study["runs"][run]["metrics"][name]["value"]


def test_the_controlled_car_follows_the_limited_reference_and_comes_to_rest(metric):
    assert metric("both", "rms") <= 0.10
    assert metric("both", "sideslip") <= 3 * DEGREE
    assert metric("both", "moment") <= 6700.0
    assert metric("both", "sideslip_at_end") <= 0.1 * DEGREE
    assert metric("both", "yaw_rate_at_end") <= 0.001


def test_the_uncontrolled_car_is_lost(metric):
    assert metric("off", "sideslip") > 20 * DEGREE


@pytest.mark.parametrize("system", ["yaw_rate_alone", "sideslip_alone"])
def test_each_system_alone_holds_the_car(metric, system):
    assert metric(system, "sideslip") < 8 * DEGREE


def test_the_printed_reference_asks_for_more_sideslip_than_the_road_allows_the_limited_one(metric):
    assert metric("unlimited/fuzzy_feedback", "sideslip") > 5 * metric("both", "sideslip")


def test_every_check_and_every_claim_holds_but_that_the_sideslip_coincides_with_its_reference(study, metric):
    assert {check["verdict"] for check in study["checks"]} == {"holds"}
    for claim in study["claims"]:
        lost = "the sideslip practically coincides" in claim["says"]
        assert claim["verdict"] == ("does not reproduce" if lost else "holds"), claim["says"]
    assert metric("both", "sideslip_rms") > 0.10  # one moment, two references


def test_the_readme_tells_what_the_study_found(metric):
    section = (STUDY.parents[2] / "README.md").read_text(encoding="utf-8").partition("### Paper D")[2]
    told = " ".join(section.partition("## ")[0].split())
    assert f"({metric('off', 'sideslip') / DEGREE:.0f} degrees of sideslip)" in told
    assert f"({100 * metric('both', 'rms'):.1f} % RMS of the peak)" in told
    assert f"({100 * metric('both', 'sideslip_rms'):.0f} % RMS)" in told
    assert f"reaches {metric('both', 'sideslip') / DEGREE:.1f} degrees" in told
    assert f"the {metric('both', 'sideslip_ref') / DEGREE:.1f} of its reference" in told
    assert f"and {metric('unlimited/fuzzy_feedback', 'sideslip') / DEGREE:.1f} with the reference" in told
