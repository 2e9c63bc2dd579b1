"""Log of the messages that FMUs send through the FMI logger, and process-wide state that an FMU may corrupt.

There is one receiver of messages for all instances of a process. The number passed to an instance as its
component environment identifies whose message it is. A process that runs FMUs passes its messages on
(`LogRelay`) to the log of the master (`FmuProcess`).

Libraries compiled for speed flush small numbers to zero for the whole process from the moment they are
loaded; others set a rounding mode or a locale (after which `strtod` reads "0,5") and leave it. Loading,
instantiation and initialization are few calls: what they have changed is restored after each of them. In a
step that would cost more than the work of many instances, so between steps only the floating-point
environment is checked, now and then: if it has changed, the run ends, because it is unknown since when.
Isolated instances share nothing.
"""

from __future__ import annotations

import contextlib
import ctypes
import itertools
import locale
import mmap
import os
import platform
import re
import signal
import struct
import sys
import threading
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

from yawbench.foundation.fork_server import Child
from yawbench.foundation.supervised_process import LOG, PipeChannel, ProtocolError, SupervisedProcess

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
        """Add a message; those with the status OK are ignored.

        Args:
            time: simulation time that it is about [s]; default: the last communication point.
        """
        status = known(status)
        if status == OK or (self._muted and category not in (MASTER, PROCESS, KILLED)):
            return
        self._counts[instance] += 1
        if self._counts[instance] > KEPT and category not in (MASTER, PROCESS, KILLED):
            self.drop(1)
            return
        at = self.time.value if time is None else time
        self.messages.append(Message(instance, at, status, category, text[:LONGEST].rstrip()))

    def drop(self, count: int) -> None:
        """Count messages that are not kept."""
        self.dropped += count

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

    def __init__(self, channel: PipeChannel, *, timed: bool) -> None:
        super().__init__()
        self._channel = channel
        self._timed = timed
        self._unreported = 0  # dropped messages not passed on yet

    def add(self, instance: str, status: int, category: str, text: str, time: float | None = None) -> None:
        kept = len(self.messages)
        super().add(instance, status, category, text, time)
        if len(self.messages) > kept:
            last = self.messages[-1]
            at = last.time if self._timed else None
            self._channel.send(LOG, (instance, last.status, category, last.text, at))

    def drop(self, count: int) -> None:
        super().drop(count)
        self._unreported += count
        if self._unreported >= KEPT:
            self.finish()

    def finish(self) -> None:
        """Pass on the number of messages dropped since the last call."""
        if self._unreported:
            count, self._unreported = self._unreported, 0
            self._channel.send(LOG, count)


class FmuProcess(SupervisedProcess):
    """Parent's side of a process that runs FMUs, and passes on what they log."""

    unasked: ClassVar[tuple[int, ...]] = (LOG,)

    def __init__(self, start: Callable[[int, int], Child], log: Log) -> None:
        super().__init__(start)
        self.log = log

    def take(self, kind: int, content: Any) -> None:
        """Log a message of an FMU, or the number of dropped messages (see `LogRelay`)."""
        if kind != LOG:
            return super().take(kind, content)
        match content:
            case int():
                self.log.drop(content)
            case [
                str() as instance,
                int() as status,
                str() as category,
                str() as text,
                float() | None as time,
            ]:
                self.log.add(instance, status, category, text, time)
            case _:
                raise ProtocolError("an invalid message")
        return None


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


_MACHINE = platform.machine()
_ENVIRONMENT = 64  # bytes; no platform's fenv_t is larger

