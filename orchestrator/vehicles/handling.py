"""What a car is like: loads at rest, understeer, yaw and body modes, roll, stopping distance, from runs.

    K(a_y) = d(delta - L r / v_x) / d a_y        in a slowly increasing steer (`evaluation.understeer`)
    v_ch   = sqrt(L / K(0))                      characteristic speed, of an understeering car
    x_k+1  = A x_k + B (delta_k, delta_k+1)      x = (v_y, r), with a roll angle also (phi, dphi)

The yaw mode is the pair of eigenvalues of A that takes most part in v_y and r; its natural frequency and
damping ratio follow from product and sum, also where the two are real. A is a least-squares fit to the
response to one small sine of the steering, so it holds whatever is in the plant.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from math import pi

import numpy as np

from vocabulary.wheels import WHEELS

from ..errors import SimulationError
from ..evaluation.understeer import gradients
from .proving import STEP, TORQUES, TestTrack

SPEEDS = tuple(v / 3.6 for v in (40.0, 60.0, 80.0, 100.0, 120.0, 140.0))
"""Of the yaw modes [m/s]."""
TURN_SPEED = 80.0 / 3.6
"""Of the slowly increasing steer [m/s]: that of UN R140."""
HAND_RATE = 13.5 / 180.0 * pi
"""Rate of the hand wheel [rad/s], UN R140."""
WANTED = 9.0
"""Lateral acceleration up to which the wheel is turned, were the car linear [m/s2]."""
SMALL = 0.3
"""Lateral acceleration of the sine, about [m/s2]."""
SAMPLE = 0.01
"""Time between states of the fit [s]."""
STOP_SPEED = 100.0 / 3.6
"""From which it stops [m/s]."""
LARGEST_FORCE = -60e3
"""Braking that no tyre follows [N]: the brakes' slip release holds the wheels."""
BODY = ("roll_angle", "roll_rate")


@dataclass(frozen=True)
class Mode:
    """A mode: natural frequency [Hz], damping ratio [1]."""

    frequency: float
    damping: float


@dataclass
class Handling:
    """What runs tell of a car; what its plant or its runs do not tell is missing."""

    plant: str
    loads: tuple[float, ...] = ()  # of fl, fr, rl, rr at rest [N]
    wheelbase: float = 0.0  # [m]
    steering: dict[float, float] = field(
        default_factory=dict
    )  # a_y [m/s2], 0: linear range -> understeer gradient [rad s2/m]
    curve: tuple[np.ndarray, np.ndarray] = (np.zeros(0), np.zeros(0))  # a_y [m/s2], delta - L r / v_x [rad]
    gains: dict[float, float] = field(default_factory=dict)  # speed [m/s] -> steady r / delta [1/s]
    yaw: dict[float, Mode] = field(default_factory=dict)  # by speed [m/s]
    roll_gradient: float | None = None  # [rad s2/m], below 4 m/s2
    roll: np.ndarray | None = None  # roll angle [rad] at the a_y of `curve`
    roll_mode: Mode | None = None  # at TURN_SPEED
    heave: Mode | None = None
    stopping_distance: float | None = None  # from STOP_SPEED [m]
    failed: list[str] = field(default_factory=list)  # runs that gave nothing, and why

    @property
    def characteristic_speed(self) -> float | None:
        """Speed [m/s] of the largest yaw gain; None for a car that does not understeer."""
        gradient = self.steering.get(0.0)
        return (self.wheelbase / gradient) ** 0.5 if gradient and gradient > 0.0 else None


def handling_of(track: TestTrack) -> Handling:
    """Drive a car and return what it is like.

    Raises:
        YawbenchError: the file, the plant or the tyres are none, or do not go together.
    """
    found = Handling(track.plant)
    plan = track.plan({"fmu": "driver_sine"}, TURN_SPEED, STEP)
    known = next(unit for unit in plan.units if unit.name == "plant")
    axles = ("cg_to_front_axle", "cg_to_rear_axle")
    found.wheelbase = sum(float(known.parameter(name) or 0.0) for name in axles)
    for number, measure in enumerate((_modes, _turn, _bounce, _stop)):
        try:
            measure(track, found)
        except SimulationError as error:  # noqa: PERF203 - what others tell stands
            if number == 0:
                raise
            found.failed.append(str(error))
    return found


def _modes(track: TestTrack, found: Handling) -> None:
    """Note loads at rest, steady gains and yaw modes over speed."""
    names = ["velocity_y", "yaw_rate", *(BODY if track.has(BODY[0]) else ())]
    every = round(SAMPLE / STEP)
    for speed in SPEEDS:
        angle = SMALL * (found.wheelbase / speed**2 + 0.005)
        of_sine = {
            "amplitude": angle,
            "frequency": 1.0,
            "periods": 1.0,
            "start_time": 0.1,
            "steering_ratio": 1,
        }
        results = track.drive({"fmu": "driver_sine", "parameters": of_sine}, speed, 2.0)
        found.loads = tuple(float(results[f"plant.vertical_load_{w}"][0]) for w in WHEELS)
        states = np.column_stack([results[f"plant.{name}"][::every] for name in names])
        steer = results["driver.steer_angle"][::every]
        transition, drive = fit(states, steer)
        yaw, roll = modes_of(transition)
        found.yaw[speed] = yaw
        if speed == TURN_SPEED:
            found.roll_mode = roll
        still = np.linalg.solve(np.eye(len(names)) - transition, drive.sum(axis=1))
        found.gains[speed] = float(still[1])


