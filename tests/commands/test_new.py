"""`yawbench new`: what it writes works as it stands."""

from __future__ import annotations

import io
import json
import re
import shlex
import shutil
import sys
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path

import numpy as np
import pytest

from tests.checkout import copy_checkout, run_in
from tests.command_line import status_of
from tests.fmu_copies import put_fmus
from tests.refusals import each_mentions, mentions
from yawbench.cli import main
from yawbench.orchestrator.results.reader import load_results
from yawbench.orchestrator.scenario import catalogue
from yawbench.orchestrator.scenario.loader import load_scenario
from yawbench.vehicles.tir import read_tir

UNITS = (
    "driver_sine", "reference_steady_state", "controller_off", "controller_fnn", "controller_fuzzy_sideslip",
    "allocator_load_proportional",
    "wheel_control_direct", "plant_seven_dof", "tyre_dugoff",
)  # fmt: skip

pytestmark = pytest.mark.skipif(shutil.which("cc") is None, reason="there is no C compiler")


@pytest.fixture
def new(tmp_path, monkeypatch, capsys):
    """Call `yawbench new` in an empty folder: exit status, printed commands, messages."""

    def call(*arguments: str, kind: str = "controller") -> tuple[int, list[str], str]:
        monkeypatch.chdir(tmp_path)
        with pytest.raises(SystemExit) as exit_:
            main(["new", kind, *arguments])
        said = capsys.readouterr()
        return int(exit_.value.code or 0), said.out.splitlines(), said.err

    return call


def files(folder: Path) -> set[str]:
    return {str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file()}


def called(folder: Path, *command: str | Path) -> tuple[int, str, str]:
    """Return status, output and messages of a command in a folder; `yawbench` is called in this process."""
    if Path(command[0]).name != "yawbench":
        done = run_in(folder, *command)
        return done.returncode, done.stdout, done.stderr
    out, said = io.StringIO(), io.StringIO()
    with pytest.MonkeyPatch.context() as patch, redirect_stdout(out), redirect_stderr(said):
        patch.chdir(folder)
        status = status_of(*command[1:])
    return status, out.getvalue(), said.getvalue()


@pytest.fixture(scope="module")
def project(tmp_path_factory):
    """A folder outside the checkout with a controller in Python and one in C, taken as far as a run."""
    folder = tmp_path_factory.mktemp("project")
    printed = {}
    for name, language in (("follow", "python"), ("follow_c", "c")):
        status, out, said = called(folder, "yawbench", "new", "controller", name, "--language", language)
        assert status == 0, said
        printed[name] = [shlex.split(line) for line in out.splitlines()]
    everything, *of_python, _ = printed["follow"]
    assert everything[1] == "build"
    assert everything[-2:] == ["--out", "fmus"]
    assert {*everything[2:-2]} == {*UNITS} - {"controller_fnn", "controller_fuzzy_sideslip"}
    put_fmus(folder / "fmus", components=UNITS)  # quicker than building everything
    for command in (*of_python, *printed["follow_c"][1:-1]):
        status, out, said = called(folder, *command)
        assert status == 0, out + said
        assert "pytest" not in command or "5 passed" in out
    return folder, printed


