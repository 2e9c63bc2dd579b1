"""Commands disturbed and called again: `python -m campaigns.kills --each 20`.

A command is stopped by SIGKILL or SIGTERM at a moment drawn from the time that it takes undisturbed. What
it leaves is then looked at (no half result may pass for a whole one), the command is called again, and
what that leaves must be the same as if nothing had happened: the same numbers to the last byte, and no
file of the killed one.

With `--full-disk`, no file that it writes may exceed a size drawn between nothing and its largest file, as on
a disk that fills up. It must fail with a sentence or have done all of its work; the rest is the same.
"""

from __future__ import annotations

import argparse
import csv
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

from tests.commands.test_batch_commands import SCENARIO, STUDY, UNITS
from tests.ranking.test_ranking import SMALL
from tests.studies.test_tuning import SCENARIO as WHEEL
from tests.studies.test_tuning import TUNING
from yawbench.fmus.build import build_all
from yawbench.foundation.errors import ResultsError
from yawbench.foundation.safe_files import LOCK_FILE, NEW
from yawbench.orchestrator.results.reader import load_results
from yawbench.orchestrator.results.run_folder import PART
from yawbench.orchestrator.results.run_record import RUN_FILE

SWEEP = """
title: Half a sweep
scenario: half.yaml
axes: {amplitude: {vary: driver.amplitude, values: [0.01, 0.02, 0.03, 0.04, 0.05, 0.06], unit: rad}}
metrics: {moment: {metric: peak(yaw_moment)}}
"""
RANKING = SMALL.replace("  low: ", "  # ")
"""Two controllers in one condition."""
COMMANDS = {
    "run": ("run", "half.yaml", "--out", "out"),
    "compare": ("compare", "half.yaml", "--swap", "controller=controller_off", "--out", "out"),
    "study": ("study", "study.yaml", "--out", "out"),
    "report": ("report", "study.yaml", "--out", "out"),
    "sweep": ("sweep", "sweep.yaml", "--out", "out"),
    "tune": ("tune", "tuning.yaml", "--out", "out"),
    "rank": ("rank", "ranking.yaml", "--out", "out"),
    "build": ("build", "--out", "out", *UNITS),
    "export-ssp": ("export-ssp", "half.yaml", "--out", "out/half.ssp"),
}
SAME = ("*.csv", "*.ssp", "*.parquet", "*.fmu", "experiment.json", "entries.yaml")
"""Files that are the same to the last byte, whatever happened before; others hold times and versions."""
MEASURED = "step_time"
"""Prefix of columns of computing time, which no two runs share."""
LITTER = (PART, NEW, LOCK_FILE, ".tmp")
"""Endings of names of files that a command which has ended may not leave."""
NOISE = ("Traceback", "leaked", "resource_tracker", "yawbench itself")
"""Words that a command that is killed may not print."""
ENDED = {signal.SIGKILL: (-signal.SIGKILL,), signal.SIGTERM: (128 + signal.SIGTERM, -signal.SIGTERM)}
"""Exit status after a signal: by SIGTERM also at once, while Python is still being started."""
WHOLE = {".svg": b"</svg>", ".html": b"</html>", ".png": b"IEND\xaeB`\x82", ".json": b"}"}
"""Last bytes of files that are written at once."""


