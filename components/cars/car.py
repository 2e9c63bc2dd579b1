"""Base classes of plants: a car on four free-rolling wheels, and a car with driven and braked wheels.

A plant implements its body in four methods, called in this order:

    rest(signals)               sets the body at start time; returns the values to extrapolate (see below)
    move(h, delta, signals)     advances body and `self.motion` under held forces; returns the same values
    wheel_velocities()          returns those of the wheels at the current motion and steer angle
    finish(carried)             sets `self.end` (a_x, a_y) and `self.loads` at the current time

and, if its body has further outputs, in `output`. `self.pull` has the accelerations by road and wind, which
act on all parts of the car alike (`cars.road_plane`); the extrapolated values depend on the tyres alone.

`signals` has one item per input: steer angle, tyre forces x and y, the plant's own inputs, and, if declared,
those of road and wind, adjacent; forces are those at the middle of the step. The values that `rest` and
`move` return belong to that middle; they are extrapolated to the step's end (`mathematics.carry`) and passed
to `finish`.

    beta = atan2(v_y, v_x)        dbeta/dt = (v_x a_y - v_y a_x) / (v_x^2 + v_y^2) - r

Front wheels turn with the steer angle, so their slips and velocities depend on it directly.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import atan2, cos, sin
from typing import Any, ClassVar

from yawbench.vocabulary.wheels import Four

from ..fmi.component import Component
from ..fmi.variables import output, parameter, signal
from ..mathematics.carry import Carried, Values
from .plane_body import Motion
from .road_plane import INPUTS as ROAD_PLANE
from .road_plane import LEVEL, Pull, pull_of
from .wheel_kinematics import Eight, slip_angle, slip_ratio, wheel_velocities
from .wheel_steer import WheelYieldParameters, Yielding
from .wheel_spin import spin

MOTION = (
    "velocity_x",
    "velocity_y",
    "yaw_rate",
    "sideslip",
    "sideslip_rate",
    "acceleration_x",
    "acceleration_y",
    "position_x",
    "position_y",
    "yaw_angle",
)
"""Outputs of every car: plane motion."""


def of_steered_wheels(name: str) -> tuple[Any, ...]:
    """Declare an output of four wheels; those of the front wheels depend directly on the steer angle."""
    front = [output(f"{name}_{wheel}", "steer_angle") for wheel in ("fl", "fr")]
    return (*front, f"{name}_rl", f"{name}_rr")


WHEEL_SLIPS = (*of_steered_wheels("slip_angle"), *of_steered_wheels("slip_ratio"), "vertical_load_*")
"""Outputs of every car: slips and loads of the wheels."""

DRIVEN_WHEELS = (*WHEEL_SLIPS, "wheel_speed_*", *of_steered_wheels("wheel_velocity"))
"""Outputs of a car whose wheels are driven and braked."""


@dataclass(frozen=True)
class StartParameters(WheelYieldParameters):
    """Initial motion of a car, the reference speed of slip at low speed, and how wheels yield."""

    initial_sideslip: float = parameter(0.0, "rad", "Sideslip angle at the start", "chosen: none")
    initial_yaw_rate: float = parameter(0.0, "rad/s", "Yaw rate at the start", "chosen: none")
    low_speed: float = parameter(
        0.5,
        "m/s",
        "Reference speed of the slips of slower wheels",
        "chosen: keeps a parked car quiet at 1 ms",
        minimum=0.001,
    )


@dataclass(frozen=True)
class DrivenCarParameters:
    """Further parameters of a car whose wheels are driven and braked."""

    slip_stiffness_per_load: float = parameter(
        22.0,
        "1",
        "Slip stiffness over load for slow wheels, see cars.wheel_spin",
        "chosen: tyre set 1",
        minimum=0.0,
    )


class Car(Component):
    """Base: a car on four wheels that roll freely."""

    motion: Motion
    steer_angle: float
    wheels: Eight
    end: tuple[float, float]
    loads: Four
    pull: Pull = LEVEL
    yielding: Yielding | None
    of_plane: ClassVar[slice | None]
    """Indices of the inputs of road and wind; None without them."""

    def __init_subclass__(cls, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        first = cls.inputs.index(ROAD_PLANE[0]) if ROAD_PLANE[0] in cls.inputs else None
        cls.of_plane = None if first is None else slice(first, first + len(ROAD_PLANE))

    # ---- for the plant ----------------------------------------------------------------------

    def rest(self, signals: Sequence[Any]) -> Values:
        """Set the body's state at start time from the inputs, by signal; return the values to extrapolate."""
        raise NotImplementedError

    def move(self, h: float, delta: float, signals: Sequence[Any]) -> Values:
        """Advance body and motion by `h` > 0 [s]; return the values to extrapolate.

        Args:
            h: step [s].
            delta: steer angle at the middle of the step [rad].
            signals: the inputs, by signal; forces are held over the step.
        """
        raise NotImplementedError

    def finish(self, carried: Values) -> None:
        """Set `self.end`, accelerations [m/s2], and `self.loads` [N] at the current time."""
        raise NotImplementedError

    def wheel_velocities(self) -> Eight:
        """Return the velocities [m/s] of the wheels in wheel axes: four longitudinal, four lateral."""
        v_x, v_y, r = self.motion[:3]
        return wheel_velocities(v_x, v_y, r=r, delta=self.steer_angle, p=self.p)

    # ---- common to all plants ---------------------------------------------------------------

    def start(self, t: float, u: list[float]) -> None:
        p = self.p
        signals = self.by_signal(u)
        v_x = p.initial_speed * cos(p.initial_sideslip)
        v_y = p.initial_speed * sin(p.initial_sideslip)
        self.motion = v_x, v_y, p.initial_yaw_rate, 0.0, 0.0, 0.0
        self.steer_angle = signals[0]
        if self.of_plane:
            self.pull = pull_of(signals[self.of_plane], p.mass)
        carried = self.rest(signals)
        self.carried = Carried(carried)
        self.wheels = self.wheel_velocities()
        self.start_wheels()
        self.yielding = None
        if p.steer_compliance_front or p.steer_compliance_rear or p.tyre_relaxation_length:
            self.yielding = Yielding(p)
            self.yielding.begin(self.steered_angles())
        self.finish(carried)

    def advance(self, t: float, h: float, u: list[float]) -> None:
        signals = self.by_signal(u)
        delta = signals[0]
        before, self.steer_angle = self.steer_angle, delta
        if h <= 0.0:  # nothing moves
            self.wheels = self.wheel_velocities()
            return
        if self.of_plane:
            self.pull = pull_of(signals[self.of_plane], self.p.mass)
        carried = self.move(h, 0.5 * (before + delta), signals)
        v, loads = self.wheels, self.loads
        self.wheels = self.wheel_velocities()
        self.finish(self.carried.to_end(h, carried))
        self.turn_wheels(h, v, loads, signals)
        if self.yielding:
            self.yielding.advance(h, signals[2], self.steered_angles(), self.wheels[:4])

    def output(self, t: float, u: list[float]) -> tuple[float, ...]:
        return (*self.motion_values(), *self.wheel_values())

    def motion_values(self) -> tuple[float, ...]:
        """Return the values of `MOTION`."""
        v_x, v_y, r, x, y, psi = self.motion
        a_x, a_y = self.end
        low = self.p.low_speed
        turning = (v_x * a_y - v_y * a_x) / max(v_x * v_x + v_y * v_y, low * low)
        return v_x, v_y, r, atan2(v_y, v_x), turning - r, a_x, a_y, x, y, psi

    def wheel_values(self) -> tuple[float, ...]:
        """Return the values of the wheels' outputs."""
        angles = self.yielding.angles if self.yielding else self.steered_angles()
        return (*angles, *self.rolling_values())

    def steered_angles(self) -> Four:
        """Return the slip angles [rad] of wheels that do not yield to side force."""
        low = self.p.low_speed
        v_fl, v_fr, v_rl, v_rr, side_fl, side_fr, side_rl, side_rr = self.wheels
        return (
            slip_angle(v_fl, side_fl, low),
            slip_angle(v_fr, side_fr, low),
            slip_angle(v_rl, side_rl, low),
            slip_angle(v_rr, side_rr, low),
        )

    def start_wheels(self) -> None:
        """Set the wheels' state at start time."""

    def turn_wheels(self, h: float, v: Eight, loads: Four, signals: Sequence[Any]) -> None:
        """Advance the wheels by `h` [s], from their velocities `v` [m/s] and `loads` [N] at the start."""

    def rolling_values(self) -> tuple[float, ...]:
        """Return the values of the wheels' outputs that follow the slip angles."""
        return (0.0, 0.0, 0.0, 0.0, *self.loads, *self.wheels[:4])


