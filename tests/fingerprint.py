"""A fingerprint of everything the tool computes: `python -m tests.fingerprint --out FILE`.

For whoever changes the structure of the program and none of its figures: make it before, compare after. It
calls nothing but the command line, so that no name of a module matters to it: builds every FMU, runs every
scenario, the studies of the papers at their chosen point, a sweep, the quick ranking, a tuning, standard
tests, exports, faults. Every artefact is a line with its SHA-256; the texts go into a second file, so that a
comparison can show what differs.
"""

from __future__ import annotations

import argparse
import gzip
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from itertools import zip_longest
from pathlib import Path
from typing import NamedTuple

from tests.artefacts import artefacts_in, masked, numbers_in, sha256

ROOT = Path(__file__).resolve().parents[1]
BASE = "scenarios/fnn_sideslip/25mps.yaml"
SHORT = ("--set", "stop_time=3")

EVALUATED = {
    "proving_ground/step_steer": "step-steer",
    "proving_ground/sine_sweep": "frequency-response",
    "proving_ground/slow_ramp": "understeer-gradient",
    "proving_ground/slowly_increasing_steer": "slowly-increasing-steer",
    "proving_ground/braking_in_turn": "turn-response",
    "proving_ground/lift_off_in_turn": "turn-response",
    "proving_ground/iso_3888_1": "lane-change",
    "proving_ground/iso_3888_2": "lane-change",
    "proving_ground/friction_jump_braking": "straight-braking",
    "proving_ground/side_wind_gust": "side-wind",
    "road/split_braking": "straight-braking",
}
"""Scenario -> the standard test that its run is evaluated as."""
QUICK_SCENARIOS = (
    "fnn_sideslip/25mps",
    "fuzzy_pid/ramp",
    "fuzzy_sliding_mode/monitored",
    "proving_ground/step_steer",
    "real_signals/told_fnn",
    "road/friction_jump",
    "tyre_file/lane_change",
)
STUDIES = ("fnn_sideslip", "fuzzy_sliding_mode", "fuzzy_pid", "fuzzy_feedback")
FAULTS = (
    "plant.sideslip -> controller: noise 0.2 deg from 0.5 s",
    "plant.velocity_x -> reference: delay 40 ms",
    "driver.steer_angle -> plant: freeze from 2 s until 2.2 s",
    "controller.yaw_moment: loss 50 % from 1 s",
)
SWEEP = """\
title: A small sweep
scenario: ../fnn_sideslip/25mps.yaml
set: {driver.amplitude: 0.05}
stop_time: 4.0
axes:
  friction: {vary: "inputs.friction*", values: [0.3, 0.9]}
  speed: {vary: plant.initial_speed, from: 15, to: 25, count: 2, says: Entry speed}
  control: {vary: controller, values: {controller_off: no control, controller_fnn: neural network}}
metrics:
  sideslip: {metric: peak(sideslip)}
  error: {metric: relative_peak_error(sideslip)}
limits:
  stable: {says: Largest speed below 10 degrees, of: speed, holds_if: [{metric: sideslip, at_most: 10 deg}]}
figures:
  - {name: sideslip, kind: curve, metric: sideslip, x: speed, lines: control, panels: friction}
"""
CAMPAIGN = """\
title: A small fault campaign
scenario: ../fuzzy_feedback/single_sine.yaml
stop_time: 3.0
axes:
  fault:
    vary: faults.plant.yaw_rate -> controller
    values: {none: healthy, freeze from 1 s: frozen, bias 3 deg/s from 1 s: biased}
metrics:
  sideslip: {metric: peak(sideslip)}
"""
TUNING = """\
title: A small tuning
step_size: 0.002
stop_time: 3.0
runs:
  - {name: sine, scenario: ../fnn_sideslip/25mps.yaml}
metrics:
  error: {metric: relative_peak_error(sideslip)}
derived:
  cost: {says: Largest sideslip error, expression: e, of: {e: {run: sine, metric: error}}, unit: "%"}
tuning:
  objective: cost
  population: 5
  generations: 2
  seed: 1
  laws:
    fuzzy sideslip:
      swap: {controller: controller_fuzzy_sideslip}
      axes:
        error_range: {vary: controller.error_range, from: 0.00125, to: 0.02, spacing: log}
        moment_range: {vary: controller.moment_range, from: 1250, to: 20000, spacing: log}
    PID:
      swap: {controller: controller_pid}
      axes:
        gain: {vary: controller.sideslip_proportional_gain, from: 2.5e+5, to: 4.0e+6, spacing: log}
"""
FILES = {"sweep": SWEEP, "campaign": CAMPAIGN, "tuning": TUNING}
"""Experiments of its own, small enough: a file of scenarios/fingerprint/ each."""


