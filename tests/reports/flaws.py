"""Flaws of a page that a careful reader would complain of: things cut, overlapping, empty, too wide."""

from __future__ import annotations

import functools
import re
from importlib.resources import files
from itertools import product
from pathlib import Path

import pytest
from _pytest.mark import ParameterSet

from tests.reports.browser import Browser

CUT = """
const scrolls = (e) => ['auto', 'scroll'].includes(getComputedStyle(e).overflowX);
const boxed = (e) => e !== document.body && (scrolls(e) || boxed(e.parentElement));
const edge = document.documentElement.clientWidth + 1;
const hidden = (e) => e.closest('thead') && getComputedStyle(e.closest('thead')).position === 'absolute';
return [...document.querySelectorAll('body *')].filter((e) => {
  const box = e.getBoundingClientRect();
  if (!box.width || !box.height || !e.checkVisibility() || e.closest('svg') || hidden(e)) return false;
  if (e.closest('.yv-hidden, .skip')) return false;
  const style = getComputedStyle(e);
  const shortened = style.textOverflow === 'ellipsis' && e.title;
  const clips = ['hidden', 'clip'].includes(style.overflowX) && !shortened;
  const clipped = clips && e.scrollWidth > e.clientWidth + 1;
  return (!boxed(e.parentElement) && (box.right > edge || box.left < -1)) || clipped;
}).map((e) => `${e.tagName} ${e.className}: ${e.textContent.trim().slice(0, 60)}`);
"""
OVERLAPPING = """
const scrolledAway = (e, box) => {
  const frame = e.closest('.yv-table, .yv-happened > div, .beside > :first-child')?.getBoundingClientRect();
  return frame && (box.bottom > frame.bottom || box.top < frame.top);
};
const leaves = 'p, li, h1, h2, h3, h4, summary, figcaption, caption, img, canvas, button, select, td, th';
const boxes = [...document.querySelectorAll(leaves)]
  .filter((e) => !e.querySelector(leaves) && !e.closest('svg') && e.checkVisibility())
  .filter((e) => !e.closest('.yv-hidden, .skip, .yv-foot')) // the foot lies over what scrolls below it
  .filter((e) => !(e.closest('thead') && getComputedStyle(e.closest('thead')).position === 'absolute'))
  .map((e) => ({e, box: e.getBoundingClientRect()}))
  .filter(({e, box}) => box.width > 0 && box.height > 0 && !scrolledAway(e, box))
  .sort((a, b) => a.box.top - b.box.top);
const found = [];
boxes.forEach(({e, box}, i) => {
  for (let k = i + 1; k < boxes.length && boxes[k].box.top < box.bottom - 1; k += 1) {
    const other = boxes[k].box;
    if (other.left < box.right - 1 && box.left < other.right - 1) {
      const named = [e, boxes[k].e].map((one) => `${one.tagName} ${one.textContent.trim().slice(0, 40)}`);
      found.push(named.join(' / '));
    }
  }
});
return found;
"""
TEXTS_ON_EACH_OTHER = """
const found = [];
for (const svg of document.querySelectorAll('.system svg')) {
  const frame = svg.getBoundingClientRect();
  if (!frame.width) continue;
  const texts = [...svg.querySelectorAll('text')].map((e) => [e.textContent, e.getBoundingClientRect()]);
  texts.forEach(([text, box], i) => {
    const inside = box.left > frame.left - 1 && box.right < frame.right + 1 && box.bottom < frame.bottom + 1;
    if (!inside) found.push(`outside: ${text}`);
    for (const [other, place] of texts.slice(i + 1)) {
      const across = Math.min(box.right, place.right) - Math.max(box.left, place.left);
      const down = Math.min(box.bottom, place.bottom) - Math.max(box.top, place.top);
      if (across > 1 && down > 0.4 * box.height) found.push(`${text} / ${other}`);
    }
  });
}
return found;
"""
EMPTY = """
const done = arguments[0];
const inked = (image) => {
  const canvas = document.createElement('canvas');
  [canvas.width, canvas.height] = [240, 120];
  const context = canvas.getContext('2d');
  context.drawImage(image, 0, 0, 240, 120);
  const {data} = context.getImageData(0, 0, 240, 120);
  let count = 0;
  for (let i = 0; i < data.length; i += 4) {
    count += data[i + 3] > 0 && data[i] + data[i + 1] + data[i + 2] < 700;
  }
  return count / (240 * 120);
};
Promise.all([...document.images].map(async (image) => {
  try { await image.decode(); } catch { return `broken: ${image.alt}`; }
  return inked(image) > 0.01 ? null : `empty: ${image.alt}`;
})).then((said) => done(said.filter(Boolean)));
"""


