"""Checksums inside a JSON record: whatever was changed since it was written is found, with its key.

Every record and journal line that is read back carries them. They guard against editors, merges and disks,
not against somebody who makes new ones on purpose.

The checksum of a file of results.
"""

from __future__ import annotations

import hashlib
import json
import multiprocessing
import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from .errors import RecordWarning
from .files import open_regular
from .messages import listed, short

KEY = "checksums"
WHOLE = "*"
"""Stands for all keys together, so that none is lost or added unseen."""
DIGITS = 16
"""Hexadecimal digits of a checksum. Chosen: one in 10^19 changes goes unseen."""
NAMED = 5
"""Keys named in a sentence. Chosen: what fits into a line or two."""


def checksums_of(content: Mapping[str, Any]) -> dict[str, str]:
    """Return the checksums of a record, one per key and one of the whole."""
    parts = {key: _digest(value) for key, value in content.items()}
    return {WHOLE: _digest(dict(content)), **parts}


def with_checksums(content: Mapping[str, Any]) -> dict[str, Any]:
    """Return a record with its checksums, in place of those that it may have."""
    bare = {key: value for key, value in content.items() if key != KEY}
    return {**bare, KEY: checksums_of(bare)}


def changed_since(content: Mapping[str, Any]) -> str:
    """Return in words what was changed in a record since it was written, "" if nothing was.

    A record without checksums is taken as it is; see `has_checksums`.
    """
    if not has_checksums(content):
        return ""
    return what_changed({key: value for key, value in content.items() if key != KEY}, content[KEY])


def what_changed(content: Mapping[str, Any], known: Any) -> str:
    """Return in words what in a record does not fit its checksums, "" if all does."""
    if not isinstance(known, dict) or WHOLE not in known:
        return f"{KEY!r} was changed"
    found = checksums_of(content)
    words = [
        f"{what} was {how}"
        for how, keys in (
            ("changed", [key for key in found if key in known and known[key] != found[key]]),
            ("added", [key for key in found if key not in known]),
            ("removed", [key for key in known if key not in found]),
        )
        if (what := _named([key for key in keys if key != WHOLE]))
    ]
    if not words and known[WHOLE] != found[WHOLE]:
        words = [f"{KEY}.{WHOLE} was changed"]
    return ", ".join(words)


def has_checksums(content: Mapping[str, Any]) -> bool:
    """Return whether a record carries checksums: those of earlier versions do not."""
    return KEY in content


def warn(sentence: str) -> None:
    """Tell the user what was found in a record; the process that a command began in does."""
    if multiprocessing.parent_process() is None:
        warnings.warn(RecordWarning(sentence), stacklevel=3)


def _named(keys: list[str]) -> str:
    more = [f"{len(keys) - NAMED} more"] if len(keys) > NAMED else []
    return listed([*(short(key) for key in keys[:NAMED]), *more], last="and") if keys else ""


def _digest(value: Any) -> str:
    text = json.dumps(value, sort_keys=True)
    return f"sha256:{hashlib.sha256(text.encode()).hexdigest()[:DIGITS]}"


def checksum(path: Path) -> str:
    """Return the checksum of a file."""
    digest = hashlib.sha256()
    with open_regular(path) as stream:
        while block := stream.read(1 << 20):
            digest.update(block)
    return shown(digest)


def shown(digest: Any) -> str:
    """Return a SHA-256 as it stands in a run's record."""
    return f"sha256:{digest.hexdigest()}"