def fit(states: np.ndarray, steer: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return A, shape (k, k), and B, (k, 2), of states, (n, k), that follow a steer angle [rad], (n,)."""
    known = np.column_stack([states[:-1], steer[:-1], steer[1:]])
    scale = np.maximum(np.max(np.abs(known), axis=0), 1e-30)
    solved = (np.linalg.lstsq(known / scale, states[1:], rcond=None)[0].T) / scale
    k = states.shape[1]
    return solved[:, :k], solved[:, k:]


def modes_of(transition: np.ndarray) -> tuple[Mode, Mode | None]:
    """Return the yaw mode, and of four states the roll mode, from the transition over `SAMPLE`.

    Two complex eigenvalues that belong together are one mode, and so are two real ones.
    """
    values, right = np.linalg.eig(transition)  # of a real matrix, so that pairs are exactly such
    left = np.linalg.inv(right)
    part = np.abs(right[0] * left[:, 0]) + np.abs(right[1] * left[:, 1])  # in v_y and r
    rates = np.log(values.astype(complex)) / SAMPLE
    order = sorted(range(len(rates)), key=lambda k: (rates[k].imag == 0.0, abs(rates[k].imag), -part[k]))
    pairs = [order[i : i + 2] for i in range(0, len(order), 2)]
    pairs.sort(key=lambda pair: -part[pair].sum())
    modes = [_mode(rates[pair]) for pair in pairs]
    return modes[0], modes[1] if len(modes) > 1 else None


def _mode(rates: np.ndarray) -> Mode:
    omega = float(abs(rates[0] * rates[1]) ** 0.5)
    return Mode(omega / (2.0 * pi), float(-(rates[0] + rates[1]).real) / (2.0 * omega))


def _turn(track: TestTrack, found: Handling) -> None:
    """Note understeer and roll over lateral acceleration."""
    last = WANTED / (found.gains[TURN_SPEED] * TURN_SPEED)
    ratio = 17.0  # cancels: the hand wheel turns so much faster than the road wheels
    duration = max(last * ratio / HAND_RATE, 2.0)
    of_ramp = {
        "amplitude": last * ratio,
        "ramp_time": duration,
        "start_time": 0.5,
        "steering_ratio": ratio,
        "drive_force_limit": 2e4,
    }
    results = track.drive({"fmu": "driver_ramp", "parameters": of_ramp}, TURN_SPEED, 0.5 + duration)
    a_y = results["plant.acceleration_y"]
    after = (results.time > 1.0) & (np.arange(len(a_y)) <= np.argmax(a_y))
    a_y = a_y[after]
    rate, speed = results["plant.yaw_rate"][after], results["plant.velocity_x"][after]
    extra = results["driver.steer_angle"][after] - found.wheelbase * rate / speed
    found.curve = a_y, extra
    found.steering = {level: one for level, one in gradients(a_y, extra).items() if one is not None}
    if track.has(BODY[0]):
        found.roll = roll = results["plant.roll_angle"][after]
        low = a_y < 4.0
        found.roll_gradient = float(np.polyfit(a_y[low], roll[low], 1)[0])


def _bounce(track: TestTrack, found: Handling) -> None:
    """Note how the body bounces, let go from a centimetre above its place."""
    if not (track.has("heave") and track.has("initial_heave")):
        return
    results = track.drive({"fmu": "driver_sine"}, 10.0, 2.0, initial_heave=0.01)
    every = round(SAMPLE / STEP)
    y = results["plant.heave"][::every]
    rows = np.column_stack([y[3 - k : len(y) - 1 - k] for k in range(4)])  # of the body and of the wheels
    order = np.linalg.lstsq(rows, y[4:], rcond=None)[0]
    rates = np.log(np.roots([1.0, *-order]).astype(complex)) / SAMPLE
    swinging = sorted((rate for rate in rates if rate.imag > 0.0), key=abs)
    if swinging:
        found.heave = _mode(np.array([swinging[0], swinging[0].conjugate()]))


def _stop(track: TestTrack, found: Handling) -> None:
    """Note how far the car goes from the moment the pedal is pressed down."""
    if not track.has(TORQUES):
        return
    of_pulse = {"force": LARGEST_FORCE, "start_time": 0.1, "duration": 100.0}
    results = track.drive({"fmu": "driver_force_pulse", "parameters": of_pulse}, STOP_SPEED, 7.0)
    x, v = results["plant.position_x"], results["plant.velocity_x"]
    if v[-1] < 0.1:
        pressed = np.searchsorted(results.time, 0.1)
        found.stopping_distance = float(x[-1] - x[pressed])
