"""Car with eight degrees of freedom: plane motion and roll of the body, spin of the four wheels.

    m a_x + 2 m_s h_s r dphi + m_s h_s phi dr = X - 1/2 rho C_D A v_x |v_x|                     (2)
    m a_y - m_s h_s ddphi = Y_f + Y_r                                                          (1)
    I_z dr = M                                                                                 (3)
    I_x ddphi = m_s h_s a_y + m_s g h_s sin(phi) - K phi - C dphi                              (4)
    J dw_i = T_i - F_xi R - f F_zi R w_i / |w_i|                                               (8)
    F_zf = (m g b - h X) / 2L -/+ (K_f phi + C_f dphi + h_f Y_f) / d      minus left, plus right   (13)
    F_zr = (m g a + h X) / 2L -/+ (K_r phi + C_r dphi + h_r Y_r) / d

with a_x = dv_x - v_y r, a_y = dv_y + v_x r; a prefix d denotes the time derivative, phi is positive with the
left side up, and X, Y_f, Y_r, M are the resultants of the tyre forces (`cars.plane_body`). phi is the roll
angle of the sprung mass; v_x, v_y, a_x, a_y refer to the point of the roll axis below the centre of mass,
which the paper calls the centre of mass. (1) and (4) are solved for a_y and ddphi exactly. Lifted wheels:
`cars.load_transfer`. Inclines and wind: `cars.road_plane`. Camber for tyre models that use it:
`cars.roll_camber`. Roll steer, off by default: `cars.wheel_steer`.

Ours differs: rolling resistance is a moment on each wheel (`cars.resistance`), whereas the paper has a force
m g f on the body in (2). Free wheels slow the car equally; with driven wheels the tyre forces are smaller by
m g f.

Source: paper B, equations (1)-(4), (8)-(13). Errata: (2) prints m_s h_s dphi, whose units are wrong, and adds
xi m dv_x with xi = 1.04, which would double the mass (here the excess alone, 0: the wheels' inertia is in
(8)); C_D A V^2 / 21.15 is for km/h; the printed roll stiffness 5600 lies barely above m_s g h_s. The paper
numbers the wheels fl, fr, rr, rl.

Coupling as in `plants.seven_dof`, which explains why only the front wheels' slips depend directly on an
input. The equations are in `cars.rolling_body`. Under held forces roll is solved exactly
(`mathematics.oscillator`), so any roll stiffness works with any step, plane motion by `cars.plane_body`, the
wheels by `cars.wheel_spin`.
"""

from collections.abc import Sequence
from typing import Any

from yawbench.vocabulary.wheels import Four

from ..cars.car import DRIVEN_WHEELS, MOTION, DrivenCar
from ..cars.plane_body import move, resultants
from ..cars.roll_camber import inclinations
from ..cars.rolling_body import RollingBody, RollingCarParameters
from ..cars.wheel_steer import steer_by_travel
from ..mathematics.carry import Values
from ..mathematics.oscillator import transition


class EightDof(DrivenCar):
    """Car with eight degrees of freedom (plane motion, roll, four wheel spins), load transfer by roll."""

    Parameters = RollingCarParameters
    outputs = (*MOTION, "roll_angle", "roll_rate", *DRIVEN_WHEELS, "inclination_angle_*")

    def configure(self) -> None:
        self.body = RollingBody(self.p)
        self.rolling_resistance = self.p.rolling_resistance
        self.step_size = 0.0

    def rest(self, signals: Sequence[Any]) -> Values:
        held = resultants(signals[0], signals[1], signals[2], self.p, signals[6])
        phi = 0.0
        for _ in range(20):  # static roll angle by fixed-point iteration; sin(phi) - phi is tiny
            phi = self.body.forcing(held[1] + held[2], phi, self.pull) / self.body.stiffness
        self.angle, self.rate = phi, 0.0
        return held

    def move(self, h: float, delta: float, signals: Sequence[Any]) -> Values:
        p, body = self.p, self.body
        x, y_f, y_r, moment = held = resultants(delta, signals[1], signals[2], self.p, signals[6])
        y = y_f + y_r
        pull = self.pull
        if h != self.step_size:
            self.step_size = h
            self.transition = transition(body.decay, body.stiffness, h)
        phi, dphi = self.angle, self.rate
        rest = body.forcing(y, phi + 0.5 * h * dphi, pull) / body.stiffness
        t_11, t_12, t_21, t_22 = self.transition
        offset = phi - rest
        self.angle = phi_end = rest + (t_11 * offset + t_12 * dphi)
        self.rate = dphi_end = t_21 * offset + t_22 * dphi
        v_x, v_y, r = self.motion[:3]
        dr = (moment + pull.turn) / p.yaw_inertia
        half = 0.5 * h
        a_y = (y + body.coupling * (dphi_end - dphi) / h) / p.mass + pull.y  # mean over the step
        a_x = body.longitudinal(
            x,
            pull=pull,
            v_x=v_x + half * (self.end[0] + v_y * r),  # at the middle of the step
            v_y=v_y + half * (a_y - v_x * r),
            r=r + half * dr,
            phi=0.5 * (phi + phi_end),
            dphi=(phi_end - phi) / h,
            dr=dr,
        )
        self.motion = move(self.motion, h, a_x=a_x, a_y=a_y, dr=dr)
        return held

    def finish(self, carried: Values) -> None:
        x, y_f, y_r, moment = carried
        v_x, v_y, r = self.motion[:3]
        phi, dphi = self.angle, self.rate
        held = x, y_f, y_r, moment
        pull = self.pull
        self.end = self.body.accelerations(held, pull=pull, v_x=v_x, v_y=v_y, r=r, phi=phi, dphi=dphi)
        self.loads = self.body.vertical_loads(held, pull=pull, phi=phi, dphi=dphi)

    def steered_angles(self) -> Four:
        angles = super().steered_angles()
        p = self.p
        if not (p.roll_steer_front or p.roll_steer_rear):
            return angles
        half = 0.5 * p.track_width
        travel = -half * self.angle  # of the left wheels
        fl, fr = steer_by_travel(travel, -travel, half, coefficient=p.roll_steer_front)
        rl, rr = steer_by_travel(travel, -travel, half, coefficient=-p.roll_steer_rear)
        a_fl, a_fr, a_rl, a_rr = angles
        return a_fl - fl, a_fr - fr, a_rl - rl, a_rr - rr

    def output(self, t: float, u: list[float]) -> tuple[float, ...]:
        return (
            *self.motion_values(),
            self.angle,
            self.rate,
            *self.wheel_values(),
            *inclinations(self.angle, self.p),
        )
