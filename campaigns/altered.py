"""Files of users and records altered at random, given to commands: `python -m campaigns.altered`.

    python -m campaigns.altered --each 400 --seed 1 --jobs 2
    python -m campaigns.altered text archive --each 2000
    python -m campaigns.altered --only fit:17

In vehicle, fit and measurement files, and in what runs, studies, sweeps and fits have written, an alteration
keeps a file well-formed and gives one or a few of its values another magnitude, sign, type, length or place,
or one from another file: what passes the readers and is computed with. The groups of `BROKEN` have what
readers must refuse (`mutate`): bytes, tokens and structure of scenario, vehicle, study and sweep files, of an
SSP archive and of recorded results, and values of options. Each case is a command in a process of its own.
What must hold: exit status 0, 1 or 2, a sentence unless it is 0, and neither a traceback, a control
character, a warning of a library, a hang nor a huge memory. Of what is broken, only results are written.
"""

from __future__ import annotations

import argparse
import contextlib
import copy
import io
import json
import os
import random
import re
import resource
import select
import shutil
import signal
import sys
import tempfile
import threading
import time
import urllib.request
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from ruamel.yaml import YAML

from tests.command_line import status_of
from tests.commands.test_batch_commands import SCENARIO as HALF
from tests.commands.test_batch_commands import STUDY
from tests.measured_cars.test_fit import FIT, MEASURED
from tests.measured_cars.test_fit import SCENARIO as OF_FIT
from tests.trees import snapshot
from yawbench.cli import main as yawbench
from yawbench.foundation.errors import YawbenchError

from . import mutate
from .child import working_in
from .kills import SWEEP

ROOT = Path(__file__).resolve().parents[1]
FMUS = ("--fmus", str(ROOT / "fmus"))
WHOLE = "scenarios/fnn_sideslip/25mps.yaml"
SHORT = ("--set", "stop_time=0.02", "--set", "step_size=0.002")
TEMPORARY = "temporary"
LIMIT = 60
"""Processor time that a command may take [s]; chosen: ten times what the longest takes."""
MEMORY = 8_000_000_000
"""Address space that a command may take [bytes]; chosen: several times what one takes."""
NOISE = (
    "Traceback",
    "yawbench itself",
    "is not understood",
    "Warning:",
    "Segmentation",
    "Unraisable",
    "\x1b",
)
"""Words that no command may print."""
BROKEN = ("text", "archive", "recorded", "option")
"""Groups of cases that are broken, not only altered."""
FACTORS = (
    -1.0, 0.0, 1e-300, 1e-12, 1e-6, 1e-3, 0.1, 0.5, 0.999999, 1.000001, 2.0, 10.0, 1e3, 1e6, 1e12, 1e300,
)  # fmt: skip
NUMBERS = (0, -1, 1, 2, 3, 7, 100, 2**31, -(2**63), 10**30, 0.5, -0.0, 5e-324, 1e-9, 1e9, 1.7e308)
UNITS = ("s", "ms", "m/s", "km/h", "deg", "rad", "N", "kg", "%", "1", "deg/s", "m/s2", "h", "mm", "")
TEXTS = (
    "", " ", "x", "0", "-1", "nan", "inf", "-inf", "1e999", "none", "*", "a.b", "..", "run.csv", "\u00e9",
    "plant",
)  # fmt: skip
OTHERS: tuple[Any, ...] = (None, True, False, [], {}, [[]], [{}], {"": None}, [0, 1], {"a": 1}, "x")


@dataclass
class Folder:
    """Well-formed files, and results made of them, that cases are made from."""

    place: Path
    cases: dict[str, list[Path]] = field(default_factory=dict)  # group -> files that are altered


def call(*arguments: object) -> int:
    """Return the exit status of a command in this process."""
    with contextlib.redirect_stdout(io.StringIO()):
        return status_of(*arguments)


