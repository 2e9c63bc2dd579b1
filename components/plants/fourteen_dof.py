"""Car with fourteen degrees of freedom: body in space, vertical motion and spin of the four wheels.

    m (dv_x/dt - v_y r) = X - 1/2 rho C_D A v_x |v_x|                                  (a)
    m (dv_y/dt + v_x r) = Y                                                            (b)
    J dw_i/dt = T_i - F_xi R - f F_zi R w_i / |w_i|                                    (c)

with X, Y the sums of the tyre forces in vehicle axes, v_x, v_y the velocity of the car's centre of mass.
Yaw, roll, pitch, heave and the vertical motion of the wheels are those of `cars.ride`, equations
(1)-(11): springs, dampers, anti-roll bars, roll centres, tyre springs that cannot pull. Slips are those
of the contact points, which move with body and wheels (`cars.contact_points`).

The model replaces a multi-body model. Degrees of freedom and assumptions as in T. Shim, C. Ghike,
Understanding the limitations of different vehicle models for roll dynamics studies, Vehicle System
Dynamics 45(3), 2007, 191-216: rigid body, vertical wheel travel, linear springs and dampers at the
wheels, no bump stops. Ours differs: vertical yaw axis, roll and pitch to second order in the
kinetic energy, roll centres as slopes of the wheels' paths. Wheels have the body's horizontal motion at
`unsprung_height`; no anti-dive. Derivation: docs/plant_fourteen_dof.md. Rollover, beyond 45 degrees of roll
or pitch, is an error. Drag acts at the centre of mass, rolling resistance at the wheels (`cars.resistance`).
Wheels incline with the body (`cars.roll_camber`), for tyre models with camber; roll and bump steer, off by
default, follow the wheel travel (`cars.wheel_steer`).

Coupling: vertical loads follow from the tyre springs, that is from the state, so there is no loop of loads
and forces. Only the slips and longitudinal velocities of the front wheels depend directly on an input; tyre
forces and torques belong to the middle of the step, and accelerations are extrapolated to its end
(`mathematics.carry`), as in `plants.seven_dof`. Under held forces plane motion is solved by
`cars.plane_body`, the wheels by `cars.wheel_spin`, the rest by Runge-Kutta, in substeps if springs are stiff
or the step is long.
"""

from collections.abc import Sequence
from math import degrees, pi
from typing import Any

from yawbench.vocabulary.wheels import Four

from ..cars.car import DRIVEN_WHEELS, MOTION, DrivenCar
from ..cars.contact_points import contact, contact_velocities
from ..cars.plane_body import move
from ..cars.resistance import drag_of
from ..cars.ride import AT_REST, RESOLVED, loads, move_ride
from ..cars.roll_camber import inclinations
from ..cars.sprung_car import FourteenDofParameters, ride_of
from ..cars.wheel_kinematics import Eight
from ..cars.wheel_steer import steer_by_travel
from ..fmi.variables import output
from ..mathematics.carry import Values

ROLLED_OVER = 0.25 * pi
"""Roll or pitch [rad] above which the equations are not valid; chosen: half way to lying on the side."""

HEAVE = output("heave", unit="m", text="Height of the sprung mass's centre above its position at rest")


class FourteenDof(DrivenCar):
    """Car with fourteen degrees of freedom (body in space, wheel travel, wheel spins), on tyre springs."""

    Parameters = FourteenDofParameters
    outputs = (
        *MOTION,
        "roll_angle",
        "roll_rate",
        "pitch_angle",
        HEAVE,
        *DRIVEN_WHEELS,
        "inclination_angle_*",
    )

    def configure(self) -> None:
        self.ride = ride_of(self.p)
        self.longest = RESOLVED / self.ride.fastest()
        self.drag = drag_of(self.p)
        self.rolling_resistance = self.p.rolling_resistance

    def rest(self, signals: Sequence[Any]) -> Values:
        high = self.p.initial_heave
        self.body: tuple[float, ...] = (high, 0.0, 0.0, high, high, high, high, *AT_REST[7:])
        held = contact(signals[0], signals[1], signals[2], self.p, signals[6])
        return held.x, held.y

    def move(self, h: float, delta: float, signals: Sequence[Any]) -> Values:
        held = contact(delta, signals[1], signals[2], self.p, signals[6])
        pull = self.pull
        if pull.turn:
            held = held._replace(moment=held.moment + pull.turn)
        v_x, v_y, r = self.motion[:3]
        r_end, *body = move_ride(
            r, self.body, h, held=held, ride=self.ride, longest=self.longest, lighter=pull.lighter
        )
        _, roll, pitch = body[:3]
        if abs(roll) >= ROLLED_OVER or abs(pitch) >= ROLLED_OVER:
            raise ValueError(
                f"the car has rolled over: roll {degrees(roll):.3g}, pitch {degrees(pitch):.3g} degrees; "
                f"its equations end at {degrees(ROLLED_OVER):g}"
            )
        a_x, a_y = self._accelerations(held.x, held.y, v_x + 0.5 * h * (self.end[0] + v_y * r))
        self.motion = move(self.motion, h, a_x=a_x, a_y=a_y, dr=(r_end - r) / h)
        self.body = tuple(body)
        return held.x, held.y

    def finish(self, carried: Values) -> None:
        x, y = carried
        self.loads = loads(self.body, self.ride)
        self.end = self._accelerations(x, y, self.motion[0])

    def output(self, t: float, u: list[float]) -> tuple[float, ...]:
        heave, roll, pitch = self.body[:3]
        return (
            *self.motion_values(),
            roll,
            self.body[8],
            pitch,
            heave,
            *self.wheel_values(),
            *inclinations(roll, self.p),
        )

    def wheel_velocities(self) -> Eight:
        """Return the velocities [m/s] of the contact points in wheel axes, longitudinal and lateral."""
        v_x, v_y, r = self.motion[:3]
        return contact_velocities(v_x, v_y, r, self.body, delta=self.steer_angle, ride=self.ride, p=self.p)

    def steered_angles(self) -> Four:
        angles = super().steered_angles()
        p = self.p
        if not (p.roll_steer_front or p.roll_steer_rear):
            return angles
        ride = self.ride
        half = ride.half_track
        z, phi, theta, u_fl, u_fr, u_rl, u_rr = self.body[:7]
        front, rear, side = z - ride.a * theta, z + ride.b * theta, half * phi
        fl, fr = steer_by_travel(
            u_fl - front - side, u_fr - front + side, half, coefficient=p.roll_steer_front
        )
        rl, rr = steer_by_travel(u_rl - rear - side, u_rr - rear + side, half, coefficient=-p.roll_steer_rear)
        a_fl, a_fr, a_rl, a_rr = angles
        return a_fl - fl, a_fr - fr, a_rl - rl, a_rr - rr

    def _accelerations(self, x: float, y: float, v_x: float) -> tuple[float, float]:
        """Return a_x, a_y [m/s2] from the tyre forces [N] and the speed [m/s]."""
        mass = self.p.mass
        pull = self.pull
        return (x - self.drag * v_x * abs(v_x)) / mass + pull.x, y / mass + pull.y
