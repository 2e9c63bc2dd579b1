"""An FMU runs in any folder, however a host spells the way there."""

from __future__ import annotations

import shutil

import pytest

from tests.fmus.bare import Fmu, Refused, Unit
from tests.fmus.programs import host_command, run
from tests.refusals import refused


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
@pytest.mark.sampled(4)
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


def test_a_folder_that_pythonfmu_cannot_read_is_refused_with_a_sentence(
    archive, unpack, tmp_path, monkeypatch
):
    monkeypatch.setenv("YAWBENCH_UNITS", "python")
    folder = tmp_path / "a%20b%20c"
    shutil.copytree(unpack(archive("driver_sine")), folder)
    with refused(Refused, names=("fmi2Instantiate", "status 3", "PythonFMU", "resources")):
        Unit(Fmu(folder))


def test_incomplete_resources_are_refused_with_a_sentence(archive, unpack, tmp_path, monkeypatch):
    monkeypatch.setenv("YAWBENCH_UNITS", "python")
    folder = tmp_path / "fmu"
    shutil.copytree(unpack(archive("driver_sine")), folder)
    next(folder.glob("resources/driver_sine_*.py")).unlink()
    with refused(Refused, names=("fmi2Instantiate", "status 3", "file")):
        Unit(Fmu(folder))
