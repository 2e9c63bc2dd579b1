"""Mistakes of newcomers, and the sentences that answer them."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from tests.refusals import mentions
from yawbench.cli import main

ROOT = Path(__file__).parents[2]
NAME = "fuzzy_feedback/single_sine"
FILE = f"scenarios/{NAME}.yaml"
RUN = ("run", NAME, "--set", "stop_time=0.01")


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


def in_one_sentence(said, arguments, names):
    status, told = said(*arguments)
    assert status == 2
    assert "Traceback" not in told
    assert "error in yawbench itself" not in told
    assert mentions(told, *names)


@pytest.mark.parametrize(
    ("arguments", "names"),
    [
        (("run", "25mps.yaml"), ["'25mps.yaml'", "fnn_sideslip/25mps"]),
        (("run", "25mps"), ["'25mps'", "fnn_sideslip/25mps"]),
        (("run", "fuzy_pid/sine"), ["'fuzzy_pid/sine'"]),
        (("run", FILE.replace("single", "singel")), ["single_sine.yaml"]),
        (("run", "scenarios/fuzzy_feedback/study.yaml"), ["study", "`yawbench study`"]),
        (("study", FILE), ["scenario", "study", "`yawbench run`"]),
        (("run", "scenarios/vehicles/esp_saloon.yaml"), ["'vehicle'"]),
        (("run", "empty.yaml"), ["empty.yaml"]),
        (("run", "tabs.yaml"), ["tabs.yaml:3", "spaces", "tabs"]),
        ((*RUN, "--set", "plant.initial_sped=3"), ["'initial_sped'", "'initial_speed'"]),
        ((*RUN, "--set", "plant.initial_speed=3kmh"), ["'kmh'", "'km/h'"]),
        ((*RUN, "--set", "plant.initial_speed=3 kg"), ["'3 kg'", "m/s", "km/h"]),
        ((*RUN, "--set", "plant.initial_speed"), ["--set INSTANCE.PARAMETER=VALUE"]),
        ((*RUN, "--set", "friction=-0.3"), ["--set friction=-0.3", "at least 0"]),
        ((*RUN, "--set", "step_size=1 s"), ["multiple", "1 s"]),
        ((*RUN, "--set", "controller.step_size=0.0015"), ["0.001 s", "0.002 s"]),
        ((*RUN, "--metric", "peak_sideslp"), ["'peak_sideslp'"]),
        ((*RUN, "--metric", "peek(sideslip)"), ["'peek'", "'peak'"]),
        ((*RUN, "--swap", "controler=controller_off"), ["'controler'", "'controller'"]),
        ((*RUN, "--swap", "controller=controller_of"), ["'controller_off'"]),
        ((*RUN, "--swap", "controller=tyre_dugoff"), ["tyre_dugoff", "'tyre'"]),
        ((*RUN, "--swap", "controller"), ["--swap INSTANCE=FMU"]),
        ((*RUN, "--swap", r"controller=C:\units\x.fmu"), [r'C:\units\x.fmu', "/"]),
        ((*RUN, "--out", "a_file"), ["a_file", "--out"]),
        ((*RUN, "--format", "excel"), ["--format excel", "csv", "parquet"]),
        ((*RUN, "--fmus", "nowhere"), ["--fmus nowhere"]),
        ((*RUN, "--call-limit", "5"), ["--call-limit", "--isolate"]),
        (("plot", "nowhere"), ["nowhere", "yawbench run SCENARIO"]),
        (("list", "runs"), ["results", "folder"]),
        (("build", "controler_off"), ["'controler_off'", "'controller_off'"]),
        (("build", "nowhere.py"), ["nowhere.py"]),
        (("new", "controller", "my controller"), ["controller", "'my_controller'"]),
        (("second-opinion", NAME, "--master", "lib"), ["libcosim", "ecos", "fmpy"]),
        (("runn", NAME), ["Did you mean 'run'?"]),
    ],
    ids=lambda given: " ".join(given) if isinstance(given, tuple) else "",
)  # fmt: skip
def test_a_mistake_on_the_command_line_is_answered_by_what_to_do(said, arguments, names):
    in_one_sentence(said, arguments, names)


def test_the_results_of_a_run_in_place_of_its_scenario_are_told_from_a_folder_of_scenarios(said):
    assert said(*RUN, "--out", "done")[0] in (None, 0)
    in_one_sentence(said, ("check", "done"), ["done", "results", "'yawbench plot done'"])
    in_one_sentence(said, ("plot", "done", "--panel", "sidslip"), ["'sideslip'"])
