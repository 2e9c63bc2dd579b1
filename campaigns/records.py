"""Records and journals with altered lines and keys: `python -m campaigns.records --each 150 --seed 1`.

A study and a sweep are made once; then a line, key or value of one of their files, or of a ranking's file of
entries, is altered, and a command called that prints numbers from it. It holds if the table is the same as
before, or a sentence names the file with the key or the line; and if what makes runs comes to the undisturbed
table again.
"""

from __future__ import annotations

import argparse
import contextlib
import csv
import io
import json
import os
import random
import re
import shutil
import sys
import tempfile
import warnings
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tests.orchestrator.test_batch_commands import SCENARIO, STUDY, UNITS
from yawbench.cli import main as yawbench
from yawbench.fmus.build import build_all
from yawbench.foundation.errors import RecordWarning, YawbenchError
from yawbench.orchestrator.scenario.loader import SHIPPED
from yawbench.ranking.ranking import load_ranking

from .kills import SWEEP
from .mutate import JSON, YAML, mutated

VALUES = (
    0, 1, -1, 2.5, 1e308, -1e-308, 10**30, True, False, None, "", "deg", "rad", "7.5", "12", "NaN", [], {},
    [3.7, "deg"], [1, 2, 3], {"a": 1}, float("nan"), float("inf"), "\x1b[31m", "\u202e", "plant.yaw_rate",
)  # fmt: skip
"""Replacements of a value."""
RIGHT, SAID, MADE = "numbers right, nothing to say", "named in a sentence", "named, and made again"
NAMED = (
    r"(:line\d+:|:\d+:|:[^;]{0,300}(was(changed|added|removed)|cannotberead|isnottherecordofarun|"
    r"hasnochecksums|itisnorecord|entries\.|entries:|isnotUTF-8|isempty|notvalidYAML))"
)
"""Behind the name of the file: the line or the key, or that nothing in it can be believed."""
BAD = ("WRONG", "NOT NAMED", "OWN ERROR")
SWEEP_OF_TWO = SWEEP.replace("[0.01, 0.02, 0.03, 0.04, 0.05, 0.06]", "[0.01, 0.02]")


@dataclass
class Told:
    """Outcome of a call of the command line."""

    status: int
    out: str
    err: str


def call(*arguments: object) -> Told:
    """Call the command line in this process."""
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            yawbench([str(one) for one in arguments])
            status = 0
        except SystemExit as ended:
            status = ended.code if isinstance(ended.code, int) else int(ended.code is not None)
    return Told(status, out.getvalue(), err.getvalue())


def altered(data: bytes, r: random.Random) -> bytes:
    """Return the bytes of a JSON file with one line, key or value altered."""
    if r.random() < 0.25:
        return mutated(data, JSON, r)
    try:
        content = json.loads(data)
    except ValueError:
        return mutated(data, JSON, r)
    places: list[tuple[Any, Any]] = []

    def collect(part: Any) -> None:
        for key in part if isinstance(part, dict) else range(len(part)) if isinstance(part, list) else ():
            places.append((part, key))
            collect(part[key])

    collect(content)
    part, key = r.choice(places)
    what = r.choice(("value", "value", "value", "drop", "name", "swap", "scale"))
    if what == "drop":
        del part[key]
    elif what == "name" and isinstance(part, dict):
        part[r.choice(("x", "units", "values", f"{key}_"))] = part.pop(key)
    elif what == "swap":
        other = r.choice([*part] if isinstance(part, dict) else range(len(part)))
        part[key], part[other] = part[other], part[key]
    elif what == "scale" and isinstance(part[key], (int, float)):
        part[key] *= 57.3
    else:
        part[key] = r.choice(VALUES)
    return json.dumps(content, ensure_ascii=r.random() < 0.5).encode("utf-8", "surrogatepass")


def altered_line(data: bytes, r: random.Random) -> bytes:
    """Return the bytes of a journal with one of its lines altered, lost, doubled or torn."""
    lines = data.splitlines(keepends=True)
    at = r.randrange(len(lines))
    what = r.random()
    if what < 0.1:
        other = r.randrange(len(lines))
        lines[at], lines[other] = lines[other], lines[at]
    elif what < 0.15:
        lines.insert(at, lines[at])
    else:
        lines[at] = altered(lines[at].rstrip(b"\n"), r).replace(b"\n", b" ") + b"\n"
    return b"".join(lines)


