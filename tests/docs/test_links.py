"""Markdown as browsed in the repository: every relative link leads to a file, every anchor to a heading."""

from __future__ import annotations

import re
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

from docs.generate.__main__ import DOCS, PAGES, text_of
from tests.checkout import ROOT
from yawbench.fmus.build import HERE, build_all

_LINK = re.compile(r'\[(?:[^\[\]]|\[[^\]]*\])*\]\(<?([^)\s>]+)>?(?: "[^"]*")?\)|(?:src|href)="([^"]+)"')


def markdown_files() -> list[Path]:
    listed = subprocess.run(["git", "ls-files", "*.md"], cwd=ROOT, capture_output=True, text=True, check=True)
    return [ROOT / name for name in listed.stdout.split()]


def prose(file: Path) -> str:
    """Return the text of a page without code."""
    text = re.sub(r"^(```|~~~).*?^\1", "", file.read_text("utf-8"), flags=re.DOTALL | re.MULTILINE)
    return re.sub(r"`[^`\n]*`", lambda match: "`" * len(match[0]), text)


def anchors_of(file: Path) -> set[str]:
    """Return what GitHub makes of the headings of a page."""
    found: dict[str, int] = {}
    anchors = set()
    text = re.sub(r"^(```|~~~).*?^\1", "", file.read_text("utf-8"), flags=re.DOTALL | re.MULTILINE)
    for heading in re.findall(r"^#{1,6} (.+?)\s*$", text, re.MULTILINE):
        plain = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading)
        slug = re.sub(r"[^\w\- ]", "", plain.lower()).replace(" ", "-")
        number = found[slug] = found.get(slug, -1) + 1
        anchors.add(f"{slug}-{number}" if number else slug)
    return anchors


def links() -> Iterator[tuple[Path, str]]:
    for file in markdown_files():
        for match in _LINK.finditer(prose(file)):
            link = match[1] or match[2]
            if not re.match(r"[a-z]+:", link):
                yield file, link


def test_no_link_of_the_repository_is_dead():
    dead, checked = [], 0
    for file, link in links():
        path, _, anchor = link.partition("#")
        target = (file.parent / path).resolve() if path else file
        where = f"{file.relative_to(ROOT)}: {link}"
        if not target.exists() or not target.is_relative_to(ROOT):
            dead.append(where)
        elif anchor and target.suffix == ".md" and anchor not in anchors_of(target):
            dead.append(f"{where}: no such heading")
        checked += 1
    assert dead == []
    assert checked > 150


@pytest.mark.parametrize("page", PAGES)
def test_generated_pages_are_those_that_the_program_writes(page):
    if page == "reference/units.md":
        build_all(HERE)
    written = (DOCS / page).read_text("utf-8")
    assert written == text_of(page), f"{page}: python -m docs.generate writes it anew"