def base(place: Path) -> Folder:
    """Write the files and make the results that cases are made from."""
    place.mkdir(parents=True)
    shutil.copytree(ROOT / "scenarios", place / "scenarios")
    times = np.arange(0.0, 4.005, 0.02)
    steer = 0.03 * np.sin(2.0 * np.pi * 0.7 * np.maximum(times - 0.3, 0.0))
    np.savetxt(
        place / "steer.csv", np.column_stack([times, steer]), delimiter=",", header="time,steer_angle [rad]",
        comments="",
    )  # fmt: skip
    car = "scenarios/vehicles/mid_size.yaml"
    (place / "truth.yaml").write_text(OF_FIT.format(vehicle=car, stop=4, file="steer.csv"))
    with working_in(place):
        assert call("run", "truth.yaml", *FMUS, "--out", "out/truth") == 0
        from yawbench.orchestrator.results.reader import load_results

        results = load_results(Path("out/truth"))
        names = ("velocity_x", "sideslip", "yaw_rate", "acceleration_y")
        columns = [np.interp(times, results.time, results[f"plant.{name}"]) for name in names]
        header = ",".join(["time", "steer_angle", *names])
        np.savetxt(
            "run.csv", np.column_stack([times, steer, *columns]), delimiter=",", header=header, comments=""
        )
        Path("measured.yaml").write_text(MEASURED)
        Path("scenario.yaml").write_text(OF_FIT.format(vehicle=car, stop=4, file="measured.yaml"))
        Path("short.yaml").write_text(OF_FIT.format(vehicle=car, stop=0.1, file="steer.csv"))
        Path("fit.yaml").write_text(FIT + "most_sets: 12\n")
        Path("one.yaml").write_text(FIT.partition("  vehicle.cornering")[0] + "most_sets: 6\n")
        Path("half.yaml").write_text(HALF)
        Path("study.yaml").write_text(STUDY)
        Path("sweep.yaml").write_text(SWEEP + "keep: all\n")
        assert call("study", "study.yaml", *FMUS, "--jobs", "1", "--out", "out/study") in (0, 1)
        assert call("sweep", "sweep.yaml", *FMUS, "--jobs", "1", "--out", "out/sweep") == 0
        assert call("fit", "one.yaml", *FMUS, "--jobs", "1", "--out", "out/fit") == 0
        assert call("export-ssp", WHOLE, *FMUS, "--out", "whole.ssp") == 0
        for form in ("csv", "parquet"):
            assert call("run", WHOLE, *FMUS, *SHORT, "--format", form, "--out", f"short/{form}") == 0
    folder = Folder(place)
    folder.cases = {
        "vehicle": sorted((place / "scenarios" / "vehicles").glob("*.yaml")),
        "fit": [place / name for name in ("fit.yaml", "fit.yaml", "one.yaml", "one.yaml", "scenario.yaml")],
        "measurement": [place / "measured.yaml", place / "run.csv"],
        "record": [
            path for name in ("run.json", "experiment.json", "fit.json", "runs.jsonl", "table.csv")
            for path in sorted((place / "out").rglob(name))
        ],
        "text": sorted((place / "scenarios").rglob("*.yaml")),
        "archive": [place / "whole.ssp"],
        "recorded": sorted(path for path in (place / "short").rglob("*") if path.is_file()),
        "option": [place / WHOLE],
    }  # fmt: skip
    return folder


# ---- alterations ----


