"""Files made wrong at random, through the loaders and the command line: `python -m campaigns.mutations`.

    python -m campaigns.mutations --files 10000 --commands 300 --ssp 3000 --results 600 --seed 1

What must hold: a file is taken or answered by a sentence (exit status 0, 1 or 2), never by a traceback,
within a time limit, and nothing is written outside the folder of results. Prints each case that did not,
with what repeats it, and a table of the outcomes. `--only files:17` repeats one case and keeps its file.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import multiprocessing
import os
import random
import re
import resource
import shutil
import subprocess
import sys
import tempfile
import threading
import time
import traceback
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from . import mutate

ROOT = Path(__file__).resolve().parents[1]
LIMIT = 10.0
"""Processor time that a file may take [s]."""
STARVED = 12
"""Times as long by the clock is still no hang: the machine may do much else."""
MEMORY = 6_000_000_000
"""Bytes that a loader may take."""
FINE, REFUSED, UNFORESEEN = "taken", "refused in a sentence", "refused, not foreseen"
BAD = ("TRACEBACK", "HANG", "DIED", "NO SENTENCE", "WROTE OUTSIDE")
STEPS = 3000
"""Steps of a run that a mutated file may ask for; of more, it is only checked."""


@dataclass
class Tally:
    """Counts of the outcomes of the cases of a kind."""

    counts: Counter[str] = field(default_factory=Counter)
    notes: list[str] = field(default_factory=list)


class Sandbox:
    """A folder with copies of the scenarios and everything that the commands may write to."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.scenarios = folder / "scenarios"
        self.work = folder / "work"
        for name in ("work", "home", "tmp", "cache", "cases"):
            (folder / name).mkdir(parents=True, exist_ok=True)
        if not self.scenarios.exists():
            shutil.copytree(ROOT / "scenarios", self.scenarios)
            for file in self.scenarios.rglob("*.yaml"):  # short runs, beside their files
                text = file.read_text(encoding="utf-8")
                short = re.sub(r"(?m)^stop_time:.*$", "stop_time: 0.02", text)
                file.with_name(f"short_{file.name}").write_text(short, encoding="utf-8")

    def environment(self) -> dict[str, str]:
        """Return the environment of everything that runs here."""
        own = {"HOME": "home", "TMPDIR": "tmp", "YAWBENCH_CACHE": "cache", "MPLCONFIGDIR": "cache"}
        return {
            **os.environ,
            **{key: str(self.folder / name) for key, name in own.items()},
            "PYTHONPATH": str(ROOT),
        }

    def listing(self) -> dict[str, tuple[int, int]]:
        """Return every file that no case may change, with its size and time."""
        own = {self.folder / name for name in ("work", "cache", "cases", "tmp")}
        found = {}
        for above, folders, names in os.walk(self.folder):
            folders[:] = [one for one in folders if Path(above, one) not in own]
            for name in names:
                if not name.startswith("mutated"):
                    status = os.stat(Path(above, name))
                    found[str(Path(above, name))] = (status.st_size, status.st_mtime_ns)
        return found


def kind_of(text: str) -> str:
    """Return which kind of YAML file a text is."""
    for kind, key in (("sweep", "axes"), ("study", "runs"), ("scenario", "units"), ("vehicle", "parameters")):
        if re.search(rf"(?m)^{key}:", text):
            return kind
    return "scenario"


def case_of(group: str, number: int, seed: int, box: Sandbox) -> tuple[Path, str]:
    """Write the file of a case; return it and its kind."""
    r = random.Random(f"{seed}/{group}/{number}")
    tag = f"mutated_{group}_{number}"
    if group == "ssp":
        source = r.choice(sorted((box.folder / "cases").glob("base*.ssp")))
        file = box.work / f"{tag}.ssp"
        file.write_bytes(mutate.mutated_archive(source.read_bytes(), r))
        return file, "ssp"
    if group == "results":
        source = r.choice(sorted((box.folder / "cases").glob("base_*")))
        folder = box.work / tag
        shutil.copytree(source, folder, dirs_exist_ok=True)
        file = r.choice(
            [one for one in sorted(folder.iterdir()) if one.suffix in (".csv", ".json", ".parquet", ".mf4")]
        )
        how = {".json": mutate.JSON, ".csv": mutate.CSV}.get(file.suffix, mutate.ANY)
        file.write_bytes(mutate.mutated(file.read_bytes(), how, r))
        return folder, "results"
    short = group == "commands"
    bases = [
        f
        for f in sorted(box.scenarios.rglob("*.yaml"))
        if f.name.startswith("short_") == short and "mutated" not in f.name
    ]
    source = r.choice(bases)
    text = source.read_bytes()
    file = source.with_name(f"{tag}.{source.stem.removeprefix('short_')}.yaml")
    file.write_bytes(mutate.mutated(text, mutate.YAML, r))
    return file, kind_of(text.decode())


