"""Programs to run an FMU in, and the Pythons of this machine."""

from __future__ import annotations

import os
import random
import re
import shutil
import subprocess
import sys
from functools import lru_cache
from pathlib import Path

from tests.fmus.bare import Fmu, Unit
from tests.fmus.plausible import plausible

MINORS = (10, 11, 12, 13)
OURS_FIRST = sorted(MINORS, key=lambda minor: minor != sys.version_info.minor)
"""Which Pythons there are is asked as late as in a test: it takes a process each."""
"""Of the versions of Python 3 that are supported."""


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
    unit = Unit(fmu, **unpacked_inputs(folder))
    unit.start()
    for k in range(10):
        unit.step(k * 0.001)
    outputs = unit.outputs()
    unit.free()
    return outputs


def host_outputs(done: subprocess.CompletedProcess[str], folder: Path) -> list[float]:
    fmu = Fmu(folder)
    values = [float(line) for line in done.stdout.split()]
    return [values[fmu.reference[name]] for name in fmu.names("output")]


@lru_cache
def python_libraries() -> dict[str, str]:
    """Return version -> libpython of every Python of 3.10 to 3.13 on this machine.

    Found by asking each `python3.<n>` on PATH, in the folders of pyenv, and what
    YAWBENCH_TEST_LIBPYTHONS lists (separated by colons).
    """
    found: dict[str, str] = {}
    candidates = [f for f in os.environ.get("YAWBENCH_TEST_LIBPYTHONS", "").split(":") if f]
    pyenv = Path(os.environ.get("PYENV_ROOT", Path.home() / ".pyenv"))
    candidates += map(str, sorted(pyenv.glob("versions/3.*/lib/libpython3.*.so.1.0")))
    for minor in MINORS:
        for interpreter in {
            shutil.which(f"python3.{minor}"),
            shutil.which(f"python3.{minor}", path="/usr/bin"),
        }:
            if interpreter:
                asked = (
                    "import sysconfig as s; print(s.get_config_var('LIBDIR'), s.get_config_var('INSTSONAME'))"
                )
                answer = subprocess.run(
                    [interpreter, "-c", asked], capture_output=True, text=True, check=False
                )
                candidates.append("/".join(answer.stdout.split()))
    for file in candidates:
        version = re.search(r"libpython(3\.\d+)\.so", file)
        if version and int(version[1][2:]) in MINORS and os.path.exists(file):
            found.setdefault(f"{version[1]} {file}", file)
    return found


def interpreters(minor: int) -> list[str]:
    """Return every different Python 3.`minor` on PATH, in /usr/bin or in the folders of pyenv."""
    found = {}
    pyenv = Path(os.environ.get("PYENV_ROOT", Path.home() / ".pyenv"))
    name = f"python3.{minor}"
    candidates = [shutil.which(name), shutil.which(name, path="/usr/bin")]
    candidates += map(str, sorted(pyenv.glob(f"versions/3.{minor}.*/bin/{name}")))
    for interpreter in filter(None, candidates):
        asked = [interpreter, "-c", "import sys; print(sys.executable)"]
        answer = subprocess.run(asked, capture_output=True, text=True, check=False)
        if answer.returncode == 0:
            found[os.path.realpath(answer.stdout.strip())] = None
    return list(found)
