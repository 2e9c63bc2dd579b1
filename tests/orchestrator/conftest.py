"""Fixtures of the orchestrator's tests."""

from __future__ import annotations

import os
import shlex
import subprocess
from pathlib import Path

import pytest

from yawbench.fmus.build import build_component
from yawbench.fmus.c import c_recipe

HERE = Path(__file__).parent


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty cache of unpacked FMUs, in place of the user's."""
    folder = tmp_path / "cache"
    monkeypatch.setenv("YAWBENCH_CACHE", str(folder))
    return folder


@pytest.fixture(scope="session")
def unpacked(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A cache for many tests: equal FMUs are unpacked and described once."""
    return tmp_path_factory.mktemp("unpacked")


@pytest.fixture
def common_cache(unpacked: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The cache for many tests, in place of the user's."""
    monkeypatch.setenv("YAWBENCH_CACHE", str(unpacked))


def build_here(source: Path, folder: Path) -> Path:
    """Build a component in C without its library for Windows, which takes as long as that for Linux."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(c_recipe, "TO_WINDOWS", "no-compiler-for-windows")
        return build_component(source, folder)


@pytest.fixture(scope="session")
def library(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A compiled FMU library from elsewhere: it doubles its inputs, and answers a step as it is told."""
    return compiled(HERE / "foreign.c", tmp_path_factory.mktemp("foreign") / "foreign.so")


@pytest.fixture(scope="session")
def bare_library(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same without the functions that many FMUs leave out, those for texts among them."""
    return compiled(HERE / "foreign.c", tmp_path_factory.mktemp("bare") / "foreign.so", "-DBARE")


def compiled(source: Path, target: Path, *options: str) -> Path:
    """Return the library that is made of a file of C."""
    compiler = shlex.split(os.environ.get("CC", "cc"))
    include = HERE.parents[1] / "fmus"
    flags = ["-shared", "-fPIC", "-w", f"-I{include}", *options]
    subprocess.run([*compiler, *flags, source, "-o", target, "-lm"], check=True)
    return target
