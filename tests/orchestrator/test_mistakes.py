"""Mistakes of newcomers, and the sentences that say what to do."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from orchestrator.cli import main

ROOT = Path(__file__).parents[2]
NAME = "fuzzy_feedback/single_sine"
FILE = f"scenarios/{NAME}.yaml"
RUN = ("run", NAME, "--set", "stop_time=0.01")
KNOWN = "did you mean"


@pytest.fixture
def said(tmp_path, monkeypatch, capsys):
    """Output and exit status of a command in a folder with a copy of the scenarios."""
    shutil.copytree(ROOT / "scenarios", tmp_path / "scenarios")
    (tmp_path / "a_file").touch()
    (tmp_path / "empty.yaml").touch()
    (tmp_path / "tabs.yaml").write_text("title: x\nunits:\n\tdriver: {fmu: driver_sine}\n")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "200")

    def say(*arguments):
        with pytest.raises(SystemExit) as ended:
            main(list(arguments))
        return ended.value.code, capsys.readouterr().err

    return say


def in_one_sentence(said, arguments, words):
    status, told = said(*arguments)
    assert status == 2
    assert "Traceback" not in told
    assert "error in yawbench itself" not in told
    sentence = next((line for line in told.splitlines() if all(word in line for word in words)), None)
    assert sentence, told


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("run", "25mps.yaml"), ["there is no scenario '25mps.yaml'", "by name", "fnn_sideslip/25mps"]),
        (("run", "25mps"), ["there is no scenario '25mps'", "by name there are: fnn_sideslip/25mps"]),
        (("run", "fuzy_pid/sine"), [f"{KNOWN} 'fuzzy_pid/sine'?"]),
        (("run", FILE.replace("single", "singel")), ["no such scenario file", KNOWN, "single_sine.yaml"]),
        (("run", "scenarios/fuzzy_feedback/study.yaml"), ["a study file, not a scenario", "yawbench study"]),
        (("study", FILE), ["a scenario, not a tuning file, a study file or a sweep file", "`yawbench run`"]),
        (("run", "scenarios/vehicles/esp_saloon.yaml"), ["a scenario names it under 'vehicle'"]),
        (("run", "empty.yaml"), ["empty.yaml: this scenario file is empty"]),
        (("run", "tabs.yaml"), ["tabs.yaml:3: not valid YAML", "indent with spaces, not tabs"]),
        ((*RUN, "--set", "plant.initial_sped=3"), [f"no parameter 'initial_sped'; {KNOWN} 'initial_speed'?"]),
        ((*RUN, "--set", "plant.initial_speed=3kmh"), [f"'kmh' is not a unit; {KNOWN} 'km/h'?"]),
        ((*RUN, "--set", "plant.initial_speed=3 kg"), ["'3 kg' is not a value in m/s: use m/s or km/h"]),
        ((*RUN, "--set", "plant.initial_speed"), ["write --set INSTANCE.PARAMETER=VALUE"]),
        ((*RUN, "--set", "friction=-0.3"), ["--set friction=-0.3: must be at least 0 (got -0.3)"]),
        ((*RUN, "--set", "step_size=1 s"), ["not an integer multiple of the communication step 1 s", "1 s"]),
        ((*RUN, "--set", "controller.step_size=0.0015"), ["nearest allowed: 0.001 s or 0.002 s"]),
        ((*RUN, "--metric", "peak_sideslp"), ["'peak_sideslp' is not a metric"]),
        ((*RUN, "--metric", "peek(sideslip)"), [f"there is no measure 'peek'; {KNOWN} 'peak'?"]),
        ((*RUN, "--swap", "controler=controller_off"), [f"no instance 'controler'; {KNOWN} 'controller'?"]),
        ((*RUN, "--swap", "controller=controller_of"), [f"{KNOWN} 'controller_off'?"]),
        ((*RUN, "--swap", "controller=tyre_dugoff"), ["by its name tyre_dugoff is for the instance 'tyre'"]),
        ((*RUN, "--swap", "controller"), ["write --swap INSTANCE=FMU"]),
        ((*RUN, "--swap", r"controller=C:\units\x.fmu"), ["no such FMU; write paths with /, not \\"]),
        ((*RUN, "--out", "a_file"), ["a_file: results cannot be written here", "name another with --out"]),
        ((*RUN, "--format", "excel"), ["no such format; there are: csv, parquet and mf4"]),
        ((*RUN, "--fmus", "nowhere"), ["--fmus nowhere: no such folder"]),
        ((*RUN, "--call-limit", "5"), ["--call-limit requires --isolate"]),
        (("plot", "nowhere"), ["nowhere: no results here", "make them with 'yawbench run SCENARIO"]),
        (("list", "runs"), ["results: no such folder"]),
        (("build", "controler_off"), [f"there is no component 'controler_off'; {KNOWN} 'controller_off'?"]),
        (("build", "nowhere.py"), ["nowhere.py: there is no such file; name a component or its Python file"]),
        (("new", "controller", "my controller"), ["cannot name a controller", "for example 'my_controller'"]),
        (("second-opinion", NAME, "--master", "lib"), ["known: libcosim, ecos and fmpy"]),
        (("runn", NAME), ["Did you mean 'run'?"]),
    ],
    ids=lambda given: " ".join(given) if isinstance(given, tuple) else "",
)  # fmt: skip
def test_a_mistake_on_the_command_line_is_answered_by_what_to_do(said, arguments, words):
    in_one_sentence(said, arguments, words)


@pytest.mark.parametrize(
    ("right", "wrong", "words"),
    [
        ("tyre_magic_formula_1987", "~/x.fmu", ["no such FMU; ~ is a folder's name here"]),
        ("speed: 25.0", 'speed: "25 m per s"', ["'m per s' is not a unit: use m/s or km/h"]),
        ("speed: 25.0", 'speed: "25,0"', ["write a decimal point: 25.0"]),
        ("stop_time: 6.0", "stop_time: -6", ["must be a time above 0 s (got -6)"]),
        ("stop_time:", "stoptime:", [f"unknown key; {KNOWN} 'stop_time'?"]),
        ("extrapolated", "euler", ["must be 'jacobi', 'gauss_seidel' or 'extrapolated' (got 'euler')"]),
        ("esp_saloon", "esp_salon", ["no such vehicle file", KNOWN, "esp_saloon.yaml"]),
        ("friction:", "frction:", [f"unknown key; {KNOWN} 'friction'?"]),
        ("units:", "record: [plant.yawrate]\nunits:", [f"no variable 'yawrate' to record; {KNOWN}"]),
        (
            "units:", "connections: [{from: plant.steer_angle, to: driver.steer_angle}]\nunits:",
            ["plant.steer_angle is not an output: its causality is input"],
        ),
        (
            "units:", "connections: [{form: driver.steer_angle, to: plant.steer_angle}]\nunits:",
            [f"unknown key; {KNOWN} 'from'?"],
        ),
        (
            "units:", "connections: [{from: driver.steer_angle, to: plant.yaw_moment}]\nunits:",
            ["cannot connect driver.steer_angle [rad] to plant.yaw_moment [N.m]: the units differ"],
        ),
    ],
)  # fmt: skip
def test_a_mistake_in_a_scenario_is_answered_by_its_line_and_what_to_do(said, right, wrong, words):
    text = Path(FILE).read_text(encoding="utf-8")
    assert right in text
    Path(FILE).write_text(text.replace(right, wrong, 1), encoding="utf-8")
    in_one_sentence(said, ("check", FILE), [f"{FILE}:", *words])


def test_the_results_of_a_run_in_place_of_its_scenario_are_told_from_a_folder_of_scenarios(said):
    assert said(*RUN, "--out", "done")[0] in (None, 0)
    in_one_sentence(said, ("check", "done"), ["done: these are the results of a run", "'yawbench plot done'"])
    in_one_sentence(said, ("plot", "done", "--panel", "sidslip"), [f"{KNOWN} 'sideslip'?"])
