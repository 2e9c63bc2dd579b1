"""Results of a study, for the tests of its file: `study` made some of its runs, `whole` all."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

Number = Callable[[str, str], float]


@pytest.fixture
def metric(study: dict[str, Any]) -> Number:
    """Return a metric of a run."""
    return lambda run, name: study["runs"][run]["metrics"][name]["value"]


@pytest.fixture
def metric_of_all(whole: dict[str, Any]) -> Number:
    """Return a metric of a run, of any."""
    return lambda run, name: whole["runs"][run]["metrics"][name]["value"]


@pytest.fixture
def derived(study: dict[str, Any]) -> Callable[[str], float]:
    """Return a number derived from several runs."""
    return lambda name: study["derived"][name]["value"]