class Trial:
    """A folder with scenario, study and sweep, in which commands are called."""

    def __init__(self, place: Path, fmus: Path) -> None:
        self.place = place = place / "half"  # the same name each time: a sweep is known by it
        self._fmus = fmus
        (place / "tmp").mkdir(parents=True)
        (place / "half.yaml").write_text(SCENARIO.replace("stop_time: 0.4", "stop_time: 40"))
        (place / "study.yaml").write_text(STUDY)
        (place / "sweep.yaml").write_text(SWEEP)
        (place / "wheel.yaml").write_text(WHEEL)
        (place / "tuning.yaml").write_text(TUNING)
        (place / "ranking.yaml").write_text(RANKING)

    def start(self, command: str, largest: int | None = None) -> subprocess.Popen[str]:
        """Start a command in a group of its own; no file that it writes may exceed `largest` [bytes]."""
        arguments = [sys.executable, "-m", "yawbench", *COMMANDS[command]]
        if command not in ("build", "rank"):  # which has the cars of this checkout
            arguments += ["--fmus", str(self._fmus)]
        environment = {**os.environ, "TMPDIR": str(self.place / "tmp")}
        return subprocess.Popen(
            arguments, cwd=self.place, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
            env=environment, start_new_session=True,
            preexec_fn=None if largest is None else partial(_limit_files, largest),
        )  # fmt: skip

    def call(self, command: str, largest: int | None = None) -> tuple[int, str, float]:
        """Return exit status, what was said, and the time taken [s]."""
        began = time.monotonic()
        process = self.start(command, largest)
        said = process.communicate()[0]
        return process.returncode, said, time.monotonic() - began

    def kill(self, command: str, after: float, number: signal.Signals) -> tuple[bool, list[str]]:
        """Start a command and stop it after a time [s].

        Returns:
            whether it was still there; what is wrong with how it has ended.
        """
        process = self.start(command)
        try:
            process.communicate(timeout=after)
            return False, []
        except subprocess.TimeoutExpired:
            process.send_signal(number)
            said = process.communicate()[0]
        noise = [f"{word!r} on the terminal: {said.strip()[-300:]}" for word in NOISE if word in said]
        status = process.returncode
        if status == 128 + number and "nterrupted" not in said:
            noise.append("no word on what ended it")
        if status not in (0, *ENDED[number]):  # 0: it was about to end
            noise.append(f"exit status {status}: {said.strip()[-300:]}")
        return True, noise

    def numbers(self) -> dict[str, bytes]:
        """Return the content of all files that must be the same."""
        out = self.place / "out"
        return {
            path.relative_to(out).as_posix(): _computed(path)
            for pattern in SAME
            for path in sorted(out.rglob(pattern))
            if path.is_file()
        }

    def litter(self) -> Iterator[str]:
        """Yield files that should not be there once a command has ended by itself."""
        for path in (self.place / "out").rglob("*"):
            if path.name.endswith(LITTER):
                yield f"left behind: {path.relative_to(self.place)}"

    def halves(self, whole: dict[str, bytes]) -> Iterator[str]:
        """Yield results and pages that pass for whole and are not."""
        out = self.place / "out"
        for path in out.rglob("*"):
            end = WHOLE.get(path.suffix)
            if end is not None and path.is_file() and not path.read_bytes().rstrip().endswith(end):
                yield f"half a file: {path.relative_to(out)}"
        for record in [*out.rglob(RUN_FILE)]:
            try:
                results = load_results(record.parent)
            except ResultsError:
                continue
            name = results.file.relative_to(out).as_posix()
            if results.record.status == "completed" and whole.get(name) != (out / name).read_bytes():
                yield f"half a result passes for whole: {name}"


def _limit_files(largest: int) -> None:
    import resource  # not on Windows

    resource.setrlimit(resource.RLIMIT_FSIZE, (largest, largest))


def _computed(file: Path) -> bytes:
    """Return what a file holds, without times that were measured."""
    content = file.read_bytes()
    if MEASURED.encode() not in content.partition(b"\n")[0]:
        return content
    rows = [*csv.reader(content.decode().splitlines())]
    kept = [k for k, name in enumerate(rows[0]) if not name.startswith(MEASURED)]
    return repr([[row[k] for k in kept] for row in rows]).encode()


Disturb = Callable[[Trial], tuple[str, str, list[str]]]
"""Calls a command of a trial and disturbs it; returns the outcome, the circumstances, and what went wrong."""


