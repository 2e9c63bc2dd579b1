"""Pages of sweeps and rankings in a browser: what they count, draw, open and remember."""

from __future__ import annotations

import csv
import json
import shutil
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from tests.bench.test_serve import serving
from tests.command_line import status_of
from tests.reports.browser import DESK, PHONE, Browser
from tests.reports.flaws import SCREENS, check_first_screen, flaws, flaws_in_print, inaccessible, looks
from tests.reports.made_up import HALF_A_CAR
from yawbench.orchestrator.results.reader import load_results

UNITS = ("driver_sine", "reference_single_track")

SWEEP = """
title: How far may it be steered?
scenario: half.yaml
axes:
  speed: {vary: inputs.velocity_x, from: 10, to: 40, count: 4, says: Speed}
  amplitude: {vary: driver.amplitude, from: 1, to: 5, count: 5, unit: deg, says: Steering}
  wave: {vary: driver.frequency, values: {0.5: slow, 1: fast}}
metrics:
  rate: {metric: peak(yaw_rate_ref), heading: Largest reference}
  steer: {metric: peak(steer_angle)}
limits:
  calm: {says: Most steering below 12 deg/s, of: amplitude, holds_if: [{metric: rate, at_most: 12 deg/s}]}
"""
TEXTS = """
const texts = [...document.querySelectorAll(`${arguments[0]} svg text`)].filter((one) => one.textContent);
const boxes = texts.map((one) => [one.textContent, one.getBoundingClientRect()]);
const across = (a, b) => Math.min(a.right, b.right) - Math.max(a.left, b.left);
const down = (a, b) => Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top);
return boxes.flatMap(([text, a], k) => boxes.slice(k + 1)
  .filter(([, b]) => across(a, b) > -1 && down(a, b) > 4).map(([other]) => `${text} / ${other}`));
"""
VIEW = "const view = document.querySelector('.ys').sweep;"
MOST_ELEMENTS = 2000


def swept(folder: Path, fmus: Path, text: str, *options: str) -> SimpleNamespace:
    """Return the page of a sweep, its folder and the rows of its table."""
    (folder / "half.yaml").write_text(HALF_A_CAR)
    (folder / "sweep.yaml").write_text(text)
    out = folder / "out"
    status_of("sweep", folder / "sweep.yaml", *options, "--out", out, "--fmus", fmus)
    rows = list(csv.DictReader((out / "table.csv").open()))
    return SimpleNamespace(page=out / "report.html", folder=out, rows=rows)


@pytest.fixture(scope="module")
def sweep(tmp_path_factory, fmus) -> SimpleNamespace:
    """A sweep of 40 runs."""
    return swept(tmp_path_factory.mktemp("sweep"), fmus, SWEEP)


def opened(chromium: Browser, page: Path, fragment: str = "", **size) -> None:
    chromium.open(page, fragment, **size)
    chromium.wait_for("document.querySelector('.ys-ready')")


@pytest.mark.parametrize(("width", "colours"), looks(PHONE, DESK, narrow=False))
def test_the_page_is_drawn_at_every_width_within_its_budgets(chromium, sweep, width, colours):
    opened(chromium, sweep.page, width=width)
    assert flaws(chromium) == []
    assert chromium.run(TEXTS, ".ys-map") == chromium.run(TEXTS, ".ys-lines") == []
    assert chromium.run("return document.querySelectorAll('*').length") <= MOST_ELEMENTS
    assert sweep.page.stat().st_size < 500_000
    chromium.run(VIEW + "view.open(view.data.sides.indexOf(true))")
    chromium.wait_for("document.querySelector('.ys-run .yv-ready')")
    assert inaccessible(chromium, colours) == []
    assert flaws_in_print(chromium) == []


@pytest.mark.parametrize(("width", "height"), SCREENS)
def test_the_answer_and_the_map_are_on_the_first_screen(chromium, sweep, width, height):
    check_first_screen(chromium, sweep.page, width, height)


def test_numbers_in_the_cells_and_every_count_are_those_of_the_table(chromium, sweep):
    opened(chromium, sweep.page)
    rates = {int(row["run"]): float(row["rate [rad/s]"]) for row in sweep.rows}
    cells = chromium.run(
        VIEW + "return view.places.map(({cell}) => [cell.rows[0] + 1, view.inCell(cell.value), cell.within])"
    )
    drawn = chromium.run(
        "return [...document.querySelectorAll('.ys-map svg > text')].map((t) => t.textContent)"
    )
    assert len(cells) == len(sweep.rows) == 40
    for run, text, within in cells:
        assert float(text) == pytest.approx(np.degrees(rates[run]), abs=0.051)
        assert text in drawn
        assert within == (np.degrees(rates[run]) <= 12)
    held = sum(np.degrees(rate) <= 12 for rate in rates.values())
    assert 0 < held < 40
    counts = chromium.run("return document.querySelector('.ys-counts').textContent")
    assert counts.startswith("40 runs: 40 completed.")
    assert f"{held} of 40 within 12" in counts


