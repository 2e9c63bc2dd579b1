"""The checksum of a file of results."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Any

from ..files import open_regular


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
