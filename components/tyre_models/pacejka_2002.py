"""Magic Formula, 2002 form: forces and aligning moment of a tyre.

    F_x  = G_xa F_x0                    F_x0 = D sin(C atan(B k - E (B k - atan(B k)))) + S_Vx    (4.E9 ff.)
    F_y  = G_yk F_y0 + S_Vyk            F_y0 = likewise in tan(alpha), + S_Vy                     (4.E19 ff.)
    M_z  = -t (F_y - S_Vyk) + M_zr + s F_x                                                        (4.E71 ff.)
    G_xa = cos(C atan(B tan(alpha))), B = RBX1 cos(atan(RBX2 k)); G_yk likewise in k              (4.E50 ff.)

Source: H. B. Pacejka, Tyre and Vehicle Dynamics, 2nd ed. 2006, section 4.3.2, equations 4.E1-4.E78,
without camber, turn slip and speed dependence. The signs of the coefficients follow ISO 8855.

Friction: with lambda = mu / reference_friction, pure slip obeys F(slip) = lambda F_dry(slip / lambda), as
with lambda_mu in the book: lower peak, same stiffness. Pure slip is therefore evaluated at scaled slips.
`low_friction` selects the slips of the weights G: scaled, too (`similarity`, the default; combined slip then
obeys the same law, as in the similarity method of section 4.2), or unscaled (`scale`, as printed in equations
4.E50 ff.). Unscaled, both forces are near their peaks at slips that are still small for the weights of a dry
road: the resultant over friction and load grows from 1.21 on the dry road, the peak of F_x alone, to 1.42 at
lambda = 0.3 and 1.53 at 0.1, which is not physical.

Asymmetric terms, all zero unless switched on: PHX*, PVX*, PHY*, PVY* and QHZ* (shifts), PEY3, QEZ4
(left-right difference of the curvatures), RHX1, RBY3 (shifts in the weights), RVY* (side force
induced by kappa), QDZ6, QDZ7 (residual moment) and SSZ1 (constant lever arm of F_x). Without them
F_x is even and F_y, M_z are odd in alpha, to the bit, and zero slip gives zero force. PEX4 and RHY*
are kept: they distinguish driving from braking, not left from right, and give no force at zero slip.

The side force induced by kappa is proportional to mu_y F_z (4.E67), and mu_y of table A3.1 is negative, with
signs of ISO 8855 throughout: read literally, as here, the force has the sign of -RVY1 sin(RVY5 atan(RVY6
kappa)). Programs that fit or use such sets read it likewise: Chrono's `ChPac02Tire` and the Magic Formula
Tyre Library for MATLAB (teasit) both multiply by a mu_y that keeps the sign of PDY1.

Beyond the measured range G is bounded below by zero (with this set it would be negative for alpha > 31
degrees at kappa 0), and above `maximum_load` all outputs are proportional to load. kappa is defined by the
interface as (w R - v) / max(|w R|, |v|), by the book as (w R - v) / |v|: `practical_slip` converts it, up
to 99 (w R = 100 v).
"""

from math import atan, cos, exp, pi, sin, sqrt, tan
from typing import NamedTuple

from .pacejka_2002_set import Coefficients

SMALLEST_LOAD = 1e-6
"""Vertical load [N] up to which forces are zero."""
SMALLEST_FRICTION = 1e-6
"""lambda = mu / reference_friction [1] up to which forces are zero."""
SLIP_STEP = 1e-6
"""Step of kappa in the difference quotient dF_x/dkappa: truncation and rounding errors below 1e-4."""


class LongitudinalCurve(NamedTuple):
    """Coefficients of F_x(kappa) at fixed slip angle, load and friction, see `longitudinal_curve`."""

    forward: bool
    c: float
    d: float
    b: float  # B / lambda
    shift: float  # B S_Hx at scaled slip
    e_braking: float
    e_driving: float
    s_v: float
    stiffness: float  # K_x of pure slip [N]
    weight_slip: float  # tan(alpha) + S_Hxa in the weight G_xa
    weight_b: float
    weight_variation: float  # RBX2, divided by lambda if the weights use scaled slips
    weight_c: float
    weight_e: float
    weight_shift: float  # S_Hxa


