"""The page that is made from the record of what tests have measured."""

from __future__ import annotations

import json
import re
import sys

from tests.checkout import ROOT
from tests.evidence import FILE

sys.path.insert(0, str(ROOT / "docs"))
from generate import evidence


def test_the_page_tells_every_figure_under_a_heading_of_its_own_and_its_test_is_there():
    record = json.loads(FILE.read_text(encoding="utf-8"))
    entries = [entry for chapter in record.values() for entry in chapter.values()]
    assert record.keys() == set(evidence.CHAPTERS)
    assert evidence.page().count("| `test_") == len(entries) > 20
    for file, _, name in (entry["test"].partition("::") for entry in entries):
        text = (ROOT / file).read_text(encoding="utf-8")
        body = re.search(rf"^def {name}\(.*?(?=^\S|\Z)", text, re.M | re.S)
        assert body and "measured(" in body[0], f"its figures go from {FILE.name}"
    for entry in entries:
        assert entry["figure"] >= entry["limit"] if entry["at_least"] else entry["figure"] <= entry["limit"]
