"""What all code of a process shares, and a unit may therefore change for the others.

Libraries that are compiled for speed let small numbers become zero for everybody from the moment they
are loaded; others set a rounding mode or a locale (after which `strtod` reads "0,5") and leave it.
Loading, instantiation and initialization are few calls: what they have changed is undone after each of
them. In a step that would cost more than many units' own work, so between steps it is only looked, now and
then, whether numbers are still computed as they were: if not, the run ends, for nobody knows since when.
Units that are isolated share nothing.

Ctrl-C and SIGTERM as a wish that is looked at between steps.

Python's own answer to Ctrl-C is an exception wherever the program happens to be, which inside an
FMU would end in half a step or a dead process.
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
    """Those of this process, as they are when this is made."""

    def __init__(self) -> None:
        self._arithmetic = _arithmetic()
        self._locale = _c.setlocale(locale.LC_ALL, None)
        self._folder = os.getcwd()
        self._umask = _umask()
        self._told: set[tuple[str, str]] = set()

    def arithmetic_changed(self) -> bool:
        """Return whether numbers are rounded, flushed to zero or trapped in another way by now."""
        return _control(_arithmetic()) != _control(self._arithmetic)

    def restore(self, unit: str, log: Log) -> None:
        """Undo what a unit has changed; the first time it does, that is a warning."""
        for what in self._undone():
            if (unit, what) not in self._told:
                self._told.add((unit, what))
                log.add(unit, WARNING, MASTER, f"it changed {what}, which all units share; that was undone")

    def _undone(self) -> Iterator[str]:
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
                if (handler := signal.getsignal(number)) is not None:  # Python's, whatever C has now
                    signal.signal(number, handler)


class Copies:
    """Ends the copies that a unit makes of this process with `fork` and lets return.

    Each would go on with the run, and a unit that forks in every step would soon fill the machine. The
    process is looked at once per step.
    """

    def __init__(self) -> None:
        self.process = os.getpid()
        self._made = mmap.mmap(-1, 1)  # shared with them

    def end(self) -> None:
        """End this process if it is a copy."""
        if os.getpid() != self.process:
            self._made[0] = 1
            os._exit(0)

    @property
    def made(self) -> bool:
        """Whether one has been ended."""
        return bool(self._made[0])


def suspects(units: Sequence[Instance]) -> list[str]:
    """Return the units that may have changed something: those that are compiled, or all if none is."""
    return [u.name for u in units if u.fmu.compiled] or [u.name for u in units]


def flush_output() -> None:
    """Write what Python and C have still to print."""
    for stream in filter(None, (sys.stdout, sys.stderr)):
        with contextlib.suppress(OSError, ValueError):  # nobody reads it any more
            stream.flush()
    _c.fflush(None)


def _arithmetic() -> ctypes.Array[ctypes.c_char]:
    environment = ctypes.create_string_buffer(_ENVIRONMENT)
    _c.fegetenv(environment)
    return environment


def _control(environment: ctypes.Array[ctypes.c_char]) -> tuple[int, ...]:
    """Return what decides on results, without the flags that every operation may raise."""
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
    """Whether the run is to end, and the signal that asks for it."""

    def __init__(self) -> None:
        self.requested = False
        self.number: int = signal.SIGINT

    def request(self, number: int = signal.SIGINT) -> None:
        """Let it end."""
        global _requested_at
        self.requested, self.number = True, number
        _requested_at = _requested_at or time.monotonic()

    def interrupted(self, how: str, *, unit: str | None = None, time: float | None = None) -> Interrupted:
        """Return what to raise; `how` continues "the run was interrupted"."""
        space = "" if how.startswith(":") else " "
        problem = f"the run was interrupted{space}{how}"
        return Interrupted(problem, instance=unit, time=time, number=self.number)


def stop_requested_at() -> float | None:
    """Return when this process was asked to stop, by `time.monotonic` [s]; None if it was not."""
    return _requested_at


@contextlib.contextmanager
def terminable() -> Iterator[None]:
    """Let SIGTERM end the block as Ctrl-C does, with an exception.

    Raises:
        Interrupted: it came.
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
    """Let SIGINT and SIGTERM raise `flag` while the block runs; `again` is called if they repeat.

    Outside the main thread, where Python allows no handlers, the block just runs.

    Raises:
        Interrupted: one of them came too late for the block to end because of it.
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
