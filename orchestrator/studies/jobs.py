"""Runs of scenarios in processes of their own, so that one that crashes takes no other with it."""

from __future__ import annotations

import copy
import multiprocessing
import multiprocessing.util
import os
import signal
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import suppress
from dataclasses import dataclass, field, replace
from multiprocessing import forkserver, resource_tracker
from multiprocessing.connection import Connection, wait
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import BuildError, ResultsError, ScenarioError, YawbenchError
from ..master.interrupts import StopFlag, interrupts
from ..plan import Change, Plan
from ..results.read import Results, load_results
from ..scenario import yaml_lines
from ..scenario.yaml_lines import Document
from ..spawning import SAFE_PATH, SafeSpawnContext, safe_path
from ..wording import hint

if TYPE_CHECKING:
    from ..scenario.schema import Scenario

GRACE = 5.0
"""Time that a process has to end, and a run to write what it has recorded [s]."""
LONGEST_FOLDER = 60
"""Bytes of a folder's path that leave room for the names of sockets in it; chosen: they need 36."""
SHORT_FOLDER = "/tmp"
"""Where they go if the folder for temporary files has a longer path."""
LOOK_EVERY = 0.2
"""Time between two looks whether to stop [s]."""


@dataclass(frozen=True)
class Job:
    """One run to be made: a scenario, what is changed in it, and the folder its results go to."""

    label: str
    scenario: Path
    out: Path
    changes: tuple[Change, ...] = ()
    fmus: Path | None = None
    record: tuple[str, ...] = ()  # unit.variable; default: what the scenario records
    format: str = "csv"  # of the results
    call_limit: float | None = None  # of a call of an FMU [s], in a process per unit; None: units share one


@dataclass(frozen=True)
class Outcome:
    """What became of a job: `problems` is empty if it ran to the end."""

    job: Job
    problems: tuple[str, ...] = ()
    exit_status: int = 0
    seconds: float = 0.0  # of the process, start to end
    value: Any = None  # what the process returned
    died: bool = False  # the process ended without a word, or because it was told to

    @property
    def ok(self) -> bool:
        return not self.problems

    @property
    def reason(self) -> str:
        """Why it failed, in one sentence."""
        return "; ".join(self.problems)


NEEDED = ("orchestrator.wiring.make_plan", "orchestrator.master.simulate", "matplotlib.backends.backend_agg")
"""Modules that take long to import."""


class Once:
    """Files read and FMUs opened once for many plans; `build`: see `Opener`."""

    def __init__(self, *, build: bool = False) -> None:
        from ..fmu.opener import Opener

        self._documents: dict[Path, Document] = {}
        self.opener = Opener(build=build)

    def read(self, path: Path, *, what: str) -> Document:
        """Return what `yaml_lines.read` does, a copy each time."""
        if path not in self._documents:
            self._documents[path] = yaml_lines.read(path, what=what)
        return copy.deepcopy(self._documents[path])


def plan_of(job: Job, once: Once | None = None) -> Plan:
    """Return the plan of a job's run; `once` for many plans of the same files.

    Raises:
        YawbenchError: the scenario, an option or an FMU is wrong.
    """
    return planned(job, once)[1]


def planned(job: Job, once: Once | None = None) -> tuple[Scenario, Plan]:
    """Return a job's scenario with all that is changed in it, and its plan (see `plan_of`)."""
    from ..scenario.load import load_scenario
    from ..wiring.make_plan import make_plan

    once = once or Once()
    scenario = load_scenario(job.scenario, changes=job.changes, read=once.read)
    isolated = job.call_limit is not None
    plan = make_plan(scenario, fmus=job.fmus, opener=once.opener, isolated=isolated)
    if not job.record:
        return scenario, plan
    recorded = {f"{unit}.{variable}": (unit, variable) for unit, variable in plan.record}
    unknown = [name for name in job.record if name not in recorded]
    if unknown:
        guess = hint(unknown[0], recorded, lead="recorded are")
        raise ScenarioError(f"{job.scenario}: {unknown[0]!r} is not recorded{guess}")
    return scenario, replace(plan, record=tuple(recorded[name] for name in job.record))