def load(file: Path, kind: str, planner: Any) -> None:
    """Read a file as the commands do, up to where runs would begin."""
    from tests.cars import load_scenario, make_plan
    from yawbench.metrics.expressions import evaluate_all
    from yawbench.orchestrator.plan import Override
    from yawbench.orchestrator.results.reader import load_results
    from yawbench.studies.load_experiment import load_experiment

    fmus, opener = ROOT / "fmus", planner.opener
    if kind == "study":
        load_experiment(file)
    elif kind == "sweep":
        assert load_experiment(file).points
    elif kind == "results":
        evaluate_all(load_results(file))
    elif kind == "ssp":
        load_scenario(file)
    elif kind == "vehicle":
        name = f"{file.name.split('.')[1]}.yaml"
        uses = (one for one in sorted(file.parents[1].rglob("*.yaml")) if _uses(one, name))
        base = next(uses, file.parents[1] / "fnn_sideslip" / "25mps.yaml")
        make_plan(
            load_scenario(base, changes=(Override.of("vehicle", str(file), "test"),)),
            fmus=fmus,
            opener=opener,
        )
    else:
        make_plan(load_scenario(file), fmus=fmus, opener=opener)


def _uses(scenario: Path, vehicle: str) -> bool:
    if "mutated" in scenario.name:
        return False
    text = scenario.read_text(encoding="utf-8")
    return "units:" in text and f"/{vehicle}" in text


def outcome_of(function: Callable[[], None]) -> tuple[str, str]:
    """Return what became of reading a file, and what was said."""
    from yawbench.foundation.errors import YawbenchError

    try:
        with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
            function()
    except YawbenchError as error:
        if not all(one.message.strip() and one.code for one in error.diagnostics or [None]):
            return "NO SENTENCE", repr(error.diagnostics)
        said = "\n".join(map(str, error.diagnostics))
        if error.__cause__ is not None:
            return UNFORESEEN, said + "\n" + "".join(traceback.format_exception(error.__cause__)[-3:])
        return REFUSED, said
    except BaseException:
        return "TRACEBACK", "".join(traceback.format_exc().splitlines(keepends=True)[-12:])
    return FINE, ""


def work(pipe: Connection, group: str, numbers: list[int], seed: int, folder: Path, limit: float) -> None:
    """Load case after case in this process, telling the parent before and after each."""
    box = Sandbox(folder)
    os.environ.update(box.environment())
    tempfile.tempdir = None
    os.chdir(box.work)
    from yawbench.planner import Planner

    planner = Planner()
    sys.unraisablehook = lambda _: None  # as in the command line
    outcome_of(
        lambda: load(box.scenarios / "fnn_sideslip" / "25mps.yaml", "scenario", planner)
    )  # modules, FMUs
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    for number in numbers:
        file, kind = case_of(group, number, seed, box)
        pipe.send(("begin", number, kind))
        began = time.process_time()
        outcome, said = outcome_of(lambda: load(file, kind, planner))  # noqa: B023
        if (took := time.process_time() - began) > limit:
            outcome, said = "HANG", f"{took:.1f} s: {said}"
        pipe.send(("end", number, (outcome, said)))
        shutil.rmtree(file) if file.is_dir() else file.unlink()
    pipe.send(("done", 0, ""))


