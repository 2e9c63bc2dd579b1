"""Process-wide state that an FMU may corrupt for others, and signals that stop a run.

Libraries compiled for speed flush small numbers to zero for the whole process from the moment they are
loaded; others set a rounding mode or a locale (after which `strtod` reads "0,5") and leave it. Loading,
instantiation and initialization are few calls: what they have changed is restored after each of them. In a
step that would cost more than the work of many instances, so between steps only the floating-point
environment is checked, now and then: if it has changed, the run ends, because it is unknown since when.
Isolated instances share nothing.

Ctrl-C and SIGTERM set a flag that is checked between steps. Python's default for Ctrl-C is an exception at an
arbitrary point, which inside an FMU would end in half a step or a dead process.
"""

from __future__ import annotations

import contextlib
import ctypes
import locale
import mmap
import os
import platform
import signal
import struct
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from types import FrameType

from ..errors import Interrupted
from ..plan import Instance
from .log import MASTER, WARNING, Log

_ENVIRONMENT = 64  # bytes; no platform's fenv_t is larger

_c = ctypes.CDLL(None)
_c.setlocale.restype = ctypes.c_char_p
_HANDLED = [getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGPIPE") if hasattr(signal, name)]


class ProcessState:
    """Snapshot of the process-wide state: FPU mode, locale, working directory, umask, signal handlers."""

    def __init__(self) -> None:
        self._arithmetic = _arithmetic()
        self._locale = _c.setlocale(locale.LC_ALL, None)
        self._folder = os.getcwd()
        self._umask = _umask()
        self._reported: set[tuple[str, str]] = set()

    def arithmetic_changed(self) -> bool:
        """Return whether rounding, flush-to-zero or traps differ from the snapshot."""
        return _control(_arithmetic()) != _control(self._arithmetic)

    def restore(self, unit: str, log: Log) -> None:
        """Undo what an instance has changed; log a warning the first time."""
        for what in self._restored():
            if (unit, what) not in self._reported:
                self._reported.add((unit, what))
                log.add(unit, WARNING, MASTER, f"it changed {what}, which all units share; that was undone")

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
        if threading.current_thread() is threading.main_thread():
            for number in _HANDLED:
                if (handler := signal.getsignal(number)) is not None:  # Python's, whatever C has installed
                    signal.signal(number, handler)


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


def suspects(units: Sequence[Instance]) -> list[str]:
    """Return the instances that may have changed something: the compiled FMUs, or all if none is."""
    return [u.name for u in units if u.fmu.compiled] or [u.name for u in units]


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
    if platform.machine() in ("x86_64", "AMD64"):
        return struct.unpack_from("<H", environment)[0], struct.unpack_from("<I", environment, 28)[0] & ~0x3F
    if platform.machine() == "aarch64":
        return struct.unpack_from("<I", environment)
    return (_c.fegetround(),)


def _folder() -> str:
    try:
        return os.getcwd()
    except OSError:
        return ""


def _umask() -> int:
    mask = os.umask(0o077)
    os.umask(mask)
    return mask


_requested_at: float | None = None


class StopFlag:
    """Whether the run should stop, and the signal that requested it."""

    def __init__(self) -> None:
        self.flag = ctypes.c_int32(0)  # read by the compiled loop, too
        self.number: int = signal.SIGINT

    @property
    def requested(self) -> bool:
        return bool(self.flag.value)

    def request(self, number: int = signal.SIGINT) -> None:
        """Ask the run to stop."""
        global _requested_at
        self.flag.value, self.number = 1, number
        _requested_at = _requested_at or time.monotonic()

    def interrupted(self, how: str, *, unit: str | None = None, time: float | None = None) -> Interrupted:
        """Return the exception to raise; `how` continues the message "the run was interrupted"."""
        space = "" if how.startswith(":") else " "
        problem = f"the run was interrupted{space}{how}"
        return Interrupted(problem, instance=unit, time=time, number=self.number)


def stop_requested_at() -> float | None:
    """Return when this process was asked to stop, by `time.monotonic` [s]; None if it was not."""
    return _requested_at


@contextlib.contextmanager
def terminable() -> Iterator[None]:
    """Make SIGTERM end the block with an exception, as Ctrl-C does.

    Raises:
        Interrupted: SIGTERM was received.
    """

    def handle(number: int, frame: FrameType | None) -> None:
        raise Interrupted(number=number)

    if threading.current_thread() is not threading.main_thread():
        yield
        return
    earlier = signal.signal(signal.SIGTERM, handle)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, signal.SIG_DFL if earlier is None else earlier)


@contextlib.contextmanager
def interrupts(flag: StopFlag, again: Callable[[], None]) -> Iterator[None]:
    """Make SIGINT and SIGTERM set `flag` while the block runs; `again` is called if they repeat.

    Outside the main thread, where Python allows no handlers, the block just runs.

    Raises:
        Interrupted: a signal came too late to stop the block.
    """

    def handle(number: int, frame: FrameType | None) -> None:
        if flag.requested:
            again()
        flag.request(number)

    if threading.current_thread() is not threading.main_thread():
        yield
        return
    global _requested_at
    _requested_at = None
    numbers = (signal.SIGINT, signal.SIGTERM)
    earlier = [signal.signal(number, handle) for number in numbers]
    try:
        yield
    finally:
        _requested_at = None
        for number, handler in zip(numbers, earlier, strict=True):
            signal.signal(number, signal.SIG_DFL if handler is None else handler)
    if flag.requested:
        raise flag.interrupted("when it had ended")
