"""Markdown: tables, and plain text that must not be read as markup."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence

NOTE = "*This page is generated from the program: `python -m docs.generate` writes it.*"


def plain(text: str) -> str:
    """Return text as Markdown that shows it as it is; text in backticks stays code."""
    parts = re.split(r"(`[^`]*`)", text)
    return "".join(part if part.startswith("`") else _escaped(part) for part in parts)


def _escaped(text: str) -> str:
    return re.sub(r"([*_\\|$\[\]])", r"\\\1", text).replace("<", "&lt;")


def cell(text: str) -> str:
    """Return plain text for a cell of a table."""
    return plain(" ".join(text.split()))


def code(text: str) -> str:
    """Return text as code in a cell of a table."""
    return f"`{text}`" if text else ""


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a Markdown table of ready cells; nothing if it has no rows."""
    lines = [f"| {' | '.join(row)} |" for row in rows]
    if not lines:
        return ""
    return "\n".join([f"| {' | '.join(head)} |", f"|{'---|' * len(head)}", *lines, ""])


def docstring(text: str) -> str:
    """Return a docstring as Markdown: paragraphs as they are, indented lines as code."""
    lines = []
    for line in text.strip().splitlines():
        if line.startswith("    "):
            lines.append(line)
        elif re.match(r"[*-] ", line):
            lines.append("- " + plain(line[2:]))
        else:
            lines.append(plain(line))
    return re.sub(r"(?m)^(?!    )(.+)\n(?=    \S)", r"\1\n\n", "\n".join(lines)) + "\n"
