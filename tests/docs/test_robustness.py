"""Limits of the program, as docs/robustness.md states them."""

from __future__ import annotations

import importlib
import re
from pathlib import Path

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "robustness.md"
SCALES = {"MB": 10**6, "GB": 10**9}


def test_the_limits_on_the_page_are_those_of_the_program() -> None:
    rows = re.findall(r"\| ([\d,]+)(?: (MB|GB))? \| `([\w.]+)\.(\w+)` \|", PAGE.read_text(encoding="utf-8"))
    assert len(rows) >= 12
    for number, scale, module, name in rows:
        limit = getattr(importlib.import_module(module), name)
        assert limit == int(number.replace(",", "")) * SCALES.get(scale, 1), f"{module}.{name}"