def through_loaders(
    group: str, numbers: list[int], seed: int, box: Sandbox, limit: float, jobs: int
) -> Tally:
    """Load all cases of a group in processes of their own, each watched."""
    tally = Tally()
    lock = threading.Lock()
    context = multiprocessing.get_context("spawn")

    def note(outcome: str, kind: str, number: int, said: str) -> None:
        with lock:
            tally.counts[f"{kind}: {outcome}"] += 1
            if outcome in BAD or outcome == UNFORESEEN:
                tally.notes.append(f"{outcome} --only {group}:{number} --seed {seed}\n{said}")

    def watch(mine: list[int]) -> None:
        while mine:
            ours, theirs = context.Pipe(duplex=False)
            process = context.Process(
                target=work, args=(theirs, group, mine, seed, box.folder, limit), daemon=True
            )
            process.start()
            theirs.close()
            current, kind, patience = mine[0], "", 120.0  # modules are imported first
            try:
                while True:
                    if not ours.poll(patience):
                        note("HANG", kind, current, f"more than {patience:g} s")
                        break
                    what, number, said = ours.recv()
                    if what == "done":
                        return
                    if what == "begin":
                        current, kind, patience = number, said, STARVED * limit
                    else:
                        note(said[0], kind, number, said[1])
                        patience = 60.0  # to write the next file
                        mine = mine[mine.index(number) + 1 :]
                        current = mine[0] if mine else current
            except EOFError:
                process.join()
                note("DIED", kind, current, f"exit status {process.exitcode}")
            finally:
                process.kill()
                process.join()
            mine = mine[mine.index(current) + 1 :] if current in mine else mine

    threads = [threading.Thread(target=watch, args=(numbers[i::jobs],)) for i in range(jobs)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    return tally


def command_of(number: int, seed: int, box: Sandbox) -> tuple[list[str], Path]:
    """Return a command line for a case, and its file."""
    from tests.cars import load_scenario
    from yawbench.studies.load_experiment import load_experiment

    r = random.Random(f"{seed}/command/{number}")
    file, kind = case_of("commands", number, seed, box)
    fmus = ["--fmus", str(ROOT / "fmus")]
    good = str(box.scenarios / "fnn_sideslip" / "short_25mps.yaml")
    texts = [text for text in mutate.NASTY if "\0" not in text and text.isprintable()]
    if r.random() < 0.3:  # options
        option = r.choice(("--set", "--set", "--swap", "--metric", "--panel"))
        place = r.choice(
            ("plant.mass", "driver.amplitude", "inputs.friction*", "vehicle.mass", "stop_time", "x", "")
        )
        if option == "--set":
            return ["check", good, *fmus, f"--set={place}={r.choice(texts)}"], file
        if option == "--swap":
            return [
                "check",
                good,
                *fmus,
                f"--swap={r.choice(('controller', 'plant', 'x'))}={r.choice(texts)}",
            ], file
        command = "run" if option == "--metric" else "plot"
        return [command, good, *fmus, "--out", "results/options", f"{option}={r.choice(texts)}"], file
    if r.random() < 0.1:
        return [r.choice(("check", "study", "sweep", "plot", "animate", "export-ssp")), str(file)], file
    if kind == "vehicle":
        return ["check", good, *fmus, "--set=vehicle.mass=1000"], file
    try:
        if kind == "scenario":
            loaded = load_scenario(file)
            few = loaded.stop_time / loaded.step_size <= STEPS
        elif kind == "study":
            few = False
        else:
            few = len(load_experiment(file).points) <= 2
    except Exception:
        few = True  # what is refused takes no time
    with contextlib.suppress(Exception):
        if kind == "study":
            load_experiment(file)
    if kind == "study":
        return ["study", str(file), "--no-run", *fmus], file
    if kind == "sweep":
        return (["sweep", str(file), *fmus] if few else ["study", str(file)]), file
    return (["run", str(file), *fmus] if few and r.random() < 0.4 else ["check", str(file), *fmus]), file


def through_commands(numbers: list[int], seed: int, box: Sandbox, limit: float) -> Tally:
    """Give each case to the command line in a process of its own."""
    tally = Tally()
    for number in numbers:
        arguments, file = command_of(number, seed, box)
        before = box.listing()
        command = [sys.executable, "-m", "yawbench", *arguments]
        began = time.monotonic()
        try:
            done = subprocess.run(
                command, cwd=box.work, env=box.environment(), capture_output=True, text=True,
                errors="replace", timeout=STARVED * limit, stdin=subprocess.DEVNULL,
            )  # fmt: skip
            said, status = done.stderr, done.returncode
            if "Traceback (most" in said or "error in yawbench itself" in said:
                outcome = "TRACEBACK"
            elif "something in it is not understood" in said:
                outcome = UNFORESEEN
            elif status not in (0, 1, 2):
                outcome = "DIED"
            elif status and not said.strip():
                outcome = "NO SENTENCE"
            else:
                outcome = f"exit status {status}"
            if "\x1b" in said + done.stdout:
                outcome = "NO SENTENCE"  # a control character of the file's reached the terminal
        except subprocess.TimeoutExpired as error:
            outcome, said = "HANG", f"{error}"
        if box.listing() != before:
            outcome = "WROTE OUTSIDE"
            said += str(set(box.listing().items()) ^ set(before.items()))
        tally.counts[f"{arguments[0]}: {outcome}"] += 1
        if outcome in BAD or outcome == UNFORESEEN:
            seconds = time.monotonic() - began
            shown = " ".join(arguments)[:300]
            tally.notes.append(
                f"{outcome} --only commands:{number} --seed {seed} ({seconds:.1f} s)\n{shown}\n{said[-1500:]}"
            )
        file.unlink()
    return tally


def prepare(box: Sandbox, groups: set[str]) -> None:
    """Make the archives and results that are mutated."""
    cases, scenario = box.folder / "cases", box.scenarios / "fnn_sideslip" / "short_25mps.yaml"
    made: list[list[str]] = []
    if "ssp" in groups:
        made += [["export-ssp", str(scenario), "--out", str(cases / "base.ssp")]]
    if "results" in groups:
        made += [
            ["run", str(scenario), "--format", f, "--out", str(cases / f"base_{f}")]
            for f in ("csv", "parquet")
        ]
    for arguments in made:
        subprocess.run(
            [sys.executable, "-m", "yawbench", *arguments, "--fmus", str(ROOT / "fmus")],
            cwd=box.work, env=box.environment(), check=True, capture_output=True,
        )  # fmt: skip


def trial(
    counts: dict[str, list[int]], seed: int, folder: Path, limit: float, jobs: int
) -> Iterator[tuple[str, Tally]]:
    """Yield each group of cases with what became of them."""
    box = Sandbox(folder)
    prepare(box, set(counts))
    for group, numbers in counts.items():
        before = box.listing()
        if group == "commands":
            tally = through_commands(numbers, seed, box, limit)
        else:
            tally = through_loaders(group, numbers, seed, box, limit, jobs)
        if box.listing() != before:
            tally.counts["WROTE OUTSIDE"] += 1
            tally.notes.append(f"WROTE OUTSIDE {set(box.listing().items()) ^ set(before.items())}")
        yield group, tally


def bad(tally: Tally) -> int:
    """Return how many cases were not answered as they must be."""
    return sum(count for what, count in tally.counts.items() if what.endswith(BAD))


def main() -> None:
    """Run what the command line asks for."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    for group in ("files", "commands", "ssp", "results"):
        parser.add_argument(f"--{group}", type=int, default=0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--limit", type=float, default=LIMIT, help="processor time per file [s]")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--only", help="GROUP:NUMBER")
    given = parser.parse_args()
    if given.only:
        group, _, number = given.only.partition(":")
        box = Sandbox(Path(tempfile.mkdtemp(prefix="mutations-")))
        prepare(box, {group})
        if group == "commands":
            print("yawbench", *command_of(int(number), given.seed, box)[0])
        else:
            file, kind = case_of(group, int(number), given.seed, box)
            print(f"a {kind}: {file}")
        return
    counts = {
        g: list(range(getattr(given, g)))
        for g in ("files", "ssp", "results", "commands")
        if getattr(given, g)
    }
    failed = 0
    with tempfile.TemporaryDirectory(prefix="mutations-") as folder:
        for group, tally in trial(counts, given.seed, Path(folder), given.limit, given.jobs):
            failed += bad(tally)
            for note in tally.notes[:20]:
                print(note, "\n")
            print(f"{group}: {sum(tally.counts.values())} cases, seed {given.seed}")
            for what, count in sorted(tally.counts.items()):
                print(f"  {what:45} {count}")
            sys.stdout.flush()
    sys.exit(bool(failed))


if __name__ == "__main__":
    main()
