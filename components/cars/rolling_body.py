"""A car's body that rolls on its springs: what `plants.eight_dof` is made of, equation by equation.

Numbers and symbols are those of the plant's docstring.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import sin

from ..fmi.variables import parameter
from .plane_body import Four
from .resistance import resistance

G = 9.81  # m/s2


@dataclass(frozen=True)
class RollingCarParameters:
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
        "Slip stiffness over load for slow wheels, see cars.wheel_spin; chosen: tyre set 1",
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
    def of(cls, p: RollingCarParameters) -> RollModel:
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

    def forcing(self, y: float, phi: float, p: RollingCarParameters) -> float:
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
    p: RollingCarParameters,
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
    p: RollingCarParameters,
    roll: RollModel,
) -> float:
    """Return a_x [m/s2], equation (2), from the resultant `x` [N] and the motion."""
    resisting = resistance(
        v_x,
        drag=0.5 * p.air_density * p.drag_coefficient * p.frontal_area,
        rolling=p.rolling_resistance * p.mass * G,
        fade=p.rolling_fade_speed,
    )
    force = x - resisting - roll.coupling * (2.0 * r * dphi + phi * dr)
    xi = p.rotating_mass_excess
    return (force / p.mass - xi * v_y * r) / (1.0 + xi)


def vertical_loads(forces: Four, *, phi: float, dphi: float, p: RollingCarParameters) -> Four:
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
