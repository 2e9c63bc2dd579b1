"""Sentences for users: what diagnostics say."""

from __future__ import annotations

from typing import Any


def texts_of(told: Any) -> tuple[str, ...]:
    """Return the texts of the diagnostics of a plan, a run or an error."""
    return tuple(map(str, told.diagnostics))
