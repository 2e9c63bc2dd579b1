"""A video of runs as the pages draw them: frames of a page's scene, from a browser without a window.

A page's script draws every frame, so that a video shows what the page shows. Needs Chromium, its driver and
the package selenium; nothing is downloaded.
"""

from __future__ import annotations

import base64
import io
import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from yawbench.foundation.errors import ResultsError, ScenarioError
from yawbench.foundation.messages import listed
from yawbench.foundation.safe_files import write_whole

FORMATS = {".gif": "GIF", ".webp": "WEBP", ".png": "PNG"}
"""Ending of a file of moving pictures -> its format; a PNG has frames (APNG)."""
CAMERAS = ("chase", "side", "fixed", "orbit", "cars", "whole")
"""Cameras of the page: four in space, and two from above."""
RATE = 20
"""Frames per second; chosen: the fastest of which GIF players keep the time."""
SIZE = (720, 450)
"""Width and height [pixels]; chosen: a column of a page."""
MOST = 1200
"""Largest number of frames; chosen: a minute."""
BROWSERS, DRIVERS = ("chromium", "chromium-browser", "google-chrome"), ("chromedriver",)
FLAGS = ("--headless=new", "--disable-gpu", "--no-sandbox", "--disable-dev-shm-usage", "--hide-scrollbars")
READY = """
const done = arguments[arguments.length - 1];
const look = () => (document.querySelector('.yv-ready') ? done() : requestAnimationFrame(look));
look();
"""
BEGIN = """
const [width, height, camera] = arguments;
const viewer = document.querySelector('.yv').viewer;
if (!viewer.road) return null;
viewer.road.scene.style.cssText = `width: ${width}px; height: ${height}px; border: 0`;
viewer.state.camera = viewer.road.camera.value = camera;
return viewer.ends();
"""
FRAME = """
const {state, road} = document.querySelector('.yv').viewer;
state.time = arguments[0];
road.draw(1);
return road.scene.toDataURL('image/png');
"""


def write_video(page: str, file: Path, *, camera: str, speed: float) -> int:
    """Write a video of the scene of a page, and return the number of its frames.

    Args:
        page: the page of a viewer.
        file: its ending is one of `FORMATS`.
        camera: one of `CAMERAS`.
        speed: of the video over that of the car.

    Raises:
        ResultsError: a program or package is missing, no run has a position, or the file cannot be written.
        ScenarioError: it would be longer than `MOST` frames.
    """
    from PIL import Image

    frames = [Image.open(io.BytesIO(picture)).convert("RGB") for picture in _frames(page, camera, speed)]
    data = io.BytesIO()
    first, *others = frames
    kind = FORMATS[file.suffix]
    own: dict[str, Any] = {"quality": 80} if kind == "WEBP" else {}
    first.save(data, kind, save_all=True, append_images=others, duration=1000 // RATE, loop=0, **own)
    try:
        write_whole(file, data.getvalue())
    except OSError as error:
        raise ResultsError(
            f"{file}: cannot write the video: {error.strerror or error}", code="results-unwritable"
        ) from None
    return len(frames)


def _frames(page: str, camera: str, speed: float) -> Iterator[bytes]:
    """Yield the frames as PNG."""
    with tempfile.TemporaryDirectory(prefix="yawbench-") as folder:
        place = Path(folder) / "page.html"
        place.write_text(page, encoding="utf-8")
        browser = _browser(Path(folder))
        try:
            browser.get(place.as_uri())
            browser.execute_async_script(READY)
            ends = browser.execute_script(BEGIN, *SIZE, camera)
            if ends is None:
                raise ResultsError(
                    "a video needs the position and the yaw angle of a car, which no run has recorded",
                    code="signal-unknown",
                )
            begin, end = ends
            count = int((end - begin) / speed * RATE) + 1
            if count > MOST:
                raise ScenarioError(
                    f"--speed {speed:g}: the video would have {count} frames, more than {MOST}: "
                    f"take at least {(end - begin) * RATE / (MOST - 1):.2g}",
                    code="option-invalid",
                )
            for k in range(count):
                url = browser.execute_script(FRAME, begin + k * speed / RATE)
                yield base64.b64decode(url.partition(",")[2])
        finally:
            browser.quit()


def _browser(folder: Path) -> Any:
    """Return a browser without a window, with its profile in a folder.

    Raises:
        ResultsError: a program or package is missing.
    """
    try:
        from selenium import webdriver
        from selenium.webdriver.chrome.service import Service
    except ImportError:
        raise ResultsError(
            "a video needs the package selenium: pip install 'yawbench[video]'", code="package-missing"
        ) from None
    chosen = []
    for names in (BROWSERS, DRIVERS):
        found = next(filter(None, map(shutil.which, names)), None)
        if found is None:
            raise ResultsError(
                f"a video is drawn in a browser: install {listed(names, last='or')}", code="package-missing"
            )
        chosen.append(found)
    options = webdriver.ChromeOptions()
    options.binary_location = chosen[0]
    for flag in (*FLAGS, f"--user-data-dir={folder / 'profile'}"):
        options.add_argument(flag)
    return webdriver.Chrome(options=options, service=Service(chosen[1]))
