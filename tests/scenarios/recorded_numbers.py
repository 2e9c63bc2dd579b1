"""Numbers of the papers' studies against those that the docs are made of."""

from __future__ import annotations

import pytest

from docs.generate.papers import Numbers, recorded

AS_RECORDED = {"rel": 1e-4, "abs": 1e-8}
"""Differences that other processors make: a tenth of what a page shows, and nothing of cars at rest."""


def assert_recorded(name: str, found: Numbers) -> None:
    """Assert that the runs of a study that were made, and what is derived from them, are as recorded."""
    known = recorded()[name]
    assert found.runs
    for run, metrics in found.runs.items():
        assert metrics == pytest.approx(known[run], **AS_RECORDED), run
    for key, value in found.derived.items():
        assert value == pytest.approx(known.derived[key], **AS_RECORDED), key
