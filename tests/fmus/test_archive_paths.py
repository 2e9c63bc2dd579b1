"""Archives as other programs pack them, FMUs and SSP alike: read, or refused with one sentence."""

from __future__ import annotations

import re
import struct
import warnings
import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.changed import changed
from tests.fmus.fake_fmus import Var, make_fmu
from tests.interop.test_ssp_values import description, inline, parameter, parameters
from tests.refusals import texts_of
from yawbench.fmus.archive import open_fmu
from yawbench.foundation.errors import YawbenchError
from yawbench.orchestrator.scenario.loader import load_scenario
from yawbench.orchestrator.wiring.make_plan import make_plan

KINDS = ("fmu", "ssp")
VALUES = inline(parameters(parameter("g.k", '<ssv:Real value="2.5"/>')))
Members = list[tuple[str, bytes]]


def members_of(path: Path) -> Members:
    with zipfile.ZipFile(path) as archive:
        return [(name, archive.read(name)) for name in archive.namelist()]


def packed(kind: str, folder: Path, change: Callable[[Members], Members] = lambda members: members) -> Path:
    """Return an FMU, or an archive of one, whose members are changed; the other of the two is as usual."""
    path = make_fmu(folder / "g.fmu", outputs=["y"], parameters=[Var("k")], files={"resources/t.txt": b"1"})
    members = members_of(path)
    if kind == "ssp":
        members = [
            ("SystemStructure.ssd", description(VALUES).encode()),
            ("resources/g.fmu", path.read_bytes()),
        ]
        path = folder / "s.ssp"
    with zipfile.ZipFile(path, "w") as archive, warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of names that occur twice
        for name, content in change(members):
            archive.writestr(zipfile.ZipInfo(name), content)
    return path


def opened(path: Path) -> None:
    """Check that an archive is read with all that it holds."""
    if path.suffix == ".fmu":
        fmu = open_fmu(path)
        assert list(fmu.variables) == ["y", "k"]
        assert (fmu.directory / "resources/t.txt").read_bytes() == b"1"
    else:
        (only,) = make_plan(load_scenario(path, changes=changed(step_size=0.1))).instances
        assert only.parameters == {"k": 2.5}


def problem(path: Path) -> str:
    with pytest.raises(YawbenchError) as caught:
        opened(path)
    assert caught.value.exit_status == 2
    (sentence,) = texts_of(caught.value)
    assert sentence.startswith(str(path))
    assert "\n" not in sentence
    return sentence


def renamed(pattern: str, by: str) -> Callable[[Members], Members]:
    return lambda members: [(re.sub(pattern, by, name), content) for name, content in members]


def doubled(members: Members) -> Members:
    return [*members, *((f"./{name}", content) for name, content in members)]


def with_folders(members: Members) -> Members:
    folders = {name.rpartition("/")[0] for name, _ in members}
    return [*((f"{folder}/", b"") for folder in sorted(folders) if folder), ("./", b""), *members]


READ = {
    "dot": renamed("^", "./"),
    "backslashes": renamed("/", r"\\"),
    "dot and backslash": renamed("^", r".\\"),
    "dots within": renamed("/", "/./"),
    "folders": with_folders,
    "the same file twice": doubled,
}


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("how", READ)
def test_paths_as_other_programs_write_them_are_read(kind, how, tmp_path, cache):
    opened(packed(kind, tmp_path, READ[how]))


@pytest.mark.parametrize("kind", KINDS)
def test_a_mark_of_the_byte_order_is_read(kind, tmp_path, cache):
    mark = b"\xef\xbb\xbf"
    marked = {".xml": mark, ".ssd": mark}
    opened(packed(kind, tmp_path, lambda m: [(n, marked.get(n[-4:], b"") + c) for n, c in m]))


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("method", [zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA])
def test_large_headers_and_methods_that_python_has_are_read(kind, method, tmp_path, cache):
    path = packed(kind, tmp_path)
    members = members_of(path)
    with zipfile.ZipFile(path, "w") as archive:
        for name, content in members:
            info = zipfile.ZipInfo(name)
            info.compress_type = method
            with archive.open(info, "w", force_zip64=True) as member:
                member.write(content)
    opened(path)


TOP = {"fmu": "modelDescription.xml", "ssp": "SystemStructure.ssd"}


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("where", ["a folder", "capitals", "nowhere"])
def test_a_description_that_is_not_in_its_place_is_said(kind, where, tmp_path, cache):
    top = TOP[kind]
    change, says = {
        "a folder": (renamed("^", "car/"), f"{top} is in the folder 'car'"),
        "capitals": (renamed(f"^{top}$", top.swapcase()), top.swapcase()),
        "nowhere": (renamed(f"^{top}$", "readme.txt"), f"contains no {top}"),
    }[where]
    sentence = problem(packed(kind, tmp_path, change))
    assert says in sentence
    assert top in sentence


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", ["/abs.txt", "../out.txt", "a/../../out.txt", "C:/x.txt", "..\\out.txt"])
def test_a_path_out_of_the_archive_is_refused(kind, name, tmp_path, cache):
    sentence = problem(packed(kind, tmp_path, lambda members: [*members, (name, b"evil")]))
    assert repr(name) in sentence
    assert "unsafe" in sentence
    assert not [*tmp_path.rglob("out.txt"), *tmp_path.rglob("abs.txt")]


def patched(path: Path, flags: int = 0, method: int | None = None) -> Path:
    """Change flags and method of all members where they stand."""
    raw = bytearray(path.read_bytes())
    for signature, place in ((b"PK\x01\x02", 8), (b"PK\x03\x04", 6)):
        for match in re.finditer(re.escape(signature), bytes(raw)):
            at = match.start() + place
            before, known = struct.unpack_from("<HH", raw, at)
            struct.pack_into("<HH", raw, at, before | flags, known if method is None else method)
    path.write_bytes(raw)
    return path


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(("change", "says"), [({"flags": 1}, "encrypted"), ({"method": 93}, "compression")])
def test_an_archive_that_is_encrypted_or_compressed_otherwise_is_refused_as_such(
    kind, change, says, tmp_path, cache
):
    assert says in problem(patched(packed(kind, tmp_path), **change))
