"""Units as FMI 3.0: valid, the same numbers as FMI 2.0 to the bit, and from sources."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmpy.build import build_platform_binary
from fmpy.fmi3 import FMU3Slave

import yawbench as yb
from tests.refusals import mentions, refused
from yawbench.fmus.archive import open_fmu, runs_as
from yawbench.fmus.build import COMPONENTS, build_all, build_component
from yawbench.fmus.build_stamp import Edition, read_stamp
from yawbench.fmus.compiler import zig_command
from yawbench.foundation.errors import BuildError

pytestmark = pytest.mark.skipif(shutil.which("cc") is None, reason="there is no C compiler")
UNITS = ("controllers/pid", "sensors/ideal", "allocators/side_share")
"""One with tunable gains, one with optional inputs, one with an Enumeration."""


@pytest.fixture(scope="module")
def both(tmp_path_factory) -> dict[int, Path]:
    """Folders with the units in both versions, with their sources."""
    folders = {fmi: tmp_path_factory.mktemp(f"fmi{fmi}") for fmi in (2, 3)}
    names = [f"{unit.replace('s/', '_', 1)}" for unit in UNITS]
    for fmi, folder in folders.items():
        build_all(folder, components=names, edition=Edition(fmi, sources=True))
    return folders


def test_a_unit_with_an_enumeration_is_valid(both):
    """By another checker than that of the build."""
    if not (tool := Path(sys.executable).with_name("fmutool")).exists():
        pytest.skip("fmutool is not installed")
    fmu = both[3] / "allocator_side_share.fmu"
    done = subprocess.run([tool, "-input", fmu, "-check"], capture_output=True, text=True, check=False)
    assert mentions(done.stdout + done.stderr, "compliant", "FMI-3.0")
    assert mentions(done.stdout + done.stderr, "No semantic error")


def test_value_references_are_positions_and_the_time_comes_last(both):
    for fmu in both[3].glob("*.fmu"):
        variables = fmpy.read_model_description(str(fmu)).modelVariables
        assert [v.valueReference for v in variables] == list(range(1, len(variables) + 1))
        assert [v.causality == "independent" for v in variables] == [False] * (len(variables) - 1) + [True]


def test_both_versions_say_the_same_of_their_variables(both):
    for fmu in both[3].glob("*.fmu"):
        new, old = (open_fmu(both[fmi] / fmu.name).variables for fmi in (3, 2))
        assert list(new)[:-1] == list(old)
        for name, variable in old.items():
            for what in ("type", "causality", "variability", "unit", "start", "minimum", "maximum", "choices",
                         "items", "optional", "source", "depends_on"):  # fmt: skip
                assert getattr(new[name], what) == getattr(variable, what), (name, what)
    assert any(v.optional for v in open_fmu(both[3] / "sensor_ideal.fmu").variables.values())
    assert open_fmu(both[3] / "allocator_side_share.fmu").variables["side_forces"].items


def test_fmpy_gets_the_same_numbers_from_both_which_have_the_same_library(both):
    for fmu in both[3].glob("*.fmu"):
        new, old = (zipfile.ZipFile(both[fmi] / fmu.name) for fmi in (3, 2))
        assert new.read(f"binaries/x86_64-linux/{fmu.stem}.so") == old.read("binaries/linux64/native.so")
        new, old = (fmpy.simulate_fmu(str(both[fmi] / fmu.name), stop_time=0.2) for fmi in (3, 2))
        assert new.dtype.names == old.dtype.names
        assert new.tobytes() == old.tobytes()


def slave(fmu: Path, folder: Path) -> tuple[FMU3Slave, dict[str, int]]:
    """Return an instance of a unit of FMI 3.0, and its value references."""
    description = fmpy.read_model_description(str(fmu))
    unpacked = fmpy.extract(str(fmu), str(folder))
    made = FMU3Slave(
        guid=description.guid, unzipDirectory=unpacked, modelIdentifier=fmu.stem, instanceName="one"
    )
    made.instantiate()
    return made, {v.name: v.valueReference for v in description.modelVariables}


def test_a_state_goes_to_another_instance_and_the_time_can_be_read(both, tmp_path):
    first, refs = slave(both[3] / "controller_pid.fmu", tmp_path / "a")
    second, _ = slave(both[3] / "controller_pid.fmu", tmp_path / "b")
    for unit in (first, second):
        unit.enterInitializationMode(startTime=1.0)
        unit.exitInitializationMode()
    for k in range(10):
        first.setFloat64([refs["yaw_rate_ref"]], [0.01 * k])
        first.doStep(1.0 + 0.005 * k, 0.005)
    assert first.getFloat64([refs["time"]]) == [pytest.approx(1.05)]
    state = first.serializeFMUState(first.getFMUState())
    second.setFMUState(second.deserializeFMUState(state))
    for unit in (first, second):
        unit.setFloat64([refs["yaw_rate_ref"]], [0.2])
        unit.doStep(1.05, 0.005)
    assert first.getFloat64([refs["yaw_moment"]]) == second.getFloat64([refs["yaw_moment"]])


def test_gains_can_be_tuned_between_steps_and_other_parameters_cannot(both, tmp_path):
    unit, refs = slave(both[3] / "controller_pid.fmu", tmp_path / "a")
    unit.enterInitializationMode(startTime=0.0)
    unit.exitInitializationMode()
    unit.setFloat64([refs["yaw_rate_ref"], refs["velocity_x"]], [0.1, 20.0])
    moments = []
    for k, gain in enumerate((0.0, 1e4)):
        for name in ("yaw_rate_integral_gain", "yaw_rate_derivative_gain"):
            unit.setFloat64([refs[name]], [0.0])
        unit.setFloat64([refs["yaw_rate_proportional_gain"]], [gain])
        unit.doStep(0.005 * k, 0.005)
        moments += unit.getFloat64([refs["yaw_moment"]])
    assert moments == [0.0, pytest.approx(1e3)]
    with pytest.raises(fmpy.fmi1.FMICallException):
        unit.setFloat64([refs["derivative_filter"]], [0.1])


@pytest.mark.skipif(shutil.which("cmake") is None, reason="FMPy compiles with CMake")
@pytest.mark.parametrize("fmi", [2, 3])
def test_fmpy_compiles_the_sources_to_the_same_numbers(both, fmi, tmp_path):
    fmu = both[fmi] / "controller_pid.fmu"
    folder = Path(fmpy.extract(str(fmu), str(tmp_path / "unpacked")))
    shutil.rmtree(folder / "binaries")
    build_platform_binary(folder)
    made = fmpy.simulate_fmu(str(folder), stop_time=0.2)
    assert made.tobytes() == fmpy.simulate_fmu(str(fmu), stop_time=0.2).tobytes()


def test_a_unit_that_runs_in_python_is_fmi_2_only(tmp_path):
    folder = tmp_path / "controllers"
    folder.mkdir()
    text = (COMPONENTS / "controllers/off.py").read_text()
    (folder / "idea.py").write_text(
        text.replace("return (0.0,)", "return (float(str(len(open(__file__).read()))),)")
    )
    made = build_component(folder / "idea.py", tmp_path)
    assert not runs_as(made).native
    with refused(BuildError, "fmi2-only", names=("controller_idea", "FMI 2.0", "Python")):
        build_component(folder / "idea.py", tmp_path / "fmi3", edition=Edition(3))


def test_a_law_in_python_is_exported_as_fmi_3(tmp_path):
    def follow(yaw_rate_ref, yaw_rate, gain=2e4):
        return gain * (yaw_rate_ref - yaw_rate)

    made = [yb.export_fmu(follow, tmp_path / f"v{fmi}" / "follow.fmu", fmi=fmi) for fmi in (2, 3)
            if (tmp_path / f"v{fmi}").mkdir() is None]  # fmt: skip
    assert [fmpy.read_model_description(str(fmu)).fmiVersion for fmu in made] == ["2.0", "3.0"]
    old, new = (
        fmpy.simulate_fmu(str(fmu), stop_time=0.1, start_values={"yaw_rate_ref": 0.1}) for fmu in made
    )
    assert np.array_equal(old["yaw_moment"], new["yaw_moment"])
    assert old["yaw_moment"][-1] == 2e3


def test_a_scenario_of_fmi_3_gives_the_same_bytes(yawbench, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    scenario = Path(yb.__file__).parent / "scenarios/fnn_sideslip/25mps.yaml"
    short = ("--set", "stop_time=1")
    assert yawbench("export-ssp", scenario, *short, "--fmi", "3", "--out", "three.ssp")[0] == 0
    assert yawbench("export-ssp", scenario, *short, "--out", "two.ssp")[0] == 0
    for name in ("two", "three"):
        assert yawbench("run", f"{name}.ssp", "--out", name)[0] == 0
    assert (tmp_path / "two/results.csv").read_bytes() == (tmp_path / "three/results.csv").read_bytes()
    for name, version in (("two", 2), ("three", 3)):
        assert open_fmu(tmp_path / f"{name}.ssp/resources/plant_seven_dof.fmu").fmi == version


def test_another_compiler_makes_nothing_stale(both, monkeypatch, tmp_path):
    compiler = tmp_path / "another-cc"
    compiler.write_text('#!/bin/sh\nexec cc "$@"\n')
    compiler.chmod(0o755)
    monkeypatch.setenv("CC", str(compiler))
    report = build_all(both[2], components=["controller_pid"])
    assert report.current == ["controller_pid"]  # and what it had been asked for, its sources, stays
    monkeypatch.setenv("CC", "no-such-compiler")
    assert build_all(both[2], components=["controller_pid"]).current == ["controller_pid"]


def test_a_unit_without_native_library_for_want_of_a_compiler_gets_it_when_there_is_one(
    tmp_path, monkeypatch
):
    with monkeypatch.context() as without:
        without.setenv("CC", "no-such-compiler")
        report = build_all(tmp_path, components=["controller_off"])
        assert mentions(report.in_python["controller_off"], "no-such-compiler")
        assert build_all(tmp_path, components=["controller_off"]).current == ["controller_off"]
    assert build_all(tmp_path, components=["controller_off"]).built == ["controller_off"]
    assert not read_stamp(tmp_path / "controller_off.fmu").is_unfinished
    assert runs_as(tmp_path / "controller_off.fmu").native


def test_a_build_says_what_has_no_native_library_for_windows(tmp_path, monkeypatch):
    monkeypatch.setattr("yawbench.fmus.recipe.MINGW", "no compiler")
    assert build_all(tmp_path, components=["controller_off"]).not_on_windows == ["controller_off"]


@pytest.mark.exhaustive
@pytest.mark.skipif(zig_command("x") is None, reason="ziglang is not installed")
def test_zig_compiles_for_every_platform(tmp_path, monkeypatch):
    every = ("aarch64-darwin", "aarch64-linux", "x86_64-darwin", "x86_64-windows")
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    report = build_all(tmp_path, components=["controller_off"], edition=Edition(3, every))
    assert report.not_on_windows == []
    with zipfile.ZipFile(tmp_path / "controller_off.fmu") as archive:
        heads = {path.split("/")[1]: archive.read(path) for path in archive.namelist() if "binaries/" in path}
    magic = {"linux": b"\x7fELF", "windows": b"MZ", "darwin": b"\xca\xfe\xba\xbe"}
    assert heads.keys() == {*every, "x86_64-linux"}
    assert all(head.startswith(magic[name.split("-")[1]]) for name, head in heads.items())
    assert not os.listdir(tmp_path / "elsewhere")  # nothing of the compiler is left where the user is
