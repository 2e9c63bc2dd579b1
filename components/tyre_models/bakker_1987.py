"""Magic Formula, original form of 1987: forces of a tyre, with combined slip by similarity.

Pure slip, F_z in kN, alpha in degrees, kappa in percent, zero camber (SAE 870421):

    F = D sin(C atan(B x - E (B x - atan(B x))))
    F_y: C = a0   D = a1 F_z^2 + a2 F_z   BCD = a3 sin(a4 atan(a5 F_z))            E = a6 F_z^2 + a7 F_z + a8
    F_x: C = b0   D = b1 F_z^2 + b2 F_z   BCD = (b3 F_z^2 + b4 F_z) exp(-b5 F_z)   E = b6 F_z^2 + b7 F_z + b8

Combined slip: the normalised slip k measures the distance from the limit, the pure-slip curves give the
magnitude of the force at k, and its direction changes from that of the elastic tyre (small k) to that of
sliding (k >= 2 pi):

    k = sqrt(p_x^2 + p_y^2)      p_x = K_x kappa / D_x      p_y = K_y alpha / D_y      K = BCD at the origin
    F_x = D_x f_x(k) cos(l)      F_y = -D_y f_y(k) sin(l)   tan(l) = eta(k) tan(alpha) / kappa
    eta = (1 + eta_0) / 2 - (1 - eta_0) / 2 cos(k / 2)      eta_0 = (K_y / D_y) / (K_x / D_x)

with f(k) = F / D at B x = k / C. For pure slip this is identical to the formulae above. The force of a locked
wheel opposes the sliding if both directions have the same sliding friction (D_x f_x = D_y f_y).

Sources: E. Bakker, L. Nyborg, H. B. Pacejka, Tyre modelling for use in vehicle dynamics studies, SAE
870421, 1987 (pure slip); H. S. Radt, D. A. Glemming, Normalization of tire force and moment data,
Tire Science and Technology 21(2), 1993 (combined slip). Ours differs: kappa is the interface's slip,
converted by `practical_slip`; the sign of F_y is that of ISO 8855.
"""

from dataclasses import dataclass
from math import atan, copysign, cos, exp, pi, sin, sqrt
from typing import Any, NamedTuple

from ..fmi.variables import like, parameter
from .pacejka_2002 import SMALLEST_FRICTION, SMALLEST_LOAD, lateral_slip, practical_slip
from .pacejka_2002_set import MagicFormulaParameters

SMALLEST_SLIP = 1e-150
"""Slip below which the force is zero, since its square would underflow."""


def _c(default: float, description: str) -> Any:
    return parameter(default, "1", f"{description} (F_z in kN, F in N, degrees, percent)", "SAE 870421")


@dataclass(frozen=True)
class MagicFormula1987Parameters:
    """Coefficients, equal for all four tyres."""

    peak_friction: str = parameter(
        "road",
        None,
        "Peak D of a force: road: mu F_z; measured: that of the set times mu / reference_friction. "
        "The slip stiffness is that of the set in both",
        "chosen: paper D",
        choices=("road", "measured"),
    )
    reference_friction: float = parameter(
        1.0,
        "1",
        "Friction coefficient of the road the set was measured on, for a measured peak",
        "chosen: 1",
        minimum=0.01,
    )
    maximum_load: float = like(MagicFormulaParameters, "maximum_load", 12000.0, "chosen: beyond any test")
    a0: float = _c(1.30, "Shape factor C of F_y")
    a1: float = _c(-22.1, "Peak of F_y, F_z squared")
    a2: float = _c(1011.0, "Peak of F_y, F_z")
    a3: float = _c(1078.0, "Largest cornering stiffness")
    a4: float = _c(1.82, "Shape of the cornering stiffness over load")
    a5: float = _c(0.208, "Scale of load in the cornering stiffness")
    a6: float = _c(0.0, "Curvature E of F_y, F_z squared")
    a7: float = _c(-0.354, "Curvature E of F_y, F_z")
    a8: float = _c(0.707, "Curvature E of F_y")
    b0: float = _c(1.65, "Shape factor C of F_x")
    b1: float = _c(-21.3, "Peak of F_x, F_z squared")
    b2: float = _c(1144.0, "Peak of F_x, F_z")
    b3: float = _c(49.6, "Slip stiffness, F_z squared")
    b4: float = _c(226.0, "Slip stiffness, F_z")
    b5: float = _c(0.069, "Exponent of the slip stiffness over load")
    b6: float = _c(-0.006, "Curvature E of F_x, F_z squared")
    b7: float = _c(0.056, "Curvature E of F_x, F_z")
    b8: float = _c(0.486, "Curvature E of F_x")


class Coefficients1987(NamedTuple):
    """Preprocessed coefficients, see `coefficients_1987`."""

    general: tuple[float, float]  # maximum load, 1 / reference friction or 0 for a peak of mu F_z
    lateral: tuple[float, ...]
    longitudinal: tuple[float, ...]


class LoadedTyre(NamedTuple):
    """Pure-slip curves at a given load and friction; stiffnesses K in N per rad and per unit slip."""

    c_x: float
    d_x: float
    k_x: float
    e_x: float
    c_y: float
    d_y: float
    k_y: float
    e_y: float


