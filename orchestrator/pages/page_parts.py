"""Parts shared by all pages: templates, style, verdict symbols, figures as images, tables of FMUs."""

from __future__ import annotations

import functools
import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from datetime import datetime, timezone
from importlib.resources import files
from pathlib import Path
from typing import Any
from urllib.parse import quote

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from ..experiments.tables import Table
from ..experiments.verdict_tables import FAILS, HOLDS, NOT_JUDGED, UNDECIDED
from ..messages import printable
from ..plan import Plan
from ..results.plan_record_and_freshness import versions
from ..results.read_and_salvage import Results

CURLY = str.maketrans("'\"", "’”")
"""Typographic quotes for text, so that straight ones occur only in the markup."""


def address_of(svg: str) -> Markup:
    """Return an SVG image as a short `data:` URL for an attribute in double quotes."""
    svg = svg[svg.index("<svg") :]
    svg = re.sub(r"<metadata>.*?</metadata>", "", svg, flags=re.DOTALL)
    svg = re.sub(r"(?<=>)[^<]+(?=<)", lambda text: text[0].translate(CURLY), svg)
    svg = svg.replace("'", "").replace('"', "'")
    svg = re.sub(
        r"(scale\([^)]*\))|(\.\d\d)\d+", lambda found: found[1] or found[2], svg
    )  # glyphs keep their aspect ratio
    svg = re.sub(r"\s*\n\s*", "\n", svg)
    return Markup("data:image/svg+xml," + quote(svg, safe=" =:/'(),;.-+*!?@$[]{}|^`~"))


@dataclass(frozen=True)
class FigureImage:
    """A whole figure: its title, and its image as a `data:` URL for an `<img>`."""

    title: str
    address: Markup


def image_of(file: Path, title: str) -> FigureImage:
    """Return an SVG file as an image."""
    return FigureImage(title, address_of(file.read_text(encoding="utf-8")))


def fmus_of(runs: Iterable[Results | Plan]) -> Table:
    """Return the table of all FMUs in the runs, taken from their records or plans."""
    found: dict[tuple[str, str], dict[str, None]] = {}
    for one in runs:
        for unit, name, sha256 in _fmus_in(one):
            found.setdefault((name, sha256), {})[unit] = None
    ordered = sorted(found.items(), key=lambda one: (min(one[1]), one[0][0]))
    rows = [(name, ", ".join(units), sha256) for (name, sha256), units in ordered]
    return Table("", ["FMU", "as", "SHA-256"], [*rows])


def _fmus_in(one: Results | Plan) -> Iterator[tuple[str, str, str]]:
    """Yield instance, FMU and its hash."""
    if isinstance(one, Plan):
        yield from ((unit.name, unit.fmu.name, unit.fmu.sha256) for unit in one.instances)
    else:
        for unit, fmu in one.record.fmus.items():
            yield unit, fmu.name or unit, fmu.sha256


def programs_of(runs: Iterable[Results | Plan]) -> dict[str, str]:
    """Return the versions of the programs that made the runs, taken from their records.

    Runs without a record, known by their key in the journal, have today's versions: the key includes them.
    """
    found: dict[str, dict[str, None]] = {}
    for one in runs:
        known = versions() if isinstance(one, Plan) else one.record.versions
        for name, version in known.items():
            found.setdefault(name, {})[str(version)] = None
    return {name: " and ".join(several) for name, several in found.items()}


def made_by() -> dict[str, object]:
    """Return the content of the footer of every page."""
    return {
        "versions": versions(),
        "made": f"{datetime.now(timezone.utc):%Y-%m-%d %H:%M} UTC",
    }


def anchor(text: str) -> str:
    """Return a text as an HTML anchor name."""
    return re.sub(r"[^a-z0-9]+", "-", text.lower()).strip("-")


SIGNS = {
    HOLDS: ("good", "✓"),
    UNDECIDED: ("unsure", "?"),
    NOT_JUDGED: ("open", "–"),
    **{word: ("bad", "✗") for word in FAILS.values()},
}
"""Verdict -> CSS class and symbol, which differ even without colours."""


def render(template: str, **facts: Any) -> str:
    """Render a template; a variable that is missing is an error, not empty text."""
    return _templates().get_template(template).render(facts)


@functools.cache
def _templates() -> Environment:
    """Return the template environment; each template is compiled once."""
    environment = Environment(
        loader=PackageLoader("orchestrator.pages"),
        autoescape=True,
        undefined=StrictUndefined,
        finalize=lambda value: printable(value) if type(value) is str else value,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["verdict"] = verdict_sign
    return environment


def style() -> Markup:
    """Return the style sheet shared by all pages with text."""
    return Markup((files(__package__) / "static" / "page.css").read_text(encoding="utf-8"))


def verdict_sign(word: str) -> Markup:
    """Return a verdict as a symbol with its word; other text unchanged."""
    if word not in SIGNS:
        return Markup.escape(word)
    kind, sign = SIGNS[word]
    return Markup('<span class="verdict {}"><b aria-hidden="true">{}</b> {}</span>').format(kind, sign, word)
