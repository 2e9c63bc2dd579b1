"""The page of a ranking in a browser: its matrix, and the runs that its cells open."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from lxml import html

from tests.orchestrator.test_ranking import SMALL
from yawbench.cli import main
from yawbench.ranking.ranking import load_ranking
from yawbench.ranking.ranking_page import result_of_threats

from .browser import DESK, HELD, PHONE, Browser
from .flaws import flaws_in_print, inaccessible, looks
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


@pytest.mark.parametrize(("width", "colours"), looks(PHONE, DESK, narrow=True))
def test_the_first_cell_is_open_and_all_of_it_can_be_read_by_everyone(
    chromium: Browser, page, width, colours
):
    chromium.open(page, width=width)
    chromium.wait_for("document.querySelector('.chosen .yv-ready')")
    assert chromium.console() == []
    assert chromium.overflow() <= 0
    assert chromium.run("return document.querySelectorAll('main').length") == 1
    assert inaccessible(chromium, colours) == []
    assert flaws_in_print(chromium) == []
    chromium.open(page, width=width)
    chromium.wait_for("document.querySelector('.chosen .yv-ready')")
    chromium.run("document.querySelector(\"td.cell a[href$='none-in-low']\").click()")
    chromium.wait_for("document.querySelector('.ranking').dataset.shown === 'none-in-low'")
    top, bar = chromium.run(
        "const box = (name) => document.querySelector(name).getBoundingClientRect();"
        "return [box('.chosen h2').top, box('nav.top').bottom]"
    )
    assert top >= bar  # the heading of what was chosen is not behind the links at the top


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
    assert f"{len(rows)} of {len(rows)} controllers cannot be told apart" in answer  # by so few conditions
    assert f"of {len(conditions)} conditions" in answer
    assert len(tree.cssselect("td.cell")) == len(rows) * len(conditions)
    assert len(list((page.parent / "data").glob("*.js"))) == len(rows) * len(conditions)


def test_threats_are_quoted_where_they_can_be_read(tmp_path):
    assert "clearly better" in result_of_threats(RANKING.parent / "threats.yaml")
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


CHOSEN = (
    "const chosen = document.querySelector('.chosen'), links = [...document.querySelectorAll('td.cell a')];"
)
PANELS = "return document.querySelector('.chosen .yv').viewer.state.panels"


def test_a_late_error_does_not_replace_what_was_chosen_after_it(chromium: Browser, page):
    chromium.open(page)
    chromium.wait_for("document.querySelector('.chosen .yv-ready')")
    details = chromium.run(
        HELD + CHOSEN + "const first = await choose(links[1]), second = await choose(links[2]);"
        "end(second); await until(() => chosen.querySelector('.yv-ready'));"
        "fail(first); await frames();"
        "return document.querySelector('.details').textContent"
    )
    assert details and "belongs beside this page" not in details
    assert chromium.run(CHOSEN + "return Boolean(chosen.querySelector('.yv-ready'))")
    assert chromium.console() == []


def test_what_the_viewer_writes_while_the_next_run_is_loaded_is_not_taken_for_the_wish_of_a_link(
    chromium: Browser, page
):
    chromium.open(page)
    chromium.wait_for("document.querySelector('.chosen .yv-ready')")
    at_first = chromium.run(PANELS)
    chromium.run(
        HELD + CHOSEN + "const {viewer} = chosen.querySelector('.yv');"
        "const {panels} = viewer.state, wish = JSON.stringify(panels.slice(0, 1));"
        "location.hash = `${links[1].hash}&&${viewer.key}?panels=${wish}`; await until(() => held.length);"
        "viewer.state.panels = panels.slice(0, 2); viewer.remember();"
        "end(held[0]); await until(() => chosen.querySelector('.yv').viewer !== viewer);"
        "await until(() => chosen.querySelector('.yv-ready'));"
    )
    assert chromium.run(PANELS) == at_first[:1]


def test_of_two_quick_choices_the_last_is_shown_with_the_panels_of_the_viewer_before(chromium: Browser, page):
    chromium.open(page)
    chromium.wait_for("document.querySelector('.chosen .yv-ready')")
    at_first = chromium.run(PANELS)
    shown = chromium.run(
        HELD + CHOSEN + "const {viewer} = chosen.querySelector('.yv');"
        "viewer.state.panels = viewer.state.panels.slice(0, 1);"
        "const Plain = Response, unpacking = [];"  # samples of the first choice arrive after the second
        "window.Response = class {"
        "  constructor(stream) { this.stream = stream; }"
        "  arrayBuffer() {"
        "    return new Promise((go) => unpacking.push(() => go(new Plain(this.stream).arrayBuffer())));"
        "  }"
        "};"
        "const began = () => chosen.querySelector('.yv-started') && !chosen.querySelector('.yv').viewer;"
        "end(await choose(links[1])); await until(began); const first = chosen.querySelector('.yv');"
        "end(await choose(links[2])); await until(() => began() && chosen.querySelector('.yv') !== first);"
        "window.Response = Plain; for (const go of unpacking) go();"
        "await until(() => chosen.querySelector('.yv-ready'));"
        "return [chosen.querySelectorAll('.yv').length, Boolean(first.viewer)]"
    )
    assert shown == [1, False]
    assert chromium.run(PANELS) == at_first[:1]
