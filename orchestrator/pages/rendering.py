"""HTML rendering: the Jinja templates of all pages, their style, and verdict symbols."""

from __future__ import annotations

import functools
from importlib.resources import files
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from ..experiments.verdict_tables import FAILS, HOLDS, NOT_JUDGED, UNDECIDED
from ..messages import printable

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