def lateral_slip(alpha: float) -> tuple[float, bool]:
    """Return (tan(alpha) sgn(v_x) [1], whether the wheel moves forward) for a slip angle [rad] (4.E3)."""
    if -0.5 * pi <= alpha <= 0.5 * pi:
        return tan(alpha), True
    return -tan(alpha), False


def practical_slip(kappa: float, forward: bool) -> float:
    """Return (w R - v) / |v| for (w R - v) / max(|w R|, |v|); they differ only for driven wheels."""
    if kappa > 0.0:
        if forward:
            return kappa / (1.0 - kappa) if kappa < 0.99 else 99.0
    elif not forward:
        return kappa / (1.0 + kappa) if kappa > -0.99 else -99.0
    return kappa


def digressive(friction: float) -> float:
    """Return lambda' of lambda, with which vertical shifts vanish only on ice (4.E8, A_mu = 10)."""
    return 10.0 * friction / (1.0 + 9.0 * friction)


def longitudinal_curve(
    tan_alpha: float, forward: bool, f_z: float, mu: float, c: Coefficients
) -> LongitudinalCurve | None:
    """Return the curve F_x(kappa) at fixed slip angle, load and friction, for `longitudinal_force`.

    Args:
        tan_alpha, forward: from `lateral_slip`.
        f_z, mu: vertical load [N] and friction coefficient [1].
        c: coefficients of the axle.

    Returns:
        The curve, or None without load or friction, where the force is zero.
    """
    per_reference, similar = c[0]
    friction = mu * per_reference
    if not (f_z > SMALLEST_LOAD and friction > SMALLEST_FRICTION):
        return None
    (
        f_top, load_scale, c_x, d1, d2, e1, e2, e3, e4, k1, k2, k3,
        rb1, rb2, rc, re1, re2, rh, h1, h2, v1, v2, mu_x,
    ) = c[1]  # fmt: skip
    df = (f_z if f_z < f_top else f_top) * load_scale - 1.0
    peak = d1 + d2 * df
    k = (k1 + k2 * df) * exp(k3 * df)
    b = k / (c_x * peak)
    e = e1 + df * (e2 + df * e3)
    e_driving = e * (1.0 - e4)
    e_braking = e * (1.0 + e4)
    scale = 1.0 / friction
    weight_scale = scale if similar else 1.0
    shift = b * (h1 + h2 * df)
    s_v = f_z * (v1 + v2 * df)
    if similar:
        s_v *= mu_x * friction
    else:
        shift *= scale
        s_v *= digressive(mu_x * friction)
    return LongitudinalCurve(
        forward,
        c_x,
        peak * f_z * friction,
        b * scale,
        shift,
        e_braking if e_braking < 1.0 else 1.0,
        e_driving if e_driving < 1.0 else 1.0,
        s_v,
        k * f_z,
        tan_alpha * weight_scale + rh,
        rb1,
        rb2 * weight_scale,
        rc,
        re1 + re2 * df,
        rh,
    )


def longitudinal_force(kappa: float, curve: LongitudinalCurve) -> float:
    """Return F_x [N] of a curve at the longitudinal slip `kappa` = (w R - v) / max(|w R|, |v|)."""
    forward, c, d, b, shift, e, e_driving, s_v, _, slip, b_w, variation, c_w, e_w, slip_0 = curve
    kappa = practical_slip(kappa, forward)
    x = b * kappa + shift
    if x > 0.0:
        e = e_driving
    force = d * sin(c * atan(x - e * (x - atan(x)))) + s_v
    y = variation * kappa
    b_w /= sqrt(1.0 + y * y)
    weight = _weight(slip, slip_0, b_w, c_w, e_w)
    return weight * force if weight > 0.0 else 0.0


def _weight(slip: float, slip_0: float, b: float, c: float, e: float) -> float:
    """Return the weight of a force under the other slip, which is 1 at `slip_0`."""
    y = b * slip
    if e:
        y -= e * (y - atan(y))
    weight = cos(c * atan(y))
    if slip_0:
        weight /= _weight(slip_0, 0.0, b, c, e)
    return weight


