"""The same systems in libcosim, Ecos and fmpy, which others wrote."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.cars import load_scenario, make_plan
from tests.changed import changed
from tests.evidence import measured
from tests.refusals import mentions, refused
from yawbench.foundation.errors import WiringError
from yawbench.interop import second_opinion as module
from yawbench.interop.command import show
from yawbench.interop.second_opinion import (
    AGREEMENT,
    MASTERS,
    OtherMaster,
    Recording,
    Request,
    SecondOpinion,
    differences,
    second_opinion,
    still_signals,
)
from yawbench.vocabulary.wheels import WHEELS

SCENARIOS = Path(__file__).parents[2] / "scenarios"
PAPERS = {  # until the car moves as hard as in the whole run; the one with the fewest units first
    "fuzzy_feedback/single_sine.yaml": 1.5,
    "fnn_sideslip/25mps.yaml": 2.5,
    "fuzzy_sliding_mode/high_friction.yaml": 1.5,
    "fuzzy_pid/sine.yaml": 2.5,
}

COMMAND = (
    "second-opinion",
    SCENARIOS / "fuzzy_feedback/single_sine.yaml",
    "--set",
    "stop_time=0.1",
    "--no-one-core",
)


def plan_of(fmus, scenario="fuzzy_feedback/single_sine.yaml", stop_time=0.1):
    changes = changed(stop_time=stop_time)
    return make_plan(load_scenario(SCENARIOS / scenario, changes=changes), fmus=fmus)


@pytest.mark.parametrize("scenario", PAPERS)
@pytest.mark.sampled(1)
def test_libcosim_and_ecos_agree_with_jacobi_to_a_billionth_of_every_signals_range(scenario, fmus, tmp_path):
    plan = plan_of(fmus, scenario, PAPERS[scenario])
    opinions = second_opinion(plan, tmp_path, masters=MASTERS[:2], pinned=False)
    assert [one.problem for one in opinions] == ["", ""]
    for one in opinions:
        assert len(one.differences) == len(plan.record)
        measured("masters", scenario, one.master.title, one.largest, at_most=AGREEMENT)


@pytest.mark.exhaustive
def test_a_unit_half_asleep_in_ecos_would_be_noticed(fmus, tmp_path, monkeypatch):
    as_is = OtherMaster("Ecos", "ecos", "ecospy", one_step=False)
    (one,) = second_opinion(plan_of(fmus, stop_time=1.0), tmp_path, masters=[as_is], pinned=False)
    assert not one.problem
    assert one.largest > 1e-3


AT_REST = f"""stop_time: 1.5
step_size: 0.001
speed: 20
friction: 0.7
vehicle: {SCENARIOS}/vehicles/mid_size.yaml
units:
  driver: {{fmu: driver_sine, parameters: {{amplitude: 0.02}}}}
  plant: {{fmu: plant_two_dof}}
  tyre: {{fmu: tyre_linear}}
