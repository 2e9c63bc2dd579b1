"""The page of a ranking in a browser: its matrix, and the runs that its cells open."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from lxml import html

from orchestrator.cli import main
from orchestrator.experiments.ranking import load_ranking
from orchestrator.pages.ranking_page import result_of_threats
from tests.orchestrator.test_ranking import SMALL

from .browser import DESK, PHONE, Browser
from .flaws import inaccessible
from .made_up import unpacked
from .test_sweep_page import MOST_ELEMENTS

RANKING = Path(__file__).parents[2] / "scenarios/proving_ground/ranking.yaml"


@pytest.fixture(scope="module")
def page(tmp_path_factory) -> Path:
    """The page of two controllers in two conditions."""
    folder = tmp_path_factory.mktemp("ranking")
    (folder / "small.yaml").write_text(SMALL)
    with pytest.raises(SystemExit) as ended:
        main(["rank", str(folder / "small.yaml"), "--out", str(folder / "out")])
    assert not ended.value.code
    return folder / "out" / "report.html"


@pytest.mark.parametrize("width", [PHONE, DESK])
def test_the_first_cell_is_open_and_all_of_it_can_be_read_by_everyone(chromium: Browser, page, width):
    chromium.open(page, width=width)
    chromium.wait_for("document.querySelector('.chosen .yv-ready')")
    assert chromium.console() == []
    assert chromium.overflow() <= 0
    assert chromium.run("return document.querySelectorAll('main').length") == 1
    assert inaccessible(chromium) == []


def test_the_whole_ranking_would_keep_its_budgets(chromium: Browser, page):
    whole = load_ranking(RANKING)
    entries, cells = len(whole.entries), len(whole.entries) * len(whole.conditions)
    text, tree = page.read_text(encoding="utf-8"), html.fromstring(unpacked(page))
    size, elements = len(text.encode()), len(tree.xpath("//*[not(ancestor::template)]"))
    rows = tree.xpath("//tr[not(ancestor::template)]")
    a_cell, a_row = tree.cssselect("td.cell")[0], max(rows, key=lambda row: len(html.tostring(row)))
    assert size + cells * len(html.tostring(a_cell)) + 3 * entries * len(html.tostring(a_row)) <= 400_000
    assert elements + 2 * cells + 2 * entries * len(a_row.xpath(".//*")) <= MOST_ELEMENTS


def test_every_count_is_that_of_its_table(page):
    tree = html.fromstring(unpacked(page))
    rows = tree.cssselect("table.matrix tbody tr")
    conditions = tree.cssselect("table.matrix th.leaning")
    answer = tree.xpath("string(//p[@class='said'])")
    assert answer.startswith(f"Of {len(rows)} controllers")
    assert f"of {len(conditions)} conditions" in answer
    assert len(tree.cssselect("td.cell")) == len(rows) * len(conditions)
    assert len(list((page.parent / "data").glob("*.js"))) == len(rows) * len(conditions)


def test_threats_are_quoted_where_they_can_be_read(tmp_path):
    assert "is clear in" in result_of_threats(RANKING.parent / "threats.yaml")
    assert result_of_threats(tmp_path / "threats.yaml") == ""
    shutil.copy(RANKING.parent / "threats.yaml", tmp_path)  # without its published levels
    assert "is not known" in result_of_threats(tmp_path / "threats.yaml")


def test_a_cell_shows_its_worst_run_while_the_matrix_stays_in_sight(chromium: Browser, page):
    chromium.open(page, width=1440)
    chromium.wait_for("document.querySelector('.chosen .yv-ready')")
    for cell in ("fuzzy-pid-in-low", "none-in-low"):
        chromium.run("document.querySelector(`td.cell a[href$='${arguments[0]}']`).click()", cell)
        chromium.wait_for(f"document.querySelector('.ranking').dataset.shown === '{cell}'")
        chromium.wait_for("document.querySelector('.chosen .yv-ready')")
        top = chromium.run("return document.querySelector('.matrix').getBoundingClientRect().top")
        assert 0 <= top < 900
        assert len(chromium.run("return document.querySelector('.chosen .yv').viewer.runs")) == 1
    assert chromium.console() == []
    assert all(one.startswith("file://") for one in chromium.requests())
