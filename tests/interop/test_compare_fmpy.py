"""The comparison of foreign FMUs with FMPy, on FMUs of FMI 2.0 and 3.0 that are built here."""

from __future__ import annotations

import shutil
import sys

import numpy as np
import pytest

from tests.compare_fmpy import Comparison, compared, differences, table
from tests.fmus.models3 import make_fmu
from tests.orchestrator.test_foreign import write_fmu

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="compiles for Linux")
UNITS = ["plant_two_dof"]


@pytest.mark.parametrize(
    ("names", "run_in_neither"),
    [
        (("VanDerPol", "foreign"), {}),
        pytest.param(
            ("Every", "Matrix", *UNITS), {"Refusing": "cannot be instantiated"}, marks=pytest.mark.exhaustive
        ),
    ],
)
def test_values_here_are_those_of_an_fmpy_loop_to_the_last_bit(
    names, run_in_neither, tmp_path, library, models, fmus, capsys
):
    folder = tmp_path / "foreign"
    folder.mkdir()
    for name in {*names, *run_in_neither} - {"foreign", *UNITS}:
        make_fmu(folder, name, models)
    make_fmu(folder, "Dahlquist", models, interface="ModelExchange")
    if "foreign" in names:
        write_fmu(folder / "foreign.fmu", library, "Real", "Integer", "Boolean")
    for unit in {*names} & {*UNITS}:
        shutil.copy(fmus / f"{unit}.fmu", folder)
    comparisons = {each.name: each for each in compared(folder, "sine", validate=False)}
    reasons = {name: (each.theirs, each.ours) for name, each in comparisons.items() if each.differing is None}
    assert reasons.pop("Dahlquist") == ("not for co-simulation", "-")
    assert reasons.keys() == run_in_neither.keys()
    assert all(word in reasons[name][1] for name, word in run_in_neither.items())
    ran = [each for each in comparisons.values() if each.differing is not None]
    assert {each.name for each in ran} == {*names}
    assert all(each.differing == 0 and each.values > 100 for each in ran)
    assert {each.fmi for each in ran} == {"2.0", "3.0"}
    summary, agreed = table(comparisons.values())
    assert (summary, agreed) == (f"{len(ran)} bit-identical, {1 + len(run_in_neither)} run in neither", True)
    assert capsys.readouterr().out.count("\n") == 1 + len(comparisons)


def test_a_difference_of_a_bit_is_found():
    own = [np.linspace(0.1, 1.0, 101), np.linspace(2.0, 3.0, 101)]
    values = np.array(own).T
    assert differences(["x", "y"], values, own) == (0, 202, "")
    differing = differences(["x", "y"], np.nextafter(values, np.inf), own)
    assert differing[:2] == (202, 202)
    assert not Comparison("VanDerPol", "3.0", "ran", "ran", *differing).agrees
    assert differences(["x", "y"], values[:-1], own)[0] == 200
