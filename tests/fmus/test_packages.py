"""Components of installed packages, and FMUs in folders that the environment names."""

from __future__ import annotations

import hashlib
import shutil
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from tests.commands.test_batch_commands import SCENARIO
from tests.fmus.test_rebuild_stale import without_native_libraries
from tests.refusals import each_mentions, mentions
from yawbench.fmus import opener
from yawbench.fmus.opener import HOME
from yawbench.orchestrator.results.reader import load_results

UNITS = ("driver_sine", "reference_steady_state", "controller_off", "controller_fuzzy_sideslip")
LAW = '''
"""A proportional law, with a gain from a file beside it."""

from yawbench.components.fmi.component import Component

from ._gains import GAIN


class Follow(Component):
    """Holds the yaw rate."""

    inputs = ("yaw_rate_ref",)
    outputs = ("yaw_moment",)

    def output(self, t, u):
        return (GAIN * u[0],)
'''
Install = Callable[..., Path]


@pytest.fixture
def install(tmp_path, monkeypatch, cache) -> Iterator[Install]:
    """Install a sample package, as an installer would leave it on Python's path."""
    without_native_libraries(monkeypatch)
    site = tmp_path / "site"
    site.mkdir()
    monkeypatch.syspath_prepend(site)

    def make(distribution: str = "my-laws", *, name: str = "follow", gain: float = 3.0, of: str = "") -> Path:
        package = distribution.replace("-", "_")
        controllers = site / package / "components" / "controllers"
        controllers.mkdir(parents=True)
        (controllers / f"{name}.py").write_text(LAW)
        (controllers / "_gains.py").write_text(f"GAIN = {gain}\n")
        info = site / f"{package}-1.0.dist-info"
        info.mkdir()
        (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {distribution}\nVersion: 1.0\n")
        (info / "entry_points.txt").write_text(f"[{opener.GROUP}]\nlaws = {of or f'{package}.components'}\n")
        opener.packaged_components.cache_clear()
        return controllers

    yield make
    opener.packaged_components.cache_clear()
    for module in [name for name in sys.modules if name.partition(".")[0] in ("my_laws", "your_laws")]:
        del sys.modules[module]


@pytest.fixture
def yawbench(yawbench, fmus, tmp_path, monkeypatch):
    """Run the command line in a folder with a scenario and its folder of FMUs."""
    work = tmp_path / "work"
    work.mkdir()
    shutil.copytree(fmus, work / "fmus")
    (work / "half.yaml").write_text(SCENARIO)
    monkeypatch.chdir(work)
    return yawbench


@pytest.fixture
def run(yawbench) -> Callable[..., tuple[int, str]]:
    """Run the scenario, or another command, with a controller; return the status and what is said."""

    def do(controller: str, *more: str, command: str = "run") -> tuple[int, str]:
        status, _, said = yawbench(command, "half.yaml", "--swap", f"controller={controller}", *more)
        return status, said

    return do


def refused(answer: tuple[int, str], *names: str) -> bool:
    """Assert that a run was wrong input, told in one line that names the swap and these things."""
    status, said = answer
    assert status == 2
    return each_mentions(said, ("--swap controller=", *names))


def gain_in(folder: str) -> float:
    """Return the ratio of the peaks of output and input of a run."""
    run = load_results(Path(folder))
    return float(abs(run.find("yaw_moment")).max() / abs(run.find("yaw_rate_ref")).max())


def test_a_component_of_a_package_is_found_built_and_built_again_when_a_file_beside_it_has_changed(
    install, run, cache
):
    controllers = install()
    status, said = run("controller_follow", "--out", "results/one")
    assert status == 0, said
    assert mentions(said.splitlines()[0], "controller_follow", "my")
    assert gain_in("results/one") == pytest.approx(3.0, rel=0.01)
    assert (cache / "fmus").is_dir()
    assert sorted(path.name for path in Path("fmus").iterdir()) == sorted(f"{name}.fmu" for name in UNITS)
    assert "built" not in run("controller_follow")[1]
    (controllers / "_gains.py").write_text("GAIN = 5.0\n")
    assert "controller_follow: built" in run("controller_follow", "--out", "results/two")[1]
    assert gain_in("results/two") == pytest.approx(5.0, rel=0.01)


def test_one_that_is_not_built_is_suggested_and_listed_and_told_how_to_build(install, run, yawbench):
    install()
    assert mentions(run("controller_folow")[1], "'controller_follow'")
    assert refused(
        run("controller_follow", "--no-build"),
        "controller_follow",
        "'yawbench build controller_follow'",
        "my",
    )
    status, out, said = yawbench("list", "fmus")
    assert status == 0
    assert mentions(out + said, "controller_follow", "yawbench build")  # which a list never does
    assert "controller_off" in out
    status, _, said = yawbench("build", "controller_follow")
    assert status == 0
    assert mentions(said, "controller_follow", "my")
    _, out, said = yawbench("list", "fmus")
    assert "controller_follow" in out
    assert "not built" not in out + said
    assert run("controller_follow", "--no-build")[0] == 0


def test_a_name_that_is_also_in_the_folder_is_told_and_the_folder_counts(install, run):
    install(name="off")
    status, said = run("controller_off", command="check")
    assert status == 0
    assert mentions(said, "note", "controller_off", "fmus", "the package my-laws")
    assert run("controller_off", "--out", "results/off")[0] == 0
    assert gain_in("results/off") == 0.0


def test_a_name_in_two_packages_is_refused(install, run):
    install()
    install("your-laws", gain=4.0)
    assert refused(run("controller_follow"), "controller_follow", "my", "your")


def test_an_entry_point_that_names_nothing_is_told_with_its_package(install, run):
    install(of="my_laws.parts")
    assert refused(run("controller_follow"), "'laws'", "yawbench.components", "'my_laws.parts'")


def test_folders_of_the_environment_come_after_the_nearest(run, yawbench, tmp_path, monkeypatch):
    first, second = tmp_path / "first", tmp_path / "second"
    first.mkdir()
    second.mkdir()
    shutil.copy("fmus/controller_off.fmu", first / "controller_mine.fmu")
    shutil.copy("fmus/controller_fuzzy_sideslip.fmu", second / "controller_mine.fmu")
    shutil.copy("fmus/controller_off.fmu", second / "controller_off.fmu")
    monkeypatch.setenv(opener.FOLDERS, f"{first}:{second}")
    status, said = run("controller_mine", "--out", "results/mine")
    assert status == 0
    assert mentions(said, "note", "controller_mine", "/first", "second")
    assert gain_in("results/mine") == 0.0
    _, said = run("controller_off", command="check")
    assert mentions(said, "note", "controller_off", "fmus", "/second")
    assert "controller_mine" in yawbench("list", "fmus")[1]


def test_a_folder_of_the_environment_that_is_not_there_is_told(run, tmp_path, monkeypatch):
    monkeypatch.setenv(opener.FOLDERS, str(tmp_path / "nothing"))
    assert refused(run("controller_mine"), "YAWBENCH_FMUS", "nothing")


def test_nothing_is_searched_where_every_name_is_in_the_folder(yawbench, monkeypatch):
    monkeypatch.setattr(opener, "packaged_components", None)
    assert yawbench("run", "half.yaml")[0] == 0


def test_a_folder_with_a_suppliers_fmu_alone_is_enough(run, tmp_path, fmus):
    folder = tmp_path / "work" / "fmus"
    shutil.rmtree(folder)
    folder.mkdir()
    shutil.copy(fmus / "controller_off.fmu", folder / "controller_bought.fmu")
    assert run("controller_bought", "--out", "out")[0] == 0
    used = {fmu.name: fmu.sha256 for fmu in load_results(Path("out")).record.fmus.values()}
    places = {name: (folder if name == "controller_bought" else HOME) / f"{name}.fmu" for name in used}
    assert used == {name: hashlib.sha256(file.read_bytes()).hexdigest() for name, file in places.items()}
    status, told = run("controller_offf")
    assert status == 2
    assert mentions(told, "'controller_offf'", "'controller_off'?")
    assert "controller_bought" not in told
    status, told = run("xyz")
    assert status == 2
    assert 0 < sum(fmu.stem in told for fmu in HOME.glob("*.fmu")) < 15