class Trial:
    """A folder with a study and a sweep that are finished, and with what they print undisturbed."""

    def __init__(self, place: Path, fmus: Path) -> None:
        self.place = place / "half"
        self._fmus = fmus
        self.place.mkdir(parents=True)
        for name, text in (("half", SCENARIO), ("study", STUDY), ("sweep", SWEEP_OF_TWO)):
            (self.place / f"{name}.yaml").write_text(text)
        with _chdir(self.place):
            for command in ("study", "sweep"):
                assert call(command, f"{command}.yaml", "--out", command, *self.fmus).status == 0
            self.undisturbed = {
                "list": call("list", "runs", "study").out,
                "study": call("study", "study.yaml", "--out", "study", "--no-run", *self.fmus).out,
            }
        self.table = (self.place / "sweep/table.csv").read_bytes()
        self.numbers = _numbers(self.place / "sweep/table.csv")
        shutil.copytree(self.place / "study", self.place / "kept/study")
        shutil.copytree(self.place / "sweep", self.place / "kept/sweep")

    @property
    def fmus(self) -> tuple[object, ...]:
        """Folder of the FMUs, as an option."""
        return ("--fmus", self._fmus)

    def restore(self, name: str) -> None:
        """Bring a folder of results back to how its command left it."""
        shutil.rmtree(self.place / name, ignore_errors=True)
        shutil.copytree(self.place / "kept" / name, self.place / name)

    # each returns what became of a case: one of RIGHT, SAID, MADE, or of BAD

    def record_listed(self, r: random.Random) -> str:
        """Alter a run.json and list the runs."""
        file = self._spoil(self._record(r), altered, r)
        told = call("list", "runs", "study")
        # a list is of all runs: those whose records are whole keep their lines
        return _judged(told, told.out == self.undisturbed["list"], file)

    def record_in_study(self, r: random.Random) -> str:
        """Alter a run.json and go on with the study: the run is made again."""
        file = self._spoil(self._record(r), altered, r)
        told = call("study", "study.yaml", "--out", "study", "--jobs", "1", *self.fmus)
        return self._made(told, told.out == self.undisturbed["study"], file)

    def experiment(self, r: random.Random) -> str:
        """Alter an experiment.json and judge the study again from its runs."""
        file = self._spoil("study/experiment.json", altered, r)
        told = call("study", "study.yaml", "--out", "study", "--no-run", *self.fmus)
        return _judged(told, told.out == self.undisturbed["study"], file)

    def journal(self, r: random.Random) -> str:
        """Alter a line of a journal and make the table of the sweep from it."""
        file = self._spoil("sweep/runs.jsonl", altered_line, r)
        told = call("sweep", "sweep.yaml", "--out", "sweep", "--no-run", *self.fmus)
        same = told.status != 2 and _numbers(self.place / "sweep/table.csv") == self.numbers
        if not same and told.status != 2:  # what is there must be the undisturbed number, or none
            found = _numbers(self.place / "sweep/table.csv")
            if any(number not in ("", self.numbers[run]) for run, number in found.items()):
                return f"WRONG: {told.err[-500:]}"
        return _judged(told, same, file)

    def journal_in_sweep(self, r: random.Random) -> str:
        """Alter a line of a journal and go on with the sweep: the run is made again."""
        file = self._spoil("sweep/runs.jsonl", altered_line, r)
        told = call("sweep", "sweep.yaml", "--out", "sweep", "--jobs", "1", *self.fmus)
        return self._made(told, (self.place / "sweep/table.csv").read_bytes() == self.table, file)

    def entries(self, r: random.Random) -> str:
        """Alter a file of tuned entries and load the ranking that names it."""
        for name in ("ranking.yaml", "tuned.yaml"):
            shutil.copy(SHIPPED / "proving_ground" / name, self.place)
        before = load_ranking(self.place / "ranking.yaml").entries
        file = self._spoil("tuned.yaml", lambda data, r: mutated(data, YAML, r), r)
        with warnings.catch_warnings(record=True) as said:
            warnings.simplefilter("always", RecordWarning)
            try:
                found = load_ranking(self.place / "ranking.yaml")
            except YawbenchError as error:
                return _judged(Told(2, "", str(error)), False, file)
        words = "\n".join(str(one.message) for one in said)
        same = {name: one for name, (one, _) in found.entries.items()} == {
            name: one for name, (one, _) in before.items()
        }
        return _judged(Told(0, "", words), same, file)

    def _record(self, r: random.Random) -> str:
        return f"study/{r.choice(('off', 'fuzzy_sideslip'))}/run.json"

    def _spoil(self, name: str, how: Callable[[bytes, random.Random], bytes], r: random.Random) -> Path:
        folder = name.partition("/")[0]
        if "/" in name:
            self.restore(folder)
        file = self.place / name
        data = file.read_bytes()
        while (spoilt := how(data, r)) == data:
            pass
        file.write_bytes(spoilt)
        return file.relative_to(self.place)

    def _made(self, told: Told, same: bool, file: Path) -> str:
        outcome = _judged(told, same, file)
        if outcome == SAID and not same:
            # a folder that cannot be told from another's is refused; all else comes to the same again
            return SAID if told.status == 2 else f"WRONG: {told.out} {told.err[-500:]}"
        return MADE if outcome == SAID else outcome


