"""Make units written in C into FMUs: a folder with modelDescription.xml and C files becomes one FMU.

    build_all_c(out)                every such folder below components/
    build_c(folder, out)            one folder from anywhere

The model description is the one place where variables are declared; `variables.h` is made from it
at every build, the GUID follows from it and the sources. As with components in Python, the same
sources and the same compiler give the same bytes, what is current is not built again, and an FMU
whose sources are gone or can no longer be built is removed.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import shlex
import shutil
import subprocess
import sys
import tempfile
import uuid
from collections.abc import Iterable
from pathlib import Path
from xml.etree import ElementTree

from components.fmi.roles import ROLES
from orchestrator.errors import BuildError
from orchestrator.fmu.archive import platform

from ..archive import read_mark, to_bytes
from ..build import COMPONENTS, Progress, Report, put
from .declaration import DESCRIPTION, header, read_declaration

HERE = Path(__file__).resolve().parent
FLAGS = ("-std=c11", "-O2", "-Wall", "-Wextra", "-Wno-unused-parameter", "-fPIC", "-shared")
EXACT = ("-fvisibility=hidden", "-ffp-contract=off")  # no fused multiply-add: the same numbers everywhere
LINUX = ("-Wl,--build-id=none", "-Wl,-z,defs", "-s")


def find_c_components(root: Path = COMPONENTS) -> dict[str, Path]:
    """Return name of FMU -> folder of every unit in C below `root`."""
    found = {}
    for role in ROLES:
        for file in sorted((root / role).glob(f"*/{DESCRIPTION}")):
            found[f"{ROLES[role].name}_{file.parent.name}"] = file.parent
    return found


def build_all_c(
    out: Path,
    *,
    components: Iterable[str] | None = None,
    force: bool = False,
    progress: Progress | None = None,
    root: Path = COMPONENTS,
) -> Report:
    """Build the units in C that have changed into `out`, all or those named (names of FMUs).

    Raises:
        BuildError: with one sentence or more per unit that cannot be built; all others are.
    """
    known = find_c_components(root)
    report = Report()
    problems: list[str] = []
    tell = progress or (lambda name, what: None)
    for name in known if components is None else dict.fromkeys(components):
        target = out / f"{name}.fmu"
        try:
            made = _bring_up_to_date(name, known[name], target, kind="c-component", force=force)
        except BuildError as error:
            problems += error.problems
            if (read_mark(target) or "").startswith("c-component "):
                with contextlib.suppress(OSError):  # a folder that cannot be written is the problem told
                    target.unlink()
            tell(name, "failed")
        else:
            (report.built if made else report.current).append(name)
            tell(name, "built" if made else "current")
    if components is None and out.is_dir():
        for fmu in sorted(out.glob("*.fmu")):
            if fmu.stem not in known and (read_mark(fmu) or "").startswith("c-component "):
                fmu.unlink()
                report.removed.append(fmu.stem)
                tell(fmu.stem, "removed")
    if problems:
        raise BuildError(problems)
    return report


def build_c(folder: Path, out: Path, *, force: bool = False) -> Path:
    """Build the unit in C whose folder is given into `out` and return the FMU.

    The folder that holds `folder` says the role, as in `controllers/idea/idea.c`.

    Raises:
        BuildError: no model description, one that cannot be used, or the compiler's complaint.
    """
    folder = folder.resolve()
    role = ROLES.get(folder.parent.name)
    if not (folder / DESCRIPTION).is_file():
        raise BuildError(f"{folder}: no unit in C: it holds no {DESCRIPTION}")
    if role is None:
        raise BuildError(f"{folder}: which role? Put it into a folder called one of: {', '.join(ROLES)}")
    name = f"{role.name}_{folder.name}"
    target = out / f"{name}.fmu"
    _bring_up_to_date(name, folder, target, kind="c-file", force=force)
    return target


def _bring_up_to_date(name: str, folder: Path, target: Path, *, kind: str, force: bool) -> bool:
    """Build an FMU unless it is current; return whether it was built."""
    try:
        if folder.with_suffix(".py").exists():
            raise BuildError(f"there are both {folder.name}.py and {folder.name}/ in {folder.parent}")
        compiler = _compiler()
        sources = {file.name: file.read_bytes() for file in sorted(folder.glob("*.[ch]"))}
        if not any(source.endswith(".c") for source in sources):
            raise BuildError(f"{folder} holds no C file")
        description = (folder / DESCRIPTION).read_bytes()
        mark = f"{kind} {_key(name, compiler, sources | {DESCRIPTION: description})}"
        if not force and read_mark(target) == mark:
            return False
        root, variables = read_declaration(description, name, ROLES[folder.parent.name])
        root.set("guid", _guid(root, sources))
        binary = _compile(compiler, folder, sources, header(variables, root.get("guid", "")))
        system, suffix = platform()
        files = {
            DESCRIPTION: ElementTree.tostring(root, encoding="UTF-8", xml_declaration=True) + b"\n",
            f"binaries/{system}/{name}{suffix}": binary,
        }
        put(target, to_bytes(files, mark))
    except BuildError as error:
        raise BuildError([f"{name}: {problem}" for problem in error.problems]) from None
    except OSError as error:
        raise BuildError(f"{name}: cannot be read or written: {error}") from None
    return True


def _compiler() -> list[str]:
    command = shlex.split(os.environ.get("CC", "")) or ["cc"]
    if shutil.which(command[0]) is None:
        raise BuildError(f"there is no C compiler ({command[0]}); CC can name one")
    return command


def _key(name: str, compiler: list[str], sources: dict[str, bytes]) -> str:
    """Return a hash of all that decides what the FMU's bytes are."""
    version = subprocess.run([*compiler, "--version"], capture_output=True, text=True, check=False).stdout
    content = hashlib.sha256("\0".join([name, *compiler, version, *FLAGS, *EXACT]).encode())
    shared = [
        HERE / "build.py",
        HERE / "declaration.py",
        HERE / "unit.h",
        HERE.parent / "fmi2.h",
        HERE.parent / "archive.py",
    ]
    for path, data in [*((file.name, file.read_bytes()) for file in shared), *sources.items()]:
        content.update(f"{path}\0{len(data)}\0".encode() + data)
    return content.hexdigest()[:32]


