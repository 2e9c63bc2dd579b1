"""Car with seven degrees of freedom: plane motion of the body, spin of the four wheels.

    m (dv_x/dt - v_y r) = X,    m (dv_y/dt + v_x r) = Y                                     (5), (6)
    X = (F_xfl + F_xfr) cos(delta) - (F_yfl + F_yfr) sin(delta) + F_xrl + F_xrr
    Y = (F_xfl + F_xfr) sin(delta) + (F_yfl + F_yfr) cos(delta) + F_yrl + F_yrr
    I_z dr/dt = a [(F_yfl + F_yfr) cos(delta) + (F_xfl + F_xfr) sin(delta)] - b (F_yrl + F_yrr)
                + d/2 [(F_yfl - F_yfr) sin(delta) + (F_xfr - F_xfl) cos(delta) + F_xrr - F_xrl]     (7)
    J dw_i/dt = T_i - F_xi R                                                                (8)
    F_zf = m g b / 2L - m h a_x / 2L -/+ b m h a_y / (L d)        minus left, plus right   (17)
    F_zr = m g a / 2L + m h a_x / 2L -/+ a m h a_y / (L d)                                 (18)

with a_x = X / m, a_y = Y / m. A wheel that lifts has no load; the other wheel of its axle then
carries the axle, so the loads always add up to m g. Roll, pitch and suspension are left out.

Source: Yuan, Chen, Huang, Shi, Adaptive lateral stability control of electric vehicle based on
FNN, equations (5)-(8), (13)-(20). Ours differs: the lifted wheel; slips at rest, see
`cars.wheel_kinematics`. Errata: (7) prints the rear-track term with the opposite sign;
(13)-(16) print sideslip for yaw rate; (17), (18) print b where a is meant.

How it couples. Tyre forces and wheel torques enter the integration only: they are held over the
step, and a master that knows this hands over their values at its middle. The steer angle feeds
the slip angles directly, so its value belongs to the end of the step; the forces are turned
by the mean of it and the last one. The loads follow from the accelerations, these from the
forces and these from the loads: to leave that loop open, the accelerations, known at the middle
of each step, are carried on to its end along the straight line nearest to the last three
(`mathematics.carry`).
All of this is exact to second order in the step, which may vary. The body's motion is solved by
`cars.plane_body`, the wheels' by `cars.wheel_spin`, which also says what becomes of slow, braked wheels.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from ..cars.car_signals import INPUTS, MOTION, WHEELS, initial_motion, motion_outputs, wheel_outputs
from ..cars.load_transfer import quasi_static_loads
from ..cars.plane_body import Four, move, resultants
from ..cars.wheel_kinematics import wheel_velocities
from ..cars.wheel_spin import spin_wheels
from ..fmi.component import Component
from ..fmi.variables import parameter
from ..mathematics import carry


@dataclass(frozen=True)
class SevenDofParameters:
    """The car of paper A, table 1."""

    mass: float = parameter(1100.0, "kg", "Vehicle mass m; paper A, table 1", minimum=1.0)
    yaw_inertia: float = parameter(1249.0, "kg.m2", "Yaw inertia I_z; paper A, table 1", minimum=1.0)
    cg_to_front_axle: float = parameter(
        1.256, "m", "Distance a of the centre of mass from the front axle; paper A, table 1", minimum=0.1
    )
    cg_to_rear_axle: float = parameter(
        1.368, "m", "Distance b of the centre of mass from the rear axle; paper A, table 1", minimum=0.1
    )
    track_width: float = parameter(1.65, "m", "Track width d; paper A, table 1", minimum=0.1)
    cg_height: float = parameter(0.7, "m", "Height h of the centre of mass; paper A, table 1", minimum=0.0)
    wheel_radius: float = parameter(0.31, "m", "Wheel radius R; paper A, table 1", minimum=0.05)
    wheel_inertia: float = parameter(
        2.1, "kg.m2", "Inertia J of one wheel; chosen: paper B's value, paper A names none", minimum=0.01
    )
    initial_speed: float = parameter(25.0, "m/s", "Speed at the start; paper A drives 15, 25, 40 m/s")
    initial_sideslip: float = parameter(0.0, "rad", "Sideslip angle at the start; chosen: none")
    initial_yaw_rate: float = parameter(0.0, "rad/s", "Yaw rate at the start; chosen: none")
    low_speed: float = parameter(
        0.5,
        "m/s",
        "Slips refer to this speed when the wheel is slower; chosen: keeps a parked car quiet at 1 ms",
        minimum=0.001,
    )
    slip_stiffness_per_load: float = parameter(
        15.0,
        "1",
        "Slip stiffness over load for slow wheels, see cars.wheel_spin; chosen: paper A's tyre at rest",
        minimum=0.0,
    )


def accelerations(delta: float, forces: Sequence[float], p: SevenDofParameters) -> tuple[float, float, float]:
    """Return (a_x, a_y [m/s2], dr/dt [rad/s2]) of the centre of mass; equations (5)-(7).

    Args:
        delta: steer angle [rad].
        forces: F_x of the wheels fl, fr, rl, rr, then F_y, wheel axes [N].
    """
    x, front, rear, moment = resultants(
        delta, forces, a=p.cg_to_front_axle, b=p.cg_to_rear_axle, half_track=0.5 * p.track_width
    )
    return x / p.mass, (front + rear) / p.mass, moment / p.yaw_inertia


def vertical_loads(a_x: float, a_y: float, p: SevenDofParameters) -> Four:
    """Return F_z [N] of fl, fr, rl, rr from the accelerations [m/s2]; equations (17), (18)."""
    return quasi_static_loads(
        a_x,
        a_y,
        mass=p.mass,
        a=p.cg_to_front_axle,
        b=p.cg_to_rear_axle,
        track_width=p.track_width,
        height=p.cg_height,
    )


class SevenDof(Component):
    """Car with seven degrees of freedom (plane motion, four wheel spins), quasi-static wheel loads."""

    Parameters = SevenDofParameters
    inputs = INPUTS
    outputs = (*MOTION, *WHEELS)

    def start(self, t, u):
        p = self.p
        self.motion = initial_motion(p)
        self.steer_angle = u[0]
        self.wheels = self._wheels(u[0])
        self.spins = tuple([v / p.wheel_radius for v in self.wheels[:4]])  # rolling freely
        a_x, a_y, _ = accelerations(u[0], u[1:9], p)
        self.end = (a_x, a_y)
        self.history = ((0.0, a_x, a_y),) * 2  # age [s] and accelerations at the last two middles
        self.loads = vertical_loads(a_x, a_y, p)

    def advance(self, t, h, u):
        p = self.p
        delta, self.steer_angle = self.steer_angle, u[0]
        if h <= 0.0:  # nothing moves
            self.wheels = self._wheels(u[0])
            return
        a_x, a_y, dr = accelerations(0.5 * (delta + u[0]), u[1:9], p)
        self.motion = move(self.motion, h, a_x=a_x, a_y=a_y, dr=dr)
        before = self.wheels
        self.wheels = self._wheels(u[0])
        self.spins = spin_wheels(
            self.spins,
            h,
            torque=u[9:13],
            f_x=u[1:5],
            slip_stiffness=u[13:17],
            tyre_slip=u[17:21],
            load=self.loads,
            v=before,
            v_end=self.wheels,
            radius=p.wheel_radius,
            inertia=p.wheel_inertia,
            stiffness_per_load=p.slip_stiffness_per_load,
            v_low=p.low_speed,
        )
        (age_1, x_1, y_1), (age_2, x_2, y_2) = self.history
        k_0, k_1, k_2 = carry.weights(0.5 * h, age_1 + h, age_2 + h)
        self.history = ((0.5 * h, a_x, a_y), (age_1 + h, x_1, y_1))
        self.end = (k_0 * a_x + k_1 * x_1 + k_2 * x_2, k_0 * a_y + k_1 * y_1 + k_2 * y_2)
        self.loads = vertical_loads(*self.end, p)

    def output(self, t, u):
        p = self.p
        wheels = wheel_outputs(self.wheels, self.spins, self.loads, radius=p.wheel_radius, v_low=p.low_speed)
        return (*motion_outputs(self.motion, *self.end, p.low_speed), *wheels)

    def _wheels(self, delta):
        """Return the velocities of the wheels [m/s], longitudinal and lateral, at `delta` [rad]."""
        p = self.p
        v_x, v_y, r = self.motion[:3]
        return wheel_velocities(
            v_x,
            v_y,
            r=r,
            delta=delta,
            a=p.cg_to_front_axle,
            b=p.cg_to_rear_axle,
            half_track=0.5 * p.track_width,
        )
