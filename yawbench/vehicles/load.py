"""A load in the car: what it makes of the mass, the centres of mass and the inertias of a vehicle file.

The load is a point mass, carried by the springs, at x ahead of the centre of mass of the car without it and
z above the road (ISO 8855), in the middle of the car. Masses add, moments of mass about the old centre give
the new one, and inertias follow from the theorem of parallel axes for two bodies (Meriam, Kraige, Bolton,
Engineering Mechanics: Dynamics, 8th edition, appendix B). Wheels, springs and the wheelbase stay as they are,
and so does the height of the roll axis.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass

from yawbench.foundation.messages import listed, short
from yawbench.orchestrator.scenario.quantities import convert
from yawbench.vocabulary.gravity import G

from .derivations import car_of

LOAD = "load"
"""Name of the load among the quantities of a vehicle file."""
_FORM = re.compile(r"(?P<mass>[^()]+?)\s+at\s+\((?P<x>[^(),]+),(?P<z>[^(),]+)\)")
AFFECTED = (
    "mass", "sprung_mass", "cg_to_front_axle", "cg_to_rear_axle", "front_load_share", "cg_height",
    "sprung_cg_height", "sprung_cg_offset", "yaw_inertia", "sprung_yaw_inertia", "roll_inertia",
    "sprung_roll_inertia", "sprung_pitch_inertia", "sprung_roll_yaw_product", "roll_arm", "roll_axis_height",
    "static_load_front", "static_load_rear",
)  # fmt: skip
"""Quantities that a load changes."""


@dataclass(frozen=True)
class Load:
    """A mass [kg] at x and z [m]."""

    mass: float
    x: float
    z: float

    def __str__(self) -> str:
        return f"{self.mass:g} kg at ({self.x:g} m, {self.z:g} m)"


def load_of(text: object) -> Load:
    """Return the load written as `300 kg at (-0.8 m, 0.9 m)`; numbers without a unit are in kg and m.

    Raises:
        ValueError: the text is not of that form, or the mass is negative.
    """
    found = _FORM.fullmatch(str(text).strip())
    if found is None:
        raise ValueError(f"must be a mass at (x, z), such as 300 kg at (-0.8 m, 0.9 m) (got {short(text)})")
    mass, x, z = (
        float(convert(found[key].strip() if not _plain(found[key]) else f"{found[key].strip()} {unit}", unit))
        for key, unit in (("mass", "kg"), ("x", "m"), ("z", "m"))
    )
    if mass < 0.0:
        raise ValueError(f"must have a mass of at least 0 kg (got {short(text)})")
    return Load(mass, x, z)


def _plain(text: str) -> bool:
    return re.fullmatch(r"\s*[-+]?[\d.]+(e[-+]?\d+)?\s*", text) is not None


def loaded(given: Mapping[str, float], load: Load) -> dict[str, float]:
    """Return the given quantities of a car with a load.

    Args:
        given: name of `CAR` -> value in SI, of the car without it.
        load: the load.

    Raises:
        ValueError: what is given does not tell how the load changes it.
    """
    known, new = car_of(given).values, dict[str, float]()
    m, x, z = load.mass, load.x, load.z
    if lacking := [name for name in ("mass", "cg_to_front_axle", "cg_to_rear_axle") if name not in known]:
        raise ValueError(f"needs {listed(lacking)} in the vehicle file, or what they follow from")
    mass, a, b = known["mass"], known["cg_to_front_axle"], known["cg_to_rear_axle"]
    whole = mass + m
    moved = m * x / whole  # forward, of the centre of mass
    new |= {"mass": whole, "cg_to_front_axle": a - moved, "cg_to_rear_axle": b + moved}
    new["front_load_share"] = (b + moved) / (a + b)
    new["static_load_front"] = 0.5 * whole * G * (b + moved) / (a + b)
    new["static_load_rear"] = 0.5 * whole * G * (a - moved) / (a + b)
    if "cg_height" in known:
        new["cg_height"] = (mass * known["cg_height"] + m * z) / whole
    if "yaw_inertia" in known:
        new["yaw_inertia"] = known["yaw_inertia"] + m * mass / whole * x * x
    if "sprung_mass" in known:
        new |= _of_body(known, load, moved)
    if unclear := [name for name in AFFECTED if name in given and name not in new]:
        raise ValueError(f"changes {listed(unclear)}, which the vehicle file does not tell enough about")
    tilted = {"sprung_roll_yaw_product"} if "sprung_roll_inertia" in known else set()  # else of no meaning
    return {**given, **{name: value for name, value in new.items() if name in {*given, *tilted}}}


def _of_body(known: Mapping[str, float], load: Load, moved: float) -> dict[str, float]:
    """Return the quantities of the sprung mass with a load; `moved`: of the car's centre of mass, forward."""
    body, m = known["sprung_mass"], load.mass
    whole = body + m
    reduced, new = body * m / whole, {"sprung_mass": whole}
    ahead = load.x - known["sprung_cg_offset"] if "sprung_cg_offset" in known else None
    above = load.z - known["sprung_cg_height"] if "sprung_cg_height" in known else None
    if ahead is not None:
        new["sprung_cg_offset"] = known["sprung_cg_offset"] + m * ahead / whole - moved
        if "sprung_yaw_inertia" in known:
            new["sprung_yaw_inertia"] = known["sprung_yaw_inertia"] + reduced * ahead * ahead
    if above is not None:
        raised = m * above / whole
        new["sprung_cg_height"] = known["sprung_cg_height"] + raised
        if "sprung_roll_inertia" in known:
            new["sprung_roll_inertia"] = known["sprung_roll_inertia"] + reduced * above * above
        for name in ("roll_arm", "roll_axis_height"):
            if name in known:
                new[name] = known[name] + raised
        if "roll_inertia" in known and "roll_arm" in known:
            arm = above + known["roll_arm"]  # of the load, above the roll axis
            new["roll_inertia"] = known["roll_inertia"] + m * arm * arm
    if ahead is not None and above is not None:
        if "sprung_pitch_inertia" in known:
            about = ahead * ahead + above * above
            new["sprung_pitch_inertia"] = known["sprung_pitch_inertia"] + reduced * about
        new["sprung_roll_yaw_product"] = known.get("sprung_roll_yaw_product", 0.0) + reduced * ahead * above
    return new
