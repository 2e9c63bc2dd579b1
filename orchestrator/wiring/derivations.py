"""What follows from a vehicle file's values: one table of name, formula, inputs.

A car is described once, by what is known of it; every unit takes what it declares. What the file does not
give is derived where a formula here has all that it needs, also from what was derived before; the first that
fits is taken. A formula whose result the file gives as well must agree with it.

All are identities of masses, distances and inertias, but for two that say so in their formula: the one track
of a plant is the mean of two, and the roll stiffness and damping of an axle are those of springs and dampers
in series with the tyres (Milliken, Race Car Vehicle Dynamics, 1995, section 16.2), exact for slow roll about
an axis on the road.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

from vocabulary.gravity import G
from vocabulary.vehicle import CAR

AGREES = 0.01
"""Relative difference of what is given from what follows. Chosen: rounding of data sheets."""


class Derivation(NamedTuple):
    """How a quantity follows from others."""

    name: str
    formula: str
    """In the names of the quantities, as people read it."""
    inputs: tuple[str, ...]
    value: Callable[..., float]


def in_series(stiffness: float, bar: float, track: float, tyre: float) -> tuple[float, float]:
    """Return an axle's roll stiffness on its tyres [N.m/rad] and the tyres' part in it [1]."""
    springs, tyres = 0.5 * track * track * (stiffness + 2.0 * bar), 0.5 * track * track * tyre
    part = tyres / (springs + tyres)
    return springs * part, part


def _roll_stiffness(axle: str) -> Derivation:
    return Derivation(
        f"roll_stiffness_{axle}",
        "springs and anti-roll bar in series with the tyres, d^2/2 (k + 2 s) k_t / (k + 2 s + k_t)",
        (f"spring_stiffness_{axle}", f"anti_roll_stiffness_{axle}", "track_width", "tyre_vertical_stiffness"),
        lambda k, s, d, k_t: in_series(k, s, d, k_t)[0],
    )


def _roll_damping(axle: str) -> Derivation:
    return Derivation(
        f"roll_damping_{axle}",
        "dampers in series with the tyres, d^2/2 c (k_t / (k + 2 s + k_t))^2",
        (
            f"spring_stiffness_{axle}",
            f"anti_roll_stiffness_{axle}",
            "track_width",
            "tyre_vertical_stiffness",
            f"damping_{axle}",
        ),
        lambda k, s, d, k_t, c: 0.5 * d * d * c * in_series(k, s, d, k_t)[1] ** 2,
    )


def _wheels(m_u: float, share: float, a: float, b: float, d: float) -> float:
    """Return the yaw inertia [kg.m2] of four point masses at the wheels about the car's centre of mass."""
    return m_u * (share * a * a + (1.0 - share) * b * b + 0.25 * d * d)


