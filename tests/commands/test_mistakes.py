"""Mistakes of newcomers, and the sentences that answer them."""

from __future__ import annotations

import pytest

from tests.checkout import ROOT
from tests.command_line import status_of
from tests.refusals import mentions

NAME = "fuzzy_feedback/single_sine"
FILE = str(ROOT / f"scenarios/{NAME}.yaml")
RUN = ("run", NAME, "--set", "stop_time=0.01")


@pytest.fixture
def said(tmp_path, monkeypatch, capsys):
    """Exit status of a command, and what it says on stderr."""
    (tmp_path / "tabs.yaml").write_text("title: x\nunits:\n\tdriver: {fmu: driver_sine}\n")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "200")

    def say(*arguments):
        return status_of(*arguments), capsys.readouterr().err

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
        (("study", FILE), ["scenario", "study", "`yawbench run`"]),
        (("run", "tabs.yaml"), ["tabs.yaml:3", "spaces", "tabs"]),
        ((*RUN, "--metric", "peak_sideslp"), ["'peak_sideslp'"]),
        ((*RUN, "--swap", "controller=tyre_dugoff"), ["tyre_dugoff", "'tyre'"]),
        ((*RUN, "--swap", r"controller=C:\units\x.fmu"), [r'C:\units\x.fmu', "/"]),
        ((*RUN, "--call-limit", "5"), ["--call-limit", "--isolate"]),
        ((*RUN, "--set", "mass=1200"), ["--set mass=1200", "vehicle.mass=1200"]),
        ((*RUN, "--set", "frction=0.3"), ["--set frction=0.3", "friction"]),
        (("list", "foo"), ["'WHAT'", "'foo'", "'runs'", "'scenarios'", "'fmus'", "'signals'", "'metrics'"]),
        (("build", "controler_off"), ["'controler_off'", "'controller_off'"]),
        (("build", "nowhere.py"), ["nowhere.py"]),
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
    for page in ((), ("--page",)):
        in_one_sentence(said, ("plot", "done", "--panel", "sidslip", *page), ["'sideslip'"])
