"""Folders of results from somebody else, read by all that reads: `python -m campaigns.result_folders`.

    python -m campaigns.result_folders            # all of them
    python -m campaigns.result_folders --every 20

Each folder is that of a good run with one thing altered: a value in run.json or in a part of it, a file
that is a link, a pipe or cut off, another name, size or time. What must hold for each command: exit status 0,
1 or 2, a sentence unless it is 0, never a traceback, no control character; nothing in the folder is written,
nothing outside it changes.
"""

from __future__ import annotations

import argparse
import contextlib
import copy
import io
import itertools
import json
import os
import shutil
import signal
import sys
import tempfile
import traceback
import zlib
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yawbench as yb
from tests.orchestrator import recorded
from tests.trees import snapshot
from yawbench.cli import main as yawbench
from yawbench.foundation.errors import YawbenchError
from yawbench.foundation.messages import printable
from yawbench.foundation.safe_files import LOCK_FILE
from yawbench.orchestrator.results.file_formats import FILES
from yawbench.orchestrator.results.recorder import write_results

from .child import working_in

LIMIT = 60.0
"""Processor time that a command may take [s]; chosen: a hundred times what one takes."""

STUDY = """
title: What somebody sent
runs: [{name: theirs, scenario: nowhere.yaml}]
metrics: {sideslip: {metric: peak(sideslip)}}
tables: [{title: Peaks, runs: ["*"], metrics: [sideslip]}]
claims: [{says: It holds., holds_if: [{run: theirs, metric: sideslip, at_most: 5 deg}]}]
figures: [{name: overlay, runs: ["*"], panels: [sideslip]}]
"""

EVERY_TIME: dict[str, tuple[str, ...]] = {
    "list runs": ("list", "runs", "theirs"),
    "diff": ("diff", "good", "theirs"),
}
"""Commands that every folder is given to; the library's `open` is another."""
IN_TURN: dict[str, tuple[str, ...]] = {
    "plot": ("plot", "theirs", "--panel", "sideslip", "--out", "made"),
    "animate": ("animate", "theirs", "good", "--out", "made/page.html"),
    "evaluate": ("evaluate", "step-steer", "theirs", "--no-figures", "--out", "made"),
    "evaluate below": (
        *("evaluate", "sine-with-dwell", ".", "--angle", "30 deg"),
        *("--no-figures", "--out", "made"),
    ),
    "study": ("study", "study.yaml", "--no-run", "--jobs", "1", "--out", "."),
}
"""Commands that take longer: every folder is given to one of them."""

VALUES: dict[str, Any] = {
    "nothing": None, "true": True, "minus one": -1, "minus zero": -0.0, "a half": 0.5, "huge": 1e308,
    "many digits": 10**40,
    "not a number": float("nan"), "endless": float("inf"), "number as text": "12", "no text": "",
    "long text": "x" * 100_000, "escape": "\x1b[31m\x07", "turned": "\u202egpj.exe",
    "lone surrogate": "\ud800",
    "markup": "<script>alert(1)</script>", "dollars": r"$\frac{", "above": "../../home/.bashrc",
    "absolute": "/etc/passwd", "device": "/dev/zero", "zero byte": "a\0b", "list": [],
    "list of lists": [[[]]],
    "mapping": {}, "mapping of nothing": {"": None}, "other unit": "deg", "date": "9999-99-99T99:99:99",
}  # fmt: skip


@dataclass(frozen=True)
class Case:
    """A folder of results: a name that tells it again, and what is altered in the folder of a good run."""

    name: str
    alter: Callable[[Path], None]


@dataclass
class Tally:
    """Counts of the outcomes of the folders."""

    folders: int = 0
    calls: Counter[str] = field(default_factory=Counter)  # what was made of them -> how often
    notes: list[str] = field(default_factory=list)  # what did not hold