def test_an_exercise_is_failed_as_it_begins_and_passed_with_a_law(project):
    folder, _ = project
    status, out, said = called(folder, "yawbench", "new", "exercise", "hold")
    assert status == 0, said
    units, build, test, study, mark = [shlex.split(line) for line in out.splitlines()]
    law = folder / "controllers" / "hold.py"
    begun = law.read_text()
    assert [called(folder, *command)[0] for command in (build, test)] == [0, 1]
    law.write_text(begun.replace("return 0.0  # your part", "return 2e4 * (yaw_rate_ref - yaw_rate)"))
    done = [called(folder, *command) for command in (build, test, study, mark)]
    assert [status for status, *_ in done] == [0, 0, 0, 0], [said for *_, said in done]
    record = json.loads((folder / "results/hold/exercise/experiment.json").read_text())
    assert [check["holds"] for check in record["checks"]] == [True, True, True]
    assert (folder / "exercises/hold/marks.csv").read_text().splitlines()[1].split(",")[2] == "pass"
    marking = folder / "exercises/hold/mark.py"
    marking.write_text(re.sub(r"LIMIT = .*", "LIMIT = 3.0", marking.read_text()))
    asleep = begun.replace("return 0.0  # your part", "__import__('time').sleep(60)")
    submitted = {"endless": asleep, "leaving": "import os; os._exit(0)", "broken": "raise RuntimeError('no')"}
    for name, text in submitted.items():
        (folder / f"{name}.py").write_text(text)
    status, out, _ = called(folder, *mark, *(f"{name}.py" for name in submitted))
    ends = (
        ("endless.py", "0 of 2", "3 s"),
        ("leaving.py", "0 of 2"),
        ("broken.py", "0 of 2", "RuntimeError: no"),
    )
    assert status == 1 and each_mentions(out, *ends)
    rows = [line.split(",")[:3] for line in marking.with_name("marks.csv").read_text().splitlines()[1:]]
    assert rows == [[f"{name}.py", "0", "fail"] for name in submitted]
    task = (folder / "exercises/hold/README.md").read_text()
    assert all(shlex.join(["yawbench", *command[1:]]) in task for command in (units, build))


OTHERS = {
    "driver": "driver_sine", "reference": "reference_steady_state", "tyre": "tyre_dugoff",
    "plant": "plant_seven_dof", "road": "road_patchwork",
}  # fmt: skip


@pytest.mark.exhaustive
def test_what_begins_of_any_kind_is_built_tested_run_and_judged(project):
    folder, _ = project
    for kind in (*OTHERS, "vehicle", "scenario", "study", "sweep"):
        done = run_in(folder, "yawbench", "new", kind, f"my_{kind}")
        assert done.returncode == 0, done.stderr
        _, *commands = [shlex.split(line) for line in done.stdout.splitlines()]
        for command in (c for c in commands if c[1] != "compare"):
            done = run_in(folder, *command)
            assert done.returncode == 0, done.stdout + done.stderr
        assert {"study": "holds", "sweep": "neural network"}.get(kind, "") in done.stdout
        if kind in OTHERS:
            run = load_results(folder / "results" / f"my_{kind}" / "25mps")
            assert run.record.fmus[kind].name == f"{kind}_my_{kind}"
            assert np.abs(run.find("yaw_rate")).max() > 0.01
            last = commands[-1]
            assert last[1:2] + last[-1:] == ["compare", f"{kind}={OTHERS[kind]},{kind}_my_{kind}"]


def test_only_controllers_begin_in_c(new):
    status, _, said = new("idea", "--language", "c", kind="tyre")
    assert status == 2
    assert each_mentions(said, ("--language c", "available"))


@pytest.mark.parametrize(
    ("language", "source"),
    [("python", {"idea.py"}), ("c", {"idea/idea.c", "idea/modelDescription.xml"})],
)
def test_a_controller_has_a_source_a_test_and_a_scenario_and_neither_language_overwrites(
    language, source, tmp_path, new
):
    new("idea", "--language", language)
    expected = {"tests/test_idea.py", "scenarios/idea/25mps.yaml", "scenarios/schemas/scenario.json"}
    expected |= {f"controllers/{name}" for name in source}
    assert files(tmp_path) == expected
    status, _, said = new("idea", "--language", "c" if language == "python" else "python")
    assert status == 2 and "tests/test_idea.py" in said
    assert files(tmp_path) == expected


@pytest.mark.exhaustive
def test_python_and_c_agree_in_the_closed_loop(project):
    folder, _ = project
    runs = [load_results(folder / "results" / name / "25mps") for name in ("follow", "follow_c")]
    assert np.abs(runs[0].columns["controller.yaw_moment"]).max() > 100.0
    for column, values in runs[0].columns.items():
        scale = max(np.ptp(values), 1.0)
        assert np.abs(runs[1].columns[column] - values).max() <= 1e-12 * scale, column


