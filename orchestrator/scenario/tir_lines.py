"""The lines of a tyre property file: sections, keys and values, whatever program has written them.

Read are files with any line ends and any order of sections, in UTF-8, UTF-16 or cp1252. `$` and `!` begin a
comment, tables (`{pen fz}`) are passed over, and so is a line without `=`: mostly the rest of a comment that
an editor has wrapped.
"""

from __future__ import annotations

import codecs
import re
from collections.abc import Iterator
from typing import NamedTuple

_LINE_END = re.compile(r"\r\n|\r|\n")
_ENTRY = re.compile(r"(?P<key>[A-Za-z]\w*)\s*=\s*(?P<value>'[^']*'?|\"[^\"]*\"?|[^$!]*)", re.ASCII)
_SECTION = re.compile(r"\[\s*([^\]]*?)\s*\]")


class Entry(NamedTuple):
    """A key with its value as text, None if it has none, in upper case the key and its section."""

    line: int
    section: str
    key: str
    text: str | None


def read_entries(raw: bytes) -> Iterator[Entry]:
    """Yield the entries of a file from top to bottom."""
    section = ""
    for number, line in enumerate(_LINE_END.split(_decoded(raw)), start=1):
        line = line.strip()
        if found := _SECTION.match(line):
            section = found[1].upper()
        elif found := _ENTRY.match(line):
            text = found["value"].strip().strip("'\"").strip()
            yield Entry(number, section, found["key"].upper(), text or None)


def _decoded(raw: bytes) -> str:
    if raw.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return raw.decode("utf-16", "replace")
    try:
        return raw.decode("utf-8-sig")
    except UnicodeDecodeError:
        return raw.decode("cp1252", "replace")
