"""Reproducible packing of FMU archives.

The same sources give the same bytes, independent of place and time of the build: files are sorted,
stored without compression (compressors differ), all with the same date and permissions. The GUID
is derived from the model description and the resources, not from the binaries.
"""

from __future__ import annotations

import hashlib
import io
import uuid
import zipfile
from collections.abc import Mapping
from functools import cache
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

from .build_stamp import BuildStamp
from .source_files import PYTHONFMU

DESCRIPTION = "modelDescription.xml"
_DATE = (1980, 1, 1, 0, 0, 0)
LIBRARIES = sorted(PYTHONFMU.glob("resources/binaries/*/*"))
"""PythonFMU's libraries, in a folder per platform."""
PYTHONFMU_LIBRARY = "libpythonfmu-export.so"
"""Name of PythonFMU's library next to the launcher, which opens it by this name."""


@cache
def python_libraries() -> frozenset[bytes]:
    """Return the contents of PythonFMU's libraries, which need a Python."""
    return frozenset(library.read_bytes() for library in LIBRARIES)


def pack(
    resources: Mapping[str, str], description: Element, *, name: str, version: str, launcher: bytes | None
) -> dict[str, bytes]:
    """Return the files of an FMU, as path -> content.

    Args:
        resources: Python sources, as path -> text.
        description: model description.
        name, version: of the FMU.
        launcher: binary for Linux that opens PythonFMU's library; None: only that library.
    """
    files = {f"resources/{path}": text.encode() for path, text in sorted(resources.items())}
    description.set("version", version)
    # for the launcher, which refuses any other
    files["resources/guid.txt"] = set_guid(description, files).encode()
    ElementTree.indent(description)
    files[DESCRIPTION] = ElementTree.tostring(description, encoding="UTF-8", xml_declaration=True) + b"\n"
    for library in LIBRARIES:
        files[f"binaries/{library.parent.name}/{name}{library.suffix}"] = library.read_bytes()
    if launcher is not None:
        binary = f"binaries/linux64/{name}.so"
        files[f"binaries/linux64/{PYTHONFMU_LIBRARY}"] = files[binary]
        files[binary] = launcher
    return files


def set_guid(description: Element, files: Mapping[str, bytes]) -> str:
    """Give a model description the GUID that follows from it and from files, and return the GUID."""
    description.set("guid", "")
    content = hashlib.sha256(ElementTree.tostring(description))
    for path, data in files.items():
        content.update(path.encode() + b"\0" + hashlib.sha256(data).digest())
    guid = f"{{{uuid.UUID(bytes=content.digest()[:16])}}}"
    description.set("guid", guid)
    return guid


def to_bytes(files: Mapping[str, bytes], stamp: BuildStamp) -> bytes:
    """Return the archive of `files`, with the stamp as its comment."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_STORED) as archive:
        for path, data in sorted(files.items()):
            info = zipfile.ZipInfo(path, _DATE)
            info.create_system = 3  # Unix, also when built elsewhere
            info.external_attr = 0o100644 << 16
            archive.writestr(info, data)
        archive.comment = stamp.to_comment()
    return buffer.getvalue()
