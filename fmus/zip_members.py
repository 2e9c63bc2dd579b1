"""Members of zip archives that other people have packed: FMUs and SSP archives."""

from __future__ import annotations

import lzma
import struct
import zipfile
import zlib
from collections.abc import Iterable
from pathlib import PurePosixPath

from yawbench.foundation.messages import in_bytes

UNPACKED = 1_000_000_000
"""Bytes of all members of an archive, unpacked. Chosen: larger than all FMUs known to us."""


DAMAGE = (
    zipfile.BadZipFile, zlib.error, lzma.LZMAError, struct.error, EOFError, OSError, ValueError,
    RuntimeError,  # encrypted, or an unknown compression method
)  # fmt: skip
"""What the reading of a damaged archive raises."""


class ArchiveError(ValueError):
    """The members of an archive cannot be taken."""


def members(archive: zipfile.ZipFile) -> dict[str, zipfile.ZipInfo]:
    """Return the files of an archive by path: with /, and without the ./ and \\ that some programs write.

    Raises:
        ArchiveError: a path leads out of the archive, or it is too large; `zipfile` never reads more bytes
            of a member than its directory declares.
    """
    size = sum(info.file_size for info in archive.infolist())
    if size > UNPACKED:
        raise ArchiveError(f"unpacked it has {in_bytes(size)}, more than {in_bytes(UNPACKED)}")
    files: dict[str, zipfile.ZipInfo] = {}
    for info in archive.infolist():
        name = info.filename.replace("\\", "/")
        parts = PurePosixPath(name).parts
        if name.startswith("/") or ".." in parts or ":" in name or "\0" in name:
            raise ArchiveError(f"the archive is unsafe: it contains the path {info.filename!r}")
        if parts and not name.endswith("/"):
            files["/".join(parts)] = info
    return files


def misplaced(files: Iterable[str], wanted: str) -> str:
    """Return why an archive with these files lacks the file `wanted` in its first folder."""
    for name in files:
        folder, _, last = name.rpartition("/")
        if last == wanted and folder.split("/")[0] not in ("resources", "extra", "sources"):
            return (
                f"{wanted} is in the folder {folder!r} of the archive: pack the content of that folder, not "
                "the folder"
            )
        if name.lower() == wanted.lower():
            return f"the archive contains {name}, which has to be called {wanted}"
    return f"the archive contains no {wanted}"
