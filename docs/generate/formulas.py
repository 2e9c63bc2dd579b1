"""Formulas written as TeX between dollars, shown as MathML: no script, no network."""

from __future__ import annotations

import html
import re

from latex2mathml.converter import convert

_MATH = re.compile(
    r'<(?P<tag>span|div) class="arithmatex">(?:\\\((?P<inline>.*?)\\\)|\\\[(?P<block>.*?)\\\])</(?P=tag)>',
    re.DOTALL,
)


_FUNCTION = re.compile(r"<mi>(cos|sin|tan|tanh|arctan|exp)</mi>(?!<mo|<mrow><mo)")
"""A function whose argument follows without a bracket; TeX leaves a thin space there, browsers do not."""
_GAP = '<mspace width="0.17em"></mspace>'


def to_mathml(page: str) -> str:
    """Return a page with the formulas that arithmatex has marked turned into MathML.

    Raises:
        ValueError: a formula that cannot be converted, with its text.
    """
    return _MATH.sub(_replace, page)


def _replace(match: re.Match[str]) -> str:
    block = match["block"] is not None
    tex = html.unescape(match["block"] if block else match["inline"]).strip()
    try:
        made = convert(tex, display="block" if block else "inline")
    except Exception as error:
        raise ValueError(f"this formula cannot be shown: {tex}: {error}") from None
    made = _FUNCTION.sub(rf"{_GAP}<mi>\1</mi>{_GAP}", made)
    return f'<div class="formula">{made}</div>' if block else made
