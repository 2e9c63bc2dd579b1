"""Pools of worker processes: for runs, for reading results and drawing figures, for building FMUs.

Workers are children of the fork server (`processes`). They communicate through pipes only: the queues of
`concurrent.futures` need semaphores, which leak if the command is killed.
"""

from __future__ import annotations

import contextlib
import os
import signal
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from multiprocessing.connection import wait
from typing import Any, NamedTuple

from .errors import YawbenchError
from .processes import LOOK_EVERY, ProcessLost, Worker

FIGURES = (
    "yawbench.studies.result_files",
    "matplotlib.backends.backend_agg",
    "matplotlib.backends.backend_svg",
    "matplotlib.figure",
    "matplotlib.mathtext",
    "pyarrow.csv",
)
"""Modules to preload for reading results and drawing figures, because they are slow to import."""


def default_workers() -> int:
    """Return the number of processor cores that this process may use."""
    affinity = getattr(os, "sched_getaffinity", None)
    return len(affinity(0)) if affinity else os.cpu_count() or 1


class Finished(NamedTuple):
    """Outcome of a call: its value, the exception that it raised, or the end of the process."""

    number: int  # of the call, in the order in which they were given
    seconds: float  # from request to answer
    value: Any = None
    error: Exception | None = None
    died: str = ""


class Pool(contextlib.AbstractContextManager["Pool"]):
    """Pool of worker processes, started on demand; all end with the `with` block.

    Args:
        workers: largest number of processes; None: one per core.
        preload: modules that their functions need, imported once for all of them.
        lasting: number of calls after which a worker is replaced by a fresh process.
    """

    def __init__(
        self, workers: int | None = None, *, preload: Sequence[str] = FIGURES, lasting: float = float("inf")
    ) -> None:
        self._limit = max(1, workers or default_workers())
        self._preload = preload
        self._lasting = lasting
        self._workers: list[Worker] = []
        self._busy: dict[Worker, tuple[int, float]] = {}  # number of its call, and when it began

    def each(
        self,
        function: Callable[..., Any],
        calls: Iterable[Sequence[Any]],
        *,
        look: Callable[[], None] = lambda: None,
    ) -> Iterator[Finished]:
        """Call `function` with each set of arguments; yield what became of the calls, as they end.

        Args:
            function: importable by name, as are its arguments' types.
            calls: arguments of each call, asked for when a process is idle.
            look: called several times a second; it may raise to end all processes.
        """
        waiting = enumerate(calls)
        following = next(waiting, None)
        while True:
            look()
            while following and (worker := self._idle(function.__module__)) is not None:
                following = self._begin(worker, function, following, waiting)
            if not self._busy:
                return
            answering = wait({end for worker in self._busy for end in worker.telling()}, LOOK_EVERY / 1000)
            for worker in [one for one in self._busy if not one.telling().isdisjoint(answering)]:
                finished = self._finish(worker)
                if finished.died or worker.retires or worker.calls >= self._lasting:
                    self._workers.remove(worker)
                    worker.close()
                elif following:  # it need not wait until this answer has been seen to
                    following = self._begin(worker, function, following, waiting)
                yield finished

    def _begin(
        self,
        worker: Worker,
        function: Callable[..., Any],
        call: tuple[int, Sequence[Any]],
        waiting: Iterator[tuple[int, Sequence[Any]]],
    ) -> tuple[int, Sequence[Any]] | None:
        """Have a worker make a call; return the one that follows."""
        self._busy[worker] = call[0], time.monotonic()
        worker.give(function, call[1])
        return next(waiting, None)

    def _finish(self, worker: Worker) -> Finished:
        """Wait for the end of a worker's call and return what became of it."""
        died, value, error = "", None, None
        try:
            value, error = worker.answer()
        except ProcessLost as lost:
            died = str(lost)
        number, began = self._busy.pop(worker)
        return Finished(number, time.monotonic() - began, value, error, died)

    def map(self, function: Callable[..., Any], *arguments: Iterable[Any]) -> list[Any]:
        """Apply `function` to each set of arguments and return the results in order.

        Raises:
            Exception: raised by the first call that fails.
            YawbenchError: a process was killed.
        """
        results: dict[int, Any] = {}
        try:
            for finished in self.each(function, zip(*arguments, strict=False)):
                if finished.died:
                    raise YawbenchError(
                        "a process that reads results or draws figures has been killed",
                        code="run-process-died",
                    )
                if finished.error is not None:
                    raise finished.error
                results[finished.number] = finished.value
        except BaseException:
            self.end()  # do not wait for other calls
            raise
        return [results[number] for number in range(len(results))]

    def _idle(self, module: str) -> Worker | None:
        """Return an idle process, started with the module of its function if need be; None: all busy."""
        for worker in self._workers:
            if worker not in self._busy:
                return worker
        if len(self._workers) == self._limit:
            return None
        self._workers.append(Worker(("platformdirs", *self._preload, module)))  # which finds the cache
        return self._workers[-1]

    def end(self, *, terminate: bool = True) -> None:
        """End all processes; `terminate`: without waiting for their calls. Further calls start new ones."""
        workers, self._workers, self._busy = self._workers, [], {}
        for worker in workers:
            if terminate:
                worker.child.kill(signal.SIGTERM)  # a run writes what it has recorded
        for worker in workers:
            worker.close()

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        self.end(terminate=kind is not None)
