"""The coefficients of the Magic Formula, 2002 form, as parameters that tyre and wheel control share.

Names are those of the tyre property file (PCX1 is p_Cx1 of the book), so a set can be pasted in.
Defaults: H. B. Pacejka, Tyre and Vehicle Dynamics, 2nd ed. 2006, table A3.1, 205/60R15 91V at 2.2 bar.
Coefficients that the table does not list are zero.

Not here, because they would do nothing: coefficients of camber (PDX3, PDY3, PEY4, PKY3, PHY3, PVY3,
PVY4, RVY3, QBZ4, QBZ5, QDZ3, QDZ4, QDZ8, QDZ9, QEZ5, QHZ3, QHZ4, SSZ3, SSZ4: it takes no camber), the
reference speed V_0 (it only enters the speed decay of friction, zero in this set) and rolling
resistance (QSY1: the plants have it). Scaling factors that multiply a whole group of coefficients
are left out too: scale the coefficients.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import atan, pi
from typing import Any, NamedTuple

from ..fmi.variables import parameter

_BOOK = "Pacejka 2006, table A3.1"


def _c(default: float, description: str) -> Any:
    return parameter(default, "1", description, _BOOK)


def _odd(default: float, description: str) -> Any:
    return parameter(default, "1", f"{description}, used with asymmetric_terms", _BOOK)


def _one(description: str) -> Any:
    return parameter(1.0, "1", description, "chosen: the set as measured", minimum=0.01)


@dataclass(frozen=True)
class MagicFormulaParameters:
    """One set for all four tyres, with stiffness scalings per axle."""

    nominal_load: float = parameter(4000.0, "N", "Nominal load F_z0", _BOOK, minimum=1.0)
    unloaded_radius: float = parameter(0.313, "m", "Unloaded radius R_0", _BOOK, minimum=0.01)
    maximum_load: float = parameter(
        12000.0,
        "N",
        "Load above which forces are proportional to it, all coefficients held",
        "chosen: three times nominal",
        minimum=1.0,
    )
    reference_friction: float = parameter(
        1.0,
        "1",
        "Friction coefficient of the road the set was measured on: lambda_mu is friction over it",
        "chosen: the papers' mu = 1 is the set as it is",
        minimum=0.01,
    )
    low_friction: str = parameter(
        "similarity",
        None,
        "Combined slip where lambda_mu is not 1: similarity scales the slips in the weights too, scale keeps "
        "the weights of the dry tyre",
        "chosen: no wheel gives more than on a dry road, over friction; scale, the book's, does",
        choices=("similarity", "scale"),
    )
    asymmetric_terms: bool = parameter(
        False, None, "Use the terms that break mirror symmetry or give force at zero slip", "chosen: off"
    )
    friction_scale_x: float = _one("Scaling lambda_mux of longitudinal friction")
    friction_scale_y: float = _one("Scaling lambda_muy of lateral friction")
    slip_stiffness_scale_front: float = _one("Scaling lambda_Kx of front longitudinal slip stiffness")
    slip_stiffness_scale_rear: float = _one("Scaling lambda_Kx of rear longitudinal slip stiffness")
    cornering_stiffness_scale_front: float = _one("Scaling lambda_Ky of front cornering stiffness")
    cornering_stiffness_scale_rear: float = _one("Scaling lambda_Ky of rear cornering stiffness")

    PCX1: float = parameter(1.685, "1", "Shape factor C of F_x", _BOOK, minimum=0.01)
    PDX1: float = _c(1.210, "Friction mu_x at nominal load")
    PDX2: float = _c(-0.037, "Variation of mu_x with load")
    PEX1: float = _c(0.344, "Curvature E of F_x at nominal load")
    PEX2: float = _c(0.095, "Variation of E of F_x with load")
    PEX3: float = _c(-0.020, "Variation of E of F_x with load squared")
    PEX4: float = _c(0.0, "Difference of E of F_x between driving and braking")
    PKX1: float = _c(21.51, "Slip stiffness K_x / F_z at nominal load")
    PKX2: float = _c(-0.163, "Variation of K_x / F_z with load")
    PKX3: float = _c(0.245, "Exponent of K_x / F_z with load")
    PHX1: float = _odd(-0.002, "Horizontal shift of F_x at nominal load")
    PHX2: float = _odd(0.002, "Variation of the horizontal shift of F_x with load")
    PVX1: float = _odd(0.0, "Vertical shift of F_x / F_z at nominal load")
    PVX2: float = _odd(0.0, "Variation of the vertical shift of F_x / F_z with load")
    RBX1: float = _c(12.35, "Slope of the reduction of F_x by slip angle")
    RBX2: float = _c(-10.77, "Variation of that slope with kappa")
    RCX1: float = _c(1.092, "Shape factor of the reduction of F_x by slip angle")
    REX1: float = _c(0.0, "Curvature of the reduction of F_x by slip angle")
    REX2: float = _c(0.0, "Variation of that curvature with load")
    RHX1: float = _odd(0.007, "Shift of the reduction of F_x by slip angle")

    PCY1: float = parameter(1.193, "1", "Shape factor C of F_y", _BOOK, minimum=0.01)
    PDY1: float = _c(-0.990, "Friction mu_y at nominal load")
    PDY2: float = _c(0.145, "Variation of mu_y with load")
    PEY1: float = _c(-1.003, "Curvature E of F_y at nominal load")
    PEY2: float = _c(-0.537, "Variation of E of F_y with load")
    PEY3: float = _odd(-0.083, "Difference of E of F_y between left and right")
    PKY1: float = _c(-14.95, "Largest cornering stiffness K_y / F_z0")
    PKY2: float = parameter(2.130, "1", "Load over nominal load at which K_y is largest", _BOOK, minimum=0.01)
    PKY4: float = _c(2.0, "Shape of K_y over load")
    PHY1: float = _odd(0.003, "Horizontal shift of F_y at nominal load")
    PHY2: float = _odd(-0.001, "Variation of the horizontal shift of F_y with load")
    PVY1: float = _odd(0.045, "Vertical shift of F_y / F_z at nominal load")
    PVY2: float = _odd(-0.024, "Variation of the vertical shift of F_y / F_z with load")
    RBY1: float = _c(6.461, "Slope of the reduction of F_y by kappa")
    RBY2: float = _c(4.196, "Variation of that slope with slip angle")
    RBY3: float = _odd(-0.015, "Shift of the slip angle in RBY2")
    RCY1: float = _c(1.081, "Shape factor of the reduction of F_y by kappa")
    REY1: float = _c(0.0, "Curvature of the reduction of F_y by kappa")
    REY2: float = _c(0.0, "Variation of that curvature with load")
    RHY1: float = _c(0.009, "Shift of the reduction of F_y by kappa")
    RHY2: float = _c(0.0, "Variation of that shift with load")
    RVY1: float = _odd(0.053, "Side force induced by kappa, over mu_y F_z, at nominal load")
    RVY2: float = _odd(-0.073, "Variation of the side force induced by kappa with load")
    RVY4: float = _odd(35.44, "Decay of the side force induced by kappa with slip angle")
    RVY5: float = _odd(1.9, "Shape of the side force induced by kappa")
    RVY6: float = _odd(-10.71, "Slope of the side force induced by kappa")

    QBZ1: float = _c(8.964, "Slope of the trail at nominal load")
    QBZ2: float = _c(-1.106, "Variation of the slope of the trail with load")
    QBZ3: float = _c(-0.842, "Variation of the slope of the trail with load squared")
    QBZ9: float = _odd(18.47, "Slope of the residual moment")
    QBZ10: float = _odd(0.0, "Slope of the residual moment with B C of F_y")
    QCZ1: float = _c(1.180, "Shape factor of the trail")
    QDZ1: float = _c(0.100, "Largest trail over R_0 at nominal load")
    QDZ2: float = _c(-0.001, "Variation of the largest trail with load")
    QDZ6: float = _odd(-0.008, "Largest residual moment over F_z R_0")
    QDZ7: float = _odd(0.0, "Variation of the largest residual moment with load")
    QEZ1: float = _c(-1.609, "Curvature of the trail at nominal load")
    QEZ2: float = _c(-0.359, "Variation of the curvature of the trail with load")
    QEZ3: float = _c(0.0, "Variation of the curvature of the trail with load squared")
    QEZ4: float = _odd(0.174, "Difference of the curvature of the trail between left and right")
    QHZ1: float = _odd(0.007, "Horizontal shift of the trail at nominal load")
    QHZ2: float = _odd(-0.002, "Variation of the horizontal shift of the trail with load")
    SSZ1: float = _odd(0.043, "Lever arm of F_x over R_0")
    SSZ2: float = _c(0.001, "Variation of the lever arm of F_x with F_y / F_z0")


class Coefficients(NamedTuple):
    """A parameter set made ready for one axle, scalings and switches applied; see `coefficients`."""

    friction: tuple[float, float]
    longitudinal: tuple[float, ...]
    lateral: tuple[float, ...]
    aligning: tuple[float, ...]
    asymmetric: tuple[float, ...]  # empty when switched off


def coefficients(p: MagicFormulaParameters, name: str) -> Coefficients:
    """Return the set `p` made ready for the axle called "front" or "rear".

    Raises:
        ValueError: a peak or a stiffness vanishes or changes its sign below maximum_load.
    """
    top = p.maximum_load / p.nominal_load
    for what, at_zero, at_top in (
        ("mu_x (PDX1, PDX2)", p.PDX1 - p.PDX2, p.PDX1 + p.PDX2 * (top - 1.0)),
        ("mu_y (PDY1, PDY2)", p.PDY1 - p.PDY2, p.PDY1 + p.PDY2 * (top - 1.0)),
        ("K_x (PKX1, PKX2)", p.PKX1 - p.PKX2, p.PKX1 + p.PKX2 * (top - 1.0)),
        ("K_y (PKY1, PKY2, PKY4)", p.PKY1 * p.PKY4, p.PKY1 * (pi - p.PKY4 * atan(top / p.PKY2))),
    ):
        if at_zero * at_top <= 0.0:
            raise ValueError(
                f"the Magic Formula's {what} must keep its sign from no load to maximum_load = "
                f"{p.maximum_load:g} N: correct the set or lower maximum_load"
            )
    mu_x = p.friction_scale_x
    mu_y = p.friction_scale_y
    k_x = getattr(p, f"slip_stiffness_scale_{name}")
    k_y = getattr(p, f"cornering_stiffness_scale_{name}")
    load_scale = 1.0 / p.nominal_load
    radius = p.unloaded_radius
    odd = p.asymmetric_terms
    return Coefficients(
        friction=(1.0 / p.reference_friction, 1.0 if p.low_friction == "similarity" else 0.0),
        longitudinal=(
            *(p.maximum_load, load_scale, p.PCX1, mu_x * p.PDX1, mu_x * p.PDX2),
            *(p.PEX1, p.PEX2, p.PEX3, p.PEX4, k_x * p.PKX1, k_x * p.PKX2, p.PKX3),
            *(p.RBX1, p.RBX2, p.RCX1, p.REX1, p.REX2, p.RHX1 if odd else 0.0),
            *((p.PHX1, p.PHX2, p.PVX1, p.PVX2, mu_x) if odd else (0.0, 0.0, 0.0, 0.0, mu_x)),
        ),
        lateral=(
            *(p.maximum_load, load_scale, p.PCY1, mu_y * p.PDY1, mu_y * p.PDY2, p.PEY1, p.PEY2),
            *(k_y * p.PKY1 * p.nominal_load, load_scale / p.PKY2, p.PKY4),
            *(p.RBY1, p.RBY2, p.RCY1, p.REY1, p.REY2, p.RHY1, p.RHY2),
        ),
        aligning=(
            *(p.QBZ1 * k_y / mu_y, p.QBZ2 * k_y / mu_y, p.QBZ3 * k_y / mu_y, p.QCZ1),
            *(p.QDZ1 * radius * load_scale, p.QDZ2 * radius * load_scale),
            *(p.QEZ1, p.QEZ2, p.QEZ3, p.SSZ2 * radius * load_scale),
        ),
        asymmetric=(
            *(mu_y, p.PEY3, p.PHY1, p.PHY2, p.PVY1, p.PVY2, p.RBY3),
            *(p.RVY1, p.RVY2, p.RVY4, p.RVY5, p.RVY6),
            *(p.QHZ1, p.QHZ2, p.QEZ4, p.QBZ9 * k_y / mu_y, p.QBZ10),
            *(p.QDZ6 * radius * mu_y, p.QDZ7 * radius * mu_y, p.SSZ1 * radius),
        )
        if odd
        else (),
    )
