"""Input values a unit may meet on the road, by signal."""

from __future__ import annotations

import random
from collections.abc import Iterable

from yawbench.fmus.usual_ranges import pattern_of, usual_range

_SPEEDS = {"velocity_x", "wheel_speed_*", "wheel_velocity_*"}


def plausible(names: Iterable[str], source: random.Random, *, slow: bool = False) -> dict[str, float]:
    """Return a value for every name; a signal that is not in the list gets one from -1 to 1.

    With `slow`, the car is nearly standing.
    """
    return {
        name: source.uniform(*((0.0, 1.5) if slow and pattern_of(name) in _SPEEDS else usual_range(name)))
        for name in names
    }
