"""Processes that read results and draw figures: work that cannot fail as FMUs can.

They are asked and answer through pipes alone. The queues of `concurrent.futures` need semaphores, which
outlive a command that is killed, and of which Python then complains on the terminal.
"""

from __future__ import annotations

import contextlib
import pickle
import traceback
from collections import deque
from collections.abc import Callable, Iterable
from multiprocessing.connection import Connection, wait
from typing import Any

from ..errors import YawbenchError
from .workers import context_of, default_workers, end_with_caller, start

GRACE = 5.0
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
            process.join(GRACE)
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