_c = ctypes.CDLL(None)
_c.setlocale.restype = ctypes.c_char_p
_ACTION = 256  # bytes; no platform's struct sigaction is larger
_HANDLER, _FLAGS = 16, slice(136, 140)
"""The parts of a struct sigaction that are compared: the handler with the mask of all signals there are, and
on Linux the flags; on macOS they are in the first part, and the second is empty."""
_HANDLED = [getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGPIPE") if hasattr(signal, name)]


class ProcessState:
    """Snapshot of the process-wide state: FPU mode, locale, working directory, umask, signal handlers."""

    def __init__(self) -> None:
        self._arithmetic = _arithmetic()
        self._control = _control(self._arithmetic)
        self._actions: list[bytes] = []  # of the signals, once Python's handlers are in place
        self._locale = _c.setlocale(locale.LC_ALL, None)
        self._folder = os.getcwd()
        self._umask = _umask()
        self._reported: set[tuple[str, str]] = set()

    def arithmetic_changed(self) -> bool:
        """Return whether rounding, flush-to-zero or traps differ from the snapshot."""
        return _control(_arithmetic()) != self._control

    def restore(self, instance: str, log: Log) -> None:
        """Restore state that an instance has changed; log a warning the first time."""
        for what in self._restored():
            if (instance, what) not in self._reported:
                self._reported.add((instance, what))
                log.add(
                    instance,
                    WARNING,
                    MASTER,
                    f"it changed {what}, which all instances share; this was undone",
                )

    def _restored(self) -> Iterator[str]:
        """Restore the snapshot; yield a description of each thing that had changed."""
        if self.arithmetic_changed():
            _c.fesetenv(self._arithmetic)
            yield "how numbers are rounded, flushed to zero or trapped"
        if _c.setlocale(locale.LC_ALL, None) != self._locale:
            _c.setlocale(locale.LC_ALL, self._locale)
            yield "the locale"
        if _folder() != self._folder:
            with contextlib.suppress(OSError):
                os.chdir(self._folder)
            yield "the working directory"
        if _umask() != self._umask:
            os.umask(self._umask)
            yield "the mask of file permissions"
        if threading.current_thread() is threading.main_thread() and _signal_actions() != self._actions:
            for number in _HANDLED:
                if (handler := signal.getsignal(number)) is not None:  # Python's, whatever C has installed
                    signal.signal(number, handler)
            self._actions = _signal_actions()


class Copies:
    """Ends copies of this process that an FMU makes with `fork` and lets return from the call.

    Each copy would go on with the run, and an FMU that forks in every step would soon fill the machine. The
    process id is checked once per step.
    """

    def __init__(self) -> None:
        self.process = os.getpid()
        self._made = mmap.mmap(-1, 1)  # shared with the copies

    def end(self) -> None:
        """End this process if it is a copy."""
        if os.getpid() != self.process:
            self._made[0] = 1
            os._exit(0)

    @property
    def made(self) -> bool:
        """Whether a copy has been made and ended."""
        return bool(self._made[0])


def suspects(instances: Sequence[Instance]) -> list[str]:
    """Return the instances that may have changed something: the compiled FMUs, or all if none is."""
    return [u.name for u in instances if u.fmu.compiled] or [u.name for u in instances]


def flush_output() -> None:
    """Flush the standard output streams of Python and C."""
    for stream in filter(None, (sys.stdout, sys.stderr)):
        with contextlib.suppress(OSError, ValueError):  # the reader has closed the pipe
            stream.flush()
    _c.fflush(None)


def _arithmetic() -> ctypes.Array[ctypes.c_char]:
    environment = ctypes.create_string_buffer(_ENVIRONMENT)
    _c.fegetenv(environment)
    return environment


def _control(environment: ctypes.Array[ctypes.c_char]) -> tuple[int, ...]:
    """Return the part that affects results, without the flags that any operation may raise."""
    if _MACHINE in ("x86_64", "AMD64"):
        return struct.unpack_from("<H", environment)[0], struct.unpack_from("<I", environment, 28)[0] & ~0x3F
    if _MACHINE == "aarch64":
        return struct.unpack_from("<I", environment)
    return (_c.fegetround(),)


def _signal_actions() -> list[bytes]:
    """Return what C has installed for each of the handled signals, which is quick to compare.

    Most of a mask is larger than what the kernel fills in: it differs from call to call.
    """
    actions = ctypes.create_string_buffer(_ACTION * len(_HANDLED))
    begins = range(0, len(actions), _ACTION)
    for number, begin in zip(_HANDLED, begins, strict=True):
        _c.sigaction(number, None, ctypes.byref(actions, begin))
    raw = actions.raw
    return [raw[begin : begin + _HANDLER] + raw[begin:][_FLAGS] for begin in begins]


def _folder() -> str:
    try:
        return os.getcwd()
    except OSError:
        return ""


def _umask() -> int:
    mask = os.umask(0o077)
    os.umask(mask)
    return mask
