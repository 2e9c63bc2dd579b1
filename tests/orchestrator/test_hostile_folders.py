"""Folders of results from somebody else: with links, foreign names and `..`, for every command.

Whatever stands in such a folder, nothing outside it changes, and what only reads changes nothing at all.
"""

from __future__ import annotations

import json
import os
import re
import shutil
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import pytest
from lxml import html

import yawbench as yb
from tests.orchestrator import recorded
from tests.refusals import mentions, refused
from tests.trees import snapshot
from yawbench.foundation.errors import ResultsError, YawbenchError
from yawbench.foundation.safe_files import LOCK_FILE, NEW
from yawbench.orchestrator.results.folder_lock import FolderLock, holder_of
from yawbench.orchestrator.results.folder_names import below_results
from yawbench.orchestrator.results.salvage import salvage

UNITS = ("driver_sine", "reference_steady_state", "controller_off", "controller_fuzzy_sideslip")

SCENARIO = """
title: Half a car
stop_time: 0.1
step_size: 0.01
inputs: {velocity_x: 20, friction: 0.7, sideslip: 0.001, sideslip_rate: 0}
units:
  driver:     {fmu: driver_sine, parameters: {frequency: 2, start_time: 0}}
  reference:  {fmu: reference_steady_state}
  controller: {fmu: controller_fuzzy_sideslip}
"""
STUDY = """
title: Half a paper
runs:
  - {name: a/off, scenario: base.yaml, swap: {controller: controller_off}}
  - {name: b, scenario: base.yaml}
metrics: {moment: {metric: peak(yaw_moment)}}
claims:
  - {says: There is no moment., holds_if: [{run: a/off, metric: moment, at_most: 0}]}
figures:
  - {name: moments, runs: ["*"], panels: [yaw_moment]}
"""
SWEEP = """
title: Half a sweep
scenario: base.yaml
axes: {speed: {vary: inputs.velocity_x, values: [20, 25]}}
metrics: {moment: {metric: peak(yaw_moment)}}
"""
TUNING = """
title: How far to turn
runs: [{name: turned, scenario: base.yaml}]
metrics: {steer: {metric: peak(steer_angle)}}
derived:
  miss:
    says: Distance
    expression: (turned - 0.03) * (turned - 0.03)
    of: {turned: {run: turned, metric: steer}}
tuning:
  {objective: miss, population: 5, generations: 1, seed: 2,
   laws: {wheel: {swap: {driver: driver_sine},
                  axes: {angle: {vary: driver.amplitude, from: 0.5, to: 5, unit: deg}}}}}
"""
FILES = {"base.yaml": SCENARIO, "study.yaml": STUDY, "sweep.yaml": SWEEP, "tuning.yaml": TUNING}

MAKES = {
    "run": ("base.yaml",),
    "compare": ("base.yaml", "--swap", "controller=controller_off"),
    "converge": ("base.yaml", "--signal", "reference.yaw_rate_ref", "--halvings", "2"),
    "study": ("study.yaml", "--jobs", "1"),
    "report": ("study.yaml", "--jobs", "1"),
    "sweep": ("sweep.yaml", "--jobs", "1", "--keep"),
    "tune": ("tuning.yaml", "--jobs", "1"),
}
"""Commands that make runs -> what they are called with, but for --out."""
READS = {
    "list": ("list", "runs", "."),
    "diff": ("diff", "theirs", "good"),
    "plot": ("plot", "theirs", "--panel", "yaw_rate"),
    "animate": ("animate", "theirs", "good"),
    "evaluate": ("evaluate", "step-steer", "."),
}
"""Commands that read results. The first two read as all do; the others are tried on what stands where they
write."""
NAMES = ["overview.svg", "overview.png", "view.html", "evaluation.json", "step_steer.svg", "step_steer.png"]
PRODUCTS = [f"{above}{name}" for above in ("", "../") for name in NAMES]
"""Files that those write where results are."""
DRAFTS = [f"{name}{NEW}" for name in PRODUCTS]

pytestmark = pytest.mark.skipif(os.name == "nt", reason="links need a privilege here")