def whole_record() -> dict[str, Any]:
    """Return a record with every part that a run may write, each with something in it."""
    units = recorded.run_record({"time": "s", **recorded.UNITS, "driver.steering_wheel_angle": "rad"})
    fmu = {
        "name": "plant_made_up", "file": "plant_made_up.fmu", "sha256": "0123456789" * 6, "guid": "{0}",
        "generation_tool": "by hand", "fmi_version": "2.0", "built": None, "step_size": 0.01,
        "tolerance": None,
        "parameters": {"mass": 1500.0}, "origins": {"mass": "vehicle"}, "defaults": {"mass": 1400.0},
        "constants": {"friction": 1.0}, "series": {"wind": {"file": "wind.csv", "sha256": "0",
        "column": "w"}},
    }  # fmt: skip
    return units | {
        "id": "3446bfa3df41", "key": "98b86a4f4f6baa3be335e193295c8de6",
        "started": "2026-01-01T00:00:00+00:00",
        "start_time": 0.0, "stop_time": 8.0, "ended": None,
        "error": {"message": "it failed", "unit": "plant", "time": 1.0}, "results": "results.csv",
        "evaluation_order": ["controller", "plant"], "texts": [], "fmus": {"plant": fmu, "controller": fmu},
        "changes": [{"place": "plant.mass", "value": 1500.0, "origin": "--set", "plain": 1500.0}],
        "faults": [{"on": "plant.yaw_rate", "fault": "freeze", "from": 1.0, "until": None}],
        "findings": [{"kind": "spin", "place": "plant", "value": 1.0, "time": 2.0, "says": "the car spins"}],
        "warnings": [{"unit": "plant", "time": 0.0, "text": "slow", "status": "Warning"}], "more_warnings": 0,
        "notes": ["a note"], "units_freed": True,
        "scenario": {
            "title": "Sine", "source": "paper", "file": "scenarios/a/b.yaml", "vehicle": {"file": "car.yaml"},
            "parameters": {"plant.mass": {"value": 1500.0, "origin": "vehicle"}},
        },
        "versions": {"python": "3.11", "yawbench": "0.1.0", "numpy": "2.0", "orchestrator": "sources 0"},
    }  # fmt: skip


def make_good(folder: Path) -> None:
    """Write the results of a good run, with a whole record."""
    car = recorded.car(n=81)
    car.columns["driver.steering_wheel_angle"] = 16.0 * car["driver.steer_angle"]
    car.units["driver.steering_wheel_angle"] = "rad"
    recorded.noted(car, **whole_record())
    write_results(car, folder)


Place = tuple[str | int, ...]


def places(value: Any, above: Place = ()) -> Iterator[Place]:
    """Yield the place of every value in a record; of many in a list or of columns the first two."""
    children: Iterable[tuple[str | int, Any]] = ()
    if isinstance(value, dict):
        children = list(value.items())[: 2 if above in (("units",), ("smallest",), ("largest",)) else None]
    elif isinstance(value, list):
        children = list(enumerate(value))[:2]
    for key, child in children:
        yield (*above, key)
        yield from places(child, (*above, key))


def _in_record(change: Callable[[Any, str | int], None], place: Place, name: str) -> Callable[[Path], None]:
    def alter(folder: Path) -> None:
        record = json.loads((folder / "run.json").read_text())
        parent = record
        for key in place[:-1]:
            parent = parent[key]
        change(parent, place[-1])
        (folder / name).write_text(json.dumps(record))

    return alter


def _set(value: Any) -> Callable[[Any, str | int], None]:
    def change(parent: Any, key: str | int) -> None:
        parent[key] = copy.deepcopy(value)

    return change


def _drop(parent: Any, key: str | int) -> None:
    del parent[key]


def _rename(parent: Any, key: str | int) -> None:
    if isinstance(parent, dict):
        parent[f"{key}\x1b"] = parent.pop(key)
    else:
        parent.insert(0, parent)  # a list in itself cannot be written
        parent[0] = list(parent[1:])


def cases() -> list[Case]:
    """Return all folders."""
    found: list[Case] = []
    for place in places(whole_record() | {"rows": 1, "size": 1, "smallest": {"a.b": 0.0}}):
        shown = ".".join(map(str, place))
        if place[0] == "smallest" and len(place) > 1:
            place = ("smallest", "plant.sideslip")
        for name, value in VALUES.items():
            found.append(Case(f"{shown}: {name}", _in_record(_set(value), place, "run.json")))
        found.append(Case(f"{shown}: left out", _in_record(_drop, place, "run.json")))
        found.append(Case(f"{shown}: renamed", _in_record(_rename, place, "run.json")))
    for status, name in itertools.product(("running", "completed", "failed", "died", "x"), VALUES):
        for key in ("results", "started", "scenario"):  # of a run that has died
            change = _both(_in_record(_set(VALUES[name]), (key,), "run.json.part"), status)
            found.append(Case(f"run.json.part, {status}, {key}: {name}", change))
    return [*found, *_of_files()]


def _both(alter: Callable[[Path], None], status: str) -> Callable[[Path], None]:
    def change(folder: Path) -> None:
        alter(folder)
        record = json.loads((folder / "run.json.part").read_text())
        (folder / "run.json.part").write_text(json.dumps(record | {"status": status}))
        shutil.copy(folder / "results.csv", folder / "results.csv.part")
        (folder / "failed").symlink_to("../home")

    return change


