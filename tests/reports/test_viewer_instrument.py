"""The viewer as an instrument: pin, peaks, zoom, pan, undo, touch, events, claims, pictures."""

from __future__ import annotations

import json
import shlex
from dataclasses import replace
from pathlib import Path
from urllib.parse import quote
from xml.etree import ElementTree

import numpy as np
import pytest

from tests.command_line import status_of
from tests.orchestrator.recorded import noted, write
from tests.refusals import mentions
from tests.reports.browser import PHONE, Browser
from tests.reports.made_up import data_in, whole_car
from tests.reports.test_viewer import VIEWER, chart, drag, opened, written
from yawbench.events.kinds import events_in
from yawbench.figures import plots
from yawbench.figures.panels import LabelledRun
from yawbench.figures.plots import draw
from yawbench.orchestrator.results.reader import Results
from yawbench.reports.phase_planes import PLANES
from yawbench.reports.viewer import LEAST
from yawbench.reports.viewer_views import Mark, View
from yawbench.vocabulary.gravity import G

A, B, C = "no control", "fuzzy", "held"
SHOWN = ("sideslip", "yaw_rate", "acceleration_y")


def spun() -> Results:
    """Return a run whose sideslip grows to its end."""
    run = whole_car()
    return replace(run, columns={**run.columns, "plant.sideslip": np.linspace(0.0, 1.2, run.time.size)})


@pytest.fixture(scope="module")
def three(tmp_path_factory) -> Path:
    """A page of three runs; the first is lost."""
    runs = [LabelledRun(A, spun()), LabelledRun(B, whole_car(2.0)), LabelledRun(C, whole_car(0.5))]
    settings = {"views": [View(panels=SHOWN)], "marks": [Mark(1.0, "begin of B", 1)]}
    return written(tmp_path_factory.mktemp("instrument"), *runs, **settings)


STATE = VIEWER + "viewer.remember(); return viewer.state"


def test_time_axis_and_cursor_time_stay_in_sight(chromium: Browser, three):
    height = 500
    for width in (1400, PHONE):
        opened(chromium, three, width=width, height=height)
        boxes = chromium.run(
            VIEWER + "viewer.panels[1].root.scrollIntoView({block: 'center', behavior: 'instant'});"
            "return ['axis', 'clock'].map((name) => viewer.find(name).getBoundingClientRect())"
            ".map((box) => [box.top, box.bottom])"
        )
        assert all(0 <= top < bottom <= height for top, bottom in boxes), width
        ends = chromium.run(
            VIEWER + "viewer.zoomTo([1, 3]); const {x} = viewer.axis.plot.scales; return [x.min, x.max]"
        )
        assert ends == [1, 3] or chromium.run(VIEWER + "return viewer.span()") == [1, 3]


def test_the_pin_gives_differences_in_time_and_value(chromium: Browser, three):
    opened(chromium, three)
    chromium.run(VIEWER + "viewer.seek(2); viewer.setPin(); viewer.seek(4.5); viewer.moveCursor();")
    assert chromium.run(VIEWER + "return viewer.find('since').textContent") == "2.500 s since 2.000 s"
    lines = chromium.run(
        VIEWER + "const {shown, cells} = viewer.panels[0];"
        "return shown.map(({run, reference}, k) => [run.number, reference, cells[k][1].textContent])"
    )
    run = spun()
    rows = [int(np.argmin(np.abs(run.time - t))) for t in (2.0, 4.5)]
    apart = np.degrees(run["plant.sideslip"][rows[1]] - run["plant.sideslip"][rows[0]])
    (text,) = [text for number, reference, text in lines if number == 0 and not reference]
    assert text.startswith("+") and float(text) == pytest.approx(apart, abs=0.01)
    chromium.run(VIEWER + "viewer.setPin()")
    assert chromium.run(STATE)["pin"] is None


def test_the_peak_is_gone_to_and_one_at_the_end_is_still_growing(chromium: Browser, three):
    opened(chromium, three)
    peak = (
        VIEWER + "viewer.panels[0].root.querySelector('[title^=\"Go to the peak\"]').click();"
        "viewer.moveCursor(); return [viewer.state.time, viewer.panels[0].remark.textContent]"
    )
    time, said = chromium.run(peak)
    assert time == 8 and A in said and said.endswith("still growing")
    time, said = chromium.run(peak)
    run = whole_car(2.0)
    assert time == pytest.approx(run.time[np.argmax(np.abs(run["plant.sideslip"]))], abs=0.011)  # a row
    assert B in said and "growing" not in said
    told = chromium.run(
        "return [...document.querySelectorAll('.yv-metric small')].map((one) => one.textContent)"
    )
    assert told == ["still growing"]


