"""How much room the results of a run will take."""

from __future__ import annotations

import math
import shutil
from pathlib import Path

from ..plan import Plan
from .formats import FORMATS

HUGE = 2e9
"""Bytes from which on a run says so before it starts; chosen: what takes a minute to read back."""


def expected_size(plan: Plan, format: str) -> int:
    """Return about how many bytes the results of a run will take in a format."""
    return (plan.n_steps + 1) * (len(plan.record) + 1) * FORMATS[format].bytes


def size_note(plan: Plan, folder: Path, format: str) -> str | None:
    """Return a warning of results that are huge or will not fit into `folder`, None of others."""
    size, free = expected_size(plan, format), _free(folder)
    if size < HUGE and size <= free:
        return None
    note = (
        f"{folder / FORMATS[format].file} will take about {_shown(size)} "
        f"({plan.n_steps + 1} rows of {len(plan.record)} variables)"
    )
    if size > free:
        note += f", and {_shown(free)} are free there"
    shorter = "name the variables that you need under 'record:' in the scenario"
    if format == "csv":
        return f"{note}; {shorter}, or take --format parquet ({_shown(expected_size(plan, 'parquet'))})"
    return f"{note}; {shorter}"


def _free(folder: Path) -> float:
    """Return the free bytes of the disk that a folder is on or will be made on."""
    absolute = folder.absolute()
    try:
        return shutil.disk_usage(
            next(place for place in (absolute, *absolute.parents) if place.exists())
        ).free
    except OSError:
        return math.inf


def _shown(size: float) -> str:
    return f"{size / 1e9:.1f} GB" if size >= 1e9 else f"{size / 1e6:.0f} MB"
