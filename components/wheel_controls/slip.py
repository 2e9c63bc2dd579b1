"""Wheel torque by sliding-mode slip control, with the curve of the tyre it is told of.

The law is described in `control_laws.slip_control`. It needs the tyre's F_x(kappa) at the present slip
angle, load and friction; this unit evaluates the very functions that the tyre units evaluate, so no table is
typed in. Give it the same parameters as the tyre, as a scenario's vehicle file does by itself.

Source: Vehicle yaw stability control based on fuzzy sliding mode direct yaw moment, equations (31)-(38).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from ..control_laws.slip_control import Curve, SlipControlParameters, wheel_torque
from ..fmi.component import Component
from ..fmi.variables import output, parameter
from ..tyre_models.bakker_1987 import MagicFormula1987Parameters, coefficients_1987, forces_1987, loaded_tyre
from ..tyre_models.pacejka_2002 import lateral_slip, longitudinal_curve, longitudinal_force
from ..tyre_models.pacejka_2002_set import MagicFormulaParameters, coefficients
from ..tyres.dugoff import DugoffParameters, dugoff
from ..tyres.linear import LinearTyreParameters, limit_to_friction, linear_tyre


@dataclass(frozen=True)
class SlipParameters(
    SlipControlParameters,
    MagicFormulaParameters,
    MagicFormula1987Parameters,
    DugoffParameters,
    LinearTyreParameters,
):
    """The slip control's own, and the sets of all tyres; only that of the chosen tyre is used."""

    tyre: str = parameter(
        "magic_formula",
        None,
        "Tyre model whose curve is inverted; chosen: the tyre of paper B",
        choices=("magic_formula", "magic_formula_1987", "dugoff", "linear"),
    )


def magic_formula_curve(alpha: float, f_z: float, mu: float, c: Any) -> Curve:
    """Return the curve of the Magic Formula, 2002 form; `c` is the axle's set."""
    curve = longitudinal_curve(*lateral_slip(alpha), f_z, mu, c)
    if curve is None:
        return no_force, 1.0
    return lambda kappa: longitudinal_force(kappa, curve), curve.d / curve.stiffness


def magic_formula_1987_curve(alpha: float, f_z: float, mu: float, c: Any) -> Curve:
    """Return the curve of the Magic Formula, 1987 form."""
    tyre = loaded_tyre(f_z, mu, c)
    if tyre is None:
        return no_force, 1.0
    return lambda kappa: forces_1987(kappa, alpha, tyre)[0], tyre.d_x / tyre.k_x


def dugoff_curve(alpha: float, f_z: float, mu: float, c: Any) -> Curve:
    """Return the curve of Dugoff's tyre; `c` is its two stiffnesses."""
    c_x, c_y = c
    return lambda kappa: dugoff(alpha, kappa, f_z=f_z, mu=mu, c_x=c_x, c_y=c_y)[0], mu * f_z / c_x


def linear_curve(alpha: float, f_z: float, mu: float, c: Any) -> Curve:
    """Return the curve of the linear tyre; `c` is its two stiffnesses and whether friction limits it."""
    c_x, c_y, limited = c
    if limited:
        return (
            lambda kappa: limit_to_friction(
                *linear_tyre(alpha, kappa, f_z=f_z, c_x=c_x, c_y=c_y), grip=mu * f_z
            )[0],
            1.0,
        )
    return lambda kappa: linear_tyre(alpha, kappa, f_z=f_z, c_x=c_x, c_y=c_y)[0], 1.0


def no_force(kappa: float) -> float:
    """Return the force [N] of a tyre without load or friction."""
    return 0.0


CURVES: dict[str, Callable[[float, float, float, Any], Curve]] = {
    "magic_formula": magic_formula_curve,
    "magic_formula_1987": magic_formula_1987_curve,
    "dugoff": dugoff_curve,
    "linear": linear_curve,
}


def tyre_sets(p: SlipParameters) -> tuple[Any, Any]:
    """Return what the chosen tyre's curve needs of the parameters, front and rear."""
    if p.tyre == "magic_formula":
        return coefficients(p, "front"), coefficients(p, "rear")
    both: Any
    if p.tyre == "magic_formula_1987":
        both = coefficients_1987(p)
    elif p.tyre == "dugoff":
        both = (p.longitudinal_stiffness, p.cornering_stiffness)
    else:
        both = (p.longitudinal_stiffness, p.cornering_stiffness, p.limited)
    return both, both


class Slip(Component):
    """Slip control: wheel torque that holds the slip which gives the requested force."""

    Parameters = SlipParameters
    inputs = (
        "force_request_*",
        "slip_ratio_*",
        "slip_angle_*",
        "vertical_load_*",
        "wheel_speed_*",
        "wheel_velocity_*",
        "friction_*",
    )
    outputs = (
        output("torque_request_*", *inputs),
        output(
            "slip_ratio_target_*",
            *("force_request_*", "slip_angle_*", "vertical_load_*", "friction_*"),
            unit="1",
            text="Slip that gives the requested force, within the limits",
        ),
    )
    sampled = True

    def configure(self):
        self.sets = tyre_sets(self.p)

    def start(self, t, u):
        self.velocities = u[20:24]
        self.accelerations = [0.0, 0.0, 0.0, 0.0]
        self.sample_time = 0.001  # until the first step tells

    def advance(self, t, h, u):
        if h <= 0.0:
            return
        velocities = u[20:24]
        weight = 1.0 / (self.p.acceleration_filter + h)
        self.accelerations = [
            dv + weight * (now - before - h * dv)
            for dv, now, before in zip(self.accelerations, velocities, self.velocities, strict=True)
        ]
        self.velocities = velocities
        self.sample_time = h

    def output(self, t, u):
        p = self.p
        make = CURVES[p.tyre]
        torques = []
        targets = []
        for i in (0, 1, 2, 3):
            torque, target = wheel_torque(
                u[i],
                u[4 + i],
                make(u[8 + i], u[12 + i], u[24 + i], self.sets[i // 2]),
                w=u[16 + i],
                v=u[20 + i],
                dv=self.accelerations[i],
                sample_time=self.sample_time,
                p=p,
            )
            torques.append(torque)
            targets.append(target)
        return torques + targets
