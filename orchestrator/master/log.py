"""What the units say through the FMI logger.

There is one receiver for all instances of a process; the environment that an instance was given, a
number, says whose message it is.
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

WRITTEN = 100
"""Warnings written into run.json; more are only counted."""
KEPT = 1000
"""Messages kept per unit; a unit that goes on is only counted."""
LONGEST = 10_000
"""Characters kept of a message; chosen: a traceback has fewer."""
MASTER = "yawbench"
"""Category of what the master has to say of a unit; always kept."""
PROCESS = "yawbench process"
"""Category of the message that says how the process of an isolated unit ended; always kept."""

_TELLS_WHEN = re.compile(r"^[^:]* failed at t = [^:]* s: ")
_CONTROLS = re.compile(r"[\x00-\x08\x0b-\x1f\x7f-\x9f]")


def known(status: int) -> int:
    """Return a status, UNKNOWN for a number that is none."""
    return status if OK <= status <= PENDING else UNKNOWN


@dataclass(frozen=True)
class Message:
    """One message of a unit; `time` [s] is the communication point before it, if none is said."""

    instance: str
    time: float
    status: int
    category: str
    text: str


class Log:
    """All messages of a run with a status worse than OK, in the order in which they came."""

    def __init__(self) -> None:
        self.messages: list[Message] = []
        self.dropped = 0
        self._counts: Counter[str] = Counter()
        self._deaf = False
        self.time = ctypes.c_double(0.0)  # [s], moved on by the master

    @contextlib.contextmanager
    def deaf(self) -> Iterator[None]:
        """Hear nothing while the block runs: an FMU may be asked for what it need not tell."""
        self._deaf = True
        try:
            yield
        finally:
            self._deaf = False

    def add(self, unit: str, status: int, category: str, text: str, time: float | None = None) -> None:
        """Keep a message; those with the status OK are of no interest.

        Args:
            time: that it tells of [s]; default: the communication point before it.
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
        """Return the unit's messages with a status worse than Warning, without tracebacks."""
        return [
            m
            for m in self.messages
            if m.instance == unit and m.status > WARNING and m.category != "traceback"
        ]

    def tracebacks(self, unit: str) -> list[str]:
        """Return the full Python tracebacks that the unit has logged."""
        return [m.text for m in self.messages if m.instance == unit and m.category == "traceback"]

    def warnings(self, ended_by: str | None = None) -> Iterable[Message]:
        """Return what the units said while the run went on, after what the master had to say.

        That is warnings, and errors after which a unit went on as if there had been none.

        Args:
            ended_by: the unit whose errors ended the run, if one did: they are told elsewhere.
        """
        chosen = (
            m
            for m in self.messages
            if m.status == WARNING or (m.instance != ended_by and m.category != "traceback")
        )
        return sorted(chosen, key=lambda m: m.category != MASTER)

    def record(self, ended_by: str | None = None) -> dict[str, Any]:
        """Return what run.json says of the warnings (see `warnings`)."""
        warnings = list(self.warnings(ended_by))
        return {
            "warnings": [
                {"unit": m.instance, "time": m.time, "status": STATUS[m.status], "text": m.text}
                for m in warnings[:WRITTEN]
            ],
            "more_warnings": max(0, len(warnings) - WRITTEN) + self.dropped,
        }


def describe(unit: str, what: str, time: float, status: int, log: Log) -> str:
    """Return one sentence: unit, what failed, when, and the reason.

    Args:
        what: "step", "initialization", "setting inputs", ...
        time: beginning of the step [s].
    """
    errors = _latest(unit, log)
    if status != OK and errors and errors[0].time < log.time.value:
        errors = []  # the unit has gone on since
    if status == PENDING and not errors:
        reason = "the FMU wants to compute asynchronously, which is not supported"
    elif not errors:
        reason = f"the FMU returned {STATUS[status]} and gave no reason"
    else:
        ended = (m for m in errors if m.category == PROCESS)  # what the unit said before is told with it
        reason = " ".join(next(ended, errors[0]).text.split())
        if _TELLS_WHEN.match(reason):  # a component of this project: it knows where and when
            return f"{unit}: {reason.partition('; inputs: ')[0]}"
    return f"{unit}: {what} failed at t = {time:.9g} s: {reason}"


def _latest(unit: str, log: Log) -> list[Message]:
    """Return the errors that a unit has logged at the last instant at which it logged any."""
    errors = log.errors(unit)
    return [m for m in errors if m.time == errors[-1].time]


_listeners: dict[int, tuple[Log, str, Any]] = {}
_numbers = itertools.count(1)


def listen(log: Log, unit: str, kept: Any = None) -> int:
    """Return the number under which `receive` passes messages on to `log`.

    Args:
        kept: what has to stay in memory until the number is given to `unlisten`.
    """
    number = next(_numbers)
    _listeners[number] = (log, unit, kept)
    return number


def unlisten(number: int) -> None:
    """Forget an instance that has been freed."""
    _listeners.pop(number, None)


def receive(number: int, status: int, category: bytes | None, text: bytes | None) -> None:
    """Take a message of the instance that was given this number."""
    try:
        if number not in _listeners:
            return  # a thread of an instance that is gone
        log, unit, _ = _listeners[number]
        log.add(unit, status, _decoded(category), _decoded(text))
    except Exception as error:  # must not reach the C code that called
        print(f"yawbench: a log message was lost: {error}")


def _decoded(text: bytes | None) -> str:
    """Return a text of an FMU, without what would steer a terminal."""
    return _CONTROLS.sub("", (text or b"").decode("utf-8", errors="replace"))
