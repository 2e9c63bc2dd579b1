"""The page of a ranking in a browser: its matrix, and the runs that its cells open."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import pytest

from tests.ranking.test_ranking import SMALL
from tests.reports.browser import DESK, HELD, PHONE, Browser
from tests.reports.flaws import flaws_in_print, inaccessible, looks
from yawbench.cli import main
from yawbench.ranking.ranking import load_ranking
from yawbench.ranking.ranking_page import sentence_of_threats

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


def test_threats_are_quoted_where_they_can_be_read(tmp_path):
    ranking = load_ranking(RANKING)
    assert "clearly better" in sentence_of_threats(ranking)
    alone = replace(ranking, path=tmp_path / "ranking.yaml")
    assert sentence_of_threats(alone) == ""
    shutil.copy(RANKING.parent / "threats.yaml", tmp_path)  # without its published levels
    assert "is not known" in sentence_of_threats(alone)


def test_a_cell_shows_its_worst_run_while_the_matrix_stays_in_sight(chromium: Browser, page):
    chromium.open(page, width=1440)
    chromium.wait_for("document.querySelector('.chosen .yv-ready')")
    for cell, runs in (("fuzzy-pid-in-low", ["fuzzy PID"]), ("none-in-low", ["no control", "fuzzy PID"])):
        chromium.run("document.querySelector(`td.cell a[href$='${arguments[0]}']`).click()", cell)
        chromium.wait_for(f"document.querySelector('.ranking').dataset.shown === '{cell}'")
        chromium.wait_for("document.querySelector('.chosen .yv-ready')")
        top = chromium.run("return document.querySelector('.matrix').getBoundingClientRect().top")
        assert 0 <= top < 900
        labels = chromium.run(
            "return document.querySelector('.chosen .yv').viewer.runs.map(({label}) => label.split(',')[0])"
        )
        assert labels == runs  # of a car that was lost, with the best beside
    assert chromium.console() == []
    assert all(one.startswith("file://") for one in chromium.requests())


CHOSEN = (
    "const chosen = document.querySelector('.chosen'), links = [...document.querySelectorAll('td.cell a')];"
)
PANELS = "return document.querySelector('.chosen .yv').viewer.state.panels"


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
