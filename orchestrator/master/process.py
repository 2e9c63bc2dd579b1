"""Processes at the other ends of two pipes: listened to, watched, ended.

One is that of an isolated unit, here; the other that in which the units of a run are stepped (see `apart`).
"""

from __future__ import annotations

import contextlib
import os
import select
import subprocess
import time
from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any, ClassVar

from ..processes import how_it_ended, python
from .exchange import ANSWER, FAILED, LOG, REPLY, Channel, Garbled, shared_memory
from .interrupts import stop_requested_at
from .log import Log

START_LIMIT = 60.0
"""Time that a process may take to start [s]; chosen: Python is read from a slow disk in less."""
LOOK_EVERY = 100
"""Time between two looks at the clock while an answer is waited for [ms]."""
STOP_GRACE = 1.0
"""Time that a call may still take when the run is to stop [s]; chosen: as long as one likes to wait."""
CLOSING = 1.0
"""Time in which a process that has closed its pipe is seen to end [s]."""
GRACE = 5.0
"""Time that the process of a unit may take to end when nobody is left to ask it [s]."""


class Lost(Exception):
    """A process that gave no answer; it is gone, or has been ended because of that.

    Args:
        did: what it did, as "died of SIGSEGV".
        late: it is the FMI function being called that did, or did not.
    """

    def __init__(self, did: str, *, late: bool = False) -> None:
        super().__init__(did)
        self._late = late

    def in_(self, function: str) -> str:
        """Return what the process of a unit did, with the FMI function being called ("" for none)."""
        if self._late:
            return f"{function or 'its process'} {self}"
        return f"its process {self}" + (f" in {function}" if function else " between two calls")


class Process(ABC):
    """The hold on a process. All calls that wait for it raise `Lost` if no answer comes."""

    unasked: ClassVar[tuple[int, ...]]
    """First bytes of the records that it may send at any time, beside what is logged in it."""
    log: Log

    def _start(self, start: Callable[[int, int], Any]) -> Any:
        """Let `start` make it, given its ends of the pipes to read from and to write into."""
        commands, writing = os.pipe()
        reading, answers = os.pipe()
        try:
            return start(commands, answers)
        finally:
            os.close(commands)
            os.close(answers)
            self._channel = Channel(reading, writing, self._wait_for_more)
            self._poll = select.poll()
            self._poll.register(reading, select.POLLIN)

    @abstractmethod
    def _take(self, kind: int, content: Any) -> None:
        """Take a record that came unasked; raise `Garbled` if it is none."""

    @abstractmethod
    def _check_time(self) -> None:
        """Raise `Lost` if it has had time enough."""

    @abstractmethod
    def _has_ended(self, within: float) -> bool:
        """Return whether it ends within a time [s]."""

    @abstractmethod
    def close(self) -> int:
        """End it and all that it has started, whatever they are doing; return its exit status. Once."""

    def _hear(self, wanted: int) -> Any:
        """Take what comes until it is the record, or the answer of one byte, that is wanted; return it."""
        try:
            while True:
                self._wait_for_more()
                kind = self._channel.hear()
                if kind is None:
                    raise EOFError
                if kind <= ANSWER and wanted == ANSWER:
                    return kind
                if kind not in (wanted, LOG, *self.unasked):
                    raise Garbled(f"byte {kind}")
                content = self._channel.receive()
                if kind == wanted:
                    return content
                if kind == LOG:
                    self._keep(content)
                else:
                    self._take(kind, content)
                self._check_time()
        except EOFError:
            ended = self._has_ended(CLOSING)
            code = self.close()
            raise Lost(how_it_ended(code) if ended else "closed the pipe to the master") from None
        except Garbled as error:
            raise self.garbled(str(error)) from None

    def _keep(self, content: Any) -> None:
        """Keep what a unit logs: a message, or how many more there were (see `exchange.Relay`)."""
        match content:
            case int():
                self.log.drop(content)
            case [str() as unit, int() as status, str() as category, str() as text, float() | None as time]:
                self.log.add(unit, status, category, text, time)
            case _:
                raise Garbled("a message that is none")

    def _wait_for_more(self) -> None:
        while not self._poll.poll(LOOK_EVERY):
            self._check_time()
            if self._has_ended(0.0) and not self._poll.poll(0):
                raise EOFError  # something that a unit has started holds the pipe open

    def garbled(self, what: str) -> Lost:
        """End it, for its answers can no longer be told from what else came; return what to raise."""
        self.close()
        return Lost(f"wrote into the pipe to the master what is no answer ({what})")


class UnitProcess(Process):
    """The process of one isolated unit."""

    unasked = (FAILED,)

    def __init__(self, values: int, limit: float) -> None:
        """Start it, without waiting for it.

        Args:
            values: number of inputs and outputs for which there shall be room.
            limit: time that an answer may take [s].
        """
        self._limit = limit
        self.memory = shared_memory(values)
        self._deadline = 0.0
        self._closed = False
        self._popen = self._start(self._spawned)

    def _spawned(self, commands: int, answers: int) -> subprocess.Popen[bytes]:
        theirs = (commands, answers, self.memory)
        return subprocess.Popen(
            python("orchestrator.master.worker", *theirs),
            stdin=subprocess.DEVNULL,
            pass_fds=theirs,
            start_new_session=True,  # Ctrl-C on the terminal is for the master
        )

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
        return self._hear(wanted)

    def _take(self, kind: int, content: Any) -> None:
        self.close()
        raise Lost(f"failed: {content}")

    def _check_time(self) -> None:
        now, asked = time.monotonic(), stop_requested_at()
        if asked is not None and now - asked > STOP_GRACE:
            self.close()
            raise Lost("did not come back when the run was to stop", late=True)
        if now > self._deadline:
            self.close()
            limit = f"{self._limit:g} s, the limit of a call (--call-limit)"
            raise Lost(f"did not come back within {limit}", late=True)

    def _has_ended(self, within: float) -> bool:
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._popen.wait(within)
            return True
        return False

    def close(self) -> int:
        if not self._closed:
            self._closed = True
            self._channel.close()  # its guardian wakes up
            os.close(self.memory)
            if not self._has_ended(GRACE):
                self._popen.kill()
                self._popen.wait()
        return self._popen.returncode