NAMES = (
    "run.json", "results.csv", "run.json.part", "results.csv.part", "run.json.new", LOCK_FILE, "failed",
    "results.parquet", "results.parquet.part", "overview.svg", "view.html",
    "evaluation.json",
)  # fmt: skip
"""Files that a command may look for in a folder."""
TARGETS = {
    "a file of one's own": "../home/.bashrc", "results of one's own": "../home/results.csv",
    "a record of one's own": "../home/run.json", "a folder of one's own": "../home", "nothing": "nowhere",
    "itself": None, "a device": "/dev/zero", "the folder": ".",
}  # fmt: skip


def _of_files() -> Iterator[Case]:
    for name, (what, target) in itertools.product(NAMES, TARGETS.items()):
        yield Case(
            f"{name} is a link to {what}", _replaced(name, lambda p, t=target: p.symlink_to(t or p.name))
        )
    for name in NAMES:
        for what, make in {
            "a pipe": os.mkfifo,
            "a folder": os.mkdir,
            "empty": lambda path: path.write_bytes(b""),
            "zeros": lambda path: path.write_bytes(bytes(100_000)),
            "random": lambda path: path.write_bytes(bytes(range(256)) * 50),
            "a list": lambda path: path.write_bytes(b"[1, 2]"),
            "nested": lambda path: path.write_bytes(b"[" * 200_000),
            "no UTF-8": lambda path: path.write_bytes(b'{"title": "\xff\xfe"}'),
            "hundreds of gigabytes": lambda path: _sparse(path, 300_000_000_000),
            "another name of a file of one's own": lambda path: os.link(
                path.parent.parent / "home/.bashrc", path
            ),
        }.items():
            yield Case(f"{name} is {what}", _replaced(name, make))
    for name, times in itertools.product(
        ("run.json", "results.csv", "."), ((0, 0), (2**31, 2**31), (2**33, 2**33), (-1, -1))
    ):
        yield Case(f"{name} of time {times[0]}", lambda folder, n=name, t=times: os.utime(folder / n, t))
    for name in ("run.json", "results.csv"):
        for k in range(20):
            yield Case(f"{name} cut at {k} of 20", lambda folder, n=name, k=k: _cut(folder / n, k / 20))
    for name in ("\x1b[31m", "\u202egpj", "a\nb", "x" * 250, "run.json.part.new", "..part", "$HOME", "-rf"):
        yield Case(f"a file called {name!r}"[:60], lambda folder, n=name: (folder / n).write_text("theirs"))
        yield Case(f"a folder of results called {name!r}"[:60], lambda folder, n=name: _below(folder, n))
    for name, line in {
        "time twice": "time,time\n0,0\n", "no time": "a,b\n1,2\n",
        "backwards": "time,plant.sideslip\n1,0\n0,0\n",
        "text": "time,plant.sideslip\n0,\x1b[31m\n", "more cells": "time,plant.sideslip\n0,1,2,3\n",
        "not a number": "time,plant.sideslip\nnan,nan\n", "no rows": "time,plant.sideslip\n",
        "names of control": "time,\x1b[31m.\u202e\n0,1\n", "quotes": 'time,"a\nb.c"\n0,1\n',
        "endless": "time,plant.sideslip\n0,inf\n1,-inf\n", "a formula": 'time,"=cmd|x"\n0,1\n',
    }.items():  # fmt: skip
        yield Case(f"results.csv: {name}", lambda folder, text=line: _own_results(folder, text))
    for name in FILES.values():
        for other in FILES.values():
            yield Case(f"{name} called {other}", lambda folder, n=name, o=other: _called(folder, n, o))


def _replaced(name: str, make: Callable[[Path], Any]) -> Callable[[Path], None]:
    def alter(folder: Path) -> None:
        (folder / name).unlink(missing_ok=True)
        make(folder / name)

    return alter


def _sparse(path: Path, size: int) -> None:
    with path.open("wb") as stream:
        stream.truncate(size)


def _cut(path: Path, share: float) -> None:
    os.truncate(path, int(path.stat().st_size * share))


def _below(folder: Path, name: str) -> None:
    (folder / name).mkdir()
    for file in ("run.json", "results.csv"):
        shutil.copy(folder / file, folder / name)


def _own_results(folder: Path, text: str) -> None:
    record = json.loads((folder / "run.json").read_text())
    del record["size"]
    (folder / "run.json").write_text(json.dumps(record))
    (folder / "results.csv").write_text(text)


def _called(folder: Path, name: str, other: str) -> None:
    results = yb.open(folder).results
    for file in folder.iterdir():
        file.unlink()
    form = next(form for form, file in FILES.items() if file == name)
    write_results(results, folder, format=form)
    record = json.loads((folder / "run.json").read_text())
    (folder / "run.json").write_text(json.dumps(record | {"results": other}))
    (folder / name).rename(folder / other)


