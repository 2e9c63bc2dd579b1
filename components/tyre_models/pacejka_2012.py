"""Magic Formula of MF-Tyre 6.1, 6.2 and 5.2: forces and moments of a tyre.

The equations are in `tyres/magic_formula_62.py`; numbers in brackets are those of the book, H. B. Pacejka,
Tyre and Vehicle Dynamics, 3rd ed. 2012, section 4.3.2.

Values that depend only on coefficients and pressure are computed once per wheel (`longitudinal_set`,
`whole_set`), the dependence of F_x on camber, load and friction once per evaluation (`longitudinal_curve`),
because slip control evaluates the same curve at many slips.

A wheel is always evaluated as a wheel on the tyreside of the set that rolls forward: a wheel on the other
side is mirrored (slip angle, camber, F_y, M_x and M_z change sign), a wheel that rolls backward is reflected
fore and aft (kappa, F_x and M_z change sign). Both are exact.
"""

from math import atan, cos, exp, pi, sin, sqrt, tan
from typing import Any

from .pacejka_2002 import SMALLEST_FRICTION, SMALLEST_LOAD
from .pacejka_2012_set import of_axle

Numbers = tuple[float, ...]
Curve2012 = tuple[float, ...]
"""Coefficients of F_x(kappa) at fixed slip angle, camber, load and friction, see `longitudinal_curve`."""

LARGEST_SLIP = 0.99
"""Slip of the interface above which the book's slip of a driven wheel, kappa / (1 - kappa), is held at 99."""


def longitudinal_set(p: Any, axle: str, *, left: bool) -> tuple[Numbers, Numbers]:
    """Return the preprocessed parameters of F_x for the left or right wheel of the axle "front" or "rear".

    Raises:
        ValueError: a stiffness has the wrong sign.
    """

    of = of_axle(p, axle)
    load_0 = of("fnomin") * of("lfzo")
    pressure = of("inflpres") / of("nompres") - 1.0
    _check_stiffness(axle, "K_x (PKX1)", of("pkx1") * of("lkx"))
    mirror = 1.0 if left == (of("tyreside") >= 0.0) else -1.0
    common = (
        *(mirror, 1.0 / p.reference_friction, of("fzmax"), 1.0 / load_0),
        1.0 if p.slip_angle_as_tangent else 0.0,
        1.0 if p.file_low_friction == "similarity" else 0.0,
    )
    mu = of("lmux") * (1.0 + pressure * (of("ppx3") + pressure * of("ppx4")))
    k = of("lkx") * (1.0 + pressure * (of("ppx1") + pressure * of("ppx2")))
    lex, lhx, lvx = of("lex"), of("lhx"), of("lvx") * of("lmux")
    camber = of("lgax") ** 2
    return common, (
        *(of("pcx1") * of("lcx"), mu * of("pdx1"), mu * of("pdx2"), of("pdx3") * camber),
        *(lex * of("pex1"), lex * of("pex2"), lex * of("pex3"), of("pex4")),
        *(k * of("pkx1"), k * of("pkx2"), of("pkx3")),
        *(lhx * of("phx1"), lhx * of("phx2"), lvx * of("pvx1"), lvx * of("pvx2")),
        *(of("rbx1") * of("lxal"), of("rbx2"), of("rbx3") * of("lxal")),
        *(of("rcx1"), of("rex1"), of("rex2"), of("rhx1")),
    )


