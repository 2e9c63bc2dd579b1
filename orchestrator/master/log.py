"""Log of the messages that FMUs send through the FMI logger.

There is one receiver for all instances of a process. The number passed to an instance as its component
environment identifies whose message it is.
"""

from __future__ import annotations

import contextlib
import ctypes
import itertools
import re
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any

OK, WARNING, DISCARD, ERROR, FATAL, PENDING, UNKNOWN = range(7)
STATUS = ("OK", "Warning", "Discard", "Error", "Fatal", "Pending", "a status that FMI does not have")

KEPT = 1000
"""Messages kept per instance; further ones are only counted."""
LONGEST = 10_000
"""Characters kept of a message; chosen: a traceback is shorter."""
MASTER = "yawbench"
"""Category of the master's own messages about an instance; always kept."""
PROCESS = "yawbench process"
"""Category of the message that says how the process of an isolated instance ended; always kept."""

_HAS_TIME = re.compile(r"^[^:]* failed at t = [^:]* s: ")
_CONTROLS = re.compile(r"[\x00-\x08\x0b-\x1f\x7f-\x9f]")


def known(status: int) -> int:
    """Return the status, or UNKNOWN for a number that is not an FMI status."""
    return status if OK <= status <= PENDING else UNKNOWN


@dataclass(frozen=True)
class Message:
    """A message of an instance; `time` [s] is the communication point before it, unless given explicitly."""

    instance: str
    time: float
    status: int
    category: str
    text: str


class Log:
    """The messages of a run with a status worse than OK, in order of arrival."""

    def __init__(self) -> None:
        self.messages: list[Message] = []
        self.dropped = 0
        self._counts: Counter[str] = Counter()
        self._deaf = False
        self.time = ctypes.c_double(0.0)  # [s], moved on by the master

    @contextlib.contextmanager
    def deaf(self) -> Iterator[None]:
        """Ignore FMU messages inside this block, because an optional read may legally fail."""
        self._deaf = True
        try:
            yield
        finally:
            self._deaf = False

    def add(self, unit: str, status: int, category: str, text: str, time: float | None = None) -> None:
        """Add a message; those with the status OK are ignored.

        Args:
            time: simulation time that it is about [s]; default: the last communication point.
        """
        status = known(status)
        if status == OK or (self._deaf and category not in (MASTER, PROCESS)):
            return
        self._counts[unit] += 1
        if self._counts[unit] > KEPT and category not in (MASTER, PROCESS):
            self.drop(1)
            return
        at = self.time.value if time is None else time
        self.messages.append(Message(unit, at, status, category, text[:LONGEST].rstrip()))

    def drop(self, count: int) -> None:
        """Count messages that are not kept."""
        self.dropped += count

    def errors(self, unit: str) -> list[Message]:
        """Return the messages of an instance with a status worse than Warning, without tracebacks."""
        return [
            m
            for m in self.messages
            if m.instance == unit and m.status > WARNING and m.category != "traceback"
        ]

    def tracebacks(self, unit: str) -> list[str]:
        """Return the full Python tracebacks that an instance has logged."""
        return [m.text for m in self.messages if m.instance == unit and m.category == "traceback"]

    def warnings(self, ended_by: str | None = None) -> Iterable[Message]:
        """Return the messages that did not end the run: the master's own first, then those of the FMUs.

        These are warnings, and errors after which an instance continued regardless.

        Args:
            ended_by: the instance whose errors ended the run, if any; those are reported separately.
        """
        chosen = (
            m
            for m in self.messages
            if m.status == WARNING or (m.instance != ended_by and m.category != "traceback")
        )
        return sorted(chosen, key=lambda m: m.category != MASTER)


def describe(unit: str, what: str, time: float, status: int, log: Log) -> str:
    """Return an error message: instance, what failed, when, and the reason.

    Args:
        what: "step", "initialization", "setting inputs", ...
        time: beginning of the step [s].
    """
    errors = _latest(unit, log)
    if status != OK and errors and errors[0].time < log.time.value:
        errors = []  # the instance has continued since then
    if status == PENDING and not errors:
        reason = "the FMU wants to compute asynchronously, which is not supported"
    elif not errors:
        reason = f"the FMU returned {STATUS[status]} and gave no reason"
    else:
        ended = (m for m in errors if m.category == PROCESS)  # it already quotes the last error of the FMU
        reason = " ".join(next(ended, errors[0]).text.split())
        if _HAS_TIME.match(reason):  # a component of this project, whose message already has place and time
            return f"{unit}: {reason.partition('; inputs: ')[0]}"
    return f"{unit}: {what} failed at t = {time:.9g} s: {reason}"


def _latest(unit: str, log: Log) -> list[Message]:
    """Return the errors that an instance logged at the latest time at which it logged any."""
    errors = log.errors(unit)
    return [m for m in errors if m.time == errors[-1].time]


_listeners: dict[int, tuple[Log, str, Any]] = {}
_numbers = itertools.count(1)


def listen(log: Log, unit: str, kept: Any = None) -> int:
    """Return the number under which `receive` passes messages on to `log`.

    Args:
        kept: object to be kept alive until `unlisten` is called with the number.
    """
    number = next(_numbers)
    _listeners[number] = (log, unit, kept)
    return number


def relisten(number: int, log: Log) -> None:
    """Pass the messages of an instance on to another log."""
    _, unit, kept = _listeners[number]
    _listeners[number] = (log, unit, kept)


def unlisten(number: int) -> None:
    """Forget an instance that has been freed."""
    _listeners.pop(number, None)


def receive(number: int, status: int, category: bytes | None, text: bytes | None) -> None:
    """Log a message of the instance with this number (called from C)."""
    try:
        if number not in _listeners:
            return  # from a thread of an instance already freed
        log, unit, _ = _listeners[number]
        log.add(unit, status, _decoded(category), _decoded(text))
    except Exception as error:  # must not propagate into the calling C code
        print(f"yawbench: a log message was lost: {error}")


def _decoded(text: bytes | None) -> str:
    """Decode a text of an FMU and remove control characters, which could act on a terminal."""
    return _CONTROLS.sub("", (text or b"").decode("utf-8", errors="replace"))
