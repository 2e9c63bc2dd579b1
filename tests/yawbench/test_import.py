"""`import yawbench`: light, public names alone, and clear where a foreign package hides one of ours."""

from __future__ import annotations

import pickle
import subprocess
import sys
from pathlib import Path

import pytest

import yawbench as yb
from tests.refusals import mentions, refused

HEAVY = (
    "numpy",
    "pandas",
    "pyarrow",
    "scipy",
    "matplotlib",
    "pydantic",
    "fmpy",
    "orchestrator",
    "components",
)


def python(*arguments: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, *arguments], cwd=cwd, capture_output=True, text=True)


@pytest.mark.parametrize("name", ["components", "fmus", "orchestrator", "scenarios", "vocabulary"])
@pytest.mark.parametrize("form", ["package", "module"])
def test_a_foreign_package_in_the_way_is_named(name, form, tmp_path):
    hiding = tmp_path / name if form == "package" else tmp_path / f"{name}.py"
    if form == "package":
        hiding.mkdir()
        (hiding / "__init__.py").touch()
    else:
        hiding.touch()
    for command in (["-c", "import yawbench"], ["-m", "yawbench"]):
        ended = python(*command, cwd=tmp_path)
        assert ended.returncode
        assert mentions(ended.stderr, "yawbench", "package", f"'{name}'", hiding.name)


def test_folders_of_these_names_that_are_no_packages_hide_nothing(tmp_path):
    for name in ("components", "fmus", "scenarios"):
        (tmp_path / name).mkdir()
    assert python("-c", "import yawbench; yawbench.load", cwd=tmp_path).returncode == 0


def test_the_import_alone_loads_nothing_else(tmp_path):
    program = f"import sys, yawbench; print([name for name in {HEAVY} if name in sys.modules])"
    assert python("-c", program, cwd=tmp_path).stdout.strip() == "[]"


def test_dir_shows_the_public_names_alone():
    assert dir(yb) == sorted(yb.__all__)
    with refused(AttributeError, names=("'yawbench'", "'laod'")):
        _ = yb.laod


def test_public_classes_say_where_they_are_imported_from():
    classes = [value for name in yb.__all__ if isinstance(value := getattr(yb, name), type)]
    assert len(classes) >= 14
    assert {one.__module__ for one in classes} == {"yawbench"}
    assert all(pickle.loads(pickle.dumps(one)) is one for one in classes)