def test_a_drag_upwards_zooms_a_panel_and_undo_and_back_take_it_back(chromium: Browser, three):
    opened(chromium, three)
    before = chromium.run(STATE)
    drag(chromium, 1, (0.5, 0.2), (0.5, 0.7))
    zoomed = chromium.run(STATE)
    ((low, high),) = zoomed["heights"].values()
    assert zoomed["span"] is None and low < high
    chromium.run(VIEWER + "viewer.removePanel(viewer.state.panels[2]); viewer.remember();")
    assert len(chromium.run(STATE)["panels"]) == 2
    chromium.run("document.querySelector('.yv-undo').click()")
    chromium.wait_for("document.querySelector('.yv').viewer.state.panels.length === 3")
    assert chromium.run(STATE)["heights"] == zoomed["heights"]
    chromium.run("history.back()")
    chromium.wait_for("!Object.keys(document.querySelector('.yv').viewer.state.heights).length")
    assert {**chromium.run(STATE), "time": 0} == {**before, "time": 0}
    assert chromium.run("return document.querySelector('.yv-undo').disabled")
    chromium.run("history.forward()")
    chromium.wait_for("Object.keys(document.querySelector('.yv').viewer.state.heights).length")
    chromium.run(VIEWER + "viewer.reset(); viewer.remember();")
    assert {**chromium.run(STATE), "time": 0} == {**before, "time": 0}


def test_a_drag_with_shift_pans(chromium: Browser, three):
    opened(chromium, three)
    chromium.run(VIEWER + "viewer.zoomTo([2, 4])")
    drag(chromium, 0, (0.75, 0.5), (0.25, 0.5), keys=8)
    begin, end = chromium.run(STATE)["span"]
    assert (begin, end) == (pytest.approx(3.0, abs=0.03), pytest.approx(5.0, abs=0.03))


def touch(chromium: Browser, kind: str, *points: tuple[float, float]) -> None:
    chromium.driver.execute_cdp_cmd(
        "Input.dispatchTouchEvent",
        {"type": kind, "touchPoints": [{"x": x, "y": y, "id": k} for k, (x, y) in enumerate(points)]},
    )


def test_one_finger_moves_the_cursor_and_two_pinch(chromium: Browser, three):
    opened(chromium, three, width=PHONE)
    left, top, wide, high = chart(chromium, 1)
    y = top + high / 2
    touch(chromium, "touchStart", (left + 0.25 * wide, y))
    touch(chromium, "touchMove", (left + 0.5 * wide, y))
    touch(chromium, "touchEnd")
    assert chromium.run(STATE)["time"] == pytest.approx(4.0, abs=0.1)
    touch(chromium, "touchStart", (left + 0.4 * wide, y), (left + 0.6 * wide, y))
    touch(chromium, "touchMove", (left + 0.3 * wide, y), (left + 0.7 * wide, y))
    touch(chromium, "touchEnd")
    begin, end = chromium.run(STATE)["span"]
    assert end - begin == pytest.approx(4.0, rel=0.05) and (begin + end) / 2 == pytest.approx(4.0, abs=0.2)


def test_panels_are_moved_enlarged_and_a_new_one_is_scrolled_to(chromium: Browser, three):
    opened(chromium, three, height=500)
    press = VIEWER + 'viewer.panels[arguments[0]].root.querySelector(`[title="${arguments[1]}"]`).click()'
    chromium.run(press, 0, "Move down")
    panels = chromium.run(STATE)["panels"]
    assert [name.split(",")[0] for name in panels[:2]] == ["plant.yaw_rate", "plant.sideslip"]
    height = VIEWER + "return viewer.panels[0].chart.clientHeight"
    low = chromium.run(height)
    chromium.run(press, 0, "Enlarge")
    assert chromium.run(height) > 2 * low
    box = chromium.run(
        "scrollTo(0, 0);" + VIEWER + "const add = viewer.find('add'); add.value = 'velocity_x';"
        "add.dispatchEvent(new Event('change'));"
        "const box = viewer.panels.at(-1).root.getBoundingClientRect(); return [box.top, box.bottom]"
    )
    assert 0 <= box[0] < box[1] <= 500


