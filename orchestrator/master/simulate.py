"""One run, from a plan to results on disk."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from ..plan import Finding, Plan
from ..results.columnar import MemoryRecorder
from ..results.formats import recorder_of
from ..results.read import Results
from .apart import can_be_apart
from .course import Opener, Progress
from .ending import Run
from .log import Message
from .opening import open_unit


@dataclass(frozen=True)
class RunInfo:
    """What a completed run has to tell beside its results."""

    folder: Path
    rows: int
    columns: int
    id: str  # in run.json too: which run the results in a folder are of
    wall_time: float  # of initialization and stepping [s]
    passes: int  # of initialization
    warnings: list[Message] = field(default_factory=list)
    ended: str | None = None  # why a unit ended it before its stop time
    findings: tuple[Finding, ...] = ()  # on the run's course


def simulate(
    plan: Plan,
    out: Path | str,
    *,
    progress: Progress | None = None,
    opener: Opener = open_unit,
    format: str = "csv",
    apart: bool = False,
) -> RunInfo:
    """Run a plan and write its results (`results.csv`) and `run.json` into the folder `out`.

    A run that fails or is interrupted (Ctrl-C, SIGTERM) writes what it has recorded, and why it
    ended, before it raises. Results of an earlier run in `out` are replaced as a whole; a run that fails
    leaves those of one that reached its end, and puts its own into `failed` beside them. A run that a unit
    wants to end is complete, and says so. All is on the
    disk before the units are terminated and freed.

    Args:
        plan: made by `wiring.make_plan`.
        out: folder of the results; made if it does not exist.
        progress: told how far the run is.
        opener: makes the instances; tests put their own in.
        format: of the results, one of `results.formats.FILES`.
        apart: step the units in a process of their own, where that is possible (see `apart`): whatever
            becomes of it, the run ends with a sentence and the results so far.

    Raises:
        ScenarioError: there is no such format.
        ModelDescriptionError: an FMU has no library that this computer can load.
        SimulationError: a unit failed, a wire was not finite, the run was interrupted or the results
            cannot be written any further.
        ResultsError: nothing can be written to `out`, or the format needs a package that is missing.
    """
    recorder = recorder_of(format)(Path(out), *_columns(plan))
    run = Run(plan, recorder, progress, apart=apart and can_be_apart())
    run.make(opener)
    warnings, ended = list(run.log.warnings()), None if run.ended is None else str(run.ended)
    return RunInfo(
        Path(out),
        recorder.written,
        len(plan.record),
        run.id,
        run.wall_time,
        run.passes,
        warnings,
        ended,
        run.watch.findings(),
    )


def simulate_in_memory(
    plan: Plan, *, progress: Progress | None = None, opener: Opener = open_unit
) -> Results:
    """Run a plan and return its results; nothing is written.

    Raises:
        ModelDescriptionError, SimulationError: as `simulate`.
    """
    recorder = MemoryRecorder(*_columns(plan))
    Run(plan, recorder, progress, apart=False).make(opener)
    assert recorder.results is not None
    return recorder.results


def _columns(plan: Plan) -> tuple[list[str], list[bool], dict[str, str | None]]:
    """Return the names of the recorded columns, which are Real, and their units."""
    units = {unit.name: unit for unit in plan.units}
    recorded = {f"{unit}.{name}": units[unit].fmu.variables[name] for unit, name in plan.record}
    units_of = {"time": "s", **{column: variable.unit for column, variable in recorded.items()}}
    return list(recorded), [variable.type == "Real" for variable in recorded.values()], units_of
