"""Coefficients of the Magic Formula, 2002 form, as parameters of tyre and wheel control.

Names are those of the tyre property file (PCX1 is p_Cx1 of the book), so a set can be pasted in.
Defaults: H. B. Pacejka, Tyre and Vehicle Dynamics, 2nd ed. 2006, table A3.1, 205/60R15 91V at 2.2 bar.
Coefficients that the table does not list are zero.

Omitted because they have no effect: coefficients of camber (PDX3, PDY3, PEY4, PKY3, PHY3, PVY3, PVY4, RVY3,
QBZ4, QBZ5, QDZ3, QDZ4, QDZ8, QDZ9, QEZ5, QHZ3, QHZ4, SSZ3, SSZ4: this form has no camber input), the
reference speed V_0 (only used for the decay of friction with speed, zero in this set) and rolling resistance
(QSY1: the plants have it). Scaling factors of a whole group of coefficients are also omitted: scale the
coefficients.
"""

from dataclasses import dataclass
from math import atan, pi
from typing import Any, NamedTuple

from ..fmi.variables import like, parameter, parameter_class
from .pacejka_2012_set import COMMON, LONGITUDINAL, REST, Pacejka2012Parameters

_BOOK = "Pacejka 2006, table A3.1"

NAMES = """
    PCX1 PDX1 PDX2 PEX1 PEX2 PEX3 PEX4 PKX1 PKX2 PKX3 PHX1 PHX2 PVX1 PVX2 RBX1 RBX2 RCX1 REX1 REX2 RHX1
    PCY1 PDY1 PDY2 PEY1 PEY2 PEY3 PKY1 PKY2 PKY4 PHY1 PHY2 PVY1 PVY2 RBY1 RBY2 RBY3 RCY1 REY1 REY2 RHY1
    RHY2 RVY1 RVY2 RVY4 RVY5 RVY6
    QBZ1 QBZ2 QBZ3 QBZ9 QBZ10 QCZ1 QDZ1 QDZ2 QDZ6 QDZ7 QEZ1 QEZ2 QEZ3 QEZ4 QHZ1 QHZ2 SSZ1 SSZ2
"""
"""Coefficients of F_x, F_y and M_z in use."""

ODD = """
    PHX1 PHX2 PVX1 PVX2 RHX1
    PEY3 PHY1 PHY2 PVY1 PVY2 RBY3 RVY1 RVY2 RVY4 RVY5 RVY6
    QBZ9 QBZ10 QDZ6 QDZ7 QEZ4 QHZ1 QHZ2 SSZ1
"""
"""Coefficients used only with `asymmetric_terms`."""


def _one(description: str) -> Any:
    return parameter(1.0, "1", description, "chosen: the set as measured", minimum=0.01)


@dataclass(frozen=True)
class _General:
    """Parameters that are not coefficients of the tyre."""

    nominal_load: float = parameter(4000.0, "N", "Nominal load F_z0", _BOOK, minimum=1.0)
    unloaded_radius: float = parameter(0.313, "m", "Unloaded radius R_0", _BOOK, minimum=0.01)
    maximum_load: float = parameter(
        12000.0,
        "N",
        "Load above which forces are proportional to load, with constant coefficients",
        "chosen: three times nominal",
        minimum=1.0,
    )
    reference_friction: float = like(Pacejka2012Parameters, "reference_friction")
    low_friction: str = parameter(
        "similarity",
        None,
        "Combined slip at low friction: similarity also scales the slips in the weights, scale keeps the "
        "weights of the dry tyre",
        "chosen: force over friction stays that of the dry road; with scale, the book's, it is exceeded",
        choices=("similarity", "scale"),
    )
    asymmetric_terms: bool = parameter(
        False, None, "Use terms that break mirror symmetry or give force at zero slip", "chosen: off"
    )
    friction_scale_x: float = _one("Scaling lambda_mux of longitudinal friction")
    friction_scale_y: float = _one("Scaling lambda_muy of lateral friction")
    slip_stiffness_scale_front: float = _one("Scaling lambda_Kx of front longitudinal slip stiffness")
    slip_stiffness_scale_rear: float = _one("Scaling lambda_Kx of rear longitudinal slip stiffness")
    cornering_stiffness_scale_front: float = _one("Scaling lambda_Ky of front cornering stiffness")
    cornering_stiffness_scale_rear: float = _one("Scaling lambda_Ky of rear cornering stiffness")


def _declared() -> dict[str, Any]:
    """Declare the coefficients, from the table of the 2012 form, whose set is the same."""
    rows = {name.upper(): row for name, row in (COMMON | LONGITUDINAL | REST).items()}
    rows["PKY2"] = rows["PKY2"]._replace(minimum=0.01)
    rows["RBY3"] = rows["RBY3"]._replace(text="Shift of the slip angle in RBY2")
    rows["QDZ7"] = rows["QDZ7"]._replace(text="Variation of the largest residual moment with load")
    odd = ", used with asymmetric_terms"
    return {
        name: rows[name]._replace(source=_BOOK).declared(rows[name].text + odd * (name in ODD.split()))
        for name in NAMES.split()
    }


MagicFormulaParameters = parameter_class(__name__, "MagicFormulaParameters", _declared(), bases=(_General,))
"""Coefficients, equal for all four tyres, with stiffness scalings per axle."""


class Coefficients(NamedTuple):
    """Preprocessed coefficients of an axle, with scalings and switches applied, see `coefficients`."""

    friction: tuple[float, float]
    longitudinal: tuple[float, ...]
    lateral: tuple[float, ...]
    aligning: tuple[float, ...]
    asymmetric: tuple[float, ...]  # empty when switched off


def coefficients(p: Any, name: str) -> Coefficients:
    """Return the preprocessed coefficients of `p` for the axle "front" or "rear".

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
