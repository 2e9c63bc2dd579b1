"""Processes of Python that find the modules that this one does, and how they ended.

Processes of the standard library's multiprocessing that run neither the caller's script once more nor
modules in the working folder.
"""

from __future__ import annotations

import contextlib
import os
import signal
import sys
from collections.abc import Iterator, Sequence
from multiprocessing import context, util
from multiprocessing.process import BaseProcess
from types import ModuleType
from typing import Any

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


SAFE_PATH = "PYTHONSAFEPATH"
"""Environment variable that keeps the working folder off a new Python's path; from Python 3.11 on."""


@contextlib.contextmanager
def safe_path() -> Iterator[None]:
    """Let processes that multiprocessing starts meanwhile leave the working folder alone."""
    given = os.environ.get(SAFE_PATH)
    os.environ[SAFE_PATH] = "1"
    start: Any = getattr(util, "spawnv_passfds", None)
    if sys.version_info < (3, 11) and start:

        def start_safely(path: bytes, args: Sequence[Any], passfds: Sequence[int]) -> int:
            return start(path, _off_path(args), passfds)

        util.spawnv_passfds = start_safely
    try:
        yield
    finally:
        if sys.version_info < (3, 11) and start:
            util.spawnv_passfds = start
        if given is None:
            del os.environ[SAFE_PATH]
        else:
            os.environ[SAFE_PATH] = given


def _off_path(command: Sequence[str]) -> list[str]:
    """Return the command of a Python with a one-line program, which takes the working folder off its path."""
    at = command.index("-c") + 1
    return [*command[:at], f"import sys; del sys.path[0]; {command[at]}", *command[at + 1 :]]


@contextlib.contextmanager
def no_script() -> Iterator[None]:
    """Let processes that multiprocessing starts meanwhile leave the program's script alone.

    They would run it once more, which needs `if __name__ == "__main__":` there; what they do is
    importable from elsewhere.
    """
    script = sys.modules["__main__"]
    sys.modules["__main__"] = ModuleType("__main__")
    try:
        yield
    finally:
        sys.modules["__main__"] = script


class SafeSpawnProcess(context.SpawnProcess):
    """A process that starts afresh."""

    @staticmethod
    def _Popen(process: BaseProcess) -> Any:
        with safe_path(), no_script():
            return context.SpawnProcess._Popen(process)  # type: ignore[attr-defined]


class SafeSpawnContext(context.SpawnContext):
    """What starts such processes."""

    Process = SafeSpawnProcess


if hasattr(context, "ForkServerContext"):  # not on Windows

    class SafeForkServerProcess(context.ForkServerProcess):
        """A process that a server starts, which has imported what it needs."""

        @staticmethod
        def _Popen(process: BaseProcess) -> Any:
            with no_script():
                return context.ForkServerProcess._Popen(process)  # type: ignore[attr-defined]

    class SafeForkServerContext(context.ForkServerContext):
        """What starts such processes."""

        Process = SafeForkServerProcess