KILLED = -9
"""The exit status of a process that SIGKILL has ended."""
PROGRESS = re.compile(r"^\[ *\d+/\d+\].*\n?", re.MULTILINE)


class Job(NamedTuple):
    """Commands that follow each other; they write into a folder of their own."""

    name: str
    commands: tuple[tuple[str, ...], ...]
    cost: int = 1
    """Rough duration: the longest are begun first."""
    quick: bool = False
    """Whether --quick does it too."""
    printed: bool = True
    """Whether what it prints is an artefact; a run's and a long experiment's progress is not."""


class Comparison(NamedTuple):
    """Difference between two fingerprints, by name."""

    differing: list[str]
    missing: list[str]
    new: list[str]

    def __bool__(self) -> bool:
        return any(self)


def jobs(scenarios: Path, quick: bool = False) -> list[Job]:
    """Return all that is run, the longest first."""
    every = [*_scenario_jobs(scenarios), *_experiment_jobs(quick), *_other_jobs()]
    return sorted((job for job in every if job.quick or not quick), key=lambda job: -job.cost)


def _scenario_jobs(folder: Path) -> list[Job]:
    found = []
    for file in sorted(folder.glob("*/*.yaml")):
        name = file.relative_to(folder).with_suffix("").as_posix()
        keys = {line.partition(":")[0] for line in file.read_text(encoding="utf-8").splitlines()}
        if "units" not in keys:  # a study, a sweep, a vehicle
            continue
        out = f"out/scenarios/{name}"
        commands = [("run", f"scenarios/{name}.yaml", "--out", out, "--metric", "standard")]
        if test := EVALUATED.get(name):
            commands.append(("evaluate", test, out))
        found.append(Job(f"scenarios/{name}", tuple(commands), 5, name in QUICK_SCENARIOS))
    return found


def _experiment_jobs(quick: bool) -> list[Job]:
    one = ("--jobs", "1")  # several commands run at a time
    ranking = ("rank", "--quick", "--out", "out/ranking", *one)
    if quick:
        ranking += ("--condition", "hard", "--only", "none", "--only", "pid_tuned", "--only", "fnn")
    found = [Job("ranking", (ranking,), 100, True, False)]
    for study in STUDIES:
        out = f"out/studies/{study}"
        command = (
            "study",
            f"scenarios/{study}/study.yaml",
            "--quick",
            "--format",
            "parquet",
            *one,
            "--out",
            out,
        )
        found.append(Job(f"studies/{study}", (command,), 60, study == "fuzzy_feedback", False))
    for name, command in {"sweep": "sweep", "campaign": "sweep", "tuning": "tune"}.items():
        made = (command, f"scenarios/fingerprint/{name}.yaml", *one, "--out", f"out/{name}")
        found.append(Job(name, (made,), 20, True, False))
    swaps = ("--swap", "controller=controller_off,controller_fnn,controller_pid")
    compared = ("compare", BASE, *SHORT, *swaps, *one, "--out", "out/compare")
    found.append(Job("compare", (compared,), 10, printed=False))
    driven = ("drive", "iso-3888-2", *one, "--out", "out/drive")
    found.append(Job("drive", (driven,), 50, printed=False))
    converged = ("converge", BASE, "--set", "stop_time=2", "--halvings", "2", "--out", "out/converge")
    found.append(Job("converge", (converged,), 20, printed=False))
    return found


def _other_jobs() -> list[Job]:
    def run(name: str, *options: str) -> tuple[str, ...]:
        return ("run", BASE, *SHORT, *options, "--out", f"out/{name}")

    faults = [word for fault in FAULTS for word in ("--fault", fault)]
    swap = ("--swap", "controller=controller_pid", "--set", "controller.step_size=5 ms")
    exported = ("export-ssp", BASE, *SHORT, "--out", "out/ssp/25mps.ssp")
    return [
        Job("parquet", (run("parquet", "--format", "parquet"),), 3, True),
        Job("faults", (run("faults", *faults),), 3, True),
        Job("isolated", (run("isolated", "--isolate"),), 20, True),
        Job("jacobi", (run("jacobi", "--set", "algorithm=jacobi", "--set", "plant.mass=1200"),), 3),
        Job("gauss_seidel", (run("gauss_seidel", "--set", "algorithm=gauss_seidel"),), 3),
        Job(
            "diff",
            (
                run("diff/a"), run("diff/b", *swap), ("diff", "out/diff/a", "out/diff/b"),
                ("plot", "out/diff/a", "out/diff/b", "--out", "out/diff/plot"),
                ("animate", "out/diff/a", "out/diff/b", "--out", "out/diff/view.html"),
            ),
            10, True,
        ),
        Job("ssp", (exported, ("run", "out/ssp/25mps.ssp", "--out", "out/ssp/run")), 5, True),
        Job("ssp_2", (("export-ssp", BASE, "--standard", "2.0", "--out", "out/ssp_2/25mps.ssp"),), 2),
        Job("check", (("check", "scenarios/real_signals/told_fnn.yaml", "--all"),), 2, True),
        Job("check_faults", (("check", BASE, *faults),), 2),
        Job("signals", (("list", "signals"),), 2, True),
        Job("metrics", (("list", "metrics"),), 2, True),
        Job("vehicles", (("list", "vehicles"),), 2),
        Job("tyre", (("tyre", "show", "tyre_magic_formula"),), 5),
        Job("vehicle", (("vehicle", "show", "scenarios/vehicles/hard.yaml"),), 30),
        # What is refused: the sentence, and the exit status.
        Job("refused", (run("refused", "--set", "plant.mas=1"), ("check", BASE, "--set", "friction=-1")), 2),
    ]  # fmt: skip


