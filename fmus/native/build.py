"""Builds the native library of a component: translates it to C, compiles, and compares with Python.

Verified libraries are cached by the C text (which contains the GUID, and thus depends on the component's
sources), the headers, the compilers, the comparison and the Python used in the comparison. A change of the
translator that leaves the C text unchanged needs no compilation.
"""

from __future__ import annotations

import hashlib
import json
import os
import platform
import shutil
import sys
import tempfile
from base64 import b64decode, b64encode
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import Any

from yawbench.foundation.cache import keep, recall
from yawbench.foundation.errors import BuildError

from .. import usual_ranges
from ..compiler import compile_library, compiler_command, compiler_version
from . import compare_with_python, ir
from .emit import emit
from .specialise import Program, specialise
from .values import Refused

HERE = Path(__file__).resolve().parent
SHARED = [HERE.parent / name for name in ("calling_sequence.h", "fmi2.h", "oldest_glibc.h", "seal.h")]
HEADERS = {file.name: file for file in (HERE / "arithmetic.h", HERE / "unit.h", *SHARED)}
NATIVE_LIBRARY = "native.so"
"""Name of the native library, in the folder of the launcher, which opens it by this name."""
FLAGS = ("-std=c11", "-ffp-contract=off", "-frounding-math", "-fno-builtin", "-fno-math-errno", "-w", "-fPIC",
         "-shared", "-fvisibility=hidden")  # fmt: skip
"""Compiler flags: functions are those of libm, as in CPython, neither replaced nor fused by the compiler.
Without `-frounding-math`, GCC 12 replaces 0.0 - x by -x if x is an absolute value or was an integer,
which is wrong for 0."""
LINUX = ("-O2", "-Wl,--build-id=none", "-Wl,-z,defs", "-s")
TO_WINDOWS = "x86_64-w64-mingw32-gcc"
WINDOWS = ("-O1", "-static", "-Wl,--no-insert-timestamp", "-s")
STORE = "native"
"""Folder of native libraries in the cache."""
EFFORTS = "efforts"
"""Folder of the processor times of builds of native libraries, in the cache."""
LONGEST = 3.0
"""Processor time [s] above which a run does not wait for a native library; chosen: runs start within 3 s."""
MOST_TEXT, MOST_IN_HURRY = 2_000_000, 200_000
"""Largest number of characters in C of a component, and of one that a run waits for if it was never built;
chosen: the longest of this project's has 0.9 million, those from 0.2 million on take more than `LONGEST`."""
MARK = b"branches that yawbench compared:\0"
"""Bytes before the table of branches in a library: MARK of `arithmetic.h`."""
LATER = "its native library takes longer than a run should wait; 'yawbench build' makes it"


@dataclass(frozen=True)
class Native:
    """The native libraries of an FMU.

    Attributes:
        files: path in the archive -> content.
        why_not: reason if there are none, else "".
        untried: files and lines of branches that were never compared with Python.
        new: whether they were compiled, and not in the cache.
    """

    files: dict[str, bytes] = field(default_factory=dict)
    why_not: str = ""
    untried: tuple[str, ...] = ()
    new: bool = field(default=False, compare=False)


def tools() -> list[str]:
    """Return the items other than sources that determine a native library (see `evidence`)."""
    return [f"tool:{TO_WINDOWS}"]


def toolchain() -> str:
    """Return a text that changes with translator, compilers and comparison."""
    return _compilers(tuple(compiler_command())) + _digests(*sorted(HERE.glob("*.py")))


def _comparison() -> str:
    """Return a text that changes with compilers and comparison."""
    return _compilers(tuple(compiler_command())) + _digests(
        Path(compare_with_python.__file__), Path(usual_ranges.__file__)
    )


@cache
def _compilers(compiler: tuple[str, ...]) -> str:
    parts = [platform.python_version(), *FLAGS, *LINUX, *WINDOWS]
    for command in (compiler, (TO_WINDOWS,)):
        parts += command
        if shutil.which(command[0]):
            parts.append(compiler_version(command))
    return "\0".join(parts) + _digests(*HEADERS.values())


@cache
def _digests(*files: Path) -> str:
    return "\0".join(hashlib.sha256(file.read_bytes()).hexdigest() for file in files)


