"""Foreign FMUs here and in FMPy, to the last bit: `python -m tests.compare_fmpy FOLDER`.

Every FMU for co-simulation in a folder is run twice, each time in a process of its own: by `yawbench run`
as the only unit of a scenario, and by a loop that calls FMPy's functions at the same points with the same
step. Both record all outputs that are numbers, of an FMU without outputs its local variables. The table
says whether each FMU ran, or why not, and in how many values the two differ. The exit status is 1 if a
value differs, or if an FMU runs in FMPy and not here.

Inputs keep their start values; with `--inputs sine`, Real inputs follow a sine around them.
"""

from __future__ import annotations

import argparse
import itertools
import json
import math
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

STEPS = 100
"""Communication steps of a run; chosen: enough for events, and a second of time."""
LOCALS = 20
"""Local variables recorded of an FMU without outputs; chosen: enough to see a difference."""
LIMIT = 120.0
"""Time that a run may take [s]; chosen: far longer than a run takes."""
AMPLITUDE, PERIOD = 0.01, 37
"""Amplitude of the sine, relative to 1 plus the start value, and its period in steps; chosen: small, so that
FMUs stay where they work."""
COLUMNS = ("FMU", "FMI", "FMPy", "here", "values that differ")


@dataclass(frozen=True)
class Job:
    """A run of an FMU, the same here and in FMPy; times in seconds, as fractions in text."""

    path: str
    start: str
    step: str
    tolerance: float | None
    inputs: dict[str, list[float] | float | str]
    """Name of an input -> its value, or its values at the beginning of all steps."""
    record: list[str]
    validate: bool

    def times(self) -> list[float]:
        """Return the communication points."""
        return [float(Fraction(self.start) + k * Fraction(self.step)) for k in range(STEPS + 1)]


@dataclass(frozen=True)
class Comparison:
    """Outcome of an FMU in FMPy and here: "ran", or why not; and the values that differ."""

    name: str
    fmi: str
    theirs: str
    ours: str
    differing: int | None = None
    values: int = 0
    example: str = ""

    @property
    def agrees(self) -> bool:
        """Whether both ran with the same values, or it does not run in FMPy."""
        return self.theirs != "ran" or self.differing == 0

    @property
    def row(self) -> tuple[str, ...]:
        """Cells of `COLUMNS`."""
        differing = "-" if self.differing is None else f"{self.differing} of {self.values}{self.example}"
        return self.name, self.fmi, self.theirs, self.ours, differing


def elements(variable: Any) -> list[str]:
    """Return the names of the elements of a variable, counted from 1."""
    if not variable.shape:
        return [variable.name]
    places = itertools.product(*(range(1, n + 1) for n in variable.shape))
    return [f"{variable.name}[{','.join(map(str, place))}]" for place in places]


def accessor(variable: Any, modern: bool) -> str:
    """Return the type of a variable as in the names of FMI functions."""
    return {"Enumeration": "Int64" if modern else "Integer"}.get(variable.type, variable.type)


def numbers(description: Any, causality: str) -> list[Any]:
    """Return the variables of a causality that are numbers."""
    return [
        v
        for v in description.modelVariables
        if v.causality == causality and v.type not in ("String", "Binary", "Clock") and not v.clocks
    ]


def watched(description: Any) -> list[Any]:
    """Return the variables to record: outputs, else local variables that may change."""
    moving = [v for v in numbers(description, "local") if v.variability not in ("constant", "fixed")]
    return numbers(description, "output") or moving[:LOCALS]


REALS = ("Real", "Float64", "Float32")


def starts(variable: Any) -> list[float]:
    """Return the start values of the elements of an input."""
    kind = bool if variable.type == "Boolean" else float if variable.type in REALS else int
    words = str(variable.start or "0").split()
    values = [kind(word == "true" if kind is bool else float(word)) for word in words]
    count = math.prod(variable.shape or ())
    return values * count if len(values) == 1 else values


def sine(value: float, variable: Any) -> list[float]:
    """Return a sine around a value, at the beginning of all steps, within the limits of its input."""
    lowest, highest = float(variable.min or -math.inf), float(variable.max or math.inf)
    swing = AMPLITUDE * (1 + abs(value))
    wave = (value + swing * math.sin(2 * math.pi * k / PERIOD) for k in range(STEPS + 1))
    return [min(max(number, lowest), highest) for number in wave]


