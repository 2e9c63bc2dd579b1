"""Every FMU runs in every program: without Python, in any Python, in any folder."""

from __future__ import annotations

import json
import os
import random
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from fmus.build import COMPONENTS, find_components
from tests.fmus.bare import Fmu, Refused, Unit
from tests.fmus.plausible import plausible

NAMES = list(find_components())
BARE = Path(__file__).with_name("bare.py")
SUPPRESSIONS = Path(__file__).with_name("python.supp")
MINORS = (10, 11, 12, 13)


def unpacked_inputs(folder: Path) -> dict[str, float]:
    fmu = Fmu(folder)
    return plausible(fmu.names("input"), random.Random(7))


def host_command(program: Path, folder: Path) -> list[str]:
    fmu = Fmu(folder)
    reals = sum(kind == "Real" for kind in fmu.type.values())
    inputs = [f"{fmu.reference[name]}={value!r}" for name, value in unpacked_inputs(folder).items()]
    location = (folder / "resources").as_uri()
    return [str(program), str(fmu.binary), location, fmu.guid, "0", str(reals), *inputs]


def run(command: list[str], empty: Path, **environment: str) -> subprocess.CompletedProcess[str]:
    """Run in an empty folder with next to nothing in the environment."""
    clean = {"PATH": "/usr/bin:/bin", **environment}
    return subprocess.run(command, cwd=empty, env=clean, capture_output=True, text=True, check=False)


def expected_outputs(folder: Path) -> list[float]:
    """Return what the FMU gives in this very process."""
    fmu = Fmu(folder)
    unit = Unit(fmu, **unpacked_inputs(folder))
    unit.start()
    for k in range(10):
        unit.step(k * 0.001)
    outputs = unit.outputs()
    unit.free()
    return outputs


def host_outputs(done: subprocess.CompletedProcess[str], folder: Path) -> list[float]:
    fmu = Fmu(folder)
    values = [float(line) for line in done.stdout.split()]
    return [values[fmu.reference[name]] for name in fmu.names("output")]


def python_libraries() -> dict[str, str]:
    """Return version -> libpython of every Python of 3.10 to 3.13 on this machine.

    Found by asking each `python3.<n>` on PATH, in the folders of pyenv, and what
    YAWBENCH_TEST_LIBPYTHONS lists (separated by colons).
    """
    found: dict[str, str] = {}
    candidates = [f for f in os.environ.get("YAWBENCH_TEST_LIBPYTHONS", "").split(":") if f]
    pyenv = Path(os.environ.get("PYENV_ROOT", Path.home() / ".pyenv"))
    candidates += map(str, sorted(pyenv.glob("versions/3.*/lib/libpython3.*.so.1.0")))
    for minor in MINORS:
        for interpreter in {
            shutil.which(f"python3.{minor}"),
            shutil.which(f"python3.{minor}", path="/usr/bin"),
        }:
            if interpreter:
                asked = (
                    "import sysconfig as s; print(s.get_config_var('LIBDIR'), s.get_config_var('INSTSONAME'))"
                )
                answer = subprocess.run(
                    [interpreter, "-c", asked], capture_output=True, text=True, check=False
                )
                candidates.append("/".join(answer.stdout.split()))
    for file in candidates:
        version = re.search(r"libpython(3\.\d+)\.so", file)
        if version and int(version[1][2:]) in MINORS and os.path.exists(file):
            found.setdefault(f"{version[1]} {file}", file)
    return found


def interpreters() -> list[str]:
    """Return every different Python of 3.10 to 3.13 on PATH or in /usr/bin, besides this one."""
    found = {}
    for minor in MINORS:
        for path in (None, "/usr/bin"):
            interpreter = shutil.which(f"python3.{minor}", path=path)
            if interpreter:
                asked = "import sys; print(sys.executable)"
                answer = subprocess.run(
                    [interpreter, "-c", asked], capture_output=True, text=True, check=False
                )
                if answer.returncode == 0:
                    found[os.path.realpath(answer.stdout.strip())] = None
    return list(found)


@pytest.mark.parametrize("name", NAMES)
def test_each_fmu_runs_in_a_c_host_with_nothing_preloaded(host, archive, unpack, tmp_path, name):
    folder = unpack(archive(name))
    done = run(host_command(host, folder), tmp_path)
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    assert host_outputs(done, folder) == expected_outputs(folder)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", NAMES)
def test_each_fmu_is_complete(archive, unpack, tmp_path, name):
    folder = unpack(archive(name))
    inputs = [f"{key}={value!r}" for key, value in unpacked_inputs(folder).items()]
    base = getattr(sys, "_base_executable", sys.executable)
    done = run([base, "-I", "-S", "-B", str(BARE), str(folder), *inputs], tmp_path)
    assert done.returncode == 0, done.stderr
    answer = json.loads(done.stdout)
    assert answer["outputs"] == expected_outputs(folder)
    project = str(COMPONENTS.parent)
    assert [file for file in answer["files"] if file.startswith(project)] == []
    assert any(file.startswith(str(folder)) for file in answer["files"])
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("interpreter", interpreters())
@pytest.mark.parametrize("name", [NAMES[0], NAMES[-1]])
def test_fmus_run_in_any_other_python_that_has_nothing_installed(
    archive, unpack, tmp_path, interpreter, name
):
    """One of them is Debian's, which is linked statically and exports Python's symbols itself."""
    folder = unpack(archive(name))
    inputs = [f"{key}={value!r}" for key, value in unpacked_inputs(folder).items()]
    done = run([interpreter, "-I", "-S", "-B", str(BARE), str(folder), *inputs], tmp_path)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["outputs"] == pytest.approx(expected_outputs(folder), rel=1e-12)