@pytest.mark.exhaustive
def test_in_a_checkout_the_files_stand_among_its_own_and_build_finds_them(tmp_path):
    checkout = copy_checkout(tmp_path / "checkout")
    inside = checkout / "scenarios"
    for name, language in (("idea", "python"), ("idea_c", "c")):
        done = run_in(inside, "yawbench", "new", "controller", name, "--language", language,
                      PYTHONPATH=str(checkout))  # fmt: skip
        assert done.returncode == 0, done.stderr
    assert (checkout / "components/controllers/idea.py").is_file()
    assert (checkout / "components/controllers/idea_c/idea_c.c").is_file()
    said = run_in(checkout, "yawbench", "build").stderr
    assert mentions(said, "controller_idea", "built")
    assert mentions(said, "controller_idea_c", "built")
    for name in ("idea", "idea_c"):
        done = run_in(checkout, "yawbench", "check", f"scenarios/{name}/25mps.yaml")
        assert done.returncode == 0, done.stderr
    tests = [f"tests/components/test_{name}.py" for name in ("idea", "idea_c")]
    assert "10 passed" in run_in(checkout, "python", "-m", "pytest", "-q", *tests).stdout
    shutil.rmtree(checkout / "components/controllers/idea_c")
    assert mentions(run_in(checkout, "yawbench", "build").stderr, "controller_idea_c", "removed")


def test_a_scenario_begins_as_another_whose_files_it_still_finds(tmp_path, new):
    assert new("mine", "--from", "tyre_file/lane_change", kind="scenario")[0] == 0
    copied = tmp_path / "scenarios/mine/lane_change.yaml"
    original = catalogue.find("tyre_file/lane_change", "a scenario")
    one, other = (load_scenario(path, read_tyre=read_tir) for path in (original, copied))
    for scenario, path in ((one, original), (other, copied)):
        assert (path.parent / scenario.vehicle).is_file()
    assert one.vehicle_file.values == other.vehicle_file.values
    assert [file.sha256 for file in one.tyre_files.values()] == [f.sha256 for f in other.tyre_files.values()]
    assert {name: unit.fmu for name, unit in one.units.items()} == {
        name: unit.fmu for name, unit in other.units.items()
    }
    assert new("other", "--from", "no/such", kind="scenario")[0] == 2
    assert new("other", "--from", "tyre_file/lane_change", kind="sweep")[0] == 2


def test_nothing_is_overwritten_and_nothing_is_written_beside_what_exists(tmp_path, new):
    scenario = tmp_path / "scenarios" / "idea" / "25mps.yaml"
    scenario.parent.mkdir(parents=True)
    scenario.write_text("mine")
    status, _, said = new("idea")
    assert status == 2
    assert each_mentions(said, ("scenarios/idea/25mps.yaml", "exists"))
    assert files(tmp_path) == {"scenarios/idea/25mps.yaml"}
    assert scenario.read_text() == "mine"


@pytest.mark.parametrize(
    ("name", "names"),
    [
        ("MyIdea", ("'my_idea'", "example")),
        ("my-idea", ("'my_idea'", "example")),
        ("2nd", ("letter",)),
        ("lambda", ("keyword", "Python")),
        ("../idea", ("'idea'", "example")),
        ("", ("letter",)),
        ("x" * 51, ("50",)),
        ("idéa", ("lower-case", "letters", "digits")),
        ("controller_idea", ("'controller'", "'idea'")),
        ("fnn", ("'fnn'", "controller", "exists")),
    ],
)
def test_a_name_that_cannot_be_is_refused_in_one_sentence(tmp_path, new, name, names):
    status, commands, said = new(name)
    assert (status, commands, files(tmp_path)) == (2, [], set())
    assert mentions(said, *names)
    assert said.count("\n") == 1


@pytest.mark.skipif(sys.platform == "win32", reason="needs a limit on the size of files")
def test_a_full_disk_leaves_no_part_of_a_file(new, tmp_path):
    import resource

    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (100, limits[1]))
    try:
        status, _, said = new("follow")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert status == 1 and said.strip()
    assert files(tmp_path) == set()
    assert new("follow")[0] == 0