def job_of(path: Path, inputs: str, validate: bool) -> tuple[Job | None, str, str]:
    """Return the job for an FMU, its version of FMI, and why there is no job."""
    from fmpy import read_model_description

    try:
        description = read_model_description(str(path), validate=validate)
    except Exception as error:
        return None, "", f"cannot be read: {first_line(error)}"
    if description.fmiVersion == "1.0":
        return None, "1.0", "FMI 1.0"
    if description.coSimulation is None:
        return None, description.fmiVersion, "not for co-simulation"
    usual = description.defaultExperiment
    start = Fraction(str(usual.startTime or 0)) if usual else Fraction(0)
    stop = Fraction(str(usual.stopTime)) if usual and usual.stopTime else start + 1
    step = Fraction(str(usual.stepSize)) if usual and usual.stepSize else (stop - start) / 1000
    tolerance = float(usual.tolerance) if usual and usual.tolerance else None
    values: dict[str, list[float] | float | str] = {
        v.name: v.start or ""
        for v in description.modelVariables
        if v.causality == "input" and v.type == "String" and not v.shape
    }
    for variable in numbers(description, "input"):
        if variable.alias:
            continue
        moves = (
            inputs == "sine" and variable.type in ("Real", "Float64") and variable.variability != "discrete"
        )
        for name, value in zip(elements(variable), starts(variable), strict=True):
            values[name] = sine(value, variable) if moves else value
    record = [name for v in watched(description) for name in elements(v)]
    job = Job(str(path), str(start), str(step), tolerance, values, record, validate)
    return job, description.fmiVersion, ""


def run_in_fmpy(job: Job) -> np.ndarray:
    """Run an FMU in a loop of FMPy's functions; return the recorded values, shape (rows, variables)."""
    from fmpy import extract, instantiate_fmu, read_model_description
    from fmpy.fmi1 import FMICallException
    from fmpy.fmi2 import fmi2Discard, fmi2LastSuccessfulTime, fmi2Terminated

    description = read_model_description(job.path, validate=False)
    modern = description.fmiVersion != "2.0"
    fmu = instantiate_fmu(extract(job.path), description, "CoSimulation")
    inputs = [v for v in numbers(description, "input") if not v.alias]
    outputs = watched(description)
    times, step = job.times(), float(Fraction(job.step))

    def put(k: int | None) -> None:
        for v in inputs:
            given = [job.inputs[name] for name in elements(v)]
            if k is None or any(isinstance(value, list) for value in given):
                values = [value[k or 0] if isinstance(value, list) else value for value in given]
                getattr(fmu, f"set{accessor(v, modern)}")([v.valueReference], values)

    def fetch() -> list[float]:
        row: list[float] = []
        for v in outputs:
            more = {"nValues": math.prod(v.shape or ())} if modern else {}
            row += getattr(fmu, f"get{accessor(v, modern)}")([v.valueReference], **more)
        return [float(value) for value in row]

    bounds = {"tolerance": job.tolerance, "startTime": times[0], "stopTime": times[-1]}
    if not modern:
        fmu.setupExperiment(**bounds)
    put(None)
    fmu.enterInitializationMode(**(bounds if modern else {}))
    fmu.exitInitializationMode()
    rows = [fetch()]
    for k, time in enumerate(times[:-1]):
        put(k)
        try:
            answer = fmu.doStep(currentCommunicationPoint=time, communicationStepSize=step)
            ending, reached = bool(modern and answer[1]), times[k + 1]
        except FMICallException as error:
            if modern or error.status != fmi2Discard or not fmu.getBooleanStatus(fmi2Terminated):
                raise
            ending, reached = True, fmu.getRealStatus(fmi2LastSuccessfulTime)
        if reached > times[k + 1] - step / 2:
            rows.append(fetch())
        if ending:
            break
    return np.array(rows).reshape(len(rows), len(job.record))


def in_process(job: Job, folder: Path) -> str:
    """Run an FMU in FMPy in a process of its own, into `theirs.npy`; return "ran" or why it did not."""
    (folder / "job.json").write_text(json.dumps(vars(job)), encoding="utf-8")
    return status_of([sys.executable, "-m", __spec__.name, "--job", str(folder)])


