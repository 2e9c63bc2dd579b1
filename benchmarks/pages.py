"""Times and sizes of pages in a browser: `make bench`, or `python -m benchmarks.pages`.

Prints, and asserts nothing: times depend on the machine and on who else uses it. Every time is the best of
several, followed by the median. The page is that of a comparison of four runs of paper A; a bench page of
`yawbench serve` has sliders for the same scenario.
"""

from __future__ import annotations

import tempfile
from collections.abc import Mapping, Sequence
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path
from statistics import median
from time import perf_counter

import pytest

from tests.bench.test_serve import serving
from tests.command_line import status_of
from tests.reports.browser import Browser, start
from tests.reports.flaws import size_without_samples
from yawbench.reports.page_parts import PAGE

SCENARIO = "fnn_sideslip/25mps"
CONTROLLERS = "controller_off,controller_fnn,controller_fuzzy_sideslip,controller_fuzzy_pid"
LOADS, MOVES = 5, 20
"""Repeats of what loads a page, and of what the reader does on it."""
PAINT = """
const afterPaint = (tell) => {
  const {port1, port2} = new MessageChannel();
  port1.onmessage = tell;
  port2.postMessage(0);
};
"""
"""Script that calls a function when the current frame has been painted."""
PAINTED = f"""{PAINT}
const look = () => {{
  const panel = document.querySelector('.yv')?.viewer?.panels[0];
  if (panel?.plot) afterPaint(() => {{ window.painted = performance.now(); }});
  else requestAnimationFrame(look);
}};
requestAnimationFrame(look);
"""
"""Script that notes when the first curve of a page has been painted [ms from the request for the page]."""
FRAMES = f"""{PAINT}
const [count, action, done] = arguments;
const times = [];
const act = new Function('viewer', 'k', action);
const frame = () => requestAnimationFrame(() => {{
  const began = performance.now();
  act(document.querySelector('.yv').viewer, times.length);
  afterPaint(() => {{
    times.push(performance.now() - began);
    if (times.length < count) frame(); else done(times);
  }});
}});
frame();
"""
"""Script that acts at the beginning of frames, and returns how long each took until it was painted [ms]."""
ZOOM = "viewer.zoomTo(k % 2 ? null : [2 + 0.01 * k, 4])"
CURSOR = "viewer.state.time = 1 + 0.3 * (k % 20); viewer.moveCursor()"


def line(what: str, times: Sequence[float], most: str) -> None:
    """Print the best and the median of times [ms], and what the best is to be at most."""
    print(f"  {what:62s}{min(times):7.0f}{median(times):9.0f}   {most}", flush=True)


def made(folder: Path, *command: str) -> Path:
    """Return the page that a command writes into a folder."""
    with redirect_stdout(StringIO()):
        status_of(*command, "--out", folder)
    return folder / PAGE


def comparison(browser: Browser, page: Path) -> None:
    """Print the times of the page of a comparison of four runs."""
    first = []
    for _ in range(LOADS):
        browser.open(page)
        browser.wait_for("window.painted")
        first.append(browser.run("return window.painted"))
    browser.wait_for("document.querySelector('.yv').classList.contains('yv-ready')")
    zoom, cursor = (browser.driver.execute_async_script(FRAMES, MOVES, action) for action in (ZOOM, CURSOR))
    line("comparison of 4 runs: first curve", first, "600")
    line("zoom of all panels", zoom, "33")
    line("cursor in all panels and on the road", cursor, "16")


def sizes(pages: Mapping[str, tuple[Path, int]]) -> None:
    """Print the sizes of pages [kB], each beside the largest that it may have, and without samples."""
    for title, (page, most) in pages.items():
        html = page.read_text(encoding="utf-8")
        whole, without = len(html.encode()) / 1000, size_without_samples(html) / 1000
        print(f"  {f'{title}: kB; without samples':62s}{whole:7.0f}{without:9.0f}   {most}; 250")


def sliders(browser: Browser) -> None:
    """Print the times of the bench with sliders: each first curve is that of a server of its own."""
    shown, whole, moves = [], [], []
    for _ in range(LOADS):
        with tempfile.TemporaryDirectory() as folder, serving(Path(folder)) as server:
            began = perf_counter()
            browser.driver.get(f"{server.address}bench?scenario={SCENARIO}")
            browser.wait_for("document.querySelector('form.bench').dataset.shown")
            whole.append(1000 * (perf_counter() - began))
            shown.append(shown_after(browser))
            for k in range(MOVES // LOADS):
                browser.run(
                    "const form = document.querySelector('form.bench'); delete form.dataset.shown;"
                    "const slider = form.querySelector('input[type=range]');"
                    "slider.value = Number(slider.value) * (1 - 0.02 * (1 + arguments[0]));"
                    "slider.dispatchEvent(new Event('input'));",
                    k,
                )
                browser.wait_for("document.querySelector('form.bench').dataset.shown")
                moves.append(shown_after(browser))
    line("bench with sliders: first curve, from the request for the run", shown, "300")
    line("first curve, from the request for the page", whole, "")
    line("curves after a move of a slider", moves, "")


def shown_after(browser: Browser) -> float:
    """Return after how many ms the latest run of a bench page was shown."""
    return float(browser.run("return document.querySelector('form.bench').dataset.shown"))


def main() -> None:
    """Print all times and sizes, or why there are none."""
    try:
        browser = start()
    except pytest.skip.Exception as why:
        print(f"No times of pages: {why}")
        return
    try:
        browser.driver.execute_cdp_cmd("Page.addScriptToEvaluateOnNewDocument", {"source": PAINTED})
        print(f"  {'pages in Chromium, ms':62s}{'best':>7s}{'median':>9s}   at most")
        with tempfile.TemporaryDirectory() as place:
            folder = Path(place)
            compared = made(folder / "compare", "compare", SCENARIO, "--swap", f"controller={CONTROLLERS}")
            comparison(browser, compared)
            sliders(browser)
            sizes({
                "comparison of 4 runs": (compared, 1200),
                "quick study": (made(folder / "study", "study", "fnn_sideslip/study", "--quick"), 2500),
                "quick ranking": (made(folder / "rank", "rank", "--quick"), 400),
            })  # fmt: skip
    finally:
        browser.driver.quit()


if __name__ == "__main__":
    main()
