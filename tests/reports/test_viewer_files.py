"""What the viewer saves, what it draws of hidden runs, and the digits that it knows."""

from __future__ import annotations

import csv
import io
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.reports.made_up import whole_car
from tests.reports.test_viewer import VIEWER, opened, written
from yawbench.figures.panels import LabelledRun
from yawbench.reports.viewer_samples import COARSE
from yawbench.reports.viewer_views import Bound, Mark, View

A, B, C = "no control", "fuzzy, new", "third/law"
SAVED = (
    VIEWER + "const names = [], create = document.createElement.bind(document);"
    "document.createElement = (tag) => { const one = create(tag); if (tag === 'a') {"
    "  one.click = () => names.push(one.download); } return one; };"
    "viewer.find('csv').click(); viewer.find('svg').click();"
    "viewer.find('png').click(); const done = arguments[arguments.length - 1];"
    "const look = () => names.length === 3 ? done(names) : requestAnimationFrame(look); look();"
)
WORDS = (
    VIEWER + "const said = [], old = CanvasRenderingContext2D.prototype.fillText;"
    "CanvasRenderingContext2D.prototype.fillText = function (words, ...at) { said.push([words, ...at]); };"
    "const sheet = viewer.picture(); CanvasRenderingContext2D.prototype.fillText = old;"
    "return [said, sheet.width];"
)


def tiny(results, size: float = 1e-7):
    """Return a run whose sideslip is next to nothing in its second half."""
    late = results.time > 0.5 * results.time[-1]
    small = np.where(late, size * np.sin(50.0 * results.time), results["plant.sideslip"])
    return replace(results, columns={**results.columns, "plant.sideslip": small})


@pytest.fixture(scope="module")
def three(tmp_path_factory) -> Path:
    """A page of three runs; the second has instants and limits of its own."""
    runs = [LabelledRun(A, whole_car()), LabelledRun(B, whole_car(2.0)), LabelledRun(C, tiny(whole_car(0.5)))]
    return written(
        tmp_path_factory.mktemp("files"), *runs, views=[View(panels=("sideslip", "yaw_rate"))],
        marks=[Mark(1.0, "beginning", 1)], limits=[Bound("yaw_rate", 9.0, "too much", 1)],
    )  # fmt: skip


def test_files_of_runs_are_named_by_the_page_alone(chromium, three):
    opened(chromium, three)
    assert chromium.driver.execute_async_script(SAVED) == ["run.csv", "run.svg", "run.png"]
    words = [text for text, *_ in chromium.run(WORDS)[0]]
    assert words[:3] == [A, B, C] and not any("minus" in text for text in words)


@pytest.mark.parametrize("shown", [[0, 1, 2], [1, 2]])
def test_files_of_a_difference_say_so(shown, chromium, three):
    opened(chromium, three, f"run?difference=true&shown={shown}".replace(" ", ""))
    drawn = [label for k, label in enumerate((A, B, C)) if k in shown and k]
    for name, suffix in zip(
        chromium.driver.execute_async_script(SAVED), (".csv", ".svg", ".png"), strict=True
    ):
        assert name.startswith("run_") and name.endswith(f"minus_no_control{suffix}")
        assert "/" not in name and "fuzzy,_new" in name
    said, wide = chromium.run(WORDS)
    title, *legend = (text for text, *_ in said[: 1 + len(drawn)])
    assert title == f"{', '.join(drawn)} minus {A}"
    assert legend == [f"{label} minus {A}" for label in drawn]  # the baseline is not drawn
    headings = [text for text, *_ in said[1 + len(drawn) :] if " in °" in text]
    assert len(headings) == 2 and all(text.endswith(f"minus {A}") for text in headings)
    assert all(x < wide for _, x, *_ in said)
    rows = [*csv.DictReader(io.StringIO(chromium.run(VIEWER + "return viewer.csv()")))]
    assert {row["run"] for row in rows} == {f"{label} minus {A}" for label in drawn}
    of_b = [row for row in rows if row["run"].startswith(B)]
    expected = whole_car(2.0)["plant.yaw_rate"] - whole_car()["plant.yaw_rate"]
    values = [float(row["plant.yaw_rate [rad/s]"]) for row in of_b]
    step = np.ptp([whole_car(2.0)["plant.yaw_rate"].max(), whole_car(2.0)["plant.yaw_rate"].min()]) / COARSE
    np.testing.assert_allclose(values, expected, atol=2.0 * step)
    assert "reference.yaw_rate_ref [rad/s]" not in rows[0]


DASHED = (
    VIEWER + "const panel = viewer.panels.find((one) => one.spec.startsWith('plant.yaw_rate'));"
    "const c = panel.plot.ctx; let count = 0; c.setLineDash = (dash) => { count += dash.length > 0; };"
    "panel.above(c, panel.frame, 1); delete c.setLineDash;"
    "return [count, panel.heights(panel.shown, panel.meaning.factor)[1]];"
)


def test_hiding_a_run_takes_its_lines_car_instants_and_limits_along(chromium, three):
    opened(chromium, three)
    drawn = VIEWER + "return viewer.panels[1].shown.filter((one) => !one.reference).map(({run}) => run.label)"
    assert chromium.run(drawn) == [A, B, C]
    count, high = chromium.run(DASHED)
    assert count == 2 and high > np.degrees(9.0)
    chromium.run("document.querySelectorAll('.yv-show')[1].click()")
    count, high = chromium.run(DASHED)
    assert count == 0 and high < np.degrees(9.0)
    assert chromium.run(drawn) == [A, C]
    assert chromium.run("return document.querySelectorAll('.yv-closeups figure').length") == 2
    chromium.run("document.querySelectorAll('.yv-show')[1].click()")
    assert chromium.run(DASHED)[0] == 2


AT = VIEWER + (
    "return arguments[0].flatMap((time) => { viewer.state.time = time; viewer.moveCursor();"
    "return [...viewer.panels[0].body.rows].map((row) => row.cells[1].textContent); });"
)


@pytest.mark.parametrize(
    "fragment", ["", "run?difference=true", 'run?panels=["plant.sideslip - plant.yaw_rate"]']
)
def test_values_at_the_cursor_have_no_digits_finer_than_the_samples(fragment, chromium, three):
    opened(chromium, three, fragment)
    ranges = [np.ptp([f(run[name]) for run in (whole_car(), whole_car(2.0)) for f in (np.max, np.min)])
              for name in ("plant.sideslip", "plant.yaw_rate")]  # fmt: skip
    times = whole_car().time
    step = np.degrees(ranges[0]) / COARSE
    cells = chromium.run(AT, times[times > 0.6 * times[-1]][::40].tolist())
    texts = [text for text in cells if text not in ("–", "0")]
    assert texts
    for text in texts:
        decimals = len(text.partition(".")[2].partition("e")[0])
        unit = 10.0 ** (int((text.partition("e")[2] or "0").replace("−", "-")) - decimals)
        assert unit >= 0.99 * step, text