def other_value(value: Any, others: list[Any], r: random.Random) -> Any:
    """Return what an alteration puts in the place of a value: mostly of its type."""
    if r.random() < 0.15:
        return copy.deepcopy(r.choice(others))
    if r.random() < 0.12:
        return copy.deepcopy(r.choice(OTHERS))
    if isinstance(value, bool) or value is None:
        return r.choice((True, False, None, 0, "x"))
    if isinstance(value, (int, float)):
        with contextlib.suppress(OverflowError):
            if r.random() < 0.6:
                made = value * r.choice(FACTORS)
                return int(made) if isinstance(value, int) and r.random() < 0.7 else made
        return r.choice(NUMBERS)
    if isinstance(value, str):
        number, _, unit = value.partition(" ")
        with contextlib.suppress(ValueError):
            if r.random() < 0.7:
                scaled = float(number) * r.choice(FACTORS)
                return f"{scaled:g} {unit if r.random() < 0.6 else r.choice(UNITS)}".strip()
        return r.choice((*TEXTS, value[: len(value) // 2], value * 2, value.upper()))
    if isinstance(value, list):
        made = copy.deepcopy(value)
        how = r.choice(("empty", "one", "twice", "turned", "shuffled", "nested"))
        if how == "shuffled":
            r.shuffle(made)
        return {"empty": [], "one": made[:1], "twice": made * 2, "turned": made[::-1], "nested": [made]}.get(
            how, made
        )
    if not isinstance(value, dict):  # a date
        return r.choice(TEXTS)
    made = dict(value)
    if made and r.random() < 0.7:
        del made[r.choice(list(made))]
    else:
        made = {} if r.random() < 0.5 else dict(reversed(made.items()))
    return made


def alter(content: Any, others: list[Any], r: random.Random) -> None:
    """Alter one to four values, keys or parts in place."""
    for _ in range(r.choice((1, 1, 1, 2, 4))):
        places = mutate.places_in(content)
        if not places:
            return
        part, key = r.choice(places)
        how = r.random()
        if how < 0.78:
            part[key] = other_value(part[key], others, r)
        elif how < 0.88:
            del part[key]
        elif isinstance(part, dict):
            named, _ = r.choice([place for place in places if isinstance(place[0], dict)])
            part[str(r.choice(list(named) or [""]))] = part.pop(key)
        else:
            part.insert(key, copy.deepcopy(part[key]))


def altered(file: Path, others: list[Any], r: random.Random) -> bytes:
    """Return the bytes of a file after an alteration."""
    raw = file.read_bytes()
    if file.suffix == ".csv":
        rows = [line.split(",") for line in raw.decode().splitlines()]
        for _ in range(r.choice((1, 1, 3, 30))):
            row = r.choice(rows[1:]) if r.random() < 0.85 else rows[0]
            row[r.randrange(len(row))] = str(other_value(r.choice([float("1.5"), row[-1]]), ["x"], r))
        if r.random() < 0.2:
            rows = rows[: r.randrange(len(rows))]
        return "\n".join(map(",".join, rows)).encode(errors="replace")
    if file.suffix == ".jsonl":
        lines = raw.decode().splitlines()
        k = r.randrange(len(lines))
        content = json.loads(lines[k])
        _alter_record(content, others, r)
        lines[k] = json.dumps(content)
        return ("\n".join(lines) + "\n").encode(errors="surrogatepass")
    if file.suffix == ".json":
        content = json.loads(raw)
        _alter_record(content, others, r)
        return json.dumps(content, indent=1).encode(errors="surrogatepass")
    content = YAML(typ="safe").load(raw)
    alter(content, others, r)
    return json.dumps(content, indent=1, default=str).encode(errors="surrogatepass")


def _alter_record(content: dict[str, Any], others: list[Any], r: random.Random) -> None:
    part = content
    inner = [key for key in ("scenario", "fmus", "connections", "diagnostics", "models") if content.get(key)]
    if inner and r.random() < 0.6:
        part = content[r.choice(inner)]
    alter(part, others, r)


def broken(group: str, file: Path, r: random.Random) -> bytes:
    """Return the bytes of a file after mutations; options leave it as it is."""
    raw = file.read_bytes()
    if group == "option":
        return raw
    if group == "archive":
        return mutate.mutated_archive(raw, r)
    how = {".yaml": mutate.YAML, ".json": mutate.JSON, ".csv": mutate.CSV}.get(file.suffix, mutate.ANY)
    return mutate.mutated(raw, how, r)


# ---- cases ----


def command_of_broken(group: str, file: Path, place: Path, r: random.Random) -> tuple[object, ...]:
    """Return the command that a broken file, or value of an option, is given to."""
    if group == "option":
        texts = [text for text in mutate.NASTY if "\0" not in text and text.isprintable()]
        targets = ("plant.mass", "driver.amplitude", "inputs.friction*", "vehicle.mass", "stop_time", "x", "")
        value, target = r.choice(texts), r.choice(targets)
        return r.choice((
            ("check", file, *FMUS, f"--set={target}={value}"),
            ("check", file, *FMUS, f"--swap={r.choice(('controller', 'plant', 'x'))}={value}"),
            ("run", file, *FMUS, *SHORT, "--out", "made", f"--metric={value}"),
            ("plot", file, *FMUS, "--out", "made", f"--panel={value}"),
        ))  # fmt: skip
    if group == "recorded":
        run = file.parent
        return r.choice((
            ("list", "runs", "short"),
            ("diff", run, "out/truth"),
            ("plot", run, "--out", "made"),
            ("evaluate", "turn-response", run, "--no-figures", "--out", "made"),
        ))  # fmt: skip
    if r.random() < 0.1:  # any command, also of other kinds of files
        return (r.choice(("check", "study", "sweep", "tune", "plot", "animate", "export-ssp")), file)
    if "vehicles" in file.parts:
        return command_of("vehicle", file, place, r)
    text = (ROOT / file).read_text(encoding="utf-8") if group == "text" else "units:"
    if re.search(r"(?m)^(axes|runs|like):", text):
        return r.choice((("load", file), ("load", file), ("study", file, "--no-run", *FMUS, "--out", "made")))
    return r.choice((("check", file, *FMUS), ("run", file, *FMUS, *SHORT, "--out", "made")))


def command_of(group: str, file: Path, place: Path, r: random.Random) -> tuple[object, ...]:
    """Return the command that a case is given to, relative to its folder."""
    jobs = ("--jobs", "1")
    if group == "vehicle":
        scenario = (
            (place / "short.yaml").read_text().replace("vehicles/mid_size.yaml", f"vehicles/{file.name}")
        )
        (place / "short.yaml").write_text(scenario)
        plant = r.choice(("plant_seven_dof", "plant_two_dof", "plant_fourteen_dof", "plant_eight_dof"))
        return r.choice((
            ("run", "short.yaml", *FMUS, "--out", "made"),
            ("check", "short.yaml", *FMUS),
            ("vehicle", "show", file, *FMUS, "--plant", plant, "--out", "made/car.svg"),
        ))  # fmt: skip
    if group == "fit":
        fit = "one.yaml" if file.name == "scenario.yaml" else file.name
        return ("fit", fit, *FMUS, *jobs, "--out", "made")
    if group == "measurement":
        return r.choice((
            ("measured", "show", "measured.yaml"),
            ("measured", "show", "measured.yaml", "--out", "made.svg"),
            ("fit", "one.yaml", *FMUS, *jobs, "--out", "made"),
            ("run", "scenario.yaml", *FMUS, "--out", "made", "--set", "stop_time=0.1"),
            ("evaluate", "turn-response", "measured.yaml", "--no-figures", "--out", "made"),
            ("diff", "measured.yaml", "out/truth"),
        ))  # fmt: skip
    folder = file.parent
    run = folder if file.name == "run.json" else Path("out/truth")
    made = (*FMUS, *jobs, "--out")
    readers: list[tuple[object, ...]] = [
        ("list", "runs", "out"),
        ("diff", run, "out/truth"),
        ("plot", run, "--out", "made"),
        ("animate", run, "out/truth", "--out", "made.html"),
        ("evaluate", "turn-response", run, "--no-figures", "--out", "made"),
        ("serve", run),
    ]
    swap = ("--swap", "controller=controller_off,controller_fuzzy_sideslip")
    makers: dict[str, list[tuple[object, ...]]] = {
        "study": [
            ("study", "study.yaml", *made, "out/study"),
            ("study", "study.yaml", *made, "out/study", "--no-run"),
            ("report", "study.yaml", *made, "out/study"),
            ("compare", "half.yaml", *swap, *made, "out/study"),
        ],
        "sweep": [
            ("sweep", "sweep.yaml", *made, "out/sweep"),
            ("sweep", "sweep.yaml", *made, "out/sweep", "--no-run"),
        ],
        "fit": [("fit", "one.yaml", *made, "out/fit")],
        "truth": [("run", "truth.yaml", *FMUS, "--out", "out/truth")],
    }
    own = makers[file.parts[1]]
    return r.choice(readers if file.name == "run.json" and r.random() < 0.5 else own)


def served(run: Path) -> None:
    """Ask a server for its first page, the view of a run and the runs' files."""
    from yawbench.bench.server import ResultsServer
    from yawbench.bench.sliders import Bench

    bench = Bench()
    with ResultsServer(Path("out"), bench) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        for path in ("", f"view?run={run.relative_to('out').as_posix()}", "view?run=truth"):
            with contextlib.suppress(urllib.request.HTTPError):  # which is an answer
                urllib.request.urlopen(f"{server.address}{path}").read()
        server.shutdown()
    bench.close()


def loaded(file: Path) -> int:
    """Return the exit status of reading an experiment file and its points."""
    from yawbench.studies.load_experiment import load_experiment

    try:
        assert load_experiment(file).points
    except YawbenchError as error:
        print(error, file=sys.stderr)
        return error.exit_status
    return 0


def case(group: str, number: int, seed: int, folder: Folder, box: Path) -> tuple[object, ...]:
    """Write a case into an empty folder; return its command."""
    r = random.Random(f"{seed}/{group}/{number}")
    shutil.copytree(folder.place, box)
    source = r.choice(folder.cases[group])
    file = source.relative_to(folder.place)
    if group in BROKEN:
        (box / file).write_bytes(broken(group, source, r))
        return command_of_broken(group, file, box, r)
    pool = [path for path in folder.cases[group] if path.suffix in (".yaml", ".json")] or [
        folder.place / "fit.yaml"
    ]
    other = YAML(typ="safe").load(r.choice(pool).read_bytes())
    others = [part[key] for part, key in mutate.places_in(other)]
    (box / file).write_bytes(altered(source, others, r))
    return command_of(group, file, box, r)


def _child(arguments: tuple[object, ...], box: Path, said: Path) -> None:
    """Execute a command in this process, which was forked for it."""
    os.chdir(box)
    os.setsid()
    stream = os.open(said, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
    os.dup2(stream, 1)
    os.dup2(stream, 2)
    tempfile.tempdir = None
    os.environ["TMPDIR"] = str(box / TEMPORARY)
    os.mkdir(TEMPORARY)
    resource.setrlimit(resource.RLIMIT_CPU, (LIMIT, LIMIT + 5))
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    sys.stdout = open(1, "w", closefd=False)  # noqa: SIM115
    sys.stderr = open(2, "w", closefd=False)  # noqa: SIM115
    status = 99
    try:
        status = 0
        if arguments[0] == "serve":
            served(Path(str(arguments[1])))
        elif arguments[0] == "load":
            status = loaded(Path(str(arguments[1])))
        else:
            yawbench([str(argument) for argument in arguments])
    except SystemExit as ended:
        status = int(ended.code or 0)
    except BaseException:
        import traceback

        traceback.print_exc()
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(status)


def outcome_of(arguments: tuple[object, ...], box: Path) -> tuple[str, str]:
    """Execute a command in a process of its own; return what became of it, and what was said."""
    said = box.with_suffix(".said")
    child = os.fork()
    if child == 0:
        _child(arguments, box, said)
    watched = os.pidfd_open(child)
    late = not select.select([watched], [], [], 12 * LIMIT)[0]
    if late:
        os.killpg(child, signal.SIGKILL)
    os.close(watched)
    code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    text = said.read_text(errors="replace")
    said.unlink()
    if late or code in (-signal.SIGXCPU, -signal.SIGKILL):
        return "HANG", text
    if code not in (0, 1, 2):
        return "DIED", f"exit status {code}\n{text}"
    if noise := [word for word in NOISE if word in text]:
        return "NOISE" if noise == ["Warning:"] else "TRACEBACK", text
    if code and not text.strip():
        return "NO SENTENCE", text
    return ("taken", "failed in a sentence", "refused in a sentence")[code], text


def _of_results(path: Path, box: Path) -> bool:
    """Return whether a command may write a file: results, figures beside recorded ones, what is temporary."""
    return path.relative_to(box).parts[0] in ("made", "results", "short", TEMPORARY) or path.suffix == ".ssp"


def trial(
    group: str, numbers: list[int], seed: int, folder: Folder, jobs: int, keep: Path | None = None
) -> tuple[Counter[str], list[str]]:
    """Execute cases; return the counts of their outcomes, and what did not hold with what repeats it."""
    counts: Counter[str] = Counter()
    notes: list[str] = []

    def one(number: int) -> None:
        box = (keep or folder.place.parent) / f"{group}_{number}"
        arguments = case(group, number, seed, folder, box)
        before = snapshot(box)
        outcome, text = outcome_of(arguments, box)
        changed = {path for path, state in snapshot(box).items() if before.get(path) != state} - {str(box)}
        if group in BROKEN and (written := [path for path in changed if not _of_results(Path(path), box)]):
            outcome, text = "WROTE", f"{text}\n{written}"
        counts[outcome] += 1
        if outcome.isupper() or keep:
            command = " ".join(str(argument) for argument in arguments)
            notes.append(f"{outcome} --only {group}:{number} --seed {seed}: {command}\n{text[-1500:]}")
            print(notes[-1], file=sys.stderr, flush=True)
        if not keep:
            shutil.rmtree(box)

    with ThreadPoolExecutor(jobs) as pool:
        list(pool.map(one, numbers))
    return counts, notes


GROUPS: tuple[str, ...] = ("vehicle", "fit", "measurement", "record", *BROKEN)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("groups", nargs="*", default=list(GROUPS), help="default: all")
    parser.add_argument("--each", type=int, default=400, help="cases of each group")
    parser.add_argument("--first", type=int, default=0, help="number of the first case")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--only", help="GROUP:NUMBER: repeat a case, and keep its folder")
    given = parser.parse_args()
    failed = False
    with tempfile.TemporaryDirectory(prefix="altered-") as place:
        folder = base(Path(place, "base"))
        if given.only:
            group, number = given.only.split(":")
            kept = Path(tempfile.mkdtemp(prefix="altered-kept-"))
            _, notes = trial(group, [int(number)], given.seed, folder, 1, kept)
            print(f"kept: {kept}" if notes else "nothing was said")
            return
        for group in given.groups:
            began = time.monotonic()
            numbers = list(range(given.first, given.first + given.each))
            counts, notes = trial(group, numbers, given.seed, folder, given.jobs)
            words = ", ".join(f"{count} {outcome}" for outcome, count in counts.most_common())
            print(f"{group}: {words} ({time.monotonic() - began:.0f} s)", flush=True)
            failed = failed or bool(notes)
    sys.exit(failed)


if __name__ == "__main__":
    main()
