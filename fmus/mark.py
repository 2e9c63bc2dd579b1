"""What an FMU's archive says, in its comment, about what it was built from."""

from __future__ import annotations

import json
import zipfile
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

from orchestrator.files import check_regular

_SIGN = b"yawbench "
_UNFINISHED = "-unfinished"


@dataclass(frozen=True)
class BuildStamp:
    """Where an FMU comes from, and a key of all that decided what its bytes are."""

    name: str
    key: str
    source: str  # of a component: from the folder above components/; of a file: from the FMU's folder
    tool: str = ""  # what built it
    home: str = ""  # of a file: name of the FMU's folder; a copy in another folder is the user's own affair
    role: str = ""  # of a file: the folder of its role
    defaults: Mapping[str, Any] = field(default_factory=dict)  # default values other than the source's

    @property
    def is_component(self) -> bool:
        """True for one that the project builds by itself, and removes when its source is gone."""
        return not self.home

    def unfinished(self) -> BuildStamp:
        """Return the mark of the same FMU without the native library that it is to get."""
        return replace(self, key=self.key + _UNFINISHED)

    @property
    def is_unfinished(self) -> bool:
        """True for an FMU that is to get a native library."""
        return self.key.endswith(_UNFINISHED)

    def is_of(self, key: str | None) -> bool:
        """Return whether the FMU was built from what has this key, finished or not."""
        return key is not None and self.key.removesuffix(_UNFINISHED) == key

    def to_comment(self) -> bytes:
        """Return the comment of the archive."""
        said = {key: value for key, value in asdict(self).items() if value}
        return _SIGN + json.dumps(said, sort_keys=True).encode()


def read_mark(fmu: Path) -> BuildStamp | None:
    """Return the mark of an FMU that was built here, None for any other file, and for none."""
    try:
        check_regular(fmu)
        with zipfile.ZipFile(fmu) as archive:
            comment = archive.comment
    except Exception:  # zipfile raises whatever it meets in what is no archive
        return None
    if not comment.startswith(_SIGN):
        return None
    try:
        return BuildStamp(**json.loads(comment[len(_SIGN) :]))
    except (ValueError, TypeError):  # as other versions of this program wrote it
        return BuildStamp(fmu.stem, "", "")