def killed(command: str, undisturbed: Trial, duration: float, r: random.Random) -> Disturb:
    """Return what kills a command at a random moment."""
    how, after = r.choice((signal.SIGKILL, signal.SIGTERM)), r.uniform(0.1, 1.0) * duration

    def disturb(one: Trial) -> tuple[str, str, list[str]]:
        alive, found = one.kill(command, after, how)
        return how.name if alive else "had ended before", f"{how.name} after {after:.2f} s", found

    return disturb


def on_a_full_disk(command: str, undisturbed: Trial, duration: float, r: random.Random) -> Disturb:
    """Return what calls a command without enough room."""
    largest = max(path.stat().st_size for path in undisturbed.place.rglob("out/**/*") if path.is_file())
    room = round(largest * r.random() ** 3)  # most files are small

    def disturb(one: Trial) -> tuple[str, str, list[str]]:
        status, said, _ = one.call(command, room)
        found = [f"{word!r} on the terminal: {said.strip()[-300:]}" for word in NOISE if word in said]
        if status == 0 and one.numbers() != undisturbed.numbers():
            found.append("exit status 0 with other numbers than undisturbed")
        if status not in (0, 1, 2):
            found.append(f"exit status {status}")
        if status and not said.strip():
            found.append("no word on what went wrong")
        return "failed" if status else "had room", f"{room} bytes", [*found, *one.litter()]

    return disturb


def trial(
    command: str, each: int, seed: int, folder: Path, fmus: Path, disturbed: Callable[..., Disturb] = killed
) -> tuple[Counter[str], list[str]]:
    """Disturb a command `each` times.

    Returns:
        how many trials had which outcome ("held", or what went wrong); sentences on what went wrong.
    """
    r = random.Random(f"{seed} {command}")
    undisturbed = Trial(folder / f"{command} undisturbed", fmus)
    status, said, duration = undisturbed.call(command)
    assert status == 0, said
    whole = undisturbed.numbers()
    assert whole
    counts: Counter[str] = Counter()
    notes: list[str] = []
    for number in range(each):
        one = Trial(folder / f"{command} {number}", fmus)
        if command != "sweep" and r.random() < 0.5:  # with results of an earlier call, which a sweep keeps
            shutil.copytree(undisturbed.place / "out", one.place / "out")
        outcome, circumstances, found = disturbed(command, undisturbed, duration, r)(one)
        found += one.halves(whole)
        status, said, _ = one.call(command)
        found += [f"called again, exit status {status}: {said.strip().splitlines()[-1:]}"] if status else []
        found += ["called again, a traceback"] if "Traceback" in said else []
        found += [*one.litter()]
        if one.numbers() != whole:
            found.append("called again, other numbers than undisturbed")
        counts["held" if not found else "did not hold"] += 1
        counts[outcome] += 1
        notes += [f"{command} {number}, {circumstances}: {sentence}" for sentence in found]
        shutil.rmtree(one.place.parent)
    return counts, notes


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("commands", nargs="*", default=list(COMMANDS), help="default: all")
    parser.add_argument("--each", type=int, default=20, help="trials of each command")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--full-disk", action="store_true")
    given = parser.parse_args()
    outcomes = ("failed", "had room") if given.full_disk else ("SIGKILL", "SIGTERM", "had ended before")
    outcomes, failed = (*outcomes, "held"), False
    print(f"| command | trials | {' | '.join(outcomes)} |")
    print(f"|---|---:|{'---:|' * len(outcomes)}", flush=True)
    with tempfile.TemporaryDirectory(prefix="trials-") as folder:
        fmus = Path(folder, "fmus")
        build_all(fmus, components=UNITS)
        for command in given.commands:
            disturbed = on_a_full_disk if given.full_disk else killed
            counts, notes = trial(command, given.each, given.seed, Path(folder), fmus, disturbed)
            numbers = (given.each, *(counts[outcome] for outcome in outcomes))
            print(f"| `{command}` | {' | '.join(map(str, numbers))} |", flush=True)
            print("".join(f"{note}\n" for note in notes), end="", file=sys.stderr, flush=True)
            failed = failed or bool(notes)
    sys.exit(failed)


if __name__ == "__main__":
    main()