def whole_set(p: Any, axle: str, *, left: bool) -> tuple[Numbers, ...]:
    """Return the preprocessed parameters of all forces and moments, as `longitudinal_set` for F_x."""

    of = of_axle(p, axle)
    six = of("fittyp") >= 60.0
    load, load_0 = of("fnomin"), of("fnomin") * of("lfzo")
    pressure = of("inflpres") / of("nompres") - 1.0
    bend = of("pky2") * (1.0 + pressure * of("ppy2"))
    if bend == 0.0:
        raise ValueError(f"pky2_{axle} must not be 0")
    at_nominal = of("pky1") * of("lky") * sin(of("pky4") * atan(1.0 / bend))
    _check_stiffness(axle, "-K_y (PKY1, PKY2, PKY4)", -at_nominal)
    mu, lmuy, lky, ley = of("lmuy"), of("lmuy"), of("lky"), of("ley")
    mu *= 1.0 + pressure * (of("ppy3") + pressure * of("ppy4"))
    lhy, lvy, lga = of("lhy"), of("lvy") * lmuy, of("lgay")
    camber = of("lkyc") if six else lga
    k_camber = of("lkyc") * (1.0 + pressure * of("ppy5")) if six else 0.0
    lateral = (
        *(of("pcy1") * of("lcy"), mu * of("pdy1"), mu * of("pdy2"), of("pdy3") * lga * lga),
        *(ley * of("pey1"), ley * of("pey2"), of("pey3"), of("pey4") * lga, of("pey5") * lga * lga),
        *(lky * of("pky1") * load_0 * (1.0 + pressure * of("ppy1")), bend),
        *(of("pky3") * lga, of("pky4"), of("pky5") * lga * lga * (1.0 + pressure * of("ppy2"))),
        *(
            k_camber * of("pky6"),
            k_camber * of("pky7"),
            0.0 if six else of("phy3") * lga,
            1.0 if six else 0.0,
        ),
        *(lhy * of("phy1"), lhy * of("phy2"), lvy * of("pvy1"), lvy * of("pvy2")),
        *(camber * lmuy * of("pvy3"), camber * lmuy * of("pvy4")),
    )
    induced = of("lvyka")
    combined = (
        *(of("rby1") * of("lyka"), of("rby2"), of("rby3"), of("rby4") * of("lyka")),
        *(of("rcy1"), of("rey1"), of("rey2"), of("rhy1"), of("rhy2")),
        *(induced * of("rvy1"), induced * of("rvy2"), induced * of("rvy3")),
        *(of("rvy4"), of("rvy5"), of("rvy6")),
    )
    radius, lgaz = of("unloaded_radius"), of("lgaz")
    slope = lky / lmuy
    trail = radius / load * of("ltr") * (1.0 - pressure * of("ppz1"))
    residual = radius * lmuy
    by_camber = residual * (of("lkzc") if six else lgaz)
    lever = radius * of("ls")
    aligning = (
        1.0 if six else 0.0,
        *(slope * of("qbz1"), slope * of("qbz2"), slope * of("qbz3"), of("qbz4") * lgaz, of("qbz5") * lgaz),
        *(slope * of("qbz9"), of("qbz10"), of("qcz1"), trail * of("qdz1"), trail * of("qdz2")),
        *(of("qdz3") * lgaz, of("qdz4") * lgaz * lgaz),
        *(residual * of("lres") * of("qdz6"), residual * of("lres") * of("qdz7")),
        by_camber * of("qdz8") * (1.0 + pressure * of("ppz2")),
        by_camber * of("qdz9") * (1.0 + pressure * of("ppz2")),
        *(by_camber * of("qdz10"), by_camber * of("qdz11")),
        *(of("qez1"), of("qez2"), of("qez3"), of("qez4"), of("qez5") * lgaz),
        *(of("qhz1"), of("qhz2"), of("qhz3") * lgaz, of("qhz4") * lgaz),
        *(lever * of("ssz1"), lever * of("ssz2") / load, lever * of("ssz3"), lever * of("ssz4")),
    )
    size = radius * of("lmx")
    overturning: Numbers = (
        *(size, 1.0 / load, of("qsx1") * of("lvmx"), of("qsx2") * (1.0 + pressure * of("ppmx1"))),
        *(of(f"qsx{i}") for i in range(3, 15)),
    )
    if not any(of(f"qsx{i}") for i in range(1, 15)):
        overturning = ()
    return *longitudinal_set(p, axle, left=left), lateral, combined, aligning, overturning


def _check_stiffness(axle: str, what: str, at_nominal: float) -> None:
    if not at_nominal > 0.0:
        raise ValueError(
            f"the Magic Formula's {what} of the {axle} tyres must be positive at nominal load: driving slip "
            "gives a positive longitudinal force, a positive slip angle a negative lateral one"
        )