def fingerprint(folder: Path, quick: bool = False, only: Sequence[str] = ()) -> dict[str, str]:
    """Run everything in an empty folder; return name -> text of all artefacts, sorted by name.

    Args:
        folder: for all that is written.
        quick: leaves out what takes longest.
        only: names of jobs that are run alone.
    """
    work = folder.resolve()
    shutil.copytree(
        ROOT / "scenarios", work / "scenarios", ignore=shutil.ignore_patterns("__pycache__", "*.py")
    )
    own = work / "scenarios" / "fingerprint"
    own.mkdir()
    for name, text in FILES.items():
        (own / f"{name}.yaml").write_text(text, encoding="utf-8")
    (work / "out").mkdir()
    built = _call(("build", "--out", "fmus"), work)
    if built.returncode:
        raise SystemExit(built.stderr)
    found = {f"fmus/{name}": text for name, text in artefacts_in(work / "fmus", work).items()}
    todo = [job for job in jobs(ROOT / "scenarios", quick) if not only or job.name in only]
    with ThreadPoolExecutor(os.cpu_count() or 1) as pool:
        running = {pool.submit(_run, job, work): job for job in todo}
        for k, future in enumerate(as_completed(running), start=1):
            found |= future.result()
            failed = [name for name in future.result() if name.endswith(": error")]
            print(f"[{k}/{len(todo)}] {running[future].name}", *failed, file=sys.stderr)
    return dict(sorted(found.items()))


def _run(job: Job, work: Path) -> dict[str, str]:
    found = {}
    for k, command in enumerate(job.commands, start=1):
        ended = _call(command, work)
        if ended.returncode == KILLED:  # by somebody else: for want of memory, say
            ended = _call(command, work)
        name = f"{job.name}/{k} {command[0]}"
        found[f"{name}: exit status"] = f"{ended.returncode}\n"
        if job.printed:
            found[f"{name}: printed"] = masked(ended.stdout, work)
        if ended.returncode:
            found[f"{name}: error"] = masked(PROGRESS.sub("", ended.stderr), work)
    folder = work / "out" / job.name
    if folder.is_dir():
        found |= {f"{job.name}/{name}": text for name, text in artefacts_in(folder, work).items()}
    return found


def _call(command: Sequence[str], work: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [*_console_script(), *command],
        cwd=work, env=_environment(work), capture_output=True, text=True, encoding="utf-8", check=False,
    )  # fmt: skip


def _console_script() -> list[str]:
    """Return the command of the tool: its script beside the interpreter, whatever module that calls."""
    script = shutil.which("yawbench", path=str(Path(sys.executable).parent))
    if script is None:
        raise SystemExit(f"No yawbench beside {sys.executable}: pip install --editable .")
    return [sys.executable, script] if os.name != "nt" else [script]


def _environment(work: Path) -> dict[str, str]:
    """Return an environment with this checkout's sources and a cache of its own, without colours."""
    return {name: value for name, value in os.environ.items() if not name.startswith("YAWBENCH_")} | {
        "PYTHONPATH": str(ROOT),
        "XDG_CACHE_HOME": str(work / "cache"),
        "YAWBENCH_NO_BUILD": "1",
        "COLUMNS": "160",
        "NO_COLOR": "1",
        "TERM": "dumb",
        "PYTHONIOENCODING": "utf-8",
    }


def lines_of(texts: Mapping[str, str]) -> list[str]:
    """Return a line per artefact: `<sha256>  <name>`, sorted by name."""
    return [f"{sha256(texts[name])}  {name}" for name in sorted(texts)]


def hashes_in(lines: Iterable[str]) -> dict[str, str]:
    """Return name -> hash of the lines of a fingerprint."""
    split = (line.rstrip("\n").partition("  ") for line in lines if line.strip())
    return {name: digest for digest, _, name in split}


