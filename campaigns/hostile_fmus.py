"""Runs with an FMU that does harm: `python -m campaigns.hostile_fmus [PART OF A NAME ...]`.

Every behaviour of `tests/fmus/hostile.c` in every call of FMI, with and without `--isolate`, in a
forked command line each. What must hold stands in `verdict`. Prints what did not, and a table.
"""

from __future__ import annotations

import contextlib
import csv
import faulthandler
import itertools
import json
import mmap
import os
import shlex
import signal
import subprocess
import sys
import tempfile
import time
import traceback
import zipfile
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import fmpy

from yawbench.cli import main
from yawbench.commands import run as _run_command  # noqa: F401  imported once, before the forks
from yawbench.orchestrator.master import isolation  # noqa: F401
from yawbench.orchestrator.master.simulate import simulate  # noqa: F401
from yawbench.orchestrator.wiring.make_plan import make_plan  # noqa: F401

SOURCE = Path(__file__).parents[1] / "tests" / "fmus" / "hostile.c"
INCLUDE = Path(__file__).parents[1] / "fmus"

SET_UP = ("load", "instantiate", "setup", "enter", "leave")
STEPPING = ("set", "step", "get")
ENDING = ("terminate", "free", "unload")
KINDS = {
    "ends the process": (
        "exit", "_exit", "quick_exit", "abort", "segfault", "kill", "kill_group", "alarm", "overflow",
        "execute", "leave_thread", "divide",
    ),
    "does not come back": ("hang", "sleep", "deaf", "blocked", "stop"),
    "starts processes": ("child", "child_crash"),
    "writes into open files": ("garbage", "zeros", "length", "endless", "print"),
    "closes or limits files": ("close", "close_output", "files", "size"),
    "changes the process": ("rounding", "flush", "trap", "signals", "environment"),
    "logs": ("flood", "long", "escape", "no_text", "thread_log"),
    "leaves a thread": ("thread",),
    "answers wrongly": ("status_7", "status_minus", "status_huge", "pending", "fatal", "error", "discard"),
}  # fmt: skip
"""Things that an FMU may do in any call, by kind."""
VALUES = ("nan", "inf", "wired_nan", "huge_text", "no_text", "not_utf8", "count")
OTHERS = (*(f"value:{what}" for what in VALUES), "free:log_after")

PATIENCE = 4.0
"""Time after which a run that hangs gets a Ctrl-C [s]."""
LIMIT = 10.0
"""Time within which it has to end then, and any other run has to [s]."""
STEP, STEPS, ACTS_AT = 0.02, 10, 0.1  # s

VARIABLES = (
    ("x", 1, "input", "continuous", '<Real start="1"/>'),
    ("y", 2, "output", "continuous", "<Real/>"),
    ("spare", 3, "output", "continuous", "<Real/>"),
    ("text", 4, "output", "discrete", "<String/>"),
    ("count", 5, "output", "discrete", "<Integer/>"),
    ("text_in", 6, "input", "discrete", '<String start=""/>'),
)
DESCRIPTION = (
    '<?xml version="1.0" encoding="UTF-8"?>\n'
    '<fmiModelDescription fmiVersion="2.0" modelName="hostile" guid="{1}">'
    '<CoSimulation modelIdentifier="hostile"/><ModelVariables>'
    + "".join(
        f'<ScalarVariable name="{name}" valueReference="{reference}" causality="{causality}" '
        f'variability="{variability}">{kind}</ScalarVariable>'
        for name, reference, causality, variability, kind in VARIABLES
    )
    + '</ModelVariables><ModelStructure><Outputs><Unknown index="2" dependencies="1"/>'
    + "".join(f'<Unknown index="{index}" dependencies=""/>' for index in (3, 4, 5))
    + "</Outputs></ModelStructure></fmiModelDescription>"
)
SCENARIO = f"""
title: A unit that does harm between two that do not
stop_time: {STEP * STEPS}
step_size: {STEP}
inputs: {{good.x: 1.0, good.text_in: text, bad.text_in: text}}
units:
  good: {{fmu: ./hostile.fmu}}
  bad: {{fmu: ./hostile.fmu}}
  after: {{fmu: ./hostile.fmu}}
connections:
  - {{from: good.y, to: bad.x}}
  - {{from: bad.y, to: after.x}}
  - {{from: bad.text, to: after.text_in}}
"""
VALUES_OF = {"good.y": 2 + 1 / 3, "good.spare": 1e-311 * 1e308 + 0.5, "after.spare": 1e-311 * 1e308 + 0.5}
"""Outputs of FMUs that do no harm, always the same."""


