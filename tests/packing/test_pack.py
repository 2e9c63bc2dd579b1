"""`yawbench pack`: what is in the archive, and that it repeats the study on a machine without a checkout."""

from __future__ import annotations

import hashlib
import subprocess
import zipfile
from pathlib import Path

import pytest

from tests.checkout import install_apart, run_apart
from tests.commands.test_batch_commands import SCENARIO, STUDY
from tests.refusals import mentions
from yawbench.fmus.packing import DESCRIPTION
from yawbench.packing.wheel import lock, wheel

UNITS = ("driver_sine", "reference_steady_state", "controller_off", "controller_fuzzy_sideslip")
PROFILE = "time,friction\n0,0.7\n1,0.5\n"


@pytest.fixture
def project(tmp_path, monkeypatch, fmus):
    """A study in a folder of scenarios, which names an FMU by its path and a file of friction."""
    home = tmp_path / "project" / "scenarios" / "half"
    (home / "own").mkdir(parents=True)
    (home / "own" / "steering.fmu").write_bytes((fmus / "driver_sine.fmu").read_bytes())
    (home / "friction.csv").write_text(PROFILE)
    scenario = SCENARIO.replace("fmu: driver_sine", "fmu: own/steering.fmu")
    scenario = scenario.replace("friction: 0.7", "friction: {file: friction.csv, column: friction}")
    (home / "half.yaml").write_text(scenario)
    (home / "study.yaml").write_text(STUDY)
    (home / "unused.yaml").write_text(SCENARIO)
    monkeypatch.chdir(tmp_path / "project")
    return tmp_path / "project"


@pytest.fixture
def unpacked(project, yawbench, fmus, tmp_path):
    """The archive of the study, unpacked elsewhere."""
    status, _, said = yawbench("pack", "half/study", "--fmus", fmus, "--out", "half.zip")
    assert status == 0, said
    with zipfile.ZipFile("half.zip") as archive:
        archive.extractall(tmp_path / "elsewhere")
    return tmp_path / "elsewhere" / "half"


def test_an_archive_holds_what_the_study_reads_and_no_more(unpacked, project, fmus):
    there = {path.relative_to(unpacked).as_posix() for path in unpacked.rglob("*") if path.is_file()}
    assert {name for name in there if name.startswith("scenarios/")} == {
        f"scenarios/half/{name}" for name in ("study.yaml", "half.yaml", "friction.csv", "own/steering.fmu")
    }
    named = {"reference_steady_state", "controller_off", "controller_fuzzy_sideslip"}
    assert {name for name in there if name.startswith("fmus/")} == {f"fmus/{name}.fmu" for name in named}
    for name in named:
        packed, built = (folder / f"{name}.fmu" for folder in (unpacked / "fmus", fmus))
        assert packed.read_bytes() == built.read_bytes()
        with zipfile.ZipFile(packed) as archive:
            assert DESCRIPTION in archive.namelist() and f"{name.partition('_')[2]}.py" in " ".join(
                archive.namelist()
            )
    results = project / "results" / "half" / "study"
    for name in ("table.csv", "verdicts.csv", "experiment.json", "report.html", "off/results.csv"):
        assert (unpacked / "results" / name).read_bytes() == (results / name).read_bytes()
    assert not any(Path(name).name.startswith(".") for name in there)
    requirements = (unpacked / "requirements.txt").read_text().split()
    assert requirements == [*(f"{name}=={version}" for name, version in lock().items()), f"./{wheel()[0]}"]
    readme = (unpacked / "README.md").read_text()
    digest = hashlib.sha256((fmus / "controller_off.fmu").read_bytes()).hexdigest()
    assert mentions(readme, "Half a paper") and mentions(readme, "controller_off", "Python", digest)


def test_the_lock_names_each_package_once_and_what_packages_need():
    named = {name.lower().replace("_", "-"): version for name, version in lock().items()}
    assert len(named) == len(lock())
    assert {"numpy", "fmpy", "pydantic", "pydantic-core"} <= named.keys()
    assert not {"pytest", "mkdocs"} & named.keys()  # of extras


def test_the_wheel_has_the_same_bytes_every_time():
    assert wheel() == wheel()


def test_an_archive_that_is_no_zip_is_refused(project, yawbench, fmus):
    status, _, said = yawbench("pack", "half/study", "--fmus", fmus, "--out", "half.tar")
    assert status == 2 and mentions(said, "--out", "half.tar", ".zip")


@pytest.mark.exhaustive
def test_without_a_checkout_one_command_gives_the_same_bytes(unpacked, tmp_path):
    (program,) = unpacked.glob("*.whl")
    yawbench = install_apart(program, tmp_path / "environment") / "bin" / "yawbench"

    def repeated() -> subprocess.CompletedProcess[str]:
        own = {"YAWBENCH_CACHE": str(tmp_path / "cache"), "YAWBENCH": str(yawbench)}
        return run_apart("sh", "repeat.sh", cwd=unpacked, **own)

    done = repeated()
    assert done.returncode == 0, done.stdout + done.stderr
    assert mentions(done.stderr, "identical", "2 verdicts") and "same bytes" in done.stdout
    for name in ("table.csv", "table.parquet", "verdicts.csv", "off/results.csv"):
        assert (unpacked / "repeated" / name).read_bytes() == (unpacked / "results" / name).read_bytes()
    (unpacked / "results" / "off" / "results.csv").write_text("time\n0\n")
    done = repeated()
    assert done.returncode != 0 and mentions(done.stdout + done.stderr, "off/results.csv")
