"""The shared library in an FMU: its path for this platform, its functions, whether it is native or Python."""

from __future__ import annotations

import os
import platform as machine
import re
import sys
import zipfile
from functools import lru_cache
from pathlib import Path

from ..messages import listed, short
from ..plan import Fmu, RunsAs

_ALWAYS = ("EnterInitializationMode", "ExitInitializationMode", "DoStep", "FreeInstance")
CORE = {
    2: ("Instantiate", "SetupExperiment", *_ALWAYS),
    3: ("InstantiateCoSimulation", *_ALWAYS),
}
"""Major version of FMI -> functions that every run calls."""
INTEGERS = tuple(f"{sign}Int{bits}" for bits in (8, 16, 32, 64) for sign in ("", "U"))
TYPES = {
    2: ("Real", "Integer", "Boolean", "String"),
    3: ("Float32", "Float64", *INTEGERS, "Boolean", "String"),
}
"""Major version of FMI -> types as in the names of setters and getters."""
_FILE_NAME = re.compile(r"[^/\\:\x00-\x1f\x7f]{1,200}")

_ARCHITECTURES = {"amd64": "x86_64", "x86_64": "x86_64", "arm64": "aarch64", "aarch64": "aarch64"}


def integer_limits(kind: str) -> tuple[int, int]:
    """Return the smallest and the largest number of an integer type of FMI 3.0, such as "UInt8"."""
    bits = int(kind.partition("Int")[2])
    return (0, 2**bits - 1) if kind.startswith("U") else (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1)


def platform(fmi: int = 2) -> tuple[str, str]:
    """Return the name of this platform in a version of FMI, and the suffix of its binaries."""
    names = {"win32": ("win", ".dll"), "cygwin": ("win", ".dll"), "darwin": ("darwin", ".dylib")}
    system, suffix = names.get(sys.platform, ("linux", ".so"))  # as in fmpy, which is slow to import
    wide = sys.maxsize > 2**32
    if fmi == 2:
        return f"{system}{64 if wide else 32}", suffix
    architecture = _ARCHITECTURES.get(machine.machine().lower(), "x86_64") if wide else "x86"
    return f"{architecture}-{'windows' if system == 'win' else system}", suffix


def binary_of(fmi: int, identifier: str) -> str:
    """Return the path, within the archive, of the library for this platform."""
    name, suffix = platform(fmi)
    return f"binaries/{name}/{identifier}{suffix}"


def binary_problem(fmu: Fmu) -> str | None:
    """Return why an FMU cannot be loaded on this platform, None if it has a binary for it."""
    identifier = fmu.model_identifier
    if not _FILE_NAME.fullmatch(identifier) or identifier in (".", ".."):
        return (
            f"modelIdentifier {short(identifier)} cannot name the library of an FMU: "
            "it may contain letters, digits and _, at most 200"
        )
    missing = binary_of(fmu.fmi, identifier)
    if (fmu.directory / missing).is_file():
        return None
    name, _ = platform(fmu.fmi)
    present = sorted(p.name for p in fmu.directory.glob("binaries/*") if p.is_dir() and any(p.iterdir()))
    if name in present:
        files = sorted(p.name for p in (fmu.directory / "binaries" / name).iterdir())
        return (
            f"no binary of the name that the model identifier asks for ({missing}); binaries/{name} contains "
            f"{listed(files)}"
        )
    others = f"it has binaries for {listed(present)}" if present else "it has no binaries"
    return f"no binary for this platform ({missing}); {others}"


def lacking(library: bytes | None, fmi: int) -> tuple[str, ...]:
    """Return the functions that this program may call and the library does not export.

    The library is not loaded: a function whose name is not in the file cannot be found after loading. A file
    with none of the names gets its functions from another library; it is checked when it is loaded.
    """
    access = [f"{verb}{kind}" for verb in ("Set", "Get") for kind in TYPES[fmi]]
    named = {name: f"fmi{fmi}{name}" for name in (*CORE[fmi], *access)}
    missing = [name for name, full in named.items() if f"{full}\0".encode() not in (library or b"")]
    return () if len(missing) == len(named) else tuple(named[name] for name in missing)


REASON = "extra/org.yawbench.native/native.txt"
"""Path in an archive of why it has no native library; empty if it has one."""
WANTED = "YAWBENCH_UNITS"
"""Environment variable: `python` asks for Python in place of native code."""


PYTHON_WANTED = RunsAs(f"{WANTED} asks for it")


def python_wanted() -> bool:
    """Return whether the environment asks for Python in place of native code."""
    return os.environ.get(WANTED) == "python"


def runs_as(archive: Path) -> RunsAs | None:
    """Return how an FMU that was built from Python here runs, None for any other."""
    try:
        reason = _reason(str(archive), os.stat(archive).st_mtime_ns)
    except OSError:
        return None
    if reason is None:
        return None
    if reason:
        return RunsAs(reason)
    if python_wanted():
        return PYTHON_WANTED
    return RunsAs() if sys.platform == "linux" else RunsAs("the native library is for Linux")


def is_native(directory: Path) -> bool:
    """Return whether the FMU unpacked in a folder was built here and runs natively in this process."""
    if sys.platform != "linux" or python_wanted():
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
