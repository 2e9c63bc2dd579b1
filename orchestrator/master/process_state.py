"""Process-wide state that an FMU may corrupt for others.

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
import locale
import mmap
import os
import platform
import signal
import struct
import sys
import threading
from collections.abc import Iterator, Sequence

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
                log.add(
                    unit, WARNING, MASTER, f"it changed {what}, which all instances share; this was undone"
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
