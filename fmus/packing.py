"""From what PythonFMU's builder made to the archive that is an FMU: complete, minimal, reproducible.

The same sources give the same bytes, wherever and whenever they are built: files in sorted order,
stored without compression (compressors differ), with one date and one set of permissions. The GUID
follows from the model description and the resources, not from the binaries.
"""

from __future__ import annotations

import hashlib
import io
import uuid
import zipfile
from collections.abc import Mapping
from pathlib import Path
from xml.etree import ElementTree

from .mark import Mark

_DATE = (1980, 1, 1, 0, 0, 0)
PYTHONFMU_LIBRARY = "libpythonfmu-export.so"
"""Name of PythonFMU's library beside the launcher; the launcher opens it by this name."""


def pack(built: Path, *, name: str, version: str, launcher: bytes | None) -> dict[str, bytes]:
    """Return path -> content of the FMU `name` from the archive that PythonFMU's builder wrote.

    The builder's own copy of PythonFMU is left out: the package of the component carries what it
    needs under a name of its own. With a `launcher`, it becomes the binary for Linux.
    """
    files: dict[str, bytes] = {}
    with zipfile.ZipFile(built) as archive:
        for path in archive.namelist():
            if not path.startswith("resources/pythonfmu/"):
                files[path] = archive.read(path)
    binary = f"binaries/linux64/{name}.so"
    if launcher is not None:
        files[f"binaries/linux64/{PYTHONFMU_LIBRARY}"] = files[binary]
        files[binary] = launcher
    files["modelDescription.xml"] = _description(files, version)
    return files


def _description(files: Mapping[str, bytes], version: str) -> bytes:
    root = ElementTree.fromstring(files["modelDescription.xml"])
    for element in root.iter():  # the builder has indented already, differently in each Python
        element.text = element.tail = None
    root.set("version", version)
    root.set("guid", "")
    content = hashlib.sha256(ElementTree.tostring(root))
    for path, data in sorted(files.items()):
        if path.startswith("resources/"):
            content.update(path.encode() + b"\0" + hashlib.sha256(data).digest())
    root.set("guid", f"{{{uuid.UUID(bytes=content.digest()[:16])}}}")
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="UTF-8", xml_declaration=True) + b"\n"


def to_bytes(files: Mapping[str, bytes], mark: Mark) -> bytes:
    """Return the archive of `files`; its comment is the mark."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_STORED) as archive:
        for path, data in sorted(files.items()):
            info = zipfile.ZipInfo(path, _DATE)
            info.create_system = 3  # Unix, also when built elsewhere
            info.external_attr = 0o100644 << 16
            archive.writestr(info, data)
        archive.comment = mark.to_comment()
    return buffer.getvalue()
