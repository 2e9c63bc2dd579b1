"""The study of paper A, with FMUs built for the test."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from fmus.build import build_all
from orchestrator.cli import main
from orchestrator.experiments.experiment import load_experiment
from orchestrator.experiments.findings import judge_results
from orchestrator.experiments.verdicts import run_tables

STUDY = Path(__file__).parents[2] / "scenarios" / "fnn_sideslip" / "study.yaml"
UNITS = (
    "driver_sine", "reference_steady_state", "controller_off", "controller_fuzzy_sideslip", "controller_fnn",
    "allocator_load_proportional", "wheel_control_direct", "plant_seven_dof", "tyre_dugoff",
)  # fmt: skip


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    """What experiment.json says, with the folder of the study."""
    folder = tmp_path_factory.mktemp("paper_a")
    build_all(folder / "fmus", components=UNITS)
    with pytest.raises(SystemExit) as exit_:
        main(["study", str(STUDY), "--quick", "--out", str(folder / "out"), "--fmus", str(folder / "fmus")])
    assert not exit_.value.code
    return json.loads((folder / "out" / "experiment.json").read_text()) | {"folder": folder / "out"}


@pytest.fixture
def metric(study):
    """Return a metric of a run."""
    return lambda run, name: study["runs"][run]["metrics"][name]["value"]


def test_without_control_the_error_is_what_the_paper_says(metric):
    assert metric("15mps/off", "error") > 1.0
    assert metric("25mps/off", "error") > 2.0
    assert metric("40mps/off", "error") > 2.0


@pytest.mark.parametrize("speed", [15, 25, 40])
def test_the_network_stays_within_five_per_cent_without_chatter(metric, speed):
    assert metric(f"{speed}mps/fnn", "error") <= 0.05
    assert metric(f"{speed}mps/fnn", "chatter") <= 15e3


@pytest.mark.parametrize("speed", [15, 25, 40])
def test_conventional_fuzzy_control_lies_between_the_two(metric, speed):
    errors = [metric(f"{speed}mps/{name}", "error") for name in ("fnn", "fuzzy_sideslip", "off")]
    assert errors == sorted(errors)


def test_learning_halves_the_error_at_15_mps(metric):
    learning, frozen = (metric(f"three_periods/15mps/learning_{x}", "period_1") for x in ("true", "false"))
    assert learning <= 0.5 * frozen


@pytest.mark.parametrize("speed", [15, 25])
def test_learning_goes_on_from_period_to_period(metric, speed):
    run = f"three_periods/{speed}mps/learning_true"
    assert metric(run, "period_3") < metric(run, "period_1")


def test_the_verdicts_are_those_the_readme_tells(study):
    failing = {claim["says"] for claim in study["claims"] if claim["verdict"] != "holds"}
    assert failing == {
        "With conventional fuzzy control it is above 10 % at 15 m/s.",
        "With conventional fuzzy control it is above 40 % at 25 m/s.",
        "With conventional fuzzy control it is above 40 % at 40 m/s.",
        "The fuzzy neural network chatters less than conventional fuzzy control at 25 and 40 m/s.",
    }
    assert [check["says"] for check in study["checks"] if check["verdict"] != "holds"] == [
        "Under harsh steering at 40 m/s learning does no harm."
    ]


def rows(text):
    """Return the cells of the Markdown rows about one of the three speeds and a controller."""
    lines = [line for line in text.splitlines() if line.startswith(("| 15 m/s", "| 25 m/s", "| 40 m/s"))]
    cells = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]
    return [row for row in cells if row[0].endswith(("control", "fuzzy", "network"))]


def test_the_readme_tells_what_the_study_found(study, metric):
    readme = (STUDY.parents[2] / "README.md").read_text(encoding="utf-8")
    experiment = load_experiment(STUDY)
    first, *_ = run_tables(judge_results(experiment, study["folder"]))
    told = rows(readme)
    assert len(told) == 9
    found = [[cell.removesuffix(" †") for cell in row] for row in first.text()]
    assert told == [[row[0], row[1], row[2].partition(" (")[0], row[3], row[-1]] for row in found]
    prose = " ".join(readme.partition("What comes out")[2].partition("###")[0].split())
    learning, frozen = (
        [f"{100 * metric(f'three_periods/15mps/{run}', f'period_{k}'):.1f}" for k in (1, 3)]
        for run in ("learning_true", "learning_false")
    )
    assert f"the error falls from {' to '.join(learning)} % over three periods" in prose
    assert f"with frozen weights from {' to '.join(frozen)} %" in prose
    harm, calm, recalled = (
        f"{100 * metric(f'harsh/{run}', 'error'):.0f} %"
        for run in ("learning_true", "learning_false", "recall")
    )
    assert f"its error reaches {harm}, where frozen weights stay at {calm}" in prose
    assert f"holds it at {recalled}" in prose


def test_all_figures_are_drawn(study):
    assert set(study["figures"]) == {
        "15mps", "25mps", "40mps", "25mps_wheel_torques", "learning_15mps", "learning_25mps", "harsh",
    }  # fmt: skip
    for name in study["figures"]:
        for kind in ("svg", "png"):
            assert (study["folder"] / "figures" / f"{name}.{kind}").stat().st_size > 10_000
