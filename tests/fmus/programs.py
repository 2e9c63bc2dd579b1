"""Programs to run an FMU in, and the Pythons of this machine."""

from __future__ import annotations

import fcntl
import os
import random
import re
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterable
from functools import lru_cache
from pathlib import Path

import pytest

from tests.fmus.bare import Fmu, Unit
from tests.fmus.plausible import plausible
from yawbench.commands.new import Language, begin
from yawbench.fmus.build import HERE as FMUS
from yawbench.fmus.compiler import MINGW, TO_WINDOWS, compiler_for

WINE = shutil.which("wine64") or next(map(str, Path("/usr/lib/wine").glob("wine64")), None)
_OF_WINDOWS = pytest.mark.skipif(
    WINE is None or compiler_for(TO_WINDOWS) is None, reason="needs Wine and a cross compiler"
)


def in_windows(test: Callable[..., None]) -> Callable[..., None]:
    """Mark a test that needs Wine; of the second tier if Zig compiles: it first makes Windows' runtime."""
    return _OF_WINDOWS(test if shutil.which(MINGW) else pytest.mark.exhaustive(test))


MINORS = (10, 11, 12, 13)
"""Minor versions of Python 3 that are supported."""
OURS_FIRST = sorted(MINORS, key=lambda minor: minor != sys.version_info.minor)
"""The same, ours first; whether they are installed is asked in a test: it takes a process each."""


def begun(folder: Path, kind: str = "controller", language: Language = "c") -> Path:
    """Write what `yawbench new` begins with, by default a controller in C, and return the folder of that."""
    for path, text in begin(kind, "idea", language, in_checkout=language == "c").files.items():
        file = folder / path
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text)
    return folder / "components" / "controllers" / "idea"


def unpacked_inputs(folder: Path) -> dict[str, float]:
    fmu = Fmu(folder)
    return plausible(fmu.names("input"), random.Random(7))


def host_command(program: Path, folder: Path) -> list[str]:
    fmu = Fmu(folder)
    reals = sum(kind == "Real" for kind in fmu.type.values())
    inputs = [f"{fmu.reference[name]}={value!r}" for name, value in unpacked_inputs(folder).items()]
    location = (folder / "resources").as_uri()
    return [str(program), str(fmu.binary), location, fmu.guid, "0", str(reals), *inputs]


def run(command: list[str], empty: Path, **environment: str) -> subprocess.CompletedProcess[str]:
    """Run in an empty folder with next to nothing in the environment."""
    clean = {"PATH": "/usr/bin:/bin", "YAWBENCH_UNITS": "python", **environment}
    return subprocess.run(command, cwd=empty, env=clean, capture_output=True, text=True, check=False)


def expected_outputs(folder: Path) -> list[float]:
    """Return what the FMU gives in this very process."""
    fmu = Fmu(folder)
    reals = [name for name, kind in fmu.type.items() if kind == "Real"]
    last = dict(zip(reals, ten_steps(fmu, unpacked_inputs(folder))[-1], strict=True))
    return [last[name] for name in fmu.names("output")]


def host_outputs(done: subprocess.CompletedProcess[str], folder: Path) -> list[float]:
    fmu = Fmu(folder)
    values = [float(line) for line in done.stdout.split()]
    return [values[fmu.reference[name]] for name in fmu.names("output")]


def in_wine(
    units: Iterable[tuple[Fmu, dict[str, float]]], folder: Path, prefix: Path
) -> list[list[list[float]]]:
    """Return all Reals of FMUs with these inputs after each of ten steps, as a host on Windows reads them.

    Args:
        units: the FMUs.
        folder: for the host and the libraries.
        prefix: folder of Wine's drive, which is made if it is missing.
    """
    host = folder / "host.exe"
    source = Path(__file__).with_name("host_windows.c")
    compiler = compiler_for(TO_WINDOWS)
    assert compiler is not None
    command, flags = compiler  # those of libraries: Zig makes a runtime for every level of optimization
    subprocess.run([*command, *flags, f"-I{FMUS}", source, "-o", host], check=True)
    lines, sizes = [], []
    for fmu, inputs in units:
        library = next((fmu.folder / "binaries" / "win64").glob("*.dll"))
        shutil.copy(library, folder)
        given = [f"{fmu.reference[name]}={value!r}" for name, value in inputs.items()]
        sizes.append(sum(kind == "Real" for kind in fmu.type.values()))
        lines.append(" ".join([library.name, fmu.guid, str(sizes[-1]), *given]))
    wine = {"WINEPREFIX": str(prefix), "WINEDEBUG": "-all", "WINEDLLOVERRIDES": "mscoree,mshtml="}
    with prefix.with_name("wine.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)  # another worker makes the drive
        done = subprocess.run(
            [str(WINE), str(host)],
            cwd=folder,
            env=os.environ | wine,
            input="\n".join(lines) + "\n",
            capture_output=True,
            text=True,
            check=False,
        )
    assert done.returncode == 0, done.stderr
    rows = [[float.fromhex(word) for word in line.split()] for line in done.stdout.splitlines()]
    assert [len(row) for row in rows] == [size for size in sizes for _ in range(10)]
    return [rows[i : i + 10] for i in range(0, len(rows), 10)]


def ten_steps(fmu: Fmu, inputs: dict[str, float]) -> list[list[float]]:
    """Return all Reals of an FMU in this process after each of ten steps."""
    unit = Unit(fmu, **inputs)
    unit.start()
    rows = []
    for k in range(10):
        unit.step(0.001 * k)
        rows.append(unit.get(*(name for name, kind in fmu.type.items() if kind == "Real")))
    unit.free()
    return rows


@lru_cache
def pythons(minor: int) -> dict[str, str]:
    """Return interpreter -> libpython of every Python 3.`minor` on PATH, in /usr/bin or of pyenv."""
    found = {}
    name = f"python3.{minor}"
    asked = (
        "import sys, sysconfig as s; print(sys.executable, *map(s.get_config_var, ('LIBDIR', 'INSTSONAME')))"
    )
    pyenv = Path(os.environ.get("PYENV_ROOT", Path.home() / ".pyenv"))
    candidates = [shutil.which(name), shutil.which(name, path="/usr/bin")]
    candidates += map(str, sorted(pyenv.glob(f"versions/3.{minor}.*/bin/{name}")))
    for interpreter in dict.fromkeys(filter(None, candidates)):
        answer = subprocess.run([interpreter, "-c", asked], capture_output=True, text=True, check=False)
        if answer.returncode == 0:
            executable, folder, library = answer.stdout.split()
            found[os.path.realpath(executable)] = f"{folder}/{library}"
    return found


def python_libraries() -> dict[str, int]:
    """Return libpython -> minor version, of those Pythons and of the list in YAWBENCH_TEST_LIBPYTHONS."""
    files = [f for f in os.environ.get("YAWBENCH_TEST_LIBPYTHONS", "").split(":") if f]
    files += [library for minor in MINORS for library in pythons(minor).values()]
    versions = {file: re.search(r"libpython3\.(\d+)\.so", file) for file in files if os.path.exists(file)}
    return {file: int(found[1]) for file, found in versions.items() if found and int(found[1]) in MINORS}
