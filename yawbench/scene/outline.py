"""The outline of a run's car, its lanes and its ground: geometry from recorded parameters."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from yawbench.orchestrator.results.reader import Results
from yawbench.vocabulary.lane_change import Lane, lanes_of

from .ground import Bounds, FrictionPatch, ground_of

OVERHANG_FRONT, OVERHANG_REAR, HEIGHT, RADIUS, CENTRE = 0.85, 1.0, 1.45, 0.31, 0.55
"""Overhangs beyond the axles, height of the body, radius of the wheels, height of the centre of mass [m] of a
car of which they are not known; chosen: a saloon."""
BESIDE = 0.2
"""Width of the body minus track width [m]; chosen: a tyre's width."""
USUAL = {"cg_to_front_axle": 1.3, "cg_to_rear_axle": 1.4, "track_width": 1.55}
"""Dimensions for a plant that has none [m]; chosen: a mid-size car."""
CONES = 5.0
"""Distance between cones at most [m]; chosen: told apart from a wall."""


@dataclass(frozen=True)
class CarOutline:
    """A car's dimensions [m]: axles and ends from the centre of mass, widths and heights."""

    front_axle: float
    rear_axle: float
    track: float
    front_end: float
    rear_end: float
    width: float
    height: float
    radius: float  # of the wheels
    centre: float  # height of the centre of mass
    pivot: float  # height of the point about which the body turns, above the car's position
    wheels_turn: bool  # whether the axles turn about it as well


@dataclass(frozen=True)
class Places:
    """Where a run takes place.

    Attributes:
        lanes: between cones, from x = start to end, y = right to left [m].
        ground: polygons of constant friction with corners x, y [m], the later above the earlier.
    """

    lanes: tuple[Lane, ...] = ()
    ground: tuple[FrictionPatch, ...] = ()

    @property
    def cones(self) -> list[tuple[float, float]]:
        """Places x, y [m] of cones on the borders of the lanes, at most `CONES` apart."""
        return [
            (lane.start + (lane.end - lane.start) * k / pieces, side)
            for lane in self.lanes
            for pieces in [math.ceil((lane.end - lane.start) / CONES)]
            for k in range(pieces + 1)
            for side in (lane.left, lane.right)
        ]

    def record(self) -> dict[str, Any]:
        """Return its entry in run.json, "" of keys without content."""
        found = {
            "lanes": [lane._asdict() for lane in self.lanes],
            "ground": [piece._asdict() for piece in self.ground],
        }
        return {name: pieces for name, pieces in found.items() if pieces}


def places_of(run: Results, x: Bounds, y: Bounds) -> Places:
    """Return the lanes and ground of a run whose path lies within x[0] to x[1], y[0] to y[1] [m]."""
    lanes: Sequence[Lane] = next(filter(None, map(lanes_of, parameters_of(run, "driver"))), [])
    grounds = (ground_of(parameters, x, y) for parameters in parameters_of(run, "road"))
    return Places(tuple(lanes), tuple(next(filter(None, grounds), [])))


def parameters_of(run: Results, role: str) -> Iterator[Mapping[str, Any]]:
    """Yield the parameters of the instances with a role."""
    for instance in run.instances_of_role(role):
        fmu = run.record.fmus[instance]
        yield {**fmu.defaults, **fmu.parameters}


def fed(results: Results, instance: str, variable: str) -> str | None:
    """Return the recorded column that feeds an input; None if it is not recorded, or nothing does."""
    for wire in results.record.connections:
        if (wire.target.instance, wire.target.variable) == (instance, variable):
            return str(wire.source) if str(wire.source) in results.columns else None
    return None


def numbers_of(parameters: Mapping[str, Any]) -> dict[str, float]:
    """Return the parameters that are finite numbers above zero."""
    return {
        name: float(value)
        for name, value in parameters.items()
        if isinstance(value, (int, float)) and not isinstance(value, bool) and 0 < value < math.inf
    }


def outline_of(run: Results) -> tuple[CarOutline, bool]:
    """Return the car's outline, and whether the plant has any of its dimensions.

    Its ends and width are those of the driver where it drives between cones, which are judged with them, else
    those of the vehicle file, else chosen.
    """
    sizes: dict[str, float] = {}
    for parameters in parameters_of(run, "plant"):
        sizes |= numbers_of(parameters)
    front, rear, track = (sizes.get(name, usual) for name, usual in USUAL.items())
    file = numbers_of(run.record.scenario.get("vehicle_parameters", {}))
    ends = {
        "front": front + file.get("front_overhang", OVERHANG_FRONT),
        "rear": rear + _rear_overhang(file, front + rear),
        "width": file.get("vehicle_width", track + BESIDE),
    }
    for parameters in parameters_of(run, "driver"):
        if lanes_of(parameters):
            ends["width"] = float(parameters["vehicle_width"])
            ends["front"] = float(parameters.get("cg_to_front_end", ends["front"]))
            ends["rear"] = float(parameters.get("cg_to_rear_end", ends["rear"]))
    centre = sizes.get("cg_height", CENTRE)
    on_tyres = "tyre_vertical_stiffness" in sizes  # `cars.ride`: all parts turn about the centre of mass
    return CarOutline(
        front,
        rear,
        track,
        ends["front"],
        ends["rear"],
        ends["width"],
        file.get("vehicle_height", HEIGHT),
        sizes.get("wheel_radius", RADIUS),
        centre,
        centre if on_tyres else max(centre - sizes.get("roll_arm", centre), 0.0),
        on_tyres,
    ), any(name in sizes for name in USUAL)


def _rear_overhang(file: Mapping[str, float], wheelbase: float) -> float:
    if "rear_overhang" in file:
        return file["rear_overhang"]
    rest = file.get("vehicle_length", 0.0) - wheelbase - file.get("front_overhang", OVERHANG_FRONT)
    return rest if rest > 0 else OVERHANG_REAR