def forward_slip(alpha: float, mirror: float, book: float) -> tuple[float, bool]:
    """Return the slip angle [rad] mirrored to a forward-rolling wheel on the tyreside, and the direction.

    The second item is true if the wheel rolls forward.

    Args:
        alpha: slip angle [rad] as defined by the interface.
        mirror: 1 on the tyreside of the set, -1 on the other side.
        book: if not zero, return its tangent, as in (4.E3).
    """
    forward = True
    if alpha > 0.5 * pi:
        alpha, forward = pi - alpha, False
    elif alpha < -0.5 * pi:
        alpha, forward = -pi - alpha, False
    return mirror * (tan(alpha) if book else alpha), forward


def practical_slip(kappa: float) -> tuple[float, float]:
    """Return (w R - v) / v of a forward-rolling wheel, and its derivative by (w R - v) / max(w R, v)."""
    if kappa <= 0.0:
        return kappa, 1.0
    if kappa < LARGEST_SLIP:
        rest = 1.0 / (1.0 - kappa)
        return kappa * rest, rest * rest
    return LARGEST_SLIP / (1.0 - LARGEST_SLIP), 0.0


def longitudinal_curve(
    alpha: float, gamma: float, load: float, df: float, friction: float, s: Numbers
) -> Curve2012:
    """Return the curve F_x(kappa) at fixed slip angle, camber, load and friction, for `longitudinal_force`.

    Args:
        alpha, gamma: slip angle and camber on the tyreside of the set [rad].
        load, df: vertical load [N], not above fzmax, and F_z / F_z0' - 1.
        friction: lambda = mu / reference_friction.
        s: preprocessed parameters of F_x.
    """
    (
        c, d1, d2, d3, e1, e2, e3, e4, k1, k2, k3, h1, h2, v1, v2, rb1, rb2, rb3, rc, re1, re2, rh,
    ) = s  # fmt: skip
    d = (d1 + d2 * df) * friction * load  # 4.E12, 4.E13
    if gamma != 0.0:
        square = gamma * gamma
        d *= 1.0 - d3 * square
        rb1 += rb3 * square
    k = load * (k1 + k2 * df) * exp(k3 * df)  # 4.E15
    e = e1 + df * (e2 + df * e3)
    e_driving, e_braking, e_weight = e * (1.0 - e4), e * (1.0 + e4), re1 + re2 * df
    return (
        c,
        d,
        k / (c * d) if d else 0.0,
        h1 + h2 * df,
        e_driving if e_driving < 1.0 else 1.0,
        e_braking if e_braking < 1.0 else 1.0,
        load * (v1 + v2 * df) * friction,
        k,
        rb1,
        rb2,
        rc,
        e_weight if e_weight < 1.0 else 1.0,
        alpha + rh,
        rh,
    )


def longitudinal_force(kappa: float, curve: Curve2012) -> tuple[float, float]:
    """Return F_x and dF_x/dkappa [N] at the book's slip `kappa`, (w R - v) / v (4.E9-4.E18, 4.E50-4.E57)."""
    c, d, b, s_h, e_driving, e_braking, s_v, _, rb1, rb2, rc, e_weight, slip, rh = curve
    kappa_x = kappa + s_h
    x = b * kappa_x
    e = e_driving if kappa_x > 0.0 else e_braking
    bent = x - e * (x - atan(x))
    angle = c * atan(bent)
    force = d * sin(angle) + s_v
    slope = d * c * b * cos(angle) / (1.0 + bent * bent) * (1.0 - e + e / (1.0 + x * x))

    y = rb2 * kappa
    fall = 1.0 / (1.0 + y * y)
    b_w = rb1 * sqrt(fall)
    db_w = -b_w * rb2 * y * fall
    weight, turn = _weight(slip, b_w, rc, e_weight)
    if rh:
        weight_0, turn_0 = _weight(rh, b_w, rc, e_weight)
        weight /= weight_0
        turn = (turn - weight * turn_0) / weight_0
    turn *= db_w
    if weight <= 0.0:
        return 0.0, 0.0
    return weight * force, weight * slope + turn * force