def native(
    component: type[Any],
    home: Path,
    *others: Path,
    source: str,
    guid: str,
    resources: Path,
    translated: type[Any] | None = None,
    unnamed: Path | None = None,
    read: Sequence[tuple[str, str]] = (),
    hurry: bool = False,
    closed: bool = False,
    limit: int = compare_with_python.LIMIT,
) -> Native:
    """Return the native libraries of a component, or the reason why there are none.

    Args:
        component: its class, imported.
        home, others: folders and files of its functions (see `Sources`).
        source: name of its file, for a comment.
        guid: GUID of the FMU.
        resources: folder passed to an instance.
        translated: equivalent class for the translator; default: the component.
        unnamed: a file whose lines are not mentioned in the reason.
        read: files that its modules read when they are imported, with file and line.
        hurry: postpone the build if the last one took longer than `LONGEST`, or this one will.
        closed: end calls with an error in branches that were never compared with Python; for whoever can
            then go on in Python. Others are told of these branches.
        limit: largest processor time [s] of the comparison.
    """
    if sys.platform != "linux" or platform.machine() != "x86_64":
        return Native(why_not=f"native libraries are built on Linux on x86-64, this is {platform.system()}")
    try:
        compiler_version(compiler_command())
        entry = hashlib.sha256(component.fmu_name.encode()).hexdigest()
        effort = recall(EFFORTS, entry)
        if hurry and float(effort or 0.0) > LONGEST:
            return Native(why_not=LATER)
        for opened, where in read:
            raise Refused(f"{opened} is read at every import, and may change after the build", where)
        began = _processor_time()
        program = specialise(translated or component, home, *others, unnamed=unnamed)
        text = emit(program, source, guid)
        if len(text) > MOST_TEXT:
            raise Refused(f"its translation to C is too long ({len(text) / 1e6:.1f} million characters)")
        if hurry and effort is None and len(text) > MOST_IN_HURRY:
            return Native(why_not=LATER)
        thresholds = _thresholds(program)
        made = _let_through(text, component, guid, resources, limit, hurry, thresholds)
        if made.new:
            keep(EFFORTS, entry, str(_processor_time() - began).encode())
        return made if closed else _opened(made)
    except Refused as refused:
        return Native(why_not=str(refused))
    except BuildError as error:
        return Native(why_not=str(error.diagnostics[0]))
    except Exception as error:  # whatever fails here, the FMU works in Python
        return Native(why_not=f"not translated: {type(error).__name__}: {error}")


def _processor_time() -> float:
    return sum(os.times()[:4])  # of this process and its finished compilers


def _thresholds(program: Program) -> list[float]:
    """Return the numbers with which a component compares others: constants, and values of parameters."""
    constants = {x for function in program.functions.values() for x in ir.thresholds(function.body)}
    parameters = [v.start for v in program.variables if v.causality == "parameter" and v.type != "String"]
    return sorted({*constants, *map(float, parameters)})


def _let_through(
    text: str,
    component: type[Any],
    guid: str,
    resources: Path,
    limit: int,
    hurry: bool,
    thresholds: Sequence[float],
) -> Native:
    """Return the cached result for a C text, or compile and compare it."""
    key = hashlib.sha256(f"{text}{_comparison()}{limit}".encode()).hexdigest()[:32]
    kept = recall(STORE, key)
    if kept is not None:
        record = json.loads(kept)
        files = {path: b64decode(content) for path, content in record["files"].items()}
        return Native(files, record["why_not"], tuple(record["untried"]))
    try:
        most = min(limit, int(LONGEST)) if hurry else limit
        made = _made(text, component, guid, resources, most, thresholds)
    except TimeoutError as error:
        if hurry:
            return Native(why_not=LATER, new=True)
        made = Native(why_not=str(error), new=True)
    contents = {path: b64encode(content).decode() for path, content in made.files.items()}
    record = {"files": contents, "why_not": made.why_not, "untried": made.untried}
    keep(STORE, key, json.dumps(record).encode())
    return made


def _made(
    text: str,
    component: type[Any],
    guid: str,
    resources: Path,
    limit: int,
    thresholds: Sequence[float],
) -> Native:
    name = component.fmu_name
    sources = {f"{name}.c": text.encode()} | {n: file.read_bytes() for n, file in HEADERS.items()}
    compilers = {f"binaries/linux64/{NATIVE_LIBRARY}": (compiler_command(), LINUX)}
    if shutil.which(TO_WINDOWS):
        compilers[f"binaries/win64/{name}.dll"] = ([TO_WINDOWS], WINDOWS)

    def compiled(command: list[str], flags: tuple[str, ...]) -> bytes:
        return compile_library(command, sources, *flags, *FLAGS, f"{name}.c", "-lm")

    with ThreadPoolExecutor() as pool:
        files = dict(zip(compilers, pool.map(compiled, *zip(*compilers.values(), strict=True)), strict=True))
    with tempfile.TemporaryDirectory(prefix="yawbench_") as folder:
        library = Path(folder, f"{name}.so")
        library.write_bytes(files[f"binaries/linux64/{NATIVE_LIBRARY}"])
        compared = compare_with_python.differences(library, guid, component, resources, thresholds, limit)
    if compared.difference:
        return Native(why_not=f"the translation is not the same as Python: {compared.difference}", new=True)
    files = {path: _closed(data, compared.reached) for path, data in files.items()}
    return Native(files, untried=compared.untried, new=True)


def _opened(made: Native) -> Native:
    """Return libraries that compute in all branches."""
    return replace(
        made, files={path: data.replace(MARK + b"\1", MARK + b"\0", 1) for path, data in made.files.items()}
    )


def _closed(library: bytes, reached: bytes) -> bytes:
    """Return a library that ends with an error in branches that were not reached; see `arithmetic.h`."""
    if not reached:
        return library
    before, mark, after = library.partition(MARK + bytes(1 + len(reached)))
    if not mark or MARK in after:
        raise BuildError(["the compiled library has no table of its branches"])
    return before + MARK + b"\1" + reached + after
