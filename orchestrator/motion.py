"""Whether a car moves fast enough for the angles of its velocity: sideslip, its rate, slip angles of wheels.

The angle of a vector of length zero is undefined, and that of a short one is noise: a car that stands has any
sideslip. Whatever judges, summarises or draws such a signal (`ANGLES`) leaves out the samples
in which the car is slower than `LEAST_SPEED`; recorded signals stay what the FMU or the sensor gave.

The speed is sqrt(v_x^2 + v_y^2). Where v_y is not known, it is |v_x| / |cos(beta)|, so that a car which
slides sideways moves, or |v_x| without sideslip. Without v_x it is unknown, and nothing is left out.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from vocabulary.wheels import wheels

ANGLES = ("sideslip", "sideslip_rate", *wheels("slip_angle_*"))
"""Signals that are angles of a velocity, or rates of one."""
LEAST_SPEED = 10.0 / 3.6
"""Speed below which the angle of a velocity means nothing [m/s]. Chosen: an error of 0.1 m/s in v_y is 2
degrees of sideslip there; inertial navigation systems for tests of cars give a slip angle above about this
speed only (Advanced Navigation, packet 73 of their protocol: above 3.45 m/s)."""
LEAST_COSINE = 0.2
"""Least cos(beta) by which v_x is divided. Chosen: beyond 78 degrees of sideslip the noise of a v_x at rest
would become a speed."""
SPEED_SIGNALS = ("velocity_x", "velocity_y", "sideslip")
"""Signals that the speed is computed from."""


def speed_of(signals: Mapping[str, np.ndarray]) -> np.ndarray | None:
    """Return the speed of a car [m/s] from those of `SPEED_SIGNALS` that are known, in SI; None: unknown."""
    forward = signals.get("velocity_x")
    if forward is None:
        return None
    if "velocity_y" in signals:
        return np.hypot(forward, signals["velocity_y"])
    along = np.abs(np.cos(signals["sideslip"])) if "sideslip" in signals else np.ones(1)
    return np.asarray(np.abs(forward) / np.maximum(along, LEAST_COSINE))


def standing(signals: Mapping[str, np.ndarray]) -> np.ndarray | None:
    """Return the rows in which a car is slower than `LEAST_SPEED`; None if there is none, or if its speed is
    unknown."""
    speed = speed_of(signals)
    stands = None if speed is None else speed < LEAST_SPEED  # an unknown speed is not below it
    return stands if stands is not None and stands.any() else None


def while_moving(signals: Mapping[str, np.ndarray], name: str) -> np.ndarray:
    """Return an angle of the velocity, NaN in the rows in which the car stands."""
    stands = standing(signals)
    return signals[name] if stands is None else np.where(stands, np.nan, signals[name])


def largest(values: np.ndarray) -> float | None:
    """Return the largest absolute value; None if all are NaN, or there is none."""
    known = np.abs(values[~np.isnan(values)])
    return float(known.max()) if known.size else None


def nearest_turn(angle: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Return angles [rad], each by as many whole turns further as brings it nearest to the other."""
    turns = np.round((angle - other) / (2.0 * np.pi))
    return np.asarray(angle - 2.0 * np.pi * turns) if np.any(turns) else angle
