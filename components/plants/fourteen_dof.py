"""Car with fourteen degrees of freedom: body in space, four wheels up and down, spin of the four wheels.

    m (dv_x/dt - v_y r) = X - 1/2 rho C_D A v_x |v_x| - m g f v_x / |v_x|                   (a)
    m (dv_y/dt + v_x r) = Y                                                            (b)
    J dw_i/dt = T_i - F_xi R                                                           (c)

with X, Y the sums of the tyre forces in vehicle axes, v_x, v_y the velocity of the car's centre of mass.
Yaw, roll, pitch, heave and the vertical motion of the wheels are those of `cars.ride`, equations
(1)-(11): springs, dampers, anti-roll bars, roll centres, tyre springs that cannot pull. Slips are those
of the contact points, which move with body and wheels (`cars.contact_points`).

Stands in for a multi-body model. Degrees of freedom and assumptions as in T. Shim, C. Ghike,
Understanding the limitations of different vehicle models for roll dynamics studies, Vehicle System
Dynamics 45(3), 2007, 191-216: rigid body, vertical wheel travel, linear springs and dampers at the
wheels, no bump stops, no camber, no steering by roll. Ours differs: yaw axis vertical, roll and pitch to
second order in the kinetic energy, roll centres as slopes of the wheels' paths. Wheels share the
body's horizontal motion at `unsprung_height`, no anti-dive. Derivation: docs/plant_fourteen_dof.md. A car
that rolls over, beyond 45 degrees of roll or pitch, is an error.
Drag acts at the centre of mass, rolling resistance as in `plants.eight_dof`.

How it couples. Vertical loads follow from the tyre springs, that is from the state: there is no loop of
loads and forces here. Nothing but the front wheels' slip and longitudinal velocity follows an input
directly; tyre forces and torques belong to the middle of the step, accelerations are carried to
its end (`mathematics.carry`), as in `plants.seven_dof`. Solved over a step with held forces: plane motion by
`cars.plane_body`, wheels by `cars.wheel_spin`, the rest by Runge-Kutta, in substeps where the
springs are stiff or the step is long.
"""

from __future__ import annotations

from math import degrees, pi

from ..cars.car_signals import INPUTS, MOTION, WHEELS, initial_motion, motion_outputs, wheel_outputs
from ..cars.contact_points import contact, contact_velocities
from ..cars.plane_body import move
from ..cars.resistance import resistance
from ..cars.ride import AT_REST, RESOLVED, loads, move_ride
from ..cars.sprung_car import FourteenDofParameters, G, ride_of
from ..cars.wheel_spin import spin_wheels
from ..fmi.component import Component
from ..fmi.variables import output
from ..mathematics import carry

ROLLED_OVER = 0.25 * pi
"""Roll or pitch [rad] from which on these equations are wrong; chosen: half way on to its side."""

HEAVE = output("heave", unit="m", text="Height of the sprung mass's centre above its place at rest")


class FourteenDof(Component):
    """Car with fourteen degrees of freedom (body in space, wheel travel, wheel spins) on tyre springs."""

    Parameters = FourteenDofParameters
    inputs = INPUTS
    outputs = (*MOTION, "roll_angle", "roll_rate", "pitch_angle", HEAVE, *WHEELS)

    def configure(self):
        p = self.p
        self.ride = ride_of(p)
        self.longest = RESOLVED / self.ride.fastest()
        self.drag = 0.5 * p.air_density * p.drag_coefficient * p.frontal_area
        self.rolling = p.rolling_resistance * p.mass * G

    def start(self, t, u):
        p = self.p
        self.motion = initial_motion(p)
        high = p.initial_heave
        self.body: tuple[float, ...] = (high, 0.0, 0.0, high, high, high, high, *AT_REST[7:])
        self.steer_angle = u[0]
        self.wheels = self._wheels()
        self.spins = tuple([v / p.wheel_radius for v in self.wheels[:4]])  # rolling freely
        self.loads = loads(self.body, self.ride)
        held = self._contact(u[0], u)
        self.history = ((0.0, held.x, held.y),) * 2  # age [s] and forces at the last two middles
        self.ages = (0.0, 0.0, 0.0)
        self.end = self._accelerations(held.x, held.y)

    def advance(self, t, h, u):
        delta_end = u[0]
        if h <= 0.0:  # nothing moves
            self.steer_angle = delta_end
            self.wheels = self._wheels()
            return
        p = self.p
        held = self._contact(0.5 * (self.steer_angle + delta_end), u)
        x, y = held.x, held.y
        v_x, v_y, r = self.motion[:3]
        r_end, *body = move_ride(r, self.body, h, held=held, ride=self.ride, longest=self.longest)
        _, roll, pitch = body[:3]
        if abs(roll) >= ROLLED_OVER or abs(pitch) >= ROLLED_OVER:
            raise ValueError(
                f"the car has rolled over: roll {degrees(roll):.3g}, pitch {degrees(pitch):.3g} degrees; "
                f"its equations end at {degrees(ROLLED_OVER):g}"
            )
        middle = v_x + 0.5 * h * (self.end[0] + v_y * r)
        resisting = resistance(middle, drag=self.drag, rolling=self.rolling, fade=p.rolling_fade_speed)
        self.motion = move(self.motion, h, a_x=(x - resisting) / p.mass, a_y=y / p.mass, dr=(r_end - r) / h)
        self.body = tuple(body)
        self.steer_angle = delta_end
        before = self.wheels
        self.wheels = self._wheels()
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
        self.loads = loads(self.body, self.ride)
        (age_1, x_1, y_1), (age_2, x_2, y_2) = self.history
        ages = (0.5 * h, age_1 + h, age_2 + h)
        if ages != self.ages:
            self.ages = ages
            self.weights = carry.weights(*ages)
        k_0, k_1, k_2 = self.weights
        self.history = ((0.5 * h, x, y), (age_1 + h, x_1, y_1))
        self.end = self._accelerations(k_0 * x + k_1 * x_1 + k_2 * x_2, k_0 * y + k_1 * y_1 + k_2 * y_2)

    def output(self, t, u):
        p = self.p
        a_x, a_y = self.end
        heave, roll, pitch = self.body[:3]
        roll_rate = self.body[8]
        motion = motion_outputs(self.motion, a_x, a_y, p.low_speed)
        wheels = wheel_outputs(self.wheels, self.spins, self.loads, radius=p.wheel_radius, v_low=p.low_speed)
        return (*motion, roll, roll_rate, pitch, heave, *wheels)

    def _contact(self, delta, u):
        p = self.p
        return contact(
            delta, u[1:9], a=p.cg_to_front_axle, b=p.cg_to_rear_axle, half_track=0.5 * p.track_width
        )

    def _accelerations(self, x, y):
        """Return a_x, a_y [m/s2] at the present time from the tyre forces there [N]."""
        p = self.p
        resisting = resistance(
            self.motion[0], drag=self.drag, rolling=self.rolling, fade=p.rolling_fade_speed
        )
        return (x - resisting) / p.mass, y / p.mass

    def _wheels(self):
        """Return the velocities of the contact points [m/s], longitudinal and lateral."""
        p = self.p
        v_x, v_y, r = self.motion[:3]
        return contact_velocities(
            v_x,
            v_y,
            r,
            self.body,
            delta=self.steer_angle,
            ride=self.ride,
            a=p.cg_to_front_axle,
            b=p.cg_to_rear_axle,
        )