def _weight(slip: float, b: float, c: float, e: float) -> tuple[float, float]:
    """Return cos(C atan(B x - E (B x - atan(B x)))) and its derivative by B."""
    x = b * slip
    if not e:
        angle = c * atan(x)
        return cos(angle), -sin(angle) * c * slip / (1.0 + x * x)
    bent = x - e * (x - atan(x))
    angle = c * atan(bent)
    return cos(angle), -sin(angle) * c * slip / (1.0 + bent * bent) * (1.0 - e + e / (1.0 + x * x))


def side_force(alpha: float, gamma: float, load: float, df: float, friction: float, s: Numbers) -> Numbers:
    """Return F_y0 [N], mu_y F_z [N], K_y [N/rad], B C [1/rad], S_H [rad] and S_V [N] (4.E19-4.E30)."""
    (
        c, d1, d2, d3, e1, e2, e3, e4, e5, k1, k2, k3, k4, k5, k6, k7, phy3, six, h1, h2, v1, v2, v3, v4,
    ) = s  # fmt: skip
    d = (d1 + d2 * df) * friction * load
    e = e1 + e2 * df
    s_h = h1 + h2 * df
    s_v = load * (v1 + v2 * df) * friction
    even, odd = 1.0, e3
    if gamma == 0.0:
        k = k1 * sin(k4 * atan((1.0 + df) / k2))
    else:
        square = gamma * gamma
        size = abs(gamma)
        d *= 1.0 - d3 * square
        k = k1 * (1.0 - k3 * size) * sin(k4 * atan((1.0 + df) / (k2 + k5 * square)))
        v_camber = load * (v3 + v4 * df) * gamma * friction  # 4.E28
        s_v += v_camber
        if six:
            s_h += (load * (k6 + k7 * df) * gamma - v_camber) / k if k else 0.0  # 4.E27
        else:
            s_h += phy3 * gamma
        even += e5 * square
        odd += e4 * gamma
    alpha_y = alpha + s_h
    e *= even - odd if alpha_y > 0.0 else even + odd
    if e > 1.0:
        e = 1.0
    b = k / (c * d) if d else 0.0
    x = b * alpha_y
    return d * sin(c * atan(x - e * (x - atan(x)))) + s_v, d, k, b * c, s_h, s_v


