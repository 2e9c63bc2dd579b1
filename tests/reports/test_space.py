"""The scene of a page in three dimensions, and videos of it."""

from __future__ import annotations

import json
from urllib.parse import quote

import numpy as np
import pytest
from PIL import Image

import yawbench as yb
from tests.command_line import status_of
from tests.refusals import mentions, refused
from yawbench.foundation.errors import ResultsError, ScenarioError
from yawbench.reports import video
from yawbench.reports.road import road_of

PICTURE = "return document.querySelector('.yv-scene').toDataURL()"


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """Folders of two runs of a lane change of ISO 3888."""
    folder = tmp_path_factory.mktemp("runs")
    scenario = yb.load("proving_ground/iso_3888_2").set({"stop_time": 5.0})
    return [scenario.set({"speed": speed}).run().save(folder / str(speed)) for speed in (14.0, 20.0)]


@pytest.fixture(scope="module")
def page(runs, tmp_path_factory):
    file = tmp_path_factory.mktemp("page") / "view.html"
    assert status_of("animate", *runs, "--out", file) == 0
    return file


def opened(chromium, page, **state):
    chromium.open(page, "run?" + "&".join(f"{k}={quote(json.dumps(v))}" for k, v in state.items()), width=700)
    chromium.wait_for("document.querySelector('.yv-ready')")


def test_every_camera_shows_another_picture_that_a_link_repeats(chromium, page):
    opened(chromium, page, time=2.5)
    pictures = {}
    for camera in ("cars", "chase", "side", "fixed", "orbit"):
        chromium.run(
            "const camera = document.querySelector('.yv-camera'); camera.value = arguments[0];"
            "camera.dispatchEvent(new Event('change')); document.querySelector('.yv').viewer.moveCursor()",
            camera,
        )
        pictures[camera] = chromium.run(PICTURE)
    for shown, baseline in (([0, 1], 1), ([0], 0)):  # a hidden run is not drawn, and the baseline is solid
        show = "const {viewer} = document.querySelector('.yv'); viewer.showRuns(...arguments);"
        chromium.run(f"{show} viewer.moveCursor()", shown, baseline)
        pictures[baseline] = chromium.run(PICTURE)
    assert len({*pictures.values()}) == len(pictures) == 7
    opened(chromium, page, camera="side", time=2.5)
    assert chromium.run("return document.querySelector('.yv-camera').value") == "side"
    assert chromium.run(PICTURE) == pictures["side"]
    assert chromium.console() == []


def test_the_scene_follows_the_cursor_and_turns_when_dragged(chromium, page):
    from selenium.webdriver.common.action_chains import ActionChains

    opened(chromium, page, camera="orbit", time=1.0)
    before = chromium.run(PICTURE)
    chromium.run("document.querySelector('.yv').viewer.seek(2.5)")
    chromium.wait_for("document.querySelector('.yv-clock').textContent === '2.500 s'")
    after = chromium.run(PICTURE)
    assert after != before
    scene = chromium.driver.find_element("css selector", ".yv-scene")
    ActionChains(chromium.driver).drag_and_drop_by_offset(scene, 60, 20).perform()
    assert chromium.run(PICTURE) != after
    turn, rise = chromium.run("return document.querySelector('.yv').viewer.state.look")
    assert turn < -0.1 and rise > 0.01
    chromium.wait_for("location.hash.includes('look')")


def test_pages_have_the_heights_of_wheels_in_the_air():
    run = yb.load("proving_ground/sine_with_dwell").set({"stop_time": 3.0, "plant.cg_height": 0.9}).run()
    height = run.scene().height - run.scene().car.radius
    lifts = road_of(run.results, [])["lifts"]
    assert lifts and max(max(heights) for *_, heights in lifts) == pytest.approx(height.max(), abs=0.002)
    for wheel, begin, step, heights in lifts:
        column = ("fl", "fr", "rl", "rr").index(wheel)
        times = begin + step * np.arange(len(heights))
        assert np.interp(times, run.time, height[:, column])[:-1] == pytest.approx(heights[:-1], abs=0.002)


def test_a_video_has_the_frames_of_the_run_and_moves(runs, tmp_path, chromium):
    file = tmp_path / "fast.gif"
    assert status_of("animate", runs[1], "--camera", "side", "--speed", "10", "--out", file) == 0
    with Image.open(file) as clip:
        seconds = yb.open(runs[1]).time[-1]
        assert clip.n_frames == int(seconds / 10 * video.RATE) + 1 and clip.size == video.SIZE
        assert clip.info["duration"] == 1000 // video.RATE
        frames = []
        for k in (0, clip.n_frames // 2):
            clip.seek(k)
            frames.append(np.asarray(clip.convert("RGB"), float))
    assert np.abs(frames[0] - frames[1]).mean() > 1.0


def test_what_a_video_cannot_be_is_said_in_a_sentence(runs, page, chromium, capsys, monkeypatch, tmp_path):
    assert status_of("animate", runs[0], "--camera", "chase") == 2
    assert status_of("animate", runs[0], "--camera", "above", "--out", tmp_path / "a.gif") == 2
    said = capsys.readouterr().err
    assert mentions(said, "--camera", ".gif") and mentions(said, "above", "chase")
    monkeypatch.setattr(video.shutil, "which", lambda name: None)
    with refused(ResultsError, "package-missing", names=("chromium",)):
        video.write_video("", tmp_path / "a.gif", camera="chase", speed=1.0)
    monkeypatch.undo()
    with refused(ScenarioError, "option-invalid", names=("--speed 0.01",)):
        video.write_video(page.read_text(), tmp_path / "a.gif", camera="chase", speed=0.01)
