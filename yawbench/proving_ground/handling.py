"""Handling figures of a car from runs on a test track: loads, understeer, yaw and body modes, roll, stopping.

A vehicle file is driven on a plant and tyres, in scenarios generated for it: steered, braked or dropped.

    K(a_y) = d(delta - L r / v_x) / d a_y        in a slowly increasing steer (`steady_state_steering`)
    v_ch   = sqrt(L / K(0))                      characteristic speed, of an understeering car
    x_k+1  = A x_k + B (delta_k, delta_k+1)      x = (v_y, r), with a roll angle also (phi, dphi)

The yaw mode is the pair of eigenvalues of A that takes most part in v_y and r; its natural frequency and
damping ratio follow from product and sum, also where the two are real. A is a least-squares fit to the
response to one small sine of the steering, so it holds for any plant.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cached_property
from math import pi
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from yawbench.figures.style import QUIET, ROW, frame, line_style, new_figure
from yawbench.fmus.fmu import Fmu, is_path
from yawbench.fmus.opener import find_fmu, find_folder
from yawbench.foundation.errors import ModelDescriptionError, SimulationError, WiringError
from yawbench.orchestrator.master.simulate import simulate_in_memory
from yawbench.orchestrator.plan import Plan
from yawbench.orchestrator.results.reader import Results
from yawbench.orchestrator.scenario import like
from yawbench.planner import Planner
from yawbench.tyre_stand import KNOWN_BY, open_role
from yawbench.vocabulary.roles import role_in
from yawbench.vocabulary.wheels import WHEELS

from .steady_state_steering import FEWEST, gradients

if TYPE_CHECKING:
    from matplotlib.figure import Figure


STEP = 0.002
"""Communication step [s]. Chosen: steady turns and yaw differ by less than 1e-4 from those at 1 ms."""
TORQUES = "wheel_torque_fl"
"""Input by which plants with driven and braked wheels are recognized."""
PLANT_KNOWN_BY = ("velocity_y", "yaw_rate", "acceleration_y", "vertical_load_fl", "slip_angle_fl")
"""Variables by which a plant FMU is recognized."""


@dataclass(frozen=True)
class TestTrack:
    """A car on a dry, flat road.

    Args:
        vehicle: the vehicle file.
        plant: an FMU, by name or path.
        tyre: likewise; "": the tyre that the file is made for.
        friction: coefficient of the road [1].
        fmus: folder of FMUs given by name; None: the nearest.
        planner: makes the plans, and may first build FMUs that are out of date.
    """

    __test__ = False  # not a pytest class

    vehicle: Path
    plant: str
    tyre: str = ""
    friction: float = 1.0
    fmus: Path | None = None
    planner: Planner = field(default_factory=Planner)

    @cached_property
    def scenario_path(self) -> Path:
        """Path used for the generated scenario: messages name the vehicle file."""
        return Path(os.path.relpath(self.vehicle))

    @cached_property
    def plant_fmu(self) -> Fmu:
        """The plant's FMU."""
        return open_role(
            self.plant,
            "plant",
            PLANT_KNOWN_BY,
            near=self.scenario_path,
            fmus=self.fmus,
            opener=self.planner.opener,
        )

    def has(self, variable: str) -> bool:
        """Return whether the plant has a variable."""
        return variable in self.plant_fmu.variables

    @cached_property
    def tyres(self) -> str:
        """The tyres' FMU: as given, or the FMU that takes the file's tyre property files or stiffness."""
        data = like.read(self.vehicle, what="vehicle file").data
        content = data if isinstance(data, dict) else {}
        if self.tyre or content.get("tyres"):
            return self.tyre or "tyre_magic_formula_62"
        no_load = "cornering_stiffness" in (content.get("parameters") or {})
        return "tyre_dugoff" if no_load else "tyre_magic_formula"

    def plan(self, driver: Mapping[str, Any], speed: float, stop_time: float, **of_plant: float) -> Plan:
        """Return the plan of a run.

        Args:
            driver: the instance, as in a scenario.
            speed: at the start, and held if the driver does so [m/s].
            stop_time: [s].
            of_plant: parameters of the plant.

        Raises:
            YawbenchError: the file, the plant or the tyres are invalid, or do not fit together.
        """
        open_role(
            self.tyres, "tyre", KNOWN_BY, near=self.scenario_path, fmus=self.fmus, opener=self.planner.opener
        )
        instances: dict[str, Any] = {"driver": dict(driver)}
        plant: dict[str, Any] = {"fmu": self._named(self.plant), "parameters": of_plant}
        inputs: dict[str, Any] = {}
        connections = []
        if self.has(TORQUES):
            instances["allocator"] = {"fmu": "allocator_load_proportional"}
            instances["wheel_control"] = {"fmu": "wheel_control_hydraulic"}
            connections.append({"from": "wheel_control.torque_request_*", "to": "plant.wheel_torque_*"})
            inputs["allocator.yaw_moment"] = 0.0
        if self.has("yaw_moment"):
            inputs["plant.yaw_moment"] = 0.0
        instances |= {"plant": plant, "tyre": {"fmu": self._named(self.tyres)}}
        data = {
            "title": Path(self.vehicle).name,
            "vehicle": os.path.abspath(self.vehicle),
            "friction": self.friction,
            "speed": speed,
            "step_size": STEP,
            "stop_time": round(round(stop_time / STEP) * STEP, 6),
            "units": instances,
            "inputs": inputs,
            "connections": connections,
        }
        return self.planner.plan(self.planner.load(self.scenario_path, data=data), fmus=self.fmus)

    def drive(self, driver: Mapping[str, Any], speed: float, stop_time: float, **of_plant: float) -> Results:
        """Return the results of a run; arguments as of `plan`.

        Raises:
            YawbenchError: as `plan`, or the run failed, as when a car rolls over.
        """
        return simulate_in_memory(self.plan(driver, speed, stop_time, **of_plant))

    def _named(self, fmu: str) -> str:
        return os.path.abspath(fmu) if is_path(fmu) else fmu


