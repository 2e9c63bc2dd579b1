"""Stale FMUs are built before a scenario runs, and no others."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

from fmus.build import build_component
from fmus.rebuild_stale import FmuUpdater
from fmus.source_digests import SourceDigests
from tests.checkout import ROOT, copy_checkout, run_in
from tests.sentences import golden, golden_in

DRIVER = "title: Driver\nstop_time: 0.01\nstep_size: 0.001\nunits: {driver: {fmu: driver_sine}}\n"


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of the checkout, all FMUs that the tests use up to date, its modules compiled."""
    folder = copy_checkout(tmp_path_factory.mktemp("stale"))
    (folder / "driver.yaml").write_text(DRIVER)
    for command in ("build", "check driver.yaml", "run driver.yaml --out out"):
        done = yawbench(folder, *command.split())
        assert done.returncode == 0, done.stderr
    shutil.rmtree(folder / "out")
    return folder


@pytest.fixture
def project(built: Path, tmp_path: Path) -> Path:
    """A copy of it to spoil."""
    folder = tmp_path / "project"
    shutil.copytree(built, folder, symlinks=True, ignore=shutil.ignore_patterns("docs", "tests"))
    return folder


def yawbench(project: Path, *arguments: str, **environment: str) -> subprocess.CompletedProcess[str]:
    kept = {"YAWBENCH_CACHE": str(project / "cache"), "PYTHONDONTWRITEBYTECODE": ""}
    return run_in(project, "yawbench", *arguments, **kept | environment)


def edit(project: Path, old: str, new: str) -> None:
    file = project / "components" / "drivers" / "sine.py"
    text = file.read_text()
    assert old in text
    file.write_text(text.replace(old, new))


def record(project: Path, folder: str = "out") -> dict:
    return json.loads((project / folder / "run.json").read_text())["fmus"]["driver"]


def double(project: Path) -> None:
    """Change what the driver does: its amplitude's default is another."""
    file = project / "components" / "drivers" / "sine.py"
    text = file.read_text()
    changed = text.replace("amplitude: float = parameter(", "amplitude: float = parameter(2.0 * ", 1)
    assert changed != text
    file.write_text(changed)


def spoil(project: Path) -> None:
    with (project / "components" / "drivers" / "sine.py").open("a") as file:
        file.write("\nundefined_name\n")


def test_an_edited_component_takes_effect_in_the_next_run(project):
    first = yawbench(project, "run", "driver.yaml", "--out", "out")
    assert (first.returncode, "built" in first.stderr) == (0, False)
    amplitude = record(project)["defaults"]["amplitude"]
    assert record(project)["built"]["current"] is True
    assert record(project)["built"]["source"] == "components/drivers/sine.py"
    key = record(project)["built"]["key"]
    double(project)
    second = yawbench(project, "run", "driver.yaml", "--out", "out")
    assert golden(second.stderr)
    assert record(project)["defaults"]["amplitude"] == 2 * amplitude
    assert record(project)["built"]["key"] != key
    assert "built" not in yawbench(project, "run", "driver.yaml", "--out", "out").stderr


def test_no_run_waits_for_a_native_library_that_takes_long(project):
    builder = project / "fmus" / "native" / "build.py"
    builder.write_text(builder.read_text().replace("LONGEST = 3.0", "LONGEST = 0.0"))
    yawbench(project, "run", "driver.yaml", "--out", "out")  # from now on it is known what the library takes
    amplitude = record(project)["defaults"]["amplitude"]
    double(project)
    edited = yawbench(project, "run", "driver.yaml", "--out", "out")
    assert golden_in(edited.stderr)
    assert golden(record(project)["runs_as"])
    assert record(project)["defaults"]["amplitude"] == 2.0 * amplitude
    again = yawbench(project, "run", "driver.yaml", "--out", "out")
    assert (again.returncode, "built" in again.stderr) == (0, False)
    yawbench(project, "build", "driver_sine")
    yawbench(project, "run", "driver.yaml", "--out", "out")
    assert record(project)["runs_as"] == "native"
    assert record(project)["defaults"]["amplitude"] == 2.0 * amplitude


