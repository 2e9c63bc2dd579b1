"""The master's hold on the process of one isolated unit: started, asked, waited for, ended."""

from __future__ import annotations

import contextlib
import os
import select
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from typing import Any

from .exchange import REPLY, REQUEST, Channel, shared_memory

START_LIMIT = 60.0
"""Time that a process may take to start [s]; chosen: Python is read from a slow disk in less."""
LONGEST = 2e9
"""The longest time that poll takes [ms]: 23 days."""
GRACE = 5.0
"""Time that it may take to end once the FMU has been freed [s]; it has nothing left to do."""

_PROGRAM = (
    "import sys; sys.path[:] = sys.argv[4].split('\\n'); "
    "from orchestrator.master.worker import main; main(*map(int, sys.argv[1:4]))"
)


class Lost(Exception):
    """A process that gave no answer; it is gone, or has been ended because of that."""

    def in_(self, function: str) -> str:
        """Return what has happened, with the FMI function that was being called ("" for none)."""
        where = f" in {function}" if function else " between two calls"
        return str(self).format(where=where, function=function or "its process")


class UnitProcess:
    """The process of one unit. All calls that wait raise `Lost` if no answer comes."""

    def __init__(self, values: int, limit: float) -> None:
        """Start it, without waiting for it.

        Args:
            values: number of inputs and outputs for which there shall be room.
            limit: time that an answer may take [s].
        """
        self._limit = limit
        self.memory = shared_memory(values)
        self.log: Callable[[int, str, str], None] = lambda status, category, text: None
        commands, writing = os.pipe()
        reading, answers = os.pipe()
        theirs = (commands, answers, self.memory)
        try:
            self._popen = subprocess.Popen(
                [sys.executable, "-c", _PROGRAM, *map(str, theirs), "\n".join(sys.path)],
                stdin=subprocess.DEVNULL,
                pass_fds=theirs,
                start_new_session=True,  # Ctrl-C on the terminal is for the master
            )
        finally:
            os.close(commands)
            os.close(answers)
        self._channel = Channel(reading, writing)
        self._poll = select.poll()
        self._poll.register(reading, select.POLLIN)
        self._ended = False

    def wait_until_ready(self) -> None:
        """Wait until it can be asked."""
        self._answer(START_LIMIT)

    def ask(self, request: str, *arguments: Any) -> Any:
        """Return the answer to a request (a method of `worker.Worker`)."""
        with contextlib.suppress(BrokenPipeError):  # why is found where the answer should be
            self._channel.send(REQUEST, (request, arguments))
        return self._answer(self._limit)

    def exchange(self, parts: bytes) -> int:
        """Let it do parts of a step; return how that ended (see `worker.Worker.exchange`)."""
        with contextlib.suppress(BrokenPipeError):
            self._channel.say(parts)
        return self._answer(self._limit)

    def _answer(self, limit: float) -> Any:
        end = time.monotonic() + limit
        while (left := end - time.monotonic()) > 0 and self._poll.poll(min(1000 * left, LONGEST)):
            try:
                kind = self._channel.hear()
                if kind is not None and kind < REQUEST:
                    return kind
                content = self._channel.receive()
            except EOFError:
                raise Lost(self._death()) from None
            if kind == REPLY:
                return content
            self.log(*content)
        self.end()
        raise Lost(f"{{function}} did not come back within {limit:g} s, the limit of a call")

    def _death(self) -> str:
        """Return a sentence on how the process has ended; it has closed its end of the pipe."""
        code = self._wait()
        self.end()
        if code is None:
            return "its process closed the pipe to the master{where}"
        if code >= 0:
            return f"its process ended itself with exit status {code}{{where}}"
        try:
            name = signal.Signals(-code).name
        except ValueError:
            name = f"signal {-code}"
        cause = ", sent from outside or for want of memory," if -code == signal.SIGKILL else ""
        return f"its process died of {name}{cause}{{where}}"

    def _wait(self) -> int | None:
        try:
            return self._popen.wait(GRACE)
        except subprocess.TimeoutExpired:
            return None

    def leave(self) -> None:
        """Let it end by itself, which it does when nobody is left to ask it."""
        self._channel.close()
        self._wait()
        self.end()

    def end(self) -> None:
        """End it, whatever it is doing. Further calls do nothing."""
        if self._ended:
            return
        self._ended = True
        self._channel.close()
        os.close(self.memory)
        self._popen.kill()
        self._popen.wait()
