"""Studies of the papers, made now, against the numbers and verdicts that the docs are made of."""

from __future__ import annotations

from typing import Any

import pytest

from docs.generate.papers import Numbers, numbers_of, recorded

AS_RECORDED = {"rel": 1e-4, "abs": 1e-8}
"""Differences that other processors make: a tenth of what a page shows, and nothing of cars at rest."""
UNMET = {
    "A": ["Under harsh steering at 40 m/s learning does no harm."],
    "B": [
        "Every controller keeps the mean yaw-rate error to a quarter of that without control.",
        "Slip control keeps the slip below 0.15.",
        "Slip control keeps the car.",
        "It keeps the slip below 0.15 also where driving and turning begin at the same instant.",
    ],
    "table_3": [
        "The order within the groups is the paper's, too, with and without shares of zero or a quarter.",
        "With 0 on the left it is lost with 0.25 on the right, and kept with 0.5 or more.",
    ],
    "C": [
        "Tuned alike, next to nothing remains of that, 2 % of the peaks at most, at no less chatter.",
        "With the limit as printed PID makes the ramp's sideslip worse than without control.",
        "Between cones it is clean at 70 km/h, and at 90 km/h with transitions twice as long.",
    ],
    "D": [],
    "laws": [
        "The network reaches its 5 % with motors that lag as well, learning as fast as without lag.",
        "By the complete learning rule it does.",
    ],
}
"""Study -> those of its checks that do not hold."""


def assert_recorded(name: str, study: dict[str, Any]) -> Numbers:
    """Assert that the runs of a study that were made, and what follows from them, are as recorded."""
    known, found = recorded()[name], numbers_of(study["folder"], name)
    assert found.runs
    for run, metrics in found.runs.items():
        assert metrics == pytest.approx(known.runs[run], **AS_RECORDED), run
    for key, value in found.derived.items():
        assert value == pytest.approx(known.derived[key], **AS_RECORDED), key
    margins = {claim.says: claim.margin for claim in known.claims}
    for claim in study["claims"] if margins else ():
        assert claim["holds"] in (None, margins[claim["says"]] > 0.0), claim["says"]
    for check in study["checks"] if name in UNMET else ():
        assert check["holds"] in (None, check["says"] not in UNMET[name]), check["says"]
    return found
