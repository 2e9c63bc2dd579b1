"""Tables in Markdown, as tests read them."""

from __future__ import annotations


def table_in(text: str) -> list[list[str]]:
    """Return the cells of all rows of the Markdown tables in a text, without the rules below headings."""
    lines = [line.strip("|").split("|") for line in text.splitlines() if line.startswith("|")]
    return [[cell.strip() for cell in line] for line in lines if not set(line[0].strip()) <= {"-", ":"}]