def wheel_forces(
    kappa: float, alpha: float, f_z: float, mu: float, axle: Coefficients
) -> tuple[float, float, float, float]:
    """Return F_x, F_y [N], M_z [N.m] and dF_x/dkappa [N] of a tyre, at the contact point, ISO 8855.

    dF_x/dkappa, at constant slip angle, is a difference quotient over `SLIP_STEP` towards smaller |kappa|,
    since slip is not defined beyond |kappa| = 1.

    Args:
        kappa, alpha: longitudinal slip [1] and slip angle [rad] as defined by the interface.
        f_z, mu: vertical load [N] and friction coefficient [1].
        axle: coefficients of the axle.
    """
    tan_alpha, forward = lateral_slip(alpha)
    curve = longitudinal_curve(tan_alpha, forward, f_z, mu, axle)
    if curve is None:
        return 0.0, 0.0, 0.0, 0.0
    f_x = longitudinal_force(kappa, curve)
    step = SLIP_STEP if kappa < 0.0 else -SLIP_STEP
    stiffness = (longitudinal_force(kappa + step, curve) - f_x) / step
    kappa = practical_slip(kappa, forward)

    per_reference, similar = axle[0]
    friction = mu * per_reference
    scale = 1.0 / friction
    (
        f_top, load_scale, c_y, d1, d2, e1, e2, k1, k2, k4, rb1, rb2, rc, re1, re2, rh1, rh2,
    ) = axle[2]  # fmt: skip
    load = f_z if f_z < f_top else f_top
    df = load * load_scale - 1.0
    peak = d1 + d2 * df
    k_y = k1 * sin(k4 * atan(k2 * load)) / load
    b = k_y / (c_y * peak)
    e = e1 + e2 * df
    d = peak * f_z * friction
    slip_y = tan_alpha * scale
    slip_x = kappa * scale
    tan_w, kappa_w = (slip_y, slip_x) if similar else (tan_alpha, kappa)
    cos_alpha = (1.0 if forward else -1.0) / sqrt(1.0 + tan_alpha * tan_alpha)
    odd = axle[4]
    x = slip_y
    s_v = induced = 0.0
    if odd:
        mu_y, e3, h1, h2, v1, v2, rb3, rv1, rv2, rv4, rv5, rv6 = odd[:12]
        shift_scale = 1.0 if similar else scale
        x += (h1 + h2 * df) * shift_scale
        s_v = f_z * (v1 + v2 * df) * (mu_y * friction if similar else digressive(mu_y * friction))
        slip_r = x + s_v * scale / (k_y * f_z)
        e *= 1.0 - e3 if x > 0.0 else 1.0 + e3
        y = rv4 * tan_w
        induced = d * (rv1 + rv2 * df) / sqrt(1.0 + y * y) * sin(rv5 * atan(rv6 * kappa_w))
        tan_w -= rb3
    if e > 1.0:
        e = 1.0
    x *= b
    f_y = d * sin(c_y * atan(x - e * (x - atan(x)))) + s_v

    y = rb2 * tan_w
    b_w = rb1 / sqrt(1.0 + y * y)
    s_h = rh1 + rh2 * df
    e_w = re1 + re2 * df
    weight = _weight(kappa_w + s_h, s_h, b_w, rc, e_w)
    f_y = weight * f_y if weight > 0.0 else 0.0

    q1, q2, q3, c_t, d1, d2, e1, e2, e3, lever = axle[3]
    b_t = q1 + df * (q2 + df * q3)
    e = e1 + df * (e2 + df * e3)
    lever *= (f_y + induced) * load / f_z
    slip_x *= curve[8] / (k_y * f_z)
    residual = 0.0
    x = slip_y
    if odd:
        h1, h2, e4, q9, q10, q6, q7, lever_0 = odd[12:]
        lever += lever_0
        x += (h1 + h2 * df) * shift_scale
        e *= 1.0 + e4 * (2.0 / pi) * atan(b_t * c_t * x)
        y = (q9 + q10 * b * c_y) * sqrt(slip_r * slip_r + slip_x * slip_x)
        residual = f_z * friction * (q6 + q7 * df) * cos_alpha / sqrt(1.0 + y * y)
    if e > 1.0:
        e = 1.0
    x = b_t * sqrt(x * x + slip_x * slip_x)
    trail = load * (d1 + d2 * df) * cos(c_t * atan(x - e * (x - atan(x)))) * cos_alpha
    return f_x, f_y + induced, residual + lever * f_x - trail * f_y, stiffness
