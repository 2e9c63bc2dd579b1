"""Whether a unit that was built here runs natively or in Python, and why."""

from __future__ import annotations

import os
import sys
import zipfile
from functools import lru_cache
from pathlib import Path

REASON = "extra/org.yawbench.native/native.txt"
"""Path in an archive of why it has no native library; empty if it has one."""
WANTED = "YAWBENCH_UNITS"
"""Environment variable: `python` asks for units in Python at run time."""
NATIVE = "native"


def runs_as(archive: Path) -> str | None:
    """Return "native", or "Python: " and why; None for an FMU that was not built from Python here."""
    try:
        reason = _reason(str(archive), os.stat(archive).st_mtime_ns)
    except OSError:
        return None
    if reason is None:
        return None
    if reason:
        return f"Python: {reason}"
    if os.environ.get(WANTED) == "python":
        return f"Python: {WANTED} asks for it"
    return NATIVE if sys.platform == "linux" else "Python: the native library is for Linux"


def is_native(directory: Path) -> bool:
    """Return whether the FMU unpacked in a folder was built here and runs natively in this process."""
    if sys.platform != "linux" or os.environ.get(WANTED) == "python":
        return False
    try:
        return (directory / REASON).stat().st_size == 0
    except OSError:
        return False


@lru_cache(maxsize=1024)
def _reason(archive: str, changed: int) -> str | None:
    try:
        with zipfile.ZipFile(archive) as opened:
            return opened.read(REASON).decode("utf-8", "replace")
    except (KeyError, zipfile.BadZipFile):
        return None
