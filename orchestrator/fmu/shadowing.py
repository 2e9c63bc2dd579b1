"""A guard against units that would silently run each other's code.

All PythonFMU units of a process share one interpreter: of two modules with one name, the second is
never loaded. Units made by `yawbench build` carry names that no other content has; units from
elsewhere may not.
"""

from __future__ import annotations

import hashlib
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ..plan import Fmu


def shadowed_modules(fmus: Mapping[str, Fmu], *, isolated: bool = False) -> list[str]:
    """Return a sentence for every unit that would run another unit's, or this program's, module.

    Args:
        fmus: unit -> FMU.
        isolated: each unit has a process of its own, and so no other's modules.
    """
    problems = []
    seen: dict[str, tuple[str, str]] = {}
    for unit, fmu in fmus.items():
        for module, content in fmu.python_modules.items():
            other, its_content = seen.setdefault(module, (unit, content))
            if its_content != content and not isolated:
                problems.append(
                    f"{unit} ({fmu.name}) would run code of {other} ({fmus[other].name}): both FMUs bring "
                    f"a Python module {module!r}, and a process has room for one; rebuild one of them "
                    "with another module name, or run with --isolate"
                )
            elif module in sys.stdlib_module_names:
                problems.append(
                    f"{unit} ({fmu.name}) would run other code: its Python module {module!r} has the name "
                    "of one of Python's own; rebuild it with another module name"
                )
            elif _loaded_from_elsewhere(module, content, fmu.directory):
                problems.append(
                    f"{unit} ({fmu.name}) would run other code: another Python module {module!r} is loaded "
                    "in this process already; rebuild it with another module name"
                )
    return problems


def _loaded_from_elsewhere(module: str, content: str, directory: Path) -> bool:
    """Return whether `module` is loaded, from other content than this unit's."""
    homes = [home for home in _homes(module) if not home.is_relative_to(directory)]
    return any(_content(home, module) != content for home in homes)


def _homes(module: str) -> list[Path]:
    """Return the folders that a loaded module comes from: several if it is a folder without __init__.py."""
    loaded = sys.modules.get(module)
    file = getattr(loaded, "__file__", None)
    if file is not None:
        return [Path(file).parents[1 if Path(file).name == "__init__.py" else 0]]
    return [Path(folder).parent for folder in getattr(loaded, "__path__", ())]


def _content(home: Path, module: str) -> str | None:
    """Return the hash of a module's files in a folder; None if they cannot be read."""
    package = home / module
    files = package.rglob("*.py") if package.is_dir() else [home / f"{module}.py"]
    try:
        return hashes_of_modules({f.relative_to(home).as_posix(): f.read_bytes() for f in files}).get(module)
    except OSError:
        return None


def hashes_of_modules(files: Mapping[str, bytes]) -> dict[str, str]:
    """Return the top-level Python modules among files, by their paths, each with a hash of its content."""
    hashes: dict[str, Any] = {}
    for name in sorted(files):
        if name.endswith(".py"):
            digest = hashes.setdefault(name.partition("/")[0].removesuffix(".py"), hashlib.sha256())
            digest.update(name.encode() + b"\0" + files[name] + b"\0")
    return {module: digest.hexdigest() for module, digest in hashes.items()}