def here(job: Job, folder: Path) -> str:
    """Run an FMU by the command, into `ours`; return "ran" or why it did not."""
    moving = {name: values for name, values in job.inputs.items() if isinstance(values, list)}
    given: dict[str, Any] = {
        f"u.{name}": {"file": "inputs.csv", "column": f"c{i}", "interpolation": "held"}
        for i, name in enumerate(moving)
    }
    if moving:
        columns = np.array([job.times(), *moving.values()]).T
        lines = [",".join(["time", *(f"c{i}" for i in range(len(moving)))])]
        lines += [",".join(map(repr, row)) for row in columns.tolist()]
        (folder / "inputs.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    start, step = Fraction(job.start), Fraction(job.step)
    scenario = {
        "start_time": f"{start} s",
        "stop_time": f"{start + STEPS * step} s",
        "step_size": f"{step} s",
        "algorithm": "jacobi",
        "units": {"u": {"fmu": job.path, "validate": job.validate}},
        "record": [f"u.{name}" for name in job.record],
        "inputs": {f"u.{name}": v for name, v in job.inputs.items() if name not in moving} | given,
    }
    (folder / "scenario.yaml").write_text(json.dumps(scenario), encoding="utf-8")
    command = [sys.executable, "-m", "yawbench", "run", "scenario.yaml", "--out", "ours"]
    return status_of(command, folder)


def status_of(command: list[str], folder: Path | None = None) -> str:
    """Return "ran", or the error with which a command ended."""
    try:
        done = subprocess.run(
            command, capture_output=True, timeout=LIMIT, cwd=folder, check=False, stdin=subprocess.DEVNULL
        )
    except subprocess.TimeoutExpired:
        return f"did not end within {LIMIT:g} s"
    if done.returncode == 0:
        return "ran"
    lines = [line for line in done.stderr.decode(errors="replace").splitlines() if line.strip()]
    told = [line for line in lines if not line.startswith(("note: ", "warning: ", "What was recorded"))]
    return first_line((told or lines or [f"exit status {done.returncode}"])[-1])


def first_line(text: object) -> str:
    return " ".join(str(text).split())[:200]


def compare(path: Path, inputs: str = "start", *, validate: bool = True) -> Comparison:
    """Run an FMU here and in FMPy; return what came of it."""
    from yawbench.orchestrator.results.reader import load_results

    name = path.stem
    job, version, reason = job_of(path.resolve(), inputs, validate)
    if job is None:
        return Comparison(name, version, reason, "-")
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        theirs, ours = in_process(job, folder), here(job, folder)
        if (theirs, ours) != ("ran", "ran"):
            return Comparison(name, version, theirs, ours)
        values = np.load(folder / "theirs.npy")
        results = load_results(folder / "ours")
        own = [np.asarray(results[f"u.{column}"], float) for column in job.record]
    return Comparison(name, version, theirs, ours, *differences(job.record, values, own))


def differences(names: list[str], values: np.ndarray, own: list[np.ndarray]) -> tuple[int, int, str]:
    """Return how many values differ from our own, of how many, and an example."""
    differing, example = 0, ""
    for name, expected, actual in zip(names, values.T, own, strict=True):
        same = len(actual) == len(expected) and actual.view(np.int64) == expected.copy().view(np.int64)
        if not np.all(same):
            gap = np.abs(actual - expected).max() if len(actual) == len(expected) else math.inf
            example = example or f" ({name} by {gap:.1e})"
            differing += int(np.size(expected) - np.sum(same))
    return differing, values.size, example


def compared(folder: Path, inputs: str, *, validate: bool) -> Iterator[Comparison]:
    """Compare all FMUs in a folder and those below it."""
    for path in sorted(folder.rglob("*.fmu")):
        yield compare(path, inputs, validate=validate)


def table(comparisons: Iterable[Comparison]) -> tuple[str, bool]:
    """Print a row per FMU; return the summary and whether all agree."""
    counts: Counter[str] = Counter()
    agreed = True
    print("\t".join(COLUMNS), flush=True)
    for each in comparisons:
        print("\t".join(each.row), flush=True)
        agreed = agreed and each.agrees
        if each.differing is not None:
            counts["bit-identical" if each.differing == 0 else "different"] += 1
        elif each.theirs == "ran":
            counts["run in FMPy and not here"] += 1
        else:
            counts["run here and not in FMPy" if each.ours == "ran" else "run in neither"] += 1
    return ", ".join(f"{count} {what}" for what, count in sorted(counts.items())), agreed


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path, help="folder with FMUs, or with job.json")
    parser.add_argument("--inputs", choices=("start", "sine"), default="start", help="what inputs do")
    parser.add_argument("--no-validate", action="store_true", help="also run FMUs that are not valid FMI")
    parser.add_argument("--job", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.job:
        job = Job(**json.loads((options.folder / "job.json").read_text(encoding="utf-8")))
        np.save(options.folder / "theirs.npy", run_in_fmpy(job))
        return 0
    summary, agreed = table(compared(options.folder, options.inputs, validate=not options.no_validate))
    print(summary or "no FMU found")
    return 0 if agreed else 1


if __name__ == "__main__":
    sys.exit(main())