def plants_in(fmus: Path | None, scenario: Path, planner: Planner) -> list[str]:
    """Return the plants in a folder of FMUs, those with the most parameters first: they model the most.

    FMUs that cannot be opened are left out.

    Raises:
        ModelDescriptionError: there is none, or no folder of FMUs.
    """
    opener = planner.opener
    folder = fmus or find_folder(scenario, opener=opener)
    parameters: dict[str, int] = {}
    for name in opener.names(folder):
        if role_in(name) == "plant":
            with suppress(ModelDescriptionError):
                fmu = opener.open(find_fmu(name, scenario=scenario, fmus=folder, opener=opener))
                parameters[name] = len(fmu.of("parameter"))
    if not parameters:
        raise ModelDescriptionError(f"{folder}: contains no plant")
    return sorted(parameters, key=lambda name: (-parameters[name], name))


def fitting_plant(vehicle: Path, tyre: str, fmus: Path | None, planner: Planner) -> str:
    """Return the most detailed plant that a vehicle file has the values for (see `plants_in`).

    Raises:
        YawbenchError: there is none; the message gives the reason for the simplest plant.
    """
    steer = {"fmu": "driver_sine"}
    *detailed, simplest = plants_in(fmus, vehicle, planner)
    for plant in detailed:
        try:
            TestTrack(vehicle, plant, tyre, fmus=fmus, planner=planner).plan(steer, 20.0, STEP)
        except WiringError:
            continue
        return plant
    TestTrack(vehicle, simplest, tyre, fmus=fmus, planner=planner).plan(steer, 20.0, STEP)
    return simplest


SPEEDS = tuple(v / 3.6 for v in (40.0, 60.0, 80.0, 100.0, 120.0, 140.0))
"""Speeds of the yaw modes [m/s]."""
TURN_SPEED = 80.0 / 3.6
"""Speed of the slowly increasing steer [m/s]: UN R140."""
HAND_RATE = 13.5 / 180.0 * pi
"""Rate of the hand wheel [rad/s], UN R140."""
WANTED = 9.0
"""Lateral acceleration that a linear car would reach at the end of the steer [m/s2]."""
STEEPEST = 0.5 * pi
"""Steer angle below which that must be reached [rad]: a wheel across the car."""
SMALL = 0.3
"""Approximate lateral acceleration of the sine [m/s2]."""
SAMPLE = 0.01
"""Sampling time of the fit [s]."""
STOP_SPEED = 100.0 / 3.6
"""Initial speed of the stopping distance [m/s]."""
LARGEST_FORCE = -60e3
"""Braking force beyond any tyre [N]: the slip control of the brakes limits it."""
BODY = ("roll_angle", "roll_rate")


@dataclass(frozen=True)
class Mode:
    """A mode: natural frequency [Hz], damping ratio [1]."""

    frequency: float
    damping: float


@dataclass
class Handling:
    """Handling figures of a car; those that its plant or its runs do not provide are missing."""

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
    failed: list[str] = field(default_factory=list)  # runs that failed, and why

    @property
    def characteristic_speed(self) -> float | None:
        """Speed [m/s] of the largest yaw gain; None for a car that does not understeer."""
        gradient = self.steering.get(0.0)
        return (self.wheelbase / gradient) ** 0.5 if gradient and gradient > 0.0 else None


