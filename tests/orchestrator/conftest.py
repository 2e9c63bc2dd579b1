"""Isolated runs: tests marked `together_and_apart` or `mostly_together` of `test_foreign` make both kinds."""

from __future__ import annotations

import pytest


@pytest.fixture
def isolate() -> list[str]:
    """Options of a run that say whether its instances have processes of their own."""
    return []
