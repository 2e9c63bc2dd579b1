"""`--json` and `--latex`: one object, or tables for LaTeX, on standard output, and nothing else there."""

from __future__ import annotations

import json
import re
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Any

import pytest

from tests.command_line import status_of
from tests.commands.recordings import record_spike, record_step
from tests.commands.test_batch_commands import SCENARIO, STUDY
from tests.commands.test_run import FAULTY
from yawbench.cli import main
from yawbench.commands import json_and_latex, terminal_progress
from yawbench.fmus.build import build_component
from yawbench.foundation import plugins
from yawbench.foundation.errors import Diagnostic

UNITS = ("driver_sine", "reference_steady_state", "controller_off", "controller_fuzzy_sideslip")
ROOT = Path(__file__).parents[2]
ALWAYS = {"schema", "command", "status", "tables", "diagnostics"}

SWEEP = """
title: Half a sweep
scenario: half.yaml
axes:
  speed: {vary: "inputs.velocity_x", values: [10, 20]}
metrics:
  moment: {metric: peak(yaw_moment)}
"""


@pytest.fixture
def answers(fmus, tmp_path, monkeypatch, capfd):
    """Call a command with `--json` in a folder with a scenario, a study and a sweep; return its object."""
    for name, text in {"half": SCENARIO, "study": STUDY, "sweep": SWEEP}.items():
        (tmp_path / f"{name}.yaml").write_text(text)
    monkeypatch.chdir(tmp_path)

    def call(command: str, *arguments: object, with_fmus: bool = True) -> dict[str, Any]:
        where = ["--fmus", str(fmus)] if with_fmus else []
        with pytest.raises(SystemExit) as ended:
            main([command, *map(str, arguments), *where, "--json"])
        said = capfd.readouterr().out
        made: dict[str, Any] = json.loads(said)
        assert made["command"] == command
        assert made["schema"] == json_and_latex.VERSION
        assert made["status"] == int(ended.value.code or 0)
        return made

    return call


def documented() -> dict[str, set[str]]:
    """Return command -> its fields, as the page lists them."""
    page = (ROOT / "docs/editors.md").read_text(encoding="utf-8")
    rows = page.partition("| command | field | content |\n|---|---|---|\n")[2].partition("\n\n")[0]
    fields: dict[str, set[str]] = {}
    commands: list[str] = []
    for row in rows.splitlines():
        of, names = row.split(" | ")[:2]
        commands = re.findall(r"`([\w-]+)`", of) or commands
        for command in commands:
            fields.setdefault(command, set()).update(re.findall(r"`(\w+)`", names))
    return fields


def test_the_page_tells_the_fields_of_every_command_that_has_some():
    known = plugins.names("command")
    tabular = {name for name in known if hasattr(plugins.find("command", name), "tabular")}
    assert set(documented()) <= tabular
    for always in ALWAYS:
        assert f"| `{always}` |" in (ROOT / "docs/editors.md").read_text(encoding="utf-8")


def test_run_check_and_diff_answer_with_the_documented_fields(answers):
    ran = answers("run", "half.yaml", "--metric", "peak(yaw_moment)")
    assert set(ran) == ALWAYS | documented()["run"]
    record = json.loads((Path(ran["folder"]) / "run.json").read_text())
    assert (ran["rows"], ran["ended"]) == (record["rows"], None)
    ((name, metric),) = ran["metrics"].items()
    assert (name, metric["unit"]) == ("peak(yaw_moment)", "N.m")
    assert ran["tables"][0]["rows"][0][2] == metric["value"] > 0
    faster = answers("run", "half.yaml", "--set", "inputs.velocity_x=25", "--name", "faster")

    checked = answers("check", "half.yaml")
    assert set(checked) == ALWAYS | documented()["check"]
    for key in ("evaluation_order", "fmus", "connections", "algorithm", "step_size", "stop_time"):
        assert checked["plan"][key] == record[key]
    assert "status" not in checked["plan"]

    differing = answers("diff", ran["folder"], faster["folder"], with_fmus=False)
    assert set(differing) == ALWAYS | documented()["diff"]
    assert not differing["identical"]
    assert {"name": "driver.velocity_x", "first": 20.0, "second": 25.0} in differing["inputs"]
    assert {one["signal"] for one in differing["signals"]} >= {"reference.yaw_rate_ref"}
    assert answers("diff", ran["folder"], ran["folder"], with_fmus=False)["identical"]


@pytest.mark.parametrize(
    ("command", "arguments"),
    [
        ("study", ["study.yaml"]),
        ("sweep", ["sweep.yaml"]),
        ("compare", ["half.yaml", "--swap", "controller=controller_off,controller_fuzzy_sideslip"]),
    ],
)
def test_experiments_answer_with_their_records(answers, command, arguments):
    made = answers(command, *arguments)
    assert set(made) == ALWAYS | documented()[command]
    (experiment,) = made["experiments"]
    assert (experiment["runs"], experiment["missing"], experiment["failed"]) == (2, 0, {})
    written = json.loads((Path(experiment["folder"]) / "experiment.json").read_text())
    assert experiment["record"].keys() == written.keys()
    verdicts = [[one["verdict"] for one in record["claims"]] for record in (experiment["record"], written)]
    assert verdicts[0] == verdicts[1]
    assert Path(made["page"]).is_file()


