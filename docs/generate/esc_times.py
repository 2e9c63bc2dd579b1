"""Times of the chain of the production-like stability control, from the runs of its study."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from yawbench.components.controllers.esc import EscParameters
from yawbench.orchestrator.results.reader import Results, load_results
from yawbench.vocabulary.wheels import wheels

PRESSURES = {"to_1_bar": 1e5, "to_50_bar": 5e6}
"""Time -> pressure [Pa] of any wheel that ends it; chosen: the first, and most of what a stop needs."""
FORCE = 500.0
"""Braking force [N] of any wheel; chosen: a car feels it."""
RISE = (1e6, 5e6)
"""Pressures [Pa] between which the rise of the outer front brake is taken: pre-charged, and `to_50_bar`."""


def times_of(folder: Path) -> dict[str, Mapping[str, float]]:
    """Return run -> times of its chain, of all sines with dwell of a study's results."""
    return {
        f"dwell/{run.name}": chain_times(load_results(run)) for run in sorted((folder / "dwell").iterdir())
    }


def chain_times(run: Results) -> dict[str, float]:
    """Return the times [s] from the first threshold that is passed, and the rise of pressure [Pa/s].

    The threshold is that of `controller_esc`: its yaw-rate error, or its bound on the foreseen sideslip.
    """
    p, t = EscParameters(), run.time
    reference = run["reference.yaw_rate_ref"]
    error = np.abs(reference - run["plant.yaw_rate"])
    threshold = p.yaw_rate_threshold + p.yaw_rate_threshold_share * np.abs(reference)
    begun = _first(t, (error > threshold) | (run["controller.sideslip_excess"] != 0.0))
    pressures = [run[f"wheel_control.{name}"] for name in wheels("brake_pressure_*")]
    force = -np.minimum.reduce([run[f"tyre.{name}"] for name in wheels("tyre_force_x_*")])
    reached = {
        "to_state": run["controller.stability_state"] != 0.0,
        "to_force": force > FORCE,
        **{key: np.maximum.reduce(pressures) > level for key, level in PRESSURES.items()},
    }
    found = {key: _first(t, (t >= begun) & whether) - begun for key, whether in reached.items()}
    low, high = (_first(t, np.maximum.reduce(pressures[:2]) > level) for level in RISE)
    return found | {"rise": (RISE[1] - RISE[0]) / (high - low)}


def _first(t: np.ndarray, whether: np.ndarray) -> float:
    """Return the first time at which something is so."""
    return float(t[np.flatnonzero(whether)[0]])
