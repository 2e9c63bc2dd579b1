"""The highest speed at which a track between cones is driven clean, over many runs.

From the first speed on in steps, up while runs are clean, else down until one is; then the middle of the
last two speeds, until they differ by no more than the resolution. Whatever is not clean counts as such: a
cone touched, a car that rolls over, a record that ends too early.

Source: ISO 3888-2 leaves the score to who drives; the highest clean entry speed is the common one.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence

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


def judge_entry_speeds(runs: Sequence[Judgement]) -> Series:
    """Return the highest clean entry speed of runs, with no run below it that is not clean."""
    ordered = sorted((run for run in runs if run["entry"] is not None), key=lambda run: run["entry"] or 0.0)
    clean = list(itertools.takewhile(is_clean, ordered))
    highest = clean[-1]["entry"] if clean else None
    touched = ordered[len(clean)]["entry"] if len(clean) < len(ordered) else None
    said = "No run is clean."
    if highest is not None:
        above = "" if touched is None else f"; not clean at {3.6 * touched:.1f} km/h"
        said = f"Highest clean entry speed: {3.6 * highest:.1f} km/h{above}."
    return Series(ordered, said, {"highest_clean_entry_speed": highest, "lowest_not_clean": touched})


def is_clean(run: Judgement) -> bool:
    """Return whether a run was driven without touching a cone."""
    ruling = run.rulings.get(CLEAN)
    return ruling is not None and ruling.verdict is Verdict.PASSED
