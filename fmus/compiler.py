"""Compiles C sources to shared libraries, with a cache.

The compiler is that of the environment variable CC, else `cc`, else Zig from the package `ziglang`, which
compiles for every platform in `PLATFORMS`. For Windows, MinGW-w64 is preferred where it is installed, as it
is faster.
"""

from __future__ import annotations

import ctypes
import hashlib
import importlib.util
import os
import platform
import re
import shlex
import shutil
import struct
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
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
COMPILED = "compiled"
"""Folder of the cache for libraries of FMUs for other platforms than this."""
OWN_FLAGS = ("-std=gnu11", "-O2", "-fPIC", "-shared", "-fvisibility=hidden", "-ffp-contract=off", "-pthread")
"""Compiler flags for C code of this program; fused multiply-add would give other results than Python."""


@dataclass(frozen=True)
class Platform:
    """Platform of native libraries.

    Attributes:
        name: as FMI 3.0 spells it, its folder in archives.
        folder: folder in archives of FMI 2.0, which knows neither ARM nor two kinds of macOS.
        suffix: of libraries.
        zig: target of Zig.
        flags: of its compilers.
    """

    name: str
    folder: str
    suffix: str
    zig: str
    flags: tuple[str, ...]


LINUX = ("-O2", "-fPIC", "-Wl,--build-id=none", "-Wl,-z,defs", "-s")
WINDOWS = ("-O1", "-s")
MACOS = ("-O2",)
PLATFORMS = {
    platform.name: platform
    for platform in (
        Platform("x86_64-linux", "linux64", ".so", "x86_64-linux-gnu.2.17", LINUX),
        Platform("aarch64-linux", "aarch64-linux", ".so", "aarch64-linux-gnu.2.17", LINUX),
        Platform("x86_64-windows", "win64", ".dll", "x86_64-windows-gnu", WINDOWS),
        Platform("x86_64-darwin", "darwin64", ".dylib", "x86_64-macos", MACOS),
        Platform("aarch64-darwin", "darwin64", ".dylib", "aarch64-macos", MACOS),
    )
}
"""Name of a platform -> the platform, of all for which native libraries can be compiled."""
OWN, TO_WINDOWS = PLATFORMS["x86_64-linux"], PLATFORMS["x86_64-windows"]
"""The platform on which native libraries are compared with Python; Windows."""
MINGW = "x86_64-w64-mingw32-gcc"
OF_MINGW = ("-static", "-Wl,--no-insert-timestamp")


def compiler_command() -> list[str]:
    """Return the command of the C compiler: environment variable CC, else `cc`, else Zig."""
    named = shlex.split(os.environ.get("CC", ""))
    return named or (["cc"] if shutil.which("cc") else zig_command(_here()) or ["cc"])


def zig_command(target: str) -> list[str] | None:
    """Return the command of Zig's C compiler for one of its targets, None if it is not installed."""
    zig = _zig()
    return None if zig is None else [zig, "cc", "-target", target, "-fno-sanitize=undefined"]


@cache
def _zig() -> str | None:
    spec = importlib.util.find_spec("ziglang")
    program = Path(spec.origin or "").with_name("zig.exe" if os.name == "nt" else "zig") if spec else None
    return str(program) if program and program.is_file() else None


def _here() -> str:
    """Return the target of Zig for this machine."""
    architecture = {"amd64": "x86_64", "arm64": "aarch64"}.get(platform.machine().lower(), platform.machine())
    return f"{architecture}-" + {"win32": "windows-gnu", "darwin": "macos"}.get(
        sys.platform, "linux-gnu.2.17"
    )


def compiler_for(target: Platform) -> tuple[list[str], tuple[str, ...]] | None:
    """Return the command and the flags of the fastest compiler for a platform, None if there is none."""
    if target == OWN:
        return compiler_command(), target.flags
    if target == TO_WINDOWS and shutil.which(MINGW):
        return [MINGW], (*OF_MINGW, *target.flags)
    command = zig_command(target.zig)
    return (command, target.flags) if command else None


