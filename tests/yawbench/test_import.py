"""`import yawbench`: light, public names alone, and clear where a foreign package hides one of ours."""

from __future__ import annotations

import pickle
import subprocess
import sys
from typing import get_args

import yawbench as yb
from tests.refusals import refused
from yawbench.orchestrator.fault_kinds import KINDS, FaultName
from yawbench.proving_ground.standard_tests import TESTS, TestName

HEAVY = (
    "numpy",
    "pandas",
    "pyarrow",
    "scipy",
    "matplotlib",
    "pydantic",
    "fmpy",
    "yawbench.orchestrator",
    "yawbench.components",
)


def test_the_import_loads_nothing_else_and_packages_of_others_hide_nothing(tmp_path):
    for name in ("components", "fmus", "orchestrator", "scenarios", "vocabulary"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "__init__.py").write_text("raise ImportError('of another project')")
    program = f"""
import sys, yawbench
print([name for name in {HEAVY} if name in sys.modules])
from yawbench.cli import main
yawbench.load, main(["list", "metrics", "--json"])
"""
    done = subprocess.run([sys.executable, "-c", program], cwd=tmp_path, capture_output=True, text=True)
    assert (done.returncode, done.stdout.splitlines()[0]) == (0, "[]")


def test_dir_shows_the_public_names_alone():
    assert dir(yb) == sorted(yb.__all__)
    with refused(AttributeError, names=("'yawbench'", "'laod'")):
        _ = yb.laod


def test_public_classes_can_be_pickled():
    classes = [value for name in yb.__all__ if isinstance(value := getattr(yb, name), type)]
    assert len(classes) >= 14
    assert all(pickle.loads(pickle.dumps(one)) is one for one in classes)


def test_literals_name_all_kinds_of_faults_and_all_standard_tests():
    assert get_args(FaultName) == (*KINDS,)
    assert get_args(TestName) == (*TESTS,)
