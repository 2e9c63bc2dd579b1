"""Builds the native library of a component: translates it to C, compiles, and compares with Python.

Verified libraries are cached by the C text (which contains the GUID, and thus depends on the component's
sources), the headers, the compiler, the comparison and the Python used in the comparison. A change of the
translator that leaves the C text unchanged needs no compilation. Libraries for other platforms are compiled
from the same text and not compared.
"""

from __future__ import annotations

import hashlib
import json
import os
import platform
import sys
import tempfile
from base64 import b64decode, b64encode
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cache, partial
from pathlib import Path
from typing import Any

from yawbench.foundation.cache import keep, recall
from yawbench.foundation.errors import BuildError

from .. import usual_ranges
from ..compiler import (
    OWN,
    Platform,
    compile_library,
    compiler_command,
    compiler_version,
    libraries_for,
)
from ..source_archive import source_files
from . import compare_with_python, ir
from .emit import emit
from .postponed import LATER, LONGEST, Effort
from .specialise import Program, specialise
from .values import Refused

HERE = Path(__file__).resolve().parent
NAMES = ("calling_sequence.h", "fmi2.h", "fmi2_unit.h", "fmi3.h", "fmi3_unit.h", "fmi_unit.h",
         "oldest_glibc.h", "seal.h", "unit_parts.h")  # fmt: skip
HEADERS = {file.name: file for file in (HERE / "arithmetic.h", *(HERE.parent / n for n in NAMES))}
NATIVE_LIBRARY = "native.so"
"""Name of the native library, in the folder of the launcher, which opens it by this name."""
EXACT = ("-std=c11", "-ffp-contract=off", "-frounding-math", "-fno-builtin", "-fno-math-errno")
"""Compiler flags: functions are those of libm, as in CPython, neither replaced nor fused by the compiler.
Without `-frounding-math`, GCC 12 replaces 0.0 - x by -x if x is an absolute value or was an integer,
which is wrong for 0."""
FLAGS = (*EXACT, "-w", "-shared", "-fvisibility=hidden")
LINUX = OWN.flags
OF_COMPILER = ("compiler-missing", "compiler-failed")
"""Codes of errors that are the compiler's, and not the component's."""
STORE = "native"
"""Folder of native libraries in the cache."""
MOST_TEXT = 2_000_000
"""Largest number of characters in C of a component; chosen: the longest of this project's has 0.9 million."""
MARK = b"branches that yawbench compared:\0"
"""Bytes before the table of branches in a library: MARK of `arithmetic.h`."""


@dataclass(frozen=True)
class Native:
    """The native libraries of an FMU.

    Attributes:
        files: path in the archive -> content.
        why_not: reason if there are none, else "".
        later: whether another build may have them: with a compiler, or with more time.
        untried: files and lines of branches that were never compared with Python.
        new: whether they were compiled, and not in the cache.
    """

    files: dict[str, bytes] = field(default_factory=dict)
    why_not: str = ""
    later: bool = False
    untried: tuple[str, ...] = ()
    new: bool = field(default=False, compare=False)


def toolchain() -> str:
    """Return a text that changes with translator and comparison, but not with the installed compilers."""
    return "\0".join([*FLAGS, *LINUX]) + _digests(*HEADERS.values(), *sorted(HERE.glob("*.py")))


def _comparison() -> str:
    """Return a text that changes with compilers and comparison."""
    return _compilers(tuple(compiler_command())) + _digests(
        Path(compare_with_python.__file__), Path(usual_ranges.__file__)
    )


