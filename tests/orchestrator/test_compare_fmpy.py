"""The comparison of foreign FMUs with FMPy, on FMUs of FMI 2.0 and 3.0 that are built here."""

from __future__ import annotations

import shutil
import sys

import numpy as np
import pytest

from tests.compare_fmpy import compare, compared, table

from . import models3
from .conftest import compiled
from .models3 import make_fmu
from .test_foreign import write_fmu

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="compiles for Linux")
UNITS = ["plant_two_dof"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory, library, fmus):
    """FMUs in C of both versions, FMUs of this project, and some that do not run."""
    folder = tmp_path_factory.mktemp("foreign")
    (folder / "stubs.h").write_text(models3.stubs(), encoding="utf-8")
    models = compiled(models3.HERE / "models3.c", folder / "models3.so", f"-I{folder}")
    for model in ("VanDerPol", "Every", "Matrix", "Refusing"):
        make_fmu(folder, model, models)
    make_fmu(folder, "Dahlquist", models, interface="ModelExchange")
    write_fmu(folder / "foreign.fmu", library, "Real", "Integer", "Boolean")
    for unit in UNITS:
        shutil.copy(fmus / f"{unit}.fmu", folder)
    return folder


def test_values_here_are_those_of_an_fmpy_loop_to_the_last_bit(folder, capsys):
    comparisons = {each.name: each for each in compared(folder, "sine", validate=False)}
    reasons = {name: (each.theirs, each.ours) for name, each in comparisons.items() if each.differing is None}
    assert reasons.pop("Dahlquist") == ("not for co-simulation", "-")
    assert "cannot be instantiated" in reasons.pop("Refusing")[1]
    assert not reasons
    ran = [each for each in comparisons.values() if each.differing is not None]
    assert {each.name for each in ran} >= {"VanDerPol", "Every", "Matrix", "foreign", *UNITS}
    assert all(each.differing == 0 and each.values > 100 for each in ran)
    assert {each.fmi for each in ran} == {"2.0", "3.0"}
    summary, agreed = table(comparisons.values())
    assert (summary, agreed) == (f"{len(ran)} bit-identical, 2 run in neither", True)
    assert capsys.readouterr().out.count("\n") == 1 + len(comparisons)


def test_a_difference_of_a_bit_is_found(folder, monkeypatch):
    exact = np.load
    monkeypatch.setattr(np, "load", lambda path: np.nextafter(exact(path), np.inf))
    comparison = compare(folder / "VanDerPol.fmu")
    assert comparison.differing == comparison.values == 202
    assert not comparison.agrees
