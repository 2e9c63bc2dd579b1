"""The cache: nothing in it is believed unseen, and it serves whoever may write where."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.command_line import status_of
from tests.fmus.fake_fmus import make_fmu
from tests.refusals import each_mentions, mentions, refused
from yawbench.fmus.archive import open_fmu
from yawbench.foundation.cache import STORES, cache_folder, keep, recall
from yawbench.foundation.errors import ModelDescriptionError
from yawbench.foundation.safe_files import write_whole


@pytest.fixture
def full(cache: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A cache with an unpacked FMU, a launcher, and what others have put there."""
    monkeypatch.setattr("tempfile.gettempdir", lambda: str(tmp_path / "temporary"))
    monkeypatch.setenv("PUBLIC", "/ö")
    open_fmu(make_fmu(tmp_path / "a.fmu", files={"resources/table.txt": b"1 2 3"}))
    keep("launcher", "0123", b"a launcher")
    (cache / "letters").mkdir()
    (cache / f"{'0' * 32}-1").mkdir()
    return cache


def told(capsys: pytest.CaptureFixture[str], *arguments: str) -> tuple[str, str]:
    assert status_of("cache", *arguments) == 0
    return capsys.readouterr()


def test_what_is_kept_comes_back_until_something_else_is_kept(cache):
    keep("keys", "key", b"one")
    assert recall("keys", "key") == b"one"
    keep("keys", "key", b"two")
    assert recall("keys", "key") == b"two"
    assert len(list(cache.glob("keys/*"))) == 1
    assert recall("keys", "other") is None


@pytest.mark.parametrize("harm", [b"", b"tw", b"twx"])
def test_what_is_damaged_does_not_come_back(cache, harm):
    keep("keys", "key", b"two")
    (file,) = cache.glob("keys/*")
    file.write_bytes(harm)
    assert recall("keys", "key") is None


def test_a_file_that_cannot_be_put_in_place_leaves_what_stood_there(tmp_path, monkeypatch):
    file = tmp_path / "a"
    write_whole(file, b"old")

    def refuse(*_):
        raise OSError(5, "Input/output error")

    monkeypatch.setattr(os, "fsync", refuse)
    with refused(OSError, names=("[Errno 5]", "Input/output", "a")):
        write_whole(file, b"new")
    assert file.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [file]


def test_show_tells_what_there_is_and_touches_nothing(full, capsys):
    before = sorted(full.rglob("*"))
    out, _ = told(capsys)
    assert each_mentions(
        out.splitlines()[:4],
        ("cache",),
        ("1", "0.0 MB", "unpacked"),
        ("1", "0.0 MB"),
        ("1", "0.0 MB", "left"),
    )
    assert sorted(full.rglob("*")) == before


def test_clear_deletes_what_is_ours(full, capsys):
    for store in STORES:
        keep(store, "4567", b"an entry")
    told(capsys, "clear")
    assert sorted(path.name for path in full.iterdir()) == sorted([*STORES, "letters"])
    assert [path for store in STORES for path in (full / store).iterdir()] == []


@pytest.mark.parametrize("name", ["Größe", "50 %"])
def test_a_cache_whose_path_is_not_plain_ascii_is_passed_over(name, tmp_path, monkeypatch):
    monkeypatch.setenv("YAWBENCH_CACHE", str(tmp_path / name))
    monkeypatch.setattr("tempfile.gettempdir", lambda: str(tmp_path / "temporary"))
    folder = cache_folder()
    assert folder == tmp_path / "temporary" / f"yawbench-{os.getuid()}"
    assert folder.stat().st_mode & 0o777 == 0o700


@pytest.mark.parametrize("owner", ["another", "nobody"])
def test_where_no_folder_can_be_trusted_or_is_plain_it_is_said(owner, tmp_path, monkeypatch):
    monkeypatch.setenv("YAWBENCH_CACHE", str(tmp_path / "ä"))
    places = (str(tmp_path), str(tmp_path)) if owner == "another" else ("/ü", "/ö")
    monkeypatch.setattr("tempfile.gettempdir", lambda: places[0])
    monkeypatch.setenv("PUBLIC", places[1])
    user = os.getuid() + 1
    (tmp_path / f"yawbench-{user}").mkdir()
    monkeypatch.setattr("os.getuid", lambda: user)
    names = ("FMUs", "YAWBENCH_CACHE", f"yawbench-{user}" if owner == "another" else "ä")
    with refused(ModelDescriptionError, "cache-unwritable", names=names):
        cache_folder()


def no_home(name):
    raise RuntimeError("could not determine the home directory")


@pytest.mark.parametrize("users", [lambda name: Path("~/.cache") / name, no_home, None])
def test_where_there_is_no_home_or_no_cache_can_be_made_there_a_temporary_one_serves(
    users, tmp_path, monkeypatch
):
    (tmp_path / "file").touch()
    monkeypatch.setenv("YAWBENCH_CACHE", "" if users else str(tmp_path / "file" / "cache"))
    monkeypatch.setattr("platformdirs.user_cache_path", users)
    monkeypatch.setattr("tempfile.gettempdir", lambda: str(tmp_path))
    assert cache_folder() == tmp_path / f"yawbench-{os.getuid()}"
    keep("keys", "key", b"two")
    assert recall("keys", "key") == b"two"
    assert open_fmu(make_fmu(tmp_path / "a.fmu")).directory.is_relative_to(cache_folder())


USER = """
import sys
from yawbench.fmus.archive import open_fmu
open_fmu(sys.argv[1])
print("opened", flush=True)
sys.stdin.read()
"""


@pytest.mark.skipif(sys.platform == "win32", reason="needs locks on folders")
def test_nothing_is_deleted_while_another_command_uses_the_cache(full, tmp_path, capsys):
    command = [sys.executable, "-c", USER, str(tmp_path / "a.fmu")]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as user:
        assert user.stdout is not None
        assert user.stdout.readline() == "opened\n"
        before = sorted(full.rglob("*"))
        assert status_of("cache", "clear") == 1
        assert mentions(capsys.readouterr().err, "cache", "command")
        assert sorted(full.rglob("*")) == before
        told(capsys, "show")
        user.communicate()
    told(capsys, "clear")
    assert not [one for one in full.iterdir() if one.name != "letters" and any(one.rglob("*"))]