def coefficients_1987(p: MagicFormula1987Parameters) -> Coefficients1987:
    """Return the preprocessed coefficients of `p`.

    Raises:
        ValueError: a peak or a stiffness is not positive for all loads up to maximum_load.
    """
    top = 0.001 * p.maximum_load
    for name, at_zero, at_top in (
        ("D of F_y (a1, a2)", p.a2, p.a1 * top + p.a2),
        ("D of F_x (b1, b2)", p.b2, p.b1 * top + p.b2),
        ("BCD of F_y (a3, a4, a5)", p.a3 * p.a4 * p.a5, pi - abs(p.a4 * atan(p.a5 * top))),
        ("BCD of F_x (b3, b4)", p.b4, p.b3 * top + p.b4),
        ("C (a0, b0)", p.a0, p.b0),
    ):
        if not (at_zero > 0.0 and at_top > 0.0):
            raise ValueError(
                f"the Magic Formula's {name} must be positive from no load to maximum_load = "
                f"{p.maximum_load:g} N: correct the set or lower maximum_load"
            )
    measured = 1.0 / p.reference_friction if p.peak_friction == "measured" else 0.0
    return Coefficients1987(
        (p.maximum_load, measured),
        (p.a0, p.a1, p.a2, p.a3, p.a4, p.a5, p.a6, p.a7, p.a8),
        (p.b0, p.b1, p.b2, p.b3, p.b4, p.b5, p.b6, p.b7, p.b8),
    )


def loaded_tyre(f_z: float, mu: float, c: Coefficients1987) -> LoadedTyre | None:
    """Return the pure-slip curves at vertical load `f_z` [N] and friction `mu` [1]; None for zero force."""
    if not (f_z > SMALLEST_LOAD and mu > SMALLEST_FRICTION):
        return None
    (top, measured), (a0, a1, a2, a3, a4, a5, a6, a7, a8), (b0, b1, b2, b3, b4, b5, b6, b7, b8) = c
    f = 0.001 * (f_z if f_z < top else top)
    ratio = 0.001 * f_z / f
    grip = mu * f_z
    e_x = (b6 * f + b7) * f + b8
    e_y = (a6 * f + a7) * f + a8
    return LoadedTyre(
        b0,
        (b1 * f + b2) * 0.001 * grip * measured if measured else grip,
        100.0 * ratio * (b3 * f + b4) * f * exp(-b5 * f),
        e_x if e_x < 1.0 else 1.0,
        a0,
        (a1 * f + a2) * 0.001 * grip * measured if measured else grip,
        180.0 / pi * ratio * a3 * sin(a4 * atan(a5 * f)),
        e_y if e_y < 1.0 else 1.0,
    )


def forces_1987(kappa: float, alpha: float, tyre: LoadedTyre) -> tuple[float, float, float]:
    """Return F_x, F_y and dF_x/dkappa [N] at the interface's slip `kappa` [1] and slip angle `alpha` [rad].

    dF_x/dkappa, at constant slip angle, is the derivative of F_x = D_x f_x(k) kappa / n,
    n^2 = kappa^2 + T^2, T = eta(k) tan(alpha), times that of the practical slip.
    """
    c_x, d_x, k_x, e_x, c_y, d_y, k_y, e_y = tyre
    tan_alpha, forward = lateral_slip(alpha)
    raw, kappa = kappa, practical_slip(kappa, forward)
    if not forward:
        alpha = copysign(pi, alpha) - alpha
    n_x = k_x / d_x
    n_y = k_y / d_y
    p_x = n_x * kappa
    p_y = n_y * alpha
    k = sqrt(p_x * p_x + p_y * p_y)
    turned = 0.0
    if k < 2.0 * pi:
        eta_0 = n_y / n_x
        turned = tan_alpha * 0.25 * (1.0 - eta_0) * sin(0.5 * k)
        tan_alpha *= 0.5 * (1.0 + eta_0 - (1.0 - eta_0) * cos(0.5 * k))
    square = kappa * kappa + tan_alpha * tan_alpha
    size = sqrt(square)
    if k < SMALLEST_SLIP or size < SMALLEST_SLIP:
        return 0.0, 0.0, k_x
    x = k / c_x
    y = k / c_y
    b = x - e_x * (x - atan(x))
    angle = c_x * atan(b)
    f_x = d_x * sin(angle)
    f_y = d_y * sin(c_y * atan(y - e_y * (y - atan(y))))
    by_k = n_x * p_x / k  # dk/dkappa
    slope = d_x * cos(angle) / (1.0 + b * b) * (1.0 - e_x + e_x / (1.0 + x * x))
    stiffness = (slope * by_k * kappa + f_x * tan_alpha * (tan_alpha - kappa * turned * by_k) / square) / size
    if kappa != raw:  # driving: kappa / (1 - kappa), or held at 99
        stiffness *= (kappa / raw) ** 2 if abs(raw) < 0.99 else 0.0
    return f_x * kappa / size, -f_y * tan_alpha / size, stiffness