def wheel_forces(
    kappa: float, alpha: float, gamma: float, f_z: float, mu: float, sets: tuple[Numbers, ...]
) -> tuple[float, float, float, float, float]:
    """Return F_x, F_y [N], M_z, M_x [N.m] and dF_x/dkappa [N] of a tyre, at the contact point, ISO 8855.

    Args:
        kappa, alpha: longitudinal slip [1] and slip angle [rad] as defined by the interface.
        gamma: camber [rad], positive with the top of the wheel to the right.
        f_z, mu: vertical load [N] and friction coefficient [1].
        sets: from `whole_set`.
    """
    common, longitudinal, lateral, combined, aligning, overturning = sets
    mirror, per_reference, f_top, load_scale, book, similar = common
    friction = mu * per_reference
    if not (f_z > SMALLEST_LOAD and friction > SMALLEST_FRICTION):
        return 0.0, 0.0, 0.0, 0.0, 0.0
    load, share = (f_z, 1.0) if f_z < f_top else (f_top, f_z / f_top)
    df = load * load_scale - 1.0
    cos_alpha = abs(cos(alpha))
    slip, forward = forward_slip(alpha, mirror, book)
    gamma = mirror * (sin(gamma) if book else gamma)
    kappa, stretch = practical_slip(kappa if forward else -kappa)
    scale = 1.0
    if similar:  # scaled forces of the dry tyre at scaled slips
        scale, friction = friction, 1.0
        slip /= scale
        kappa /= scale

    curve = longitudinal_curve(slip, gamma, load, df, friction, longitudinal)
    f_x, stiffness = longitudinal_force(kappa, curve)
    f_x *= scale

    f_y0, d_y, k_y, bc_y, s_h, s_v = side_force(slip, gamma, load, df, friction, lateral)
    rb1, rb2, rb3, rb4, rc, re1, re2, rh1, rh2, rv1, rv2, rv3, rv4, rv5, rv6 = combined
    y = rb2 * (slip - rb3)
    b_w = (rb1 + rb4 * gamma * gamma) / sqrt(1.0 + y * y)  # 4.E62
    e = re1 + re2 * df
    if e > 1.0:
        e = 1.0
    shift = rh1 + rh2 * df
    x = b_w * (kappa + shift)
    weight = cos(rc * atan(x - e * (x - atan(x)) if e else x))
    if shift:
        x = b_w * shift
        weight /= cos(rc * atan(x - e * (x - atan(x)) if e else x))
    if weight < 0.0:
        weight = 0.0
    y = rv4 * slip
    induced = d_y * (rv1 + rv2 * df + rv3 * gamma) / sqrt(1.0 + y * y) * sin(rv5 * atan(rv6 * kappa))  # 4.E66
    f_y = scale * (weight * f_y0 + induced)

    (
        six, qb1, qb2, qb3, qb4, qb5, qb9, qb10, c_t, qd1, qd2, qd3, qd4, qd6, qd7, qd8, qd9, qd10, qd11,
        qe1, qe2, qe3, qe4, qe5, qh1, qh2, qh3, qh4, ss1, ss2, ss3, ss4,
    ) = aligning  # fmt: skip
    b_t = (qb1 + df * (qb2 + df * qb3)) / friction
    d_t = load * (qd1 + qd2 * df)
    d_r = qd6 + qd7 * df
    s_t = qh1 + qh2 * df
    odd, lever = qe4, ss1
    turning = weight * f_y0
    if gamma != 0.0:
        size = abs(gamma)
        b_t *= 1.0 + qb4 * gamma + qb5 * size
        d_t *= 1.0 + gamma * (qd3 + qd4 * gamma)
        d_r += gamma * (qd8 + qd9 * df + size * (qd10 + qd11 * df))
        s_t += gamma * (qh3 + qh4 * df)
        odd += qe5 * gamma
        lever += gamma * (ss3 + ss4 * df)
        if six:
            turning = weight * side_force(slip, 0.0, load, df, friction, lateral)[0]  # 4.E74
    ratio = curve[7] / k_y * kappa if k_y else 0.0
    alpha_t = slip + s_t
    alpha_r = slip + s_h + (s_v / k_y if k_y else 0.0)
    e = qe1 + df * (qe2 + df * qe3)
    if odd:
        e *= 1.0 + odd * (2.0 / pi) * atan(b_t * c_t * alpha_t)
    if e > 1.0:
        e = 1.0
    if book:
        slip_t = sqrt(alpha_t * alpha_t + ratio * ratio)
        slip_r = sqrt(alpha_r * alpha_r + ratio * ratio)
    else:
        y, z = tan(scale * alpha_t), tan(scale * alpha_r)
        ratio *= scale
        slip_t = atan(sqrt(y * y + ratio * ratio)) / scale
        slip_r = atan(sqrt(z * z + ratio * ratio)) / scale
    x = b_t * slip_t
    trail = d_t * cos(c_t * atan(x - e * (x - atan(x)))) * cos_alpha  # 4.E73
    y = (qb9 / friction + qb10 * bc_y) * slip_r
    residual = load * d_r * friction * cos_alpha / sqrt(1.0 + y * y)  # 4.E75
    m_z = scale * residual + (lever + ss2 * f_y) * f_x - trail * scale * turning  # 4.E71

    m_x = 0.0
    if overturning:
        size, per_load, q1, q2, q3, q4, q5, q6, q7, q8, q9, q10, q11, q12, q13, q14 = overturning
        f, z = f_y * per_load, load * per_load
        m_x = load * (
            q1
            - q2 * gamma
            + q3 * f
            + q4 * cos(q5 * atan((q6 * z) ** 2)) * sin(q7 * gamma + q8 * atan(q9 * f))
            + q10 * atan(q11 * z) * gamma
            - q12 * gamma * abs(gamma)
        )
        m_x = size * (m_x + f_y * (q13 + q14 * abs(gamma)))  # 4.E69 and its continuation in MF-Tyre 6.2
    way = share if forward else -share
    side = share * mirror
    return way * f_x, side * f_y, way * mirror * m_z, side * m_x, share * stiffness * stretch
