"""Car with two degrees of freedom: lateral and yaw motion at constant v_x, on four tyres.

    m (dv_y/dt + v_x r) = Y = (F_yfl + F_yfr) cos(delta) + F_yrl + F_yrr                      (1)
    I_z dr/dt = a (F_yfl + F_yfr) cos(delta) - b (F_yrl + F_yrr)
                + d/2 (F_yfl - F_yfr) sin(delta) + M                                      (2)

Each wheel has its own slip angle and its own load, quasi-static from a_y = Y / m (`cars.load_transfer` with
a_x = 0: the constraint on v_x loads no axle). The wheels roll freely: longitudinal slip is 0, and
longitudinal tyre forces, which are inputs of the role, are neglected as in the paper. The controller's yaw
moment M acts on the body as an external moment.

If a measured speed is connected (`velocity_x_measured` above 0), v_x follows it: the value at the middle of a
step is extrapolated to its end, and dv_x/dt is its slope. Loads remain those of a_x = 0.

Bank and wind act as described in `cars.road_plane`; on a slope v_x is also constant, without axle load
transfer.

The constraint on v_x does work: a spinning car gains speed, v_x / cos(beta), and is twice as fast at 60
degrees of sideslip. Above about 20 degrees the model shows that control is lost, but not how the car moves.

Source: paper D, 2-DOF model with four wheels. The height h is the paper's 0.5 m.

Coupling: tyre forces and the yaw moment enter only the integration, at the middle of the step; the steer
angle feeds through to the front slip angles. The lateral acceleration, known at the middle of each step, is
extrapolated to its end (`mathematics.carry`), which avoids the algebraic loop of loads and forces, as in
`plants.seven_dof`. With held forces r is linear and v_y a parabola, both exact; the path is computed by
two-point Gauss quadrature.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import cos, sin
from typing import Any

from yawbench.vocabulary.gravity import G

from ..cars.car import MOTION, Car, StartParameters, of_steered_wheels
from ..cars.load_transfer import quasi_static_loads
from ..cars.plane_body import Geometry, Motion, sum_of
from ..cars.published_cars import PaperA
from ..cars.road_plane import INPUTS as ROAD_PLANE
from ..cars.wheel_kinematics import earth_velocity
from ..fmi.variables import like, of_car, parameter, signal
from ..mathematics.carry import Values

_GAUSS = (0.5 - 0.5 / 3.0**0.5, 0.5 + 0.5 / 3.0**0.5)


@dataclass(frozen=True)
class TwoDofParameters(StartParameters):
    """Parameters of paper D's car."""

    mass: float = like(PaperA, "mass", 1820.0, "paper D")
    yaw_inertia: float = like(PaperA, "yaw_inertia", 3800.0, "paper D")
    cg_to_front_axle: float = of_car(1.463, "paper D")
    cg_to_rear_axle: float = of_car(1.585, "paper D")
    track_width: float = like(PaperA, "track_width", 1.5, "paper D")
    cg_height: float = of_car(0.5, "paper D")
    initial_speed: float = parameter(
        25.0, "m/s", "Speed at the start; its component v_x is constant", "paper D"
    )


def lateral_resultants(delta: float, f_y: Sequence[float], p: Geometry) -> tuple[float, float]:
    """Return the force Y [N] and the moment [N.m] of the lateral tyre forces; equations (1), (2).

    Args:
        delta: steer angle of both front wheels [rad].
        f_y: lateral forces of fl, fr, rl, rr, wheel axes [N].
        p: geometry of the car.
    """
    y_fl, y_fr, y_rl, y_rr = f_y
    front = (y_fl + y_fr) * cos(delta)
    rear = y_rl + y_rr
    moment = p.cg_to_front_axle * front - p.cg_to_rear_axle * rear
    return front + rear, moment + 0.5 * p.track_width * (y_fl - y_fr) * sin(delta)


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


class TwoDof(Car):
    """Car with two degrees of freedom (lateral, yaw) at constant v_x, four tyres, quasi-static loads."""

    Parameters = TwoDofParameters
    inputs = (
        *("steer_angle", "tyre_force_x_*", "tyre_force_y_*", "yaw_moment"),
        signal("tyre_moment_z_*", optional=True),
        *ROAD_PLANE,
        signal(
            "velocity_x_measured",
            "m/s",
            "Speed along x that the car follows; 0: constant speed",
            optional=True,
        ),
    )
    outputs = (
        *MOTION,
        *of_steered_wheels("slip_angle"),
        "slip_ratio_*",
        "vertical_load_*",
        *of_steered_wheels("wheel_velocity"),
    )

    def rest(self, signals: Sequence[Any]) -> Values:
        self.speed = 0.0
        self.slope = 0.0
        return (lateral_resultants(signals[0], signals[2], self.p)[0] / self.p.mass,)

    def move(self, h: float, delta: float, signals: Sequence[Any]) -> Values:
        pull = self.pull
        yaw_moment = signals[3] + sum_of(signals[4]) + pull.turn
        force, moment = lateral_resultants(delta, signals[2], self.p)
        a_y = force / self.p.mass
        dr = (moment + yaw_moment) / self.p.yaw_inertia
        speed, before = signals[-1], self.speed
        if speed > 0.0:
            self.slope = (speed - before) / h if before > 0.0 else 0.0
            self.speed = speed
            self.motion = (speed, *self.motion[1:])
        self.motion = drift(self.motion, h, a_y=a_y + pull.y, dr=dr)
        if speed > 0.0:
            self.motion = (speed + 0.5 * h * self.slope, *self.motion[1:])
        return (a_y,)

    def finish(self, carried: Values) -> None:
        (a_y,) = carried
        _, v_y, r = self.motion[:3]
        self.end = self.slope - v_y * r, a_y + self.pull.y
        self.loads = quasi_static_loads(0.0, a_y, self.p, G - self.pull.lighter)
