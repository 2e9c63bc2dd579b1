"""What wheels do, from recorded signals and parameters: steer, torques of drive and brake, travel, friction.

No plant has these as outputs; they follow from what every run records, so that no run has to be made again:

    steer     the angle that the plant is given, of its front wheels; with roll steer and the steer by side
              force of `cars.wheel_steer`, of the body's roll and without the lag of 10 ms of the latter
    torque    drive - brake is the recorded torque. With hydraulic brakes the brake's is the recorded pressure
              times the `brake_factor` of its axle; without, a wheel does not drive and brake at once
    travel    of a wheel on a tyre spring, (N_0 - N) / k_t while it is loaded, equation (4) of `cars.ride`.
              While it is lifted, equation (5): it hangs on the recorded body, from where it left the road
"""

from __future__ import annotations

from dataclasses import fields
from typing import Any

import numpy as np

from yawbench.metrics.expressions import columns_of
from yawbench.orchestrator.results.reader import Results
from yawbench.vocabulary.wheels import WHEELS

from .outline import fed, numbers_of, parameters_of


def stacked(run: Results, columns: list[str]) -> np.ndarray:
    """Return columns side by side, shape (rows, columns)."""
    return np.stack([np.asarray(run.columns[column], float) for column in columns], axis=1)


def friction_of(run: Results) -> np.ndarray | None:
    """Return the friction under the wheels, shape (rows, 4) or (4,) if it is constant; None: not known."""
    columns = friction_columns(run)
    if columns is None:
        return None
    rows = [
        np.full(run.time.size, one) if isinstance(one, float) else np.asarray(run.columns[one], float)
        for one in columns
    ]
    return np.stack(rows, axis=1)


def friction_columns(run: Results) -> list[str | float] | None:
    """Return the column of the friction at each wheel, or the number that is constant for the tyres."""
    if columns := columns_of(run, "friction_*"):
        return [*columns]
    forces = columns_of(run, "tyre_force_x_*")
    fmu = run.record.fmus.get(run.names[forces[0]].instance) if forces else None
    constants = fmu.constants if fmu else {}
    found = [constants.get(f"friction_{wheel}", constants.get("friction")) for wheel in WHEELS]
    known = [float(mu) for mu in found if isinstance(mu, (int, float))]
    return [*known] if len(known) == len(WHEELS) else None


def steer_of(run: Results) -> tuple[np.ndarray, np.ndarray]:
    """Return the angles [rad] in which tyre forces act, and those of the wheels, shape (rows, 4) each."""
    rows = run.time.size
    held = np.zeros((rows, 4))
    for plant in run.instances_of_role("plant"):
        column = fed(run, plant, "steer_angle")
        for name in ([column] if column else columns_of(run, "steer_angle"))[:1]:
            held[:, :2] = np.asarray(run.columns[name], float)[:, None]
    p = _of_plant(run)
    steer = held.copy()
    across = columns_of(run, "tyre_force_y_*")
    for axle, name in ((slice(0, 2), "front"), (slice(2, 4), "rear")):
        stiffness = p.get(f"steer_stiffness_{name}")
        if stiffness and across:
            steer[:, axle] -= stacked(run, across)[:, axle].sum(axis=1)[:, None] / stiffness
    if columns := columns_of(run, "roll_angle"):
        roll = np.asarray(run.columns[columns[0]], float)[:, None]
        steer -= roll * [*2 * [p.get("roll_steer_front", 0.0)], *2 * [-p.get("roll_steer_rear", 0.0)]]
    return held, steer


