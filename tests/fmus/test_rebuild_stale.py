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

from tests.checkout import CODE, ROOT, copy_checkout, run_in
from tests.refusals import each_mentions, mentions
from yawbench.commands.terminal_progress import BUILDING, OPENING
from yawbench.fmus import recipe
from yawbench.fmus.build import build_component, find_recipes
from yawbench.fmus.native import build as native_build
from yawbench.fmus.rebuild_stale import FmuUpdater
from yawbench.fmus.source_digests import SourceDigests

RAN = ("11 rows", "3 variables")
"""What is said of a run."""
DRIVER = "title: Driver\nstop_time: 0.01\nstep_size: 0.001\nunits: {driver: {fmu: driver_sine}}\n"


OURS, OWN = "components/drivers/sine.py", "drivers/sine.py"
STUDY = """
title: One
runs:
  - {name: one, scenario: driver.yaml}
metrics: {m: {metric: peak(driver.steer_angle)}}
"""
SWEEP = """
title: Two
scenario: driver.yaml
axes:
  amplitude: {vary: driver.amplitude, values: [0.1, 0.2]}
metrics:
  angle: {metric: peak(steer_angle)}
"""


# ---- a driver of a user's own, and commands in the process of the tests


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a driver that is a user's own, its FMU, and files that use it."""
    folder = tmp_path_factory.mktemp("written")
    text = (ROOT / OURS).read_text().replace("from ..", "from yawbench.components.")
    (folder / "drivers").mkdir()
    (folder / OWN).write_text(text)
    with pytest.MonkeyPatch.context() as patch:
        without_native_libraries(patch)
        for name in ("driver_sine", "driver_other"):
            build_component(folder / OWN, folder / "fmus", name=name)
    (folder / "driver.yaml").write_text(DRIVER.replace("driver_sine", "fmus/driver_sine.fmu"))
    (folder / "study.yaml").write_text(STUDY)
    (folder / "sweep.yaml").write_text(SWEEP)
    return folder


