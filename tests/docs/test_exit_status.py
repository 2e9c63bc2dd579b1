"""One table tells the exit statuses; real commands end with them, and no other page contradicts it."""

from __future__ import annotations

import re
from xml.etree import ElementTree

import pytest

import yawbench as yb
from tests.checkout import ROOT
from tests.command_line import status_of
from tests.commands.recordings import record_spike, record_step
from tests.commands.test_batch_commands import SCENARIO, STUDY
from tests.measured_cars.test_validation import line
from tests.refusals import mentions
from yawbench.commands.strict_and_junit import JudgedCase, to_junit
from yawbench.metrics.verdict import Status

UNITS = ("driver_sine", "reference_steady_state", "controller_off", "controller_fuzzy_sideslip")
PAGE = ROOT / "docs/running.md"


def statuses() -> dict[int, str]:
    """Return status -> its meaning, as the page tells."""
    section = PAGE.read_text("utf-8").partition("## Exit status\n")[2].partition("\n## ")[0]
    rows = re.findall(r"^\| ([\d, ]+) \| (.*) \|$", section, re.MULTILINE)
    return {int(number): meaning for numbers, meaning in rows for number in numbers.split(", ")}


@pytest.fixture
def folder(tmp_path, monkeypatch, fmus):
    """A folder with scenarios, a study, recordings, and their results."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "half.yaml").write_text(SCENARIO)
    (tmp_path / "study.yaml").write_text(STUDY)  # one of its claims does not reproduce
    yb.measured(line(tmp_path, "turn"), segment=1).save(tmp_path / "turn")
    line(tmp_path, "near", up=0.05)
    line(tmp_path, "far", up=0.2)
    record_spike(tmp_path)
    record_step(tmp_path)
    record_step(tmp_path, "still", turned=0.0)
    return tmp_path


@pytest.mark.sampled(8)
@pytest.mark.parametrize(
    ("before", "command", "status", "words"),
    [
        ([], "study study.yaml", 0, "a claim that does not reproduce"),
        (["run half.yaml --out a", "run half.yaml --set step_size=0.02 --out b"], "diff a b", 0, "differ"),
        ([], "validate turn --measured far.yaml --out v", 1, "a signal lies outside its band"),
        ([], "measured show spike.yaml", 1, "a flaw"),
        ([], "evaluate step-steer still.yaml --no-figures", 1, "could judge nothing"),
        ([], "study study.yaml --no-run", 1, "is not made"),
        ([], "study study.yaml --strict", 1, "`--strict`"),
        ([], "evaluate step-steer step.yaml --no-figures --strict", 0, "success"),
        ([], "run half.yaml --set driver.amplitud=1", 2, "a name"),
        ([], "run half.yaml --sett a=1", 2, "an option"),
        ([], "run nowhere.yaml", 2, "a file"),
        ([], "run half.yaml --swap controller=controller_nowhere", 2, "FMUs"),
        ([], "plot nowhere", 2, "results"),
        ([], "list metrics", 0, "success"),
    ],
)  # fmt: skip
def test_commands_end_with_the_status_that_the_page_tells(
    before, command, status, words, folder, fmus, capsys
):
    def ended(text: str) -> int:
        takes = text.split()[0] in ("run", "study")
        return status_of(*text.split(), *(["--fmus", fmus] if takes else []))

    assert [ended(text) for text in before] == [0] * len(before), capsys.readouterr().err
    assert ended(command) == status, capsys.readouterr().err
    assert words in statuses()[status]


def test_a_junit_report_has_every_verdict(folder, fmus, tmp_path):
    status = status_of("study", "study.yaml", "--fmus", fmus, "--junit", "verdicts.xml")
    assert status == 0
    root = ElementTree.parse("verdicts.xml").getroot()
    cases = {case.get("name"): [child.tag for child in case] for case in root.iter("testcase")}
    assert cases == {"Without control there is no moment.": [], "Control is gentle.": ["failure"]}
    assert (root.get("tests"), root.get("failures")) == ("2", "1")
    assert mentions(root.find(".//failure").get("message"), "does not reproduce", "N·m")
    for measured, fails in (("far.yaml", 1), ("near.yaml", 0)):
        options = ("--measured", measured, "--junit", "v.xml", "--strict", "--out", "v")
        assert status_of("validate", "turn", *options) == fails
        assert ElementTree.parse("v.xml").getroot().get("failures") == str(fails)


def test_checks_of_a_study_count_as_its_claims_do(folder, fmus, tmp_path):
    (tmp_path / "checks.yaml").write_text(STUDY.replace("claims:", "checks:"))
    study = ("study", "checks.yaml", "--fmus", fmus, "--junit", "checks.xml")
    assert (status_of(*study), status_of(*study, "--strict")) == (0, 1)
    root = ElementTree.parse("checks.xml").getroot()
    assert (root.get("tests"), root.get("failures")) == ("2", "1")
    assert mentions(root.find(".//failure").get("message"), "does not hold", "N·m")


def test_a_run_that_fails_is_an_error_of_the_report_and_what_was_not_judged_is_skipped():
    cases = [
        JudgedCase("A", "run", None, "not completed", "division by zero"),
        JudgedCase("A", "claim <1>", Status.UNDECIDED, "undecided", "chance"),
        JudgedCase("B", "claim", Status.PASSED, "holds"),
    ]
    root = ElementTree.fromstring(to_junit(cases).encode())
    assert [suite.get("name") for suite in root] == ["A", "B"]
    assert {name: root.get(name) for name in ("tests", "failures", "errors", "skipped")} == {
        "tests": "3", "failures": "0", "errors": "1", "skipped": "1",
    }  # fmt: skip
    assert root.find(".//error").get("message") == "not completed: division by zero"


def test_the_page_has_no_statuses_but_those_of_commands_and_signals():
    assert set(statuses()) == {0, 1, 2, 130, 143}
