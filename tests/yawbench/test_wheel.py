"""The wheel, installed in an environment without the checkout, used in an empty folder."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest

import yawbench as yb
from tests.checkout import CODE, ROOT, copy_checkout, install_apart, run_apart

pytestmark = pytest.mark.exhaustive


def run(*command: str | Path, cwd: Path, **environment: str) -> str:
    """Run a command without this checkout on Python's path; return what it prints."""
    done = run_apart(*command, cwd=cwd, **environment)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An environment with the wheel; its dependencies are those of the environment of the tests."""
    folder = tmp_path_factory.mktemp("wheel")
    checkout = copy_checkout(folder / "checkout")
    build = (
        sys.executable,
        "-m",
        "pip",
        "wheel",
        "--quiet",
        "--no-deps",
        "--no-build-isolation",
        "--no-index",
    )
    run(*build, "--wheel-dir", folder, checkout, cwd=folder)
    (wheel,) = folder.glob("yawbench-*.whl")
    return install_apart(wheel, folder / "environment")


@pytest.fixture
def empty(tmp_path: Path) -> Path:
    """An empty folder."""
    folder = tmp_path / "empty"
    folder.mkdir()
    return folder


def test_the_wheel_holds_every_file_of_the_packages(installed):
    (packages,) = installed.glob("lib/python*/site-packages")
    names = {path.name for path in packages.iterdir() if path.is_dir() and (ROOT / path.name).is_dir()}
    assert names == {"yawbench"}
    ours = {
        file.relative_to(ROOT)
        for name in CODE
        for file in (ROOT / name).rglob("*.*")
        if file.is_file() and file.suffix not in (".fmu", ".pyc") and not file.name.startswith(".")
    }
    where = {
        file: packages / file if file.parts[0] == "yawbench" else packages / "yawbench" / file
        for file in ours
    }
    assert {str(file) for file, there in where.items() if not there.exists()} == set()


def test_the_installed_command_runs_a_scenario_with_fmus_built_into_the_cache(installed, empty):
    cache = empty.parent / "cache"
    run(installed / "bin" / "yawbench", "run", "fnn_sideslip/25mps", cwd=empty, YAWBENCH_CACHE=str(cache))
    record = json.loads((empty / "results" / "fnn_sideslip" / "25mps" / "run.json").read_text())
    (packages,) = installed.glob("lib/python*/site-packages")
    assert record["status"] == "completed"
    assert Path(record["scenario"]["file"]).is_relative_to(packages)
    assert {path.stem for path in cache.rglob("*.fmu")} >= {"plant_seven_dof", "tyre_dugoff"}
    assert not list(packages.rglob("*.fmu"))


def test_the_installed_library_runs_a_scenario_in_memory(installed, empty):
    program = "import yawbench as yb; print(yb.load('fnn_sideslip/25mps').run().metric('peak(sideslip)'))"
    printed = run(
        installed / "bin" / "python", "-c", program, cwd=empty, YAWBENCH_CACHE=str(empty.parent / "cache")
    )
    assert float(printed) == yb.load("fnn_sideslip/25mps").run().metric("peak(sideslip)")
    assert not list(empty.iterdir())


def test_the_installed_command_lists_what_is_shipped_and_prints_the_schemas_of_the_package(installed, empty):
    yawbench = installed / "bin" / "yawbench"
    (packages,) = installed.glob("lib/python*/site-packages")
    kinds = run(yawbench, "schema", cwd=empty).split()
    files = {
        file.stem: file.read_text()
        for file in (packages / "yawbench" / "scenarios" / "schemas").glob("*.json")
    }
    assert sorted(kinds) == sorted(files)
    assert run(yawbench, "schema", "scenario", cwd=empty) == files["scenario"]
    run(yawbench, "new", "study", "mine", cwd=empty)
    assert (empty / "scenarios/schemas/experiment.json").read_text() == files["experiment"]
    scenarios, vehicles = json.loads(run(yawbench, "list", "--json", cwd=empty))["tables"]
    assert "fnn_sideslip/25mps" in [row[0] for row in scenarios["rows"]]
    assert "in_wheel_motor_car" in str(vehicles["rows"])
