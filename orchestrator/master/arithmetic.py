"""The floating-point environment of a process, which its instances share and an FMU may change.

Libraries compiled for speed flush small numbers to zero for the whole process from the moment they are
loaded; others set a rounding mode and leave it. Loading, instantiation and initialization are few calls: what
they have changed is restored after each of them. In a step that would cost more than the work of many
instances, so between steps the environment is only checked, now and then: if it has changed, the run ends,
because it is unknown since when. Isolated instances share nothing.
"""

from __future__ import annotations

import ctypes
import platform
import struct

from .log import MASTER, WARNING, Log

_MACHINE = platform.machine()
_ENVIRONMENT = 64  # bytes; no platform's fenv_t is larger
_c = ctypes.CDLL(None)


class Arithmetic:
    """How this process rounded, flushed to zero and trapped when this was made."""

    def __init__(self) -> None:
        self._environment = _environment()
        self._control = _control(self._environment)
        self._reported: set[str] = set()

    def changed(self) -> bool:
        """Return whether it has changed since then."""
        return _control(_environment()) != self._control

    def restore(self, instance: str, log: Log) -> None:
        """Restore what an instance has changed; log a warning the first time."""
        if not self.changed():
            return
        _c.fesetenv(self._environment)
        if instance not in self._reported:
            self._reported.add(instance)
            what = "how numbers are rounded, flushed to zero or trapped"
            text = f"it changed {what}, which all instances share; this was undone"
            log.add(instance, WARNING, MASTER, text)


def _environment() -> ctypes.Array[ctypes.c_char]:
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
