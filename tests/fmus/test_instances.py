"""Many instances, and several builds of one component, live side by side in one process."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.fmus.bare import Fmu, Unit
from tests.fmus.programs import python_libraries
from tests.fmus.test_rebuild_stale import without_native_libraries
from yawbench.fmus.build import COMPONENTS, build_component

TESTS = Path(__file__).resolve().parent


@pytest.fixture(autouse=True)
def in_python(monkeypatch):
    """Native units share no interpreter."""
    monkeypatch.setenv("YAWBENCH_UNITS", "python")


def run_apart(script: str, *arguments: str) -> dict:
    """Run a script in a Python of its own with the tests on its path; return what it prints as JSON."""
    command = [sys.executable, "-c", script, *arguments]
    done = subprocess.run(command, cwd=TESTS.parent.parent, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def test_two_builds_of_a_component_keep_their_own_defaults_and_results(tmp_path, unpack, monkeypatch):
    without_native_libraries(monkeypatch)
    source = COMPONENTS / "drivers" / "sine.py"
    small = build_component(source, tmp_path, name="driver_small", defaults={"amplitude": 0.01})
    large = build_component(source, tmp_path, name="driver_large", defaults={"amplitude": 0.04, "periods": 2})
    fmus = [Fmu(unpack(fmu)) for fmu in (small, large)]
    angles = []
    for fmu in fmus:
        unit = Unit(fmu)
        unit.start(2.2)
        angles += unit.get("steer_angle")
    assert angles == pytest.approx([0.00998027, 4 * 0.00998027], rel=1e-5)
    assert [fmu.start["amplitude"] for fmu in fmus] == ["0.01", "0.04"]
    assert list(fmus[0].reference) == list(fmus[1].reference)
    assert fmus[0].guid != fmus[1].guid


MANY = """
import gc, json, sys
from tests.fmus.bare import Fmu, Unit

def resident():
    return int(open("/proc/self/statm").read().split()[1])

fmu = Fmu(sys.argv[1])
module = open(fmu.folder / "resources" / "slavemodule.txt").read().strip()
without_ctypes = len(sys.argv) > 2

def live(n):
    units = []
    for i in range(n):
        unit = Unit(fmu, f"unit {i}")
        unit.start()
        unit.step(0.0)
        if i % 2:
            unit.do("fmi2Reset")
        units.append(unit)
    for unit in units:
        unit.free()

if without_ctypes:
    sys.modules["ctypes"] = None
path = list(sys.path)
live(40)
gc.collect()
entry = vars(sys.modules[module])
references, pages, objects = sys.getrefcount(entry), resident(), len(gc.get_objects())
for _ in range(10):
    live(40)
gc.collect()
print(json.dumps({
    "path": sys.path == path,
    "references": sys.getrefcount(entry) - references,
    "pages": resident() - pages,
    "objects": len(gc.get_objects()) - objects,
}))
"""


@pytest.mark.parametrize("without", [(), ("ctypes",)])
def test_four_hundred_instances_leave_nothing_behind_also_in_a_python_without_ctypes(load, without):
    found = run_apart(MANY, str(load("driver_sine").folder), *without)
    assert found["path"]
    assert found["references"] == 0
    if not without:
        # PythonFMU's library itself forgets a short list and some strings, 1.2 KiB, per instantiation.
        assert found["objects"] < 600 + 40
        assert found["pages"] < 400  # of 4 KiB, for 600 instantiations


def test_fmus_bring_their_own_copy_of_pythonfmu(load):
    script = """
import json, sys, types
sys.modules["pythonfmu"] = types.ModuleType("pythonfmu")  # another FMU's, of another version
sys.modules["pythonfmu.fmi2slave"] = types.ModuleType("pythonfmu.fmi2slave")
from tests.fmus.bare import Fmu, Unit
unit = Unit(Fmu(sys.argv[1]), amplitude=0.5)
unit.start(2.25)
print(json.dumps(unit.outputs()))
"""
    assert run_apart(script, str(load("driver_sine").folder))[0] == pytest.approx(0.5)


def compiled(source, folder):
    program = folder / "host"
    flags = ["-std=c11", "-Wall", "-Wextra", "-Werror", f"-I{COMPONENTS.parent / 'fmus'}"]
    subprocess.run(["cc", *flags, TESTS / source, "-o", program, "-ldl"], check=True)
    return program


def test_different_fmus_share_one_interpreter_that_no_unloading_ends(load, unpack, host, tmp_path):
    """In a C host: the FMU that has started Python is unloaded while the other goes on."""
    first, second = load("driver_sine"), load("controller_off")
    program = compiled("host_two_fmus.c", tmp_path)
    arguments = []
    for fmu in (first, second):
        arguments += [str(fmu.binary), (fmu.folder / "resources").as_uri(), fmu.guid]
    environment = {"PATH": os.environ["PATH"], "YAWBENCH_UNITS": "python"}
    done = subprocess.run([program, *arguments], env=environment, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")


def test_python_loaded_with_local_symbols_is_found_and_used(load, tmp_path, host):
    """As in a program that embeds Python in a plug-in."""
    if not (libraries := python_libraries()):
        pytest.skip("no libpython found")
    fmu = load("driver_sine")
    program = compiled("host_local_python.c", tmp_path)
    for library in libraries:
        command = [program, library, str(fmu.binary), (fmu.folder / "resources").as_uri(), fmu.guid]
        # No other Python may be opened: this variable would lead to an error.
        environment = {"PATH": "/nowhere", "YAWBENCH_LIBPYTHON": "/nowhere", "YAWBENCH_UNITS": "python"}
        if "/usr/lib" not in library:
            environment["PYTHONHOME"] = str(Path(library).parent.parent)
        done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
        assert (done.returncode, done.stderr) == (0, ""), library