def check(jobs: Sequence[Job], *, build: bool = False) -> list[str]:
    """Make sure that every job can start; return a sentence per FMU that is stale (see `Opener`).

    Raises:
        BuildError: FMUs that are stale and cannot be built.
        ScenarioError: with everything that is wrong with any of them, each problem once.
    """
    from ..fmu.opener import stale_fmus

    once = Once(build=build)
    found = [_plan_or_problems(job, once) for job in jobs]
    problems = dict.fromkeys(problem for one in found if isinstance(one, list) for problem in one)
    if problems:
        raise ScenarioError(problems)
    return stale_fmus(unit.fmu for one in found if isinstance(one, Plan) for unit in one.units)


def _plan_or_problems(job: Job, once: Once) -> Plan | list[str]:
    try:
        return plan_of(job, once)
    except BuildError:
        raise
    except YawbenchError as error:
        return [*error.problems]


def run_job(job: Job) -> str:
    """Make one run in this process; return its id, for the results are on disk.

    Raises:
        YawbenchError: the scenario is wrong or the run failed.
    """
    from ..master.isolation import opener_of
    from ..master.simulate import simulate

    plan = plan_of(job)
    with opener_of(plan, job.call_limit) as opener:
        return simulate(plan, job.out, opener=opener, format=job.format, apart=True).id


def default_workers() -> int:
    """Return the number of processor cores this process may use."""
    affinity = getattr(os, "sched_getaffinity", None)
    return len(affinity(0)) if affinity else os.cpu_count() or 1


def execute(
    jobs: Sequence[Job],
    *,
    workers: int | None = None,
    done: Callable[[Outcome], None] = lambda outcome: None,
    run: Callable[[Job], Any] = run_job,
) -> list[Outcome]:
    """Run all jobs, so many at a time, each in a fresh process; return their outcomes in order.

    Ctrl-C is looked at between two runs' ends, never while a process is being started, which would
    leave one that nobody knows.

    Args:
        jobs: what to run.
        workers: processes at a time; default: one per core.
        done: called with every outcome as it comes.
        run: what a process does with its job; importable by name. What it returns becomes the
            outcome's value.

    Raises:
        KeyboardInterrupt: Ctrl-C or SIGTERM, when all runs have ended.
    """
    context = _context()
    limit = max(1, workers or default_workers())
    outcomes: dict[int, Outcome] = {}
    waiting: Iterator[tuple[int, Job]] = iter(enumerate(jobs))
    running: list[_Running] = []
    stop = StopFlag()
    with interrupts(stop, lambda: None):
        try:
            while not stop.requested:
                while len(running) < limit and (following := next(waiting, None)) is not None:
                    running.append(_Running.start(*following, context, run))
                if not running:
                    return [outcomes[i] for i in range(len(jobs))]
                reported = wait([one.pipe for one in running], timeout=LOOK_EVERY)
                for one in [one for one in running if one.pipe in reported]:
                    running.remove(one)
                    outcomes[one.number] = one.outcome()
                    done(outcomes[one.number])
            raise KeyboardInterrupt
        finally:
            for one in running:
                one.process.terminate()  # a run writes what it has recorded
            for one in running:
                one.end()


def pool(workers: int | None = None) -> ProcessPoolExecutor:
    """Return an executor for work that cannot fail as FMUs can: reading results, drawing figures."""
    return ProcessPoolExecutor(
        max(1, workers or default_workers()),
        mp_context=_context(),
        initializer=_end_with_caller,
    )


def _context() -> Any:
    """Return how processes start: from a server that has imported once what each needs, or afresh."""
    if "forkserver" not in multiprocessing.get_all_start_methods() or not _has_place_for_sockets():
        return SafeSpawnContext()
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(["__main__", *NEEDED])
    # Ctrl-C is for the caller, who ends its processes: the server must not get it, nor any that it starts,
    # not even while they import what they need
    with safe_path():
        resource_tracker.ensure_running()
        earlier = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            forkserver.ensure_running()
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, earlier)
    return context