@pytest.fixture
def own(written: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy of it to spoil, in which commands are called."""
    folder = tmp_path / "own"
    shutil.copytree(written, folder)
    without_native_libraries(monkeypatch)
    monkeypatch.chdir(folder)
    return folder


def without_native_libraries(monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave native libraries out of what is built: they take most of the time."""
    monkeypatch.setattr(
        "yawbench.fmus.recipe.native", lambda *_, **__: native_build.Native(why_not="left out")
    )


def record(project: Path, folder: str = "out") -> dict:
    return json.loads((project / folder / "run.json").read_text())["fmus"]["driver"]


def double(driver: Path) -> None:
    """Change what a driver does: its amplitude's default is another."""
    text = driver.read_text()
    changed = text.replace("amplitude: float = parameter(", "amplitude: float = parameter(2.0 * ", 1)
    assert changed != text
    driver.write_text(changed)


SPOILT = ("driver_sine", "NameError", "'undefined_name'", "drivers/sine.py:46")


def spoil(driver: Path) -> None:
    with driver.open("a") as file:
        file.write("\nundefined_name\n")


def test_a_broken_component_ends_the_run_before_it_begins_and_keeps_the_good_fmu(own, yawbench):
    yawbench("run", "driver.yaml", "--out", "out")
    good, results = (own / "fmus/driver_sine.fmu").read_bytes(), record(own)
    text = (own / OWN).read_text()
    spoil(own / OWN)
    for _ in range(2):
        code, _, errors = yawbench("run", "driver.yaml", "--out", "out")
        assert code == 1
        assert each_mentions(errors, SPOILT)
    assert (own / "fmus/driver_sine.fmu").read_bytes() == good
    assert record(own) == results
    (own / OWN).write_text(text)
    code, _, errors = yawbench("run", "driver.yaml", "--out", "out")
    assert (code, "built" in errors) == (0, False)  # the FMU is the one of these sources


@pytest.mark.parametrize("command", ["study", "report"])
def test_a_command_that_runs_nothing_builds_nothing_and_names_what_is_stale(own, command, yawbench):
    assert yawbench(command, "study.yaml", "--out", "out")[0] == 0
    old = (own / "fmus/driver_sine.fmu").read_bytes()
    double(own / OWN)
    code, _, errors = yawbench(command, "study.yaml", "--out", "out", "--no-run")
    assert (code, "built" in errors) == (0, False)
    assert mentions(errors, "note", "driver_sine.fmu", "../drivers/sine.py")
    assert (own / "fmus/driver_sine.fmu").read_bytes() == old


@pytest.mark.parametrize(
    "command",
    [
        "check driver.yaml",
        "compare driver.yaml --swap driver=fmus/driver_sine.fmu,fmus/driver_other.fmu",
        "converge driver.yaml --signal driver.steer_angle",
        "plot driver.yaml",
        "export-ssp driver.yaml",
        "second-opinion driver.yaml",
        "sweep sweep.yaml",
        "study study.yaml",
        "report study.yaml",
    ],
)
def test_every_command_that_opens_fmus_builds_what_is_stale_first(own, command, yawbench):
    spoil(own / OWN)
    code, _, errors = yawbench(*command.split())
    assert each_mentions(errors, SPOILT)
    assert code == 1
    assert not (own / "results").exists()


def test_runs_of_a_comparison_say_that_they_are_made_of_the_sources_as_they_are(own, yawbench):
    double(own / OWN)
    sine, other = "fmus/driver_sine.fmu", "fmus/driver_other.fmu"
    swap = f"driver={sine}:amplitude=0.5,{other},{sine}"
    code, _, errors = yawbench("compare", "driver.yaml", "--swap", swap, "--out", "out")
    assert code == 0, errors
    assert errors.count("driver_sine: built\n") == 1
    assert "note:" not in errors
    found = [json.loads(file.read_text()) for file in (own / "out").glob("*/run.json")]
    assert [run["fmus"]["driver"]["built"]["current"] for run in found] == [True] * 3


@pytest.mark.parametrize("how", ["--no-build", "YAWBENCH_NO_BUILD"])
def test_without_building_a_stale_fmu_runs_with_a_note_and_its_record_says_so(
    own, how, yawbench, monkeypatch
):
    old = (own / "fmus/driver_sine.fmu").read_bytes()
    double(own / OWN)
    options = [how] if how.startswith("--") else []
    if not options:
        monkeypatch.setenv(how, "1")
    code, _, errors = yawbench("run", "driver.yaml", "--out", "out", *options)
    assert code == 0
    assert each_mentions(errors, ("note", "driver_sine.fmu", "../drivers/sine.py"), RAN)
    assert record(own)["built"]["current"] is False
    assert (own / "fmus/driver_sine.fmu").read_bytes() == old


def test_an_fmu_of_a_users_own_file_is_built_where_it_was_built_and_a_copy_is_let_be(own, yawbench):
    (own / OWN).rename(own / "drivers/steady.py")
    source, fmu, copy = (own / name for name in ("drivers/steady.py", "made/driver_steady.fmu", "kept.fmu"))
    assert yawbench("build", source, "--out", fmu.parent)[0] == 0
    shutil.copy(fmu, copy)
    old = fmu.read_bytes()
    source.write_text(source.read_text() + "\n# another\n")
    _, _, errors = yawbench("run", "driver.yaml", "--swap", f"driver={fmu}", "--out", "out")
    assert each_mentions(errors, ("driver_steady", "built"), ("driver_steady", "driver"), RAN)
    assert fmu.read_bytes() != old
    assert record(own)["built"]["source"] == "../drivers/steady.py"
    _, _, errors = yawbench("run", "driver.yaml", "--swap", f"driver={copy}", "--out", "out")
    assert "built" not in errors
    assert copy.read_bytes() == old
    source.unlink()  # sent to somebody without its source, it is an FMU like any other
    code, _, _ = yawbench("run", "driver.yaml", "--swap", f"driver={fmu}", "--out", "out")
    assert (code, record(own)["built"]) == (0, None)


def test_no_run_waits_for_a_native_library_that_takes_long(own, yawbench, monkeypatch):
    monkeypatch.undo()
    monkeypatch.chdir(own)
    monkeypatch.setenv("YAWBENCH_CACHE", str(own / "cache"))
    native_build.toolchain()  # the real one is kept for the whole process
    monkeypatch.setattr(recipe, "MINGW", "no compiler")
    monkeypatch.setattr(native_build, "LINUX", ("-O0", "-fPIC"))
    build = ("build", OWN, "--out", "fmus")
    yawbench(*build)  # from now on it is known what the library takes
    yawbench("run", "driver.yaml", "--out", "out")
    amplitude = record(own)["defaults"]["amplitude"]
    monkeypatch.setattr(native_build, "LONGEST", 0.0)
    double(own / OWN)
    _, _, errors = yawbench("run", "driver.yaml", "--out", "out")
    assert mentions(errors, "driver_sine", "Python", "native")
    assert mentions(record(own)["runs_as"], "'yawbench build'", "native", "library")
    assert record(own)["defaults"]["amplitude"] == 2.0 * amplitude
    code, _, errors = yawbench("run", "driver.yaml", "--out", "out")
    assert (code, "built" in errors) == (0, False)
    yawbench(*build)
    yawbench("run", "driver.yaml", "--out", "out")
    assert record(own)["runs_as"] == "native"
    assert record(own)["defaults"]["amplitude"] == 2.0 * amplitude


# ---- the components of a checkout, and commands in processes of their own


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of the checkout, the FMUs that the tests use up to date, with the results of a run."""
    folder = copy_checkout(tmp_path_factory.mktemp("stale"), CODE)
    for file in (folder / "fmus").glob("*.fmu"):
        if file.name != "driver_sine.fmu":
            file.unlink()
    (folder / "driver.yaml").write_text(DRIVER)
    command(folder, "run", "driver.yaml", "--out", "out")
    return folder


def command(project: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Run `yawbench` in a process of its own, which compiles nothing.

    It says that, and on a computer at work that opening the FMUs takes seconds, in lines that are left out.
    """
    done = run_in(project, "yawbench", *arguments, CC="none")
    assert "Traceback" not in done.stderr
    left_out = (OPENING, "note: no C compiler")
    done.stderr = "".join(line for line in done.stderr.splitlines(True) if not line.startswith(left_out))
    return done


def test_an_edited_or_new_component_takes_effect_in_the_next_run_and_no_fmu_that_is_not_used_is_built(
    built, tmp_path
):
    project = shutil.copytree(built, tmp_path / "project", symlinks=True)
    before = record(project)
    assert before["built"]["current"] is True
    assert before["built"]["source"] == OURS
    double(project / OURS)
    with (project / "components/drivers/ramp.py").open("a") as file:
        file.write("\n1 +\n")
    done = command(project, "run", "driver.yaml", "--out", "out")
    assert each_mentions(done.stderr, ("driver_sine", "built"), RAN)
    assert record(project)["defaults"]["amplitude"] == 2 * before["defaults"]["amplitude"]
    assert record(project)["built"]["key"] != before["built"]["key"]
    (project / "fmus/driver_sine.fmu").unlink()
    shutil.copy(project / OURS, project / "components/drivers/new.py")  # which has no FMU yet
    done = command(project, "run", "driver.yaml", "--swap", "driver=driver_new", "--out", "out")
    assert each_mentions(done.stderr, ("driver_new", "built"), ("driver_new", "driver"), RAN)
    assert done.returncode == 0
    assert not (project / "fmus/driver_sine.fmu").exists()


def test_nobody_waits_for_the_builder_if_everything_is_current(tmp_path, yawbench):
    (tmp_path / "driver.yaml").write_text(DRIVER)
    yawbench("check", tmp_path / "driver.yaml")
    script = (
        "import sys; from yawbench.cli import main\n"
        "try: main(['check', 'driver.yaml'])\n"
        "except SystemExit: print('yawbench.fmus.build' in sys.modules, 'pythonfmu' in sys.modules)\n"
    )
    done = run_in(tmp_path, "python", "-c", script)
    assert done.stdout.endswith("False False\n"), done.stderr


def test_a_file_that_comes_before_a_known_one_is_noticed(tmp_path):
    """A package goes before a module of the same name, without any known file being changed."""
    root = tmp_path / "components"
    shutil.copytree(ROOT / "components", root, ignore=shutil.ignore_patterns("__pycache__"))
    evidence = find_recipes(root)["driver_sine"].evidence()
    assert SourceDigests().confirm(evidence)
    package = root / "driving/speed_holding"
    package.mkdir()
    (package / "__init__.py").touch()
    assert not SourceDigests().confirm(evidence)


# ---- files and users


@pytest.mark.parametrize("built_into", ["fmus", "linked"])
def test_a_folder_of_fmus_may_be_opened_through_a_link(built_into, tmp_path, monkeypatch):
    without_native_libraries(monkeypatch)
    source = tmp_path / "drivers" / "steady.py"
    source.parent.mkdir()
    text = (ROOT / OURS).read_text().replace("from ..", "from yawbench.components.")
    source.write_text(text)
    (tmp_path / "fmus").mkdir()
    (tmp_path / "linked").symlink_to("fmus")
    fmu = build_component(source, tmp_path / built_into).name
    for round, way in enumerate(("fmus", "linked")):
        source.write_text(f"{text}\nEDITED = {round}\n")
        lines: list[str] = []
        place, info = FmuUpdater(lines.append).bring(tmp_path / way / fmu, build=True)
        assert (place, info and info.current, len(lines)) == (tmp_path / way / fmu, True, 1)


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


def _python_of_others() -> str | None:
    """Return a Python of this version that any user may start."""
    python = Path(f"/usr/bin/python{sys.version_info[0]}.{sys.version_info[1]}")
    readable = all(os.stat(path).st_mode & 0o005 == 0o005 for path in (ROOT, *ROOT.parents))
    return str(python) if os.getuid() == 0 and python.exists() and readable else None


@pytest.mark.skipif(_python_of_others() is None, reason="needs root, and a Python that others may start")
@pytest.mark.parametrize("environment", [{"CC": "none"}, {}, {"HOME": "/"}, {"HOME": "/root"}])
@pytest.mark.sampled(1)
def test_any_user_runs_a_project_that_he_cannot_write(built, environment):
    """As in a container: a user id that nobody knows, no home, everything installed by root.

    Without a compiler there is less to wait for.
    """
    packages = [path for path in sys.path if path.endswith("site-packages")]
    with tempfile.TemporaryDirectory() as folder:  # pytest's own is closed to others
        os.chmod(folder, 0o755)
        project, room = Path(folder, "project"), Path(folder, "room")
        # with its links: the folder of FMUs is one, however it is reached
        shutil.copytree(built, project, ignore=shutil.ignore_patterns(".venv"), symlinks=True)
        project.chmod(0o755)
        (project / "fmus/driver_sine.fmu").unlink()
        double(project / OURS)
        room.mkdir()
        room.chmod(0o1777)
        environment = environment | {
            "PYTHONPATH": os.pathsep.join([str(project), *packages]),
            **{"PATH": "/usr/bin:/bin", "TMPDIR": str(room), "PYTHONDONTWRITEBYTECODE": "1"},
        }
        words = [_python_of_others(), "-m", "yawbench.cli", "run", "driver.yaml", "--out", str(room / "out")]
        for attempt in ("driver_sine: built", ""):
            done = subprocess.run(
                words, cwd=project, env=environment, user=54321, group=54321, extra_groups=[],
                capture_output=True, text=True, check=False,
            )  # fmt: skip
            assert done.returncode == 0, done.stderr
            assert attempt in done.stderr
            assert ("built" in done.stderr.replace(BUILDING, "")) == bool(attempt)
        assert record(room)["built"]["current"] is True
        assert not (project / "fmus/driver_sine.fmu").exists()


if sys.platform != "linux":
    pytestmark = pytest.mark.skip("checked on Linux")