def test_events_are_listed_marked_and_gone_to_and_hidden_with_their_run(chromium: Browser, three):
    opened(chromium, three)
    chromium.run("document.querySelector('.yv-happened').open = true")
    chromium.wait_for("document.querySelector('.yv-events button')")
    past = next(event for event in events_in(spun()) if event.kind == "sideslip-past")
    marks = VIEWER + "return viewer.panels[0].marks().map(({time, text}) => [time, text])"
    assert [past.time, "sideslip past its bound"] in chromium.run(marks)
    assert [1.0, "begin of B"] in chromium.run(marks)
    why = "return [...document.querySelectorAll('.yv-why li')].map((one) => [one.hidden, one.textContent])"
    ((hidden, text),) = chromium.run(why)
    assert not hidden and text.startswith(f"{A}:") and f"passes 20 degrees at {past.time:.2f} s" in text
    chromium.run(
        "[...document.querySelectorAll('.yv-why a')].at(-1).click();" + VIEWER + "viewer.moveCursor()"
    )
    assert chromium.run(STATE)["time"] == pytest.approx(past.time, abs=1e-6)
    assert chromium.run("return document.querySelector('.yv-why button').textContent") == f"beside {B}"
    chromium.run("document.querySelector('.yv-why button').click()")
    assert chromium.run(STATE)["shown"] == [0, 1]
    chromium.run(VIEWER + "viewer.showRuns([0, 2], 0)")
    assert [1.0, "begin of B"] not in chromium.run(marks)
    chromium.run(VIEWER + "viewer.showRuns([1], 1)")
    assert [past.time, "sideslip past its bound"] not in chromium.run(marks)
    assert chromium.run(why)[0][0]


def test_a_claim_shows_its_signal_with_bound_and_instant(chromium: Browser, three):
    lit = quote(json.dumps(["plant.yaw_rate", 0.2, "Yaw rate: peak ≤ 11.5 °/s"]))
    opened(chromium, three, f"run?shown=[1]&baseline=1&lit={lit}")
    state = chromium.run(STATE)
    run = whole_car(2.0)
    peak = run.time[np.argmax(np.abs(run["plant.yaw_rate"]))]
    assert state["time"] == pytest.approx(peak, abs=1e-6) and state["panels"][0].startswith("plant.yaw_rate")
    said = chromium.run(
        VIEWER + "const [panel] = viewer.panels; return [panel.root.className, panel.remark.textContent,"
        " panel.limits().map(([bound]) => bound)]"
    )
    assert said == ["yv-panel yv-lit", "judged: Yaw rate: peak ≤ 11.5 °/s", [0.2, -0.2]]


def test_every_run_has_its_own_reference(chromium: Browser, tmp_path):
    first, second = whole_car(), whole_car(2.0)
    second.columns["reference.yaw_rate_ref"] = 1.5 * second["reference.yaw_rate_ref"]
    opened(chromium, written(tmp_path, first, second))
    drawn = VIEWER + (
        "const panel = viewer.panels.find(({spec}) => spec.startsWith('plant.' + arguments[0]));"
        "return panel.shown.filter(({reference}) => reference).map(({run}) => run.number)"
    )
    assert chromium.run(drawn, "yaw_rate") == [0, 1]
    assert chromium.run(drawn, "sideslip") == [0]  # the same in both


def test_the_picture_as_svg_has_titles_axis_legend_and_a_line_per_run(chromium: Browser, three):
    opened(chromium, three, "run?difference=true")
    text = chromium.run(VIEWER + "return viewer.drawing()")
    svg = ElementTree.fromstring(text)
    words = [one.text for one in svg.iter("{http://www.w3.org/2000/svg}text")]
    assert words[0] == f"{B}, {C} minus {A}" and "t in s" in words
    lines = [one for one in svg.iter("{http://www.w3.org/2000/svg}path") if len(one.get("d", "")) > 1000]
    assert len(lines) == 2 * len(SHOWN)


COMMAND = VIEWER + "viewer.tellCommand(); return viewer.find('command').textContent"


@pytest.fixture(scope="module")
def saved(tmp_path_factory) -> list[LabelledRun]:
    """Three runs that are recorded, in folders whose names have a space."""
    folder = tmp_path_factory.mktemp("saved")
    runs = [
        LabelledRun(label, replace(whole_car(k + 1.0), folder=folder / f"run {k}"))
        for k, label in enumerate((A, B, C))
    ]
    for run in runs:
        write(run.results, run.results.folder)
    return runs


@pytest.fixture(scope="module")
def recorded(saved, tmp_path_factory) -> Path:
    """Their page."""
    return written(tmp_path_factory.mktemp("recorded"), *saved)


