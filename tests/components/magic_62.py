"""A second implementation of the Magic Formula of MF-Tyre 6.1, 6.2 and 5.2, of arrays, from the equations.

Written apart from the one in `components`: keys as in a tyre property file, no work done ahead, longdouble
numbers, and every slope a complex step.
"""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

SIX = 61, 62


def values_of(given: dict[str, float]) -> SimpleNamespace:
    """Return the coefficients with what a file leaves out: scalings one, PKY4 two, all others zero."""

    class Values(SimpleNamespace):
        def __getattr__(self, key: str) -> float:
            return 1.0 if key.startswith("L") else {"PKY4": 2.0}.get(key, 0.0)

    values = Values(**given)
    values.__dict__.setdefault("INFLPRES", values.NOMPRES)
    return values


def shape(x, b, c, e):
    """Return the argument of the sine or cosine."""
    inner = b * x
    return c * np.arctan(inner * (1 - e) + e * np.arctan(inner))


def longitudinal(k, kappa, alpha, gamma, f_z, scale):
    """Return F_x and K_x; kappa may be complex, by which a slope is found."""
    base = k.FNOMIN * k.LFZO
    df = f_z / base - 1
    dp = (k.INFLPRES - k.NOMPRES) / k.NOMPRES if k.NOMPRES else 0.0
    g = gamma * k.LGAX
    mu = (k.PDX1 + k.PDX2 * df) * (1 + k.PPX3 * dp + k.PPX4 * dp**2) * (1 - k.PDX3 * g**2) * k.LMUX * scale
    stiff = f_z * (k.PKX1 + k.PKX2 * df) * np.exp(k.PKX3 * df) * (1 + k.PPX1 * dp + k.PPX2 * dp**2) * k.LKX
    c = k.PCX1 * k.LCX
    x = kappa + (k.PHX1 + k.PHX2 * df) * k.LHX
    e = (k.PEX1 + k.PEX2 * df + k.PEX3 * df**2) * (1 - k.PEX4 * np.where(np.real(x) > 0, 1, -1)) * k.LEX
    lift = f_z * (k.PVX1 + k.PVX2 * df) * k.LVX * k.LMUX * scale
    pure = mu * f_z * np.sin(shape(x, stiff / (c * mu * f_z), c, np.minimum(e, 1))) + lift
    b = (k.RBX1 + k.RBX3 * gamma**2) / np.sqrt(1 + (k.RBX2 * kappa) ** 2) * k.LXAL
    e = np.minimum(k.REX1 + k.REX2 * df, 1)
    weight = np.cos(shape(alpha + k.RHX1, b, k.RCX1, e)) / np.cos(shape(k.RHX1, b, k.RCX1, e))
    return np.where(np.real(weight) > 0, weight * pure, 0), stiff


def lateral(k, alpha, gamma, f_z, scale):
    """Return F_y0, mu_y, K_y, B, C, S_H and S_V."""
    base = k.FNOMIN * k.LFZO
    df = f_z / base - 1
    dp = (k.INFLPRES - k.NOMPRES) / k.NOMPRES if k.NOMPRES else 0.0
    g = gamma * k.LGAY
    mu = (k.PDY1 + k.PDY2 * df) * (1 + k.PPY3 * dp + k.PPY4 * dp**2) * (1 - k.PDY3 * g**2) * k.LMUY * scale
    at = f_z / base / ((k.PKY2 + k.PKY5 * g**2) * (1 + k.PPY2 * dp))
    stiff = k.PKY1 * base * (1 + k.PPY1 * dp) * (1 - k.PKY3 * np.abs(g)) * k.LKY
    stiff = stiff * np.sin(k.PKY4 * np.arctan(at))
    lean = k.LKYC if k.FITTYP in SIX else k.LGAY
    by_camber = f_z * (k.PVY3 + k.PVY4 * df) * gamma * lean * k.LMUY * scale
    s_v = f_z * (k.PVY1 + k.PVY2 * df) * k.LVY * k.LMUY * scale + by_camber
    s_h = (k.PHY1 + k.PHY2 * df) * k.LHY
    if k.FITTYP in SIX:
        thrust = f_z * (k.PKY6 + k.PKY7 * df) * (1 + k.PPY5 * dp) * k.LKYC
        s_h = s_h + (thrust * gamma - by_camber) / stiff
    else:
        s_h = s_h + k.PHY3 * g
    x = alpha + s_h
    sign = np.where(x > 0, 1, -1)
    e = (k.PEY1 + k.PEY2 * df) * (1 + k.PEY5 * g**2 - (k.PEY3 + k.PEY4 * g) * sign) * k.LEY
    c = k.PCY1 * k.LCY
    b = stiff / (c * mu * f_z)
    return mu * f_z * np.sin(shape(x, b, c, np.minimum(e, 1))) + s_v, mu, stiff, b, c, s_h, s_v


