"""Pages in Firefox, opened as files: decoded samples, links, zooms, side files, no request to anywhere."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from tests.reports.browser import Firefox, start_firefox
from tests.reports.made_up import head_of, whole_car
from yawbench.figures.panels import LabelledRun
from yawbench.reports.viewer import carried, embedded, page, write_side

VIEWER = "const viewer = document.querySelector('.yv').viewer;"
READY = "document.querySelector('.yv-ready')"
SETTLED = f"{READY} && {READY}.viewer.wide === {READY}.clientWidth"
"""A scroll bar that appears makes the page narrower, and the viewer draws itself anew."""


@pytest.fixture(scope="module")
def firefox(tmp_path_factory) -> Iterator[Firefox]:
    browser = start_firefox(tmp_path_factory.mktemp("logs"))
    try:
        yield browser
    finally:
        browser.client.quit()


@pytest.fixture(scope="module")
def two(tmp_path_factory) -> Path:
    """The page of two runs."""
    file = tmp_path_factory.mktemp("firefox") / "two.html"
    runs = [LabelledRun("controlled", whole_car()), LabelledRun("off", whole_car(2.0))]
    file.write_text(page(runs), "utf-8")
    return file


@pytest.mark.parametrize("width", [500, 1400])  # Firefox has no narrower windows
def test_the_page_is_drawn_from_the_recorded_samples_without_a_request_or_overflow(firefox, two, width):
    firefox.open(two, width=width)
    firefox.wait_for(READY)
    assert firefox.run("return performance.getEntriesByType('resource').length") == 0
    assert firefox.run("return document.documentElement.scrollWidth - window.innerWidth") <= 0
    panels, inked = firefox.run(
        VIEWER + "const {canvas} = viewer.panels[0].plot.ctx;"
        "const {data} = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height);"
        "return [viewer.panels.length, data.filter((one, i) => i % 4 === 3 && one > 99).length]"
    )
    assert panels == 5
    assert inked > 1000
    name, run = "plant.sideslip", whole_car(2.0)
    samples = firefox.run(VIEWER + "return [...viewer.runs[1].column(arguments[0])]", name)
    span = np.ptp(np.concatenate([whole_car().columns[name], run.columns[name]]))
    assert np.abs(samples - run.columns[name]).max() <= span / 131068 * (1 + 1e-9)


def test_a_link_opened_anew_shows_the_same_picture(firefox, two):
    picture = VIEWER + "return [JSON.stringify(viewer.state), viewer.panels[0].plot.ctx.canvas.toDataURL()]"
    firefox.open(two)
    firefox.wait_for(SETTLED)
    first = firefox.run(picture)
    firefox.run(VIEWER + "viewer.zoomTo([1, 3]); viewer.seek(2.5); viewer.moveCursor(); viewer.remember();")
    zoomed = firefox.run(picture)
    assert first[1] != zoomed[1]
    firefox.client.refresh()
    firefox.wait_for(SETTLED)
    assert firefox.run(picture) == zoomed


def test_a_side_file_opens_its_run(firefox, tmp_path):
    run = whole_car()
    write_side(tmp_path, "cell", carried([LabelledRun("worst", run)]))
    matrix = "<table class='matrix'><tr><td class='cell'><a href='#cell?id=cell'>0/1</a></td></tr></table>"
    chosen = f"<div class='chosen'><p class='details'></p><template>{embedded(None, 'run')}</template></div>"
    content = f"<div class='choosing' data-folder='data' data-first='cell'>{matrix}{chosen}</div>"
    (tmp_path / "page.html").write_text(f"{head_of('cells', 'chooser.js')}<main>{content}</main>", "utf-8")
    firefox.open(tmp_path / "page.html")
    firefox.wait_for(f"document.querySelector('.chosen') && {READY}")
    assert firefox.run(VIEWER + "return viewer.runs[0].rows") == run.time.size
    names = firefox.run("return performance.getEntriesByType('resource').map((one) => one.name)")
    assert all(name.startswith("file://") for name in names)
