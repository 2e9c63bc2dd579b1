"""Tyre relaxation: lag of forces behind slip due to the deflection of the carcass.

The deflection u of the contact patch relative to the rim grows with the slip speed s and decays over the
relaxation length sigma,

    du/dt = s - V u / sigma,        slip of the contact patch = u / sigma

so in steady rolling the contact patch has the slip s / V of the wheel, and at rest the tyre is a spring. Over
a step with constant s, V and sigma this is solved exactly, with z = V h / sigma:

    u_end = u exp(-z) + s h (1 - exp(-z)) / z

The deflection of a slow wheel is limited by the grip of the sliding contact (`gripped`).
"""

from math import atan, exp, expm1, hypot, sin
from typing import Any

from .pacejka_2012_set import of_axle

SHORTEST = 0.02
"""Smallest relaxation length [m], of tyres with hardly any load; chosen: shorter than a contact patch."""

SLIDES = 3.0
"""K slip over mu F_z above which the whole contact slides, from the brush model (Pacejka, section 3.2)."""


def gripped(of_patch: tuple[float, float], of_wheel: tuple[float, float], grip: float) -> float:
    """Return the share [1] of a deflection that the contact can hold.

    It is 1 up to the grip; beyond, it depends on the component of the wheel's own slip in the direction of
    the deflection. A wheel that keeps sliding thus keeps its deflection, and a wheel that stops or reverses
    loses the excess over the grip.

    Args:
        of_patch, of_wheel: slips of contact patch and wheel, each times its stiffness, x and y [N].
        grip: largest deflecting force that the contact holds [N].
    """
    held = hypot(*of_patch)
    if held <= grip:
        return 1.0
    along = (of_patch[0] * of_wheel[0] + of_patch[1] * of_wheel[1]) / held
    return min(max(grip, along) / held, 1.0)


def deflected(u: float, s: float, v: float, sigma: float, h: float) -> float:
    """Return the deflection [m] after `h` [s].

    Args:
        u: deflection [m].
        s, v: slip speed and rolling speed, not negative, constant over the step [m/s].
        sigma: relaxation length, positive [m].
    """
    z = v * h / sigma
    return u * exp(-z) + s * h * part(z)


def part(z: float) -> float:
    """Return (1 - exp(-z)) / z."""
    return -expm1(-z) / z if z > 1e-9 else 1.0 - 0.5 * z


def relaxation_set(p: Any, axle: str) -> tuple[float, ...]:
    """Return the preprocessed parameters of `relaxation_lengths` for the axle "front" or "rear"."""

    of = of_axle(p, axle)
    pressure = of("inflpres") / of("nompres") - 1.0
    load_0, radius = of("fnomin") * of("lfzo"), of("unloaded_radius")
    return (
        *(1.0 if of("fittyp") >= 60.0 else 0.0, p.relaxation_length, 1.0 / load_0),
        *(of("longitudinal_stiffness") * (1.0 + of("pcfx3") * pressure), of("pcfx1"), of("pcfx2")),
        *(of("lateral_stiffness") * (1.0 + of("pcfy3") * pressure), of("pcfy1"), of("pcfy2")),
        *(of("ptx1"), of("ptx2"), of("ptx3"), radius / of("fnomin") * of("lsgkp")),
        *(of("pty1") * radius * of("lfzo") * of("lsgal"), 1.0 / of("pty2") if of("pty2") else 0.0),
        of("pky3") * of("lgay"),
    )


def relaxation_lengths(
    load: float, gamma: float, k_x: float, k_y: float, s: tuple[float, ...]
) -> tuple[float, float]:
    """Return the relaxation lengths [m] of F_x and F_y.

        6:    K_x / C_x, -K_y / C_y     C = C_0 (1 + PCF1 df + PCF2 df^2) (1 + PCF3 dp)
        5.2:  F_z (PTX1 + PTX2 df) exp(-PTX3 df) R_0 / F_z0 LSGKP,
              PTY1 sin(2 atan(F_z / (PTY2 F_z0'))) (1 - PKY3 |gamma|) R_0 LFZO LSGAL

    A set without these coefficients has the default length.

    Args:
        load, gamma: vertical load [N] and camber [rad].
        k_x, k_y: slip stiffness [N] and cornering stiffness [N/rad] at that load.
        s: from `relaxation_set`.
    """
    (
        six, otherwise, load_scale, c_x, x1, x2, c_y, y1, y2, t1, t2, t3, per_load, largest, at, k3,
    ) = s  # fmt: skip
    df = load * load_scale - 1.0
    if six:
        c_x *= 1.0 + df * (x1 + x2 * df)
        c_y *= 1.0 + df * (y1 + y2 * df)
        along = k_x / c_x if c_x > 0.0 else otherwise
        across = abs(k_y) / c_y if c_y > 0.0 else otherwise
    else:
        along = load * (t1 + t2 * df) * exp(-t3 * df) * per_load if t1 else otherwise
        across = otherwise
        if largest:
            across = largest * sin(2.0 * atan(load * load_scale * at)) * (1.0 - k3 * abs(gamma))
    return max(along, SHORTEST), max(across, SHORTEST)
