"""Measured errors that tell how far numbers can be trusted: asserted here, and printed in the docs.

`docs/evidence.json` keeps the figures, and the page "How far to trust the numbers" is made from it. A test
that measures one asserts its limit and that the record is still true; with `YAWBENCH_RECORD=1` in the
environment it writes the record anew in place of the second.
"""

from __future__ import annotations

import fcntl
import json
import os
from pathlib import Path

import pytest

FILE = Path(__file__).parents[1] / "docs" / "evidence.json"
RECORD = "YAWBENCH_RECORD"
SLACK = 0.5
"""A record is true as long as the figure has not changed by more than this share of it, or a twentieth of its
limit. Chosen: rounding differs from one processor to the next, a change of the models is larger."""


def measured(
    chapter: str,
    what: str,
    against: str,
    found: float,
    *,
    at_most: float | None = None,
    at_least: float = 0.0,
) -> None:
    """Assert that a figure keeps its limit, and that its record is true.

    Args:
        chapter: of the page: "cars", "tyres", "order", "energy", "mirror", "masters".
        what: was measured.
        against: what it was compared with.
        found: the figure: a largest difference as a share of the peak, an order.
        at_most, at_least: its limits; one is given.
    """
    limit = at_least if at_most is None else at_most
    found = float(found)
    assert found <= limit if at_most is not None else found >= limit, (what, against, found, limit)
    test = os.environ["PYTEST_CURRENT_TEST"].partition(" ")[0].partition("[")[0]
    entry = {"figure": float(f"{found:.3g}"), "limit": limit, "at_least": at_most is None, "test": test}
    place = f"{what} | {against}"
    if os.environ.get(RECORD):
        with FILE.open("r+", encoding="utf-8") as file:  # tests may run side by side
            fcntl.flock(file, fcntl.LOCK_EX)
            record = json.load(file)
            record.setdefault(chapter, {})[place] = entry
            file.seek(0)
            file.write(json.dumps(record, indent=1, ensure_ascii=False, sort_keys=True) + "\n")
            file.truncate()
        return
    known = json.loads(FILE.read_text(encoding="utf-8")).get(chapter, {}).get(place)
    hint = f"{RECORD}=1 pytest {test} records it in {FILE.name}"
    assert known is not None, f"{place} is not recorded; {hint}"
    assert known | {"figure": 0} == entry | {"figure": 0}, hint
    assert found == pytest.approx(known["figure"], rel=SLACK, abs=0.05 * limit), hint
