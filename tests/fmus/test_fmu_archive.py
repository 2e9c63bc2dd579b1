"""Archives: unpacked once, whole, in a plain place; and the sentence for each that cannot be used."""

from __future__ import annotations

import errno
import json
import os
import subprocess
import sys
import time
import zipfile
from pathlib import Path
from typing import Any

import pytest

from tests.fmus.fake_fmus import Var, make_fmu, model_description, out
from tests.refusals import mentions, refused
from yawbench.fmus import archive as fmu_archive
from yawbench.fmus import zip_members
from yawbench.fmus.archive import open_fmu
from yawbench.fmus.description import platform
from yawbench.foundation.cache import KEEP_DAYS, delete_unused
from yawbench.foundation.errors import ModelDescriptionError

HERE, SUFFIX = platform()


@pytest.fixture
def fmu(tmp_path: Path, cache: Path) -> Path:
    """An FMU with a variable of every kind, and a file in resources/."""
    return make_fmu(
        tmp_path / "tyre_a.fmu",
        inputs=[Var("friction_*", minimum=0.0, maximum=2.0), Var("gear", type="Integer", start=1)],
        outputs=[out("force_*", "friction_*", unit="N"), out("sum", unit="N", follows=None)],
        parameters=[
            Var("stiffness", "N/rad", start=5e4, minimum=1.0, description="Cornering stiffness"),
            Var("mode", type="String", start="plain", choices=("plain", "similar")),
            Var("lifted", type="Boolean", start=True),
            Var("set", type="Enumeration", start=2, items=("dry", "wet")),
        ],
        files={"resources/table.txt": b"1 2 3"},
    )


def problem(path: Path) -> str:
    with pytest.raises(ModelDescriptionError) as caught:
        open_fmu(path)
    assert caught.value.exit_status == 2
    assert len(caught.value.diagnostics) == 1
    assert "\n" not in str(caught.value)
    return str(caught.value)


def test_an_fmu_is_described_completely(fmu: Path) -> None:
    opened = open_fmu(fmu)
    assert (opened.name, opened.path, opened.guid) == ("tyre_a", fmu, "tyre_a")
    assert (opened.model_identifier, opened.generation_tool) == ("tyre_a", "fake")
    assert not opened.once_per_process
    assert [v.name for v in opened.of("input")][:2] == ["friction_fl", "friction_fr"]
    friction, force = opened.variables["friction_fl"], opened.variables["force_fl"]
    assert (friction.type, friction.unit, friction.minimum, friction.maximum) == ("Real", "1", 0.0, 2.0)
    assert (force.causality, force.unit, force.depends_on) == ("output", "N", ("friction_fl",))
    assert force.follows("friction_fl")
    assert not force.follows("friction_fr")
    assert opened.variables["sum"].depends_on is None
    assert opened.variables["sum"].follows("friction_rr")
    stiffness = opened.variables["stiffness"]
    assert (stiffness.start, stiffness.minimum, stiffness.description) == (5e4, 1.0, "Cornering stiffness")
    assert opened.variables["mode"].choices == ("plain", "similar")
    assert (opened.variables["lifted"].start, opened.variables["gear"].start) == (True, 1)
    assert (opened.variables["set"].start, opened.variables["set"].items) == (2, {"dry": 1, "wet": 2})
    assert opened.variables["gear"].discrete


