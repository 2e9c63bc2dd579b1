"""Runs in processes of their own, so that one that crashes takes no other with it.

Processes that read results and draw figures: work that cannot fail as FMUs can.

They are asked and answer through pipes alone. The queues of `concurrent.futures` need semaphores, which
outlive a command that is killed, and of which Python then complains on the terminal.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import multiprocessing.util
import os
import pickle
import signal
import sys
import tempfile
import threading
import time
import traceback
from collections import deque
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from multiprocessing import forkserver, resource_tracker
from multiprocessing.connection import Connection, wait
from typing import Any

from ..errors import Interrupted, YawbenchError
from ..master.process_state import StopFlag, interrupts
from ..messages import printable
from ..processes import SAFE_PATH, SafeSpawnContext, no_script, safe_path
from .jobs import Job, Outcome, run_job

GRACE = 5.0
"""Time that a process has to end, and a run to write what it has recorded [s]."""
LONGEST_FOLDER = 60
"""Bytes of a folder's path that leave room for the names of sockets in it; chosen: they need 36."""
SHORT_FOLDER = "/tmp"
"""Where they go if the folder for temporary files has a longer path."""
LOOK_EVERY = 0.2
"""Time between two looks whether to stop [s]."""
FILES, FILES_EACH = 32, 4
"""Files that have to be allowed open at a time, and as many for each process besides. Chosen: 32 do for two
processes; each takes a pipe for its report and one that tells of its end."""
TRIES = 2
"""Times that a run is begun whose process dies; chosen: a kill from outside strikes seldom twice."""
NEEDED = (
    "orchestrator.quiet",
    "orchestrator.wiring.make_plan",
    "orchestrator.master.simulate",
    "orchestrator.experiments.figures",
    "matplotlib.backends.backend_agg",
    "matplotlib.backends.backend_svg",
    "matplotlib.figure",
    "matplotlib.mathtext",
    "pyarrow.csv",
)
"""What runs need: modules that take long to import, after one that keeps the server quiet."""
FOR_TESTS = ("scipy.signal", "orchestrator.evaluation.sine_with_dwell")
"""Likewise, where runs are judged by a standard test."""


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

    A run whose process died is made again when the others are through: perhaps the process was killed, and
    the run is not to blame.

    Ctrl-C is looked at between two runs' ends, never while a process is being started, which would
    leave one that nobody knows.

    Args:
        jobs: what to run.
        workers: processes at a time; default: one per core.
        done: called with every outcome as it comes, one for each job.
        run: what a process does with its job; importable by name. What it returns becomes the
            outcome's value.

    Raises:
        Interrupted: Ctrl-C or SIGTERM, when all runs have ended.
        YawbenchError: this process may not open as many files as that takes.
    """
    limit = max(1, workers or default_workers())
    context = context_of(limit, FOR_TESTS if any(job.test for job in jobs) else ())
    outcomes: dict[int, Outcome] = {}
    waiting = deque((number, job, TRIES) for number, job in enumerate(jobs))
    running: list[_Running] = []
    stop = StopFlag()
    with interrupts(stop, lambda: None):
        try:
            while not stop.requested:
                while len(running) < limit and waiting:
                    running.append(_Running.start(*waiting.popleft(), context, run))
                if not running:
                    return [outcomes[i] for i in range(len(jobs))]
                reported = wait([one.pipe for one in running], timeout=LOOK_EVERY)
                for one in [one for one in running if one.pipe in reported]:
                    running.remove(one)
                    outcome = one.outcome()
                    if outcome.died and one.tries > 1:
                        waiting.append((one.number, one.job, one.tries - 1))
                        continue
                    outcomes[one.number] = outcome
                    done(outcome)
            raise Interrupted(number=stop.number)
        finally:
            for one in running:
                one.process.terminate()  # a run writes what it has recorded
            for one in running:
                one.end()


def context_of(workers: int, needed: Sequence[str] = ()) -> Any:
    """Return how processes start: from a server that has imported once what each needs, or afresh."""
    _require_files(FILES + FILES_EACH * max(workers, default_workers()))
    if "forkserver" not in multiprocessing.get_all_start_methods() or not _has_place_for_sockets():
        return SafeSpawnContext()
    from ..processes import SafeForkServerContext

    context = SafeForkServerContext()
    context.set_forkserver_preload([*NEEDED, *needed])
    # Ctrl-C is for the caller, who ends its processes: the server must not get it, nor any that it starts,
    # not even while they import what they need
    with safe_path(), no_script():
        resource_tracker.ensure_running()
        earlier = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            forkserver.ensure_running()
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, earlier)
    return context


def _forget_server() -> None:
    """Let a copy of this process that somebody forks start a server of its own; it cannot wait for ours."""
    server: Any = forkserver._forkserver  # type: ignore[attr-defined]
    alive = server._forkserver_alive_fd
    if alive is not None:
        os.close(alive)
        server._forkserver_address = server._forkserver_alive_fd = server._forkserver_pid = None


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_forget_server)


def _require_files(needed: int) -> None:
    """Make sure that this process may open so many files, since the server of processes cannot say it."""
    try:
        import resource
    except ImportError:  # Windows, which has no such limit
        return
    allowed, _ = resource.getrlimit(resource.RLIMIT_NOFILE)
    if allowed != resource.RLIM_INFINITY and allowed < needed:
        raise YawbenchError(
            f"only {allowed} files may be open at a time, and these processes need {needed} "
            f"(`ulimit -n {needed}`)"
        )


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
    tries: int  # this one and those left
    process: Any
    pipe: Connection
    began: float = field(default_factory=time.monotonic)

    @classmethod
    def start(cls, number: int, job: Job, tries: int, context: Any, run: Callable[[Job], Any]) -> _Running:
        ours, theirs = context.Pipe(duplex=False)
        process = context.Process(target=_work, args=(job, run, theirs), daemon=True)
        start(process)
        theirs.close()
        return cls(number, job, tries, process, ours)

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


def start(process: Any) -> None:
    """Start a process, from a daemonic one as well.

    Daemonic processes may have no children because they could leave orphans; ours end with their caller.
    """
    settings = multiprocessing.current_process()._config  # type: ignore[attr-defined]
    with _starting:
        daemonic = settings.pop("daemon", None)
        try:
            process.start()
        finally:
            if daemonic is not None:
                settings["daemon"] = daemonic


_starting = threading.Lock()  # workers of a cluster start runs from several threads


def _work(job: Job, run: Callable[[Job], Any], pipe: Connection) -> None:
    """Do one job in a process of its own and report how it ended."""
    end_with_caller()
    os.environ.pop(SAFE_PATH, None)  # what an FMU starts may need its own folder
    if hasattr(os, "setpgrp"):
        os.setpgrp()  # Ctrl-C on the terminal is for the caller, who ends this process
    try:
        report: tuple[int, list[str], Any, bool] = (0, [], run(job), False)
    except (YawbenchError, Interrupted) as error:
        told = isinstance(error, Interrupted)
        report = (error.exit_status, [*error.problems] or [type(error).__name__], None, told)
    except BaseException as error:
        print(printable("".join(traceback.format_exception(error))), file=sys.stderr)
        report = (1, [f"{type(error).__name__}: {error}"], None, False)
    with suppress(BrokenPipeError):  # the caller was killed
        pipe.send(report)
    pipe.close()


def end_with_caller() -> None:
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


POOL_GRACE = 5.0
"""Time that a process has to end [s]; chosen: it only has to see that its pipe is closed."""


class Pool(contextlib.AbstractContextManager["Pool"]):
    """So many processes at most, started as they are needed; all end with the `with` block.

    Args:
        workers: how many; None: one per core.

    Raises:
        YawbenchError: this process may not open as many files as that takes.
    """

    def __init__(self, workers: int | None = None) -> None:
        self._limit = max(1, workers or default_workers())
        self._context = context_of(self._limit)
        self._processes: dict[Connection, Any] = {}

    def map(self, function: Callable[..., Any], *arguments: Iterable[Any]) -> list[Any]:
        """Return what `function` gives for each set of arguments, in their order.

        Raises:
            Exception: what the first call to fail has raised.
            YawbenchError: a process was killed.
        """
        waiting = deque(enumerate(zip(*arguments, strict=False)))
        results: dict[int, Any] = {}
        busy: dict[Connection, int] = {}
        try:
            while waiting or busy:
                while waiting and (idle := self._idle(busy)) is not None:
                    busy[idle], given = waiting.popleft()
                    idle.send((function, given))
                for pipe in wait(list(busy)):
                    assert isinstance(pipe, Connection)
                    results[busy.pop(pipe)] = _answer(pipe)
        except BaseException:
            self._end(kill=True)  # others still have to answer
            raise
        return [results[number] for number in range(len(results))]

    def _idle(self, busy: dict[Connection, int]) -> Connection | None:
        """Return the pipe to a process that has nothing to do, None if there can be no more of them."""
        for pipe in self._processes:
            if pipe not in busy:
                return pipe
        if len(self._processes) == self._limit:
            return None
        ours: Connection
        ours, theirs = self._context.Pipe()
        process = self._context.Process(target=_serve, args=(theirs,), daemon=True)
        start(process)
        theirs.close()
        self._processes[ours] = process
        return ours

    def _end(self, *, kill: bool) -> None:
        processes, self._processes = self._processes, {}
        for pipe in processes:
            pipe.close()
        for process in processes.values():
            if kill:
                process.terminate()
        for process in processes.values():
            process.join(POOL_GRACE)
            if process.is_alive():
                process.kill()
                process.join()
            process.close()

    def __exit__(self, *_: object) -> None:
        self._end(kill=False)


def _answer(pipe: Connection) -> Any:
    try:
        fine, value = pipe.recv()
    except (EOFError, OSError):
        raise YawbenchError("a process that reads results or draws figures has been killed") from None
    if fine:
        return value
    raise value


def _serve(pipe: Connection) -> None:
    """Do what is asked until nobody asks any more."""
    end_with_caller()
    with contextlib.suppress(EOFError, OSError):
        while True:
            function, arguments = pipe.recv()
            try:
                answer = True, function(*arguments)
            except Exception as error:
                answer = False, _portable(error)
            pipe.send(answer)


def _portable(error: Exception) -> Exception:
    """Return an exception, or if it cannot be handed to another process, one that tells of it."""
    try:
        pickle.loads(pickle.dumps(error))
    except Exception:
        return RuntimeError("".join(traceback.format_exception(error)))
    return error
