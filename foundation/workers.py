"""Pools of worker processes: for runs, for reading results and drawing figures, for building FMUs.

Workers are supervised processes of the fork server. They communicate through pipes only: the queues of
`concurrent.futures` need semaphores, which leak if the command is killed.
"""

from __future__ import annotations

import contextlib
import copyreg
import io
import os
import pickle
import select
import signal
import time
import traceback
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import fields
from typing import Any, NamedTuple

from .errors import YawbenchError, hide_library_warnings
from .fork_server import ServedChild, start
from .sent_once import SentOnce
from .supervised_process import LOOK_EVERY, REPLY, REQUEST, PipeChannel, ProcessLost, SupervisedProcess

FILES, FILES_EACH = 32, 4
"""Required limit of open files: a base, and more per process. Chosen: 32 suffice for two processes; each
needs two pipes and one that signals its end."""
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


COMMON = (__name__, "platformdirs")
"""Modules that every worker needs; platformdirs finds the cache."""


class Worker(SupervisedProcess):
    """A process that calls functions, one at a time."""

    trusted = True
    child: ServedChild

    def __init__(self, preload: Sequence[str]) -> None:
        super().__init__(lambda *pipes: start(__name__, *pipes, preload=[*COMMON, *preload]))
        self.calls = 0
        self.busy = False
        self.retires = False  # see `retire`
        self._sent: dict[int, SentOnce] = {}

    def give(self, number: int, function: Callable[..., Any], arguments: Sequence[Any]) -> None:
        """Have it call a function, importable by name."""
        self._number, self._began = number, time.monotonic()
        self.calls += 1
        self.busy = True
        with contextlib.suppress(BrokenPipeError):  # the cause is found when the answer is read
            self._channel.send_pickle(REQUEST, pickled((function, arguments), self._once))

    def _once(self, item: SentOnce) -> tuple[Any, ...]:
        """Reduce an object to a number after the first time."""
        number = id(item)
        if number in self._sent:
            return _kept, (number,)
        self._sent[number] = item  # refers to it, so that no other object gets its number
        of_item = {field.name: getattr(item, field.name) for field in fields(item)}  # type: ignore[arg-type]
        return _keep, (number, type(item), of_item)

    def descriptors(self) -> tuple[int, int]:
        """Return the descriptors that can be read when it has answered or died."""
        return self._channel.reading, self.child.status

    def finished(self) -> Finished:
        """Wait for the answer and return it."""
        died, value, error = "", None, None
        try:
            value, error, self.retires = self.hear(REPLY)
        except ProcessLost as lost:
            died = str(lost)
        self.busy = False
        return Finished(self._number, time.monotonic() - self._began, value, error, died)


class Pool(contextlib.AbstractContextManager["Pool"]):
    """Pool of worker processes, started on demand; all end with the `with` block.

    Args:
        workers: largest number of processes; None: one per core.
        preload: modules that their functions need, imported once for all of them.
        lasting: number of calls after which a worker is replaced by a fresh process.

    Raises:
        YawbenchError: the limit of open files is too low.
    """

    def __init__(
        self, workers: int | None = None, *, preload: Sequence[str] = FIGURES, lasting: float = float("inf")
    ) -> None:
        self._limit = max(1, workers or default_workers())
        _require_files(FILES + FILES_EACH * max(self._limit, default_workers()))
        self._preload = preload
        self._lasting = lasting
        self._workers: list[Worker] = []

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
                worker.give(following[0], function, following[1])
                following = next(waiting, None)
            busy = [worker for worker in self._workers if worker.busy]
            if not busy:
                return
            for worker in _answering(busy):
                finished = worker.finished()
                if finished.died or worker.retires or worker.calls >= self._lasting:
                    self._workers.remove(worker)
                    worker.close()
                elif following:  # it need not wait until this answer has been seen to
                    worker.give(following[0], function, following[1])
                    following = next(waiting, None)
                yield finished

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
            if not worker.busy:
                return worker
        if len(self._workers) == self._limit:
            return None
        self._workers.append(Worker((*self._preload, module)))
        return self._workers[-1]

    def end(self, *, terminate: bool = True) -> None:
        """End all processes; `terminate`: without waiting for their calls. Further calls start new ones."""
        workers, self._workers = self._workers, []
        for worker in workers:
            if terminate:
                worker.child.kill(signal.SIGTERM)  # a run writes what it has recorded
        for worker in workers:
            worker.close()

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        self.end(terminate=kind is not None)


def _answering(busy: Sequence[Worker]) -> list[Worker]:
    """Return the workers that have answered or died, after a wait of at most `LOOK_EVERY`."""
    events = select.poll()
    for worker in busy:
        for descriptor in worker.descriptors():
            events.register(descriptor, select.POLLIN)
    ready = {descriptor for descriptor, _ in events.poll(LOOK_EVERY)}
    return [worker for worker in busy if not ready.isdisjoint(worker.descriptors())]


def _require_files(needed: int) -> None:
    """Check the limit of open files before processes fail for it."""
    import resource

    allowed, _ = resource.getrlimit(resource.RLIMIT_NOFILE)
    if allowed != resource.RLIM_INFINITY and allowed < needed:
        raise YawbenchError(
            f"only {allowed} files may be open at a time, and these processes need {needed} "
            f"(`ulimit -n {needed}`)",
            code="too-few-open-files",
        )


_received: dict[int, SentOnce] = {}
"""In a worker: number -> object that it was sent; see `Worker._once`."""


def _keep(number: int, kind: type[SentOnce], fields: dict[str, Any]) -> SentOnce:
    _received[number] = kind(**fields)
    return _received[number]


def _kept(number: int) -> SentOnce:
    return _received[number]


_retires = False


def retire() -> None:
    """Have the worker that calls this function be replaced by a fresh process after the current call."""
    global _retires
    _retires = True


def main(reading: str, writing: str) -> None:
    """Execute calls until the pipe is closed."""
    hide_library_warnings()
    channel = PipeChannel(int(reading), int(writing))
    while channel.hear() is not None:
        function, arguments = channel.receive_object()
        answer: tuple[Any, Exception | None]
        try:
            answer = function(*arguments), None
        except Exception as error:
            answer = None, _portable(error)
        channel.send_object(REPLY, (*answer, _retires))


def pickled(content: Any, reduce: Callable[[SentOnce], tuple[Any, ...]]) -> bytes:
    """Return a pickle in which `reduce` says how what is sent once is restored, as `__reduce__` does."""
    buffer = io.BytesIO()
    pickler = pickle.Pickler(buffer)
    pickler.dispatch_table = copyreg.dispatch_table | dict.fromkeys(SentOnce.__subclasses__(), reduce)
    pickler.dump(content)
    return buffer.getvalue()


def _portable(error: Exception) -> Exception:
    """Return an exception, or if it cannot be pickled, a RuntimeError with its traceback."""
    try:
        pickle.loads(pickle.dumps(error))
    except Exception:
        return RuntimeError("".join(traceback.format_exception(error)))
    return error