DERIVATIONS = (
    Derivation(
        "unsprung_mass",
        "unsprung_mass_front + unsprung_mass_rear",
        ("unsprung_mass_front", "unsprung_mass_rear"),
        lambda f, r: f + r,
    ),
    Derivation("mass", "sprung_mass + unsprung_mass", ("sprung_mass", "unsprung_mass"), lambda s, u: s + u),
    Derivation("unsprung_mass", "mass - sprung_mass", ("mass", "sprung_mass"), lambda m, m_s: m - m_s),
    Derivation("sprung_mass", "mass - unsprung_mass", ("mass", "unsprung_mass"), lambda m, u: m - u),
    Derivation(
        "unsprung_mass_front",
        "unsprung_mass - unsprung_mass_rear",
        ("unsprung_mass", "unsprung_mass_rear"),
        lambda u, r: u - r,
    ),
    Derivation(
        "front_unsprung_share",
        "unsprung_mass_front / unsprung_mass",
        ("unsprung_mass_front", "unsprung_mass"),
        lambda f, u: f / u,
    ),
    Derivation(
        "wheelbase",
        "cg_to_front_axle + cg_to_rear_axle",
        ("cg_to_front_axle", "cg_to_rear_axle"),
        lambda a, b: a + b,
    ),
    Derivation(
        "cg_to_front_axle",
        "(1 - front_load_share) wheelbase",
        ("front_load_share", "wheelbase"),
        lambda share, wheelbase: (1.0 - share) * wheelbase,
    ),
    Derivation(
        "cg_to_front_axle",
        "wheelbase - cg_to_rear_axle",
        ("wheelbase", "cg_to_rear_axle"),
        lambda wheelbase, b: wheelbase - b,
    ),
    Derivation(
        "cg_to_rear_axle",
        "wheelbase - cg_to_front_axle",
        ("wheelbase", "cg_to_front_axle"),
        lambda wheelbase, a: wheelbase - a,
    ),
    Derivation(
        "track_width",
        "mean of track_width_front and track_width_rear",
        ("track_width_front", "track_width_rear"),
        lambda f, r: 0.5 * (f + r),
    ),
    Derivation(
        "cg_height",
        "(sprung_mass sprung_cg_height + unsprung_mass unsprung_height) / mass",
        ("sprung_mass", "sprung_cg_height", "unsprung_mass", "unsprung_height", "mass"),
        lambda m_s, h_s, m_u, h_u, m: (m_s * h_s + m_u * h_u) / m,
    ),
    Derivation(
        "sprung_cg_height",
        "(mass cg_height - unsprung_mass unsprung_height) / sprung_mass",
        ("mass", "cg_height", "unsprung_mass", "unsprung_height", "sprung_mass"),
        lambda m, h, m_u, h_u, m_s: (m * h - m_u * h_u) / m_s,
    ),
    Derivation(
        "sprung_cg_offset",
        "(unsprung_mass_rear cg_to_rear_axle - unsprung_mass_front cg_to_front_axle) / sprung_mass",
        ("unsprung_mass", "front_unsprung_share", "cg_to_front_axle", "cg_to_rear_axle", "sprung_mass"),
        lambda m_u, share, a, b, m_s: m_u * ((1.0 - share) * b - share * a) / m_s,
    ),
    Derivation(
        "yaw_inertia",
        "sprung_yaw_inertia + wheels and sprung mass at their distances from the centre of mass",
        (
            *("sprung_yaw_inertia", "sprung_mass", "sprung_cg_offset"),
            *("unsprung_mass", "front_unsprung_share", "cg_to_front_axle", "cg_to_rear_axle", "track_width"),
        ),
        lambda i, m_s, e, *wheels: i + m_s * e * e + _wheels(*wheels),
    ),
    Derivation(
        "roll_axis_height",
        "between the roll centres, below the centre of the sprung mass",
        (
            *("roll_centre_height_front", "roll_centre_height_rear"),
            *("cg_to_front_axle", "cg_to_rear_axle", "sprung_cg_offset"),
        ),
        lambda f, r, a, b, e: ((b + e) * f + (a - e) * r) / (a + b),
    ),
    Derivation(
        "roll_arm",
        "sprung_cg_height - roll_axis_height",
        ("sprung_cg_height", "roll_axis_height"),
        lambda h_s, axis: h_s - axis,
    ),
    Derivation(
        "roll_inertia",
        "sprung_roll_inertia + sprung_mass roll_arm^2",
        ("sprung_roll_inertia", "sprung_mass", "roll_arm"),
        lambda i, m_s, arm: i + m_s * arm * arm,
    ),
    Derivation(
        "sprung_roll_inertia",
        "roll_inertia - sprung_mass roll_arm^2",
        ("roll_inertia", "sprung_mass", "roll_arm"),
        lambda i, m_s, arm: i - m_s * arm * arm,
    ),
    _roll_stiffness("front"),
    _roll_stiffness("rear"),
    Derivation(
        "roll_stiffness",
        "roll_stiffness_front + roll_stiffness_rear, each in series with its tyres",
        ("roll_stiffness_front", "roll_stiffness_rear"),
        lambda f, r: f + r,
    ),
    Derivation(
        "front_roll_share",
        "roll_stiffness_front / (roll_stiffness_front + roll_stiffness_rear)",
        ("roll_stiffness_front", "roll_stiffness_rear"),
        lambda f, r: f / (f + r),
    ),
    _roll_damping("front"),
    _roll_damping("rear"),
    Derivation(
        "roll_damping",
        "roll_damping_front + roll_damping_rear, each in series with its tyres",
        ("roll_damping_front", "roll_damping_rear"),
        lambda f, r: f + r,
    ),
    Derivation(
        "static_load_front",
        "mass g cg_to_rear_axle / (2 wheelbase)",
        ("mass", "cg_to_rear_axle", "wheelbase"),
        lambda m, b, wheelbase: 0.5 * m * G * b / wheelbase,
    ),
    Derivation(
        "static_load_rear",
        "mass g cg_to_front_axle / (2 wheelbase)",
        ("mass", "cg_to_front_axle", "wheelbase"),
        lambda m, a, wheelbase: 0.5 * m * G * a / wheelbase,
    ),
)
NEUTRAL = {"front_unsprung_share": 0.5}
"""What a formula takes where nothing gives a quantity: as the plants have it, equal wheels."""


@dataclass(frozen=True)
class Car:
    """What is known of a car: numbers in SI by name, and of those that were derived the formula."""

    values: dict[str, float]
    formulas: dict[str, str] = field(default_factory=dict)
    used: frozenset[str] = frozenset()
    """Names that formulas were made of."""


def car_of(given: Mapping[str, float]) -> Car:
    """Return all that follows from what is given of a car.

    Args:
        given: name of `CAR` -> value in SI.
    """
    values, formulas, used = dict(given), dict[str, str](), set[str]()
    found = True
    while found:
        found = False
        for one in DERIVATIONS:
            inputs = [values.get(name, NEUTRAL.get(name)) for name in one.inputs]
            if one.name in values or None in inputs or not (value := _number(one, inputs)):
                continue
            values[one.name], formulas[one.name] = value[0], one.formula
            used.update(one.inputs)
            found = True
    return Car(values, formulas, frozenset(used))


def contradictions(given: Mapping[str, float]) -> list[tuple[str, str]]:
    """Return the (name, sentence) of every value that does not agree with what follows from the others.

    Of formulas between the same quantities the first counts.
    """
    known = car_of(given).values
    found, seen = [], set()
    for one in DERIVATIONS:
        among = frozenset((one.name, *one.inputs))
        if among in seen or one.name not in given or not all(name in known for name in one.inputs):
            continue
        seen.add(among)
        value = _number(one, [known[name] for name in one.inputs])
        if value and abs(value[0] - given[one.name]) > AGREES * max(abs(value[0]), abs(given[one.name])):
            measure = CAR[one.name].unit
            unit = "" if measure == "1" else f" {measure}"
            found.append(
                (
                    one.name,
                    f"{given[one.name]:.6g}{unit} contradicts {one.formula} = {value[0]:.6g}{unit}: "
                    "leave one of them out",
                )
            )
    return found


def _number(one: Derivation, inputs: Sequence[float | None]) -> tuple[float] | None:
    """Return the value in a tuple, None where there is none: a car that weighs nothing."""
    try:
        return (float(one.value(*inputs)),)
    except (ZeroDivisionError, OverflowError):
        return None