def test_a_moved_limit_and_a_brush_choose_the_runs_that_the_table_says(chromium, sweep):
    opened(chromium, sweep.page)
    rates = [np.degrees(float(row["rate [rad/s]"])) for row in sweep.rows]
    speeds = [float(row[next(k for k in row if k.startswith("speed"))]) for row in sweep.rows]
    chromium.run(VIEW + "view.find('bound').value = 9; view.find('bound').dispatchEvent(new Event('change'))")
    axis = chromium.driver.find_element("css selector", ".ys-axis[data-dim=speed]")
    chromium.run("arguments[0].focus()", axis)
    chromium.press("\ue015")  # arrow down: below the largest speed
    chosen = [k for k, speed in enumerate(speeds) if speed <= 30]
    assert chromium.run(VIEW + "return view.visible") == chosen
    held = sum(rates[k] <= 9 for k in chosen)
    text = chromium.run("return document.querySelector('.ys-chosen').textContent")
    assert text.startswith(f"{len(chosen)} of 40 chosen; {held} of {len(chosen)} within 9")
    assert chromium.run("return document.activeElement.dataset.dim") == "speed"
    head, *lines = csv.reader(chromium.run(VIEW + "return view.csv()").splitlines())
    assert [line[head.index("key")] for line in lines] == [sweep.rows[k]["key"][:12] for k in chosen]
    chromium.press("\ue017")  # Delete
    assert chromium.run(VIEW + "return view.visible.length") == 40


def test_a_click_on_a_cell_opens_its_run_with_the_recorded_samples(chromium, sweep):
    opened(chromium, sweep.page)
    kept = chromium.run(VIEW + "return view.rows.filter((row) => view.data.sides[row])")
    assert 0 < len(kept) < 40
    row = kept[0]
    x, y = chromium.run(
        VIEW + "const svg = view.find('map').querySelector('svg').getBoundingClientRect();"
        "const {px, py, w, h} = view.places.find(({cell}) => cell.rows.includes(arguments[0]));"
        "return [svg.left + px + w / 2, svg.top + py + h / 2]",
        row,
    )
    for kind in ("mousePressed", "mouseReleased"):
        event = {"type": kind, "x": x, "y": y, "button": "left", "clickCount": 1}
        chromium.driver.execute_cdp_cmd("Input.dispatchMouseEvent", event)
    chromium.wait_for("document.querySelector('.ys-run .yv-ready')")
    assert row in chromium.run(VIEW + "return view.state.open")
    place = chromium.run(VIEW + "return view.state.open.filter((k) => view.data.sides[k])").index(row)
    results = load_results(sweep.folder / "runs" / sweep.rows[row]["key"][:12])
    name, exact = next(iter(results.columns.items()))
    values = chromium.run(
        "return [...document.querySelector('.ys-run .yv').viewer.runs[arguments[0]].column(arguments[1])]",
        place, name,
    )  # fmt: skip
    assert values == pytest.approx(exact, abs=np.ptp(exact) / 131_068 + 1e-12)
    title = chromium.run("return document.querySelector('.ys-run > h3').textContent")
    assert f"Run {row + 1}," in title
    assert chromium.console() == []
    assert all(one.startswith("file://") for one in chromium.requests())


def test_the_keys_go_from_cell_to_cell_and_open_a_run_or_show_its_command(chromium, sweep):
    opened(chromium, sweep.page)
    chromium.run("document.querySelector('.ys-map').focus()")
    chromium.press("\ue014", "\ue014", "\ue013")  # right, right, up
    row = chromium.run(VIEW + "return view.row")
    assert f"Run {row + 1}," in chromium.run("return document.querySelector('.ys-told').textContent")
    missing = chromium.run(VIEW + "return view.data.sides.indexOf(false)")
    chromium.run(VIEW + "view.point(arguments[0])", missing)
    chromium.press("\ue007")  # Enter
    command = chromium.run("return document.querySelector('.ys-remark pre').textContent")
    level = next(value for key, value in sweep.rows[missing].items() if key.startswith("speed"))
    assert command.startswith("yawbench run ")
    assert f"inputs.velocity_x={float(level):g}" in command.replace(".0 ", " ")


