"""The same systems in libcosim, Ecos and fmpy, which others wrote."""

from __future__ import annotations

import multiprocessing
import re
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.cars import make_plan
from tests.changed import changed
from tests.command_line import status_of
from tests.evidence import measured
from tests.interop import fmpy_exchanging
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
from yawbench.orchestrator.master.simulate import simulate_in_memory
from yawbench.orchestrator.scenario.loader import load_scenario

SCENARIOS = Path(__file__).parents[2] / "scenarios"
PAPERS = {  # until the car moves as hard as in the whole run; the one with the fewest units first
    "fuzzy_feedback/single_sine.yaml": 1.5,
    "fnn_sideslip/25mps.yaml": 2.5,
    "fuzzy_sliding_mode/high_friction.yaml": 1.5,
    "fuzzy_pid/sine.yaml": 2.5,
}

OF = {"steer_angle": "driver", "yaw_rate": "plant", "sideslip": "plant", "yaw_moment": "controller"}


def plan_of(fmus, scenario="fuzzy_feedback/single_sine.yaml", stop_time=0.1, settings=()):
    changes = changed(settings=settings, stop_time=stop_time)
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


@pytest.mark.exhaustive
def test_fmpy_runs_the_archive_from_another_start(fmus, tmp_path):
    (one,) = second_opinion(plan_of(fmus), tmp_path, masters=MASTERS[2:], pinned=False)
    assert not one.problem
    assert one.differences["driver.steer_angle"] <= AGREEMENT  # follows no input
    assert not one.agrees


@pytest.mark.parametrize("scenario", PAPERS)
@pytest.mark.sampled(1)
def test_fmpy_differs_by_its_start_and_by_texts_and_by_nothing_else(scenario, fmus, tmp_path):
    without_texts = ["reference.mode=steady_state"] if "fuzzy_feedback" in scenario else []
    plan = plan_of(fmus, scenario, 0.6, without_texts)
    request = module._request(plan, True, tmp_path)
    own, as_it_is = module.run_own(request), module._run("fmpy_ssp", request, tmp_path)
    with ProcessPoolExecutor(1, multiprocessing.get_context("fork")) as pool:  # it changes fmpy for good
        exchanging = pool.submit(fmpy_exchanging.drive, request).result()
    assert isinstance(as_it_is, Recording)
    assert max(differences(request, own.values, as_it_is.values).values()) > 1e-6
    assert max(differences(request, own.values, exchanging.values).values()) <= AGREEMENT


def test_differences_are_relative_to_the_range_and_infinite_where_a_value_is_missing():
    request = Request("x.ssp", 0.1, 2, [("a", "x"), ("a", "lost")])
    own = np.array([[0.0, 0.0], [1.0, 1.0], [4.0, 2.0]])
    other = own + np.array([[0.0, 0.0], [0.0, np.nan], [0.4, 0.0]])
    other[0] = np.nan  # this master has no value before its first step
    assert differences(request, own, other) == {"a.x": pytest.approx(0.1), "a.lost": np.inf}


def test_a_master_that_gives_up_its_values_half_way_does_not_agree():
    request = Request("x.ssp", 0.1, 2, [("a", "x")])
    own = np.array([[0.0], [1.0], [2.0]])
    assert differences(request, own, np.array([[np.nan], [1.0], [2.0]])) == {"a.x": 0.0}
    assert differences(request, own, np.array([[0.0], [1.0], [np.nan]])) == {"a.x": np.inf}
    assert differences(request, own, np.full((3, 1), np.nan)) == {"a.x": np.inf}


def test_names_with_brackets_are_printed_whole(capsys):
    show([SecondOpinion(MASTERS[0], False, "", {"a.force[front]": 0.0}, {"theirs": 1e-6, "ours": 1e-6})])
    assert "a.force[front]" in capsys.readouterr().out


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


def test_signals_that_do_not_change_are_told(capsys):
    request = Request("x.ssp", 0.1, 1, [("a", "moves"), ("a", "rounded"), ("b", "zero_fl"), ("b", "zero_fr")])
    own = np.array([[0.0, 5.0, 0.0, 0.0], [1.0, np.nextafter(5.0, 6.0), 0.0, 0.0]])
    still = still_signals(request, own)
    assert still == ("a.rounded", "b.zero_fl", "b.zero_fr")
    gaps = differences(request, own, own)
    show([SecondOpinion(MASTERS[0], False, "", gaps, {"theirs": 1e-6, "ours": 1e-6}, still)])
    said = capsys.readouterr().out
    assert mentions(said, "3", "4 signals", "a.rounded")
    show([SecondOpinion(MASTERS[0], False, "", gaps, {"theirs": 1e-6, "ours": 1e-6}, tuple(gaps))])
    assert mentions(capsys.readouterr().out.splitlines()[-1], "changes", "agreement", "evidence")
    show([SecondOpinion(MASTERS[0], False, "", gaps, {"theirs": 1e-6, "ours": 1e-6})])
    assert "Constant" not in capsys.readouterr().out


def test_the_example_of_the_documentation_compares_signals_that_move(fmus, tmp_path):
    text = (SCENARIOS.parent / "docs/other_tools.md").read_text()
    (command,) = re.findall(r"second-opinion scenarios/(\S+) --set stop_time=(\S+)", text)
    plan = plan_of(fmus, command[0], float(command[1]))
    results = simulate_in_memory(plan)
    for name in ("steer_angle", "yaw_rate", "sideslip", "yaw_moment"):
        assert np.ptp(results.columns[results.column(f"{OF[name]}.{name}")]) > 1e-3, name


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


def test_the_command_prints_every_signal_and_the_times(fmus, capsys, monkeypatch):
    def run(name: str, request: Request, folder: Path) -> Recording:
        rows = np.linspace(0.0, 1.0, request.n_steps + 1)
        return Recording(np.tile(rows, (len(request.columns), 1)).T, 1e-6)

    monkeypatch.setattr(module, "_run", run)
    arguments = [str(SCENARIOS / "fuzzy_feedback/single_sine.yaml"), "--fmus", str(fmus)]
    options = ["--set", "stop_time=0.1", "--master", "libcosim", "--no-one-core"]
    assert status_of("second-opinion", *arguments, *options) == 0
    said = capsys.readouterr().out
    assert "plant.yaw_rate" in said
    assert mentions(said, "per", "communication", "step")


@pytest.mark.parametrize("master", ["fmpy", "libcosim"])
def test_a_second_opinion_without_a_comparison_is_no_agreement(master, fmus, capsys, monkeypatch):
    monkeypatch.setattr(module, "installed", lambda master: False)
    scenario = SCENARIOS / "fuzzy_feedback/single_sine.yaml"
    options = ["--set", "stop_time=0.1", "--master", master, "--no-one-core"]
    assert status_of("second-opinion", scenario, "--fmus", fmus, *options) == 1
    assert "nothing was compared" in capsys.readouterr().err


def test_an_unknown_master_is_refused(capsys):
    assert status_of("second-opinion", "any.yaml", "--master", "libcosmi") == 2
    assert mentions(capsys.readouterr().err.strip(), "--master libcosmi", "'libcosim'")