AXE = """
const done = arguments[arguments.length - 1];
const keepsState = (node) => node.html.includes('href="#') && node.html.includes('?');
const texts = ['id', 'href', 'title', 'alt', 'value', 'aria-label'];
const shape = (e) => JSON.stringify([
  e.tagName,
  [...e.childNodes].some((one) => one.nodeType === Node.TEXT_NODE && one.data.trim()),
  [...e.attributes].map(({name, value}) => {
    const text = texts.includes(name) || name.startsWith('data-');
    return [name, text && !/^#[^?]*$/.test(value) ? Boolean(value.trim()) : value];
  }),
  [...e.children].map(shape),
]);
const ids = [...document.querySelectorAll('[id]')].map(({id}) => id);
const found = ids.filter((id, i) => ids.indexOf(id) < i).map((id) => `duplicate-id: ${id}`);
const alike = [...document.querySelectorAll('tbody')].flatMap((body) => {
  const number = {};
  return [...body.rows].filter((row) => {
    const which = shape(row);
    number[which] = 1 + (number[which] || 0);
    return number[which] > 2;
  });
});
const back = alike.map((row) => {
  const place = document.createComment('');
  row.replaceWith(place);
  return () => place.replaceWith(row);
});
axe.run(document, {resultTypes: ['violations']}).then(({violations}) => {
  back.forEach((put) => put());
  done([...found, ...violations.flatMap((one) =>
    one.nodes.filter((node) => one.id !== 'skip-link' || !keepsState(node))
      .map((node) => `${one.id}: ${node.target}: ${node.failureSummary.split('\\n')[1] || ''}`))]);
});
"""
"""Runs axe-core, which is slow on long tables, without rows that differ from two before them by texts only.

Targets of links within the page count as differences. A link whose fragment holds the state of a view,
#view?shown=[0], does not skip to a place of the page.
"""


COLOURS = ("dark", "light")


def looks(*widths: int, narrow: bool) -> list[ParameterSet]:
    """Return all pairs of a width and of a page's colours, for tests of its accessibility.

    Of the first tier is one pair, as axe-core takes seconds: the first width in dark colours where `narrow`,
    else the last in light ones. Pages share their styles; about as many have the one as the other.
    """
    first = (widths[0], COLOURS[0]) if narrow else (widths[-1], COLOURS[-1])
    return [
        pytest.param(*look, marks=() if look == first else pytest.mark.exhaustive)
        for look in product(widths, COLOURS)
    ]


def inaccessible(chromium: Browser, *colours: str) -> list[str]:
    """Return what axe-core finds on the page that is open, in the named colours, by default in all."""
    found = []
    for scheme in colours or COLOURS:
        wish = {"name": "prefers-color-scheme", "value": scheme}
        calm = {"name": "prefers-reduced-motion", "value": "reduce"}
        chromium.driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": "", "features": [wish, calm]})
        chromium.run(axe())
        found += [f"{scheme}: {said}" for said in chromium.driver.execute_async_script(AXE)]
    chromium.run("scrollTo({top: 0, behavior: 'instant'})")  # axe-core scrolls to what it looks at
    return found


@functools.cache
def axe() -> str:
    """Return the script of axe-core."""
    return (files("axe_selenium_python") / "node_modules/axe-core/axe.min.js").read_text(encoding="utf-8")


