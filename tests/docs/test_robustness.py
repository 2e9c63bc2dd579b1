"""What the record of attacks says of the program's limits is so."""

from __future__ import annotations

import importlib
import re
from pathlib import Path

from tests.trials.kills import COMMANDS

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "robustness.md"
SCALES = {"MB": 10**6, "GB": 10**9}


def test_the_limits_on_the_page_are_those_of_the_program() -> None:
    rows = re.findall(r"\| ([\d,]+)(?: (MB|GB))? \| `([\w.]+)\.(\w+)` \|", PAGE.read_text(encoding="utf-8"))
    assert len(rows) >= 12
    for number, scale, module, name in rows:
        limit = getattr(importlib.import_module(module), name)
        assert limit == int(number.replace(",", "")) * SCALES.get(scale, 1), f"{module}.{name}"


def test_every_test_that_the_security_policy_names_exists() -> None:
    named = re.findall(r"`(test_\w+)`", (ROOT / "SECURITY.md").read_text(encoding="utf-8"))
    sources = "\n".join(file.read_text(encoding="utf-8") for file in (ROOT / "tests").rglob("test_*.py"))
    defined = set(re.findall(r"def (test_\w+)", sources))
    assert named
    assert not set(named) - defined


def test_every_command_that_is_killed_has_its_row_in_which_all_held() -> None:
    table = PAGE.read_text(encoding="utf-8").partition("## Commands killed")[2].partition("\n## ")[0]
    rows = re.findall(r"\| `([\w-]+)` \| (\d+) \| (\d+) \| (\d+) \| (\d+) \| (\d+) \|", table)
    assert {name for name, *_ in rows} == set(COMMANDS)
    for name, *numbers in rows:
        kills, by_kill, by_term, before, held = map(int, numbers)
        assert kills >= 20, name
        assert by_kill + by_term + before == kills, name
        assert held == kills, name