def _guid(root: ElementTree.Element, sources: dict[str, bytes]) -> str:
    root.set("guid", "")
    content = hashlib.sha256(ElementTree.tostring(root))
    for name, data in sources.items():
        content.update(name.encode() + b"\0" + hashlib.sha256(data).digest())
    return f"{{{uuid.UUID(bytes=content.digest()[:16])}}}"


def _compile(compiler: list[str], folder: Path, sources: dict[str, bytes], header: str) -> bytes:
    """Return the shared library; what the compiler warns of goes to stderr."""
    flags = [*FLAGS, *EXACT, *(LINUX if sys.platform == "linux" else ())]
    with tempfile.TemporaryDirectory(prefix="yawbench_") as temporary:
        for name, data in sources.items():  # relative names: bytes must not depend on where they stand
            Path(temporary, name).write_bytes(data)
        Path(temporary, "variables.h").write_text(header, encoding="utf-8")
        files = [name for name in sources if name.endswith(".c")]
        includes = ["-I.", f"-I{HERE}", f"-I{HERE.parent}"]
        command = [*compiler, *flags, *includes, *files, "-o", "unit.so", "-lm"]
        done = subprocess.run(command, cwd=temporary, capture_output=True, text=True, check=False)
        if done.returncode != 0:
            lines = [line for line in done.stderr.splitlines() if "error" in line or "undefined" in line]
            raise BuildError(lines or [f"the C compiler failed with exit status {done.returncode}"])
        if done.stderr:
            print(done.stderr.rstrip(), file=sys.stderr)
        return Path(temporary, "unit.so").read_bytes()