def test_a_broken_component_ends_the_run_before_it_begins_and_keeps_the_good_fmu(project):
    yawbench(project, "run", "driver.yaml", "--out", "out")
    good, results = (project / "fmus/driver_sine.fmu").read_bytes(), record(project)
    spoil(project)
    for _ in range(2):
        done = yawbench(project, "run", "driver.yaml", "--out", "out")
        assert done.returncode == 1
        assert golden(done.stderr)
        assert done.stderr.count("\n") == 1
    assert (project / "fmus/driver_sine.fmu").read_bytes() == good
    assert record(project) == results
    edit(project, "\nundefined_name\n", "")
    done = yawbench(project, "run", "driver.yaml", "--out", "out")
    assert (done.returncode, "built" in done.stderr) == (0, False)  # the FMU is the one of these sources


@pytest.mark.parametrize("command", ["study", "report"])
@pytest.mark.sampled(1)
def test_a_command_that_runs_nothing_builds_nothing_and_names_what_is_stale(project, command):
    (project / "study.yaml").write_text(
        "title: One\nruns:\n  - {name: one, scenario: driver.yaml}\n"
        "metrics: {m: {metric: peak(driver.steer_angle)}}\n"
    )
    assert yawbench(project, command, "study.yaml", "--out", "out").returncode == 0
    old = (project / "fmus/driver_sine.fmu").read_bytes()
    double(project)
    done = yawbench(project, command, "study.yaml", "--out", "out", "--no-run")
    assert (done.returncode, "built" in done.stderr) == (0, False)
    assert golden_in(done.stderr)
    assert (project / "fmus/driver_sine.fmu").read_bytes() == old


@pytest.mark.parametrize(
    "command",
    [
        "check driver.yaml",
        "compare driver.yaml --swap driver=driver_sine,driver_ramp",
        "converge driver.yaml --signal driver.steer_angle",
        "plot driver.yaml",
        "export-ssp driver.yaml",
        "second-opinion driver.yaml",
        "sweep sweep.yaml",
        "study scenarios/fnn_sideslip/study.yaml",
        "report scenarios/fnn_sideslip/study.yaml",
    ],
)
@pytest.mark.sampled(2)
def test_every_command_that_opens_fmus_builds_what_is_stale_first(project, command):
    (project / "sweep.yaml").write_text(
        "title: Two\nscenario: driver.yaml\n"
        "axes:\n  amplitude: {vary: driver.amplitude, values: [0.1, 0.2]}\n"
        "metrics:\n  angle: {metric: peak(steer_angle)}\n"
    )
    spoil(project)
    done = yawbench(project, *command.split())
    assert golden(done.stderr), done.stderr
    assert done.returncode == 1
    assert "Traceback" not in done.stderr
    assert not (project / "results").exists()


def test_runs_of_a_comparison_say_that_they_are_made_of_the_sources_as_they_are(project):
    double(project)
    swap = "driver=driver_sine:amplitude=0.5,driver_force_pulse,driver_sine"
    done = yawbench(project, "compare", "driver.yaml", "--swap", swap, "--out", "out")
    assert done.returncode == 0, done.stderr
    assert done.stderr.count("driver_sine: built\n") == 1
    assert "note:" not in done.stderr
    found = [json.loads(file.read_text()) for file in (project / "out").glob("*/run.json")]
    assert [run["fmus"]["driver"]["built"]["current"] for run in found] == [True] * 3


@pytest.mark.parametrize("how", [{"option": "--no-build"}, {"YAWBENCH_NO_BUILD": "1"}])
@pytest.mark.sampled(1)
def test_without_building_a_stale_fmu_runs_with_a_note_and_its_record_says_so(project, how):
    old = (project / "fmus/driver_sine.fmu").read_bytes()
    double(project)
    option = [how["option"]] if "option" in how else []
    environment = {} if "option" in how else how
    done = yawbench(project, "run", "driver.yaml", "--out", "out", *option, **environment)
    assert done.returncode == 0
    assert golden(done.stderr)
    assert record(project)["built"]["current"] is False
    assert (project / "fmus/driver_sine.fmu").read_bytes() == old