@dataclass(frozen=True)
class Case:
    """One run: what the FMU does, "step:abort", and whether its unit is isolated."""

    does: str
    isolated: bool

    @property
    def call(self) -> str:
        return self.does.partition(":")[0]

    @property
    def kind(self) -> str:
        what = self.does.partition(":")[2]
        return next(
            (kind for kind, known in KINDS.items() if what in known and self.does not in OTHERS), "values"
        )

    def __str__(self) -> str:
        return f"{self.does} {'apart' if self.isolated else 'together'}"


@dataclass
class Running:
    """A case's process."""

    case: Case
    folder: Path
    process: int
    began: float = field(default_factory=time.monotonic)
    interrupted: float | None = None

    def ended(self) -> int | None:
        """Return the process's status if it has ended; send signals when it is time to."""
        pid, status = os.waitpid(self.process, os.WNOHANG)
        if pid:
            return os.waitstatus_to_exitcode(status)
        now = time.monotonic()
        if self.interrupted is None and now - self.began > PATIENCE * (3 if self.case.isolated else 1):
            self.interrupted = now
            os.kill(self.process, signal.SIGINT)
        if self.interrupted is not None and now - self.interrupted > LIMIT:
            os.killpg(self.process, signal.SIGKILL)
            os.waitpid(self.process, 0)
            return -999
        return None


def every_case() -> Iterator[Case]:
    """Yield all behaviours in all calls."""
    together = [f"{c}:{b}" for c in (*SET_UP, *STEPPING, *ENDING) for b in itertools.chain(*KINDS.values())]
    for does in (*together, *OTHERS):
        yield Case(does, isolated=False)
        yield Case(does, isolated=True)


def make_files(folder: Path) -> Path:
    """Compile the FMU and write it and its scenario; return the scenario."""
    compiler = shlex.split(os.environ.get("CC", "cc"))
    library = folder / "hostile.so"
    options = ["-shared", "-fPIC", "-w", "-O1", f"-I{INCLUDE}"]
    subprocess.run([*compiler, *options, SOURCE, "-o", library, "-lpthread", "-lm"], check=True)
    with zipfile.ZipFile(folder / "hostile.fmu", "w") as archive:
        archive.writestr("modelDescription.xml", DESCRIPTION)
        archive.write(library, f"binaries/{fmpy.platform}/hostile.so")
    scenario = folder / "hostile.yaml"
    scenario.write_text(SCENARIO, encoding="utf-8")
    return scenario


