"""Evidence for the key of an FMU: digests of the files, folders and tools that determine it.

A key is expensive to compute (sources are parsed, the compiler reports its version), its evidence is
cheap to check: as long as all digests are the same, so is the key.

    /path/to/file, /path/to/folder      content; names in it
    env:CC                              an environment variable
    tool:cc                             a program on PATH
    tool:/path/to/file                  a file of an installed package, never edited in place
"""

from __future__ import annotations

import hashlib
import os
import shutil
from collections.abc import Iterable, Mapping
from pathlib import Path

Evidence = Mapping[str, str]
"""Item, as above -> its digest."""


class SourceDigests:
    """Digests of the current state, each computed once."""

    def __init__(self) -> None:
        self._digests: dict[str, str] = {}

    def at(self, item: str) -> str:
        """Return the current digest of an item."""
        if item not in self._digests:
            self._digests[item] = _digest(item)
        return self._digests[item]

    def confirm(self, evidence: Evidence) -> bool:
        """Return whether all digests are still the same."""
        return all(self.at(item) == digest for item, digest in evidence.items())

    def evidence(self, items: Iterable[str | Path]) -> dict[str, str]:
        """Return the current evidence: items with their digests."""
        return {str(item): self.at(str(item)) for item in items}


def _digest(item: str) -> str:
    scheme, _, rest = item.partition(":")
    if scheme == "env":
        return os.environ.get(rest, "")
    try:
        if scheme == "tool":
            path = shutil.which(rest) or rest
            status = os.stat(path)
            return f"{path} {status.st_size} {status.st_mtime_ns}"
        if os.path.isdir(item):
            names = sorted(n for n in os.listdir(item) if not n.startswith(".") and n != "__pycache__")
            return content_digest("\0".join(names).encode())
        with open(item, "rb", buffering=0) as file:
            return content_digest(file.read())
    except OSError:
        return ""


def content_digest(content: bytes) -> str:
    """Return the digest of a file's content."""
    return hashlib.sha256(content).hexdigest()[:32]