def _has_place_for_sockets() -> bool:
    """Give multiprocessing a folder whose path is short enough for sockets, if one can be written.

    It makes its own where `tempfile` says, and asks only once; a socket's path has 108 bytes.
    """
    usual = tempfile.tempdir
    try:
        if len(os.fsencode(tempfile.gettempdir())) > LONGEST_FOLDER:
            tempfile.tempdir = SHORT_FOLDER
        multiprocessing.util.get_temp_dir()
    except OSError:
        return False
    finally:
        tempfile.tempdir = usual
    return True


@dataclass
class _Running:
    """A job's process, the pipe it reports through, and when it began."""

    number: int
    job: Job
    process: Any
    pipe: Connection
    began: float = field(default_factory=time.monotonic)

    @classmethod
    def start(cls, number: int, job: Job, context: Any, run: Callable[[Job], Any]) -> _Running:
        ours, theirs = context.Pipe(duplex=False)
        process = context.Process(target=_work, args=(job, run, theirs), daemon=True)
        process.start()
        theirs.close()
        return cls(number, job, process, ours)

    def outcome(self) -> Outcome:
        """Return what the process reported, or how it died if it did not."""
        try:
            status, problems, value, died = self.pipe.recv()
            self.end()
        except (EOFError, OSError):
            self.end()
            status, problems, value, died = 1, (_death(self.process.exitcode),), None, True
        self.pipe.close()
        seconds = time.monotonic() - self.began
        return Outcome(self.job, tuple(problems), status, seconds, value, died)

    def end(self) -> None:
        """Wait for the process to end; kill one that does not, because a unit never comes back."""
        self.process.join(timeout=GRACE)
        self.process.kill()
        self.process.join()


def _work(job: Job, run: Callable[[Job], Any], pipe: Connection) -> None:
    """Do one job in a process of its own and report how it ended."""
    from ..master.master import Interrupted

    _end_with_caller()
    os.environ.pop(SAFE_PATH, None)  # what an FMU starts may need its own folder
    if hasattr(os, "setpgrp"):
        os.setpgrp()  # Ctrl-C on the terminal is for the caller, who ends this process
    try:
        report: tuple[int, list[str], Any, bool] = (0, [], run(job), False)
    except YawbenchError as error:
        told = isinstance(error, Interrupted)
        report = (error.exit_status, [*error.problems] or [type(error).__name__], None, told)
    except BaseException as error:
        sys.excepthook(type(error), error, error.__traceback__)
        report = (1, [f"{type(error).__name__}: {error}"], None, False)
    with suppress(BrokenPipeError):  # the caller was killed
        pipe.send(report)
    pipe.close()


def _end_with_caller() -> None:
    """Let this process get SIGTERM when the caller has ended, however it did (Linux).

    The pipe that tells of it asks for the signal; a thread that waits for it could not be forked.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C on the terminal is for the caller
    caller = multiprocessing.parent_process()
    if sys.platform != "linux" or caller is None:
        return
    import fcntl

    fcntl.fcntl(caller.sentinel, fcntl.F_SETOWN, os.getpid())
    fcntl.fcntl(caller.sentinel, fcntl.F_SETSIG, signal.SIGTERM)
    fcntl.fcntl(caller.sentinel, fcntl.F_SETFL, os.O_ASYNC | os.O_NONBLOCK)
    if wait([caller.sentinel], timeout=0):
        os.kill(os.getpid(), signal.SIGTERM)


def _death(code: int | None) -> str:
    if code is not None and code < 0:
        with suppress(ValueError):
            return f"the process of this run died of signal {signal.Signals(-code).name}"
    return f"the process of this run ended without a word, exit status {code}"


def read_back(folder: Path, run: str | None = None) -> Results | str:
    """Return the results of a run that reached its end, or a sentence that says why there are none.

    Args:
        folder: of the results.
        run: the id of the run that they must be of; None: whichever was the last.
    """
    try:
        results = load_results(folder)
    except ResultsError as error:
        return str(error)
    if run is not None and results.run.get("id") != run:
        return f"{folder}: holds the results of another run than the one just made"
    if results.run.get("status") == "completed":
        return results
    message = (results.run.get("error") or {}).get("message", "no reason recorded")
    return f"{folder}: this run ended early: {message}"
