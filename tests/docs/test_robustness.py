"""Limits of the program, as docs/robustness.md states them."""

from __future__ import annotations

import importlib
import re
from pathlib import Path

from tests.trials import result_folders
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


def test_every_command_that_is_killed_has_its_row_in_which_all_held() -> None:
    table = PAGE.read_text(encoding="utf-8").partition("## Commands killed")[2].partition("\n## ")[0]
    rows = re.findall(r"\| `([\w-]+)` \| (\d+) \| (\d+) \| (\d+) \| (\d+) \| (\d+) \|", table)
    assert {name for name, *_ in rows} == set(COMMANDS)
    for name, *numbers in rows:
        kills, by_kill, by_term, before, held = map(int, numbers)
        assert kills >= 20, name
        assert by_kill + by_term + before == kills, name
        assert held == kills, name


def test_the_page_tells_how_many_folders_of_results_are_tried() -> None:
    text = PAGE.read_text(encoding="utf-8")
    ((folders, calls, result, sentence, bad),) = re.findall(
        r"\| ([\d,]+) \| ([\d,]+) \| ([\d,]+) \| ([\d,]+) \| (\d+) \|\n\nFound on the way", text
    )
    every = result_folders.cases()
    assert f"A quarter of {len(every):,} folders" in " ".join(text.split())
    assert number(folders) == len(every[::4])
    assert number(calls) == number(folders) * (len(result_folders.EVERY_TIME) + 2)
    assert number(result) + number(sentence) + number(bad) == number(calls)


def number(text: str) -> int:
    return int(text.replace(",", ""))
