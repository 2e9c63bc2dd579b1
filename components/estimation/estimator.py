"""Base class of estimators: from sensor signals to sideslip, speed, wheel slips and loads.

An estimator overrides two methods:

    begin()                          sets its state, for a car driving straight ahead
    lateral(h, r, delta, a_x, a_y, straight)    updates it with a message; returns v_y and dv_y/dt

Common to all, in this order:

    zero points of gyro and a_y      learned straight ahead                        `estimation.straight_ahead`
    a_y = (f_y - zero) / (1 + phi_g)        phi_g: roll angle at 1 g               roll compensation
    delta                            delayed like the inertial signals             `mathematics.low_pass`
    v_x                              from wheels and a_x                       `estimation.reference_speed`
    beta, dbeta/dt                   atan2(v_y, v_x), (v_x dv_y - v_y dv_x) / (v_x^2 + v_y^2)
    slips, velocities of wheels      kinematics                                 `cars.wheel_kinematics`
    loads                            quasi-static from a_x, a_y                  `cars.load_transfer`

Gyro and accelerometers have a low pass, the hand wheel has none; the steer angle passes through the same low
pass to be simultaneous with them. Otherwise the model would be steered too early and attribute the difference
in a_y to sideslip and friction. v_x and v_y, which are as old as the filtered signals, are extrapolated by
their rates over `signal_delay`. The body rolls by phi_g a_y / g, which adds phi_g a_y to the acceleration
that the accelerometer measures.

There is no output `friction_*`: wired by name, it would drive the tyres of a scenario with an estimate
instead of the road. Connect `friction` explicitly to inputs that need it per wheel.
"""

from math import atan2

from yawbench.vocabulary.wheels import wheels

from ..cars.load_transfer import quasi_static_loads
from ..cars.wheel_kinematics import slip_angle, slip_ratio, wheel_velocities
from ..fmi.component import Component
from ..fmi.variables import output
from ..mathematics.low_pass import LowPass
from .reference_speed import ReferenceSpeed
from .straight_ahead import ZeroPoints

INPUTS = ("yaw_rate", "acceleration_x", "acceleration_y", "steer_angle", "wheel_speed_*")
NAMES = (
    *("velocity_x", "velocity_y", "sideslip", "sideslip_rate"),
    *("slip_angle_*", "slip_ratio_*", "vertical_load_*", "wheel_velocity_*"),
)
OUTPUTS = tuple(output(name, *INPUTS[:-1], *wheels("wheel_speed_*")) for name in NAMES)
"""Outputs of every estimator, each with direct feedthrough of all inputs."""


class Estimator(Component):
    """Base class of estimators of a car's motion from sensor signals."""

    sampled = True
    inputs = INPUTS
    outputs = OUTPUTS

    # ---- for the estimator ------------------------------------------------------------------

    def begin(self) -> None:
        """Set the state for a car driving straight ahead."""

    def lateral(
        self, h: float, *, r: float, delta: float, a_x: float, a_y: float, straight: float
    ) -> tuple[float, float]:
        """Advance the state by `h` [s] to a message; return v_y [m/s] and dv_y/dt [m/s2].

        Args:
            r, delta: yaw rate [rad/s] and steer angle [rad].
            a_x, a_y: accelerations in the road plane [m/s2].
            straight: time for which the car has been driving straight ahead [s].
        """
        raise NotImplementedError

    # ---- common to all estimators------------------------------------------------------------

    def start(self, t: float, u: list[float]) -> None:
        self.zeros = ZeroPoints(self.p)
        self.speed = ReferenceSpeed(u[4:8], self.p)
        self.v_y = 0.0
        self.steered = u[3]
        self.steering = LowPass(self.p.inertial_bandwidth, u[3]) if self.p.inertial_bandwidth else None
        self.begin()
        self._conclude(u, 0.0, 0.0)

    def advance(self, t: float, h: float, u: list[float]) -> None:
        if h <= 0.0:
            return
        felt_r, a_x, felt_y, delta = u[:4]
        zeros = self.zeros
        zeros.see(h, r=felt_r, a_y=felt_y, delta=delta)
        delta = self._steered(h, delta)
        r = felt_r - zeros.yaw_rate
        a_y = (felt_y - zeros.acceleration) / (1.0 + self.p.roll_at_1_g)
        self.speed.see(u[4:8], h, r=r, v_y=self.v_y, delta=delta, a_x=a_x)
        self.v_y, rate = self.lateral(h, r=r, delta=delta, a_x=a_x, a_y=a_y, straight=zeros.straight)
        self._conclude(u, a_y, rate)

    def output(self, t: float, u: list[float]) -> list[float]:
        return self.known

    def _steered(self, h: float, delta: float) -> float:
        """Return the steer angle [rad] at the time of the inertial signals."""
        if self.steering is None:
            return delta
        self.steering.advance(h, self.steered, delta)
        self.steered = delta
        return self.steering.x

    def _conclude(self, u: list[float], a_y: float, rate: float) -> None:
        """Set the estimates for the current time, from a_y and dv_y/dt [m/s2]."""
        p = self.p
        r, a_x, delta = u[0] - self.zeros.yaw_rate, u[1], u[3]
        ahead = self.speed.rate
        v_x = max(self.speed.v + p.signal_delay * ahead, 0.0)
        v_y = self.v_y + p.signal_delay * rate
        square = max(v_x * v_x + v_y * v_y, LOW_SPEED * LOW_SPEED)
        velocities = wheel_velocities(v_x, v_y, r=r, delta=delta, p=p)
        along, across = velocities[:4], velocities[4:]
        self.known = [
            v_x,
            v_y,
            atan2(v_y, v_x),
            (v_x * rate - v_y * ahead) / square,
            *(slip_angle(v, side, LOW_SPEED) for v, side in zip(along, across, strict=True)),
            *(slip_ratio(w * p.wheel_radius, v, LOW_SPEED) for w, v in zip(u[4:8], along, strict=True)),
            *quasi_static_loads(a_x, a_y, p),
            *along,
        ]


LOW_SPEED = 2.0
"""Reference speed [m/s] of slips and rates of a slower car; chosen: walking pace."""
