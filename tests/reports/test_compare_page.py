"""The page of a comparison, from the command line to the browser."""

from __future__ import annotations

from pathlib import Path

import pytest
from lxml import html

from tests.command_line import status_of
from tests.fmu_copies import put_fmus
from tests.refusals import each_mentions, mentions
from tests.reports.browser import DESK, PHONE
from tests.reports.flaws import check_whole, looks, open_all, size_without_samples
from tests.reports.made_up import data_in, texts, unpacked

ROOT = Path(__file__).parents[2]
UNITS = (
    "driver_sine", "reference_single_track", "controller_off", "controller_fuzzy_feedback", "plant_two_dof",
    "tyre_magic_formula_1987",
)  # fmt: skip


@pytest.fixture(scope="module")
def page(tmp_path_factory) -> Path:
    """The page that `yawbench compare` writes of paper D's scenario with three controllers."""
    folder = tmp_path_factory.mktemp("compare")
    put_fmus(folder / "fmus", components=UNITS)
    fuzzy = "controller_fuzzy_feedback"
    swaps = f"controller=controller_off,{fuzzy},{fuzzy}:rule_table=gentle"
    given = ("--set", "stop_time=3", "--swap", swaps, "--fmus", folder / "fmus", "--format", "parquet")
    scenario = ROOT / "scenarios/fuzzy_feedback/single_sine.yaml"
    assert status_of("compare", scenario, *given, "--out", folder / "out") == 0
    assert [path.suffix for path in folder.glob("out/*/results.*")] == [".parquet"] * 3
    return folder / "out" / "report.html"


@pytest.fixture(scope="module")
def tree(page):
    return html.fromstring(unpacked(page))


def test_metrics_stand_side_by_side_with_their_difference_from_the_first(tree):
    fuzzy = "controller_fuzzy_feedback"
    (table,) = tree.cssselect("table.first-free")
    assert texts(table, "thead th")[2:] == ["controller_off †", fuzzy, f"{fuzzy} rule_table=gentle"]
    rows = {row[0].text_content(): row for row in table.cssselect("tbody tr")}
    cells = [" ".join(cell.text_content().split()) for cell in rows["Yaw moment: peak"][2:]]
    assert cells[0] == "0 N·m"
    value, _, difference = cells[1].partition(" N·m")
    assert float(value) > 1000
    assert difference == f"+{value} N·m"


def test_it_tells_what_was_changed_and_where_the_runs_part(tree):
    assert mentions(texts(tree, "h1"), "controller", "stop_time = 3 s")
    headings = [text for text in texts(tree, "h3") if " against " in text]
    assert len(headings) == 2
    said = tree.text_content()
    assert mentions(" ".join(said.split()), "controller.yaw_moment", "0.505 s")


def test_it_shows_the_system_its_parameters_and_how_to_repeat_it(tree):
    chapters = (("Metrics",), ("differ",), ("system",), ("Parameters",), ("reproduce",))
    assert each_mentions([text.partition(":")[0] for text in texts(tree, "h2")], *chapters)
    assert len(tree.cssselect(".system svg")) == 1
    assert "controller_fuzzy_feedback" in " ".join(texts(tree, ".system svg text"))
    assert len(tree.cssselect(".fmus td:last-child")) == len(UNITS)
    (command,) = texts(tree, "pre")
    assert command.startswith("yawbench compare ")
    assert mentions(
        command,
        "single_sine.yaml",
        "--swap controller=controller_off",
        "controller_fuzzy_feedback",
        "rule_table=gentle",
        "--set stop_time=3",
    )


@pytest.mark.parametrize(("width", "colours"), looks(PHONE, 768, DESK, narrow=False))
def test_nothing_is_cut_overlapping_or_empty_at_any_width(chromium, page, width, colours):
    check_whole(chromium, page, width, colours)


def test_the_viewer_comes_first_with_the_signals_that_differ_most(chromium, page):
    chromium.open(page, calm=False)
    chromium.wait_for("document.querySelector('.yv-ready')")
    assert chromium.run("return document.querySelector('.yv').getBoundingClientRect().top") < 250
    text = page.read_text(encoding="utf-8")
    data = data_in(text)
    rows = [run["rows"] for run in data["runs"]]
    assert rows == 3 * [3001]
    assert len(text.encode()) - size_without_samples(text) <= 15 * sum(rows)
    first, *others = data["views"]
    assert mentions(first["title"], "signals")
    assert len(first["panels"]) == 6 and first["shown"] == [0, 1, 2]
    assert others
    chromium.run("document.querySelector('.yv-play').click()")
    chromium.wait_for("document.querySelector('.yv').viewer.state.time > 0.02")
    assert chromium.console() == []


def test_on_a_phone_tables_become_cards_but_for_those_of_the_viewer(chromium, page):
    chromium.open(page, width=PHONE)
    display = "return getComputedStyle(document.querySelector(arguments[0])).display"
    assert chromium.run(display, "table.first-free tbody tr") == "block"
    assert chromium.run(display, ".yv-runs td") == "table-cell"
    open_all(chromium)
    assert chromium.run(display, "table.parameters td.none") == "none"
    chips = "return [...document.querySelectorAll('.kind.chosen')].map((one) => one.clientWidth)"
    assert max(chromium.run(chips)) < 100
