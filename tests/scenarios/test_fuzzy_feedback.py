"""The study of paper D on the real master."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import pytest

from orchestrator.cli import main
from orchestrator.experiments.verdicts import share
from tests.fmu_copies import put_fmus

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
    put_fmus(folder / "fmus", components=UNITS)
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


def test_sideslip_and_robustness_do_not_reproduce_and_all_else_holds(study, metric):
    assert {check["verdict"] for check in study["checks"]} == {"holds"}
    assert [claim["says"] for claim in study["claims"] if claim["verdict"] != "holds"] == [
        "With control the sideslip practically coincides with its reference.",
        "Fuzzy control is robust, insensitive to disturbances and changed parameters.",
    ]
    assert metric("both", "sideslip_rms") > 0.10  # one moment, two references


def test_the_readme_tells_what_the_study_found(study, metric):
    section = (STUDY.parents[2] / "README.md").read_text(encoding="utf-8").partition("### Paper D")[2]
    told = " ".join(section.partition("## ")[0].split())
    assert f"({metric('off', 'sideslip') / DEGREE:.0f} degrees of sideslip)" in told
    assert f"({100 * metric('both', 'rms'):.1f} % RMS of the peak)" in told
    assert f"({100 * metric('both', 'sideslip_rms'):.0f} % RMS)" in told
    assert f"reaches {metric('both', 'sideslip') / DEGREE:.1f} degrees" in told
    assert f"the {metric('both', 'sideslip_ref') / DEGREE:.1f} of its reference" in told
    assert f"and {metric('unlimited/fuzzy_feedback', 'sideslip') / DEGREE:.1f} with the reference" in told
    assert f"as far as the road bears it ({100 * metric('both', 'path'):.1f} % RMS)" in told
    unknown = [run for run in study["runs"] if run.startswith("unknown/")]
    rms, path = (max(100 * metric(run, name) for run in unknown) for name in ("rms", "path"))
    assert f"({rms:.1f} % at most), but the path leaves its own (up to {path:.0f} %)" in told


@pytest.mark.exhaustive
def test_the_readme_tells_how_far_the_verdicts_carry(tmp_path):
    put_fmus(tmp_path / "fmus", components=(*UNITS, "tyre_magic_formula"))
    with pytest.raises(SystemExit) as ended:
        main(["study", str(STUDY), "--out", str(tmp_path), "--fmus", str(tmp_path / "fmus")])
    assert not ended.value.code
    found = {row["says"]: row for row in csv.DictReader((tmp_path / "verdicts.csv").open(encoding="utf-8"))}
    section = (STUDY.parents[2] / "README.md").read_text(encoding="utf-8").partition("### Paper D")[2]
    table = [line for line in section.partition("## ")[0].splitlines() if line.startswith("| With")]
    assert len(table) >= 4
    for line in table:
        says, verdict, margin, region, flip = (cell.strip() for cell in line.strip("|").split("|"))
        row = found[says]
        assert (verdict, margin) == (row["verdict"], share(float(row["margin [1]"])))
        held = 100 * int(row["holds at"]) / int(row["points"])
        assert region == f"holds in {held:.0f} % of {row['points']} points"
        flips = f"flips at {row['flips by']} {row['flips at']}"
        assert flip == (flips if row["flips by"] else "no flip along any open value")
