"""Recordings of cars, with their measurement files, as tests of commands need them."""

from __future__ import annotations

from pathlib import Path

import numpy as np


def record_spike(folder: Path) -> None:
    """Write `spike.yaml`, a yaw rate with one value that cannot be."""
    rows = "".join(f"{k / 100},{9.0 if k == 50 else 0.001 * (k % 7)}\n" for k in range(200))
    (folder / "spike.csv").write_text("time [s],r [rad/s]\n" + rows)
    (folder / "spike.yaml").write_text("files: [spike.csv]\nsignals: {yaw_rate: r}\n")


def record_step(folder: Path, name: str = "step", turned: float = 1.0) -> None:
    """Write a step of the hand wheel, `step.yaml`, or with `turned=0` a car that goes straight on."""
    t = np.arange(0.0, 5.0, 0.01)
    columns = (t, 0.5 * turned * (t > 1), 0.2 * turned * (t > 1.2), 4.0 * turned * (t > 1.3), 25.0 + 0.0 * t)
    header = "time [s],d [rad],r [rad/s],a [m/s2],v [m/s]"
    np.savetxt(folder / f"{name}.csv", np.transpose(columns), "%.9g", ",", header=header, comments="")
    signals = "steering_wheel_angle: d, yaw_rate: r, acceleration_y: a, velocity_x: v"
    (folder / f"{name}.yaml").write_text(f"files: [{name}.csv]\nsignals: {{{signals}}}\n")
