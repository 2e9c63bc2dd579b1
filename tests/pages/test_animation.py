"""`yawbench animate`, and what a browser makes of an animation."""

from __future__ import annotations

import base64
import re
from pathlib import Path

import numpy as np
import pytest

from components.driving.track import LaneChangeParameters
from orchestrator.cli import main
from orchestrator.pages.animation import FRAMES, assets, fragment, page
from tests.orchestrator.recorded import noted, write

from .browser import DESK, PHONE, Browser
from .made_up import data_in, whole_car, without

PLAYER = "const player = document.querySelector('.yb-animation').player;"


@pytest.fixture
def yawbench(capsys):
    """Call the command line and return its exit status and what it said."""

    def call(*arguments):
        with pytest.raises(SystemExit) as ended:
            main(list(arguments))
        return ended.value.code, capsys.readouterr().err

    return call


def test_animate_writes_one_page_of_one_run_or_two(yawbench, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name, gain in (("fnn", 1.0), ("off", 2.0)):
        write(whole_car(gain), tmp_path / "runs" / name)
    status, said = yawbench("animate", "runs/fnn")
    assert (status, said.split(":")[0]) == (0, "runs/fnn/animation.html")
    status, said = yawbench("animate", "runs/fnn", "runs/off", "--out", "two.html")
    assert (status, said.split(":")[0]) == (0, "two.html")
    html = Path("two.html").read_text(encoding="utf-8")
    assert [run["label"] for run in data_in(html)["runs"]] == ["fnn", "off"]
    assert "<title>fnn and off</title>" in html
    assert "<p>Sine at 25 m/s</p>" in html


def test_animate_makes_the_run_of_a_scenario_once_and_lays_another_beside_it(yawbench, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    scenario, short = "fuzzy_feedback/single_sine", ("--set", "stop_time=0.05 s")
    status, said = yawbench("animate", scenario, *short)
    assert (status, "[1/1]" in said) == (0, True)
    (made,) = Path("results").rglob("animation.html")
    assert "stop_time" in made.parent.name
    assert "changed: stop_time = 0.05 s" in made.read_text(encoding="utf-8")
    status, said = yawbench("animate", scenario, str(made.parent), *short, "--out", "two.html")
    assert (status, said.split(":")[0]) == (0, "two.html")  # nothing is run again


def test_animate_refuses_what_it_cannot_show(yawbench, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write(without(whole_car(), "position"), tmp_path / "still")
    status, said = yawbench("animate", "still")
    assert status == 2
    assert said.count("\n") == 1
    assert "cannot be animated: position_x and position_y were not recorded" in said
    assert yawbench("animate", *"abcdefgh") == (2, "an animation shows up to 7 runs, not 8\n")
    status, said = yawbench("animate", "nowhere")
    assert (status, "no results here" in said) == (2, True)


@pytest.fixture(scope="module")
def two(tmp_path_factory) -> Path:
    """A page of two runs with lanes."""
    one = whole_car()
    driver = {"name": "driver_double_lane_change", "parameters": vars(LaneChangeParameters())}
    noted(one, fmus={"driver": driver})
    file = tmp_path_factory.mktemp("page") / "two.html"
    file.write_text(page([("fuzzy neural network", one), ("off", whole_car(2.0))]), "utf-8")
    return file


def inked(chromium: Browser, canvas: str, bright: int = 720) -> float:
    """Return the share of a canvas's pixels that are not white, or darker than a sum of their colours."""
    return chromium.run(
        "const canvas = document.querySelector(arguments[0]);"
        "const {data} = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height);"
        "let n = 0;"
        "for (let i = 0; i < data.length; i += 4) n += data[i] + data[i + 1] + data[i + 2] < arguments[1];"
        "return n / (data.length / 4);",
        canvas,
        bright,
    )


@pytest.mark.parametrize("width", [PHONE, 768, DESK])
def test_the_page_is_drawn_at_every_width_without_complaint(chromium, two, width):
    chromium.open(two, width=width)
    assert chromium.console() == []
    assert chromium.requests() == []
    assert chromium.overflow() <= 0
    for canvas in (".yb-scene", ".yb-strip", ".yb-close canvas"):
        assert inked(chromium, canvas) > 0.002, canvas
    sizes = chromium.run(
        "return [...document.querySelectorAll('canvas')].map((c) => [c.width / c.clientWidth, c.clientWidth])"
    )
    assert all(ratio == pytest.approx(2.0, rel=0.02) for ratio, _ in sizes)  # crisp: device pixels
    assert all(wide > 120 for _, wide in sizes)


def test_the_slider_moves_the_cars_and_the_numbers(chromium, two):
    chromium.open(two)
    script = (
        PLAYER + "const slider = document.querySelector('.yb-slider'); slider.value = arguments[0];"
        "slider.dispatchEvent(new Event('input'));"
        "return {x: player.states[0].x, time: document.querySelector('.yb-time').textContent,"
        " spoken: slider.getAttribute('aria-valuetext'), cells: [...document.querySelectorAll('tbody td')]"
        ".map((cell) => cell.textContent)};"
    )
    recorded = whole_car()
    for time in (2.0, 6.5):
        shown = chromium.run(script, time)
        assert shown["time"] == shown["spoken"] == f"{time:.2f} s"
        assert shown["x"] == pytest.approx(
            np.interp(time, recorded.time, recorded["plant.position_x"]), abs=0.02
        )
        speed = np.interp(time, recorded.time, recorded["plant.velocity_x"]) * 3.6
        assert float(shown["cells"][0]) == pytest.approx(speed, abs=0.051)
        slip = np.degrees(np.interp(time, recorded.time, recorded["plant.sideslip"]))
        assert float(shown["cells"][2].replace("−", "-")) == pytest.approx(slip, abs=0.011)
    assert shown["cells"][1] == shown["cells"][0]


def test_the_picture_changes_with_time(chromium, two):
    chromium.open(two)
    look = PLAYER + "player.seek(arguments[0]); return player.scene.toDataURL();"
    assert chromium.run(look, 1.0) != chromium.run(look, 4.0)
    assert chromium.run(look, 4.0) == chromium.run(look, 4.0)


def test_the_keyboard_plays_steps_and_zooms(chromium, two):
    from selenium.webdriver.common.keys import Keys

    chromium.open(two)
    state = PLAYER + "return [player.time, player.playing, player.view.zoom]"
    chromium.press(Keys.HOME)
    assert chromium.run(state) == [0, False, 1]
    chromium.press(Keys.ARROW_RIGHT)
    assert chromium.run(state)[0] == pytest.approx(8.0 / (FRAMES - 1))
    chromium.press(Keys.END)
    assert chromium.run(state)[0] == 8
    chromium.press("+")
    assert chromium.run(state)[2] > 1
    chromium.press(" ")
    assert chromium.run(state)[1] is True
    chromium.press(" ")
    assert chromium.run(state)[1] is False


def test_controls_are_reached_in_order_and_have_names(chromium, two):
    from selenium.webdriver.common.keys import Keys

    chromium.open(two)
    reached = []
    for _ in range(7):
        chromium.press(Keys.TAB)
        reached.append(chromium.run("return document.activeElement.className"))
    assert reached == ["yb-scene", "yb-play", "yb-rate", "yb-camera", "yb-out", "yb-in", "yb-slider"]
    names = [
        element.accessible_name
        for element in chromium.driver.find_elements("css selector", "button, select, input")
    ]
    assert all(names), names


def test_it_plays_by_itself_unless_less_motion_is_asked_for(chromium, two):
    chromium.open(two, calm=False)
    chromium.wait_for("document.querySelector('.yb-animation').player.time > 0.05")
    assert chromium.run(PLAYER + "return player.playing") is True
    chromium.open(two, calm=True)
    assert chromium.run(PLAYER + "return [player.playing, player.time === player.data.still]") == [
        False,
        True,
    ]


def test_a_run_plays_to_its_end_and_stops(chromium, two):
    chromium.open(two)
    chromium.run(PLAYER + "player.seek(7.9); player.rate = 2; player.play();")
    chromium.wait_for("!document.querySelector('.yb-animation').player.playing")
    assert chromium.run(PLAYER + "return [player.time, player.button.textContent]") == [8, "Play"]


def test_a_finger_on_the_curve_chooses_the_moment(chromium, two):
    chromium.open(two, width=PHONE)
    where = chromium.run(
        "const strip = document.querySelector('.yb-strip'); strip.scrollIntoView({block: 'center'});"
        "const box = strip.getBoundingClientRect(); return [box.left + box.width / 2, box.top + 30];"
    )
    point = [{"x": where[0], "y": where[1]}]
    chromium.driver.execute_cdp_cmd("Input.dispatchTouchEvent", {"type": "touchStart", "touchPoints": point})
    chromium.driver.execute_cdp_cmd("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})
    chromium.wait_for("document.querySelector('.yb-animation').player.touched")
    assert chromium.run(PLAYER + "return player.time") == pytest.approx(4.0, abs=0.05)


def test_every_view_keeps_what_it_follows_in_sight(chromium, two):
    chromium.open(two, width=PHONE)
    for view, followed in (("cars", (0, 1)), ("0", (0,)), ("1", (1,)), ("whole", (0, 1))):
        for time in (0.0, 4.0, 8.0):
            places, size = chromium.run(
                PLAYER + "const camera = document.querySelector('.yb-camera'); camera.value = arguments[0];"
                "camera.dispatchEvent(new Event('change')); player.seek(arguments[1]);"
                "const {clientWidth, clientHeight} = player.scene;"
                "return [player.states.map((state) => state.screen), [clientWidth, clientHeight]]",
                view,
                time,
            )
            for run in followed:
                assert all(0 < at < limit for at, limit in zip(places[run], size, strict=True)), (view, time)


def test_runs_differ_in_grey_print(two):
    runs = data_in(two.read_text(encoding="utf-8"))["runs"]
    assert runs[0]["dash"] != runs[1]["dash"]


def test_several_animations_share_a_page(chromium, tmp_path):
    parts = [fragment([("one", whole_car())]), fragment([("a", whole_car()), ("b", whole_car(2.0))])]
    file = tmp_path / "report.html"
    head = '<!DOCTYPE html><html lang="en"><meta charset="utf-8"><link rel="icon" href="data:,">'
    file.write_text(f"{head}<title>report</title>{assets()}{''.join(parts)}</html>", "utf-8")
    chromium.open(file, calm=False)
    assert chromium.console() == []
    players = "[...document.querySelectorAll('.yb-animation')].map((root) => root.player)"
    assert chromium.run(f"return {players}.map((player) => player.playing)") == [False, False]
    chromium.run(f"{players}[0].seek(1)")
    times = chromium.run(f"return {players}.map((player) => player.time)")
    assert times[0] == 1 and times[1] != 1


def test_a_bare_run_is_drawn_without_complaint(chromium, tmp_path):
    file = tmp_path / "bare.html"
    bare = without(whole_car(), "tyre_force", "load", "sideslip", "yaw_rate", "moment", "velocity", "steer")
    file.write_text(page([("bare", bare)]), "utf-8")
    chromium.open(file, width=PHONE)
    assert chromium.console() == []
    assert chromium.overflow() <= 0
    assert inked(chromium, ".yb-scene") > 0.002
    assert chromium.run("return document.querySelector('figcaption').textContent").endswith(
        "tyre forces were not recorded"
    )


def test_a_sideslip_angle_beyond_half_a_turn_comes_back_at_the_other_end(chromium, tmp_path):
    spun = whole_car()
    turned = np.linspace(np.pi - 0.2, np.pi + 0.2, spun.time.size)
    spun.columns["plant.sideslip"][:] = (turned + np.pi) % (2 * np.pi) - np.pi
    file = tmp_path / "spun.html"
    file.write_text(page([("spun", spun)]), "utf-8")
    chromium.open(file)
    middle = float(np.interp(np.pi, turned, spun.time))
    script = PLAYER + "player.seek(arguments[0]); return player.states[0].sideslip"
    for time in np.linspace(middle - 0.1, middle + 0.1, 41):
        assert abs(chromium.run(script, float(time))) > 3.1
    drawn = chromium.run(
        "const c = document.querySelector('.yb-strip'), p = c.getContext('2d');"
        "const row = Math.round(c.height * 0.4), {data} = p.getImageData(0, row, c.width, 1);"
        "let n = 0; for (let i = 0; i < data.length; i += 4) n += data[i] < 150 && data[i + 2] > 120;"
        "return n;"
    )
    assert drawn == 0  # no line from one end to the other


def test_a_standing_car_is_drawn_without_an_arrow_of_its_motion(chromium, tmp_path):
    pictures = []
    for name, speed in (("standing", 0.0), ("driving", 20.0)):
        car = whole_car()
        for column in car.columns:
            if "velocity" in column:
                car.columns[column][:] = speed if column.endswith("velocity_x") else 0.0
        file = tmp_path / f"{name}.html"
        file.write_text(page([("car", car)]), "utf-8")
        chromium.open(file)
        chromium.run(PLAYER + "player.seek(0)")
        pictures.append(inked(chromium, ".yb-close canvas", 450))
    assert pictures[0] < pictures[1]


def test_print_holds_the_moment_and_shows_no_controls(chromium, two):
    chromium.open(two, calm=False)
    chromium.wait_for("document.querySelector('.yb-animation').player.time > 0.02")
    chromium.run("document.querySelector('.yb-animation').player.rate = 0.01")  # far from its end
    pdf = base64.b64decode(chromium.driver.execute_cdp_cmd("Page.printToPDF", {})["data"])
    assert len(re.findall(rb"/Type\s*/Page\b", pdf)) == 1
    assert chromium.run(PLAYER + "return player.playing") is False
    chromium.driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": "print"})
    hidden = "return getComputedStyle(document.querySelector(arguments[0])).display"
    shown = {
        name: chromium.run(hidden, f".yb-{name}") for name in ("play", "slider", "scene", "time", "readouts")
    }
    assert shown["play"] == shown["slider"] == "none"
    assert "none" not in (shown["scene"], shown["time"], shown["readouts"])
