"""What the key of an FMU follows from: files, names in folders, tools, each with a digest of its state.

A key is costly to find (sources are parsed, a compiler is asked for its version), its evidence is
cheap to look at: while every digest is the same, so is the key.

    /path/to/file, /path/to/folder      content; names in it
    env:CC                              an environment variable
    tool:cc                             a program on PATH
    tool:/path/to/file                  a file of an installed package, which nobody edits
"""

from __future__ import annotations

import hashlib
import os
import shutil
from collections.abc import Iterable, Mapping
from pathlib import Path

Evidence = Mapping[str, str]
"""What was looked at -> digest of what was found."""


class SourceDigests:
    """Digests of the present state, each found once."""

    def __init__(self) -> None:
        self._found: dict[str, str] = {}

    def at(self, what: str) -> str:
        """Return the digest of one thing as it is now."""
        if what not in self._found:
            self._found[what] = _digest(what)
        return self._found[what]

    def confirm(self, evidence: Evidence) -> bool:
        """Return whether everything is as it was."""
        return all(self.at(what) == digest for what, digest in evidence.items())

    def evidence(self, of: Iterable[str | Path]) -> dict[str, str]:
        """Return the evidence of things as they are now."""
        return {str(what): self.at(str(what)) for what in of}


def _digest(what: str) -> str:
    scheme, _, rest = what.partition(":")
    if scheme == "env":
        return os.environ.get(rest, "")
    try:
        if scheme == "tool":
            path = shutil.which(rest) or rest
            status = os.stat(path)
            return f"{path} {status.st_size} {status.st_mtime_ns}"
        if os.path.isdir(what):
            names = sorted(n for n in os.listdir(what) if not n.startswith(".") and n != "__pycache__")
            return content_digest("\0".join(names).encode())
        with open(what, "rb", buffering=0) as file:
            return content_digest(file.read())
    except OSError:
        return ""


def content_digest(content: bytes) -> str:
    """Return the digest of a file's content."""
    return hashlib.sha256(content).hexdigest()[:32]
