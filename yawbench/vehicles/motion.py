"""How a car moves: fast enough for the angles of its velocity (`vocabulary.motion`), backwards, in a spin."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from yawbench.vocabulary.motion import LEAST_SPEED

SPIN = math.radians(45.0)
"""Sideslip beyond which a car spins [rad]. Chosen: more than front wheels can be steered against."""
BACKWARDS = math.radians(135.0)
"""Sideslip beyond which a car that sets off does so backwards [rad]; chosen: nearer to back than to aside."""


def standing(signals: Mapping[str, np.ndarray]) -> np.ndarray | None:
    """Return the rows in which a car is slower than `LEAST_SPEED`, from those of `SPEED_SIGNALS` that are
    known, in SI; None if there are no such rows, or if the speed is unknown.
    """
    forward = signals.get("velocity_x")
    if forward is None:
        return None
    stands = np.hypot(forward, signals.get("velocity_y", 0.0)) < LEAST_SPEED
    return np.asarray(stands) if stands.any() else None


def largest(values: np.ndarray) -> float | None:
    """Return the largest absolute value; None if all are NaN, or there is none."""
    known = np.abs(values[~np.isnan(values)])
    return float(known.max()) if known.size else None


def nearest_turn(angle: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Return angles [rad], each by as many whole turns further as brings it nearest to the other."""
    turns = np.round((angle - other) / (2.0 * np.pi))
    return np.asarray(angle - 2.0 * np.pi * turns) if np.any(turns) else angle