def handling_of(track: TestTrack) -> Handling:
    """Drive a car and return its handling figures.

    Raises:
        YawbenchError: the file, the plant or the tyres are invalid, or do not fit together.
    """
    handling = Handling(track.plant)
    plan = track.plan({"fmu": "driver_sine"}, TURN_SPEED, STEP)
    plant = next(instance for instance in plan.instances if instance.name == "plant")
    axles = ("cg_to_front_axle", "cg_to_rear_axle")
    handling.wheelbase = sum(float(plant.parameter(name) or 0.0) for name in axles)
    for number, measure in enumerate((_modes, _turn, _bounce, _stop)):
        try:
            measure(track, handling)
        except SimulationError as error:  # noqa: PERF203 - keep the other figures
            if number == 0:
                raise
            handling.failed.append(str(error))
        except NoFigureError as error:
            handling.failed.append(str(error))
    return handling


class NoFigureError(Exception):
    """A car moves in such a way that a figure does not exist; the message says how."""


def _modes(track: TestTrack, handling: Handling) -> None:
    """Add loads at rest, steady gains and yaw modes over speed."""
    names = ["velocity_y", "yaw_rate", *(BODY if track.has(BODY[0]) else ())]
    every = round(SAMPLE / STEP)
    for speed in SPEEDS:
        angle = SMALL * (handling.wheelbase / speed**2 + 0.005)
        of_sine = {
            "amplitude": angle,
            "frequency": 1.0,
            "periods": 1.0,
            "start_time": 0.1,
            "steering_ratio": 1,
        }
        results = track.drive({"fmu": "driver_sine", "parameters": of_sine}, speed, 2.0)
        handling.loads = tuple(float(results[f"plant.vertical_load_{w}"][0]) for w in WHEELS)
        states = np.column_stack([results[f"plant.{name}"][::every] for name in names])
        steer = results["driver.steer_angle"][::every]
        try:
            transition, drive = fit(states, steer)
            yaw, roll = modes_of(transition)
            still = np.linalg.solve(np.eye(len(names)) - transition, drive.sum(axis=1))
        except np.linalg.LinAlgError:
            handling.failed.append(
                f"at {3.6 * speed:.0f} km/h the car does not answer a small sine of steering"
            )
            continue
        handling.yaw[speed] = yaw
        if speed == TURN_SPEED:
            handling.roll_mode = roll
        handling.gains[speed] = float(still[1])


