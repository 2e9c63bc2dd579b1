"""Car with two degrees of freedom, lateral and yaw motion at constant v_x, on four tyres.

    m (dv_y/dt + v_x r) = Y = (F_yfl + F_yfr) cos(delta) + F_yrl + F_yrr                      (1)
    I_z dr/dt = a (F_yfl + F_yfr) cos(delta) - b (F_yrl + F_yrr)
                + d/2 (F_yfl - F_yfr) sin(delta) + M                                      (2)

Each wheel has its own slip angle and its own load, quasi-static from a_y = Y / m
(`cars.load_transfer`, a_x = 0: whatever holds the speed loads no axle). The wheels roll freely:
longitudinal slip is 0, and longitudinal tyre forces, which the role has as inputs, are left out as in
the paper. The controller's yaw moment M acts on the body from outside.

Whatever holds v_x does work: a car that spins gains speed here, v_x / cos(beta), at 60 degrees of sideslip
twice its own. Beyond some 20 degrees the model says that the car is lost, not how it moves.

Source: Xie, Li, Zheng, Pei, Synthesized feedback control of the ESP system based on fuzzy technology,
2-DOF model with four wheels. The height h is the paper's 0.5 m.

How it couples. Tyre forces and the yaw moment enter the integration only, at the middle of the step; the
steer angle feeds the front slip angles directly. The lateral acceleration, known at the middle of each
step, is carried to its end (`mathematics.carry`), which leaves the loop of loads and forces open, as in
`plants.seven_dof`. With held forces r is linear and v_y a parabola, both exact; the path is taken by
Gauss's rule with two points.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, sin

from ..cars.car_signals import MOTION, initial_motion, motion_outputs
from ..cars.load_transfer import quasi_static_loads
from ..cars.plane_body import Motion
from ..cars.wheel_kinematics import earth_velocity, slip_angle, wheel_velocities
from ..fmi.component import Component
from ..fmi.variables import output, parameter
from ..mathematics import carry

_GAUSS = (0.5 - 0.5 / 3.0**0.5, 0.5 + 0.5 / 3.0**0.5)


@dataclass(frozen=True)
class TwoDofParameters:
    """The car of paper D."""

    mass: float = parameter(1820.0, "kg", "Vehicle mass m; paper D", minimum=1.0)
    yaw_inertia: float = parameter(3800.0, "kg.m2", "Yaw inertia I_z; paper D", minimum=1.0)
    cg_to_front_axle: float = parameter(
        1.463, "m", "Distance a of the centre of mass from the front axle; paper D", minimum=0.1
    )
    cg_to_rear_axle: float = parameter(
        1.585, "m", "Distance b of the centre of mass from the rear axle; paper D", minimum=0.1
    )
    track_width: float = parameter(1.5, "m", "Track width d; paper D", minimum=0.1)
    cg_height: float = parameter(0.5, "m", "Height h of the centre of mass; paper D", minimum=0.0)
    initial_speed: float = parameter(25.0, "m/s", "Speed at the start; its part along x is kept; paper D")
    initial_sideslip: float = parameter(0.0, "rad", "Sideslip angle at the start; chosen: none")
    initial_yaw_rate: float = parameter(0.0, "rad/s", "Yaw rate at the start; chosen: none")
    low_speed: float = parameter(
        0.5,
        "m/s",
        "Slip angles refer to this speed when the wheel is slower; chosen: as other plants",
        minimum=0.001,
    )


def lateral_resultants(
    delta: float, f_y: tuple[float, ...] | list[float], *, a: float, b: float, half_track: float
) -> tuple[float, float]:
    """Return the force Y [N] and the moment [N.m] of the lateral tyre forces; equations (1), (2).

    Args:
        delta: steer angle of both front wheels [rad].
        f_y: lateral forces of fl, fr, rl, rr, wheel axes [N].
        a, b, half_track: distances of axles and wheels from the centre of mass [m].
    """
    y_fl, y_fr, y_rl, y_rr = f_y
    front = (y_fl + y_fr) * cos(delta)
    rear = y_rl + y_rr
    return front + rear, a * front - b * rear + half_track * (y_fl - y_fr) * sin(delta)


def drift(motion: Motion, h: float, *, a_y: float, dr: float) -> Motion:
    """Return the motion after `h` [s] at constant v_x under held a_y [m/s2], dr/dt [rad/s2]."""
    v_x, v_y, r, x, y, psi = motion
    for part in _GAUSS:
        t = part * h
        side = v_y + t * (a_y - v_x * (r + 0.5 * dr * t))
        along, across = earth_velocity(v_x, side, psi + t * (r + 0.5 * dr * t))
        x += 0.5 * h * along
        y += 0.5 * h * across
    turned = r + 0.5 * dr * h
    return v_x, v_y + h * (a_y - v_x * turned), r + h * dr, x, y, psi + h * turned


class TwoDof(Component):
    """Car with two degrees of freedom (lateral, yaw) at constant speed on four tyres, quasi-static loads."""

    Parameters = TwoDofParameters
    inputs = ("steer_angle", "tyre_force_x_*", "tyre_force_y_*", "yaw_moment")
    outputs = (
        *MOTION,
        output("slip_angle_fl", "steer_angle"),
        output("slip_angle_fr", "steer_angle"),
        "slip_angle_rl",
        "slip_angle_rr",
        "slip_ratio_*",
        "vertical_load_*",
        output("wheel_velocity_fl", "steer_angle"),
        output("wheel_velocity_fr", "steer_angle"),
        "wheel_velocity_rl",
        "wheel_velocity_rr",
    )

    def start(self, t, u):
        p = self.p
        self.motion = initial_motion(p)
        self.steer_angle = u[0]
        a_y = self._resultants(u[0], u)[0] / p.mass
        self.history = ((0.0, a_y), (0.0, a_y))  # age [s] and acceleration at the last two middles
        self._finish(a_y)

    def advance(self, t, h, u):
        delta, self.steer_angle = self.steer_angle, u[0]
        if h <= 0.0:  # nothing moves
            self._finish(self.a_y)
            return
        p = self.p
        force, moment = self._resultants(0.5 * (delta + u[0]), u)
        a_y = force / p.mass
        self.motion = drift(self.motion, h, a_y=a_y, dr=(moment + u[9]) / p.yaw_inertia)
        (age_1, y_1), (age_2, y_2) = self.history
        k_0, k_1, k_2 = carry.weights(0.5 * h, age_1 + h, age_2 + h)
        self.history = ((0.5 * h, a_y), (age_1 + h, y_1))
        self._finish(k_0 * a_y + k_1 * y_1 + k_2 * y_2)

    def output(self, t, u):
        low = self.p.low_speed
        _, v_y, r = self.motion[:3]
        v_fl, v_fr, v_rl, v_rr, side_fl, side_fr, side_rl, side_rr = self.wheels
        return (
            *motion_outputs(self.motion, -v_y * r, self.a_y, low),
            slip_angle(v_fl, side_fl, low),
            slip_angle(v_fr, side_fr, low),
            slip_angle(v_rl, side_rl, low),
            slip_angle(v_rr, side_rr, low),
            0.0,
            0.0,
            0.0,
            0.0,
            *self.loads,
            v_fl,
            v_fr,
            v_rl,
            v_rr,
        )

    def _resultants(self, delta, u):
        p = self.p
        return lateral_resultants(
            delta, u[5:9], a=p.cg_to_front_axle, b=p.cg_to_rear_axle, half_track=0.5 * p.track_width
        )

    def _finish(self, a_y):
        """Set lateral acceleration [m/s2], wheel velocities and loads at the present time."""
        p = self.p
        a, b = p.cg_to_front_axle, p.cg_to_rear_axle
        v_x, v_y, r = self.motion[:3]
        self.a_y = a_y
        self.wheels = wheel_velocities(
            v_x, v_y, r=r, delta=self.steer_angle, a=a, b=b, half_track=0.5 * p.track_width
        )
        self.loads = quasi_static_loads(
            0.0, a_y, mass=p.mass, a=a, b=b, track_width=p.track_width, height=p.cg_height
        )
