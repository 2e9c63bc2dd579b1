"""What all pages share: the types that templates show, the templates' filters, scripts and figures as images.

A page is a typed view, a subclass of `Page`, that a template shows; a part of a page is a `Part`. Templates
are in the folder `templates/` of the view's own package, and may extend and import those here; scripts and
style sheets are in `static/` likewise. So a wing, or a package of somebody else, brings pages of its own.
"""

from __future__ import annotations

import base64
import functools
import gzip
import os
import re
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime, timezone
from importlib.metadata import distribution
from importlib.resources import files
from pathlib import Path
from typing import ClassVar, NamedTuple

from jinja2 import ChoiceLoader, Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from yawbench.foundation.messages import printable
from yawbench.metrics.verdict import Status, VerdictText
from yawbench.orchestrator.plan import Override
from yawbench.orchestrator.results.record_of_plan import versions
from yawbench.studies.tables import Table

PAGE = "report.html"
"""File name of the page of a study, a ranking or several studies."""
RANKING = Path("results/proving_ground/ranking", PAGE)
"""Default path of the ranking's page."""


class FigureImage(NamedTuple):
    """A whole figure: its title, and its image as SVG."""

    title: str
    svg: str


def image_of(file: Path, title: str) -> FigureImage:
    """Return an SVG file as an image."""
    return FigureImage(title, file.read_text(encoding="utf-8"))


def option_of(change: Override) -> list[str]:
    """Return an override as an option of the command line."""
    if change.target.kind == "vehicle_file":
        return ["--vehicle", os.path.relpath(str(change.value))]
    if change.faulty:
        return ["--fault", f"{change.faulty}: {change.value}"]
    text = str(change.value).lower() if isinstance(change.value, bool) else str(change.value)
    return ["--swap" if change.swaps else "--set", f"{change.target}={text}"]


def now() -> str:
    """Return the time at which a page is made, as text."""
    return f"{datetime.now(timezone.utc):%Y-%m-%d %H:%M} UTC"


def anchor(text: str) -> str:
    """Return a text as an HTML anchor name."""
    return re.sub(r"[^a-z0-9]+", "-", text.lower()).strip("-")


SIGNS = {
    Status.PASSED: ("good", "✓"),
    Status.FAILED: ("bad", "✗"),
    Status.SENSITIVE: ("unsure", "±"),
    Status.UNDECIDED: ("unsure", "?"),
    Status.NOT_JUDGED: ("open", "–"),
}
"""Status -> CSS class and symbol, which differ even without colours."""


@dataclass(frozen=True, kw_only=True)
class Part:
    """What a template shows, as its variable `view`, on a page or as a part of one."""

    template: ClassVar[str]
    """Name of a file in `templates/` of the package of the class."""


@dataclass(frozen=True, kw_only=True)
class Page(Part):
    """A page: its heading; style sheets and scripts besides those of all pages."""

    title: str
    assets: Assets | None = None


@dataclass(frozen=True, kw_only=True)
class ViewerPage(Page):
    """A page around a viewer.

    Attributes:
        many: tables of a section from which on they are folded. Chosen: more hide what comes after them.
    """

    template = "viewer_page.html.j2"
    viewer: Markup
    sentence: str = ""  # the result
    below: str = ""  # a line on what the data are
    warnings: Sequence[str] = ()  # shown below the sentence
    first: Sequence[Table] = ()  # tables before the viewer
    notes: Sequence[str] = ()  # below the viewer
    sections: Sequence[tuple[str, Sequence[Table]]] = ()  # heading, or "", and tables
    many: int = 6


def render(view: Part) -> str:
    """Return a page or a part of one; a variable that is missing is an error, not empty text."""
    package = type(view).__module__.rpartition(".")[0]
    return _templates(package).get_template(view.template).render(view=view)


@functools.cache
def _templates(package: str) -> Environment:
    """Return the environment of a package's templates; each template is compiled once."""
    places = dict.fromkeys((package, __package__))
    environment = Environment(
        loader=ChoiceLoader([PackageLoader(place) for place in places]),
        autoescape=True,
        undefined=StrictUndefined,
        finalize=lambda value: printable(value) if type(value) is str else value,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {"sign": sign_of, "verdict": verdict_sign}
    environment.filters |= {"minus": with_minus, "compressed": compressed}
    program = f"yawbench {versions()['yawbench']}"
    environment.globals |= {"static": lambda name: Markup(static(name)), "program": program, "now": now}
    return environment


def compressed(text: str) -> str:
    """Return a text compressed by gzip, in base64, for the attribute `data-packed`; see `static/page.js`.

    For what needs JavaScript or is not seen at first: scripts, data, folded parts, images.
    """
    return base64.b64encode(gzip.compress(text.encode(), 9, mtime=0)).decode()


@dataclass(frozen=True)
class Assets:
    """Style sheets and scripts of a page."""

    style: str
    script: str


def static(name: str, package: str = __package__) -> str:
    """Return a style sheet or a script of a package, of all pages, or of uPlot."""
    folders = [files(place) / "static" for place in dict.fromkeys((package, __package__))]
    folders.append(Path(str(distribution("uplot-python").locate_file("uplot/static"))))
    return next(file for folder in folders if (file := folder / name).is_file()).read_text(encoding="utf-8")


def without_comments(script: str) -> str:
    """Return a script without indentation and `//` comments: 15 kB less in every page.

    Text over several lines would lose its indentation; a test holds that no script has any.
    """
    return re.sub(r"^[ \t]*(?://.*)?\n|^[ \t]+|[ \t]+//\s[^'\"`\n]*$", "", script, flags=re.MULTILINE)


def with_minus(text: str) -> str:
    """Return a text with a minus before its negative numbers; a hyphen is shorter, and ends a line."""
    return re.sub(r"(?<![^\s(])-(?=\.?\d)", "−", text)


def sign_of(words: VerdictText) -> tuple[str, str]:
    """Return CSS class and symbol of a verdict in words."""
    return SIGNS[words.status]


def verdict_sign(text: str) -> Markup:
    """Return the text of a verdict with its symbol; other text unchanged."""
    if not isinstance(text, VerdictText):
        return Markup.escape(text)
    kind, sign = sign_of(text)
    return Markup('<span class="verdict {}"><b aria-hidden="true">{}</b> {}</span>').format(kind, sign, text)