def forces(given, *, kappa, alpha, gamma, f_z, mu=1.0):
    """Return F_x, F_y, M_z, M_x and dF_x/dkappa of a wheel on the set's own side, rolling forward.

    Args:
        given: coefficients, keys as in a tyre property file.
        kappa: as the interface defines it, (w R - v) / max(w R, v); shape (n,).
        alpha, gamma, f_z: slip angle, camber [rad], load [N]; shape (n,).
        mu: over that of the road the set was measured on.
    """
    k = values_of({key: np.longdouble(value) for key, value in given.items()})
    kappa, alpha, gamma, f_z = (np.asarray(x, np.longdouble) for x in (kappa, alpha, gamma, f_z))
    share = np.maximum(f_z / k.FZMAX, 1) if k.FZMAX else 1.0
    f_z = f_z / share

    def of_kappa(kappa):
        slip = np.where(np.real(kappa) > 0, kappa / (1 - kappa), kappa)
        return longitudinal(k, slip, alpha, gamma, f_z, mu)

    tiny = np.longdouble(1e-200)
    f_x, k_x = of_kappa(kappa)
    slope = np.imag(of_kappa(kappa + 1j * tiny)[0]) / tiny
    kappa = np.where(kappa > 0, kappa / (1 - kappa), kappa)

    base = k.FNOMIN * k.LFZO
    df = f_z / base - 1
    dp = (k.INFLPRES - k.NOMPRES) / k.NOMPRES if k.NOMPRES else 0.0
    f_y0, mu_y, k_y, b_y, c_y, s_h, s_v = lateral(k, alpha, gamma, f_z, mu)
    b = (k.RBY1 + k.RBY4 * gamma**2) * np.cos(np.arctan(k.RBY2 * (alpha - k.RBY3))) * k.LYKA
    e = np.minimum(k.REY1 + k.REY2 * df, 1)
    shift = k.RHY1 + k.RHY2 * df
    weight = np.cos(shape(kappa + shift, b, k.RCY1, e)) / np.cos(shape(shift, b, k.RCY1, e))
    weight = np.maximum(weight, 0)
    induced = mu_y * f_z * (k.RVY1 + k.RVY2 * df + k.RVY3 * gamma) * np.cos(np.arctan(k.RVY4 * alpha))
    induced = induced * np.sin(k.RVY5 * np.arctan(k.RVY6 * kappa)) * k.LVYKA
    f_y = weight * f_y0 + induced

    r_0, g = k.UNLOADED_RADIUS, gamma * k.LGAZ
    alpha_t = alpha + k.QHZ1 + k.QHZ2 * df + (k.QHZ3 + k.QHZ4 * df) * g
    alpha_r = alpha + s_h + s_v / k_y
    both = (k_x / k_y * kappa) ** 2
    slip_t = np.arctan(np.sqrt(np.tan(alpha_t) ** 2 + both))
    slip_r = np.arctan(np.sqrt(np.tan(alpha_r) ** 2 + both))
    b_t = (k.QBZ1 + k.QBZ2 * df + k.QBZ3 * df**2) * (1 + k.QBZ4 * g + k.QBZ5 * np.abs(g))
    b_t = b_t * k.LKY / (k.LMUY * mu)
    d_t = f_z * (k.QDZ1 + k.QDZ2 * df) * (1 - k.PPZ1 * dp) * (1 + k.QDZ3 * g + k.QDZ4 * g**2) * r_0 / k.FNOMIN
    e_t = (k.QEZ1 + k.QEZ2 * df + k.QEZ3 * df**2) * (
        1 + (k.QEZ4 + k.QEZ5 * g) * 2 / np.pi * np.arctan(b_t * k.QCZ1 * alpha_t)
    )
    trail = d_t * k.LTR * np.cos(shape(slip_t, b_t, k.QCZ1, np.minimum(e_t, 1))) * np.cos(alpha)
    b_r = k.QBZ9 * k.LKY / (k.LMUY * mu) + k.QBZ10 * b_y * c_y
    lean = k.LKZC if k.FITTYP in SIX else k.LGAZ
    d_r = (k.QDZ8 + k.QDZ9 * df) * (1 + k.PPZ2 * dp) + (k.QDZ10 + k.QDZ11 * df) * np.abs(gamma)
    d_r = f_z * r_0 * ((k.QDZ6 + k.QDZ7 * df) * k.LRES + d_r * gamma * lean) * k.LMUY * mu * np.cos(alpha)
    lever = r_0 * (k.SSZ1 + k.SSZ2 * f_y / k.FNOMIN + (k.SSZ3 + k.SSZ4 * df) * gamma) * k.LS
    turning = weight * lateral(k, alpha, 0 * gamma, f_z, mu)[0] if k.FITTYP in SIX else f_y - induced
    m_z = -trail * turning + d_r * np.cos(np.arctan(b_r * slip_r)) + lever * f_x

    f, z = f_y / k.FNOMIN, f_z / k.FNOMIN
    m_x = k.QSX1 * k.LVMX - k.QSX2 * gamma * (1 + k.PPMX1 * dp) + k.QSX3 * f
    swing = k.QSX7 * gamma + k.QSX8 * np.arctan(k.QSX9 * f)
    m_x = m_x + k.QSX4 * np.cos(k.QSX5 * np.arctan((k.QSX6 * z) ** 2)) * np.sin(swing)
    m_x = m_x + k.QSX10 * np.arctan(k.QSX11 * z) * gamma - k.QSX12 * gamma * np.abs(gamma)
    m_x = r_0 * k.LMX * (f_z * m_x + f_y * (k.QSX13 + k.QSX14 * np.abs(gamma)))
    return tuple(np.asarray(share * x, float) for x in (np.real(f_x), f_y, m_z, m_x, slope))
