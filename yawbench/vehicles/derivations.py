"""Formulas that derive quantities of a car from those that its vehicle file gives.

A vehicle file describes a car by the quantities that are known; every instance takes those that it declares
as parameters. A quantity that the file does not give is derived by the first formula whose inputs are
known, given or derived. If the file gives the result of a formula as well, the two must agree.

All formulas are identities of masses, distances and inertias, with two exceptions, which their text states:
the single track width of a plant is the mean of two, and the roll stiffness and damping of an axle are those
of springs and dampers in series with the tyres (Milliken, Race Car Vehicle Dynamics, 1995, section 16.2),
exact for slow roll about an axis on the road.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache, lru_cache
from typing import NamedTuple

from yawbench.fmus.fmu import Value, Variable
from yawbench.orchestrator.wiring.parameters import value_for
from yawbench.vocabulary.gravity import G

from .quantities import CAR

STIFFNESSES = ("cornering_stiffness_front", "cornering_stiffness_rear")
STATIC_LOADS = ("static_load_front", "static_load_rear")
"""Quantities of the car at which the `STIFFNESSES` of its tyres are measured."""
AGREES = 0.01
"""Tolerated relative difference between a given and a derived value. Chosen: rounding of data sheets."""


class Derivation(NamedTuple):
    """A formula that derives a quantity from others."""

    name: str
    formula: str
    """The formula as shown to users."""
    inputs: tuple[str, ...]
    value: Callable[..., float]


def in_series(stiffness: float, bar: float, track: float, tyre: float) -> tuple[float, float]:
    """Return an axle's roll stiffness with its tyres [N.m/rad], and its ratio to that without them [1]."""
    springs, tyres = 0.5 * track * track * (stiffness + 2.0 * bar), 0.5 * track * track * tyre
    part = tyres / (springs + tyres)
    return springs * part, part


def of_points(mass: float, share: float, a: float, b: float, track: float) -> float:
    """Return the yaw inertia [kg.m2] of four point masses at the wheels about the car's centre of mass."""
    return mass * (share * a * a + (1.0 - share) * b * b + 0.25 * track * track)


def _follows(name: str, expression: str, words: str = "") -> Derivation:
    """Return the derivation of a quantity by a Python expression in the names of others.

    `words` replace the expression in messages where it is too long to read.
    """
    known = {"g": G, "in_series": in_series, "of_points": of_points}
    inputs = tuple(symbol for symbol in compile(expression, name, "eval").co_names if symbol not in known)
    return Derivation(
        name, words or expression, inputs, eval(f"lambda {', '.join(inputs)}: {expression}", known)
    )


def _on_tyres(axle: str) -> tuple[Derivation, Derivation]:
    """Return the derivations of the roll stiffness and damping of an axle."""
    springs = f"spring_stiffness_{axle}, anti_roll_stiffness_{axle}, track_width, tyre_vertical_stiffness"
    return (
        _follows(
            f"roll_stiffness_{axle}",
            f"in_series({springs})[0]",
            "springs and anti-roll bar in series with the tyres, d^2/2 (k + 2 s) k_t / (k + 2 s + k_t)",
        ),
        _follows(
            f"roll_damping_{axle}",
            f"0.5 * track_width * track_width * damping_{axle} * in_series({springs})[1] ** 2",
            "dampers in series with the tyres, d^2/2 c (k_t / (k + 2 s + k_t))^2",
        ),
    )