def libraries_for(
    targets: Iterable[Platform], name: str, sources: Mapping[str, bytes], *arguments: str
) -> dict[str, bytes]:
    """Return an FMU's libraries for other platforms than this, as path in FMI 2.0 -> content.

    Args:
        targets: platforms. Libraries of both kinds of macOS are joined.
        name: of the FMU.
        sources, arguments: as for `compile_library`.

    Raises:
        BuildError: there is no compiler for one of them, or compilation fails.
    """
    files: dict[str, list[bytes]] = {}
    for target in targets:
        compiler = compiler_for(target)
        if compiler is None:
            raise BuildError(
                f"no compiler for {target.name}: 'pip install yawbench[compiler]' brings one",
                code="compiler-missing",
            )
        command, flags = compiler
        library = cached_library(
            COMPILED, sources, [*flags, *arguments], compiler_version(command), command=command
        )
        files.setdefault(f"binaries/{target.folder}/{name}{target.suffix}", []).append(library)
    return {path: found[0] if len(found) == 1 else universal(found) for path, found in files.items()}


def universal(libraries: Sequence[bytes]) -> bytes:
    """Return a universal library of macOS from one for each processor (Mach-O, `fat_header`)."""
    align = 14  # a power of 2: that of pages on ARM
    made, rows, place = b"", b"", 1 << align
    for library in libraries:
        processor = struct.unpack("<II", library[4:12])
        rows += struct.pack(">IIIII", *processor, place, len(library), align)
        made += library + bytes(-len(library) % (1 << align))
        place = (1 << align) + len(made)
    head = struct.pack(">II", 0xCAFEBABE, len(libraries)) + rows
    return head + bytes((1 << align) - len(head)) + made


def compiler_version(command: Sequence[str]) -> str:
    """Return the version text of a compiler.

    Raises:
        BuildError: the compiler does not exist.
    """
    if shutil.which(command[0]) is None:
        raise BuildError(
            f"no C compiler ({command[0]} not found); name one in the environment variable CC, or "
            "'pip install yawbench[compiler]'",
            code="compiler-missing",
        )
    with tempfile.TemporaryDirectory() as folder:  # Zig for macOS leaves an object file where it is asked
        return subprocess.run(
            [*command, "--version"], cwd=folder, capture_output=True, text=True, check=False
        ).stdout


def can_compile() -> bool:
    """Return whether there is a C compiler for this machine."""
    return shutil.which(compiler_command()[0]) is not None


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
            raise BuildError(
                _reasons(done.stderr) or [f"the C compiler failed: exit status {done.returncode}"],
                code="compiler-failed",
            )
        if done.stderr:
            print(printable(done.stderr.rstrip()), file=sys.stderr)
        return Path(temporary, "library.so").read_bytes()


def _reasons(said: str) -> list[str]:
    """Return the lines that say why a compiler or its linker failed."""
    lines = [line for line in said.splitlines() if _REASON.search(line) and not line.endswith(":")]
    return [line for line in lines if "ld returned" not in line] or lines


_REASON = re.compile(r"\berror\b|undefined|\bld(\.\w+)?: ")
"""What such a line has; a linker begins each of its lines with its name."""


def cached_library(
    store: str,
    sources: Mapping[str, bytes],
    arguments: Sequence[str],
    version: str | None = None,
    command: Sequence[str] | None = None,
) -> bytes:
    """Return a shared library from the cache, compiling it first if necessary.

    Args:
        store: folder of the cache.
        sources, arguments: as for `compile_library`.
        version: version of the compiler; None: libraries of all versions are equivalent.
        command: command of the compiler; default: that for this machine.

    Raises:
        BuildError: there is no C compiler, or compilation fails.
    """
    command = command or compiler_command()
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


def launcher_sources() -> bytes:
    """Return what determines the launcher, except for the compiler."""
    return b"".join(
        [*((HERE / name).read_bytes() for name in SOURCES), *map(str.encode, (*FLAGS, *LIBRARIES))]
    )


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
