"""Checksums of JSON records, one per key, and of result files: they detect changes after writing.

Every record and journal line that is read back carries them. They protect against editors, merges and
faulty disks, not against deliberate forgery.
"""

from __future__ import annotations

import hashlib
import json
import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from .errors import RecordWarning
from .files import open_regular
from .messages import listed, short

KEY = "checksums"
WHOLE = "*"
"""Key of the checksum of the whole record, which detects added and removed keys."""
DIGITS = 16
"""Hexadecimal digits of a checksum. Chosen: one in 10^19 changes goes undetected."""
NAMED = 5
"""Maximum number of keys named in a message. Chosen: they fit into a line or two."""


def checksums_of(content: Mapping[str, Any]) -> dict[str, str]:
    """Return the checksums of a record: one per key, and one of the whole record."""
    parts = {key: _digest(value) for key, value in content.items()}
    return {WHOLE: _digest(dict(content)), **parts}


def with_checksums(content: Mapping[str, Any]) -> dict[str, Any]:
    """Return a record with its checksums, replacing existing ones."""
    bare = {key: value for key, value in content.items() if key != KEY}
    return {**bare, KEY: checksums_of(bare)}


def changed_since(content: Mapping[str, Any]) -> str:
    """Describe what was changed in a record since it was written, "" if nothing was.

    A record without checksums counts as unchanged; see `has_checksums`.
    """
    if not has_checksums(content):
        return ""
    return what_changed({key: value for key, value in content.items() if key != KEY}, content[KEY])


def what_changed(content: Mapping[str, Any], known: Any) -> str:
    """Describe which keys of a record do not match its checksums, "" if all do."""
    if not isinstance(known, dict) or WHOLE not in known:
        return f"{KEY!r} was changed"
    actual = checksums_of(content)
    words = [
        f"{what} was {how}"
        for how, keys in (
            ("changed", [key for key in actual if key in known and known[key] != actual[key]]),
            ("added", [key for key in actual if key not in known]),
            ("removed", [key for key in known if key not in actual]),
        )
        if (what := _named([key for key in keys if key != WHOLE]))
    ]
    if not words and known[WHOLE] != actual[WHOLE]:
        words = [f"{KEY}.{WHOLE} was changed"]
    return ", ".join(words)


def has_checksums(content: Mapping[str, Any]) -> bool:
    """Return whether a record carries checksums; records of earlier versions do not."""
    return KEY in content


def warn(sentence: str) -> None:
    """Warn the user about a record; worker processes ignore these warnings."""
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
    """Return a SHA-256 as written in run records."""
    return f"sha256:{digest.hexdigest()}"