@pytest.mark.parametrize(
    ("view", "panels"),
    [
        ('panels=["plant.sideslip"]&shown=[2]', {"plant.sideslip": [C]}),
        ('panels=["plant.sideslip","plant.yaw_rate - reference.yaw_rate_ref"]&span=[0.5,1.25]',
         {"plant.sideslip": [A, B, C], "plant.yaw_rate - reference.yaw_rate_ref": [A, B, C]}),
        ('panels=["plant.sideslip"]&shown=[2]&baseline=1&difference=true',
         {"plant.sideslip": [f"{C} minus {B}"]}),
        ('panels=["plant.yaw_rate"]&shown=[0,1]&x="plant.sideslip"',
         {"plant.yaw_rate(plant.sideslip)": [A, B]}),
    ],
)  # fmt: skip
def test_the_command_draws_the_view(chromium: Browser, recorded, tmp_path, monkeypatch, view, panels):
    opened(chromium, recorded, f"run?{view}")
    shown = chromium.run(
        VIEWER + "return viewer.panels.map(({meaning: {factor}, drawn}) => drawn.filter(({run, reference}) =>"
        " viewer.shows(run) && !reference).map(({values}) => { const own = [...values].map((v) => v * factor)"
        ".filter(Number.isFinite); return [own.at(0), own.at(-1)]; }))"
    )
    command = chromium.run(COMMAND)
    drawn = []
    monkeypatch.setattr(plots, "draw", lambda *given: drawn.append(draw(*given)) or drawn[0])
    assert status_of(*shlex.split(command)[1:], "--out", tmp_path / "out") == 0
    (figure,) = drawn
    assert [axes.get_label() for axes in figure.axes] == [*panels]
    labels = [text.get_text() for legend in figure.legends for text in legend.get_texts()]
    for axes, (name, own), ends in zip(figure.axes, panels.items(), shown, strict=True):
        lines = [
            line for line in axes.get_lines() if line.get_label() != "reference" and len(line.get_xdata()) > 1
        ]
        assert len(lines) == len(own) and [label for label in labels if label != "reference"] in (own, [])
        for line, (first, last) in zip(lines, ends, strict=True):
            x, y = (np.asarray(values, float) for values in line.get_data())
            if "span" in view:
                assert (x[0], x[-1]) == pytest.approx((0.5, 1.25), abs=0.01)
            else:
                y = y[np.isfinite(y)]
                assert (y[0], y[-1]) == pytest.approx((first, last), rel=1e-3, abs=1e-4), name


def test_a_view_that_figures_have_not_has_no_command(chromium: Browser, recorded):
    for view in ('x="distance"', 'x="plant.sideslip"&difference=true'):
        opened(chromium, recorded, f"run?{view}")
        assert chromium.run(COMMAND) == "", view


def test_a_judged_signal_that_the_page_does_not_carry_is_named_with_the_command_that_shows_it(
    chromium: Browser, saved, tmp_path
):
    lost = "plant.acceleration_y"
    file = written(tmp_path, *saved, views=[View(panels=["sideslip"])], largest=LEAST)
    opened(chromium, file, f'run?shown=[1]&lit=["{lost}",2.5,"peak ≤ 2.5 m/s²"]')
    told = "document.querySelector('.yv-missing')"
    assert mentions(chromium.run(f"return {told}.textContent"), lost, "peak ≤ 2.5 m/s²")
    command = shlex.split(chromium.run(f"return {told}.querySelector('code').textContent"))
    assert status_of(*command[1:], "--out", tmp_path / "found.html") == 0
    assert data_in((tmp_path / "found.html").read_text("utf-8"))["views"][0]["panels"] == [lost]
    opened(chromium, file, 'run?lit=["plant.sideslip",null,"peak"]')
    assert chromium.run(f"return {told}.hidden")


def test_phase_planes_have_their_limits(chromium: Browser, tmp_path):
    run = noted(whole_car(), fmus={"tyre": {"name": "tyre", "constants": {"friction": 0.5}}})
    opened(chromium, written(tmp_path, run))
    curves = chromium.run(
        VIEWER + "const views = viewer.find('views');"
        "views.value = viewer.data.views.findIndex(({title}) => title === arguments[0]);"
        "views.dispatchEvent(new Event('change'));"
        "return viewer.curves('plant.yaw_rate').map(([, , ys]) => ys[0])",
        PLANES[1].title,
    )
    held = 0.5 * G / float(run["plant.velocity_x"][0])
    assert sorted(curves) == pytest.approx([-held, held])
    assert chromium.console() == []


def test_parts_of_a_page_hear_of_cursor_runs_and_colours(chromium: Browser, three):
    opened(chromium, three)
    heard = chromium.run(
        VIEWER + "const heard = []; const end = viewer.subscribe((one) => heard.push(one));"
        "viewer.state.time = 3; viewer.moveCursor(); viewer.showRuns([1], 1); end(); viewer.moveCursor();"
        "return heard.map(({time, shown, colours}) => [time, shown.map(({label}) => label), colours.length])"
    )
    assert [heard[1], heard[-1]] == [[3, [A, B, C], 3], [3, [B], 1]]
