"""What all code of a process shares, and a unit may therefore change for the others.

Libraries that are compiled for speed let small numbers become zero for everybody from the moment they
are loaded; others set a rounding mode or a locale (after which `strtod` reads "0,5") and leave it.
Loading, instantiation and initialization are few calls: what they have changed is undone after each of
them. In a step that would cost more than many units' own work, so between steps it is only looked, now and
then, whether numbers are still computed as they were: if not, the run ends, for nobody knows since when.
Units that are isolated share nothing.
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

from ..plan import Unit
from .log import MASTER, WARNING, Log

_ENVIRONMENT = 64  # bytes; no platform's fenv_t is larger

_c = ctypes.CDLL(None)
_c.setlocale.restype = ctypes.c_char_p
_HANDLED = [getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGPIPE") if hasattr(signal, name)]


class Surroundings:
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


def suspects(units: Sequence[Unit]) -> list[str]:
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
