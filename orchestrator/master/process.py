"""The master's hold on the process of one isolated unit: started, asked, waited for, ended."""

from __future__ import annotations

import contextlib
import os
import select
import subprocess
import time
from collections.abc import Callable
from typing import Any

from ..processes import how_it_ended, python
from .exchange import ANSWER, FAILED, LOG, REPLY, Channel, Garbled, shared_memory
from .interrupts import stop_requested_at

START_LIMIT = 60.0
"""Time that a process may take to start [s]; chosen: Python is read from a slow disk in less."""
LOOK_EVERY = 200
"""Time between two looks at the clock while an answer is waited for [ms]."""
STOP_GRACE = 1.0
"""Time that a call may still take when the run is to stop [s]; chosen: as long as one likes to wait."""
CLOSING = 1.0
"""Time in which a process that has closed its pipe is seen to end [s]."""
GRACE = 5.0
"""Time that it may take to end once the FMU has been freed [s]; it has nothing left to do."""


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
        self.log: Callable[[Any], None] = lambda content: None
        commands, writing = os.pipe()
        reading, answers = os.pipe()
        theirs = (commands, answers, self.memory)
        try:
            self._popen = subprocess.Popen(
                python("orchestrator.master.worker", *theirs),
                stdin=subprocess.DEVNULL,
                pass_fds=theirs,
                start_new_session=True,  # Ctrl-C on the terminal is for the master
            )
        finally:
            os.close(commands)
            os.close(answers)
        self._channel = Channel(reading, writing, self._wait_for_more)
        self._poll = select.poll()
        self._poll.register(reading, select.POLLIN)
        self._deadline = 0.0
        self._ended = False

    def wait_until_ready(self) -> None:
        """Wait until it can be asked."""
        self._answer(START_LIMIT, REPLY)

    def ask(self, request: str, *arguments: Any) -> Any:
        """Return the answer to a request (a method of `worker.Worker`)."""
        with contextlib.suppress(BrokenPipeError):  # why is found where the answer should be
            self._channel.order((request, arguments))
        return self._answer(self._limit, REPLY)

    def exchange(self, parts: bytes) -> int:
        """Let it do parts of a step; return how that ended (see `worker.Worker.exchange`)."""
        with contextlib.suppress(BrokenPipeError):
            self._channel.say(parts)
        return self._answer(self._limit, ANSWER)

    def _answer(self, limit: float, wanted: int) -> Any:
        self._deadline = time.monotonic() + limit
        try:
            while True:
                self._wait_for_more()
                kind = self._channel.hear()
                if kind is None:
                    raise EOFError
                if kind <= ANSWER and wanted == ANSWER:
                    return kind
                if kind not in (LOG, FAILED, wanted):
                    raise Garbled(f"byte {kind}")
                content = self._channel.receive()
                if kind == wanted:
                    return content
                if kind == FAILED:
                    raise self.lost(f"{content}{{where}}")
                self.log(content)
                self._check_time()
        except EOFError:
            raise Lost(self._death()) from None
        except Garbled as error:
            raise self.garbled(str(error)) from None

    def _wait_for_more(self) -> None:
        """Wait for the pipe to hold something, until the deadline or, a while, after a wish to stop."""
        while not self._poll.poll(LOOK_EVERY):
            self._check_time()

    def _check_time(self) -> None:
        now, asked = time.monotonic(), stop_requested_at()
        if asked is not None and now - asked > STOP_GRACE:
            raise self.lost("{function} did not come back when the run was to stop")
        if now > self._deadline:
            limit = f"{self._limit:g} s, the limit of a call (--call-limit)"
            raise self.lost(f"{{function}} did not come back within {limit}")

    def garbled(self, what: str) -> Lost:
        """End it, for its answers can no longer be told from what else came; return what to raise."""
        return self.lost(f"its process wrote into the pipe to the master what is no answer{{where}} ({what})")

    def lost(self, sentence: str) -> Lost:
        """End it; return what to raise."""
        self.end()
        return Lost(sentence)

    def _death(self) -> str:
        """Return a sentence on how the process has ended; it has closed its end of the pipe."""
        code = self._wait(CLOSING)
        self.end()
        if code is None:
            return "its process closed the pipe to the master{where}"
        return f"its process {how_it_ended(code)}{{where}}"

    def _wait(self, limit: float) -> int | None:
        try:
            return self._popen.wait(limit)
        except subprocess.TimeoutExpired:
            return None

    def leave(self) -> None:
        """Let it end by itself, which it does when nobody is left to ask it."""
        self._channel.close()
        self._wait(GRACE)
        self.end()

    def end(self) -> None:
        """End it and all that it has started, whatever they are doing. Further calls do nothing."""
        if self._ended:
            return
        self._ended = True
        self._channel.close()  # its guardian wakes up
        os.close(self.memory)
        if self._wait(GRACE) is None:
            self._popen.kill()
            self._popen.wait()
