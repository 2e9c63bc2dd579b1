"""The check of what readers cannot reach or read: it passes over rows that are alike, and over no other."""

from __future__ import annotations

import pytest

from .browser import Browser
from .flaws import inaccessible

PAGE = """<!DOCTYPE html><html lang="en"><meta charset="utf-8"><title>Rows</title>
<link rel="icon" href="data:,">
<main><h1>Rows</h1><table><thead><tr><th scope="col">Name</th><th scope="col">Value</th></tr></thead>
<tbody>{}</tbody></table></main></html>"""
LIKE = [f'<tr><th scope="row">{k}</th><td><a href="?{k}">more of {k}</a></td></tr>' for k in range(9)]


@pytest.mark.parametrize(
    ("row", "found"),
    [
        ('<tr><th scope="row">9</th><td><a href="?9">more of 9</a></td></tr>', ""),
        ('<tr><th scope="row">9</th><td><a href="?9"></a></td></tr>', "link-name"),
        ('<tr><th scope="row">9</th><td><a href="#9">more of 9</a></td></tr>', "skip-link"),
        ('<tr><th scope="row">9</th><td style="color: #ccc">pale</td></tr>', "color-contrast"),
        ('<tr><th scope="row" id="a">9</th><td></td></tr><tr><th scope="row" id="a">10</th><td></td></tr>',
         "duplicate-id"),
    ],
)  # fmt: skip
def test_a_row_unlike_those_before_it_is_looked_at(chromium: Browser, tmp_path, row, found):
    file = tmp_path / "rows.html"
    file.write_text(PAGE.format("".join([*LIKE, row])), encoding="utf-8")
    chromium.open(file)
    number = chromium.run("return document.querySelectorAll('tr').length")
    said = inaccessible(chromium, "light")
    assert {one.split(": ")[1] for one in said} == ({found} if found else set())
    assert chromium.run("return document.querySelectorAll('tr').length") == number
