"""This program as a wheel, and the versions of the packages that it needs.

The wheel is made of the imported package, be it installed or a checkout, so that whoever installs it runs the
same code: keys of runs are hashes of it. The same code gives the same bytes.
"""

from __future__ import annotations

import base64
import hashlib
import io
import os
import zipfile
from collections.abc import Iterator, Mapping
from importlib.metadata import Distribution, PackageNotFoundError, distribution
from pathlib import Path

import yawbench

PROGRAM = "yawbench"
TAG = "Wheel-Version: 1.0\nGenerator: yawbench pack\nRoot-Is-Purelib: true\nTag: py3-none-any\n"
"""Content of `WHEEL` (binary distribution format, PyPA specifications)."""
OF_INSTALLATION = ("RECORD", "INSTALLER", "REQUESTED", "direct_url.json", "WHEEL")
"""Files of an installed distribution that are not those of its wheel, or are made anew."""
BUILT = (".fmu", ".pyc", ".so", ".o")
"""Endings of files that are built, not sources."""


def wheel() -> tuple[str, bytes]:
    """Return file name and content of the wheel of this program."""
    installed = distribution(PROGRAM)
    about = f"{PROGRAM}-{installed.version}.dist-info"
    files = {**_code(), **_metadata(installed, about), f"{about}/WHEEL": TAG.encode()}
    files[f"{about}/RECORD"] = _record(files, f"{about}/RECORD")
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w", zipfile.ZIP_DEFLATED) as archive:
        for path, data in sorted(files.items()):
            archive.writestr(zipfile.ZipInfo(path), data, zipfile.ZIP_DEFLATED)  # dated 1980: the same bytes
    return f"{PROGRAM}-{installed.version}-py3-none-any.whl", content.getvalue()


def _code() -> dict[str, bytes]:
    """Return the files of the package; its parts may be links to folders beside it."""
    home = Path(yawbench.__file__).parent
    files = {}
    for above, inside, names in os.walk(home, followlinks=True):
        inside[:] = sorted(name for name in inside if name != "__pycache__" and not name.startswith("."))
        for name in sorted(names):
            if not name.startswith(".") and not name.endswith(BUILT):
                path = Path(above, name)
                files[f"{PROGRAM}/{path.relative_to(home).as_posix()}"] = path.read_bytes()
    return files


def _metadata(installed: Distribution, about: str) -> dict[str, bytes]:
    """Return the files of `dist-info`."""
    files = {}
    for entry in installed.files or ():
        inside = entry.as_posix().partition(".dist-info/")[2]
        if inside and inside not in OF_INSTALLATION:
            files[f"{about}/{inside}"] = entry.read_binary()
    return files


def _record(files: Mapping[str, bytes], own: str) -> bytes:
    def row(name: str, content: bytes) -> str:
        digest = base64.urlsafe_b64encode(hashlib.sha256(content).digest()).rstrip(b"=").decode()
        return f"{name},sha256={digest},{len(content)}"

    return "\n".join([*(row(*file) for file in sorted(files.items())), f"{own},,", ""]).encode()


def lock() -> dict[str, str]:
    """Return name -> version of every installed package that this program needs, sorted."""
    return dict(sorted(_needed(PROGRAM, set())))


def _needed(package: str, known: set[str]) -> Iterator[tuple[str, str]]:
    from packaging.requirements import Requirement  # a package that matplotlib brings
    from packaging.utils import canonicalize_name

    for text in distribution(package).requires or ():
        needed = Requirement(text)
        name = canonicalize_name(needed.name)
        if name in known or (needed.marker and not needed.marker.evaluate({"extra": ""})):
            continue
        known.add(name)
        try:
            yield name, distribution(name).version
        except PackageNotFoundError:  # an incomplete installation: the program did without it
            continue
        yield from _needed(name, known)
