"""Car with eight degrees of freedom: plane motion and roll of the body, spin of the four wheels.

    m a_x + 2 m_s h_s r dphi + m_s h_s phi dr = X - 1/2 rho C_D A v_x |v_x| - m g f v_x / |v_x|         (2)
    m a_y - m_s h_s ddphi = Y_f + Y_r                                                          (1)
    I_z dr = M                                                                                 (3)
    I_x ddphi = m_s h_s a_y + m_s g h_s sin(phi) - K phi - C dphi                              (4)
    J dw_i = T_i - F_xi R                                                                      (8)
    F_zf = (m g b - h X) / 2L -/+ (K_f phi + C_f dphi + h_f Y_f) / d      minus left, plus right   (13)
    F_zr = (m g a + h X) / 2L -/+ (K_r phi + C_r dphi + h_r Y_r) / d

with a_x = dv_x - v_y r, a_y = dv_y + v_x r, dotted quantities written with a d, phi positive with the
left side up, X, Y_f, Y_r, M the resultants of the tyre forces (`core.plane_body`). phi belongs to the
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
`plants.seven_dof`. How it is solved over a step with held forces: roll exactly (`core.oscillator`), so
any roll stiffness goes with any step, plane motion by `core.plane_body`, wheels by `core.wheel_spin`.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import atan2, cos, sin

from ..core import carry
from ..core.component import Component
from ..core.oscillator import transition
from ..core.plane_body import Four, move, resultants
from ..core.variables import output, parameter
from ..core.wheel_kinematics import slip_angle, slip_ratio, wheel_velocities
from ..core.wheel_spin import spin

G = 9.81  # m/s2


@dataclass(frozen=True)
class EightDofParameters:
    """The car of paper B, table 1."""

    mass: float = parameter(1350.0, "kg", "Vehicle mass m; paper B, table 1", minimum=1.0)
    sprung_mass: float = parameter(1110.0, "kg", "Sprung mass m_s; paper B, table 1", minimum=0.0)
    yaw_inertia: float = parameter(1343.1, "kg.m2", "Yaw inertia I_z; paper B, table 1", minimum=1.0)
    roll_inertia: float = parameter(
        440.6, "kg.m2", "Roll inertia I_x about the roll axis; paper B, table 1", minimum=1.0
    )
    cg_to_front_axle: float = parameter(
        1.04, "m", "Distance a of the centre of mass from the front axle; paper B, table 1", minimum=0.1
    )
    cg_to_rear_axle: float = parameter(
        1.56, "m", "Distance b of the centre of mass from the rear axle; paper B, table 1", minimum=0.1
    )
    track_width: float = parameter(1.48, "m", "Track width d; paper B, table 1", minimum=0.1)
    cg_height: float = parameter(0.54, "m", "Height h of the centre of mass; paper B, table 1", minimum=0.0)
    roll_arm: float = parameter(
        0.4, "m", "Height h_s of the sprung mass above the roll axis; paper B, table 1", minimum=0.0
    )
    roll_stiffness: float = parameter(
        56000.0, "N.m/rad", "Roll stiffness K; paper B, table 1, erratum: printed as 5600", minimum=0.0
    )
    roll_damping: float = parameter(2600.0, "N.m.s/rad", "Roll damping C; paper B, table 1", minimum=0.0)
    front_roll_share: float = parameter(
        0.55,
        "1",
        "Front part of roll stiffness and damping; chosen: mild understeer",
        minimum=0.0,
        maximum=1.0,
    )
    roll_centre_height_front: float = parameter(0.14, "m", "Front roll centre h_f; chosen: h - h_s")
    roll_centre_height_rear: float = parameter(0.14, "m", "Rear roll centre h_r; chosen: h - h_s")
    wheel_radius: float = parameter(0.313, "m", "Wheel radius R; chosen: that of tyre set 1", minimum=0.05)
    wheel_inertia: float = parameter(2.1, "kg.m2", "Inertia J of one wheel; paper B, table 1", minimum=0.01)
    rotating_mass_excess: float = parameter(
        0.0, "1", "Part xi of m that is added to resist dv_x; chosen: none, see the erratum", minimum=0.0
    )
    drag_coefficient: float = parameter(0.3, "1", "Drag coefficient C_D; paper B, table 1", minimum=0.0)
    frontal_area: float = parameter(1.8, "m2", "Frontal area A; paper B, table 1", minimum=0.0)
    air_density: float = parameter(
        1.2258, "kg/m3", "Air density rho; what the paper's 1 / 21.15 stands for", minimum=0.0
    )
    rolling_resistance: float = parameter(0.008, "1", "Rolling resistance f; paper B, table 1", minimum=0.0)
    rolling_fade_speed: float = parameter(
        0.1, "m/s", "Rolling resistance fades below this speed; chosen: hardly moving", minimum=0.001
    )
    initial_speed: float = parameter(27.7777778, "m/s", "Speed at the start; paper B: 100 km/h")
    initial_sideslip: float = parameter(0.0, "rad", "Sideslip angle at the start; chosen: none")
    initial_yaw_rate: float = parameter(0.0, "rad/s", "Yaw rate at the start; chosen: none")
    low_speed: float = parameter(
        0.5,
        "m/s",
        "Slips refer to this speed when the wheel is slower; chosen: keeps a parked car quiet at 1 ms",
        minimum=0.001,
    )
    slip_stiffness_per_load: float = parameter(
        22.0,
        "1",
        "Slip stiffness over load for slow wheels, see core.wheel_spin; chosen: tyre set 1",
        minimum=0.0,
    )


@dataclass(frozen=True)
class RollModel:
    """What the roll motion needs, derived from the parameters once."""

    coupling: float  # m_s h_s [kg.m]
    decay: float  # of the oscillator, s [1/s]
    stiffness: float  # of the oscillator, q [1/s2]
    inertia: float  # I_x less what the free lateral motion takes off [kg.m2]

    @classmethod
    def of(cls, p: EightDofParameters) -> RollModel:
        """Return the model of `p`.

        Raises:
            ValueError: springs that cannot hold the body up, or an inertia that cannot be.
        """
        coupling = p.sprung_mass * p.roll_arm
        if p.roll_stiffness <= coupling * G:
            raise ValueError(
                f"roll_stiffness must exceed sprung_mass g roll_arm = {coupling * G:g} N.m/rad, "
                f"or the body falls over (got {p.roll_stiffness:g})"
            )
        inertia = p.roll_inertia - coupling * coupling / p.mass
        if inertia <= 0.0:
            raise ValueError(
                f"roll_inertia must exceed (sprung_mass roll_arm)^2 / mass = {coupling * coupling / p.mass:g}"
                f" kg.m2: it counts from the roll axis (got {p.roll_inertia:g})"
            )
        return cls(
            coupling, 0.5 * p.roll_damping / inertia, (p.roll_stiffness - coupling * G) / inertia, inertia
        )

    def forcing(self, y: float, phi: float, p: EightDofParameters) -> float:
        """Return the roll acceleration [rad/s2] that the lateral force `y` [N] drives, springs apart."""
        return self.coupling * (y / p.mass + G * (sin(phi) - phi)) / self.inertia


def accelerations(
    forces: Four,
    *,
    v_x: float,
    v_y: float,
    r: float,
    phi: float,
    dphi: float,
    p: EightDofParameters,
    roll: RollModel,
) -> Four:
    """Return (a_x, a_y [m/s2], dr, ddphi [rad/s2]); equations (1)-(4).

    Args:
        forces: resultants X, Y_f, Y_r [N], M [N.m].
        v_x, v_y, r, phi, dphi: motion [m/s], [rad/s], [rad], [rad/s].
    """
    x, y_f, y_r, moment = forces
    y = y_f + y_r
    dr = moment / p.yaw_inertia
    ddphi = roll.forcing(y, phi, p) - roll.stiffness * phi - 2.0 * roll.decay * dphi
    return (
        longitudinal(x, v_x=v_x, v_y=v_y, r=r, phi=phi, dphi=dphi, dr=dr, p=p, roll=roll),
        (y + roll.coupling * ddphi) / p.mass,
        dr,
        ddphi,
    )


def longitudinal(
    x: float,
    *,
    v_x: float,
    v_y: float,
    r: float,
    phi: float,
    dphi: float,
    dr: float,
    p: EightDofParameters,
    roll: RollModel,
) -> float:
    """Return a_x [m/s2], equation (2), from the resultant `x` [N] and the motion."""
    rolling = min(max(v_x / p.rolling_fade_speed, -1.0), 1.0)
    force = (
        x
        - 0.5 * p.air_density * p.drag_coefficient * p.frontal_area * v_x * abs(v_x)
        - p.rolling_resistance * p.mass * G * rolling
        - roll.coupling * (2.0 * r * dphi + phi * dr)
    )
    xi = p.rotating_mass_excess
    return (force / p.mass - xi * v_y * r) / (1.0 + xi)


def vertical_loads(forces: Four, *, phi: float, dphi: float, p: EightDofParameters) -> Four:
    """Return F_z [N] of fl, fr, rl, rr from the resultants and the roll motion; equation (13)."""
    x, y_f, y_r, _ = forces
    weight = p.mass * G
    wheelbase = p.cg_to_front_axle + p.cg_to_rear_axle
    front = min(max((weight * p.cg_to_rear_axle - p.cg_height * x) / wheelbase, 0.0), weight)
    rear = 0.5 * (weight - front)
    front *= 0.5
    spring = p.roll_stiffness * phi + p.roll_damping * dphi
    share = p.front_roll_share
    across = (share * spring + p.roll_centre_height_front * y_f) / p.track_width
    front_across = min(max(across, -front), front)
    across = ((1.0 - share) * spring + p.roll_centre_height_rear * y_r) / p.track_width
    rear_across = min(max(across, -rear), rear)
    return front - front_across, front + front_across, rear - rear_across, rear + rear_across


class EightDof(Component):
    """Car with eight degrees of freedom (plane motion, roll, four wheel spins), loads through roll."""

    Parameters = EightDofParameters
    inputs = ("steer_angle", "tyre_force_x_*", "tyre_force_y_*", "wheel_torque_*")
    outputs = (
        "velocity_x",
        "velocity_y",
        "yaw_rate",
        "sideslip",
        "sideslip_rate",
        "acceleration_x",
        "acceleration_y",
        "roll_angle",
        "roll_rate",
        "position_x",
        "position_y",
        "yaw_angle",
        output("slip_angle_fl", "steer_angle"),
        output("slip_angle_fr", "steer_angle"),
        "slip_angle_rl",
        "slip_angle_rr",
        output("slip_ratio_fl", "steer_angle"),
        output("slip_ratio_fr", "steer_angle"),
        "slip_ratio_rl",
        "slip_ratio_rr",
        "vertical_load_*",
        "wheel_speed_*",
        output("wheel_velocity_fl", "steer_angle"),
        output("wheel_velocity_fr", "steer_angle"),
        "wheel_velocity_rl",
        "wheel_velocity_rr",
    )

    def configure(self):
        self.roll = RollModel.of(self.p)
        self.step_size = 0.0

    def start(self, t, u):
        p = self.p
        v_x = p.initial_speed * cos(p.initial_sideslip)
        v_y = p.initial_speed * sin(p.initial_sideslip)
        self.motion = (v_x, v_y, p.initial_yaw_rate, 0.0, 0.0, 0.0)
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
        after = self.wheels = self._wheels()
        radius, inertia, low = p.wheel_radius, p.wheel_inertia, p.low_speed
        per_load = p.slip_stiffness_per_load
        self.spins = tuple(
            [
                spin(
                    self.spins[i],
                    h,
                    torque=u[9 + i],
                    f_x=u[1 + i],
                    v=before[i],
                    v_end=after[i],
                    radius=radius,
                    inertia=inertia,
                    stiffness=per_load * self.loads[i],
                    v_low=low,
                )
                for i in (0, 1, 2, 3)
            ]
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
        low = p.low_speed
        radius = p.wheel_radius
        v_x, v_y, r, x, y, psi = self.motion
        a_x, a_y = self.end
        w_fl, w_fr, w_rl, w_rr = self.spins
        v_fl, v_fr, v_rl, v_rr, side_fl, side_fr, side_rl, side_rr = self.wheels
        turning = (v_x * a_y - v_y * a_x) / max(v_x * v_x + v_y * v_y, low * low)
        return (
            v_x,
            v_y,
            r,
            atan2(v_y, v_x),
            turning - r,
            a_x,
            a_y,
            self.angle,
            self.rate,
            x,
            y,
            psi,
            slip_angle(v_fl, side_fl, low),
            slip_angle(v_fr, side_fr, low),
            slip_angle(v_rl, side_rl, low),
            slip_angle(v_rr, side_rr, low),
            slip_ratio(w_fl * radius, v_fl, low),
            slip_ratio(w_fr * radius, v_fr, low),
            slip_ratio(w_rl * radius, v_rl, low),
            slip_ratio(w_rr * radius, v_rr, low),
            *self.loads,
            w_fl,
            w_fr,
            w_rl,
            w_rr,
            v_fl,
            v_fr,
            v_rl,
            v_rr,
        )

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
