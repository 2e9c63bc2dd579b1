"""Recorded results made up from closed forms, in memory or as the files of a run."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from yawbench.orchestrator.results.reader import Results
from yawbench.orchestrator.results.run_record import RunRecord

UNITS = {
    "driver.steer_angle": "rad",
    "reference.sideslip_ref": "rad",
    "reference.yaw_rate_ref": "rad/s",
    "controller.yaw_moment": "N.m",
    "plant.sideslip": "rad",
    "plant.yaw_rate": "rad/s",
    "plant.velocity_x": "m/s",
    "plant.acceleration_y": "m/s2",
    "plant.position_x": "m",
    "plant.position_y": "m",
    "plant.yaw_angle": "rad",
    **{f"wheel_control.torque_request_{w}": "N.m" for w in ("fl", "fr", "rl", "rr")},
}


def results(
    columns: dict[str, Any],
    time: Any = None,
    units: dict[str, str] | None = None,
    folder: Path = Path("made_up"),
) -> Results:
    """Return results that hold the columns; units are those of a car's usual columns or as given."""
    time = np.linspace(0.0, 1.0, len(next(iter(columns.values())))) if time is None else np.asarray(time)
    known = {"time": "s", **{name: (units or UNITS).get(name, "1") for name in columns}}
    record = RunRecord.model_validate(run_record(known))
    return Results(folder, time, {k: np.asarray(v, float) for k, v in columns.items()}, known, record)


def noted(made: Results, **fields: Any) -> Results:
    """Set fields of the record as run.json has them, FMUs beside those that are there; return the results."""
    new = RunRecord.model_validate(fields)
    for name in fields:
        setattr(made.record, name, made.record.fmus | new.fmus if name == "fmus" else getattr(new, name))
    return made


def record_text(content: dict[str, Any]) -> str:
    """Return the text of a run.json with any content."""
    return json.dumps(content)


def run_record(units: dict[str, str], title: str = "Sine at 25 m/s") -> dict[str, Any]:
    """Return what `run.json` holds of such a run."""
    fmus = {unit: {"name": f"{unit}_made_up", "sha256": "0123456789" * 6} for unit in ("controller", "plant")}
    return {
        "status": "completed", "error": None, "title": title, "wall_time": 1.5, "algorithm": "extrapolated",
        "step_size": 0.001, "units": units, "fmus": fmus, "versions": {"yawbench": "0.1.0"},
        "scenario": {"title": title, "source": "paper A"},
        "connections": [
            {"from": f"wheel_control.torque_request_{w}", "to": f"plant.wheel_torque_{w}"}
            for w in ("fl", "fr", "rl", "rr")
        ],
    }  # fmt: skip


def car(gain: float = 1.0, *, n: int = 801, chatter: float = 0.0, folder: Path = Path("made_up")) -> Results:
    """Return a car on one sine period of steering whose sideslip is `gain` times its reference."""
    t = np.linspace(0.0, 8.0, n)
    steer = np.where((t > 1) & (t < 6), 0.03 * np.sin(2 * np.pi * (t - 1) / 5), 0.0)
    yaw_rate = 6.0 * steer * (0.8 + 0.2 * gain)
    moment = 2000.0 * steer / 0.03 + chatter * np.cos(np.pi * np.arange(n))
    psi = np.concatenate([[0.0], np.cumsum(np.diff(t) * (yaw_rate[1:] + yaw_rate[:-1]) / 2)])
    columns = {
        "driver.steer_angle": steer,
        "reference.sideslip_ref": -0.6 * steer,
        "reference.yaw_rate_ref": 6.0 * steer,
        "controller.yaw_moment": moment,
        "plant.sideslip": -0.6 * gain * steer,
        "plant.yaw_rate": yaw_rate,
        "plant.velocity_x": 25.0 - 0.05 * t,
        "plant.acceleration_y": 25.0 * yaw_rate,
        "plant.position_x": np.concatenate([[0.0], np.cumsum(np.diff(t) * 25 * np.cos(psi[1:]))]),
        "plant.position_y": np.concatenate([[0.0], np.cumsum(np.diff(t) * 25 * np.sin(psi[1:]))]),
        "plant.yaw_angle": psi,
    }
    for sign, wheel in zip((-1, 1, -1, 1), ("fl", "fr", "rl", "rr"), strict=True):
        columns[f"wheel_control.torque_request_{wheel}"] = sign * moment / 10
    return results(columns, t, folder=folder)


def write(recorded: Results, folder: Path, **changes: Any) -> Path:
    """Write the results as a run writes them and return the folder."""
    folder.mkdir(parents=True, exist_ok=True)
    table = np.column_stack([recorded.time, *recorded.columns.values()])
    header = ",".join(["time", *recorded.columns])
    np.savetxt(folder / "results.csv", table, fmt="%.17g", delimiter=",", header=header, comments="")
    (folder / "run.json").write_text(record_text({**recorded.record.content(), **changes}))
    return folder