def _judged(told: Told, same: bool, file: Path) -> str:
    said = told.err + told.out
    if told.status not in (0, 1, 2) or "error in yawbench itself" in said or "Traceback (most" in said:
        return f"OWN ERROR: {said[-1500:]}"
    if re.search(re.escape(file.name) + NAMED, re.sub(r"\s+", "", said)):  # tables fold their notes
        return SAID
    return RIGHT if same else f"NOT NAMED: {said[-1500:]}"


def _numbers(table: Path) -> dict[str, str]:
    """Return the metric of every run of a table of the sweep."""
    with table.open() as stream:
        return {row["amplitude [rad]"]: row["moment [N.m]"] for row in csv.DictReader(stream)}


@contextlib.contextmanager
def _chdir(place: Path) -> Iterator[None]:
    before = Path.cwd()
    os.chdir(place)
    try:
        yield
    finally:
        os.chdir(before)


KINDS = ("record_listed", "record_in_study", "experiment", "journal", "journal_in_sweep", "entries")


def trial(
    counts: dict[str, int], seed: int, place: Path, fmus: Path
) -> Iterator[tuple[str, Counter[str], list[str]]]:
    """Yield each kind with what became of its cases, and those that did not hold."""
    made = Trial(place, fmus)
    with _chdir(made.place):
        for kind, count in counts.items():
            tally: Counter[str] = Counter()
            notes = []
            for number in range(count):
                outcome = getattr(made, kind)(random.Random(f"{seed} {kind} {number}"))
                tally[outcome.partition(":")[0]] += 1
                if outcome.startswith(BAD):
                    notes.append(f"{kind} {number}, seed {seed}: {outcome}")
            yield kind, tally, notes


def main() -> None:
    """Run what the command line asks for."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--each", type=int, default=100)
    parser.add_argument("--runs", type=int, default=20, help="cases that make runs again")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", choices=KINDS, action="append")
    given = parser.parse_args()
    failed = 0
    with tempfile.TemporaryDirectory(prefix="records-") as folder:
        build_all(Path(folder) / "fmus", components=UNITS)
        counts = {
            kind: given.runs if kind.endswith(("_study", "_sweep")) else given.each
            for kind in given.only or KINDS
        }
        for kind, tally, notes in trial(counts, given.seed, Path(folder), Path(folder) / "fmus"):
            failed += len(notes)
            print(f"{kind}: {sum(tally.values())} cases, seed {given.seed}: {dict(sorted(tally.items()))}")
            for note in notes[:10]:
                print("  ", note)
            sys.stdout.flush()
    sys.exit(bool(failed))


if __name__ == "__main__":
    main()
