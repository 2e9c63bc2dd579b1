"""The study of paper A, with the FMUs of the project."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from orchestrator.cli import main
from orchestrator.experiments.experiment import load_experiment
from orchestrator.experiments.findings import judge_results
from orchestrator.experiments.verdicts import run_tables
from orchestrator.figures.display import shown
from tests.fmu_copies import put_fmus

STUDY = Path(__file__).parents[2] / "scenarios" / "fnn_sideslip" / "study.yaml"
UNITS = (
    "driver_sine", "reference_steady_state", "controller_off", "controller_fuzzy_sideslip", "controller_fnn",
    "allocator_load_proportional", "allocator_fixed_share", "wheel_control_direct", "plant_seven_dof",
    "tyre_dugoff",
)  # fmt: skip


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    """What experiment.json says, with the folder of the study."""
    folder = tmp_path_factory.mktemp("paper_a")
    put_fmus(folder / "fmus", components=UNITS)
    with pytest.raises(SystemExit) as exit_:
        main(["study", str(STUDY), "--quick", "--out", str(folder / "out"), "--fmus", str(folder / "fmus")])
    assert not exit_.value.code
    return json.loads((folder / "out" / "experiment.json").read_text()) | {"folder": folder / "out"}


@pytest.fixture
def metric(study):
    """Return a metric of a run."""
    return lambda run, name: study["runs"][run]["metrics"][name]["value"]


def test_with_one_steering_input_for_all_speeds_the_network_is_lost_at_40_mps(metric):
    errors = [metric(f"one_input/{speed}mps/fnn", "error") for speed in (25, 40)]
    assert errors[0] > 0.05
    assert errors[1] > 3.0 > 10 * metric("one_input/40mps/fuzzy_sideslip", "error")


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
        "One steering input for all speeds: with conventional fuzzy control it is above 10, 40 and 40 %.",
        "One steering input for all speeds: with the fuzzy neural network it is within 5 %.",
        "One steering input for all speeds: the network follows more closely than conventional fuzzy.",
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
    assert told == [[row[0], row[1], row[2].partition(" (")[0], row[3], row[4], row[-1]] for row in found]
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
    (net_25, fuzzy_25), (net_40, fuzzy_40) = (
        [shown(metric(f"one_input/{speed}mps/{law}", "error"), "%") for law in ("fnn", "fuzzy_sideslip")]
        for speed in (25, 40)
    )
    assert (
        f"at 25 m/s it has {net_25} (conventional fuzzy {fuzzy_25}), at 40 m/s {net_40} ({fuzzy_40})" in prose
    )
    saved = [f"{100 * study['derived'][f'grip_{speed}']['value']:.1f}" for speed in (15, 25, 40)]
    assert f"as the paper says: by {saved[0]}, {saved[1]} and {saved[2]} %" in prose
    over = [100 * metric(f"{speed}mps/fuzzy_sideslip", "overshoot") for speed in (15, 40)]
    assert f"grows with speed, from {over[0]:.0f} to {over[1]:.1f} %" in prose


@pytest.mark.exhaustive
def test_the_readme_tells_what_became_of_the_laws_with_motors_that_lag_and_tuned_alike(tmp_path):
    put_fmus(tmp_path / "fmus", components=(*UNITS, "controller_pid", "actuator_lag"))
    out = tmp_path / "out"
    with pytest.raises(SystemExit) as exit_:
        main(
            ["study", str(STUDY.with_name("laws.yaml")), "--out", str(out), "--fmus", str(tmp_path / "fmus")]
        )
    assert not exit_.value.code
    found = json.loads((out / "experiment.json").read_text())
    assert [check["holds"] for check in found["checks"]] == [False, True, True]

    def error(run):
        return found["runs"][run]["metrics"]["error"]["value"]

    readme = (STUDY.parents[2] / "README.md").read_text(encoding="utf-8")
    prose = " ".join(readme.partition("What comes out")[2].partition("###")[0].split())
    lost = [shown(error(f"lag/{speed}mps/learning_true"), "%") for speed in (25, 40)]
    assert f"its error is {lost[0]} at 25 m/s and {lost[1]} at 40" in prose
    laws = ("learning_false", "fuzzy_sideslip")
    held = [100 * error(f"lag/{speed}mps/{law}") for speed in (15, 25, 40) for law in laws]
    assert f"have {min(held):.1f} to {max(held):.1f} %" in prose
    assert f"has {shown(error('slow/40mps/fuzzy_sideslip'), '%')} at 40 m/s" in prose
    laws = ("fnn", "frozen", "fuzzy_sideslip", "pd")
    cost = {law: found["derived"][f"cost_{law}"]["value"] for law in laws}
    assert sorted(cost, key=cost.get) == [*laws]
    told = [shown(cost[law], "%").removesuffix(" %") for law in laws]
    assert f"the network comes to {told[0]} %, frozen weights to {told[1]}" in prose
    assert f"conventional fuzzy control to {told[2]}, a PD law to {told[3]}." in prose
    lag = {law: found["derived"][f"lag_cost_{law}"]["value"] for law in laws}
    order = ("fuzzy_sideslip", "frozen", "pd", "fnn")
    assert sorted(lag, key=lag.get) == [*order]
    told = [shown(lag[law], "%").removesuffix(" %") for law in order]
    assert f"conventional fuzzy control {told[0]} %, frozen weights {told[1]}, PD {told[2]}, the" in prose
    assert f"the network {told[3]}." in prose
    for law, name in zip(
        laws, ("fuzzy neural network", "frozen weights", "conventional fuzzy", "PD"), strict=True
    ):
        for file, runs in (("tuning", "tuned"), ("tuning_with_actuators", "tuned_for_lag")):
            sought = load_experiment(STUDY.with_name(f"{file}.yaml")).spec.tuning.laws[name]
            given = {one["place"]: one["value"] for one in found["runs"][f"{runs}/15mps/{law}"]["changes"]}
            for axis in sought.axes.values():
                assert axis.start <= given[axis.vary[0]] <= axis.end


def test_all_figures_are_drawn(study):
    assert set(study["figures"]) == {
        "15mps", "25mps", "40mps", "one_input_40mps", "25mps_wheel_torques", "learning_15mps",
        "learning_25mps", "harsh",
    }  # fmt: skip
    for name in study["figures"]:
        for kind in ("svg", "png"):
            assert (study["folder"] / "figures" / f"{name}.{kind}").stat().st_size > 10_000
