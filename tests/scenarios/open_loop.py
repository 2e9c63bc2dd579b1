"""Errors of estimates, open loop: `python -m tests.scenarios.open_loop` prints the table.

Each manoeuvre is run once with exact signals; what it has recorded goes through the production sensors, 10 ms
late, with both biases of either sign or none, to the estimators, whose friction begins at 0.5 and at 0.8. A
row tells the worst of these cases.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass, field
from itertools import product
from typing import Any

import numpy as np

import yawbench as yb
from tests.components.stand import Stand
from yawbench.components.estimators.kinematic import Kinematic
from yawbench.components.estimators.observer import Observer
from yawbench.components.fmi.component import Component
from yawbench.components.sensors.production import Production
from yawbench.vocabulary.wheels import wheels

MESSAGE = 0.01
GYRO, ACCELEROMETER = math.radians(0.3), 0.2
BIASES = [(0.0, 0.0), *product((GYRO, -GYRO), (ACCELEROMETER, -ACCELEROMETER))]
FRICTIONS = (0.5, 0.8)
BANK = math.radians(3.0)


@dataclass(frozen=True)
class Manoeuvre:
    """A run: its scenario and changes, what a control unit knows of the car, what its estimates may miss."""

    scenario: str
    known_from: str
    swap: dict[str, str] = field(default_factory=dict)
    set: dict[str, Any] = field(default_factory=dict)
    most: tuple[float, float] = (0.35, 1.0)  # deg, rms and largest


_FREE = {"controller": "controller_off"}
_SPIN, _BANKED = (0.8, 2.5), (0.6, 1.6)
_BANK = {"inputs.plant.bank": BANK}
_DIRECT, _STRONG = {"wheel_control": "wheel_control_direct"}, {"wheel_control.torque_limit": 3300.0}
_A, _C, _D = "fnn_sideslip/25mps", "fuzzy_pid/double_lane_change", "fuzzy_feedback/single_sine"
_B_100, _B_80, _B_BRAKE = (
    f"fuzzy_sliding_mode/{name}" for name in ("high_friction", "beyond_paper", "beyond_grip")
)
MANOEUVRES = {
    "A, 25 m/s, controlled": Manoeuvre(_A, "fnn_25mps"),
    "A, 25 m/s, free": Manoeuvre(_A, "fnn_25mps", _FREE),
    "B, 100 km/h, controlled": Manoeuvre(_B_100, "lane_change_100kmh"),
    "B, 100 km/h, free": Manoeuvre(_B_100, "lane_change_100kmh", _FREE),
    "B, 80 km/h, controlled": Manoeuvre(_B_80, "lane_change_80kmh"),
    "B, 80 km/h, free: spins": Manoeuvre(_B_80, "lane_change_80kmh", _FREE, most=_SPIN),
    "C, double lane change, controlled": Manoeuvre(_C, "double_lane_change"),
    "C, double lane change, free": Manoeuvre(_C, "double_lane_change", _FREE),
    "D, controlled": Manoeuvre(_D, "single_sine"),
    "D, free: spins": Manoeuvre(_D, "single_sine", _FREE, most=_SPIN),
    "B, 100 km/h, bank of 3°": Manoeuvre(_B_100, "lane_change_100kmh", set=_BANK, most=_BANKED),
    "B, 80 km/h, bank of 3°": Manoeuvre(_B_80, "lane_change_80kmh", set=_BANK, most=_BANKED),
    "B, brakes beyond grip, slip control": Manoeuvre(_B_BRAKE, "lane_change_80kmh"),
    "B, all wheels locked": Manoeuvre(_B_BRAKE, "lane_change_80kmh", _DIRECT, _STRONG),
    "B, all wheels spinning": Manoeuvre(
        _B_BRAKE, "lane_change_80kmh", _DIRECT, _STRONG | {"driver.force": 6000.0}
    ),
}
"""Name -> manoeuvre."""
SPEED = 0.3
"""Largest error of the speed, rms [m/s]."""


@dataclass(frozen=True)
class Missed:
    """Errors of one estimator in its worst case: sideslip [deg], rms and largest, speed rms [m/s]."""

    rms: float
    largest: float
    speed: float

    def __str__(self) -> str:
        return f"{self.rms:.2f} / {self.largest:.2f}"


def known_car(name: str) -> dict[str, float]:
    """Return the parameters of the estimator in a scenario of real signals, as a run gives them."""
    plan = yb.load(f"real_signals/{name}").plan()
    (unit,) = (unit for unit in plan.instances if unit.name == "estimator")
    return {k: float(v) for k, v in unit.parameters.items() if k not in ("initial_friction",)}


@functools.cache
def missed(name: str) -> dict[str, Missed]:
    """Return what each estimator misses in a manoeuvre, in its worst case, by its name."""
    manoeuvre = MANOEUVRES[name]
    run = yb.load(manoeuvre.scenario).swap(**manoeuvre.swap).set(manoeuvre.set).run()
    known = known_car(manoeuvre.known_from)
    worst: dict[str, list[Missed]] = {}
    for gyro, accelerometer in BIASES:
        messages = sensed(run, manoeuvre, gyro, accelerometer, known["wheel_radius"])
        for estimator, friction in ((Kinematic, None), *((Observer, mu) for mu in FRICTIONS)):
            worst.setdefault(estimator.fmu_name, []).append(
                estimated(estimator, friction, known, messages, run)
            )
    return {
        estimator: Missed(*(max(getattr(one, key) for one in cases) for key in ("rms", "largest", "speed")))
        for estimator, cases in worst.items()
    }


def sensed(run: yb.Run, manoeuvre: Manoeuvre, gyro: float, accelerometer: float, radius: float) -> list[Any]:
    """Return what the sensors say every 10 ms, signal by signal, of a run recorded every 1 ms."""
    given = {"steer_angle_true": run["driver.steer_angle"]}
    for name in (
        "yaw_rate",
        "acceleration_x",
        "acceleration_y",
        "roll_angle",
        "pitch_angle",
        *wheels("wheel_speed_*"),
    ):
        if f"plant.{name}" in run:
            given[f"{name}_true"] = run[f"plant.{name}"]
        elif name.startswith("wheel_speed"):
            given[f"{name}_true"] = run[f"plant.{name.replace('speed', 'velocity')}"] / radius
    stand = Stand(
        Production, latency=0.01, yaw_rate_bias=gyro, acceleration_y_bias=accelerometer, sample_time=MESSAGE
    )
    names = [v.name for v in Production.variables if v.causality == "input"]
    zero = np.zeros(len(run))
    level = {"bank_true": zero + manoeuvre.set.get("inputs.plant.bank", 0.0)}
    rows = np.column_stack([(given | level).get(name, zero) for name in names]).tolist()
    stand.start(**dict(zip(names, rows[0], strict=True)))
    unit, said = stand.unit, []
    for k, row in enumerate(rows):
        if k:
            unit.advance((k - 1) * 1e-3, 1e-3, row)
        if k % 10 == 0:
            said.append(unit.output(k * 1e-3, row)[:8])
    return said


def estimated(
    estimator: type[Component],
    friction: float | None,
    known: dict[str, float],
    messages: list[Any],
    run: yb.Run,
) -> Missed:
    """Return what an estimator misses that takes these messages, friction beginning at `friction`."""
    own = {v.name for v in estimator.variables if v.causality == "parameter"}
    given = {k: v for k, v in known.items() if k in own}
    stand = Stand(estimator, **given, **({} if friction is None else {"initial_friction": friction}))
    inputs = [v.name for v in estimator.variables if v.causality == "input"]
    outputs = [v.name for v in estimator.variables if v.causality == "output"]
    sideslip, speed = outputs.index("sideslip"), outputs.index("velocity_x")
    stand.start(**dict(zip(inputs, messages[0], strict=True)))
    unit = stand.unit
    rows = [unit.output(0.0, messages[0])]
    for k, message in enumerate(messages[1:]):
        unit.advance(k * MESSAGE, MESSAGE, message)
        rows.append(unit.output((k + 1) * MESSAGE, message))
    known_of = np.array(rows)
    error = np.degrees(known_of[:, sideslip] - run["plant.sideslip"][::10])
    lost = known_of[:, speed] - run["plant.velocity_x"][::10]
    return Missed(
        float(np.sqrt(np.mean(error**2))), float(abs(error).max()), float(np.sqrt(np.mean(lost**2)))
    )


def row(name: str) -> str:
    """Return the row of the table that a manoeuvre gives, in Markdown."""
    both = missed(name)
    observer = both["estimator_observer"]
    rms, largest = MANOEUVRES[name].most
    within = f"{rms:g} / {largest:g}"
    return f"| {name} | {both['estimator_kinematic']} | {observer} | {within} | {observer.speed:.2f} |"


if __name__ == "__main__":
    for one in MANOEUVRES:
        print(row(one), flush=True)