def fit(states: np.ndarray, steer: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Fit A, shape (k, k), and B, (k, 2), to states, (n, k), that respond to a steer angle [rad], (n,)."""
    known = np.column_stack([states[:-1], steer[:-1], steer[1:]])
    scale = np.maximum(np.max(np.abs(known), axis=0), 1e-30)
    solved = (np.linalg.lstsq(known / scale, states[1:], rcond=None)[0].T) / scale
    k = states.shape[1]
    return solved[:, :k], solved[:, k:]


def modes_of(transition: np.ndarray) -> tuple[Mode, Mode | None]:
    """Return the yaw mode and, given four states, the roll mode of the transition matrix over `SAMPLE`.

    A pair of conjugate complex eigenvalues is one mode, and so are two real ones.
    """
    values, right = np.linalg.eig(transition)  # the matrix is real, so conjugate pairs are exact
    left = np.linalg.inv(right)
    part = np.abs(right[0] * left[:, 0]) + np.abs(right[1] * left[:, 1])  # in v_y and r
    if not values.all():
        raise np.linalg.LinAlgError("a motion that ends within a sample")
    rates = np.log(values.astype(complex)) / SAMPLE
    order = sorted(range(len(rates)), key=lambda k: (rates[k].imag == 0.0, abs(rates[k].imag), -part[k]))
    pairs = [order[i : i + 2] for i in range(0, len(order), 2)]
    pairs.sort(key=lambda pair: -part[pair].sum())
    modes = [_mode(rates[pair]) for pair in pairs]
    return modes[0], modes[1] if len(modes) > 1 else None


def _mode(rates: np.ndarray) -> Mode:
    omega = float(abs(rates[0] * rates[1]) ** 0.5)
    return Mode(omega / (2.0 * pi), float(-(rates[0] + rates[1]).real) / (2.0 * omega))


def _turn(track: TestTrack, handling: Handling) -> None:
    """Add understeer and roll over lateral acceleration."""
    gain = handling.gains.get(TURN_SPEED, 0.0)
    last = WANTED / (gain * TURN_SPEED) if gain else np.inf
    if not 0.0 < last < STEEPEST:
        raise NoFigureError(f"at 80 km/h the car settles in no turn: its steady yaw gain is {gain:.3g} 1/s")
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
    if np.count_nonzero(after) < FEWEST:
        raise NoFigureError(
            "at 80 km/h the car settles in no turn: its lateral acceleration falls within 1 s"
        )
    a_y = a_y[after]
    rate, speed = results["plant.yaw_rate"][after], results["plant.velocity_x"][after]
    extra = results["driver.steer_angle"][after] - handling.wheelbase * rate / speed
    handling.curve = a_y, extra
    handling.steering = {level: k for level, k in gradients(a_y, extra).items() if k is not None}
    if track.has(BODY[0]):
        handling.roll = roll = results["plant.roll_angle"][after]
        low = a_y < 4.0
        if np.count_nonzero(low) >= FEWEST:
            handling.roll_gradient = float(np.polyfit(a_y[low], roll[low], 1)[0])


def _bounce(track: TestTrack, handling: Handling) -> None:
    """Add the bounce modes of the body, released a centimetre above its rest position."""
    if not (track.has("heave") and track.has("initial_heave")):
        return
    results = track.drive({"fmu": "driver_sine"}, 10.0, 2.0, initial_heave=0.01)
    every = round(SAMPLE / STEP)
    y = results["plant.heave"][::every]
    rows = np.column_stack([y[3 - k : len(y) - 1 - k] for k in range(4)])  # of the body and of the wheels
    order = np.linalg.lstsq(rows, y[4:], rcond=None)[0]
    roots = np.roots([1.0, *-order]).astype(complex)
    rates = np.log(roots[roots != 0.0]) / SAMPLE
    swinging = sorted((rate for rate in rates if rate.imag > 0.0), key=abs)
    if swinging:
        handling.heave = _mode(np.array([swinging[0], swinging[0].conjugate()]))


def _stop(track: TestTrack, handling: Handling) -> None:
    """Add the distance from the instant at which the pedal is pressed until the car stops."""
    if not track.has(TORQUES):
        return
    of_pulse = {"force": LARGEST_FORCE, "start_time": 0.1, "duration": 100.0}
    results = track.drive({"fmu": "driver_force_pulse", "parameters": of_pulse}, STOP_SPEED, 7.0)
    x, v = results["plant.position_x"], results["plant.velocity_x"]
    if v[-1] < 0.1:
        pressed = np.searchsorted(results.time, 0.1)
        handling.stopping_distance = float(x[-1] - x[pressed])


def draw_cars(cars: Sequence[Handling], title: str, note: str) -> Figure:
    """Return the figure of a car with one or several plants."""
    with new_figure() as figure:
        axes = list(figure.subplots(2, 2).flat)
        for number, car in enumerate(cars):
            style = line_style(number)
            a_y, extra = car.curve
            axes[0].plot(a_y, np.degrees(extra), **style)
            speeds = [3.6 * v for v in car.gains]
            axes[1].plot(speeds, list(car.gains.values()), **style)
            if car.roll is not None:
                axes[2].plot(a_y, np.degrees(car.roll), **style)
            frequencies = [mode.frequency for mode in car.yaw.values()]
            axes[3].plot(speeds, frequencies, **style)
            axes[3].plot(speeds, [mode.damping for mode in car.yaw.values()], **style | {"alpha": 0.5})
        axes[0].set(
            title="Steering beyond geometry at 80 km/h", xlabel="a_y [m/s²]", ylabel="δ - L r / v_x [°]"
        )
        axes[1].set(title="Steady yaw gain", xlabel="speed [km/h]", ylabel="r / δ [1/s]")
        axes[2].set(title="Roll at 80 km/h", xlabel="a_y [m/s²]", ylabel="φ [°]")
        if not axes[2].get_lines():
            axes[2].text(0.5, 0.5, "no roll angle", transform=axes[2].transAxes, ha="center", color=QUIET)
        axes[3].set(
            title="Yaw mode: natural frequency, damping ratio (pale)",
            xlabel="speed [km/h]",
            ylabel="f_n [Hz], ζ [1]",
        )
        for panel in axes:
            panel.set_ylim(bottom=0.0)
        handles = [axes[0].plot([], [], **line_style(i), label=car.plant)[0] for i, car in enumerate(cars)]
        frame(figure, 2 * 1.4 * ROW, handles, title, note)
    return figure
