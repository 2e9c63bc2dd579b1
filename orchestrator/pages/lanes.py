"""The cones of a double lane change, from what the driver's record says of its track."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from vocabulary.lane_change import LENGTHS, PART_1, Lane, lanes

PARAMETERS = ("vehicle_width", "track_start", "lane_offset", "transition_scale")
"""Parameters of a driver that knows such a track."""


def lanes_of(parameters: Mapping[str, Any]) -> list[Lane]:
    """Return the lanes that a driver's parameters describe; none if they are not of such a track.

    Without an offset there is no change of lanes, and so no cones.
    """
    known = {name: parameters.get(name) for name in PARAMETERS}
    if not all(isinstance(value, (int, float)) for value in known.values()) or known["lane_offset"] == 0:
        return []
    numbers: dict[str, Any] = {name: float(value) for name, value in known.items() if value is not None}
    standard = parameters.get("track_standard", PART_1)
    return list(lanes(**numbers, standard=standard)) if standard in LENGTHS else []
