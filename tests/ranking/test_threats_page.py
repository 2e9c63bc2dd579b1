"""The page of threats, from the published levels, in a browser."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
from lxml import html

from docs.generate.threat_tables import FILE
from tests.refusals import mentions
from tests.reports.browser import DESK, Browser
from tests.reports.flaws import check_budgets, flaws_in_print, inaccessible, looks, open_all
from tests.reports.made_up import unpacked
from yawbench.ranking.threat_runs import published_result
from yawbench.ranking.threat_scores import scored
from yawbench.ranking.threat_tables import compared_settings
from yawbench.ranking.threats import REFERENCE, load_threats
from yawbench.ranking.threats_page import threats_page


@pytest.fixture(scope="module")
def published():
    return published_result(load_threats(FILE))


@pytest.fixture(scope="module")
def scores(published):
    return scored(published)


@pytest.fixture(scope="module")
def page(published, scores, tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("threats")
    text = threats_page(published, scores, folder, "yawbench rank proving_ground/threats")
    (folder / "report.html").write_text(text, "utf-8")
    return folder / "report.html"


@pytest.mark.parametrize(("width", "colours"), looks(390, DESK, narrow=False))
def test_it_keeps_its_budget_and_can_be_read_by_everyone(chromium: Browser, page, width, colours):
    chromium.open(page, width=width)
    chromium.wait_for("!document.querySelector('[data-packed]')")
    check_budgets(chromium, page)
    assert chromium.overflow() <= 0
    open_all(chromium)
    chromium.wait_for("!document.querySelector('details > template')")
    assert inaccessible(chromium, colours) == []
    assert flaws_in_print(chromium) == []
    assert chromium.console() == [] and chromium.requests() == []


def test_every_level_is_on_the_page_and_counts_are_those_of_its_tables(published, scores, page):
    tree = html.fromstring(unpacked(page))
    entries = published.complete[published.threats.main]
    settings = tree.xpath("//h2[@id='settings']/following-sibling::details[following::h2[@id='disciplines']]")
    assert len(settings) == len(compared_settings(published)) > 0
    folded = tree.xpath("//h2[@id='cars']/following-sibling::details/template//table")
    assert len(folded) == len(published.threats.threats_in(published.threats.main))
    assert not [table.findtext("caption") for table in folded if table.find("caption") is not None]
    assert all(len(table.xpath("tbody/tr")) == len(entries) for table in folded)
    first = sum(score.place == 1 for score in scores.scores)
    answer = tree.xpath("string(//p[@class='said'])")
    assert answer.startswith(f"Of {len(entries)} controllers, {first} share the first place")
    order = scores.order()
    better = sum(REFERENCE in scores.behind(entry) for entry in order)
    between = sum(name != REFERENCE for entry in order for name in scores.behind(entry))
    assert mentions(answer, f"{better} of {len(order) - 1} controllers", "no control")
    assert mentions(answer, between, f"{math.comb(len(order) - 1, 2)} pairs")
