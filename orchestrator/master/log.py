"""Log of the messages that FMUs send through the FMI logger.

There is one receiver of messages for all instances of a process. The number passed to an instance as its
component environment identifies whose message it is. A process that runs FMUs passes its messages on to the
log of the master (`LogRelay`).
"""

from __future__ import annotations

import contextlib
import ctypes
import itertools
import os
import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from yawbench.foundation.processes import Channel

from ..plan import Instance

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
KILLED = "yawbench process killed"
"""Category of that message if the process was killed by something else; always kept."""

EVERYTHING = "YAWBENCH_LOG"
"""Environment variable, which reaches the processes of isolated instances, too: with `info`, messages with
the status OK are heard."""

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
    """The messages of a run with a status worse than OK, in order of arrival.

    Args:
        hear: called with every message at once, those of the status OK if `EVERYTHING` asks for them.
    """

    def __init__(self, hear: Callable[[Message], None] | None = None) -> None:
        self.messages: list[Message] = []
        self._hear = hear
        self._everything = os.environ.get(EVERYTHING) == "info"
        self.dropped = 0
        self._counts: Counter[str] = Counter()
        self._muted = False
        self.time = ctypes.c_double(0.0)  # [s], moved on by the master

    @contextlib.contextmanager
    def muted(self) -> Iterator[None]:
        """Ignore FMU messages inside this block, because an optional read may legally fail."""
        self._muted = True
        try:
            yield
        finally:
            self._muted = False

    def add(self, instance: str, status: int, category: str, text: str, time: float | None = None) -> None:
        """Add a message; those with the status OK are not kept.

        Args:
            time: simulation time that it is about [s]; default: the last communication point.
        """
        status = known(status)
        if self._muted and category not in (MASTER, PROCESS, KILLED):
            return
        at = self.time.value if time is None else time
        message = Message(instance, at, status, category, text[:LONGEST].rstrip())
        if status == OK and not self._everything:
            return
        if self._hear is not None:
            self._hear(message)
        if status != OK:
            self._counts[instance] += 1
            if self._counts[instance] > KEPT and category not in (MASTER, PROCESS, KILLED):
                self.drop(1)
                return
            self.messages.append(message)
        self._relay(message)

    def _relay(self, message: Message) -> None:
        """Pass on a message that is kept, or asked for: nothing here."""

    def drop(self, count: int) -> None:
        """Count messages that are not kept."""
        self.dropped += count

    @property
    def relayed(self) -> dict[str, Callable[..., None]]:
        """What is called with the records of a `LogRelay` in another process, by their kind."""
        return {"log": self.add, "dropped": self.drop}

    def errors(self, instance: str) -> list[Message]:
        """Return the messages of an instance with a status worse than Warning, without tracebacks."""
        return [
            m
            for m in self.messages
            if m.instance == instance and m.status > WARNING and m.category != "traceback"
        ]

    def tracebacks(self, instance: str) -> list[str]:
        """Return the full Python tracebacks that an instance has logged."""
        return [m.text for m in self.messages if m.instance == instance and m.category == "traceback"]

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


class LogRelay(Log):
    """Log that passes messages on at once, as the FMU may be about to crash; a flood is only counted.

    Args:
        timed: the simulation time of the messages is known in this process.
    """

    def __init__(self, channel: Channel, *, timed: bool) -> None:
        super().__init__()
        self._channel = channel
        self._timed = timed

    def _relay(self, message: Message) -> None:
        at = message.time if self._timed else None
        self._channel.send("log", (message.instance, message.status, message.category, message.text, at))

    def finish(self) -> None:
        """Pass on the number of messages dropped since the last call."""
        if self.dropped:
            count, self.dropped = self.dropped, 0
            self._channel.send("dropped", (count,))


def describe(instance: str, what: str, time: float, status: int, log: Log) -> str:
    """Return an error message: instance, what failed, when, and the reason.

    Args:
        what: "step", "initialization", "setting inputs", ...
        time: beginning of the step [s].
    """
    errors = _latest(instance, log)
    if status != OK and errors and errors[0].time < log.time.value:
        errors = []  # the instance has continued since then
    if status == PENDING and not errors:
        reason = "the FMU wants to compute asynchronously, which is not supported"
    elif not errors:
        reason = f"the FMU returned {STATUS[status]} and gave no reason"
    else:
        # it already quotes the last error of the FMU
        ended = (m for m in errors if m.category in (PROCESS, KILLED))
        reason = " ".join(next(ended, errors[0]).text.split())
        if _HAS_TIME.match(reason):  # a component of this project, whose message already has place and time
            return f"{instance}: {reason.partition('; inputs: ')[0]}"
    return f"{instance}: {what} failed at t = {time:.9g} s: {reason}"


def _latest(instance: str, log: Log) -> list[Message]:
    """Return the errors that an instance logged at the latest time at which it logged any."""
    errors = log.errors(instance)
    return [m for m in errors if m.time == errors[-1].time]


_listeners: dict[int, tuple[Log, str, Any]] = {}
_numbers = itertools.count(1)


def listen(log: Log, instance: str, kept: Any = None) -> int:
    """Return the number under which `receive` passes messages on to `log`.

    Args:
        kept: object to be kept alive until `unlisten` is called with the number.
    """
    number = next(_numbers)
    _listeners[number] = (log, instance, kept)
    return number


def relisten(number: int, log: Log) -> None:
    """Pass the messages of an instance on to another log."""
    _, instance, kept = _listeners[number]
    _listeners[number] = (log, instance, kept)


def unlisten(number: int) -> None:
    """Forget an instance that has been freed."""
    _listeners.pop(number, None)


def receive(number: int, status: int, category: bytes | None, text: bytes | None) -> None:
    """Log a message of the instance with this number (called from C)."""
    try:
        if number not in _listeners:
            return  # from a thread of an instance already freed
        log, instance, _ = _listeners[number]
        log.add(instance, status, _decoded(category), _decoded(text))
    except Exception as error:  # must not propagate into the calling C code
        print(f"yawbench: a log message was lost: {error}")


def _decoded(text: bytes | None) -> str:
    """Decode a text of an FMU and remove control characters, which could act on a terminal."""
    return _CONTROLS.sub("", (text or b"").decode("utf-8", errors="replace"))


def suspects(instances: Sequence[Instance]) -> list[str]:
    """Return the instances that may have changed something: the compiled FMUs, or all if none is."""
    return [u.name for u in instances if u.fmu.compiled] or [u.name for u in instances]
