"""Compiles C sources to shared libraries, with a cache for the launcher and C code of this program."""

from __future__ import annotations

import ctypes
import hashlib
import os
import platform
import shlex
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path

from yawbench.foundation.cache import cache_folder, keep, recall
from yawbench.foundation.errors import BuildError, YawbenchError
from yawbench.foundation.messages import printable

HERE = Path(__file__).resolve().parent
SOURCES = (
    "launcher.c",
    "calling_sequence.h",
    "fmi2.h",
    "find_python.h",
    "oldest_glibc.h",
    "seal.h",
    "text.h",
)
FLAGS = ("-std=c11", "-O2", "-fPIC", "-shared", "-fvisibility=hidden", "-Wl,--build-id=none", "-s")
LIBRARIES = ("-ldl", "-pthread")
STORE = "launcher"
"""Folder of the cache for compiled launchers."""
OWN_FLAGS = ("-std=gnu11", "-O2", "-fPIC", "-shared", "-fvisibility=hidden", "-ffp-contract=off", "-pthread")
"""Compiler flags for C code of this program; fused multiply-add would give other results than Python."""


def compiler_command() -> list[str]:
    """Return the command of the C compiler: environment variable CC, else `cc`."""
    return shlex.split(os.environ.get("CC", "")) or ["cc"]


def compiler_tools() -> tuple[str, str]:
    """Return the items that identify the compiler (see `evidence`)."""
    return "env:CC", f"tool:{compiler_command()[0]}"


def compiler_version(command: Sequence[str]) -> str:
    """Return the version text of a compiler.

    Raises:
        BuildError: the compiler does not exist.
    """
    if shutil.which(command[0]) is None:
        raise BuildError(
            f"no C compiler ({command[0]} not found); name one in the environment variable CC",
            code="compiler-missing",
        )
    return subprocess.run([*command, "--version"], capture_output=True, text=True, check=False).stdout


def compile_library(command: Sequence[str], sources: Mapping[str, bytes], *arguments: str) -> bytes:
    """Compile files into a shared library and return it; warnings of the compiler go to stderr.

    Args:
        command: command of the compiler.
        sources: relative name -> content; relative, so that equal sources give equal libraries.
        arguments: files to compile, and options.

    Raises:
        BuildError: compilation fails; with the compiler's messages.
    """
    with tempfile.TemporaryDirectory(prefix="yawbench_") as temporary:
        for name, content in sources.items():
            Path(temporary, name).write_bytes(content)
        done = subprocess.run(
            [*command, *arguments, "-o", "library.so"],
            cwd=temporary,
            capture_output=True,
            text=True,
            check=False,
        )
        if done.returncode != 0:
            lines = [line for line in done.stderr.splitlines() if "error" in line or "undefined" in line]
            raise BuildError(
                lines or [f"the C compiler failed: exit status {done.returncode}"], code="compiler-failed"
            )
        if done.stderr:
            print(printable(done.stderr.rstrip()), file=sys.stderr)
        return Path(temporary, "library.so").read_bytes()


def cached_library(
    store: str, sources: Mapping[str, bytes], arguments: Sequence[str], version: str | None = None
) -> bytes:
    """Return a shared library from the cache, compiling it first if necessary.

    Args:
        store: folder of the cache.
        sources, arguments: as for `compile_library`.
        version: version of the compiler; None: libraries of all versions are equivalent.

    Raises:
        BuildError: there is no C compiler, or compilation fails.
    """
    command = compiler_command()
    settings = "\0".join([*command, version or platform.machine(), *arguments])
    key = hashlib.sha256(b"".join([settings.encode(), *sources.values()])).hexdigest()[:16]
    binary = recall(store, key)
    if binary is None:
        if version is None:
            compiler_version(command)
        binary = compile_library(command, sources, *arguments)
        keep(store, key, binary)
    return binary


@cache
def load_compiled(source: Path) -> tuple[ctypes.CDLL | None, str]:
    """Compile a C file and load it into this process; return the library, or None and the reason."""
    if os.name != "posix" or sys.maxsize < 2**32:
        return None, f"{source.name} requires a 64-bit system with POSIX threads"
    try:
        sources = {source.name: source.read_bytes()}
        binary = cached_library(source.stem, sources, [*OWN_FLAGS, source.name])
        with tempfile.NamedTemporaryFile(dir=cache_folder(), suffix=".so") as copy:
            copy.write(binary)
            copy.flush()
            return ctypes.CDLL(copy.name), ""
    except YawbenchError as error:
        return None, str(error.diagnostics[0])
    except OSError as error:
        return None, f"{source.name} cannot be loaded: {error}"


def compile_launcher() -> tuple[bytes | None, str]:
    """Return the launcher for this machine, or None and the reason.

    The same sources and the same compiler give the same bytes; another compiler may give others.
    """
    return _launcher(tuple(compiler_command()))


@cache
def _launcher(command: tuple[str, ...]) -> tuple[bytes | None, str]:
    if sys.platform != "linux" or platform.machine() != "x86_64":
        return None, f"it requires Linux on x86-64, this is {platform.system()} on {platform.machine()}"
    sources = {name: (HERE / name).read_bytes() for name in SOURCES}
    try:
        arguments = [*FLAGS, SOURCES[0], *LIBRARIES]
        binary = cached_library(STORE, sources, arguments, compiler_version(command))
    except BuildError as error:
        why = str(error.diagnostics[0])
        return None, why if "C compiler" in why else f"the C compiler failed: {why}"
    return binary, ""