def start(case: Case, scenario: Path, folder: Path) -> Running:
    """Fork a command line that makes the run of a case."""
    folder.mkdir()
    behaviour = {"HOSTILE": case.does, "HOSTILE_RUN": str(folder)}
    process = os.fork()
    if process:
        return Running(case, folder, process)
    status = 70
    try:
        os.setsid()
        (folder / "mark").write_bytes(b"a run's processes have this file mapped")
        with (folder / "mark").open("rb") as file:
            mark = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)  # noqa: F841  see left_over
        faulthandler.disable()  # it is for the tests that this may be part of
        os.environ |= behaviour
        for descriptor, name in ((1, "stdout"), (2, "stderr")):
            file = os.open(folder / name, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
            os.dup2(file, descriptor)
            os.close(file)
            setattr(sys, name, os.fdopen(descriptor, "w", closefd=False))
        options = ["--isolate", "--call-limit", "1 s"] if case.isolated else []
        main(["run", str(scenario), "--out", str(folder / "out"), *options])
        status = 0
    except SystemExit as end:
        status = end.code if isinstance(end.code, int) else 0
    except BaseException:
        traceback.print_exc()
    finally:
        with contextlib.suppress(BaseException):
            sys.stdout.flush()
            sys.stderr.flush()
        os._exit(status)


def verdict(run: Running, status: int) -> list[str]:
    """Return what is wrong with how a run has ended."""
    case, out = run.case, run.folder / "out"
    said = (run.folder / "stderr").read_text(errors="replace")
    problems = []
    left = left_over(run.folder)
    for pid in left:
        with contextlib.suppress(OSError):
            os.kill(pid, signal.SIGKILL)
    if status == -999:
        return ["did not end"]
    if status not in (0, 1, 2, 130):
        problems.append(f"exit status {status}")
    if "Traceback" in said or "Fatal Python error" in said:
        problems.append("traceback")
    if "\x1b" in said and "print" not in case.does and "garbage" not in case.does:
        problems.append("an escape sequence reached the terminal")
    if status != 0 and not any(word in said for word in ("good: ", "bad: ", "the run ", "an instance ")):
        problems.append("no sentence")
    if case.isolated and run.interrupted is not None:
        problems.append("had to be interrupted")
    try:
        record = json.loads((out / "run.json").read_text())
        with (out / "results.csv").open(newline="") as file:
            rows = [{k: float(v) for k, v in row.items()} for row in csv.DictReader(file)]
    except (OSError, ValueError) as error:
        return [*problems, f"no results: {error}"]
    completed = record["status"] == "completed"
    if completed != (status == 0) and not (completed and status == 130):  # 130: only its end was interrupted
        problems.append(f"run.json says {record['status']}, the exit status is {status}")
    if record["rows"] != len(rows):
        problems.append("run.json counts other rows")
    expected = {"completed": STEPS + 1}.get(record["status"], 0)
    if case.call in (*STEPPING, "value"):
        expected = max(expected, 1 if case.kind == "changes the process" else round(ACTS_AT / STEP))
    if case.call in ENDING:
        expected = STEPS + 1
    if len(rows) < expected:
        problems.append(f"{len(rows)} rows of {expected} that are good")
    wrong = {name for row in rows for name, value in VALUES_OF.items() if row[name] != value}
    if wrong:
        problems.append(f"wrong values of {', '.join(sorted(wrong))}")
    if (run.folder / "out" / "run.json").stat().st_size > 1_000_000:
        problems.append("run.json is too large")
    if left:
        problems.append(f"{len(left)} processes are left over")
    return problems


def left_over(folder: Path) -> list[int]:
    """Return the processes that a run has left behind."""
    marks = {"environ": f"HOSTILE_RUN={folder}\0".encode(), "maps": f"{folder}/mark".encode()}
    found = set()
    for entry in Path("/proc").iterdir():
        for file, mark in marks.items():
            with contextlib.suppress(OSError):
                if entry.name.isdecimal() and mark in (entry / file).read_bytes():
                    found.add(int(entry.name))
    return sorted(found)


def attack(cases: Iterable[Case], folder: Path, at_once: int = 3) -> dict[Case, list[str]]:
    """Make the runs of all cases; return what is wrong with each."""
    scenario = make_files(folder)
    waiting, running, found = enumerate(cases), [], {}
    while True:
        while len(running) < at_once and (following := next(waiting, None)) is not None:
            number, case = following
            running.append(start(case, scenario, folder / str(number)))
        if not running:
            return found
        for run in list(running):
            status = run.ended()
            if status is None:
                continue
            running.remove(run)
            found[run.case] = verdict(run, status)
            if found[run.case]:
                said = (run.folder / "stderr").read_text(errors="replace").strip().splitlines()[-3:]
                print(
                    f"{run.case}: {'; '.join(found[run.case])}", *(f"    {x[:150]}" for x in said), sep="\n"
                )
        time.sleep(0.01)


def table(found: dict[Case, list[str]]) -> str:
    """Return a table of what was tried and what held, in Markdown."""
    tried: Counter[tuple[str, bool]] = Counter((case.kind, case.isolated) for case in found)
    held: dict[tuple[str, bool], int] = defaultdict(int)
    for case, problems in found.items():
        held[case.kind, case.isolated] += not problems
    lines = ["| the FMU | in the master's process | isolated |", "|---|---:|---:|"]
    for kind in (*KINDS, "values"):
        cells = " | ".join(f"{held[kind, apart]} of {tried[kind, apart]}" for apart in (False, True))
        lines.append(f"| {kind} | {cells} |")
    return "\n".join(lines)


if __name__ == "__main__":
    parts = sys.argv[1:]
    chosen = [case for case in every_case() if not parts or any(part in str(case) for part in parts)]
    began = time.monotonic()
    with tempfile.TemporaryDirectory(prefix="hostile-") as temporary:
        results = attack(chosen, Path(temporary))
    print(f"\n{len(results)} runs in {time.monotonic() - began:.0f} s\n\n{table(results)}")
    sys.exit(any(results.values()))