def test_only_fmus_that_the_scenario_uses_are_built(project):
    with (project / "components/tyres/linear.py").open("a") as file:
        file.write("\n1 +\n")
    double(project)
    assert golden(yawbench(project, "run", "driver.yaml", "--out", "out").stderr)


def test_a_component_that_has_no_fmu_yet_is_built(project):
    (project / "fmus/driver_sine.fmu").unlink()
    shutil.copy(project / "components/drivers/sine.py", project / "components/drivers/new.py")
    done = yawbench(project, "run", "driver.yaml", "--swap", "driver=driver_new", "--out", "out")
    assert golden(done.stderr)
    assert done.returncode == 0
    assert not (project / "fmus/driver_sine.fmu").exists()
    for file in (project / "fmus").glob("*.fmu"):
        file.unlink()
    assert golden(yawbench(project, "run", "driver.yaml", "--out", "out").stderr)
    done = yawbench(project, "run", "driver.yaml", "--swap", "driver=driver_sin", "--out", "out")
    assert done.returncode == 2
    assert golden_in(done.stderr)


def test_an_fmu_of_a_users_own_file_is_built_where_it_was_built_and_a_copy_is_let_be(project, tmp_path):
    own = tmp_path / "mine" / "drivers" / "steady.py"
    own.parent.mkdir(parents=True)
    text = (project / "components/drivers/sine.py").read_text()
    own.write_text(text.replace("from ..", "from components."))
    assert yawbench(project, "build", str(own), "--out", str(tmp_path / "mine/fmus")).returncode == 0
    fmu = tmp_path / "mine/fmus/driver_steady.fmu"
    copy = tmp_path / "mine/kept/driver_steady.fmu"
    copy.parent.mkdir()
    shutil.copy(fmu, copy)
    old = fmu.read_bytes()
    own.write_text(own.read_text() + "\n# another\n")
    done = yawbench(project, "run", "driver.yaml", "--swap", f"driver={fmu}", "--out", "out")
    assert golden(done.stderr)
    assert fmu.read_bytes() != old
    assert record(project)["built"]["source"] == "../drivers/steady.py"
    done = yawbench(project, "run", "driver.yaml", "--swap", f"driver={copy}", "--out", "out")
    assert "built" not in done.stderr
    assert copy.read_bytes() == old
    shutil.rmtree(own.parent)  # sent to somebody without its source, it is an FMU like any other
    done = yawbench(project, "run", "driver.yaml", "--swap", f"driver={fmu}", "--out", "out")
    assert (done.returncode, record(project)["built"]) == (0, None)


def test_a_copy_of_a_components_fmu_in_another_folder_is_told_of_and_not_touched(project):
    shutil.copytree(project / "fmus", project / "before", ignore=shutil.ignore_patterns("*.py", "*.[ch]"))
    old = (project / "before/driver_sine.fmu").read_bytes()
    double(project)
    done = yawbench(project, "run", "driver.yaml", "--fmus", "before", "--out", "out")
    assert done.returncode == 0
    assert golden_in(done.stderr)
    assert (project / "before/driver_sine.fmu").read_bytes() == old