def compare(before: Mapping[str, str], after: Mapping[str, str]) -> Comparison:
    """Return what differs between two fingerprints, each name -> hash."""
    return Comparison(
        sorted(name for name in before.keys() & after.keys() if before[name] != after[name]),
        sorted(before.keys() - after.keys()),
        sorted(after.keys() - before.keys()),
    )


def part_of(hashes: Mapping[str, str], only: Sequence[str]) -> dict[str, str]:
    """Return the hashes of some jobs, and of the FMUs; of all if `only` is empty."""
    kept = tuple(f"{name}/" for name in ("fmus", *only))
    return {name: digest for name, digest in hashes.items() if not only or name.startswith(kept)}


def first_difference(before: str, after: str) -> tuple[int, str, str]:
    """Return number and content of the first line in which two texts differ; a missing line is empty."""
    pairs = zip_longest(before.splitlines(), after.splitlines(), fillvalue="")
    return next((k, old, new) for k, (old, new) in enumerate(pairs, start=1) if old != new)


def report(found: Comparison, before: Mapping[str, str], after: Mapping[str, str]) -> list[str]:
    """Return what to print of a comparison.

    Args:
        found: the comparison.
        before, after: name -> text, as far as there are texts.
    """
    lines = []
    for name in found.differing:
        if name not in before or name not in after:
            lines.append(f"differs: {name}")
            continue
        words = ", its numbers do not" if numbers_in(before[name]) == numbers_in(after[name]) else ""
        number, old, new = first_difference(before[name], after[name])
        lines += [
            f"differs{words}: {name}, line {number}",
            f"  - {_short(old, new)}",
            f"  + {_short(new, old)}",
        ]
    lines += [f"missing: {name}" for name in found.missing]
    lines += [f"new: {name}" for name in found.new]
    lines.append(f"{len(found.differing)} differ, {len(found.missing)} are missing, {len(found.new)} are new")
    return lines


def _short(line: str, other: str, width: int = 140) -> str:
    """Return the part of a line from shortly before it differs from another."""
    same = next((k for k, (one, two) in enumerate(zip(line, other, strict=False)) if one != two), len(line))
    start = max(same - width // 2, 0)
    shown = line[start : start + width]
    return f"{'...' if start else ''}{shown}{'...' if len(line) > start + width else ''}"


def texts_beside(file: Path) -> Path:
    """Return the file that holds the texts of a fingerprint."""
    return file.with_name(f"{file.name}.texts.gz")


def write(texts: Mapping[str, str], file: Path) -> None:
    """Write a fingerprint, and its texts beside it."""
    file.write_text("".join(f"{line}\n" for line in lines_of(texts)), encoding="utf-8")
    with gzip.open(texts_beside(file), "wt", encoding="utf-8") as packed:
        json.dump(texts, packed, ensure_ascii=False)


def read(file: Path) -> tuple[dict[str, str], dict[str, str]]:
    """Return the hashes of a fingerprint, and its texts if they are there."""
    hashes = hashes_in(file.read_text(encoding="utf-8").splitlines())
    if not texts_beside(file).exists():
        return hashes, {}
    with gzip.open(texts_beside(file), "rt", encoding="utf-8") as packed:
        return hashes, json.load(packed)


def main(arguments: list[str] | None = None) -> int:
    """Make a fingerprint; return 1 if it differs from the one to compare with."""
    parser = argparse.ArgumentParser(
        prog="python -m tests.fingerprint", description=__doc__.partition("\n")[0]
    )
    parser.add_argument("--out", type=Path, metavar="FILE", help="write it here instead of printing it")
    parser.add_argument("--compare", type=Path, metavar="FILE", help="show what differs from an earlier one")
    parser.add_argument("--quick", action="store_true", help="a part of everything")
    parser.add_argument("--only", metavar="JOB", action="append", default=[], help="this alone; repeatable")
    chosen = parser.parse_args(arguments)
    known = [job.name for job in jobs(ROOT / "scenarios", chosen.quick)]
    if wrong := [name for name in chosen.only if name not in known]:
        parser.error(f"--only {wrong[0]}: there is no such job; known: {', '.join(known)}")
    if chosen.compare and not chosen.compare.is_file():
        parser.error(f"--compare {chosen.compare}: there is no such file")
    before = read(chosen.compare) if chosen.compare else None
    with tempfile.TemporaryDirectory() as folder:
        texts = fingerprint(Path(folder), chosen.quick, chosen.only)
    hashes = hashes_in(lines_of(texts))
    if chosen.out:
        write(texts, chosen.out)
    elif before is None:
        print("\n".join(lines_of(texts)))
    if before is None:
        return 0
    found = compare(part_of(before[0], chosen.only), hashes)
    print("\n".join(report(found, before[1], texts)))
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
