"""Texts for LaTeX: all engines, pdfLaTeX among them, set them without further packages."""

from __future__ import annotations

import re
import unicodedata

MATHEMATICS = {
    "°": r"^\circ", "·": r"\cdot", "×": r"\times", "±": r"\pm", "\N{MINUS SIGN}": "-", "≈": r"\approx",
    "≤": r"\le", "≥": r"\ge", "≠": r"\ne", "∞": r"\infty", "∫": r"\int", "√": r"\surd", "∂": r"\partial",
    "→": r"\to", "✓": r"\surd", "✗": r"\times", "★": r"\star", "†": r"\dagger",
}  # fmt: skip
"""Characters of formulas, units and verdicts -> mathematics in LaTeX."""
GREEK = {"phi": "varphi", "epsilon": "varepsilon", "omicron": "mathrm{o}"}
"""Small letters -> the commands of those that our symbols have the shape of, or that have none."""
LIKE_LATIN = dict(zip("ΑΒΕΖΗΙΚΜΝΟΡΤΧ", "ABEZHIKMNOPTX", strict=True))
"""Greek capitals that LaTeX has no commands for -> Latin ones."""
LACKING = "«»ÐÞðþĄąĐđĘęĦħĮįĸĿŀŉŊŋŦŧŲųſ"
"""What pdfLaTeX has not, up to U+017F, in its default fonts (TeX Live 2022, OT1 and TS1)."""
LATIN = "".join(chr(code) for code in range(0xA1, 0x180) if chr(code) not in LACKING) + "–—‘’‚“”„•…€™"
"""What it has."""
ESCAPED = {
    "\\": r"\textbackslash{}", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}",
    "`": r"\textasciigrave{}", "|": r"\textbar{}", "<": r"\textless{}", ">": r"\textgreater{}",
    "[": "{[}", "*": "{*}", **{sign: f"\\{sign}" for sign in "&%$#_{}"},
}  # fmt: skip
"""Characters that mean something else to LaTeX; `[` and `*` at the beginning of a row."""


def characters(text: str) -> str:
    """Return a text with the characters beyond ASCII as commands, where pdfLaTeX has not got them.

    One that no command stands for becomes its number, `[U+4E2D]`.

    >>> characters("δ ≤ 2 °/s²")
    '\\\\ensuremath{\\\\delta} \\\\ensuremath{\\\\le} 2 \\\\ensuremath{^\\\\circ}/s\\\\textsuperscript{2}'
    """
    return re.sub(r"[^\x00-\x7f]", lambda match: _command(match[0]), unicodedata.normalize("NFC", text))


def escaped(text: str) -> str:
    """Return a plain text as one that LaTeX sets as it is.

    >>> escaped("a_b --set 5 %")
    'a\\\\_b -{}-set 5 \\\\%'
    """
    safe = "".join(ESCAPED.get(sign, sign) for sign in text)
    return characters(re.sub(r"-(?=-)", "-{}", safe))


def _command(character: str) -> str:
    if character in LIKE_LATIN:
        return rf"\ensuremath{{\mathrm{{{LIKE_LATIN[character]}}}}}"
    if character in MATHEMATICS:
        return rf"\ensuremath{{{MATHEMATICS[character]}}}"
    name = re.fullmatch(r"GREEK (?:SMALL|(CAPITAL)) LETTER (FINAL )?(\w+)", unicodedata.name(character, ""))
    if name and "Α" <= character <= "ω":
        capital, final, letter = name[1], name[2], name[3].lower().replace("lamda", "lambda")
        command = letter.capitalize() if capital else GREEK.get(letter, letter)
        return rf"\ensuremath{{\{'var' if final else ''}{command}}}"
    kind = unicodedata.decomposition(character).partition(" ")[0]
    plain = unicodedata.normalize("NFKD", character)
    if kind in ("<super>", "<sub>"):
        return rf"\text{kind[1:-1]}script{{{escaped(plain)}}}"
    if character in LATIN:
        return character
    return escaped(plain) if plain.isascii() else rf"{{[}}U+{ord(character):04X}]"
