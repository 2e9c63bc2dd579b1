"""Every FMU runs in every program, without Python and in any Python, and in every folder."""

from __future__ import annotations

import ctypes
import json
import os
import shutil
import sys
from pathlib import Path

import pytest

from tests.fmus.bare import Fmu, Refused, Unit
from tests.fmus.programs import (
    OURS_FIRST,
    expected_outputs,
    host_command,
    host_outputs,
    python_libraries,
    pythons,
    run,
    unpacked_inputs,
)
from tests.refusals import refused
from yawbench.fmus.build import COMPONENTS, find_components

NAMES = list(find_components())
BARE = Path(__file__).with_name("bare.py")
SUPPRESSIONS = Path(__file__).with_name("python.supp")
ALL = bool(os.environ.get("YAWBENCH_TEST_ALL_FMUS"))
"""Whether what takes long is done with every FMU, not with one or two that stand for all."""


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.sampled(3)
def test_each_fmu_runs_in_a_c_host_with_nothing_preloaded(host, archive, unpack, tmp_path, name):
    folder = unpack(archive(name))
    done = run(host_command(host, folder), tmp_path)
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    assert host_outputs(done, folder) == expected_outputs(folder)
    assert list(tmp_path.iterdir()) == []


def by_itself(interpreter: str, folder: Path, empty: Path) -> dict:
    """Run an FMU in a Python that has nothing installed; return its outputs and the files it brought."""
    inputs = [f"{key}={value!r}" for key, value in unpacked_inputs(folder).items()]
    done = run([interpreter, "-I", "-S", "-B", str(BARE), str(folder), *inputs], empty)
    assert done.returncode == 0, (interpreter, done.stderr)
    return json.loads(done.stdout)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.sampled(3)
def test_each_fmu_is_complete(archive, unpack, tmp_path, name):
    folder = unpack(archive(name))
    answer = by_itself(getattr(sys, "_base_executable", sys.executable), folder, tmp_path)
    assert answer["outputs"] == expected_outputs(folder)
    project = str(COMPONENTS.parent)
    assert [file for file in answer["files"] if file.startswith(project)] == []
    assert any(file.startswith(str(folder)) for file in answer["files"])
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("minor", OURS_FIRST)
@pytest.mark.parametrize("name", NAMES if ALL else [NAMES[0], NAMES[-1]])
@pytest.mark.exhaustive
def test_fmus_run_in_any_other_python_that_has_nothing_installed(archive, unpack, tmp_path, minor, name):
    """One of them is Debian's, which is linked statically and exports Python's symbols itself."""
    folder = unpack(archive(name))
    for interpreter in pythons(minor) or pytest.skip(f"no Python 3.{minor} found"):
        answer = by_itself(interpreter, folder, tmp_path)
        assert answer["outputs"] == pytest.approx(expected_outputs(folder), rel=1e-12)


@pytest.mark.parametrize("minor", OURS_FIRST)
@pytest.mark.sampled(1)
def test_fmus_run_with_any_libpython_that_the_environment_names(host, archive, unpack, tmp_path, minor):
    there = [file for file, version in python_libraries().items() if version == minor]
    if not there:
        pytest.skip(f"no libpython of 3.{minor} found; YAWBENCH_TEST_LIBPYTHONS may list some")
    folder = unpack(archive(NAMES[-1]))
    for library in there:
        done = run(host_command(host, folder), tmp_path, YAWBENCH_LIBPYTHON=library)
        assert done.returncode == 0, (library, done.stderr)
        assert host_outputs(done, folder) == pytest.approx(expected_outputs(folder), rel=1e-12)


@pytest.mark.parametrize(
    ("file", "message"),
    [
        ("/no/such/libpython3.11.so.1.0", "YAWBENCH_LIBPYTHON names no library that can be opened: /no/such"),
        ("libm.so.6", "the Python in this process is not usable: Py_IsInitialized is missing"),
    ],
)
@pytest.mark.sampled(1)
def test_without_libpython_the_host_is_told_and_gets_no_instance(
    host, archive, unpack, tmp_path, file, message
):
    folder = unpack(archive("driver_sine"))
    done = run(host_command(host, folder), tmp_path, YAWBENCH_LIBPYTHON=file)
    assert done.returncode == 3
    assert f"[first] 3 logStatusError: {message}" in done.stderr


