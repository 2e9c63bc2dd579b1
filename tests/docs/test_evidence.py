"""The record of what tests have measured, and the page that is made from it."""

from __future__ import annotations

import json
import re
import sys

import pytest

from tests.checkout import ROOT
from tests.evidence import FILE

sys.path.insert(0, str(ROOT / "docs"))
from generate import evidence

ENTRIES = [
    (chapter, place, entry)
    for chapter, entries in json.loads(FILE.read_text(encoding="utf-8")).items()
    for place, entry in entries.items()
]


@pytest.mark.parametrize(("chapter", "place", "entry"), ENTRIES, ids=[place for _, place, _ in ENTRIES])
def test_a_recorded_figure_keeps_its_limit_and_its_test_still_measures_it(chapter, place, entry):
    assert entry["figure"] >= entry["limit"] if entry["at_least"] else entry["figure"] <= entry["limit"]
    file, _, name = entry["test"].partition("::")
    body = re.search(rf"^def {name}\(.*?(?=^\S|\Z)", (ROOT / file).read_text(encoding="utf-8"), re.M | re.S)
    assert body, f"{entry['test']} is gone; so its figures have to go from {FILE.name}"
    assert f'measured("{chapter}"' in body[0]


def test_the_page_tells_every_figure_under_a_heading_of_its_own():
    page = evidence.page()
    assert {chapter for chapter, _, _ in ENTRIES} == set(evidence.CHAPTERS)
    assert page.count("| `test_") == len(ENTRIES) > 20