def test_measured_answers_with_flaws(answers, tmp_path):
    record_spike(tmp_path)
    made = answers("measured", "show", "spike.yaml", with_fmus=False)
    assert set(made) == ALWAYS | documented()["measured"]
    assert [(one["kind"], one["signal"]) for one in made["flaws"]] == [("spikes", "yaw_rate")]
    assert made["status"] == 1


def test_evaluate_answers_with_what_evaluation_json_has(answers, tmp_path):
    record_step(tmp_path)
    made = answers("evaluate", "step-steer", "step.yaml", "--no-figures", with_fmus=False)
    assert set(made) == ALWAYS | documented()["evaluate"]
    written = json.loads((Path(made["folder"]) / "evaluation.json").read_text())
    assert made["evaluation"] == written
    assert made["evaluation"]["test"] == "step-steer"


@pytest.mark.parametrize(
    ("arguments", "code", "location"),
    [
        (["run", "half.yaml", "--set", "driver.amplitud=1"], "parameter-unknown", "--set driver.amplitud=1"),
        (["run", "hlf.yaml"], "file-missing", None),
        (["run", "half.yaml", "--jsn"], "option-invalid", None),
        (["check"], "option-invalid", None),
        (["run", "half.yaml", "--latex"], "option-invalid", None),
    ],
)
def test_errors_are_in_the_object_with_the_same_status(answers, arguments, code, location):
    made = answers(*arguments)
    assert made["status"] == 2
    (error,) = made["diagnostics"]
    assert (error["code"], error["severity"]) == (code, "error")
    assert error.get("location", {}).get("target") == location
    assert Diagnostic.of(error).message


def controller_that(act: str, folder: Path) -> Path:
    """Build a controller that does something in every step from 0.05 s on."""
    source = folder / "controller_faulty.py"
    source.write_text(FAULTY.format(name="Faulty", act=act, value="1.0"))
    return build_component(source, folder)


def test_a_failed_run_is_an_error_at_a_time_of_an_instance(answers, fmus, tmp_path):
    fmu = controller_that("raise ValueError", tmp_path)
    made = answers("run", "half.yaml", "--swap", f"controller={fmu}")
    assert made["status"] == 1
    (error,) = (one for one in made["diagnostics"] if one["severity"] == "error")
    assert error["location"]["instance"] == "controller"
    assert error["location"]["time"] == pytest.approx(0.05)


def test_what_fmus_print_goes_to_standard_error(fmus, tmp_path):
    fmu = controller_that('print("here I am", flush=True), os.write(1, b"and here")', tmp_path)
    (tmp_path / "half.yaml").write_text(SCENARIO)
    command = (sys.executable, "-m", "yawbench", "run", tmp_path / "half.yaml", "--fmus", fmus, "--json")
    options = ("--swap", f"controller={fmu}", "--out", tmp_path / "out")
    done = subprocess.run((*command, *options), capture_output=True, text=True, check=True, cwd=ROOT)
    assert json.loads(done.stdout)["rows"] == 41
    assert "here I am" in done.stderr
    assert "and here" in done.stderr


def test_notes_are_in_the_object_as_infos_and_warnings(answers):
    made = answers("check", "half.yaml", "--set", "inputs.friction=65")
    assert made["status"] == 0
    assert {one["severity"] for one in made["diagnostics"]} <= {"warning", "info"}
    assert "value-implausible" in {one["code"] for one in made["diagnostics"]}


def test_latex_is_all_that_is_printed_and_compiles_by_its_shape(fmus, tmp_path, capfd):
    (tmp_path / "half.yaml").write_text(SCENARIO)
    assert status_of("check", tmp_path / "half.yaml", "--fmus", fmus, "--latex") == 0
    text = capfd.readouterr().out
    tables = text.split("\\end{table}\n")
    assert len(tables) > 3
    for table in tables[:-1]:
        assert table.strip().startswith("\\begin{table}")
        columns = len(re.search(r"\\begin\{tabular\}\{([lr]+)\}", table)[1])
        rows = [line for line in table.splitlines() if line.endswith("\\\\")]
        assert len(rows) > 1
        assert {len(re.split(r"(?<!\\)&", row)) for row in rows} == {columns}


def test_a_command_that_takes_long_to_open_fmus_says_so(monkeypatch, capsys):
    before = threading.active_count()
    monkeypatch.setattr(terminal_progress, "PATIENCE", 0.01)
    with terminal_progress.announced("building"):
        time.sleep(0.1)
    assert capsys.readouterr().err == "building\n"
    monkeypatch.setattr(terminal_progress, "PATIENCE", 60.0)
    with terminal_progress.announced("building"):
        pass
    assert capsys.readouterr().err == ""
    assert threading.active_count() == before
