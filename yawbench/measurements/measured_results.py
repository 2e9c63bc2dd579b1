"""Recordings of cars as results of runs."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from yawbench.foundation.errors import ResultsError
from yawbench.orchestrator.recordings.gaps import notes_on
from yawbench.orchestrator.results.reader import Results, load_results
from yawbench.orchestrator.results.run_record import FmuRecord, RunRecord, RunStatus
from yawbench.orchestrator.scenario.catalogue import YAML

from .measurement import MEASURABLE, load_measurement
from .segment import LowPass, even_grid

STEERING = ("steering_wheel_angle", "steer_angle", "drive_force")
"""Measured signals that a driver gives in simulations."""
MEASURED = "measured"
"""Name of the FMU in the record of a measurement."""


@dataclass(frozen=True)
class MeasuredResults(Results):
    """A segment of a measurement as the results of a run; `low_pass`: the filter it has passed."""

    low_pass: LowPass | None = None


def load_run(path: Path | str, *, thin: bool = False, start: float = 0.0) -> Results:
    """Read a recorded run: a results folder, a measurement file, or a segment of it, `measured.yaml#2`.

    Args:
        path: the folder or the file.
        thin: see `load_results`.
        start: time of a measurement [s] that becomes 0.

    Raises:
        ResultsError, ScenarioError: it cannot be read.
    """
    path = Path(path)
    return measured_results(path, start) if is_measurement(path) else load_results(path, thin=thin)


def is_measurement(path: Path) -> bool:
    """Return whether a path is that of a measurement file, or of a segment of it, not of a folder."""
    return path.suffix.partition("#")[0] in YAML and not path.is_dir()


def segments_of(path: Path) -> list[Path]:
    """Return the paths of all segments of a measurement file.

    Raises:
        ResultsError: it does not exist, or is a recording itself.
        ScenarioError: it cannot be used.
    """
    if not os.path.exists(str(path).partition("#")[0]):
        raise ResultsError(f"{path}: no such file or folder", code="results-missing")
    if not is_measurement(path):
        raise ResultsError(
            f"{path}: describe recordings in a measurement file, 'files: [{path.name}]' and "
            "'signals: {yaw_rate: {column: ..., unit: ...}}', and name that file",
            code="measurement-missing",
        )
    count = len(load_measurement(path).segments) if "#" not in path.name else 1
    return [Path(f"{path}#{k}") for k in range(1, count + 1)] if count > 1 else [path]


def filtered_alike(runs: Sequence[Results]) -> list[Results]:
    """Return runs, the simulated ones filtered by the low pass of the measured one among them.

    Only signals that are measured are filtered. Measured runs alone are drawn like any other.
    """
    if all(isinstance(run, MeasuredResults) for run in runs):
        return [Results(run.folder, run.time, run.columns, run.units, run.record) for run in runs]
    measured = next((run for run in runs if isinstance(run, MeasuredResults) and run.low_pass), None)
    if measured is None or measured.low_pass is None:
        return list(runs)
    wanted = {name.variable for name in measured.names.values()}
    low_pass = measured.low_pass
    return [run if isinstance(run, MeasuredResults) else _filtered(run, low_pass, wanted) for run in runs]


def _filtered(run: Results, low_pass: LowPass, wanted: set[str]) -> Results:
    """Return a run whose wanted variables have passed a low pass."""
    grid = even_grid(run.time)
    rate = 1.0 / float(grid[1] - grid[0]) if grid.size > 1 else 0.0
    if grid.size < 2 or not rate > 2.0 * low_pass.cut_off:
        return run
    columns = dict(run.columns)
    for column, name in run.names.items():
        if name.variable in wanted and np.issubdtype(columns[column].dtype, np.floating):
            smooth = low_pass(np.interp(grid, run.time, columns[column]), rate)
            columns[column] = np.interp(run.time, grid, smooth)
    return replace(run, columns=columns)


def measured_results(path: Path, start: float = 0.0) -> MeasuredResults:
    """Return a segment of a measurement as the results of a run.

    Steering belongs to the instance `driver` there, all other signals to `plant`, so that they meet those of
    simulations. What is known of the car are parameters of both.

    Args:
        path: the measurement file, with `#` and the number of the segment if it has several.
        start: its time [s] that becomes 0, as runs begin there.

    Raises:
        ScenarioError: it cannot be used.
        ResultsError: there is no such segment.
    """
    file, _, number = str(path).partition("#")
    measurement = load_measurement(file)
    try:
        segment = measurement.segment(int(number) if number else None)
    except ValueError as error:
        raise ResultsError(f"{file}: {error}, as in {file}#1", code="segment-unknown") from None
    columns, units = {}, {"time": "s"}
    for name, values in segment.signals.items():
        column = f"{'driver' if name in STEERING else 'plant'}.{name}"
        columns[column], units[column] = values, MEASURABLE[name].unit
    known = {**measurement.vehicle, **measurement.test}
    notes = [note for note in measurement.notes if note.code != "measurement-gap"]
    gaps = notes_on(segment.gaps, segment.signals, segment.name, start)
    record = RunRecord(
        status=RunStatus.COMPLETED,
        title=f"{measurement.title}, {segment.name}" if len(measurement.segments) > 1 else measurement.title,
        rows=segment.time.size,
        start_time=float(segment.time[0]) - start,
        stop_time=float(segment.time[-1]) - start,
        units=dict(units),
        fmus={
            role: FmuRecord(name=MEASURED, role=role, sha256=measurement.sha256, parameters=known)
            for role in ("driver", "plant")
        },
        scenario={"source": measurement.origin, "file": str(path)},
        diagnostics=[*notes, *gaps],
        results="",
    )
    return MeasuredResults(path, segment.time - start, columns, units, record, measurement.filter)