class DrivenCar(Car):
    """Base: a car whose wheels spin under drive and brake torques (`cars.wheel_spin`)."""

    inputs = (
        "steer_angle",
        "tyre_force_x_*",
        "tyre_force_y_*",
        "wheel_torque_*",
        signal("slip_stiffness_*", optional=True),
        signal("tyre_slip_ratio_*", optional=True),
        signal("tyre_moment_z_*", optional=True),
        *ROAD_PLANE,
    )

    rolling_resistance = 0.0
    """Rolling resistance coefficient f [1], set by plants that have it."""

    spins: Four

    def start_wheels(self) -> None:
        v_fl, v_fr, v_rl, v_rr = self.wheels[:4]
        radius = self.p.wheel_radius
        self.spins = v_fl / radius, v_fr / radius, v_rl / radius, v_rr / radius  # rolling freely

    def turn_wheels(self, h: float, v: Eight, loads: Four, signals: Sequence[Any]) -> None:
        p = self.p
        _, f_x, _, torque, slip_stiffness, tyre_slip, *_ = signals
        radius, inertia, v_low = p.wheel_radius, p.wheel_inertia, p.low_speed
        per_load = p.slip_stiffness_per_load
        resisting = 0.5 * self.rolling_resistance * radius  # of the mean load over the step
        # The first four of the eight velocities are longitudinal.
        wheels = zip(self.spins, torque, f_x, v, self.wheels, loads, self.loads, slip_stiffness, tyre_slip)  # noqa: B905
        w_fl, w_fr, w_rl, w_rr = [
            spin(
                w,
                h,
                t,
                resisting * (z_0 + z_1),
                f,
                v_0,
                v_1,
                per_load * z_0,
                radius,
                inertia,
                v_low,
                c,
                kappa,
            )
            for w, t, f, v_0, v_1, z_0, z_1, c, kappa in wheels
        ]
        self.spins = w_fl, w_fr, w_rl, w_rr

    def rolling_values(self) -> tuple[float, ...]:
        v_fl, v_fr, v_rl, v_rr = velocities = self.wheels[:4]
        w_fl, w_fr, w_rl, w_rr = spins = self.spins
        radius, low = self.p.wheel_radius, self.p.low_speed
        return (
            slip_ratio(w_fl * radius, v_fl, low),
            slip_ratio(w_fr * radius, v_fr, low),
            slip_ratio(w_rl * radius, v_rl, low),
            slip_ratio(w_rr * radius, v_rr, low),
            *self.loads,
            *spins,
            *velocities,
        )