def test_python_is_found_beside_an_interpreter_on_path(host, archive, unpack, tmp_path):
    homes = [
        home for file in python_libraries() if list((home := Path(file).parents[1]).glob("bin/python3.1?"))
    ]
    if not homes:
        pytest.skip("no Python whose libpython lies in lib beside its bin")
    interpreter = next(homes[-1].glob("bin/python3.1?"))
    environment = tmp_path / "venv" / "bin"
    environment.mkdir(parents=True)
    (environment / interpreter.name).symlink_to(interpreter)  # as in a virtual environment
    empty = tmp_path / "empty"
    empty.mkdir()
    folder = unpack(archive("driver_sine"))
    done = run(host_command(host, folder), empty, PATH=str(environment))
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("name", NAMES if ALL else ["driver_sine"])
@pytest.mark.exhaustive
def test_valgrind_finds_nothing_on_our_side(host, archive, unpack, tmp_path, name):
    valgrind = shutil.which("valgrind")
    if valgrind is None:
        pytest.skip("valgrind is not installed")
    folder = unpack(archive(name))
    options = ["-q", "--error-exitcode=9", "--keep-debuginfo=yes", f"--suppressions={SUPPRESSIONS}"]
    options += ["--leak-check=full", "--show-leak-kinds=definite", "--errors-for-leak-kinds=definite"]
    command = [valgrind, *options, *host_command(host, folder)]
    done = run(command, tmp_path, PYTHONMALLOC="malloc")
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""


def test_only_co_simulation_and_proper_instance_names_are_accepted(load):
    fmu = load("driver_sine")
    with refused(Refused, names=("fmi2Instantiate", "status 3")):
        Unit(fmu, "")
    unit = Unit(fmu, "Größe %s")
    unit.start()
    unit.free()
    assert fmu.library.fmi2Instantiate(b"x", 1, b"", b"", None, 0, 0) is None
    assert fmu.library.fmi2Instantiate(None, 0, None, None, None, 0, 0) is None


def test_the_standard_version_is_known_without_python(load):
    library = load("driver_sine").library
    for function, answer in (("fmi2GetVersion", b"2.0"), ("fmi2GetTypesPlatform", b"default")):
        getattr(library, function).restype = ctypes.c_char_p
        assert getattr(library, function)() == answer


@pytest.mark.parametrize("place", ["Grüße/aus Tübingen", "a%20b", "100%/%25/%zz", "plus+and#hash?query;&amp"])
@pytest.mark.parametrize("locale", ["C", "C.UTF-8"])
@pytest.mark.sampled(3)
def test_an_fmu_runs_in_a_folder_of_any_name(host, archive, unpack, tmp_path, place, locale):
    folder = tmp_path / place / "unit"
    shutil.copytree(unpack(archive("driver_sine")), folder)
    done = run(host_command(host, folder), folder, LC_ALL=locale)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize(
    "spelling",
    [
        lambda folder: folder.as_uri(),
        lambda folder: folder.as_uri().replace("file:///", "file:/"),
        lambda folder: folder.as_uri().replace("file:///", "file://localhost/"),
        lambda folder: folder.as_uri().replace("file:", "FILE:"),
        lambda folder: "file://" + str(folder),  # not encoded
        lambda folder: str(folder),  # no location at all, but a path
        lambda folder: folder.as_uri() + "/",
        lambda folder: "",  # none
        lambda folder: "file:///wrong/place",  # wrong, but the library knows where it lies itself
    ],
)
def test_a_resource_location_is_understood_however_it_is_spelled(archive, unpack, tmp_path, spelling):
    folder = tmp_path / "Äpfel und Birnen"
    shutil.copytree(unpack(archive("driver_sine")), folder)
    unit = Unit(Fmu(folder), location=spelling(folder / "resources"))
    unit.start()
    unit.step(0.0)
    unit.free()


@pytest.mark.parametrize("wrong", ["a folder that PythonFMU cannot read", "incomplete resources"])
def test_resources_that_cannot_be_used_are_refused_with_a_sentence(
    archive, unpack, tmp_path, monkeypatch, wrong
):
    monkeypatch.setenv("YAWBENCH_UNITS", "python")
    folder = tmp_path / ("fmu" if wrong.startswith("incomplete") else "a%20b%20c")
    shutil.copytree(unpack(archive("driver_sine")), folder)
    if wrong.startswith("incomplete"):
        next(folder.glob("resources/driver_sine_*.py")).unlink()
    names = ("file",) if wrong.startswith("incomplete") else ("PythonFMU", "resources")
    with refused(Refused, names=("fmi2Instantiate", "status 3", *names)):
        Unit(Fmu(folder))
