"""The docs in a real browser: no page too wide, nothing from elsewhere, no complaints, a search."""

from __future__ import annotations

import pytest

from tests.checkout import ROOT
from tests.pages.browser import DESK, PHONE
from tests.pages.conftest import chromium, window  # noqa: F401  fixtures

pytestmark = pytest.mark.exhaustive

NAMES = sorted(str(f.relative_to(ROOT / "docs").with_suffix(".html")) for f in (ROOT / "docs").rglob("*.md"))
MADE = [
    f"reference/{name}.html"
    for name in ("commands", "metrics", "scenario", "signals", "study", "sweep", "units")
]
CUT = """return [...document.querySelectorAll('.md-typeset__table, .md-typeset__scrollwrap, .formula')]
    .filter((e) => e.scrollWidth > e.clientWidth + 1).map((e) => e.innerText.slice(0, 80))"""
"""Tables and formulas that have to be scrolled."""


@pytest.mark.parametrize("width", [PHONE, DESK])
@pytest.mark.parametrize("name", [*NAMES, *MADE])
def test_a_page_fits_its_window_and_is_whole_by_itself(site, chromium, name, width):  # noqa: F811
    chromium.open(site / name, width=width)
    assert chromium.overflow() <= 0
    if width == DESK:
        assert chromium.run(CUT) == []
    assert chromium.console() == []
    assert [request for request in chromium.requests() if not request.startswith("file:")] == []


def test_formulas_are_drawn_and_the_large_ones_scroll_by_themselves(site, chromium):  # noqa: F811
    chromium.open(site / "theory" / "paper_a.html", width=PHONE)
    heights = chromium.run(
        "return [...document.querySelectorAll('math')].map((m) => m.getBoundingClientRect().height)"
    )
    assert len(heights) > 20
    assert min(heights) > 5
    assert chromium.run(
        "return [...document.querySelectorAll('.formula')].every((f) => f.clientWidth <= window.innerWidth)"
    )


def test_the_search_finds_pages_without_a_server(site, chromium):  # noqa: F811
    chromium.open(site / "index.html", width=DESK)
    chromium.run("document.querySelector('input.md-search__input').focus()")
    chromium.press("Dugoff")
    chromium.wait_for("document.querySelectorAll('.md-search-result__item a').length > 0")
    found = chromium.run(
        "return [...document.querySelectorAll('.md-search-result__item a')].map((a) => a.href)"
    )
    assert any("paper_a.html" in link or "units.html" in link for link in found)
