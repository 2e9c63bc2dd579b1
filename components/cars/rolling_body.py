"""Equations of motion of a car body with roll, for `plants.eight_dof`.

Equation numbers and symbols are those of the plant's docstring.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import sin

from yawbench.vocabulary.gravity import G
from yawbench.vocabulary.wheels import Four

from ..fmi.variables import like, of_car, parameter
from .car import DrivenCarParameters, StartParameters
from .load_transfer import loads_of_axles
from .published_cars import PaperB
from .resistance import ResistanceParameters, drag_of
from .road_plane import LEVEL, Pull
from .roll_camber import RollCamberParameters
from .wheel_steer import RollSteerParameters


@dataclass(frozen=True)
class RollingCarParameters(
    StartParameters, RollCamberParameters, RollSteerParameters, ResistanceParameters, PaperB
):
    """The car of paper B, table 1."""

    sprung_mass: float = of_car(1110.0, "paper B, table 1", text="Sprung mass m_s")
    roll_inertia: float = of_car(440.6, "paper B, table 1", text="Roll inertia I_x about the roll axis")
    roll_arm: float = of_car(0.4, "paper B, table 1")
    roll_stiffness: float = of_car(56000.0, "erratum: paper B, table 1, prints 5600", text="Roll stiffness K")
    roll_damping: float = of_car(2600.0, "paper B, table 1", text="Roll damping C")
    front_roll_share: float = of_car(
        0.55, "chosen: mild understeer", text="Front share of roll stiffness and damping", maximum=1.0
    )
    roll_centre_height_front: float = of_car(0.14, "chosen: h - h_s", text="Front roll centre h_f")
    roll_centre_height_rear: float = of_car(0.14, "chosen: h - h_s", text="Rear roll centre h_r")
    rotating_mass_excess: float = parameter(
        0.0, "1", "Share xi of m added to resist dv_x", "chosen: none, see the erratum", minimum=0.0
    )
    initial_speed: float = parameter(27.7777778, "m/s", "Speed at the start", "paper B: 100 km/h")
    slip_stiffness_per_load: float = like(DrivenCarParameters, "slip_stiffness_per_load")


class RollingBody:
    """Body with roll degree of freedom; its constants are derived once from the parameters `p`.

    Raises:
        ValueError: springs too soft to support the body, or an impossible inertia.
    """

    def __init__(self, p: RollingCarParameters) -> None:
        self.p = p
        self.drag = drag_of(p)
        self.coupling = coupling = p.sprung_mass * p.roll_arm  # m_s h_s [kg.m]
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
        self.inertia = inertia  # I_x minus (m_s h_s)^2 / m, for free lateral motion [kg.m2]
        self.decay = 0.5 * p.roll_damping / inertia  # s of the roll oscillator [1/s]
        self.stiffness = (p.roll_stiffness - coupling * G) / inertia  # q of the roll oscillator [1/s2]

    def __deepcopy__(self, memo: object) -> RollingBody:
        return self  # immutable: the saved state of a component may share it

    def forcing(self, y: float, phi: float, pull: Pull = LEVEL) -> float:
        """Return the roll acceleration [rad/s2] due to the lateral force `y` [N], without springs."""
        sine = sin(phi)
        driven = y / self.p.mass + G * (sine - phi)
        if pull.lighter:
            driven -= pull.lighter * sine
        return self.coupling * driven / self.inertia

    def accelerations(
        self, forces: Four, *, pull: Pull, v_x: float, v_y: float, r: float, phi: float, dphi: float
    ) -> tuple[float, float]:
        """Return (a_x, a_y) [m/s2]; equations (1)-(4).

        Args:
            forces: tyre resultants X, Y_f, Y_r [N], M [N.m].
            pull: effect of road and wind.
            v_x, v_y, r, phi, dphi: motion [m/s], [rad/s], [rad], [rad/s].
        """
        x, y_f, y_r, moment = forces
        y = y_f + y_r
        dr = (moment + pull.turn) / self.p.yaw_inertia
        ddphi = self.forcing(y, phi, pull) - self.stiffness * phi - 2.0 * self.decay * dphi
        a_x = self.longitudinal(x, pull=pull, v_x=v_x, v_y=v_y, r=r, phi=phi, dphi=dphi, dr=dr)
        return a_x, (y + self.coupling * ddphi) / self.p.mass + pull.y

    def longitudinal(
        self, x: float, *, pull: Pull, v_x: float, v_y: float, r: float, phi: float, dphi: float, dr: float
    ) -> float:
        """Return a_x [m/s2], equation (2), from the resultant `x` [N] and the motion."""
        force = x - self.drag * v_x * abs(v_x) - self.coupling * (2.0 * r * dphi + phi * dr)
        xi = self.p.rotating_mass_excess
        return (force / self.p.mass + pull.x - xi * v_y * r) / (1.0 + xi)

    def vertical_loads(self, forces: Four, *, pull: Pull, phi: float, dphi: float) -> Four:
        """Return F_z [N] of fl, fr, rl, rr from the resultants and the roll motion; equation (13)."""
        p = self.p
        x, y_f, y_r, _ = forces
        weight = p.mass * (G - pull.lighter)
        wheelbase = p.cg_to_front_axle + p.cg_to_rear_axle
        spring = p.roll_stiffness * phi + p.roll_damping * dphi
        share = p.front_roll_share
        return loads_of_axles(
            (weight * p.cg_to_rear_axle - p.cg_height * x) / wheelbase,
            weight,
            (share * spring + p.roll_centre_height_front * y_f) / p.track_width,
            ((1.0 - share) * spring + p.roll_centre_height_rear * y_r) / p.track_width,
        )