inputs: {{plant.yaw_moment: 200}}
"""


def test_fmpy_agrees_but_for_what_follows_at_once_from_more_than_zeros(fmus, tmp_path):
    """Before its first step it exchanges nothing: tyres that roll straight ahead miss their loads alone."""
    (tmp_path / "s.yaml").write_text(AT_REST)
    plan = make_plan(load_scenario(tmp_path / "s.yaml"), fmus=fmus)
    (one,) = second_opinion(plan, tmp_path, masters=MASTERS[2:], pinned=False)
    assert not one.problem and "plant.yaw_rate" not in one.still
    apart = {name for name, gap in one.differences.items() if gap > AGREEMENT}
    assert apart == {f"tyre.slip_stiffness_{wheel}" for wheel in WHEELS}
    assert not one.agrees


def test_differences_are_relative_to_the_range_and_infinite_where_a_value_is_missing():
    request = Request("x.ssp", 0.1, 2, [("a", "x"), ("a", "lost"), ("a", "last")])
    own = np.array([[0.0, 0.0, 0.0], [1.0, 1.0, 1.0], [4.0, 2.0, 2.0]])
    other = own + np.array([[0.0, 0.0, 0.0], [0.0, np.nan, 0.0], [0.4, 0.0, np.nan]])
    other[0] = np.nan  # this master has no value before its first step
    assert differences(request, own, other) == {"a.x": pytest.approx(0.1), "a.lost": np.inf, "a.last": np.inf}
    assert set(differences(request, own, np.full((3, 3), np.nan)).values()) == {np.inf}


def test_a_system_without_recorded_reals_has_nothing_to_compare(fmus, tmp_path):
    plan = replace(plan_of(fmus), record=())
    with refused(WiringError, "nothing-to-compare", names=("25 m/s", "0.5", "Real")):
        second_opinion(plan, tmp_path)


def test_differences_of_a_signal_constant_but_for_rounding_are_relative_to_its_magnitude():
    request = Request("x.ssp", 0.1, 1, [("a", "still"), ("a", "rounded"), ("a", "zero")])
    own = np.array([[5.0, 5.0, 0.0], [5.0, np.nextafter(5.0, 6.0), 0.0]])
    other = np.array([[5.0, 5.0, 0.0], [5.5, 5.0, 0.25]])
    found = differences(request, own, other)
    assert found == {"a.still": pytest.approx(0.1), "a.rounded": pytest.approx(1.8e-16, 0.1), "a.zero": 0.25}


def test_signals_that_do_not_change_are_told_and_names_are_printed_whole(capsys):
    request = Request("x.ssp", 0.1, 1, [("a", "x[1]"), ("a", "rounded"), ("b", "zero_fl"), ("b", "zero_fr")])
    own = np.array([[0.0, 5.0, 0.0, 0.0], [1.0, np.nextafter(5.0, 6.0), 0.0, 0.0]])
    still = still_signals(request, own)
    assert still == ("a.rounded", "b.zero_fl", "b.zero_fr")
    gaps = differences(request, own, own)

    def said(*constant):
        show([SecondOpinion(MASTERS[0], False, "", gaps, {"theirs": 1e-6, "ours": 1e-6}, constant)])
        return capsys.readouterr().out

    assert mentions(said(*still), "3", "4 signals", "a.rounded")
    assert mentions(said(*gaps).splitlines()[-1], "changes", "agreement", "evidence")
    assert "Constant" not in said() and "a.x[1]" in said()


def test_a_master_that_is_not_installed_costs_a_sentence(fmus, tmp_path):
    missing = OtherMaster("Nobody", "nobody", "nobody_at_all", one_step=False)
    (one,) = second_opinion(plan_of(fmus), tmp_path, masters=[missing])
    assert mentions(one.problem, "nobody_at_all", "'yawbench[interop]'")


def test_a_master_that_fails_costs_a_sentence(fmus, tmp_path, monkeypatch):
    broken = OtherMaster("Broken", "no_such_module", "json", one_step=False)
    run, request = module._run, module._request(plan_of(fmus), False, tmp_path)
    still = Recording(np.zeros((request.n_steps + 1, len(request.columns))), 0.0)
    monkeypatch.setattr(module, "_run", lambda name, *given: still if name == "own" else run(name, *given))
    (one,) = second_opinion(plan_of(fmus), tmp_path, masters=[broken], pinned=False)
    assert one.problem.startswith("KeyError: ")


@pytest.mark.exhaustive
def test_a_master_that_never_ends_costs_a_sentence(fmus, tmp_path, monkeypatch):
    plan = plan_of(fmus)
    request = module._request(plan, False, tmp_path)
    monkeypatch.setattr(module, "LIMIT", 0.01)
    assert mentions(module._run("own", request, tmp_path), "0.01 s", "end")


def test_the_command_prints_every_signal_and_the_times(fmus, yawbench, monkeypatch):
    def run(name: str, request: Request, folder: Path) -> Recording:
        rows = np.linspace(0.0, 1.0, request.n_steps + 1)
        return Recording(np.tile(rows, (len(request.columns), 1)).T, 1e-6)

    monkeypatch.setattr(module, "_run", run)
    status, said, _ = yawbench(*COMMAND, "--fmus", fmus, "--master", "libcosim")
    assert status == 0 and "plant.yaw_rate" in said
    assert mentions(said, "per", "communication", "step")


@pytest.mark.parametrize("master", ["fmpy", "libcosim"])
def test_a_second_opinion_without_a_comparison_is_no_agreement(master, fmus, yawbench, monkeypatch):
    monkeypatch.setattr(module, "installed", lambda master: False)
    status, _, said = yawbench(*COMMAND, "--fmus", fmus, "--master", master)
    assert status == 1 and "nothing was compared" in said


def test_an_unknown_master_is_refused(yawbench):
    status, _, said = yawbench(*COMMAND, "--master", "libcosmi")
    assert status == 2 and mentions(said, "--master libcosmi", "'libcosim'")