DERIVATIONS = (
    _follows("unsprung_mass", "unsprung_mass_front + unsprung_mass_rear"),
    _follows("mass", "sprung_mass + unsprung_mass"),
    _follows("unsprung_mass", "mass - sprung_mass"),
    _follows("sprung_mass", "mass - unsprung_mass"),
    _follows("unsprung_mass_front", "unsprung_mass - unsprung_mass_rear"),
    _follows("front_unsprung_share", "unsprung_mass_front / unsprung_mass"),
    _follows("wheelbase", "cg_to_front_axle + cg_to_rear_axle"),
    _follows("cg_to_front_axle", "(1 - front_load_share) * wheelbase"),
    _follows("cg_to_front_axle", "wheelbase - cg_to_rear_axle"),
    _follows("cg_to_rear_axle", "wheelbase - cg_to_front_axle"),
    _follows("track_width", "0.5 * (track_width_front + track_width_rear)"),
    _follows("cg_height", "(sprung_mass * sprung_cg_height + unsprung_mass * unsprung_height) / mass"),
    _follows("sprung_cg_height", "(mass * cg_height - unsprung_mass * unsprung_height) / sprung_mass"),
    _follows(
        "sprung_cg_offset",
        "unsprung_mass * ((1 - front_unsprung_share) * cg_to_rear_axle"
        " - front_unsprung_share * cg_to_front_axle) / sprung_mass",
        "(unsprung_mass_rear * cg_to_rear_axle - unsprung_mass_front * cg_to_front_axle) / sprung_mass",
    ),
    _follows(
        "yaw_inertia",
        "sprung_yaw_inertia + sprung_mass * sprung_cg_offset * sprung_cg_offset"
        " + of_points(unsprung_mass, front_unsprung_share, cg_to_front_axle, cg_to_rear_axle, track_width)",
        "sprung_yaw_inertia + wheels and sprung mass at their distances from the centre of mass",
    ),
    _follows(
        "roll_axis_height",
        "((cg_to_rear_axle + sprung_cg_offset) * roll_centre_height_front"
        " + (cg_to_front_axle - sprung_cg_offset) * roll_centre_height_rear)"
        " / (cg_to_front_axle + cg_to_rear_axle)",
        "between the roll centres, below the centre of the sprung mass",
    ),
    _follows("roll_arm", "sprung_cg_height - roll_axis_height"),
    _follows("roll_inertia", "sprung_roll_inertia + sprung_mass * roll_arm * roll_arm"),
    _follows("sprung_roll_inertia", "roll_inertia - sprung_mass * roll_arm * roll_arm"),
    *_on_tyres("front"),
    *_on_tyres("rear"),
    _follows("roll_stiffness", "roll_stiffness_front + roll_stiffness_rear"),
    _follows("front_roll_share", "roll_stiffness_front / (roll_stiffness_front + roll_stiffness_rear)"),
    _follows("roll_damping", "roll_damping_front + roll_damping_rear"),
    _follows("static_load_front", "0.5 * mass * g * cg_to_rear_axle / wheelbase"),
    _follows("static_load_rear", "0.5 * mass * g * cg_to_front_axle / wheelbase"),
)
NEUTRAL = {"front_unsprung_share": 0.5}
"""Defaults of quantities that nothing gives, as in the plants: equal unsprung masses of both axles."""
GIVES_WAY = {
    "mass": ("sprung_mass", "unsprung_mass"),
    "sprung_mass": ("mass", "unsprung_mass"),
}
"""Changed quantity -> the one that gives way, and the one that stays: a heavier car is heavier above its
springs, not in its wheels."""


@dataclass(frozen=True)
class CarQuantities:
    """All known quantities of a car: SI values by name, and the formulas of the derived ones."""

    values: dict[str, float]
    formulas: dict[str, str] = field(default_factory=dict)
    used: frozenset[str] = frozenset()
    """Names of the quantities that formulas have used."""


def car_of(quantities: Mapping[str, float]) -> CarQuantities:
    """Derive all quantities that follow from the given ones.

    Args:
        quantities: name of `CAR` -> value in SI.
    """
    return _derived(tuple(quantities.items()))


def known_car(parameters: Mapping[str, Value]) -> CarQuantities:
    """Return the quantities of a car that follow from the (valid) values of a vehicle file."""
    of_car = {name: raw for name, raw in parameters.items() if name in CAR}
    return car_of({name: float(value_for(quantity_of(name), raw)) for name, raw in of_car.items()})


