"""The launcher as a binary: compiled by cc once per source and compiler, then kept in a cache."""

from __future__ import annotations

import hashlib
import os
import platform
import shlex
import shutil
import subprocess
import sys
import tempfile
from functools import cache
from pathlib import Path

from orchestrator.cache import keep, recall

HERE = Path(__file__).resolve().parent
SOURCES = ("launcher.c", "fmi2.h", "find_python.h", "text.h")
FLAGS = ("-std=c11", "-O2", "-fPIC", "-shared", "-fvisibility=hidden", "-Wl,--build-id=none", "-s")
LIBRARIES = ("-ldl", "-pthread")
STORE = "launcher"
"""Of compiled launchers in the cache."""


def compiler_command() -> list[str]:
    """Return how the C compiler is called: `cc`, or what `CC` names."""
    return shlex.split(os.environ.get("CC", "")) or ["cc"]


def compiler_tools() -> tuple[str, str]:
    """Return what decides which compiler that is and what it does (see `evidence`)."""
    return "env:CC", f"tool:{compiler_command()[0]}"


def compile_launcher() -> tuple[bytes | None, str]:
    """Return the launcher for this machine, or None with the reason why there is none.

    The same sources and the same compiler give the same bytes; another compiler may give others.
    """
    return _launcher(tuple(compiler_command()))


@cache
def _launcher(command: tuple[str, ...]) -> tuple[bytes | None, str]:
    if sys.platform != "linux" or platform.machine() != "x86_64":
        return None, f"it is for Linux on x86-64, this is {platform.system()} on {platform.machine()}"
    compiler = shutil.which(command[0])
    if compiler is None:
        return None, f"there is no C compiler ({command[0]})"
    version = subprocess.run([*command, "--version"], capture_output=True, text=True, check=False).stdout
    content = hashlib.sha256("\0".join([*command, version, *FLAGS, *LIBRARIES]).encode())
    for name in SOURCES:
        content.update((HERE / name).read_bytes())
    key = content.hexdigest()[:16]
    kept = recall(STORE, key)
    if kept is not None:
        return kept, ""
    with tempfile.TemporaryDirectory() as temporary:
        made = Path(temporary) / "launcher.so"
        # Relative names: what the compiler writes must not depend on where the sources stand.
        done = subprocess.run(
            [*command, *FLAGS, "launcher.c", "-o", str(made), *LIBRARIES],
            cwd=HERE,
            capture_output=True,
            text=True,
            check=False,
        )
        if done.returncode != 0:
            lines = [line for line in done.stderr.splitlines() if "error" in line]
            return None, f"the C compiler failed: {(lines or [f'exit status {done.returncode}'])[0]}"
        binary = made.read_bytes()
    keep(STORE, key, binary)
    return binary, ""
