"""The README's own controller, built and run as the README says."""

from __future__ import annotations

import csv
import re
from pathlib import Path

import pytest

from tests.command_line import status_of
from tests.fmu_copies import put_fmus
from yawbench.fmus.build import build_component
from yawbench.foundation import plugins

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")
UNITS = (
    "driver_sine", "reference_steady_state", "controller_off", "allocator_load_proportional",
    "wheel_control_direct", "plant_seven_dof", "tyre_dugoff",
)  # fmt: skip


def python_after(words: str) -> str:
    """Return the first block of Python behind some words."""
    return re.findall(r"```python\n(.*?)```", README.partition(words)[2], re.DOTALL)[0]


def test_the_first_screen_has_python_that_prints_what_it_says_beside_the_command_line(
    tmp_path, monkeypatch, capsys
):
    first_screen = "".join(README.splitlines(keepends=True)[:30])
    code = python_after("In Python:")
    assert code in first_screen
    assert ".venv/bin/yawbench compare" in first_screen
    monkeypatch.chdir(tmp_path)
    exec(code, {})
    said = re.findall(r"# ([\d.]+) and ([\d.]+) rad", code)[0]
    assert [f"{float(number):.4f}" for number in capsys.readouterr().out.split()] == [*said]
    assert (tmp_path / "held.svg").stat().st_size > 10_000


@pytest.mark.exhaustive
def test_the_controller_of_the_readme_runs_and_follows_the_yaw_rate(tmp_path, capsys):
    code = python_after("Put this into `components/controllers/yaw_rate.py`")
    file = tmp_path / "yaw_rate.py"
    file.write_text(code.replace("from ..fmi", "from yawbench.components.fmi"), encoding="utf-8")
    put_fmus(tmp_path, components=UNITS)
    build_component(file, tmp_path, role="controllers")
    given = ("--swap", "controller=controller_off,controller_yaw_rate", "--fmus", tmp_path)
    scenario = ROOT / "scenarios/fnn_sideslip/25mps.yaml"
    assert status_of("compare", scenario, *given, "--out", tmp_path / "out") == 0
    runs = {row["run"]: row for row in csv.DictReader((tmp_path / "out" / "table.csv").open())}
    errors = [float(runs[f"controller_{n}"]["rms_error(yaw_rate) [rad/s]"]) for n in ("yaw_rate", "off")]
    assert errors[0] < 0.5 * errors[1]


def test_the_page_on_running_things_names_every_command():
    page = (ROOT / "docs" / "running.md").read_text(encoding="utf-8")
    table = re.findall(r"^\| `([\w-]+)` \|", page, re.MULTILINE)
    assert set(table) == set(plugins.names("command"))


def test_every_file_that_the_readme_names_exists():
    named = set(re.findall(r"\b(?:scenarios|components|docs)/[\w/]+\.\w+", README))
    assert len(named) > 4
    missing = {name for name in named if not (ROOT / name).is_file()}
    assert missing == {"components/controllers/yaw_rate.py"}  # the one that the reader writes