@pytest.fixture(scope="module")
def compiled(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A cache with the native libraries that a test before has compiled of the same sources."""
    return tmp_path_factory.mktemp("compiled")


@pytest.mark.parametrize("built_into", ["fmus", "linked"])
def test_a_folder_of_fmus_may_be_opened_through_a_link(built_into, compiled, tmp_path, monkeypatch):
    monkeypatch.setenv("YAWBENCH_CACHE", str(compiled))
    source = tmp_path / "drivers" / "steady.py"
    source.parent.mkdir()
    text = (ROOT / "components/drivers/steady_turn.py").read_text().replace("from ..", "from components.")
    source.write_text(text)
    (tmp_path / "fmus").mkdir()
    (tmp_path / "linked").symlink_to("fmus")
    fmu = build_component(source, tmp_path / built_into).name
    for round, way in enumerate(("fmus", "linked")):
        source.write_text(f"{text}\nEDITED = {round}\n")
        lines: list[str] = []
        place, info = FmuUpdater(lines.append).bring(tmp_path / way / fmu, build=True)
        assert (place, info and info.current, len(lines)) == (tmp_path / way / fmu, True, 1)


def test_nobody_waits_for_the_builder_if_everything_is_current(project):
    yawbench(project, "check", "driver.yaml")
    script = (
        "import sys; from orchestrator.cli import main\n"
        "try: main(['check', 'driver.yaml'])\n"
        "except SystemExit: print('fmus.build' in sys.modules, 'pythonfmu' in sys.modules)\n"
    )
    done = run_in(project, "python", "-c", script, YAWBENCH_CACHE=str(project / "cache"))
    assert done.stdout.endswith("False False\n"), done.stderr


def test_an_edit_that_leaves_size_and_time_alone_is_noticed(tmp_path):
    file = tmp_path / "a.py"
    file.write_text("1")
    evidence = SourceDigests().evidence([file, tmp_path, "env:YAWBENCH_X"])
    times = file.stat()
    file.write_text("2")
    os.utime(file, ns=(times.st_atime_ns, times.st_mtime_ns))
    assert not SourceDigests().confirm(evidence)
    file.write_text("1")
    assert SourceDigests().confirm(evidence)
    (tmp_path / "__pycache__").mkdir()
    assert SourceDigests().confirm(evidence)
    (tmp_path / "b.py").touch()
    assert not SourceDigests().confirm(evidence)


def test_a_file_that_comes_before_a_known_one_makes_an_fmu_stale(project):
    """A package goes before a module of the same name, without any known file being changed."""
    yawbench(project, "check", "driver.yaml")
    package = project / "components/driving/speed_holding"
    package.mkdir()
    (package / "__init__.py").write_text("undefined_name\n")
    done = yawbench(project, "check", "driver.yaml")
    assert golden_in(done.stderr)


def _python_of_others() -> str | None:
    """Return a Python of this version that any user may start."""
    python = Path(f"/usr/bin/python{sys.version_info[0]}.{sys.version_info[1]}")
    readable = all(os.stat(path).st_mode & 0o005 == 0o005 for path in (ROOT, *ROOT.parents))
    return str(python) if os.getuid() == 0 and python.exists() and readable else None


@pytest.mark.skipif(_python_of_others() is None, reason="needs root, and a Python that others may start")
@pytest.mark.parametrize("home", [{}, {"HOME": "/"}, {"HOME": "/root"}])
@pytest.mark.sampled(1)
def test_any_user_runs_a_project_that_he_cannot_write(built, home):
    """As in a container: a user id that nobody knows, no home, everything installed by root."""
    with tempfile.TemporaryDirectory() as folder:  # pytest's own is closed to others
        os.chmod(folder, 0o755)
        project = Path(folder, "project")
        shutil.copytree(built, project, ignore=shutil.ignore_patterns("docs", "tests", "cache", ".venv"))
        project.chmod(0o755)
        _run_as_nobody(project, Path(folder, "room"), home)


def _run_as_nobody(project: Path, room: Path, home: dict[str, str]) -> None:
    (project / "fmus/driver_sine.fmu").unlink()
    double(project)
    room.mkdir()
    room.chmod(0o1777)
    packages = [path for path in sys.path if path.endswith("site-packages")]
    command = [
        _python_of_others(),
        "-m",
        "orchestrator.cli",
        "run",
        "driver.yaml",
        "--out",
        str(room / "out"),
    ]
    for attempt in ("driver_sine: built\n", ""):
        done = subprocess.run(
            command,
            cwd=project,
            env={"PYTHONPATH": os.pathsep.join([str(project), *packages]), "PATH": "/usr/bin:/bin"}
            | {"TMPDIR": str(room), "PYTHONDONTWRITEBYTECODE": "1", **home},
            user=54321,
            group=54321,
            extra_groups=[],
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, done.stderr
        assert done.stderr.startswith(attempt)
        assert ("built" in done.stderr) == bool(attempt)
    assert json.loads((room / "out/run.json").read_text())["fmus"]["driver"]["built"]["current"] is True
    assert not (project / "fmus/driver_sine.fmu").exists()


if sys.platform != "linux":
    pytestmark = pytest.mark.skip("checked on Linux")
