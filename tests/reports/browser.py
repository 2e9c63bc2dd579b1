"""Real browsers for tests of pages, without windows, on files: Chromium, and Firefox for what may differ."""

from __future__ import annotations

import os
import shutil
from pathlib import Path
from typing import Any

import pytest

FLAGS = (
    "--headless=new",
    "--no-sandbox",  # containers run as root
    "--disable-gpu",
    "--disable-dev-shm-usage",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--hide-scrollbars",
)
PHONE, DESK = 400, 1400
SECONDS = 120
"""Longest wait for a page. Chosen: far more than any page takes, also on a busy computer."""
WAIT = (
    "const done = arguments[arguments.length - 1];"
    "const look = () => ({}) ? done() : requestAnimationFrame(look); look();"
)
"""Script that ends when an expression is true at the drawing of a frame."""


HELD = """
const held = [], append = document.head.append;
document.head.append = (script) => held.push(script);
const end = (script) => append.call(document.head, script);
const fail = (script) => script.dispatchEvent(new Event('error'));
const frames = () => new Promise((go) => requestAnimationFrame(() => requestAnimationFrame(go)));
const choose = async (link) => { link.click(); await frames(); return held.at(-1); };
const until = async (test) => { while (!test()) await frames(); };
"""
"""Beginning of a script that lets side files arrive, or fail, in an order of its own."""


class Browser:
    """One window. `console` returns what pages have complained of since it was last asked."""

    def __init__(self, driver: Any) -> None:
        self.driver = driver
        self.driver.set_script_timeout(SECONDS)
        self.width = DESK

    def open(
        self,
        file: Path,
        fragment: str = "",
        *,
        width: int = DESK,
        height: int = 900,
        density: int = 1,
        calm: bool = True,
    ) -> None:
        """Open a page in a window of that size; `calm`: the reader has asked for less motion.

        `density`: pixels of the screen in one of the page's; a second one makes drawing dearer by a quarter.
        """
        self.width = width
        metrics = {"width": width, "height": height, "deviceScaleFactor": density, "mobile": width < 600}
        self.driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics)
        wish = {"name": "prefers-reduced-motion", "value": "reduce" if calm else "no-preference"}
        self.driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": "", "features": [wish]})
        if fragment:  # where the fragment alone differs, nothing would be loaded
            self.driver.get("about:blank")
        self.driver.get(file.resolve().as_uri() + (fragment and f"#{fragment.removeprefix('#')}"))

    def reload(self) -> None:
        """Load the page again, and wait until it is loaded: what a script starts may end after it."""
        self.driver.refresh()

    def run(self, script: str, *arguments: Any) -> Any:
        """Return what a script in the page returns."""
        return self.driver.execute_script(script, *arguments)

    def wait_for(self, condition: str) -> None:
        """Wait until an expression is true at the drawing of a frame."""
        self.driver.execute_async_script(WAIT.replace("{}", condition))

    def press(self, *keys: str) -> None:
        """Press keys where the focus is."""
        from selenium.webdriver.common.action_chains import ActionChains

        ActionChains(self.driver).send_keys(*keys).perform()

    def console(self) -> list[str]:
        """Return the console's messages."""
        return [entry["message"] for entry in self.driver.get_log("browser")]

    def requests(self) -> list[str]:
        """Return what the page has fetched beside itself."""
        return self.run("return performance.getEntriesByType('resource').map((entry) => entry.name)")

    def overflow(self) -> float:
        """Return by how many pixels the page is wider than its window was made.

        `innerWidth` tells nothing: on a phone it grows with a page that is too wide.
        """
        return self.run("return document.documentElement.scrollWidth") - self.width


class Firefox:
    """One window of Firefox, driven by Mozilla's own client: Debian has no geckodriver."""

    def __init__(self, client: Any) -> None:
        self.client = client

    def open(self, file: Path, *, width: int = DESK, height: int = 900) -> None:
        """Open a page in a window of that size."""
        self.client.set_window_rect(width=width, height=height)
        self.client.navigate(file.resolve().as_uri())

    def run(self, script: str, *arguments: Any) -> Any:
        """Return what a script in the page returns."""
        return self.client.execute_script(script, script_args=list(arguments), sandbox=None)

    def wait_for(self, condition: str) -> None:
        """Wait until an expression is true at the drawing of a frame."""
        self.client.execute_async_script(
            WAIT.replace("{}", condition), script_timeout=1000 * SECONDS, sandbox=None
        )


def start_firefox(logs: Path) -> Firefox:
    """Return a window of Firefox, which keeps its log in a folder; skip the test where there is none."""
    found = (shutil.which(name) for name in ("firefox", "firefox-esr"))
    programs = [str(Path(path).resolve()) for path in found if path]
    program = next((path for path in programs if Path(path).with_name("application.ini").is_file()), None)
    if not program:  # a script that starts another program tells its client nothing about it
        pytest.skip("firefox is not installed: pages are tested in Chromium alone")
    marionette = pytest.importorskip("marionette_driver.marionette", reason="needs marionette-driver")
    client = marionette.Marionette(bin=program, headless=True, gecko_log=str(logs), port=0)  # 0: any free one
    client.start_session()
    return Firefox(client)


def start() -> Browser:
    """Return a browser; skip the test where there is none, unless CI says that there must be."""
    chromium = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
    chromedriver = shutil.which("chromedriver")
    if not chromium or not chromedriver:
        missing = "chromium" if not chromium else "chromedriver"
        if os.environ.get("CI") == "true":
            pytest.fail(f"{missing} is not installed, and CI must test pages in a browser")
        pytest.skip(f"{missing} is not installed: pages are not tested in a browser")
    from selenium import webdriver
    from selenium.webdriver.chrome.service import Service

    options = webdriver.ChromeOptions()
    options.binary_location = chromium
    for flag in FLAGS:
        options.add_argument(flag)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    return Browser(webdriver.Chrome(options=options, service=Service(chromedriver)))
