"""The comparison of foreign FMUs with FMPy, on FMUs of FMI 2.0 and 3.0 that are built here."""

from __future__ import annotations

import sys

import numpy as np
import pytest

from tests.compare_fmpy import Comparison, compared, differences, table
from tests.fmus.models3 import make_fmu
from tests.orchestrator.test_foreign import write_fmu

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="compiles for Linux")


def test_values_here_are_those_of_an_fmpy_loop_to_the_last_bit(tmp_path, library, models, capsys):
    for name in ("Matrix", "Refusing"):
        make_fmu(tmp_path, name, models)
    make_fmu(tmp_path, "Dahlquist", models, interface="ModelExchange")
    write_fmu(tmp_path / "foreign.fmu", library, "Real", "Integer", "Boolean")
    comparisons = {each.name: each for each in compared(tmp_path, "sine", validate=False)}
    dahlquist, refusing = comparisons["Dahlquist"], comparisons["Refusing"]
    assert (dahlquist.theirs, dahlquist.ours) == ("not for co-simulation", "-")
    assert "cannot be instantiated" in refusing.ours
    assert {dahlquist.differing, refusing.differing} == {None}
    for name, fmi in (("Matrix", "3.0"), ("foreign", "2.0")):
        each = comparisons[name]
        assert (each.differing, each.fmi) == (0, fmi) and each.values > 100
    assert table(comparisons.values()) == ("2 bit-identical, 2 run in neither", True)
    assert capsys.readouterr().out.count("\n") == 1 + len(comparisons)


def test_a_difference_of_a_bit_is_found():
    own = [np.linspace(0.1, 1.0, 101), np.linspace(2.0, 3.0, 101)]
    values = np.array(own).T
    assert differences(["x", "y"], values, own) == (0, 202, "")
    differing = differences(["x", "y"], np.nextafter(values, np.inf), own)
    assert differing[:2] == (202, 202)
    assert not Comparison("VanDerPol", "3.0", "ran", "ran", *differing).agrees
    assert differences(["x", "y"], values[:-1], own)[0] == 200
