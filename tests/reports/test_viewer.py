"""The viewer: what it carries, and what a browser makes of it."""

from __future__ import annotations

import base64
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.checkout import ROOT
from tests.orchestrator.recorded import car, noted, write
from tests.refusals import each_mentions, mentions
from tests.reports.browser import DESK, PHONE, Browser
from tests.reports.flaws import axe, inaccessible, looks
from tests.reports.made_up import MU, SIZES, data_in, head_of, unpacked, whole_car, without
from yawbench.components.driving.track import LaneChangeParameters, Track
from yawbench.figures.display import digits_of, shown_unit
from yawbench.figures.panels import LabelledRun
from yawbench.foundation.errors import ResultsError, ScenarioError
from yawbench.measurements.measured_results import MeasuredResults
from yawbench.orchestrator.results.reader import Results
from yawbench.orchestrator.results.run_record import ConnectionRecord, RunRecord
from yawbench.reports.page_parts import without_comments
from yawbench.reports.viewer import MOST, Settings, answer_of, check_panels, page, still_of, viewer
from yawbench.reports.viewer_samples import pack
from yawbench.reports.viewer_views import PANELS, View, views_of
from yawbench.vocabulary.lane_change import lanes_of
from yawbench.vocabulary.wheels import WHEELS

VIEWER = "const viewer = document.querySelector('.yv').viewer;"


def labelled(*runs: Any) -> list[LabelledRun]:
    names = ("fuzzy neural network", "off", *map(str, range(len(runs))))
    return [LabelledRun(name, run) for name, run in zip(names, runs, strict=False)]


def data_of(*runs: Results, settings: Settings | None = None) -> dict:
    return data_in(viewer(labelled(*runs), settings or Settings()))


# ---- what it carries ----


def test_a_view_has_the_columns_of_its_signals_with_their_references():
    view, *_ = data_of(car())["views"]
    assert view["panels"] == [
        "plant.sideslip,reference.sideslip_ref",
        "plant.yaw_rate,reference.yaw_rate_ref",
        "plant.acceleration_y",
        "controller.yaw_moment",
        "driver.steer_angle",
    ]
    assert view["shown"] == [0]


def test_a_view_takes_errors_differences_wheels_and_another_axis():
    views = [
        View("a", ["sideslip_error", "plant.yaw_rate - reference.yaw_rate_ref", "wheel_torque_*", "nothing"]),
        View("b", ["yaw_rate"], [1], "sideslip"),
    ]
    first, second, *_ = data_of(car(), car(2.0), settings=Settings(views))["views"]
    wheels = [panel for panel in first["panels"] if "torque_request" in panel]
    assert first["panels"][:2] == [
        "plant.sideslip - reference.sideslip_ref", "plant.yaw_rate - reference.yaw_rate_ref",
    ]  # fmt: skip
    assert len(first["panels"]) == 2 + len(wheels) and len(wheels) == 4
    assert (second["shown"], second["x"]) == ([1], "plant.sideslip")


def test_panels_of_a_page_are_views_and_unknown_ones_are_refused():
    runs = labelled(car(), car(2.0))
    names = [
        "sideslip_error",
        "yaw_rate - yaw_rate_ref",
        "yaw_rate, steer_angle",
        "yaw_rate(sideslip)",
        "path",
    ]
    check_panels(runs, names)
    over_time, portrait = views_of(names)
    assert [*over_time.panels] == names[:3]
    assert (portrait.title, portrait.x, *portrait.panels) == (names[3], "sideslip", "yaw_rate")
    a, b = "yaw_rate", "sidslip"
    for wrong in (b, f"{a} - {b}", f"{a}, {b}", f"{a}({b})", f"{b}({a})"):
        with pytest.raises(ScenarioError) as refused:
            check_panels(runs, [wrong])
        assert mentions(str(refused.value), "--panel", wrong)


def test_signals_have_the_label_unit_and_factor_of_the_figures():
    signals = data_of(car())["signals"]
    assert signals["plant.yaw_rate"] == {
        "label": "Yaw rate", "unit": shown_unit("rad/s")[0], "factor": shown_unit("rad/s")[1], "si": "rad/s",
    }  # fmt: skip


def test_the_cursor_begins_at_the_largest_sideslip_of_all_runs():
    large = whole_car(2.0)
    large.columns["plant.sideslip"] *= np.where(large.time < 4.0, 1.0, 0.5)
    peak = large.time[np.argmax(np.abs(large["plant.sideslip"]))]
    assert still_of([whole_car(), large]) == peak == pytest.approx(2.25)


def test_beyond_the_largest_size_the_signals_of_the_views_and_the_road_remain():
    runs = (whole_car(), whole_car(2.0))
    every = data_of(*runs)["runs"][0]["columns"]
    view = View("few", ["sideslip"])
    of_all = sum(len(run.block) for run in pack(runs))
    few = data_of(*runs, settings=Settings([view], largest=of_all - 1))["runs"][0]["columns"]
    assert set(few) < set(every)
    of_tyres = {"tyre.tyre_force_x_fl", "plant.vertical_load_rr"}
    assert {"plant.sideslip", "plant.position_x", *of_tyres} <= set(few)
    assert "plant.acceleration_y" not in few
    least = data_of(*runs, settings=Settings([view], largest=10))
    fewer = least["runs"][0]
    assert {"plant.sideslip", "plant.position_x"} <= set(fewer["columns"]) <= set(few) - of_tyres
    assert not any("tyre" in note for note in fewer["notes"])
    assert least["partial"]
    assert [one["title"] for one in least["views"]] == ["few"]  # phase planes need many signals
    assert {name for x, y, *_ in least["curves"] for name in (x, *y.split(" + "))} <= set(fewer["columns"])
    assert not data_of(*runs, settings=Settings([view], largest=10**9))["partial"]