def test_a_link_shows_the_same_runs_limit_and_brush_again(chromium, sweep):
    opened(chromium, sweep.page)
    key = chromium.run(VIEW + "return view.key")
    kept = chromium.run(VIEW + "return view.data.sides.indexOf(true)")
    state = {"limit": 8, "brush": {"speed": [10, 30]}, "open": [kept]}
    words = "&".join(f"{name}={json.dumps(value)}" for name, value in state.items())
    opened(chromium, sweep.page, f"{key}?{words}")
    chromium.wait_for("document.querySelector('.ys-run .yv-ready')")
    assert chromium.run(VIEW + "return [view.state.limit, view.state.brush, view.state.open]") == [
        *state.values()
    ]
    before = chromium.run("return document.querySelector('.ys-charts').innerHTML")
    chromium.run(VIEW + "view.remember()")
    chromium.reload()
    chromium.wait_for("document.querySelector('.ys-run .yv-ready')")
    assert chromium.run("return document.querySelector('.ys-charts').innerHTML") == before


def test_a_missing_side_file_is_said_on_the_page(chromium, sweep, tmp_path):
    opened(chromium, Path(shutil.copy(sweep.page, tmp_path)))
    chromium.run(VIEW + "view.open(view.data.sides.indexOf(true))")
    chromium.wait_for("document.querySelector('.ys-remark p')")
    assert "is missing" in chromium.run("return document.querySelector('.ys-remark').textContent")
    chromium.console()  # the browser names the file, too


def test_runs_that_were_not_made_are_not_shown_as_failures(chromium, tmp_path, fmus):
    opened(chromium, swept(tmp_path, fmus, SWEEP, "--no-run").page)
    cells = chromium.run(VIEW + "return view.cells().map((cell) => [view.label(cell), cell.within])")
    assert {tuple(cell) for cell in cells} == {("–", True)}
    text = chromium.run("return document.querySelector('main').innerText")
    assert "unknown, as no run was made" in text
    assert "at no value tried" not in text


def test_the_server_shows_the_page_and_what_it_opens(chromium, sweep):
    with serving(sweep.folder) as server:
        chromium.open(Path("/"))
        chromium.driver.get(server.address)
        chromium.console()
        chromium.run("document.querySelector('a[href=\"files/report.html\"]').click()")
        chromium.wait_for("document.querySelector('.ys-ready')")
        chromium.run(VIEW + "view.open(view.data.sides.indexOf(true))")
        chromium.wait_for("document.querySelector('.ys-run .yv-ready')")
        assert chromium.console() == []
        assert chromium.run("return origin") == "null"


SAMPLE = """
title: How sure is it?
scenario: half.yaml
design: latin_hypercube
points: 12
seed: 1
axes:
  speed: {vary: inputs.velocity_x, from: 10, to: 40, says: Speed}
  amplitude: {vary: driver.amplitude, normal: {mean: 3, deviation: 0.5}, unit: deg, says: Steering}
  start: {vary: driver.start_time, from: 0.01, to: 0.1, spacing: log}
  wave: {vary: driver.frequency, values: {0.5: slow, 1: fast}}
metrics:
  rate: {metric: peak(yaw_rate_ref), heading: Largest reference}
"""


def test_the_page_of_a_hypercube_shows_all_its_points_where_they_lie(chromium, tmp_path, fmus):
    sample = swept(tmp_path, fmus, SAMPLE)
    opened(chromium, sample.page)
    assert chromium.console() == []
    places = chromium.run(
        VIEW + "return view.places.map(({cell, px, py, map}) => [cell.rows[0], px, py, map])"
    )
    assert sorted(row for row, *_ in places) == list(range(24))
    for panel in (0, 1):
        mine = [place for place in places if place[3] == panel]
        assert len(mine) == 12
        for column, k, way in (("speed [m/s]", 1, 1), ("amplitude [rad]", 2, -1)):
            values = [way * float(sample.rows[place[0]][column]) for place in mine]
            assert np.argsort(values).tolist() == np.argsort([place[k] for place in mine]).tolist()
    assert chromium.run(TEXTS, ".ys-map") == []
    assert chromium.run("return [...document.querySelectorAll('.ys-panel option')].map((o) => o.value)") == [
        "",
        "wave",
    ]