@pytest.mark.parametrize("library", python_libraries().values())
def test_fmus_run_with_any_libpython_that_the_environment_names(host, archive, unpack, tmp_path, library):
    folder = unpack(archive(NAMES[-1]))
    done = run(host_command(host, folder), tmp_path, YAWBENCH_LIBPYTHON=library)
    assert done.returncode == 0, done.stderr
    assert host_outputs(done, folder) == pytest.approx(expected_outputs(folder), rel=1e-12)


def test_this_machine_has_a_libpython_to_test_with():
    if not python_libraries():
        pytest.skip("no libpython of 3.10 to 3.13 found; YAWBENCH_TEST_LIBPYTHONS may list some")
    assert all(os.path.exists(file) for file in python_libraries().values())


@pytest.mark.parametrize(
    ("file", "message"),
    [
        ("/no/such/libpython3.11.so.1.0", "YAWBENCH_LIBPYTHON names no library that can be opened: /no/such"),
        ("libm.so.6", "the Python in this process is not usable: Py_IsInitialized is missing"),
    ],
)
def test_without_libpython_the_host_is_told_and_gets_no_instance(
    host, archive, unpack, tmp_path, file, message
):
    folder = unpack(archive("driver_sine"))
    done = run(host_command(host, folder), tmp_path, YAWBENCH_LIBPYTHON=file)
    assert done.returncode == 3
    assert f"[first] 3 logStatusError: {message}" in done.stderr


def test_python_is_found_beside_an_interpreter_on_path(host, archive, unpack, tmp_path):
    libraries = [Path(file) for file in python_libraries().values()]
    homes = [file.parent.parent for file in libraries if (file.parent.parent / "bin").is_dir()]
    homes = [home for home in homes if list(home.glob("bin/python3.1?"))]
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


def test_valgrind_finds_nothing_on_our_side(host, archive, unpack, tmp_path):
    valgrind = shutil.which("valgrind")
    if valgrind is None:
        pytest.skip("valgrind is not installed")
    folder = unpack(archive("driver_sine"))
    options = ["-q", "--error-exitcode=9", "--keep-debuginfo=yes", f"--suppressions={SUPPRESSIONS}"]
    options += ["--leak-check=full", "--show-leak-kinds=definite", "--errors-for-leak-kinds=definite"]
    command = [valgrind, *options, *host_command(host, folder)]
    done = run(command, tmp_path, PYTHONMALLOC="malloc")
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""


@pytest.mark.parametrize(
    "place",
    [
        "mit Leerzeichen",
        "Grüße/aus Tübingen",
        "a%20b",
        "100 %",
        "100%/%25/%zz",
        "plus+and#hash?query",
        "semi;colon&amp",
    ],
)
@pytest.mark.parametrize("locale", ["C", "C.UTF-8"])
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


def test_a_folder_that_pythonfmu_cannot_read_is_refused_with_a_sentence(archive, unpack, tmp_path):
    folder = tmp_path / "a%20b%20c"
    shutil.copytree(unpack(archive("driver_sine")), folder)
    with pytest.raises(Refused, match=r"the FMU lies in a folder that PythonFMU cannot read: .*a%20b%20c"):
        Unit(Fmu(folder))


def test_incomplete_resources_are_refused_with_a_sentence(archive, unpack, tmp_path):
    folder = tmp_path / "fmu"
    shutil.copytree(unpack(archive("driver_sine")), folder)
    next(folder.glob("resources/driver_sine_*.py")).unlink()
    with pytest.raises(Refused, match="the FMU's resources are incomplete or not at file://"):
        Unit(Fmu(folder))


def test_only_co_simulation_and_proper_instance_names_are_accepted(load):
    fmu = load("driver_sine")
    with pytest.raises(Refused, match="needs an instance name in UTF-8"):
        Unit(fmu, "")
    unit = Unit(fmu, "Größe %s")
    unit.start()
    unit.free()
    assert fmu.library.fmi2Instantiate(b"x", 1, b"", b"", None, 0, 0) is None
    assert fmu.library.fmi2Instantiate(None, 0, None, None, None, 0, 0) is None


def test_the_standard_version_is_known_without_python(load):
    import ctypes

    library = load("driver_sine").library
    for function, answer in (("fmi2GetVersion", b"2.0"), ("fmi2GetTypesPlatform", b"default")):
        getattr(library, function).restype = ctypes.c_char_p
        assert getattr(library, function)() == answer