def test_no_runs_too_many_and_empty_ones_are_refused():
    for runs, words in (
        ([], f"a viewer shows one to {MOST} runs, not 0"),
        ([LabelledRun("x", car())] * (MOST + 1), f"not {MOST + 1}"),
        ([LabelledRun("x", replace(car(), time=np.zeros(0)))], "x: no samples were recorded"),
    ):
        with pytest.raises(ResultsError, match=words):
            viewer(runs)


def test_the_friction_of_a_circle_is_the_tyres_or_what_a_road_recorded_never_what_a_controller_believes():
    recorded = whole_car()
    assert data_of(recorded)["runs"][0]["road"]["friction_fl"] == MU
    rough = {f"road.friction_{w}": np.linspace(0.2, 0.8, recorded.time.size) for w in WHEELS}
    (run,) = data_of(replace(recorded, columns={**recorded.columns, **rough}))["runs"]
    assert run["road"]["friction_rr"] == "road.friction_rr"
    reference = {"name": "reference_made_up", "constants": {"friction": 0.4}}
    tyre = {"name": "tyre_made_up", "constants": {}}
    (run,) = data_of(noted(whole_car(), fmus={"reference": reference, "tyre": tyre}))["runs"]
    assert "friction_fl" not in run["road"]
    assert each_mentions(run["notes"], ("friction", "vertical", "loads"))


def test_sizes_that_only_the_fmu_had_are_taken_from_its_defaults():
    plant = {"name": "plant_made_up", "parameters": {"track_width": 1.7}, "defaults": SIZES}
    (run,) = data_of(noted(whole_car(), fmus={"plant": plant}))["runs"]
    outline = run["road"]["outline"]["car"]
    assert (outline["front_axle"], outline["rear_axle"], outline["track"]) == (1.2, 1.5, 1.7)
    assert not run["notes"]


def test_what_was_not_recorded_is_left_out_and_named():
    (bare,) = data_of(without(whole_car(), "tyre_force", "sideslip", "moment", "velocity"))["runs"]
    assert not {"force_along_fl", "sideslip", "yaw_moment", "velocity_x"} & set(bare["road"])
    assert bare["notes"] == ["tyre forces not recorded"]
    (straight,) = data_of(without(whole_car(), "steer_angle"))["runs"]
    assert each_mentions(straight["notes"], ("steer", "angle", "wheels"))
    assert mentions(data_of(car())["runs"][0]["notes"][-1], "plant", "dimensions", "mid-size")


def test_a_run_without_positions_has_no_road():
    runs = data_of(without(whole_car(), "position"), whole_car())["runs"]
    assert [run["road"] is None for run in runs] == [True, False]


@pytest.mark.parametrize(
    "change", [{}, {"lane_offset": -3.5}, {"transition_scale": 1.4, "track_start": 40.0}]
)
def test_lanes_are_those_of_the_driver(change):
    parameters = LaneChangeParameters(**{"vehicle_width": 1.7, **change})
    np.testing.assert_allclose(lanes_of(vars(parameters)), Track(parameters).lanes, rtol=0, atol=1e-12)
    assert lanes_of({"amplitude": 0.1, "vehicle_width": 1.8}) == []


def test_lanes_and_outline_come_from_the_recorded_driver():
    driver = {"name": "driver_double_lane_change", "parameters": {"track_start": 30.0}}
    (run,) = data_of(
        noted(whole_car(), fmus={"driver": driver | {"defaults": vars(LaneChangeParameters())}})
    )["runs"]
    outline = run["road"]["outline"]
    assert [lane[0] for lane in outline["lanes"]] == [30.0, 75.0, 125.0]
    assert [outline["car"][key] for key in ("front_end", "rear_end", "width")] == [2.25, 2.65, 1.85]


def test_labels_cannot_break_out_of_the_page():
    nasty = '</script><img src=x onerror="boom()">'
    html = unpacked(page([LabelledRun(nasty, whole_car())], title=nasty))
    assert "<img" not in html
    assert data_in(html)["runs"][0]["label"] == nasty


# ---- the commands ----


