"""Car with eight degrees of freedom: plane motion and roll of the body, spin of the four wheels.

    m a_x + 2 m_s h_s r dphi + m_s h_s phi dr = X - 1/2 rho C_D A v_x |v_x| - m g f v_x / |v_x|         (2)
    m a_y - m_s h_s ddphi = Y_f + Y_r                                                          (1)
    I_z dr = M                                                                                 (3)
    I_x ddphi = m_s h_s a_y + m_s g h_s sin(phi) - K phi - C dphi                              (4)
    J dw_i = T_i - F_xi R                                                                      (8)
    F_zf = (m g b - h X) / 2L -/+ (K_f phi + C_f dphi + h_f Y_f) / d      minus left, plus right   (13)
    F_zr = (m g a + h X) / 2L -/+ (K_r phi + C_r dphi + h_r Y_r) / d

with a_x = dv_x - v_y r, a_y = dv_y + v_x r, dotted quantities written with a d, phi positive with the
left side up, X, Y_f, Y_r, M the resultants of the tyre forces (`cars.plane_body`). phi belongs to the
sprung mass; v_x, v_y, a_x, a_y to the point of the roll axis below the centre of mass, which is what the
paper calls the centre of mass. The pair (1), (4) is solved for a_y and ddphi exactly. A wheel that
lifts has no load; the other wheel of its axle then carries the axle.

Rolling resistance is a force on the body, as in the paper, not a torque on the wheels. It fades below
`rolling_fade_speed`, so a car at rest stays at rest.

Source: Vehicle yaw stability control based on fuzzy sliding mode direct yaw moment, equations (1)-(4),
(8)-(13). Errata: (2) prints m_s h_s dphi, whose units are wrong, and adds xi m dv_x with xi = 1.04,
which would double the mass (here the excess alone, 0: the wheels' inertia is in (8)); C_D A V^2 / 21.15
is for km/h; the printed roll stiffness 5600 lies barely above m_s g h_s. The paper numbers the wheels
fl, fr, rr, rl.

How it couples, and why nothing but the front wheels' slip depends directly on an input: as in
`plants.seven_dof`. The equations stand in `cars.rolling_body`. How they are solved over a step with
held forces: roll exactly (`mathematics.oscillator`), so any roll stiffness goes with any step, plane
motion by `cars.plane_body`, wheels by `cars.wheel_spin`.
"""

from __future__ import annotations

from ..cars.car_signals import INPUTS, MOTION, WHEELS, initial_motion, motion_outputs, wheel_outputs
from ..cars.plane_body import move, resultants
from ..cars.rolling_body import RollingCarParameters, RollModel, accelerations, longitudinal, vertical_loads
from ..cars.wheel_kinematics import wheel_velocities
from ..cars.wheel_spin import spin_wheels
from ..fmi.component import Component
from ..mathematics import carry
from ..mathematics.oscillator import transition


class EightDof(Component):
    """Car with eight degrees of freedom (plane motion, roll, four wheel spins), loads through roll."""

    Parameters = RollingCarParameters
    inputs = INPUTS
    outputs = (*MOTION, "roll_angle", "roll_rate", *WHEELS)

    def configure(self):
        self.roll = RollModel.of(self.p)
        self.step_size = 0.0

    def start(self, t, u):
        p = self.p
        self.motion = initial_motion(p)
        self.steer_angle = u[0]
        self.wheels = self._wheels()
        self.spins = tuple([v / p.wheel_radius for v in self.wheels[:4]])  # rolling freely
        forces = self._resultants(u[0], u)
        roll = self.roll
        phi = 0.0
        for _ in range(20):  # the body hangs in its springs; sin(phi) - phi is tiny
            phi = roll.forcing(forces[1] + forces[2], phi, p) / roll.stiffness
        self.angle, self.rate = phi, 0.0
        self.history = ((0.0, forces), (0.0, forces))  # age [s] and resultants at the last two middles
        self.ages = (0.0, 0.0, 0.0)
        self._finish(forces)

    def advance(self, t, h, u):
        delta_end = u[0]
        if h <= 0.0:  # nothing moves
            self.steer_angle = delta_end
            self.wheels = self._wheels()
            return
        p = self.p
        forces = self._resultants(0.5 * (self.steer_angle + delta_end), u)
        x, y_f, y_r, moment = forces
        self._move(h, x, y_f + y_r, moment)
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
        (age_1, forces_1), (age_2, forces_2) = self.history
        ages = (0.5 * h, age_1 + h, age_2 + h)
        if ages != self.ages:
            self.ages = ages
            self.weights = carry.weights(*ages)
        k_0, k_1, k_2 = self.weights
        self.history = ((0.5 * h, forces), (age_1 + h, forces_1))
        self._finish(
            tuple([k_0 * a + k_1 * b + k_2 * c for a, b, c in zip(forces, forces_1, forces_2)])  # noqa: B905
        )

    def output(self, t, u):
        p = self.p
        wheels = wheel_outputs(self.wheels, self.spins, self.loads, radius=p.wheel_radius, v_low=p.low_speed)
        return (*motion_outputs(self.motion, *self.end, p.low_speed), self.angle, self.rate, *wheels)

    def _resultants(self, delta, u):
        p = self.p
        return resultants(
            delta, u[1:9], a=p.cg_to_front_axle, b=p.cg_to_rear_axle, half_track=0.5 * p.track_width
        )

    def _move(self, h, x, y, moment):
        """Take roll and plane motion over `h` [s] under held resultants [N], [N.m]."""
        p, roll = self.p, self.roll
        if h != self.step_size:
            self.step_size = h
            self.transition = transition(roll.decay, roll.stiffness, h)
        phi, dphi = self.angle, self.rate
        rest = roll.forcing(y, phi + 0.5 * h * dphi, p) / roll.stiffness
        t_11, t_12, t_21, t_22 = self.transition
        offset = phi - rest
        self.angle = phi_end = rest + (t_11 * offset + t_12 * dphi)
        self.rate = dphi_end = t_21 * offset + t_22 * dphi
        v_x, v_y, r = self.motion[:3]
        dr = moment / p.yaw_inertia
        half = 0.5 * h
        a_y = (y + roll.coupling * (dphi_end - dphi) / h) / p.mass  # mean over the step
        a_x = longitudinal(
            x,
            v_x=v_x + half * (self.end[0] + v_y * r),  # at the middle of the step
            v_y=v_y + half * (a_y - v_x * r),
            r=r + half * dr,
            phi=0.5 * (phi + phi_end),
            dphi=(phi_end - phi) / h,
            dr=dr,
            p=p,
            roll=roll,
        )
        self.motion = move(self.motion, h, a_x=a_x, a_y=a_y, dr=dr)

    def _finish(self, forces):
        """Set accelerations and loads from the resultants at the present time."""
        v_x, v_y, r = self.motion[:3]
        phi, dphi = self.angle, self.rate
        self.end = accelerations(forces, v_x=v_x, v_y=v_y, r=r, phi=phi, dphi=dphi, p=self.p, roll=self.roll)[
            :2
        ]
        self.loads = vertical_loads(forces, phi=phi, dphi=dphi, p=self.p)

    def _wheels(self):
        """Return the velocities of the wheels [m/s], longitudinal and lateral."""
        p = self.p
        v_x, v_y, r = self.motion[:3]
        return wheel_velocities(
            v_x,
            v_y,
            r=r,
            delta=self.steer_angle,
            a=p.cg_to_front_axle,
            b=p.cg_to_rear_axle,
            half_track=0.5 * p.track_width,
        )
