"""Worker processes: one per run, so that a crash does not affect other runs; and a pool for harmless work.

`execute` starts a fresh process for every run. `Pool` reuses processes that read results and draw figures,
which cannot crash as FMUs can. It communicates through pipes only: the queues of `concurrent.futures` need
semaphores, which leak if the command is killed, and Python then complains about them on the terminal.
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
"""Time for a process to end, and for a run to write what it has recorded [s]."""
LONGEST_FOLDER = 60
"""Longest path of a folder for sockets [bytes]; chosen: their names need 36."""
SHORT_FOLDER = "/tmp"
"""Folder for sockets if the path of the temporary folder is too long."""
LOOK_EVERY = 0.2
"""Interval of checks for Ctrl-C and SIGTERM [s]."""
FILES, FILES_EACH = 32, 4
"""Required limit of open files: a base, and more per process. Chosen: 32 suffice for two processes; each
needs a pipe for its report and one that signals its end."""
TRIES = 2
"""Attempts at a run whose process dies; chosen: a kill from outside rarely happens twice."""
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
"""Modules to preload because they are slow to import; the first one keeps the server quiet."""
FOR_TESTS = ("scipy.signal", "orchestrator.evaluation.sine_with_dwell")
"""Further modules to preload if runs are judged by a standard test."""


def default_workers() -> int:
    """Return the number of processor cores that this process may use."""
    affinity = getattr(os, "sched_getaffinity", None)
    return len(affinity(0)) if affinity else os.cpu_count() or 1


def execute(
    jobs: Sequence[Job],
    *,
    workers: int | None = None,
    done: Callable[[Outcome], None] = lambda outcome: None,
    run: Callable[[Job], Any] = run_job,
) -> list[Outcome]:
    """Execute all jobs, each in a fresh process, and return their outcomes in order.

    A run whose process died is executed again after the others, since the process may have been killed
    from outside.

    Ctrl-C is only handled between the ends of runs, never while a process is being started, which would
    leave an orphan.

    Args:
        jobs: the runs.
        workers: number of processes; None: one per core.
        done: called with each outcome as it arrives, once per job.
        run: function that a process calls with its job, importable by name. Its return value becomes the
            outcome's value.

    Raises:
        Interrupted: Ctrl-C or SIGTERM, after all processes have ended.
        YawbenchError: the limit of open files is too low.
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
    """Return a multiprocessing context: a fork server with preloaded modules if possible, else spawn."""
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
    """In a forked copy of this process, forget the fork server: only its parent can wait for it."""
    server: Any = forkserver._forkserver  # type: ignore[attr-defined]
    alive = server._forkserver_alive_fd
    if alive is not None:
        os.close(alive)
        server._forkserver_address = server._forkserver_alive_fd = server._forkserver_pid = None


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_forget_server)


def _require_files(needed: int) -> None:
    """Check the limit of open files here, since the fork server cannot report it."""
    try:
        import resource
    except ImportError:  # Windows has no such limit
        return
    allowed, _ = resource.getrlimit(resource.RLIMIT_NOFILE)
    if allowed != resource.RLIM_INFINITY and allowed < needed:
        raise YawbenchError(
            f"only {allowed} files may be open at a time, and these processes need {needed} "
            f"(`ulimit -n {needed}`)"
        )


def _has_place_for_sockets() -> bool:
    """Make multiprocessing create its folder where paths of sockets are short enough; False if it cannot.

    It creates the folder once, where `tempfile` points to; a socket's path has at most 108 bytes.
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
    """A running job: its process, the pipe it reports through, and its start time."""

    number: int
    job: Job
    tries: int  # attempts left, including this one
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
        """Return the outcome that the process reported, or how it died."""
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
        """Wait for the process to end; kill it if it does not, as when an FMU hangs."""
        self.process.join(timeout=GRACE)
        self.process.kill()
        self.process.join()


def start(process: Any) -> None:
    """Start a process, even from a daemonic one.

    multiprocessing forbids daemonic processes to have children, which could be orphaned; ours end with
    their caller.
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
    """Main function of a job's process: execute the job and report its outcome."""
    end_with_caller()
    os.environ.pop(SAFE_PATH, None)  # what an FMU starts may need its own folder
    if hasattr(os, "setpgrp"):
        os.setpgrp()  # Ctrl-C on the terminal is for the caller, who ends this process
    try:
        report: tuple[int, list[str], Any, bool] = (0, [], run(job), False)
    except (YawbenchError, Interrupted) as error:
        interrupted = isinstance(error, Interrupted)
        report = (error.exit_status, [*error.problems] or [type(error).__name__], None, interrupted)
    except BaseException as error:
        print(printable("".join(traceback.format_exception(error))), file=sys.stderr)
        report = (1, [f"{type(error).__name__}: {error}"], None, False)
    with suppress(BrokenPipeError):  # the caller was killed
        pipe.send(report)
    pipe.close()


def end_with_caller() -> None:
    """Make this process receive SIGTERM when its caller has ended, however it ended (Linux only).

    The sentinel pipe sends the signal itself (F_SETSIG); a thread waiting on it would not survive a fork.
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
"""Time for a process to end [s]; chosen: it only has to notice that its pipe is closed."""


class Pool(contextlib.AbstractContextManager["Pool"]):
    """Pool of processes, started on demand; all end with the `with` block.

    Args:
        workers: largest number of processes; None: one per core.

    Raises:
        YawbenchError: the limit of open files is too low.
    """

    def __init__(self, workers: int | None = None) -> None:
        self._limit = max(1, workers or default_workers())
        self._context = context_of(self._limit)
        self._processes: dict[Connection, Any] = {}

    def map(self, function: Callable[..., Any], *arguments: Iterable[Any]) -> list[Any]:
        """Apply `function` to each set of arguments and return the results in order.

        Raises:
            Exception: raised by the first call that fails.
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
            self._end(kill=True)  # do not wait for other calls
            raise
        return [results[number] for number in range(len(results))]

    def _idle(self, busy: dict[Connection, int]) -> Connection | None:
        """Return the pipe to an idle process, started if need be; None if all are busy."""
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
    """Main function of a pool's process: execute calls until the pipe is closed."""
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
    """Return an exception, or if it cannot be pickled, a RuntimeError with its traceback."""
    try:
        pickle.loads(pickle.dumps(error))
    except Exception:
        return RuntimeError("".join(traceback.format_exception(error)))
    return error
