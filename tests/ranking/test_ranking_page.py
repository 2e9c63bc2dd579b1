"""A small ranking that is driven: its tables, and its page in a browser, with the runs that cells open."""

from __future__ import annotations

import contextlib
import io
import json
import shutil
from dataclasses import replace
from math import degrees
from pathlib import Path
from types import SimpleNamespace
from xml.etree import ElementTree

import pytest

from tests.command_line import status_of
from tests.ranking.test_ranking import SMALL, rows
from tests.refusals import mentions
from tests.reports.browser import DESK, HELD, PHONE, Browser
from tests.reports.flaws import flaws_in_print, inaccessible, looks
from yawbench.ranking.ranking import load_ranking
from yawbench.ranking.ranking_page import sentence_of_threats

RANKING = Path(__file__).parents[2] / "scenarios/proving_ground/ranking.yaml"


@pytest.fixture(scope="module")
def driven(tmp_path_factory) -> SimpleNamespace:
    """Two controllers in two conditions, one driven after the other; what was told and written meanwhile."""
    folder = tmp_path_factory.mktemp("ranking")
    file, out = folder / "small.yaml", folder / "out"
    file.write_text(SMALL)
    told, printed, tables = [], [], []
    for only in (("--only", "fuzzy_pid"), ()):
        said, shown = io.StringIO(), io.StringIO()
        with contextlib.redirect_stderr(said), contextlib.redirect_stdout(shown):
            assert status_of("rank", file, "--out", out, "--jobs", 1, *only) == 0
        told.append(said.getvalue())
        printed.append(shown.getvalue())
        tables.append(rows(out / "table.csv"))
        if only:
            assert mentions((out / "report.html").read_text(), "build", "control")
    return SimpleNamespace(file=file, out=out, told=told, printed=printed, tables=tables)


@pytest.fixture(scope="module")
def page(driven) -> Path:
    return driven.out / "report.html"


def test_entries_that_were_not_asked_for_are_not_printed_but_counted(driven):
    title = load_ranking(driven.file).entries["none"][0].title
    some, every = driven.printed
    assert title in every and title not in some
    assert mentions(some, "1 entry", "--only") and "missing" not in some
    assert "--only" not in every


def test_a_small_matrix_goes_on_where_it_was_and_shows_what_is_missing(driven):
    first, found = driven.tables
    assert "missing" not in driven.told[0]
    assert [(one["entry"], one["place"]) for one in first] == [("fuzzy_pid", "1"), ("none", "")]
    assert mentions(driven.told[1], "4 runs", "2", "finished")
    placed = [(one["entry"], one["place"], one["passed"]) for one in found]
    assert placed == [("fuzzy_pid", "1", "2"), ("none", "1", "0")]
    assert found[0] == first[0]  # what has been made is not made again
    cells = [(one["entry"], one["state"]) for one in rows(driven.out / "cells.csv")]
    assert sorted(cells) == 2 * [("fuzzy_pid", "passed")] + 2 * [("none", "failed")]
    assert 0 < float(found[0]["step_time [s]"]) < 0.005
    held, free = (float(one["intervention [N.m.s]"]) for one in found)
    assert free < 0.001 * held  # what the engine's lag leaves of the driver's force


def test_every_cell_of_the_matrix_opens_its_worst_run(driven, page):
    assert len(rows(driven.out / "runs.csv")) == 4
    assert 'href="#cell?id=fuzzy-pid-in-low"' in page.read_text()
    sides = {path.stem: path.read_text() for path in (driven.out / "data").glob("*.js")}
    assert set(sides) == {f"{entry}-in-{name}" for entry in ("fuzzy-pid", "none") for name in ("dry", "low")}
    content = json.loads(sides["none-in-low"].partition(", ")[2].rstrip(");\n"))
    run, *_ = content["data"]["runs"]  # then the best of those that hold the car
    assert {"x", "y", "yaw"} <= set(run["road"])  # what the car on the road needs
    assert lost_run(driven)["verdict"] in content["html"]
    assert mentions(content["html"], "sine-with-dwell", "drive")


def test_answers_and_verdicts_for_other_programs_are_those_of_the_matrix(driven, page, tmp_path, yawbench):
    again = ("rank", driven.file, "--out", driven.out, "--no-run")
    status, said, _ = yawbench(*again, "--json")
    answer = json.loads(said)
    assert status == 0 and (answer["page"], answer["folder"]) == (str(page), str(driven.out))
    places = {entry["entry"]: entry["place"] for entry in answer["entries"]}
    assert places == {"fuzzy_pid": 1, "none": 1}
    assert yawbench(*again, "--strict", "--junit", tmp_path / "verdicts.xml")[0] == 1
    root = ElementTree.parse(tmp_path / "verdicts.xml").getroot()
    assert (root.get("tests"), root.get("failures"), root.get("errors")) == ("4", "2", "0")
    slip = degrees(float(lost_run(driven)["sideslip [rad]"]))
    assert mentions(root.find(".//testcase[@name='low']/failure").get("message"), f"{slip:.3g}")


def lost_run(driven) -> dict[str, str]:
    every = rows(driven.out / "runs.csv")
    (lost,) = (one for one in every if (one["entry"], one["condition"]) == ("none", "low"))
    return lost


def opened(chromium: Browser, page: Path, width: int = DESK) -> None:
    chromium.open(page, width=width)
    chromium.wait_for("document.querySelector('.chosen .yv-ready')")


@pytest.mark.parametrize(("width", "colours"), looks(PHONE, DESK, narrow=True))
def test_the_first_cell_is_open_and_all_of_it_can_be_read_by_everyone(
    chromium: Browser, page, width, colours
):
    opened(chromium, page, width)
    assert chromium.console() == []
    assert chromium.overflow() <= 0
    assert chromium.run("return document.querySelectorAll('main').length") == 1
    assert inaccessible(chromium, colours) == []
    assert flaws_in_print(chromium) == []


def test_threats_are_quoted_where_they_can_be_read(tmp_path):
    ranking = load_ranking(RANKING)
    assert "clearly better" in sentence_of_threats(ranking)
    alone = replace(ranking, path=tmp_path / "ranking.yaml")
    assert sentence_of_threats(alone) == ""
    shutil.copy(RANKING.parent / "threats.yaml", tmp_path)  # without its published levels
    assert "is not known" in sentence_of_threats(alone)


def test_a_cell_shows_its_worst_run_while_the_matrix_stays_in_sight(chromium: Browser, page):
    opened(chromium, page)
    for cell, runs in (("fuzzy-pid-in-low", ["fuzzy PID"]), ("none-in-low", ["no control", "fuzzy PID"])):
        chromium.run("document.querySelector(`td.cell a[href$='${arguments[0]}']`).click()", cell)
        chromium.wait_for(f"document.querySelector('.ranking').dataset.shown === '{cell}'")
        chromium.wait_for("document.querySelector('.chosen .yv-ready')")
        top, heading, bar = chromium.run(
            "const box = (name) => document.querySelector(name).getBoundingClientRect();"
            "return [box('.matrix').top, box('.chosen h2').top, box('nav.top').bottom]"
        )
        assert 0 <= top < 900 and heading >= bar  # which is not behind the links at the top
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
    opened(chromium, page)
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
