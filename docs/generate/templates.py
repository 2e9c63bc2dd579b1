"""Templates of pages: Markdown in which each number is an expression (Jinja)."""

from __future__ import annotations

import math
import re
import textwrap
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from yawbench.figures.display import shown
from yawbench.foundation.messages import counted, listed

DOCS = Path(__file__).resolve().parents[1]
TEMPLATES = Path(__file__).resolve().parent / "pages"
WIDTH = 118
"""Columns of a page's lines."""


def rendered(pattern: str, names: Mapping[str, Any]) -> dict[Path, str]:
    """Return the pages of the templates of a pattern: their path and text.

    Args:
        pattern: of the templates' files, relative to `TEMPLATES`.
        names: what expressions can name, beside `max`, `min`, `counted` and `listed`.
    """
    environment = Environment(
        loader=FileSystemLoader(TEMPLATES), undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True,
        keep_trailing_newline=True,
    )  # fmt: skip
    environment.filters |= FILTERS
    environment.globals |= {"max": max, "min": min, "counted": counted, "listed": listed, **names}
    return {
        DOCS / file.stem: reflowed(environment.get_template(str(file.relative_to(TEMPLATES))).render())
        for file in sorted(TEMPLATES.glob(pattern))
    }


def reflowed(text: str) -> str:
    """Return Markdown with paragraphs and items of lists in even lines; tables and code as they are."""
    made, fenced = "", False
    for block, gap in re.findall(r"(.+?)(\n\n+|\n*\Z)", text, re.DOTALL):
        inside = fenced
        fenced ^= bool(block.count("```") % 2)
        if not (inside or "```" in block or block.startswith(("|", "#", "    ", "<", "![", ">"))):
            items = re.split(r"\n(?=- )", block)
            block = "\n".join(_wrapped(item) for item in items)
        made += block + (gap if fenced else "\n\n")
    return made.rstrip() + "\n"


def _wrapped(text: str) -> str:
    indent = "  " if text.startswith("- ") else ""
    return textwrap.fill(
        " ".join(text.split()),
        WIDTH,
        subsequent_indent=indent,
        break_on_hyphens=False,
        break_long_words=False,
    )


def _per_cent(value: float, digits: int = 1) -> str:
    return f"{100.0 * value:.{digits}f}"


def _degrees(value: float, digits: int = 1) -> str:
    return f"{math.degrees(value):.{digits}f}"


def _number(value: float, digits: int = 2) -> str:
    return f"{value:.{digits}f}"


def _quantity(value: float, unit: str, digits: int = 3) -> str:
    return shown(value, unit, digits=digits)


def row(cells: Iterable[Any]) -> str:
    return f"| {' | '.join(map(str, cells))} |"


def rule(number: int, numbers: int = 0) -> str:
    return "|" + "---|" * (number - numbers) + "---:|" * numbers


FILTERS = {
    "pc": _per_cent, "deg": _degrees, "num": _number, "quantity": _quantity, "row": row, "rule": rule,
}  # fmt: skip
"""How templates show numbers: in per cent, in degrees, as they are, with a unit; cells as a row."""