@cache
def quantity_of(name: str) -> Variable:
    """Return a parameter with the unit and limits of a quantity of a car."""
    quantity = CAR[name]
    return Variable(
        name, 0, "Real", "parameter", "fixed", quantity.unit, None, quantity.minimum, None, quantity.text
    )  # fmt: skip


@lru_cache(maxsize=1024)
def _derived(quantities: tuple[tuple[str, float], ...]) -> CarQuantities:
    values, formulas, used = dict(quantities), dict[str, str](), set[str]()
    progress = True
    while progress:
        progress = False
        for derivation in DERIVATIONS:
            inputs = [values.get(name, NEUTRAL.get(name)) for name in derivation.inputs]
            if derivation.name in values or None in inputs or not (value := _number(derivation, inputs)):
                continue
            values[derivation.name], formulas[derivation.name] = value[0], derivation.formula
            used.update(derivation.inputs)
            progress = True
    return CarQuantities(values, formulas, frozenset(used))


def adapted(
    quantities: Mapping[str, float], before: Mapping[str, float], changed: Collection[str]
) -> tuple[dict[str, float], list[str]]:
    """Return the given quantities of a car after changes, without those that give way, and what it means.

    Args:
        quantities: name of `CAR` -> value in SI, changes included.
        before: the same without them.
        changed: names of the changed ones.
    """
    after, known, follow = dict(quantities), car_of(before).values, []
    for name, (yielding, stays) in GIVES_WAY.items():
        if name in changed and yielding in after and not {yielding, stays} & {*changed} and stays in known:
            del after[yielding]
            if stays not in car_of(after).values:
                after[stays] = known[stays]
            follow.append((name, stays, yielding))
    arm = "roll_arm"
    if "cg_height" in changed and arm in after and arm not in changed and "sprung_mass" in known:
        # the wheels stay as high as they are: the sprung mass makes all of the difference
        after[arm] += (after["cg_height"] - before["cg_height"]) * known["mass"] / known["sprung_mass"]
        follow.append(("cg_height", "unsprung_height", arm))
    for name, stays in (axles := ("cg_to_front_axle", "cg_to_rear_axle")), axles[::-1]:
        if name in changed and stays not in changed and stays in after and "wheelbase" not in after:
            follow.append((name, stays, "wheelbase"))
    now, notes = car_of(after).values, []
    for name, stays, other in follow:
        unit = CAR[other].unit
        if other in now and other in known and abs(now[other] - known[other]) > 1e-9 * abs(known[other]):
            notes.append(
                f"vehicle.{name} = {after[name]:.6g} {unit}: {stays} stays as it is, so {other} becomes "
                f"{now[other]:.6g} {unit} ({known[other]:.6g} {unit} before)"
            )
    return after, notes


def contradictions(quantities: Mapping[str, float]) -> list[tuple[str, str]]:
    """Return (name, message) of every given value that disagrees with the value derived from the others.

    Of several formulas between the same quantities, only the first is checked.
    """
    known = car_of(quantities).values
    messages, checked = [], set()
    for derivation in DERIVATIONS:
        among = frozenset((derivation.name, *derivation.inputs))
        if (
            among in checked
            or derivation.name not in quantities
            or not all(name in known for name in derivation.inputs)
        ):
            continue
        checked.add(among)
        value = _number(derivation, [known[name] for name in derivation.inputs])
        if value and abs(value[0] - quantities[derivation.name]) > AGREES * max(
            abs(value[0]), abs(quantities[derivation.name])
        ):
            measure = CAR[derivation.name].unit
            unit = "" if measure == "1" else f" {measure}"
            messages.append(
                (
                    derivation.name,
                    f"{quantities[derivation.name]:.6g}{unit} contradicts {derivation.formula} = "
                    f"{value[0]:.6g}{unit}: omit one of them",
                )
            )
    return messages


def _number(derivation: Derivation, inputs: Sequence[float | None]) -> tuple[float] | None:
    """Return the derived value in a tuple (0 must stay true), None if undefined: a car without mass."""
    try:
        return (float(derivation.value(*inputs)),)
    except (ZeroDivisionError, OverflowError):
        return None
