"""Python in another process, which finds the modules that this one does and none in the working folder."""

from __future__ import annotations

import sys

_PROGRAM = (
    "import sys; sys.path[:] = sys.argv[2].split('\\n'); from importlib import import_module; "
    "import_module(sys.argv[1]).main(*sys.argv[3:])"
)


def python(module: str, *arguments: object) -> list[str]:
    """Return the command that calls `main` of a module with arguments, all of them text."""
    return [sys.executable, "-c", _PROGRAM, module, "\n".join(sys.path), *map(str, arguments)]
