"""Processes of Python that find the modules that this one does, and how they ended."""

from __future__ import annotations

import signal
import sys

_PROGRAM = (
    "import sys; sys.path[:] = sys.argv[2].split('\\n'); from importlib import import_module; "
    "import_module(sys.argv[1]).main(*sys.argv[3:])"
)


def python(module: str, *arguments: object) -> list[str]:
    """Return the command that calls `main` of a module with arguments, all of them text."""
    return [sys.executable, "-c", _PROGRAM, module, "\n".join(sys.path), *map(str, arguments)]


def how_it_ended(code: int) -> str:
    """Return what a process did that has ended with this code, as `subprocess` gives it."""
    if code >= 0:
        return f"ended itself with exit status {code}"
    try:
        name = signal.Signals(-code).name
    except ValueError:
        name = f"signal {-code}"
    return f"died of {name}" + (" (sent from outside or for want of memory)" if name == "SIGKILL" else "")