def test_equal_fmus_are_unpacked_and_described_once_each_under_its_own_name(
    fmu: Path, cache: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    first = open_fmu(fmu)
    assert first.directory.is_relative_to(cache)
    assert (first.directory / "resources/table.txt").read_bytes() == b"1 2 3"
    assert [entry.name for entry in cache.iterdir()] == [f"{first.sha256[:32]}-{fmu_archive.FORMAT}"]
    monkeypatch.setattr(fmu_archive.fmu_description, "describe", None)
    assert open_fmu(fmu) == first
    copy = tmp_path / "other.fmu"
    copy.write_bytes(fmu.read_bytes())
    second = open_fmu(copy)
    assert (second.name, second.path, second.directory) == ("other", copy, first.directory)
    assert len(list(cache.iterdir())) == 1


def edited_in_place(file: Path) -> None:
    """Change nothing but the content."""
    times = file.stat()
    file.write_bytes(b"1 9 3")
    os.utime(file, ns=(times.st_atime_ns, times.st_mtime_ns))


HARM = {
    "delete": Path.unlink,
    "cut": lambda file: file.write_bytes(b"1"),
    "edit in place": edited_in_place,
    "folder": lambda file: (file.unlink(), file.mkdir()),
    "description": lambda file: (file.parents[2] / "description.json").write_text('{"fmu": {'),
}


@pytest.mark.parametrize("harm", HARM)
def test_a_damaged_cache_entry_is_put_right(fmu: Path, harm: str) -> None:
    opened = open_fmu(fmu)
    file = opened.directory / "resources/table.txt"
    HARM[harm](file)
    assert open_fmu(fmu) == opened
    assert file.read_bytes() == b"1 2 3"
    assert json.loads((opened.directory.parent / "description.json").read_text())["files"]


def test_an_entry_made_meanwhile_by_another_process_is_used(
    fmu: Path, cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    opened = open_fmu(fmu)
    found = iter([None, opened])
    monkeypatch.setattr(fmu_archive, "_load", lambda entry, path: next(found))
    assert open_fmu(fmu) == opened
    assert len(list(cache.iterdir())) == 1


def test_entries_unused_for_long_are_deleted(fmu: Path, cache: Path, tmp_path: Path) -> None:
    old = open_fmu(fmu).directory.parent
    left_over = cache / ".unpacking-x"
    left_over.mkdir()
    foreign = cache / "not ours"
    foreign.mkdir()
    long_ago = time.time() - (KEEP_DAYS + 1) * 86400.0
    for folder in (old, left_over, foreign):
        os.utime(folder, (long_ago, long_ago))
    delete_unused.cache_clear()  # as in another process
    new = open_fmu(make_fmu(tmp_path / "b.fmu")).directory.parent
    assert sorted(cache.iterdir()) == sorted([new, foreign])


def test_a_missing_fmu_is_said_with_a_guess_and_a_file_that_is_no_zip_as_such(fmu: Path) -> None:
    assert mentions(problem(fmu.with_name("tyre_b.fmu")), "tyre_b.fmu", "'tyre_a.fmu'")
    assert mentions(problem(fmu.with_name("plant.fmu")), "plant.fmu", "tyre_a.fmu")
    fmu.write_text("hello")
    assert mentions(problem(fmu), "tyre_a.fmu", "zip", "archive")


def test_an_archive_with_a_flipped_byte_is_said(tmp_path: Path, cache: Path) -> None:
    path = tmp_path / "a.fmu"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_STORED) as archive:
        archive.writestr("modelDescription.xml", model_description("a"))
    path.write_bytes(path.read_bytes().replace(b"fmiVersion", b"fmiVersiom", 1))
    assert mentions(problem(path), "a.fmu", "Bad", "CRC", "'modelDescription.xml'")


def test_every_cut_of_an_archive_gives_one_sentence(fmu: Path, cache: Path) -> None:
    raw = fmu.read_bytes()
    for length in range(0, len(raw), 97):
        fmu.write_bytes(raw[:length])
        assert problem(fmu).startswith(f"{fmu}: ")
    assert not list(cache.glob("*"))


ONE_OUTPUT = model_description("a", outputs=["x"])


@pytest.mark.parametrize(
    ("xml", "names"),
    [
        ("<fmiModelDescription", ("modelDescription.xml", "well-formed", "line 1")),
        ('<html fmiVersion="2.0"/>', ("modelDescription.xml", "FMI 2.0", "3.0")),
        ('<fmiModelDescription fmiVersion="1.0"/>', ("FMI 1.0", "2.0", "3.0")),
        ('<fmiModelDescription fmiVersion="4.0"><CoSimulation/></fmiModelDescription>', ("FMI 4.0", "2.0")),
        (
            '<fmiModelDescription fmiVersion="2.0"><ModelExchange/></fmiModelDescription>',
            ("model exchange", "co-simulation"),
        ),
        (model_description("a").replace('guid="a"', ""), ("line 2", "'guid'", "INSTANCE.validate=false")),
        (model_description("a", outputs=["x", "x"]), ('"x"', "line 7", "INSTANCE.validate=false")),
        (ONE_OUTPUT.replace('index="1"', 'index="7"'), ("Unknown", "'7'", "1")),
        (ONE_OUTPUT.replace('index="1"', 'index="0"'), ("Unknown", "'0'", "1")),
        (
            model_description("a", ["u"], [out("x", "u")]).replace('dependencies="1"', 'dependencies="1 9"'),
            ("dependencies", "Unknown", "'9'", "2"),
        ),
        (ONE_OUTPUT.replace(' valueReference="1"', ""), ("line 6", "'ScalarVariable'", "'valueReference'")),
        (model_description("a").replace("UTF-8", "UTF-7"), ("modelDescription.xml", "encoding", "UTF-8")),
        (model_description("a").replace("UTF-8", "KLINGON"), ("modelDescription.xml", "KLINGON", "UTF-8")),
    ],
)
def test_a_model_description_that_cannot_be_used_is_said(
    xml: str, names: tuple[str, ...], tmp_path: Path, cache: Path
) -> None:
    path = make_fmu(tmp_path / "a.fmu", xml=xml)
    said = problem(path)
    assert mentions(said, path, *names)
    assert "more)" not in said  # of the one violation


@pytest.mark.parametrize(
    ("binaries", "files", "names"),
    [
        (["win64x", "darwin65"], (), ("darwin65", "win64x")),
        ([], (), ("no binaries",)),
        ([], (f"binaries/{HERE}/b{SUFFIX}", f"binaries/{HERE}/c.txt"), ("b.so", "c.txt")),
    ],
)
def test_a_missing_binary_is_said_with_those_there_are(
    binaries: list[str], files: tuple[str, ...], names: tuple[str, ...], tmp_path: Path, cache: Path
) -> None:
    path = make_fmu(tmp_path / "a.fmu", binaries=binaries, files=dict.fromkeys(files, b""))
    assert mentions(problem(path), "a.fmu", "binaries/linux64/a.so", *names)


def test_a_full_disk_is_said_and_leaves_nothing_half_done(
    fmu: Path, cache: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def write_bytes(self: Path, content: bytes) -> int:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr("tempfile.gettempdir", lambda: str(tmp_path))
    with monkeypatch.context() as patch:
        patch.setattr(Path, "write_bytes", write_bytes)
        assert mentions(problem(fmu), "tyre_a.fmu", "cache", "YAWBENCH_CACHE")
    assert list(cache.iterdir()) == []
    assert open_fmu(fmu).name == "tyre_a"


def test_a_cache_that_cannot_be_written_is_said_if_there_is_no_other(
    fmu: Path, cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    cache.write_text("a file in its place")
    monkeypatch.setattr("tempfile.gettempdir", lambda: "/ü")
    monkeypatch.setenv("PUBLIC", "/ö")
    assert mentions(problem(fmu), "tyre_a.fmu", "cache", "YAWBENCH_CACHE")


def test_a_full_cache_serves_although_it_cannot_be_written(
    fmu: Path, cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    first = open_fmu(fmu)

    def refuse(*args: Any, **kwargs: Any) -> None:
        raise PermissionError(errno.EACCES, "Permission denied")

    monkeypatch.setattr(os, "utime", refuse)
    monkeypatch.setattr(fmu_archive.tempfile, "mkdtemp", refuse)
    assert open_fmu(fmu) == first


def test_modules_of_a_pythonfmu_unit_are_listed_with_their_content(tmp_path: Path, cache: Path) -> None:
    files: dict[str, Any] = {
        "resources/slavemodule.txt": b"entry",
        "resources/entry.py": b"1",
        "resources/helpers/__init__.py": b"",
        "resources/helpers/deep/more.py": b"2",
        "resources/pythonfmu/__init__.py": b"",
        "resources/data.csv": b"",
    }
    first = open_fmu(make_fmu(tmp_path / "a.fmu", files=files))
    second = open_fmu(make_fmu(tmp_path / "b.fmu", files=files | {"resources/helpers/deep/more.py": b"3"}))
    assert set(first.python_modules) == {"entry", "helpers"}
    assert first.python_modules["entry"] == second.python_modules["entry"]
    assert first.python_modules["helpers"] != second.python_modules["helpers"]


@pytest.mark.parametrize(
    "identifier", ["../../../../outside/thief", "/tmp/thief", "a\\b", "..", "C:thief", "x" * 300, ""]
)
def test_an_identifier_that_leads_out_of_the_archive_is_refused(
    identifier: str, tmp_path: Path, cache: Path
) -> None:
    xml = ONE_OUTPUT.replace('modelIdentifier="a"', f'modelIdentifier="{identifier}"')
    path = make_fmu(tmp_path / "a.fmu", xml=xml)
    assert "modelIdentifier" in problem(path)


@pytest.mark.usefixtures("cache")
def test_an_archive_that_unpacks_without_limit_is_refused_before_it_is_unpacked(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = make_fmu(tmp_path / "bomb.fmu", files={"resources/zeros": bytes(3_000_000)})
    assert path.stat().st_size < 10_000
    monkeypatch.setattr(zip_members, "UNPACKED", 2_000_000)
    monkeypatch.setattr(zipfile.ZipFile, "read", lambda *_: pytest.fail("a member was unpacked"))
    with refused(ModelDescriptionError, "fmu-damaged", names=("bomb.fmu", "3 MB", "2 MB")):
        open_fmu(path)


@pytest.mark.usefixtures("cache")
@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes with names here")
def test_a_pipe_in_place_of_an_fmu_is_not_waited_for(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.fmu")
    with refused(ModelDescriptionError, "fmu-damaged", names=("pipe.fmu", "socket", "device")):
        open_fmu(tmp_path / "pipe.fmu")


@pytest.mark.exhaustive
def test_processes_that_unpack_at_the_same_time_do_not_collide(fmu: Path, cache: Path) -> None:
    code = "import sys; from yawbench.fmus.archive import open_fmu; print(open_fmu(sys.argv[1]).directory)"
    command = [sys.executable, "-c", code, str(fmu)]
    started = [subprocess.Popen(command, stdout=subprocess.PIPE, text=True) for _ in range(2)]
    said = {process.communicate()[0].strip() for process in started}
    assert [process.returncode for process in started] == [0] * 2
    assert said == {str(open_fmu(fmu).directory)}
    assert len(list(cache.iterdir())) == 1