@pytest.fixture
def home(tmp_path: Path) -> Path:
    """A folder of somebody's own, beside the one that is worked in."""
    folder = tmp_path / "home"
    folder.mkdir()
    for name in (".bashrc", ".bashrc.part", "run.json", "results.csv", "precious"):
        (folder / name).write_text("own\n")
    return folder


@pytest.fixture
def work(tmp_path: Path, home: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder that is worked in, with good results and their like from somebody else."""
    folder = tmp_path / "work"
    folder.mkdir()
    for name in ("good", "theirs"):
        recorded.write(recorded.car(), folder / name)
    monkeypatch.chdir(folder)
    return folder


each_command = pytest.mark.parametrize(
    "command",
    [
        pytest.param(command, marks=[pytest.mark.exhaustive] * (command in ("compare", "report")))
        for command in MAKES
    ],
)
"""Those that draw and write as `study` does are for the second tier."""


def plant(
    folder: Path, home: Path, died: dict[str, str] | None = None, links: dict[str, str] | None = None,
    names: Iterable[str] = (), pipes: Iterable[str] = (), part: str = "",
) -> None:  # fmt: skip
    """Leave the record of a dead run and a part of it, links to files at home, other names of one, pipes."""
    if died:
        text = json.dumps({**json.loads((folder / "run.json").read_text()), **died})
        (folder / "run.json.part").write_text(text.replace("HOME", str(home)))
    for name, target in (links or {}).items():
        (folder / name).symlink_to(home / target)
    for name in names:
        os.link(home / "precious", folder / name)
    for name in pipes:
        os.mkfifo(folder / name)
    if part:
        shutil.copy(folder / "results.csv", folder / f"{part}.part")


COMPLETED, FAILED, RUNNING = ({"status": one} for one in ("completed", "failed", "running"))
ELSEWHERE = {"failed": "."}
PLANTS: dict[str, dict[str, Any]] = {
    "results elsewhere": {"died": {**FAILED, "results": ".bashrc"}, "links": ELSEWHERE, "part": ".bashrc"},
    "results by a path": {"died": {**COMPLETED, "results": "HOME/.bashrc"}},
    "results above": {"died": {**COMPLETED, "results": "../../home/.bashrc"}},
    "failed elsewhere": {"died": COMPLETED, "links": ELSEWHERE, "part": "results.csv"},
    "failed into a link": {"died": FAILED, "links": ELSEWHERE},
    "parts are links": {"links": {f"{name}.part": name for name in ("run.json", "results.csv")}},
    "died": {"died": RUNNING, "links": {"results.csv.part": "results.csv"}},
    "lock is a link": {"links": {LOCK_FILE: "precious"}},
    "lock has another name": {"names": [LOCK_FILE]},
    "lock of a dead run is a link": {"died": RUNNING, "links": {LOCK_FILE: "precious"}},
    "a pipe for the lock": {"pipes": [LOCK_FILE, "run.json.part"]},
    "products are links": {"links": dict.fromkeys(PRODUCTS, "precious")},
    "drafts are links": {"links": dict.fromkeys(DRAFTS, "precious")},
    "drafts have another name": {"names": DRAFTS},
}


def without_products(tree: dict[str, tuple[int, int, object]]) -> dict[str, object]:
    """Return a tree but for files that a reading command makes, and for the times of folders they are in."""
    made = {*NAMES, *(f"{name}{NEW}" for name in NAMES)}
    return {
        path: (mode, None if os.path.isdir(path) else time, content)
        for path, (mode, time, content) in tree.items()
        if os.path.basename(path) not in made
    }


@pytest.mark.parametrize(
    ("command", "what"),
    [(one, what) for one in READS for what in PLANTS if one in ("list", "diff") or what[:2] in ("pr", "dr")],
)
def test_a_command_that_reads_changes_nothing_but_its_own_product(command, what, work, home, yawbench):
    plant(work / "theirs", home, **PLANTS[what])
    outside, inside = snapshot(home), without_products(snapshot(work))
    status, _, said = yawbench(*READS[command])
    assert status in (0, 1, 2)
    assert status == 0 or said
    assert "error in yawbench" not in said
    assert snapshot(home) == outside
    assert without_products(snapshot(work)) == inside


each_plant = pytest.mark.parametrize("planted", PLANTS.values(), ids=PLANTS)


@each_plant
def test_the_library_reads_without_changing_anything(planted, work, home):
    plant(work / "theirs", home, **planted)
    before = snapshot(work, home)
    try:
        yb.open("theirs").metrics()
    except YawbenchError as error:
        assert "theirs" in str(error)
    assert snapshot(work, home) == before


@each_plant
def test_salvage_and_the_next_run_repair_inside_the_folder_alone(planted, work, home):
    plant(work / "theirs", home, **planted)
    before = snapshot(home, work / "good")
    try:
        place, _ = salvage(work / "theirs")
        assert place in (work / "theirs", work / "theirs" / "failed")
        assert not place.is_symlink()
    except ResultsError as error:
        assert "theirs" in str(error)
    assert snapshot(home, work / "good") == before
    try:
        yb.open("good").save("theirs")
    except ResultsError as error:
        assert mentions(str(error), "theirs", "results")
    else:
        left = {path.name for path in (work / "theirs").iterdir()}
        assert not left & {"run.json.part", "results.csv.part", LOCK_FILE}
    assert snapshot(home, work / "good") == before


def test_what_a_dead_run_left_is_shown_and_neither_removed_nor_moved(work, home, yawbench):
    plant(work / "theirs", home, **PLANTS["results elsewhere"])
    before = snapshot(work)
    status, out, _ = yawbench("list", "runs", "theirs")
    assert status == 0
    assert "died" in out
    assert snapshot(work) == before


def test_looking_who_holds_a_folder_changes_nothing_there(work):
    lock = FolderLock(work / "theirs")
    before = snapshot(work)
    assert f"process {os.getpid()} " in holder_of(work / "theirs")
    assert snapshot(work) == before
    lock.release()


def test_a_link_is_replaced_by_the_figure_unless_the_user_names_it(work, home, yawbench):
    plant(work / "theirs", home, **PLANTS["products are links"])
    (work / "page.html").symlink_to(home / "page.html")
    assert yawbench("plot", "theirs", "--panel", "yaw_rate")[0] == 0
    assert yawbench("animate", "theirs")[0] == 0
    assert yawbench("animate", "theirs", "--out", "page.html")[0] == 0
    assert (home / "precious").read_text() == "own\n"
    for name in ("overview.svg", "overview.png", "view.html"):
        assert not (work / "theirs" / name).is_symlink()
        assert (work / "theirs" / name).stat().st_size > 1000
    assert (work / "page.html").is_symlink()
    assert (home / "page.html").stat().st_size > 1000


@pytest.mark.parametrize(
    ("note", "told"), [(b"", "another run"), (b"\x1b[31m\xff", "\\x1b[31m"), (b"[" * 100_000, "[[...")]
)
def test_a_lock_that_says_nonsense_is_told_in_a_few_printable_words(note, told, work):
    lock = FolderLock(work / "theirs")
    (work / "theirs" / LOCK_FILE).write_bytes(note)
    holder = holder_of(work / "theirs")
    assert told in holder
    assert len(holder) <= 200
    lock.release()


@pytest.fixture
def projects(tmp_path: Path, work: Path, fmus: Path, yawbench: Callable[..., tuple[int, str, str]]):
    """Run a command that makes runs into a folder; return status and words."""
    for name, text in FILES.items():
        (work / name).write_text(text)

    def call(command: str, *more: object) -> tuple[int, str]:
        status, _, said = yawbench(command, *MAKES[command], "--fmus", fmus, *more)
        assert status in (0, 1, 2)
        assert "error in yawbench" not in said
        assert "Traceback" not in said
        return status, said

    return call


@pytest.fixture(scope="module")
def known() -> dict[str, dict[Path, bool]]:
    """Command -> what it makes in its folder of results, and whether it is a file, once it was called."""
    return {}


@pytest.fixture
def products(command, projects, work, known, monkeypatch):
    """Return what a command makes of a file above, below `results` and nowhere else; whether it is a file."""
    if command not in known:
        (work / "sub").mkdir()
        before = snapshot(work)
        with monkeypatch.context() as there:
            there.chdir(work / "sub")
            there.setitem(MAKES, command, (f"../{MAKES[command][0]}", *MAKES[command][1:]))
            assert projects(command)[0] == 0
        outside = {path for path in snapshot(work) if not Path(path).is_relative_to(work / "sub")}
        assert {path: snapshot(work)[path] for path in outside} == {path: before[path] for path in outside}
        (made,) = (work / "sub" / "results").iterdir()
        assert made.name == work.name
        (made,) = made.iterdir()
        known[command] = {path.relative_to(made): path.is_file() for path in sorted(made.rglob("*"))}
    return known[command]


@pytest.fixture
def links(products, work, home):
    """Plant links out of the folder in place of all files that a command makes, or of their drafts."""

    def put(name: str, *suffixes: str) -> Path:
        folder = work / name
        folder.mkdir()
        for number, path in enumerate(path for path, is_file in products.items() if is_file):
            (folder / path).parent.mkdir(parents=True, exist_ok=True)
            for suffix in suffixes:
                target = home / f"{name}{number}{suffix}"
                target.write_text("own\n")
                (folder / f"{path}{suffix}").symlink_to(target)
        return folder

    return put


@each_command
def test_a_command_that_makes_runs_follows_no_link_where_it_writes(command, projects, products, links, home):
    folder = links("links", "")
    before = snapshot(home)
    status, said = projects(command, "--out", "links")
    assert snapshot(home) == before
    if Path("runs.jsonl") in products:  # a journal is gone on with, not replaced
        assert status == 2
        assert mentions(said, "runs.jsonl", "symbolic", "link")
        (folder / "runs.jsonl").unlink()
        status, said = projects(command, "--out", "links")
    assert status == 0, said
    assert snapshot(home) == before
    assert not [path for path in folder.rglob("*") if path.is_symlink()]


@pytest.mark.parametrize(
    "command",
    [one if one in ("run", "sweep") else pytest.param(one, marks=pytest.mark.exhaustive) for one in MAKES],
)
def test_nor_where_it_writes_drafts_and_folders(command, projects, products, links, work, home):
    links("drafts", NEW, ".part")
    before = snapshot(home)
    projects(command, "--out", "drafts")
    assert snapshot(home) == before

    for number, path in enumerate(path for path, is_file in products.items() if not is_file):
        place = work / f"folder{number}"
        (place / path.parent).mkdir(parents=True)
        (home / f"folder{number}").mkdir()
        (place / path).symlink_to(home / f"folder{number}", target_is_directory=True)
        before = snapshot(home)
        status, said = projects(command, "--out", place)
        assert snapshot(home) == before
        said = re.sub(r"speed \d+ m/s", "speed <level>", said)  # in the order of keys, which are hashes
        assert mentions(said, "symbolic", "link", path.name)

    (work / "locked").mkdir()
    (work / "locked" / LOCK_FILE).symlink_to(home / "precious")
    before = snapshot(home)
    status, said = projects(command, "--out", "locked")
    assert status == 2
    assert mentions(said, "locked", "results", "symbolic")
    assert snapshot(home) == before


@pytest.mark.parametrize("command", ["run", "study"])
def test_results_of_a_file_above_go_below_results(command, projects, work, monkeypatch):
    sub = work / "sub"
    sub.mkdir()
    (work / "base").mkdir()
    (work / "base" / "results.csv").write_text("own\n")
    before = snapshot(work)
    monkeypatch.chdir(sub)
    file, *more = MAKES[command]
    monkeypatch.setitem(MAKES, command, (f"../{file}", *more))
    assert projects(command)[0] == 0
    after = snapshot(work)
    others = {path for path in after if not Path(path).is_relative_to(sub)}
    assert {path: after[path] for path in others} == {path: before[path] for path in others}
    assert [folder.name for folder in (sub / "results").iterdir()] == [work.name]


def test_results_of_several_files_go_below_the_folder_given(projects, work, monkeypatch):
    sub = work / "sub"
    sub.mkdir()
    monkeypatch.chdir(sub)
    (work / "other.yaml").write_text(STUDY)
    monkeypatch.setitem(MAKES, "report", ("../study.yaml", "../other.yaml", "--jobs", "1"))
    before = snapshot(work)
    assert projects("report", "--out", "all")[0] == 0
    assert {path for path in snapshot(work) if not Path(path).is_relative_to(sub)} == {
        path for path in before if not Path(path).is_relative_to(sub)
    }
    assert sorted(path.name for path in (sub / "all" / work.name).iterdir()) == ["other", "study"]


def test_results_may_be_a_link_and_nothing_below_it(work, home, projects):
    (home / "disk").mkdir()
    (work / "results").symlink_to(home / "disk")
    assert projects("run")[0] == 0
    assert (home / "disk" / "work" / "base" / "results.csv").is_file()
    shutil.rmtree(home / "disk" / "work")
    (home / "disk" / "work").symlink_to(home)
    before = snapshot(home)
    status, said = projects("run")
    assert status == 2
    assert mentions(said, "results/work", "symbolic", "results")
    assert snapshot(home) == before
    with pytest.raises(ResultsError, match="symbolic link"):
        below_results("work", "other")


def test_only_names_of_our_formats_are_put_in_place(work):
    folder = work / "theirs"
    (folder / "notes.part").write_text("theirs\n")
    plant(folder, work, {**COMPLETED, "results": "notes"})
    with refused(ResultsError, "run-died", names=("theirs", "yawbench salvage")):
        yb.open(folder)
    assert salvage(folder)[1] == 0
    assert sorted(path.name for path in folder.iterdir()) == ["notes.part", "results.csv", "run.json"]
    assert yb.open(folder).time[-1] == 8.0


def test_results_are_read_through_links(work):
    data = work / "data"
    data.mkdir()
    for name in ("run.json", "results.csv"):
        (work / "theirs" / name).rename(data / name)
        (work / "theirs" / name).symlink_to(data / name)
    before = snapshot(work)
    assert yb.open("theirs").time.size == 801
    assert snapshot(work) == before


def test_a_page_of_foreign_results_loads_nothing_and_runs_no_script_of_theirs(work, yawbench):
    evil = "</script><script src='http://e.vil/x.js'></script><img src=x onerror=alert(1)>"
    good = json.loads((work / "good" / "run.json").read_text())
    scenario = {"title": evil, "source": evil, "file": evil, "parameters": {evil: evil}}
    theirs = {**good, "title": evil, "scenario": scenario, "versions": {evil: evil}, "notes": [evil]}
    theirs["fmus"] = {evil: good["fmus"]["plant"], "plant": {**good["fmus"]["plant"], "name": evil}}
    (work / "theirs" / "run.json").write_text(json.dumps(theirs))
    (work / "study.yaml").write_text(
        "title: Theirs\nruns: [{name: theirs, scenario: no.yaml}, {name: good, scenario: no.yaml}]\n"
        "metrics: {sideslip: {metric: peak(sideslip)}}\n"
        "figures: [{name: overlay, runs: ['*'], panels: [sideslip]}]\n"
    )
    labels = ("--label", evil, "--label", "good")
    assert yawbench("animate", "theirs", "good", *labels, "--out", "a.html")[0] == 0
    yawbench("study", "study.yaml", "--no-run", "--jobs", "1", "--out", ".")
    assert yawbench("plot", "theirs", "--label", evil, "--panel", "yaw_rate")[0] == 0
    for name in ("a.html", "report.html"):
        page = html.parse(str(work / name))
        assert not [one for one in page.iter("script") if one.get("src")]
        assert not page.xpath("//@onerror | //iframe | //object | //embed | //form | //base")
        links = page.xpath("//@src | //@href | //@srcset | //@poster | //@action | //@data")
        assert not [one for one in links if not one.startswith(("data:", "#")) and ":" in one]
        assert "url(http" not in re.sub("['\"]", "", (work / name).read_text())
