"""The built docs: complete, self-contained, every link leading somewhere."""

from __future__ import annotations

import re
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote

import pytest

from docs.generate.formulas import to_mathml
from tests.checkout import ROOT


class Page(HTMLParser):
    """Links, loaded files and anchors of a page."""

    def __init__(self, file: Path) -> None:
        super().__init__()
        self.links: list[str] = []
        self.loads: list[str] = []
        self.anchors: set[str] = set()
        self.feed(file.read_text("utf-8"))

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        given = {key: value or "" for key, value in attributes}
        self.anchors |= {given[key] for key in ("id", "name") if key in given}
        if tag == "a" and "href" in given:
            self.links.append(given["href"])
        elif tag == "link" and given.get("rel") in ("stylesheet", "icon", "preload"):
            self.loads.append(given["href"])
        elif "src" in given:
            self.loads.append(given["src"])


@pytest.fixture(scope="module")
def pages(site):
    return {file.relative_to(site): Page(file) for file in site.rglob("*.html") if file.name != "404.html"}


def text_of(site, name):
    return (site / name).read_text("utf-8")


@pytest.mark.exhaustive  # test_links.py looks at the pages as they are written
def test_every_page_of_the_docs_is_in_the_menu_and_built(site, pages):
    written = {file.relative_to(ROOT / "docs") for file in (ROOT / "docs").rglob("*.md")}
    assert len(written) > 10
    assert {path.with_suffix(".html") for path in written} <= set(pages)
    assert not list(site.rglob("*.py"))


@pytest.mark.exhaustive  # test_links.py looks at the pages as they are written
def test_every_link_between_pages_leads_somewhere(site, pages):
    checked = 0
    for path, page in pages.items():
        for link in page.links:
            target, _, anchor = unquote(link).partition("#")
            if re.match(r"[a-z]+:", target):
                continue
            file = (site / path.parent / target).resolve() if target else (site / path).resolve()
            assert file.exists(), f"{path}: {link}"
            if anchor and file.suffix == ".html":
                name = file.relative_to(site.resolve())
                assert anchor in pages[name].anchors, f"{path}: {link}"
            checked += 1
    assert checked > 100


@pytest.mark.exhaustive  # test_links.py looks at the pages as they are written
def test_nothing_is_loaded_from_elsewhere(site, pages):
    assert [load for page in pages.values() for load in page.loads if "//" in load] == []
    styles = "".join(file.read_text("utf-8") for file in site.rglob("*.css"))
    assert re.findall(r"url\([\"']?https?:|@import", styles) == []


@pytest.mark.exhaustive  # test_links.py looks at the pages as they are written
def test_every_formula_is_drawn_without_a_script(site, pages):
    for letter in "abcd":
        html = text_of(site, f"theory/paper_{letter}.html")
        assert html.count("<math") > 5
        assert "arithmatex" not in html
    assert not any("\\frac" in text_of(site, path) for path in pages)


def test_a_formula_that_cannot_be_shown_fails_the_build():
    with pytest.raises(ValueError, match="this formula cannot be shown"):
        to_mathml(r'<span class="arithmatex">\(\left( a\)</span>')


def test_the_docs_name_nothing_that_is_not_in_the_repository():
    for file in [*(ROOT / "docs").rglob("*.md"), ROOT / "README.md"]:
        for path in re.findall(
            r"`((?:components|foundation|fmus|orchestrator|scenarios|tests|yawbench)/[\w/.]+?\.\w+)`",
            file.read_text("utf-8"),
        ):
            made_by_reader = ("yaw_follow", "slip_guard", "how_fast", "how_gentle", "yaw_rate.py")
            if not any(word in path for word in made_by_reader) and not path.endswith(".fmu"):
                assert (ROOT / path).exists(), f"{file.name}: {path}"
