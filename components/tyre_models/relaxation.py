"""The lag of tyre forces behind slip: the deflection of the carcass, a state over the distance rolled.

The contact patch is carried along by the ground and held by the carcass. Its deflection u grows with the slip
speed s and is rolled away over the relaxation length sigma,

    du/dt = s - V u / sigma,        slip of the contact patch = u / sigma

so in steady rolling it has the slip s / V of the wheel, and at rest the tyre is a spring. Over a step with
held s, V and sigma this is solved exactly, z = V h / sigma:

    u_end = u exp(-z) + s h (1 - exp(-z)) / z

Contact that slides holds no more than its grip, which limits the deflection of a slow wheel (`gripped`).
"""

from math import atan, exp, expm1, hypot, sin
from typing import Any

from .pacejka_2012_set import of_axle

SHORTEST = 0.02
"""Relaxation lengths [m] are not below this: a hardly loaded tyre; chosen: less than a contact patch has."""

SLIDES = 3.0
"""K slip over mu F_z from which on all of the contact slides: the brush model's (Pacejka, section 3.2)."""


def gripped(of_patch: tuple[float, float], of_wheel: tuple[float, float], grip: float) -> float:
    """Return the part [1] of a deflection that the contact holds.

    All of it up to the grip; beyond, as much as the wheel's own slip points in its direction. So a wheel that
    keeps sliding keeps its deflection, and one that stops or turns about loses what no contact could hold.

    Args:
        of_patch, of_wheel: slips of the contact patch and the wheel, each times its stiffness, x and y [N].
        grip: deflecting force that is held [N].
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
        s, v: slip speed and speed of rolling, not negative, held [m/s].
        sigma: relaxation length, positive [m].
    """
    z = v * h / sigma
    return u * exp(-z) + s * h * part(z)


def part(z: float) -> float:
    """Return (1 - exp(-z)) / z."""
    return -expm1(-z) / z if z > 1e-9 else 1.0 - 0.5 * z


def relaxation_set(p: Any, axle: str) -> tuple[float, ...]:
    """Return what `relaxation_lengths` needs of the parameters `p` on the axle "front" or "rear"."""

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

    A set that says nothing has the length chosen for this case.

    Args:
        load, gamma: vertical load [N] and camber [rad].
        k_x, k_y: slip stiffness [N] and cornering stiffness [N/rad] at that load.
        s: what `relaxation_set` returned.
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
