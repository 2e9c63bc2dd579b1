"""The FMUs under test, unpacked, and a C host to load them in."""

from __future__ import annotations

import os
import shutil
import subprocess
import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.fmus.bare import Fmu
from yawbench.fmus.build import HERE as FMUS
from yawbench.fmus.build import build_all, build_component

TESTS = Path(__file__).resolve().parent


@pytest.fixture(scope="session")
def archive() -> Callable[[str], Path]:
    """Return the FMU of a name, built if that is still to be done."""

    def find(name: str) -> Path:
        build_all(FMUS, components=[name])
        return FMUS / f"{name}.fmu"

    return find


@pytest.fixture(scope="session")
def unpack(tmp_path_factory: pytest.TempPathFactory) -> Callable[[Path], Path]:
    """Unpack an archive, once, and return the folder."""
    unpacked: dict[Path, Path] = {}

    def do(fmu: Path) -> Path:
        if fmu not in unpacked:
            unpacked[fmu] = tmp_path_factory.mktemp(fmu.stem)
            with zipfile.ZipFile(fmu) as content:
                content.extractall(unpacked[fmu])
        return unpacked[fmu]

    return do


@pytest.fixture(scope="session")
def wine_prefix(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of Wine's drive, one for all workers: making it takes longer than all that is done there."""
    base = tmp_path_factory.getbasetemp()
    return (base.parent if "PYTEST_XDIST_WORKER" in os.environ else base) / "wine"


@pytest.fixture(scope="session")
def load(archive: Callable[[str], Path], unpack: Callable[[Path], Path]) -> Callable[[str], Fmu]:
    """Load the FMU of a name into this process."""
    loaded: dict[str, Fmu] = {}

    def do(name: str) -> Fmu:
        if name not in loaded:
            loaded[name] = Fmu(unpack(archive(name)))
        return loaded[name]

    return do


@pytest.fixture(scope="session")
def sample(tmp_path_factory: pytest.TempPathFactory, unpack: Callable[[Path], Path]) -> Callable[[str], Fmu]:
    """Build one of the components that stand in `samples/` and load it."""
    out = tmp_path_factory.mktemp("samples")
    loaded: dict[str, Fmu] = {}

    def do(file: str) -> Fmu:
        if file not in loaded:
            loaded[file] = Fmu(unpack(build_component(TESTS / "samples" / file, out)))
        return loaded[file]

    return do


@pytest.fixture(scope="session")
def host(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The C host, compiled."""
    compiler = shutil.which("cc")
    if compiler is None:
        pytest.skip("there is no C compiler")
    program = tmp_path_factory.mktemp("host") / "host"
    flags = ["-std=c11", "-Wall", "-Wextra", "-Werror", "-g", "-O1", f"-I{FMUS}"]
    subprocess.run([compiler, *flags, str(TESTS / "host.c"), "-o", str(program), "-ldl"], check=True)
    return program
