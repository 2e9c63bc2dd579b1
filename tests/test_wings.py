"""Each wing can be taken off: without its folder and its line in `yawbench/parts.py` the rest works."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from tests.checkout import copy_checkout, run_in
from tests.commands.test_batch_commands import SCENARIO, STUDY
from tests.refusals import refused
from yawbench.foundation import plugins
from yawbench.foundation.errors import ScenarioError
from yawbench.parts import IMPORTED
from yawbench.parts import WINGS as REGISTERED

WINGS = [*REGISTERED, *IMPORTED]
CORE = (
    "tests/orchestrator/test_scenario.py",
    "tests/orchestrator/test_wiring.py",
    "tests/orchestrator/test_master.py",
    "tests/orchestrator/test_results.py",
    "tests/metrics/test_metrics.py",
    "tests/studies/test_study.py",
    "tests/studies/test_compare.py",
    "tests/reports/test_compare_page.py",
)
"""Files of tests of the core; chosen: one or more of each room."""


def checkout_without(wings: list[str], folder: Path) -> Path:
    """Copy the checkout and take wings off it."""
    checkout = copy_checkout(folder)
    parts = checkout / "yawbench" / "parts.py"
    lines = parts.read_text().splitlines(keepends=True)
    for wing in wings:
        shutil.rmtree(checkout / wing.replace(".", "/"))
        lines = [line for line in lines if f'"{wing}"' not in line]
    parts.write_text("".join(lines))
    return checkout


def works(checkout: Path, study: str) -> None:
    """Build, check, run, compare, and make a quick study with its page."""
    scenario = "fnn_sideslip/25mps"
    short = ("--set", "stop_time=0.5")
    for command in (
        ("build", "driver_sine"),
        ("check", scenario),
        ("run", scenario, *short, "--metric", "peak(sideslip)", "--out", "run"),
        ("compare", scenario, "--swap", "controller=controller_off", *short, "--out", "compare"),
        ("report", "--quick", f"scenarios/{study}.yaml"),
    ):
        done = run_in(checkout, "yawbench", *command)
        assert done.returncode == 0, (command, done.stdout, done.stderr)
    assert (checkout / "run/results.csv").is_file()
    assert (checkout / "results" / study / "report.html").is_file()


def test_without_any_wing_the_core_builds_checks_runs_compares_and_studies(tmp_path):
    checkout = checkout_without(WINGS, tmp_path / "checkout")
    (checkout / "scenarios/half").mkdir()
    for name, text in {"half": SCENARIO, "study": STUDY}.items():
        (checkout / f"scenarios/half/{name}.yaml").write_text(text)
    works(checkout, "half/study")
    names = run_in(checkout, "yawbench", "--help").stdout
    assert "  run " in names and "  rank " not in names
    missing = run_in(checkout, "python", "-c", "import yawbench; yawbench.rank")
    assert "not installed" in missing.stderr


@pytest.mark.exhaustive
@pytest.mark.parametrize("wing", WINGS)
def test_without_one_wing_the_rest_works_and_the_tests_of_the_core_pass(wing, tmp_path):
    checkout = checkout_without([wing], tmp_path / "checkout")
    works(checkout, "fuzzy_pid/study")
    done = run_in(checkout, "python", "-m", "pytest", "-q", "-x", "-p", "no:cacheprovider", *CORE)
    assert done.returncode == 0, done.stdout[-3000:]


def test_what_a_missing_part_makes_is_refused_in_a_sentence():
    with refused(ScenarioError, "part-missing", names=("nothing", "section of a study")):
        plugins.require("section of a study", "nothing")
