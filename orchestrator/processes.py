"""Starting Python child processes safely.

Children search for modules where this process does. Those of multiprocessing neither run the user's script
again nor import modules from the working folder.
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
    """Return the command line that calls `main` of a module with the arguments as strings."""
    return [sys.executable, "-c", _PROGRAM, module, "\n".join(sys.path), *map(str, arguments)]


def how_it_ended(code: int) -> str:
    """Describe how a process ended, by its return code as `subprocess` gives it."""
    if code >= 0:
        return f"ended itself with exit status {code}"
    try:
        name = signal.Signals(-code).name
    except ValueError:
        name = f"signal {-code}"
    return f"died of {name}" + (" (sent from outside or for want of memory)" if name == "SIGKILL" else "")


SAFE_PATH = "PYTHONSAFEPATH"
"""Environment variable that keeps the working folder out of `sys.path`; from Python 3.11 on."""


@contextlib.contextmanager
def safe_path() -> Iterator[None]:
    """Keep the working folder out of `sys.path` of processes that multiprocessing starts in this block."""
    before = os.environ.get(SAFE_PATH)
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
        if before is None:
            del os.environ[SAFE_PATH]
        else:
            os.environ[SAFE_PATH] = before


def _off_path(command: Sequence[str]) -> list[str]:
    """Return a `python -c` command that first removes the working folder from `sys.path`."""
    at = command.index("-c") + 1
    return [*command[:at], f"import sys; del sys.path[0]; {command[at]}", *command[at + 1 :]]


@contextlib.contextmanager
def no_script() -> Iterator[None]:
    """Keep processes that multiprocessing starts in this block from running the main script again.

    Users' scripts would otherwise need `if __name__ == "__main__":`; the functions that the processes call
    can be imported without the script.
    """
    script = sys.modules["__main__"]
    sys.modules["__main__"] = ModuleType("__main__")
    try:
        yield
    finally:
        sys.modules["__main__"] = script


class SafeSpawnProcess(context.SpawnProcess):
    """A spawned process that neither runs the main script nor imports from the working folder."""

    @staticmethod
    def _Popen(process: BaseProcess) -> Any:
        with safe_path(), no_script():
            return context.SpawnProcess._Popen(process)  # type: ignore[attr-defined]


class SafeSpawnContext(context.SpawnContext):
    """Multiprocessing context that starts `SafeSpawnProcess`es."""

    Process = SafeSpawnProcess


if hasattr(context, "ForkServerContext"):  # not on Windows

    class SafeForkServerProcess(context.ForkServerProcess):
        """A process forked from a server that has already imported its modules, without the main script."""

        @staticmethod
        def _Popen(process: BaseProcess) -> Any:
            with no_script():
                return context.ForkServerProcess._Popen(process)  # type: ignore[attr-defined]

    class SafeForkServerContext(context.ForkServerContext):
        """Multiprocessing context that starts `SafeForkServerProcess`es."""

        Process = SafeForkServerProcess