@cache
def _compilers(compiler: tuple[str, ...]) -> str:
    parts = [platform.python_version(), *FLAGS, *LINUX, *compiler, compiler_version(compiler)]
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
    others_too: Sequence[Platform] = (),
    with_sources: bool = False,
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
        hurry: postpone the build if it takes long (see `postponed`).
        closed: end calls with an error in branches that were never compared with Python; for whoever can
            then go on in Python. Others are told of these branches.
        limit: largest processor time [s] of the comparison.
        others_too: further platforms to compile for; not with `closed`.
        with_sources: add the sources in C.
    """
    if sys.platform != "linux" or platform.machine() != "x86_64":
        return Native(why_not=f"native libraries are built on Linux on x86-64, this is {platform.system()}")
    try:
        compiler_version(compiler_command())
        effort = Effort(component.fmu_name)
        if hurry and effort.takes_long:
            return Native(why_not=LATER, later=True)
        for opened, where in read:
            raise Refused(f"{opened} is read at every import, and may change after the build", where)
        began = _processor_time()
        program = specialise(translated or component, home, *others, unnamed=unnamed)
        text = emit(program, source, guid)
        if len(text) > MOST_TEXT:
            raise Refused(f"its translation to C is too long ({len(text) / 1e6:.1f} million characters)")
        if hurry and effort.will_take_long(text):
            return Native(why_not=LATER, later=True)
        make = partial(_made, text, component, guid, resources, _thresholds(program))
        made = _let_through(text, make, limit, hurry)
        if made.new:
            effort.note(_processor_time() - began)
        if closed or made.why_not:
            return made
        sources = _sources(component.fmu_name, text)
        further = libraries_for(
            others_too, component.fmu_name, sources, *FLAGS, f"{component.fmu_name}.c", "-lm"
        )
        if with_sources:
            further |= source_files(sources, [f"{component.fmu_name}.c"], component.fmu_name, EXACT)
        made = _opened(made)
        return replace(made, files={**made.files, **further})
    except Refused as refused:
        return Native(why_not=str(refused))
    except BuildError as error:
        return Native(why_not=str(error.diagnostics[0]), later=error.code in OF_COMPILER)
    except Exception as error:  # whatever fails here, the FMU works in Python
        return Native(why_not=f"not translated: {type(error).__name__}: {error}")


def _processor_time() -> float:
    return sum(os.times()[:4])  # of this process and its finished compilers


def _thresholds(program: Program) -> list[float]:
    """Return the numbers with which a component compares others: constants, and values of parameters."""
    constants = {x for function in program.functions.values() for x in ir.thresholds(function.body)}
    parameters = [v.start for v in program.variables if v.causality == "parameter" and v.type != "String"]
    return sorted({*constants, *map(float, parameters)})


def _let_through(text: str, make: Callable[[int], Native], limit: int, hurry: bool) -> Native:
    """Return the cached result for a C text, or what `make` makes of it within a processor time [s]."""
    key = hashlib.sha256(f"{text}{_comparison()}{limit}".encode()).hexdigest()[:32]
    kept = recall(STORE, key)
    if kept is not None:
        record = json.loads(kept)
        files = {path: b64decode(content) for path, content in record["files"].items()}
        return Native(files, record["why_not"], untried=tuple(record["untried"]))
    try:
        made = make(min(limit, int(LONGEST)) if hurry else limit)
    except TimeoutError as error:
        if hurry:
            return Native(why_not=LATER, later=True, new=True)
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
    thresholds: Sequence[float],
    limit: int,
) -> Native:
    """Compile a C text, and compare it."""
    name = component.fmu_name
    sources = _sources(name, text)
    path = f"binaries/{OWN.folder}/{NATIVE_LIBRARY}"
    made = compile_library(compiler_command(), sources, *LINUX, *FLAGS, f"{name}.c", "-lm")
    with tempfile.TemporaryDirectory(prefix="yawbench_") as folder:
        library = Path(folder, f"{name}.so")
        library.write_bytes(made)
        compared = compare_with_python.differences(library, guid, component, resources, thresholds, limit)
    if compared.difference:
        return Native(why_not=f"the translation is not the same as Python: {compared.difference}", new=True)
    return Native({path: _closed(made, compared.reached)}, untried=compared.untried, new=True)


def _sources(name: str, text: str) -> dict[str, bytes]:
    """Return the sources of a library: the C text of a component, and the headers."""
    return {f"{name}.c": text.encode()} | {n: file.read_bytes() for n, file in HEADERS.items()}


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