def test_animate_and_plot_page_write_the_same_page_of_one_run_or_several(yawbench, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name, gain in (("fnn", 1.0), ("off", 2.0)):
        write(whole_car(gain), tmp_path / "runs" / name)
    status, _, said = yawbench("animate", "runs/fnn")
    assert (status, said.split(":")[0]) == (0, "runs/fnn/view.html")
    one, made = Path("runs/fnn/view.html").read_text(encoding="utf-8"), r" on [\d-]+ [\d:]+ UTC"
    assert yawbench("plot", "--page", "runs/fnn")[0] == 0
    again = Path("runs/fnn/view.html").read_text(encoding="utf-8")
    assert re.sub(made, "", again) == re.sub(made, "", one)
    status, _, said = yawbench("animate", "runs/fnn", "runs/off", "--out", "two.html")
    assert (status, said.split(":")[0]) == (0, "two.html")
    html = Path("two.html").read_text(encoding="utf-8")
    assert [run["label"] for run in data_in(html)["runs"]] == ["fnn", "off"]
    assert mentions(html, "title", "fnn")
    assert ">Sine at 25 m/s</p>" in html
    assert yawbench("plot", "--page", "--panel", "yaw_rate", "runs/off", "--out", "shown")[0] == 0
    view, *_ = data_in(Path("shown/view.html").read_text(encoding="utf-8"))["views"]
    assert view["panels"] == ["plant.yaw_rate,reference.yaw_rate_ref"]


def test_animate_runs_a_scenario_once_and_overlays_another(yawbench, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    scenario, short = "fuzzy_feedback/single_sine", ("--set", "stop_time=0.05 s")
    status, _, said = yawbench("animate", scenario, *short)
    assert (status, "[1/1]" in said) == (0, True)
    (made,) = Path("results").rglob("view.html")
    assert "stop_time" in made.parent.name
    assert mentions(made.read_text(encoding="utf-8"), "stop_time", "0.05 s")
    status, _, said = yawbench("animate", scenario, str(made.parent), *short, "--out", "two.html")
    assert (status, said.split(":")[0]) == (0, "two.html")  # nothing is run again
    status, _, said = yawbench("animate", "nowhere")
    assert (status, "no results here" in said) == (2, True)


# ---- in a browser ----


def written(folder: Path, *runs: Results | LabelledRun, **settings) -> Path:
    """Return the page of runs in a folder; those without labels are named as by `labelled`."""
    named = [
        given if isinstance(given, LabelledRun) else one
        for given, one in zip(runs, labelled(*runs), strict=True)
    ]
    (file := folder / "page.html").write_text(page(named, Settings(**settings)), "utf-8")
    return file


@pytest.fixture(scope="module")
def two(tmp_path_factory) -> Path:
    """A page of two runs with lanes."""
    driver = {"name": "driver_double_lane_change", "parameters": vars(LaneChangeParameters())}
    runs = noted(whole_car(), fmus={"driver": driver}), whole_car(2.0)
    return written(tmp_path_factory.mktemp("page"), *runs)


def opened(chromium: Browser, file: Path, fragment: str = "", **size) -> None:
    chromium.open(file, fragment, **size)
    chromium.wait_for("document.querySelector('.yv-ready')")
    chromium.wait_for("document.querySelector('.yv').viewer.panels.every((panel) => panel.plot)")


def seen(chromium: Browser, file: Path) -> None:
    """Show a page as it is when opened, to a test that changes nothing in it; it is loaded if another did."""
    if chromium.run("return window.seen") != str(file):
        opened(chromium, file)
        chromium.run("window.seen = arguments[0]", str(file))


def inked(chromium: Browser, canvas: str, bright: int = 720) -> float:
    """Return the share of a canvas's pixels that are drawn on, darker than a sum of their colours."""
    return chromium.run(
        "const canvas = document.querySelector(arguments[0]);"
        "const {data} = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height);"
        "let n = 0;"
        "for (let i = 0; i < data.length; i += 4)"
        " n += data[i + 3] > 99 && data[i] + data[i + 1] + data[i + 2] < arguments[1];"
        "return n / (data.length / 4);",
        canvas,
        bright,
    )


@pytest.mark.parametrize(("width", "colours"), looks(PHONE, 768, DESK, narrow=True))
def test_the_page_is_drawn_at_every_width_without_complaint(chromium, two, width, colours):
    opened(chromium, two, width=width, density=2)
    assert chromium.console() == []
    assert chromium.requests() == []
    assert chromium.overflow() <= 0
    for canvas in (".yv-scene", ".yv-chart canvas", ".yv-closeups canvas"):
        assert inked(chromium, canvas) > 0.002, canvas
    sizes = chromium.run(
        "return [...document.querySelectorAll('canvas')].map((c) => [c.width / c.clientWidth, c.clientWidth])"
    )
    assert all(ratio == pytest.approx(2.0, rel=0.02) for ratio, _ in sizes)  # crisp: device pixels
    assert all(wide > 120 for _, wide in sizes)
    assert chromium.run("return document.querySelectorAll('*').length") <= 2000
    assert inaccessible(chromium, colours) == []


def test_the_page_begins_with_what_the_runs_came_to():
    failed = noted(replace(whole_car(), time=whole_car().time[:31]), status="failed")
    few = [LabelledRun("free", whole_car(2.0)), LabelledRun("held", whole_car())]
    many = [LabelledRun(f"run {k}", whole_car(1.0 + 0.1 * k)) for k in range(5)]
    peaks = [np.degrees(np.max(np.abs(run.results["plant.sideslip"]))) for run in (*few, many[-1])]
    assert answer_of(few) == f"Largest sideslip angle: {peaks[0]:.3g} ° (free) and {peaks[1]:.3g} ° (held)."
    assert answer_of(few[:1]) == f"Largest sideslip angle: {peaks[0]:.3g} °."
    assert f"{peaks[2]:.3g} ° (run 4), of 5 runs." in answer_of(many)
    assert answer_of([LabelledRun("short", failed)]).startswith("Short failed at 0.3")
    assert answer_of([LabelledRun("bare", without(whole_car(), "sideslip", "yaw", "acceleration"))]) == ""
    near = whole_car()
    near.columns["plant.sideslip"] *= 1.0 + 1e-5
    first, second = re.findall(r"[\d.]+ °", answer_of(labelled(whole_car(), near)))
    assert first != second


def test_decoded_samples_equal_the_recorded_ones(chromium, two):
    seen(chromium, two)
    runs = (whole_car(), whole_car(2.0))
    rng = np.random.default_rng(3)
    rows = rng.integers(runs[0].time.size, size=20).tolist()
    times, decoded = chromium.run(
        VIEWER + "const of = (column) => arguments[0].map((row) => column[row]);"
        "return [viewer.runs.map((run) => of(run.time)), viewer.runs.map((run) =>"
        " Object.fromEntries(arguments[1].map((name) => [name, of(run.column(name))])))]",
        rows,
        [*runs[0].columns],
    )
    for run, time, columns in zip(runs, times, decoded, strict=True):
        assert time == pytest.approx(run.time[rows], abs=1e-12)
        for name, values in columns.items():
            span = max(np.ptp(np.concatenate([one.columns[name] for one in runs])), 1e-300)
            assert np.abs(values - run.columns[name][rows]).max() <= span / 131068 * (1 + 1e-9), name


def test_the_slider_moves_cars_and_numbers(chromium, two):
    opened(chromium, two)
    script = (
        VIEWER + "const slider = document.querySelector('.yv-slider'); slider.value = arguments[0];"
        "slider.dispatchEvent(new Event('input')); viewer.moveCursor();"
        "return {x: viewer.road.states[0].x, time: document.querySelector('.yv-clock').textContent,"
        " spoken: slider.getAttribute('aria-valuetext'),"
        " cells: viewer.panels.map((panel) => panel.cells.map(([cell]) => cell.textContent))};"
    )
    runs = (whole_car(), whole_car(2.0))
    for time in (2.0, 6.5):
        shown = chromium.run(script, time)
        assert shown["time"] == shown["spoken"] == f"{time:.3f} s"
        x = np.interp(time, runs[0].time, runs[0]["plant.position_x"])
        assert shown["x"] == pytest.approx(x, abs=0.02)
        row = int(np.argmin(np.abs(runs[0].time - time)))
        span = np.ptp(np.concatenate([run["plant.sideslip"] for run in runs]))
        for text, run in zip(shown["cells"][0][-2:], runs, strict=True):
            value, (_, factor) = run["plant.sideslip"][row], shown_unit("rad")
            near = {digits_of((value + e * span / 131068) * factor, 4) for e in np.linspace(-1, 1, 9)}
            assert text.replace("−", "-") in near


def test_numbers_read_as_in_figures(chromium, two):
    seen(chromium, two)
    values = [0.0, 1.0, -2.5, 0.12345678, 1234.5678, 99999.0, 1e-5, -3.21e-9, 7.7e11]
    texts = chromium.run(VIEWER + "return arguments[0].map((value) => viewer.panels[0].text(value))", values)
    assert [text.replace("−", "-") for text in texts] == [digits_of(value, 4) for value in values]


def test_the_keyboard_steps_zooms_compares_and_plays_to_the_end(chromium, two):
    from selenium.webdriver.common.keys import Keys

    opened(chromium, two)
    state = VIEWER + "return [viewer.state.time, viewer.road.playing, viewer.span(), viewer.state.difference]"
    chromium.press(Keys.HOME)
    assert chromium.run(state) == [0, False, [0, 8], False]
    chromium.press(Keys.ARROW_RIGHT)
    assert chromium.run(state)[0] == pytest.approx(0.01)
    chromium.run("document.dispatchEvent(new KeyboardEvent('keydown', {key: 'ArrowRight', shiftKey: true}))")
    assert chromium.run(state)[0] == pytest.approx(0.11)
    chromium.press(Keys.END)
    assert chromium.run(state)[0] == 8
    chromium.press("+")
    begin, end = chromium.run(state)[2]
    assert end - begin == pytest.approx(5.0)
    chromium.press("0")
    assert chromium.run(state)[2] == [0, 8]
    chromium.press("d")
    assert chromium.run(state)[3] is True
    chromium.press(" ")
    assert chromium.run(state)[1] is True
    chromium.press(" ")
    assert chromium.run(state)[1] is False
    chromium.run(VIEWER + "viewer.seek(7.9); viewer.road.rate = 2; viewer.road.play();")
    chromium.wait_for("!document.querySelector('.yv').viewer.road.playing")
    assert chromium.run(state)[0] == 8
    assert chromium.run(VIEWER + "return viewer.road.buttons[0].textContent") == "Play"


def test_a_zoomed_span_follows_the_cursor_that_leaves_it(chromium, two):
    from selenium.webdriver.common.keys import Keys

    opened(chromium, two)
    chromium.run(VIEWER + "viewer.seek(2); viewer.zoomTo([1, 3])")
    span = VIEWER + "return [viewer.state.time, ...viewer.span()]"
    chromium.press(Keys.ARROW_RIGHT)
    assert chromium.run(span) == [pytest.approx(2.01), 1, 3]
    chromium.run(VIEWER + "viewer.seek(3)")
    chromium.press(Keys.ARROW_RIGHT)
    time, begin, end = chromium.run(span)
    assert (time, end - begin) == (pytest.approx(3.01), pytest.approx(2))
    assert begin < time < end
    chromium.press(Keys.END)
    assert chromium.run(span) == [8, 6, 8]
    chromium.press(Keys.HOME)
    assert chromium.run(span) == [0, 0, 2]


def chart(chromium: Browser, panel: int) -> tuple[float, float, float, float]:
    """Scroll a panel into sight; return the box of its chart: left, top, width, height."""
    return tuple(
        chromium.run(
            VIEWER + "const {over} = viewer.panels[arguments[0]].plot;"
            "over.scrollIntoView({block: 'center', behavior: 'instant'});"
            "const box = over.getBoundingClientRect(); return [box.left, box.top, box.width, box.height]",
            panel,
        )
    )


def drag(chromium: Browser, panel: int, begin: tuple[float, float], end: tuple[float, float], keys=0) -> None:
    """Drag the mouse over a panel, from one share of its width and height to another; keys 8: with Shift."""
    left, top, wide, high = chart(chromium, panel)
    steps = [("mouseMoved", begin), ("mousePressed", begin), ("mouseMoved", end), ("mouseReleased", end)]
    for kind, (across, down) in steps:
        held = 1 if kind in ("mousePressed", "mouseMoved") and kind != steps[0][0] else 0
        chromium.driver.execute_cdp_cmd(
            "Input.dispatchMouseEvent",
            {
                "type": kind, "x": left + across * wide, "y": top + down * high, "button": "left",
                "buttons": held, "clickCount": 1, "modifiers": keys,
            },
        )  # fmt: skip


def test_dragging_one_panel_zooms_all(chromium, two):
    opened(chromium, two)
    drag(chromium, 1, (0.25, 0.3), (0.5, 0.3))
    begin, end = chromium.run(VIEWER + "return viewer.span()")
    assert (begin, end) == (pytest.approx(2.0, abs=0.05), pytest.approx(4.0, abs=0.05))
    limits = chromium.run(
        VIEWER + "return viewer.panels.map((panel) => [panel.plot.scales.x.min, panel.plot.scales.x.max])"
    )
    assert all(one == pytest.approx([begin, end]) for one in limits)
    chromium.run("document.querySelector('.yv-all').click()")
    assert chromium.run(VIEWER + "return viewer.span()") == [0, 8]


PICTURE = VIEWER + "return viewer.panels.map((panel) => panel.plot.ctx.canvas.toDataURL().length)"
STATE = VIEWER + "return JSON.stringify(viewer.state)"


def test_the_address_reproduces_the_picture(chromium, two):
    opened(chromium, two)
    chromium.run(
        VIEWER + "document.querySelector('.yv-nearer').click();"
        "viewer.state.panels.push('plant.velocity_x'); viewer.state.shown = [1]; viewer.state.baseline = 1;"
        "viewer.refresh(); viewer.zoomTo([1, 3]); viewer.seek(2.5); viewer.moveCursor(); viewer.remember();"
    )
    state, picture = chromium.run(STATE), chromium.run(PICTURE)
    address = chromium.run("return location.hash")
    opened(chromium, two, address)
    assert chromium.run(STATE) == state
    assert chromium.run(VIEWER + "return viewer.road.view.zoom") == pytest.approx(1.25)
    assert chromium.run(PICTURE) == picture
    assert chromium.run("return document.querySelectorAll('.yv-panel').length") == len(PANELS) + 1


def test_a_link_is_followed_although_the_viewer_writes_its_address_at_that_moment(chromium, two):
    opened(chromium, two)
    chromium.run("location.hash = 'run?shown=[1]';" + VIEWER + "viewer.remember()")
    chromium.wait_for("document.querySelector('.yv').viewer.state.shown.join() === '1'")
    chromium.run(VIEWER + "viewer.seek(2.5); viewer.moveCursor(); viewer.remember();")
    assert chromium.run("return location.hash") == "#run?shown=%5B1%5D&time=2.5"


@pytest.mark.parametrize(
    "fragment",
    [
        'run?shown=[9]&panels=["nothing"]&span=[3,1]&time="x"&x=7&camera=99&offsets=[1]&view=4',
        "run?shown=[[[&panels",
        pytest.param("run?tolerance=-1&difference=7&__proto__=1", marks=pytest.mark.exhaustive),
    ],
)
def test_a_wrong_address_shows_the_first_picture(chromium, two, fragment):
    seen(chromium, two)
    state = chromium.run(STATE)
    opened(chromium, two, fragment)
    assert chromium.run(STATE) == state
    assert chromium.console() == []


def test_a_difference_is_that_from_the_baseline_with_its_tolerance(chromium, two):
    opened(chromium, two, "run?difference=true&tolerance=10")
    runs = (whole_car(), whole_car(2.0))
    name = "plant.sideslip"
    apart = runs[1][name] - runs[0][name]
    drawn = np.array(chromium.run(VIEWER + "return [...viewer.panels[0].shown[0].values]"))
    np.testing.assert_allclose(drawn, apart, atol=np.ptp(runs[1][name]) / 65000)
    first = runs[0].time[np.argmax(np.abs(apart) > 0.1 * np.max(np.abs(runs[0][name])))]
    said = chromium.run("return document.querySelector('.yv-panel output').textContent")
    assert said == f"beyond 10 % from {digits_of(first, 4)} s (off)"


def test_a_measured_run_has_a_field_for_its_offset(chromium, tmp_path):
    run = whole_car()
    measured = MeasuredResults(Path(), run.time, run.columns, run.units, RunRecord())
    opened(chromium, written(tmp_path, whole_car(), measured))
    assert chromium.run(
        "return [...document.querySelectorAll('.yv-offset')].map((x) => x.closest('tr').dataset.run)"
    ) == ["1"]
    chromium.run(
        "const field = document.querySelector('.yv-offset'); field.value = '0.25';"
        "field.dispatchEvent(new Event('change', {bubbles: true}));"
    )
    assert chromium.run(VIEWER + "return [viewer.runs[1].shifted[0], viewer.state.offsets]") == [
        0.25,
        {"1": 0.25},
    ]
    assert chromium.run("return document.querySelector('.yv-offset').value") == "0.25"
    chromium.wait_for("location.hash.includes('offsets')")
    assert inaccessible(chromium, "light") == []


def test_signals_over_distance_and_over_another_signal(chromium, two):
    recorded = whole_car()
    opened(chromium, two, 'run?x="distance"')
    end = chromium.run(VIEWER + "return viewer.whole()[1]")
    path = np.hypot(np.diff(recorded["plant.position_x"]), np.diff(recorded["plant.position_y"])).sum()
    assert end == pytest.approx(path, rel=1e-3)
    opened(chromium, two, 'run?x="plant.sideslip"')
    assert chromium.run("return document.querySelector('.yv-panel:last-child canvas') !== null")
    low, high = chromium.run(VIEWER + "return viewer.whole()")
    assert low < -0.5 and high > 0.5
    assert chromium.console() == []


def test_a_signal_is_found_by_name_variable_input_label_or_words_of_it(chromium, tmp_path):
    run = whole_car()
    wire = ConnectionRecord.model_validate({"from": "plant.velocity_x", "to": "sensor.speed_true"})
    wired = replace(run, record=run.record.model_copy(update={"connections": [wire]}))
    opened(chromium, written(tmp_path, wired, views=[View(panels=["acceleration_y"])]))
    found = {
        "plant.velocity_x": "plant.velocity_x",
        "velocity_x": "plant.velocity_x",
        "speed_true": "plant.velocity_x",
        "Longitudinal velocity": "plant.velocity_x",
        "longitudinal velocity in km/h": "plant.velocity_x",
        " YAW_MOMENT ": "controller.yaw_moment",
        "rear-left load": "plant.vertical_load_rl",
        "plant.sideslip - reference.sideslip_ref": "plant.sideslip - reference.sideslip_ref",
        "plant.velocity_x, yaw_moment": "plant.velocity_x,controller.yaw_moment",
    }
    refused = {
        "tyre force rear left": ("tyre.tyre_force_x_rl", "tyre.tyre_force_y_rl"),
        "tyre_force_x": ("tyre.tyre_force_x_fl", "tyre.tyre_force_x_rr"),
        "brake load rear left": ("no signal", "plant.vertical_load_rl"),
        "plant.nothing": ("plant.nothing", "recorded"),
    }
    add, x = (
        VIEWER + f"const field = document.querySelector('.yv-{name}'); return arguments[0].map((text) => {{"
        "field.value = text; field.dispatchEvent(new Event('change'));"
        f"return [{chosen}, field.validationMessage]; }});"
        for name, chosen in (("add", "viewer.state.panels.at(-1)"), ("x", "viewer.state.x"))
    )
    assert chromium.run(add, [*found]) == [[signal, ""] for signal in found.values()]
    panels = VIEWER + "return viewer.state.panels"
    before = chromium.run(panels)
    assert each_mentions([said for _, said in chromium.run(add, [*refused])], *refused.values())
    assert chromium.run(panels) == before
    (_, none), last = chromium.run(x, ["velocity_x", "plant.nothing"])
    assert none == "" and last[0] == "plant.velocity_x" and mentions(last[1], "plant.nothing")
    opened(chromium, written(tmp_path, whole_car(), views=[View(panels=["sideslip"])], largest=1))
    assert mentions(chromium.run(add, ["acceleration_y"])[0][1], "acceleration_y", "yawbench plot --page")


def test_the_csv_holds_the_span_in_si(chromium, two):
    opened(chromium, two, 'run?span=[1,1.05]&panels=["plant.sideslip"]')
    header, *rows = chromium.run(VIEWER + "return viewer.csv()").strip().split("\n")
    assert mentions(header, '"run"', '"time [s]"', '"plant.sideslip [rad]"')
    recorded = whole_car()
    inside = (recorded.time >= 1) & (recorded.time <= 1.05 + 1e-12)
    mine = [row.split(",") for row in rows if "fuzzy" in row]
    np.testing.assert_allclose([float(row[1]) for row in mine], recorded.time[inside])
    np.testing.assert_allclose([float(row[2]) for row in mine], recorded["plant.sideslip"][inside], atol=2e-5)


def test_forces_are_turned_into_vehicle_axes_at_the_front_alone(chromium, two):
    seen(chromium, two)
    recorded = whole_car()
    row = 300
    forces = chromium.run(
        VIEWER + "const c = viewer.runs[0].channels;"
        "return ['force_x_fl', 'force_y_fl', 'force_y_rl', 'grip_fl'].map((name) => c[name][arguments[0]])",
        row,
    )
    delta = recorded["driver.steer_angle"][row]
    f_x, f_y = (recorded[f"tyre.tyre_force_{axis}_fl"][row] for axis in "xy")
    expected = [
        f_x * np.cos(delta) - f_y * np.sin(delta), f_x * np.sin(delta) + f_y * np.cos(delta),
        recorded["tyre.tyre_force_y_rl"][row], MU * recorded["plant.vertical_load_fl"][row],
    ]  # fmt: skip
    np.testing.assert_allclose(forces, expected, atol=0.2)


def test_friction_circles_of_an_axle_touch_at_most(chromium, two):
    seen(chromium, two)
    widest = chromium.run(
        VIEWER + "const widest = viewer.road.cars.flatMap(({channels: c}) => ['f', 'r'].map((axle) =>"
        " Math.max(...c['grip_' + axle + 'l'].map((one, i) => one + c['grip_' + axle + 'r'][i]))));"
        "return Math.max(...widest) * viewer.road.scale"
    )
    assert 0.9 * SIZES["track_width"] < widest < SIZES["track_width"]


def test_every_camera_keeps_what_it_follows_in_sight(chromium, two):
    opened(chromium, two, width=PHONE)
    for view, followed in (("cars", (0, 1)), ("0", (0,)), ("1", (1,)), ("whole", (0, 1))):
        for time in (0.0, 4.0, 8.0):
            places, size = chromium.run(
                VIEWER + "const camera = document.querySelector('.yv-camera'); camera.value = arguments[0];"
                "camera.dispatchEvent(new Event('change')); viewer.seek(arguments[1]); viewer.moveCursor();"
                "const {clientWidth, clientHeight} = viewer.road.scene;"
                "return [viewer.road.states.map((state) => state.screen), [clientWidth, clientHeight]]",
                view, time,
            )  # fmt: skip
            for run in followed:
                assert all(0 < at < limit for at, limit in zip(places[run], size, strict=True)), (view, time)


def test_several_viewers_share_a_page(chromium, tmp_path):
    parts = [viewer(labelled(whole_car()), name="a"), viewer(labelled(whole_car(), whole_car(2.0)), name="b")]
    file = tmp_path / "report.html"
    file.write_text(f"{head_of('report')}{''.join(parts)}</html>", "utf-8")
    chromium.open(file)
    chromium.wait_for("document.querySelectorAll('.yv-ready').length === 2")
    assert chromium.console() == []
    viewers = "[...document.querySelectorAll('.yv')].map((root) => root.viewer)"
    chromium.run(
        f"{viewers}[0].seek(1); {viewers}[1].zoomTo([2, 3]); {viewers}.forEach((one) => one.remember())"
    )
    chromium.reload()
    chromium.wait_for("document.querySelectorAll('.yv-ready').length === 2")
    assert chromium.run(f"return {viewers}.map((one) => one.state.span)") == [None, [2, 3]]
    assert chromium.run(f"return {viewers}[0].state.time") == 1


def test_of_many_runs_few_are_listed_at_first(chromium, tmp_path):
    """Rows alone come with more of them, so that a hundred show what happens with two hundred."""
    many = 100
    opened(chromium, written(tmp_path, *many * [whole_car(n=11)]), "run?shown=[0,3,51]")
    listed = (
        "return [...document.querySelectorAll('.yv-runs tbody tr')].map((row) => Number(row.dataset.run))"
    )
    assert chromium.run("return document.querySelectorAll('*').length") <= 2000
    few = chromium.run(listed)
    assert few == sorted(few) and few[0] == 0 and few[-1] == 51 and len(few) < many / 2
    assert chromium.run("return document.querySelector('[data-run=\"51\"] .yv-show').checked")
    chromium.run("document.querySelector('.yv-rest').click()")
    assert chromium.run(listed) == list(range(many))
    chromium.run("document.querySelector('[data-run=\"40\"] .yv-show').click()")
    assert chromium.run(VIEWER + "return viewer.state.shown") == [0, 3, 40, 51]
    assert not chromium.run("return document.querySelector('.yv-rest').checkVisibility()")


def test_a_bare_run_is_drawn_without_complaint(chromium, tmp_path):
    bare = without(whole_car(), "tyre_force", "load", "sideslip", "yaw_rate", "moment", "velocity", "steer")
    opened(chromium, written(tmp_path, bare), width=PHONE)
    assert chromium.console() == []
    assert chromium.overflow() <= 0
    assert inked(chromium, ".yv-scene") > 0.002
    assert chromium.run("return document.querySelector('figcaption').textContent").endswith(
        "tyre forces not recorded"
    )


def test_runs_of_other_steps_lengths_and_signals_and_failed_ones_share_a_page(chromium, tmp_path):
    def ended(rows: int) -> Results:
        run = whole_car()
        return replace(run, time=run.time[:rows], columns={k: x[:rows] for k, x in run.columns.items()})

    whole, coarse, short = whole_car(), whole_car(2.0, n=81), ended(401)
    failed = noted(ended(31), status="failed")  # at 0.3 s
    for name in ("plant.position_y", "plant.yaw_rate"):
        failed.columns[name] = np.where(np.arange(31) < 20, failed.columns[name], np.nan)
    file = written(tmp_path, whole, coarse, short, failed, without(whole, "yaw_rate"))
    opened(chromium, file, "run?difference=true")
    assert chromium.console() == []
    apart = np.array(chromium.run(VIEWER + "return [...viewer.panels[2].shown[0].values]"))
    assert apart.size == 81
    exact = coarse["plant.acceleration_y"] - np.interp(coarse.time, whole.time, whole["plant.acceleration_y"])
    np.testing.assert_allclose(apart, exact, atol=1e-3 * np.ptp(exact))
    opened(chromium, file)
    captions = chromium.run(
        "return [...document.querySelectorAll('figcaption')].map((one) => one.textContent)"
    )
    assert "ends at 4.00 s" in captions[2]
    assert mentions(captions[3], "0.30 s", "failed")
    values = chromium.run(
        VIEWER + "viewer.seek(7); viewer.moveCursor(); const {cells, shown} = viewer.panels[1];"
        "return cells.filter((_, k) => !shown[k].reference).map(([cell]) => cell.textContent)"
    )
    assert values.count("–") == 2  # two have ended, another has not recorded it


def test_a_sideslip_angle_beyond_half_a_turn_comes_back_at_the_other_end(chromium, tmp_path):
    spun = whole_car()
    turned = np.linspace(np.pi - 0.2, np.pi + 0.2, spun.time.size)
    spun.columns["plant.sideslip"][:] = (turned + np.pi) % (2 * np.pi) - np.pi
    opened(chromium, written(tmp_path, spun), 'run?panels=["plant.sideslip"]')
    middle = float(np.interp(np.pi, turned, spun.time))
    angles = chromium.run(
        VIEWER + "return arguments[0].map((time) => { viewer.seek(time); viewer.moveCursor();"
        " return viewer.road.states[0].sideslip; })",
        np.linspace(middle - 0.1, middle + 0.1, 41).tolist(),
    )
    assert np.abs(angles).min() > 3.1
    drawn = chromium.run(
        "const c = document.querySelector('.yv-chart canvas'), p = c.getContext('2d');"
        "const {data} = p.getImageData(0, Math.round(c.height * 0.45), c.width, 1);"
        "let n = 0;"
        "for (let i = 0; i < data.length; i += 4) n += data[i + 3] > 99 && data[i] < 99 && data[i + 2] > 120;"
        "return n;"
    )
    assert drawn == 0  # no line from one end to the other


def test_a_standing_car_is_drawn_without_an_arrow_of_its_motion(chromium, tmp_path):
    pictures = []
    for speed in (0.0, 20.0):
        run = whole_car()
        for column in run.columns:
            if "velocity" in column:
                run.columns[column][:] = speed if column.endswith("velocity_x") else 0.0
        opened(chromium, written(tmp_path, run))
        chromium.run(VIEWER + "viewer.seek(0); viewer.moveCursor()")
        pictures.append(inked(chromium, ".yv-closeups canvas", 450))
    assert pictures[0] < pictures[1]


def test_print_is_finer_and_shows_no_controls(chromium, two):
    opened(chromium, two)
    chromium.driver.execute_cdp_cmd("Page.enable", {})
    chromium.run(
        "window.ratios = []; addEventListener('beforeprint', () => {"
        " const canvas = document.querySelector('.yv-chart canvas');"
        " window.ratios.push(canvas.width / canvas.clientWidth); });"
    )
    pdf = base64.b64decode(chromium.driver.execute_cdp_cmd("Page.printToPDF", {})["data"])
    assert len(re.findall(rb"/Type\s*/Page\b", pdf)) <= 2
    (ratio,) = chromium.run("return window.ratios")
    assert ratio == pytest.approx(3.0, rel=0.02)
    chromium.driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": "print"})
    display = "return getComputedStyle(document.querySelector(arguments[0])).display"
    chromium.run(VIEWER + "viewer.print()")
    places = chromium.run(
        "const box = (name) => document.querySelector(name).getBoundingClientRect();"
        "return [box('.yv-panels').bottom, box('.yv-road').top, box('.yv-scene').width, box('.yv').width]"
    )
    assert places[1] >= places[0] and places[2] < places[3]  # the road is below the panels, not on them
    shown = {
        name: chromium.run(display, f".yv-{name}") for name in ("bar", "time", "scene", "panels", "runs")
    }
    assert shown["bar"] == shown["time"] == "none"
    assert "none" not in (shown["scene"], shown["panels"], shown["runs"])


CONTRASTS = (
    VIEWER
    + """
const {Color, getContrast} = axe.commons.color;
const of = (text) => {
  const one = new Color();
  document.body.style.color = text;
  one.parseRgbString(getComputedStyle(document.body).color);
  return one;
};
const {ground, runs, ink, quiet} = viewer.theme;
const against = (colours) => Math.min(...colours.map((one) => getContrast(of(ground), of(one))));
return [against(runs), against([ink, quiet])];
"""
)
"""Smallest contrast ratios (WCAG 2.2) of the runs' lines and of words to the ground."""


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_lines_stand_out_from_the_ground_in_light_and_dark(chromium, two, scheme):
    wish = {"features": [{"name": "prefers-color-scheme", "value": scheme}]}
    chromium.driver.execute_cdp_cmd("Emulation.setEmulatedMedia", wish)
    chromium.driver.get(two.resolve().as_uri())
    chromium.wait_for("document.querySelector('.yv-ready')")
    chromium.run(axe())
    lines, words = chromium.run(CONTRASTS)
    assert lines >= 2.1 and words >= 4.5  # Okabe and Ito's sky blue on white has 2.1


def test_scripts_lose_comments_and_indentation_alone():
    script = "  // why\n\n  let a = 'b // c';  // d\n/* e */\n"
    assert without_comments(script) == "let a = 'b // c';\n/* e */\n"
    for file in (ROOT / "yawbench").glob("*/static/*.js"):
        for line in file.read_text(encoding="utf-8").splitlines():
            assert line.count("`") % 2 == 0  # no text goes over several lines


def test_a_viewer_that_was_removed_writes_nothing_into_the_address(chromium: Browser, two):
    opened(chromium, two)
    later = chromium.run(
        "const {viewer} = document.querySelector('.yv');"
        "viewer.seek(1); viewer.remove();"
        "let timers = 0; const plain = setTimeout;"
        "window.setTimeout = (...all) => { timers += 1; return plain(...all); };"
        "await new Promise((go) => requestAnimationFrame(() => requestAnimationFrame(go)));"
        "window.setTimeout = plain;"
        "return timers"
    )
    assert later == 0