def torques_of(run: Results) -> tuple[np.ndarray, np.ndarray, bool]:
    """Return the torques [N.m] that drive and brake the wheels, (rows, 4), and whether they are known."""
    columns = columns_of(run, "wheel_torque_*") or columns_of(run, "torque_request_*")
    if not columns:
        return np.zeros((run.time.size, 4)), np.zeros((run.time.size, 4)), False
    torque = stacked(run, columns)
    pressures = columns_of(run, "brake_pressure_*")
    if pressures:
        fmu = run.record.fmus[run.names[pressures[0]].instance]
        p = numbers_of({**fmu.defaults, **fmu.parameters})
        factors = [p.get(f"brake_factor_{axle}") for axle in ("front", "front", "rear", "rear")]
        if None not in factors:
            brake = stacked(run, pressures) * np.array(factors, float)
            return np.maximum(torque + brake, 0.0), np.maximum(brake, -torque), True
    return np.maximum(torque, 0.0), np.maximum(-torque, 0.0), True


def travel_of(run: Results) -> np.ndarray | None:
    """Return the height [m] of each wheel above its place at rest, shape (rows, 4).

    None without tyre springs, or if body or loads were not recorded.
    """
    signals = ("heave", "roll_angle", "pitch_angle")
    columns = [columns[0] for signal in signals if (columns := columns_of(run, signal))]
    loads = columns_of(run, "vertical_load_*")
    ride = _ride_of(run)
    if ride is None or len(columns) < len(signals) or not loads:
        return None
    z, phi, theta = stacked(run, columns).T[:, :, None]
    load = stacked(run, loads)
    x = np.array([ride.a, ride.a, -ride.b, -ride.b])
    y = ride.half_track * np.array([1.0, -1.0, 1.0, -1.0])
    at_rest = np.array([ride.load_f, ride.load_f, ride.load_r, ride.load_r])
    travel: np.ndarray = (at_rest - load) / ride.k_t
    if not (load <= 0.0).any():
        return travel
    body = z + y * phi - x * theta
    rising = np.gradient(body, run.time, axis=0)
    for axle, mass, k, d, s in (
        ((0, 1), ride.m_f, ride.k_f, ride.d_f, ride.s_f),
        ((2, 3), ride.m_r, ride.k_r, ride.d_r, ride.s_r),
    ):
        for wheel, other in (axle, axle[::-1]):
            _lift(
                run.time, load[:, wheel], travel, wheel, other, body, rising, (mass, k, d, s, at_rest[wheel])
            )
    return travel


def _lift(
    time: np.ndarray,
    load: np.ndarray,
    travel: np.ndarray,
    wheel: int,
    other: int,
    body: np.ndarray,
    rising: np.ndarray,
    constants: tuple[float, ...],
) -> None:
    """Set the travel of a wheel while it is lifted: it hangs on spring, damper and anti-roll bar.

    The step is implicit in the wheel's velocity, and so stable for any period of the recording.
    """
    mass, k, d, s, at_rest = constants
    velocity = 0.0
    for row in np.flatnonzero(load <= 0.0):
        if row == 0:
            continue
        h = time[row] - time[row - 1]
        u = travel[row - 1, wheel]
        if load[row - 1] > 0.0:  # it leaves the road
            velocity = (u - travel[row - 2, wheel]) / h if row > 1 else 0.0
        bump, over = u - body[row, wheel], travel[row - 1, other] - body[row - 1, other]
        force = -at_rest - k * bump + d * rising[row, wheel] - s * (bump - over)
        velocity = (velocity + h * force / mass) / (1.0 + h * (d + h * (k + s)) / mass)
        travel[row, wheel] = u + h * velocity


def _of_plant(run: Results) -> dict[str, float]:
    return {
        name: float(value)
        for parameters in parameters_of(run, "plant")
        for name, value in parameters.items()
        if isinstance(value, (int, float))
    }


def _ride_of(run: Results) -> Any:
    """Return the constants of springs and tyre springs of a plant that has them, else None."""
    from yawbench.components.cars.sprung_car import FourteenDofParameters, ride_of

    names = {field.name for field in fields(FourteenDofParameters)}
    for parameters in parameters_of(run, "plant"):
        if names <= parameters.keys():
            return ride_of(FourteenDofParameters(**{name: parameters[name] for name in names}))
    return None
