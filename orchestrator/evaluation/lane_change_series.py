"""The highest speed at which a track between cones is driven clean, over many runs.

From the first speed on in steps, up while runs are clean, else down until one is; then the middle of the
last two speeds, until they differ by no more than the resolution. Whatever is not clean counts as such: a
cone touched, a car that rolls over, a record that ends too early.

Source: ISO 3888-2 leaves the score to who drives; the highest clean entry speed is the common one.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from .judgement import Judgement, Series, Verdict

CLEAN = "clean"


def highest_clean(
    clean: Callable[[float], bool], *, first: float, step: float, resolution: float, least: float, most: float
) -> tuple[float | None, float | None]:
    """Return the highest value that was clean and the lowest above it that was not, None where there is none.

    Args:
        clean: asked once per value.
        first, step: where to begin, and by what to go on.
        resolution: by how much both may differ in the end.
        least, most: bounds of the values.

    >>> highest_clean(lambda v: v < 61.3, first=50, step=10, resolution=1, least=10, most=200)
    (61.25, 61.875)
    """
    good = bad = None
    value = min(max(first, least), most)
    while good is None or bad is None:
        if clean(value):
            good, nearer = value, min(value + step, most)
        else:
            bad, nearer = value, max(value - step, least)
        if nearer == value:
            return good, bad
        value = nearer
    while bad - good > resolution:
        value = 0.5 * (good + bad)
        if clean(value):
            good = value
        else:
            bad = value
    return good, bad


@dataclass
class EntrySpeedSeries(Series):
    """What the runs of a track come to, in the order of their speeds."""

    highest: float | None = None  # entry speed that was clean, below all that were not [m/s]
    touched: float | None = None  # lowest that was not [m/s]

    @property
    def summary(self) -> str:
        if self.highest is None:
            return "No run is clean."
        above = "" if self.touched is None else f"; not clean at {3.6 * self.touched:.1f} km/h"
        return f"Highest clean entry speed: {3.6 * self.highest:.1f} km/h{above}."

    def as_data(self) -> dict[str, Any]:
        return {"highest_clean_entry_speed": self.highest, "lowest_not_clean": self.touched}


def judge_entry_speeds(runs: Sequence[Judgement]) -> EntrySpeedSeries:
    """Return the highest clean entry speed of runs, with no run below it that is not clean."""
    reached = [run for run in runs if run["entry"] is not None]
    series = EntrySpeedSeries(sorted(reached, key=lambda run: run["entry"] or 0.0))
    for run in series.runs:
        ruling = run.rulings.get(CLEAN)
        if ruling is None or ruling.verdict is not Verdict.PASSED:
            series.touched = run["entry"]
            break
        series.highest = run["entry"]
    return series
