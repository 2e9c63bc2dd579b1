"""The page of a fit: what it says is what fit.json holds, what it draws is what was measured."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from lxml import html

from tests.measured_cars.test_fit import TRUTH, folder, run
from tests.reports.browser import DESK, PHONE, Browser
from tests.reports.flaws import check_whole, looks
from tests.reports.made_up import data_in, unpacked
from yawbench.figures.display import shown
from yawbench.measured_cars.fit_file import load_fit

VIEWER = "const viewer = document.querySelector('.yv').viewer;"
__all__ = ["folder"]


@pytest.fixture(scope="module")
def page(folder: Path) -> Path:
    """The page that `yawbench fit` writes."""
    assert run("fit", folder / "fit.yaml", "--out", folder / "page", "--jobs", "1") == 0
    return folder / "page" / "fit.html"


def test_every_number_of_its_tables_is_that_of_the_file(page):
    data = json.loads(page.with_name("fit.json").read_text(encoding="utf-8"))
    tree = html.fromstring(unpacked(page))
    scores, *tables = tree.cssselect("main table:not(.yv *)")
    rows = [[cell.text_content().strip() for cell in row] for row in scores.cssselect("tbody tr")]
    wanted = [(name, title) for name in ("yaw_rate", "acceleration_y") for title in data["models"]]
    assert [tuple(row[:2]) for row in rows] == wanted
    for (name, title), row in zip(wanted, rows, strict=True):
        unit = {"yaw_rate": "rad/s", "acceleration_y": "m/s2"}[name]
        for part, cells in (("training", row[2:5]), ("held_out", row[5:8])):
            score = data["models"][title]["scores"][part][name]
            texts = [shown(score["rms"], unit), shown(score["largest"], unit), f"{score['fit']:.1f} %"]
            assert cells == texts
    assert len(tables[0].cssselect("tbody tr")) == len(TRUTH)
    said = tree.xpath("string(//p[@class='said'])")
    assert tables[0].getnext().text_content().count("no intervals: 1 piece of 5 s, fewer than 5") == 1
    assert "kg·m2" in tables[0].text_content()
    assert [table.findtext("caption") for table in tables[2:]] == [  # its speed is the same all the time
        "Rms differences over |acceleration_y|, held-out windows"
    ]
    assert said[:1].lower() + said[1:].rstrip(".") == data["verdict"]


def test_decoded_samples_equal_the_measured_ones(chromium: Browser, folder, page):
    fit = load_fit(folder / "fit.yaml")
    chromium.open(page)
    chromium.wait_for("document.querySelector('.yv-ready')")
    windows = [each.window for each in (*fit.training, *fit.held_out)]
    rng = np.random.default_rng(3)
    for _ in range(20):
        window = windows[int(rng.integers(len(windows)))]
        name = ("yaw_rate", "acceleration_y")[int(rng.integers(2))]
        row = int(rng.integers(1, window.times.size - 1))
        value, spread = chromium.run(
            VIEWER + "const column = (run) => run.column(`plant.${arguments[0]}`);"
            "const all = viewer.runs.flatMap((run) => [...column(run)]);"
            "return [viewer.runs[0].at(`plant.${arguments[0]}`, arguments[1]),"
            " Math.max(...all) - Math.min(...all)];",
            name,
            float(window.times[row]),
        )
        assert abs(value - window.measured[name][row]) <= spread / 131068 * (1 + 1e-9)


def test_its_views_are_histories_and_cross_plots_of_the_car_and_both_models(page):
    data = data_in(page.read_text(encoding="utf-8"))
    assert [view["x"] for view in data["views"]] == ["time", "plant.acceleration_y"]
    assert data["runs"][0]["label"] == "made up" and len(data["runs"]) == 3


@pytest.mark.parametrize(("width", "colours"), looks(PHONE, DESK, narrow=False))
def test_the_page_has_no_flaws_and_stays_within_its_budget(chromium: Browser, page, width, colours):
    check_whole(chromium, page, width, colours)
