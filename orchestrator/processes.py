"""Python in another process, which finds the modules that this one does and none in the working folder."""

from __future__ import annotations

import contextlib
import os
import sys
from collections.abc import Iterator

SAFE_PATH = "PYTHONSAFEPATH"
"""Environment variable that keeps the working folder off a new Python's path; from Python 3.11 on."""

_PROGRAM = (
    "import sys; sys.path[:] = sys.argv[2].split('\\n'); from importlib import import_module; "
    "import_module(sys.argv[1]).main(*sys.argv[3:])"
)


def python(module: str, *arguments: object) -> list[str]:
    """Return the command that calls `main` of a module with arguments, all of them text."""
    return [sys.executable, "-c", _PROGRAM, module, "\n".join(sys.path), *map(str, arguments)]


@contextlib.contextmanager
def safe_path() -> Iterator[None]:
    """Let processes that the standard library starts meanwhile leave the working folder alone."""
    given = os.environ.get(SAFE_PATH)
    os.environ[SAFE_PATH] = "1"
    try:
        yield
    finally:
        if given is None:
            del os.environ[SAFE_PATH]
        else:
            os.environ[SAFE_PATH] = given