def trial(chosen: Iterable[Case], folder: Path) -> Tally:
    """Give each of the chosen folders to the commands, in an empty folder to work in."""
    home = folder / "home"
    home.mkdir()
    for name in (".bashrc", ".bashrc.part", "run.json", "results.csv"):
        (home / name).write_text("own\n")
    make_good(folder / "good")
    make_good(folder / "template")
    (folder / "study.yaml").write_text(STUDY)
    tally = Tally()
    turns = list(IN_TURN)
    with working_in(folder):
        for case in chosen:
            theirs = folder / "theirs"
            shutil.copytree(folder / "template", theirs)
            case.alter(theirs)
            before = snapshot(theirs, home, folder / "good")
            turn = turns[zlib.crc32(ascii(case.name).encode()) % len(turns)]
            for command, arguments in (*EVERY_TIME.items(), (turn, IN_TURN[turn])):
                _judge(tally, case, command, lambda a=arguments: _called_with(a))
                _compare(tally, case, command, before, snapshot(theirs, home, folder / "good"))
            _judge(tally, case, "yb.open", _opened)
            _compare(tally, case, "yb.open", before, snapshot(theirs, home, folder / "good"))
            tally.folders += 1
            _remove(theirs)
    return tally


def _compare(tally: Tally, case: Case, command: str, before: dict[str, Any], after: dict[str, Any]) -> None:
    changed = {path for path in before.keys() | after.keys() if before.get(path) != after.get(path)}
    if changed:
        tally.notes.append(f"WROTE {case.name}, {command}: {sorted(changed)}")


def _judge(tally: Tally, case: Case, command: str, call: Callable[[], tuple[int, str]]) -> None:
    """Call a command and note how it ended."""
    try:
        with _limited():
            status, said = call()
    except BaseException as error:
        if isinstance(error, KeyboardInterrupt):
            raise
        trace = "".join(traceback.format_exception(error))
        tally.notes.append(f"TRACEBACK {case.name}, {command}: {trace[-1500:]}")
        return
    problem = ""
    if "error in yawbench" in said or "Traceback (most" in said:
        problem = "TRACEBACK"
    elif status not in (0, 1, 2):
        problem = "STATUS"
    elif status and not said.strip():
        problem = "NO SENTENCE"
    elif "something in it is not understood" in said:
        problem = "NOT FORESEEN"
    elif printable(said) != said:
        problem = "CONTROL CHARACTER"
    if problem:
        tally.notes.append(f"{problem} {case.name}, {command} ({status}): {said[-600:]!r}")
    tally.calls["a result" if status == 0 else "a sentence"] += 1


def _called_with(arguments: tuple[str, ...]) -> tuple[int, str]:
    """Return the exit status of a command, and all that it printed."""
    out = io.TextIOWrapper(io.BytesIO(), encoding="utf-8", write_through=True)
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(out):
        try:
            yawbench(arguments)
        except SystemExit as ended:
            status = ended.code if isinstance(ended.code, int) else int(ended.code is not None)
    out.flush()
    assert isinstance(out.buffer, io.BytesIO)
    return status, out.buffer.getvalue().decode()


def _opened() -> tuple[int, str]:
    """Read the folder by the library; return 0, or 2 and the sentence."""
    try:
        run = yb.open("theirs")
        run.metrics()
        repr(run)
        run._repr_html_()
        run.to_pandas()
    except YawbenchError as error:
        return 2, printable(str(error))
    return 0, ""


def _remove(folder: Path) -> None:
    for path in folder.iterdir():
        if path.is_dir() and not path.is_symlink():
            _remove(path)
        else:
            path.unlink()
    folder.rmdir()


@contextlib.contextmanager
def _limited() -> Iterator[None]:
    """Raise TimeoutError once the block has taken too much processor time."""

    def stop(*_: object) -> None:
        raise TimeoutError(f"more than {LIMIT:g} s of processor time")

    before = signal.signal(signal.SIGPROF, stop)
    signal.setitimer(signal.ITIMER_PROF, LIMIT)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.signal(signal.SIGPROF, before)


def main() -> None:
    """Run what the command line asks for."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--every", type=int, default=1, help="take every so manieth folder")
    parser.add_argument("--from", type=int, default=0, dest="first", help="begin with this one")
    given = parser.parse_args()
    chosen = cases()[given.first :: given.every]
    with tempfile.TemporaryDirectory(prefix="folders-") as folder:
        tally = trial(chosen, Path(folder))
    for note in tally.notes:
        print(note, "\n")
    calls = ", ".join(f"{count} {what}" for what, count in tally.calls.items())
    print(f"{tally.folders} folders, {tally.calls.total()} calls: {calls}; {len(tally.notes)} did not hold")
    sys.exit(bool(tally.notes))


if __name__ == "__main__":
    main()