def flaws(chromium: Browser) -> list[str]:
    """Return all that is wrong with the page that is open, as sentences."""
    chromium.wait_for("!document.querySelector('.yv:not(.yv-ready), [data-packed]')")
    found = [f"console: {said}" for said in chromium.console()]
    found += [f"fetched: {name[:60]}" for name in chromium.requests() if not name.startswith("data:")]
    if (wide := chromium.overflow()) > 0:
        found.append(f"wider than the window by {wide} px")
    for what, script in (("cut", CUT), ("overlap", OVERLAPPING), ("drawing", TEXTS_ON_EACH_OTHER)):
        found += [f"{what}: {said}" for said in chromium.run(script)]
    return found + chromium.driver.execute_async_script(EMPTY)


PAPER = 703
"""Width of the text on A4 paper in CSS pixels: 210 mm without the margins of `@page`."""
IN_PRINT = """
const cut = [...document.querySelectorAll('main *')].filter((e) => {
  const {width, right} = e.getBoundingClientRect();
  return width > 2 && right > arguments[0] + 1 && e.checkVisibility() && !e.closest('.yv-hidden, svg');
}).map((e) => `${e.tagName} ${e.className}: ${e.textContent.trim().slice(0, 40)}`);
const viewers = [...document.querySelectorAll('.yv')].filter(({viewer}) => viewer);
const dark = viewers.filter(({viewer}) => viewer.theme.ground !== '#fff');
return [...cut.slice(0, 9), ...dark.map((e) => `drawn in dark colours: ${e.id}`)];
"""


def flaws_in_print(chromium: Browser) -> list[str]:
    """Return what paper would not show of the page that is open, for a reader who prefers dark colours."""
    wish = {"name": "prefers-color-scheme", "value": "dark"}
    chromium.driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": "", "features": [wish]})
    chromium.run("dispatchEvent(new Event('beforeprint'))")
    size = {"width": PAPER, "height": 900, "deviceScaleFactor": 1, "mobile": False}
    chromium.driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
    chromium.driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": "print", "features": [wish]})
    found = chromium.run(IN_PRINT, PAPER)
    chromium.driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": "", "features": []})
    chromium.run("dispatchEvent(new Event('afterprint'))")
    return found


def open_all(chromium: Browser) -> None:
    """Unfold everything that unfolds."""
    chromium.run("document.querySelectorAll('details').forEach((one) => { one.open = true; });")


SCREENS = ((1440, 900), (390, 844))
"""Width and height of the first screens that a page is designed for: a desk's and a phone's."""
CHARTS = ".yv-chart, .ys-map svg, figure.chart img"


def check_first_screen(chromium: Browser, page: Path, width: int, height: int) -> None:
    """Open a page: the answer and the first curve, or a map's larger part, are on its first screen."""
    chromium.open(page, width=width, height=height)
    chromium.wait_for("!document.querySelector('.yv:not(.yv-ready), [data-packed]')")
    chromium.wait_for("[...document.images].every((image) => image.complete)")
    answer, chart, middle = chromium.run(
        "const shown = (name) => [...document.querySelectorAll(name)].map((e) => e.getBoundingClientRect())"
        "  .filter((box) => box.height > 20).sort((a, b) => a.top - b.top)[0];"
        "const [answer, chart] = ['p.said', arguments[0]].map(shown);"
        "return [answer.bottom, chart.top, (chart.top + chart.bottom) / 2];",
        CHARTS,
    )
    assert answer < chart < middle < height
    assert chromium.overflow() <= 0


def size_without_samples(html: str) -> int:
    """Return the size of a page [bytes] without the samples that it carries."""
    return len(html.encode()) - sum(map(len, re.findall(r'<script type="text/plain">(.*?)</script>', html)))


def check_budgets(chromium: Browser, page: Path) -> None:
    """The page that is open has at most 2,100 elements, and 250 kB without samples."""
    elements = chromium.run("return document.querySelectorAll('*').length")
    assert elements <= 2100, f"{elements} elements"
    assert size_without_samples(page.read_text(encoding="utf-8")) < 250_000


def check_whole(chromium: Browser, page: Path, width: int, colours: str) -> None:
    """Open a page and unfold everything: it has no flaws, and stays within the budget without samples."""
    chromium.open(page, width=width)
    assert flaws(chromium) == []
    open_all(chromium)
    assert flaws(chromium) == []
    assert inaccessible(chromium, colours) == []
    check_budgets(chromium, page)
    assert flaws_in_print(chromium) == []
