"""Build stamps: sources and settings from which an FMU was built, in the comment of its archive."""

from __future__ import annotations

import json
import zipfile
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

from yawbench.foundation.safe_files import check_regular

_SIGN = b"yawbench "
_UNFINISHED = "-unfinished"


@dataclass(frozen=True)
class Edition:
    """Form in which an FMU is built.

    Attributes:
        fmi: major version of FMI: 2, or 3 for components with native libraries.
        platforms: names of platforms of further native libraries (`compiler.PLATFORMS`).
        sources: whether it contains its sources in C.
    """

    fmi: int = 2
    platforms: tuple[str, ...] = ()
    sources: bool = False

    def __or__(self, other: Edition) -> Edition:
        """Return the form that has what either has; the version of FMI is the first's."""
        platforms = tuple(sorted({*self.platforms, *other.platforms}))
        return Edition(self.fmi, platforms, self.sources or other.sources)


PLAIN = Edition()
"""FMI 2.0, for this machine."""


@dataclass(frozen=True)
class BuildStamp:
    """Origin of an FMU, and the key of everything that determines its content."""

    name: str
    key: str
    source: str  # path, for components from the folder above components/, for files from the FMU's folder
    tool: str = ""  # builder and its version
    home: str = ""  # for files: name of the FMU's folder; copies in other folders are not touched
    role: str = ""  # for files: folder of the role
    defaults: Mapping[str, Any] = field(default_factory=dict)  # default values that replace the source's
    edition: Edition = PLAIN

    @property
    def is_component(self) -> bool:
        """Whether the FMU belongs to a component of the project, and is removed with it."""
        return not self.home

    def unfinished(self) -> BuildStamp:
        """Return the stamp of the same FMU while its native library is not yet built."""
        return replace(self, key=self.key + _UNFINISHED)

    @property
    def is_unfinished(self) -> bool:
        """Whether the native library of the FMU is not yet built."""
        return self.key.endswith(_UNFINISHED)

    def is_of(self, key: str | None) -> bool:
        """Return whether the FMU was built with this key, with or without its native library."""
        return key is not None and self.key.removesuffix(_UNFINISHED) == key

    def to_comment(self) -> bytes:
        """Return the stamp as the comment of an archive."""
        edition = {key: v for key, v in asdict(self.edition).items() if v != getattr(PLAIN, key)}
        content = asdict(self) | {"edition": edition}
        return _SIGN + json.dumps({key: v for key, v in content.items() if v}, sort_keys=True).encode()


def read_stamp(fmu: Path) -> BuildStamp | None:
    """Return the stamp of an FMU built by this program, None for other or missing files."""
    try:
        check_regular(fmu)
        with zipfile.ZipFile(fmu) as archive:
            comment = archive.comment
    except Exception:  # zipfile raises many types for a file that is not an archive
        return None
    if not comment.startswith(_SIGN):
        return None
    try:
        content = json.loads(comment[len(_SIGN) :])
        edition = content.pop("edition", {})
        edition["platforms"] = tuple(edition.get("platforms", ()))
        return BuildStamp(**content, edition=Edition(**edition))
    except (ValueError, TypeError):  # written by another version of this program
        return BuildStamp(fmu.stem, "", "")
