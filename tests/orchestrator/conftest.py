"""Fixtures of foreign FMUs and their runs, of which `test_foreign` has the marks, too."""

from __future__ import annotations

import pytest

from tests.orchestrator.test_foreign import scenario  # noqa: F401 - a fixture for all tests here


@pytest.fixture
def isolate() -> list[str]:
    """Options of a run that say whether its instances have processes of their own, set by the marks."""
    return []
