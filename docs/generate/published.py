"""Tables in pages that come from published runs, which are taken from the table of an experiment."""

from __future__ import annotations

import argparse
import csv
import textwrap
from collections.abc import Callable, Mapping, Sequence
from functools import reduce
from pathlib import Path

from yawbench.studies.tables import Table


def replaced(page: str, name: str, text: str) -> str:
    """Return a page with the text between the marks of that name replaced."""
    begin, end = f"<!-- {name}: written by docs.generate -->", f"<!-- end of {name} -->"
    before, found, rest = page.partition(begin)
    if not found or end not in rest:
        raise ValueError(f"the page has no marks {begin} and {end}")
    return f"{before}{begin}\n\n{text}\n\n{end}{rest.partition(end)[2]}"


def pages_with(texts: Mapping[Path, Mapping[str, str]]) -> dict[Path, str]:
    """Return pages with the texts between their marks replaced; `texts`: page -> name -> text."""
    return {
        page: reduce(lambda told, one: replaced(told, *one), of.items(), page.read_text(encoding="utf-8"))
        for page, of in texts.items()
    }


def rows_in(file: Path) -> list[dict[str, str]]:
    """Return the rows of a table in a CSV file."""
    with file.open(encoding="utf-8", newline="") as lines:
        return list(csv.DictReader(lines))


def wrapped(text: str) -> str:
    """Return a paragraph in lines."""
    return "\n".join(textwrap.wrap(text, 118, break_on_hyphens=False))


def markdown(table: Table) -> str:
    """Return a table in Markdown, with its notes below."""
    lines = [
        f"| {' | '.join(heading or ' ' for heading in table.headings)} |",
        f"|{'|'.join('---:' if table.is_number(k) else '---' for k in range(len(table.headings)))}|",
        *(f"| {' | '.join(cell.replace(chr(10), '; ') for cell in row)} |" for row in table.text()),
    ]
    return "\n\n".join(["\n".join(lines), *map(wrapped, table.notes)])


def take(table: Path, runs: Path, columns: Sequence[str]) -> None:
    """Write the published runs from the columns of a table."""
    with runs.open("w", encoding="utf-8", newline="") as out:
        writer = csv.DictWriter(out, columns, extrasaction="ignore", lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows_in(table))


def write_pages(
    about: str | None,
    runs: Path,
    columns: Sequence[str],
    pages: Callable[[], dict[Path, str]],
    beside: Callable[[Path], None] | None = None,
) -> None:
    """Write pages anew; with `--runs TABLE`, first the published runs from the table of an experiment.

    Args:
        about: what the command does.
        runs: file of the published runs.
        columns: columns of the table that are published.
        pages: returns the pages.
        beside: takes further tables from beside that of `--runs`.
    """
    options = argparse.ArgumentParser(description=about)
    options.add_argument("--runs", type=Path, metavar="TABLE")
    table = options.parse_args().runs
    if table:
        take(table, runs, columns)
        if beside:
            beside(table)
    for page, text in pages().items():
        page.write_text(text, encoding="utf-8")
