"""The road from above: positions of a car, its lanes and the ground, from signals and parameters."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from itertools import chain, pairwise, product
from math import floor
from typing import Any, NamedTuple

import numpy as np

from yawbench.foundation.messages import listed
from yawbench.metrics.expressions import columns_of
from yawbench.orchestrator.results.reader import Results
from yawbench.orchestrator.results.run_record import RunStatus
from yawbench.vocabulary.friction_table import FrictionTable, table_of
from yawbench.vocabulary.lane_change import lanes_of
from yawbench.vocabulary.patches import Patch, Point, Span, patches_of
from yawbench.vocabulary.wheels import WHEELS

OVERHANG_FRONT, OVERHANG_REAR = 0.85, 1.0
"""Overhangs beyond the axles [m], if the driver has no dimensions of the car; chosen: a saloon."""
BESIDE = 0.2
"""Width of the body minus track width [m]; chosen: a tyre's width."""
USUAL = {"cg_to_front_axle": 1.3, "cg_to_rear_axle": 1.4, "track_width": 1.55}
"""Dimensions for a plant that has none [m]; chosen: a mid-size car."""
NAMED = 6
"""Number of ground frictions listed in the legend; if there are more, only the range is given."""

POSE = {"x": "position_x", "y": "position_y", "yaw": "yaw_angle"}
MOTION = (
    "velocity_x", "velocity_y", "sideslip", "yaw_rate", "steer_angle", "yaw_moment", "cone_overrun",
    "path_offset",
)  # fmt: skip
OF_WHEELS = ("force_along", "force_across", "load", "friction")
"""Signals of each wheel that `road_of` draws."""


@dataclass(frozen=True)
class CarOutline:
    """A car seen from above: its axles and ends from the centre of mass, its widths [m]."""

    front_axle: float
    rear_axle: float
    track: float
    front_end: float
    rear_end: float
    width: float


def road_of(run: Results, grounds: list[Any]) -> dict[str, Any] | None:
    """Return the columns that the road needs, and the car's outline; None without position or yaw angle.

    Its ground is an index of `grounds`, to which a new one is added; None: none was recorded.
    """
    road: dict[str, Any] = {}
    for key, signal in POSE.items():
        columns = columns_of(run, signal)
        if not columns or not np.isfinite(run.columns[columns[0]][0]):
            return None
        road[key] = columns[0]
    road |= {signal: columns[0] for signal in MOTION if (columns := columns_of(run, signal))}
    along, across = columns_of(run, "tyre_force_x_*"), columns_of(run, "tyre_force_y_*")
    loads = columns_of(run, "vertical_load_*")
    for k, wheel in enumerate(WHEELS if along and across else ()):
        road[f"force_along_{wheel}"], road[f"force_across_{wheel}"] = along[k], across[k]
    frictions = (
        [_friction(run, wheel, tyre=run.names[along[0]].instance) for wheel in WHEELS]
        if along and loads
        else []
    )
    if frictions and None not in frictions:
        for wheel, load, friction in zip(WHEELS, loads, frictions, strict=True):
            road[f"load_{wheel}"], road[f"friction_{wheel}"] = load, friction
    car, known = _car(run)
    lanes = next(filter(None, map(lanes_of, _parameters(run, "driver"))), [])
    x, y = (run.columns[road[key]] for key in ("x", "y"))
    ends = [(float(np.nanmin(values)), float(np.nanmax(values))) for values in (x, y)]
    pieces = next(filter(None, (ground_of(parameters, *ends) for parameters in _parameters(run, "road"))), [])
    ground = [[piece.friction, piece.corners] for piece in pieces]
    if ground and ground not in grounds:
        grounds.append(ground)
    road["outline"] = {"car": asdict(car), "lanes": [list(lane) for lane in lanes]}
    road["ground"] = grounds.index(ground) if ground else None
    road["sized"] = known
    return road


def without_tyres(road: Mapping[str, Any]) -> dict[str, Any]:
    """Return the columns that the road needs without forces and friction circles of the wheels."""
    return {key: column for key, column in road.items() if key[:-3] not in OF_WHEELS}


def notes_of(run: Results, road: Mapping[str, Any] | None) -> list[str]:
    """Return notes on what cannot be drawn of a run, and why it ended early."""
    notes: list[str] = []
    if road is None:
        return notes
    if "force_along_fl" not in road:
        notes.append("tyre forces not recorded")
    elif "steer_angle" not in road:
        notes.append("steer angle not recorded: front wheels drawn straight")
    if "force_along_fl" in road and "friction_fl" not in road:
        notes.append("friction or vertical loads not recorded: no friction circles")
    if not road["sized"]:
        notes.append("the plant has no dimensions; drawing a mid-size car")
    if run.record.status not in (RunStatus.UNKNOWN, RunStatus.COMPLETED):
        notes.append(f"the run failed at {run.time[-1]:.2f} s")
    elif run.ended:
        notes.append(run.ended)
    return notes


def legend_of(roads: Sequence[Mapping[str, Any] | None], grounds: Sequence[Any]) -> str:
    """Return the legend of the symbols on the road."""
    drawn = {name for road in roads for name in road or ()}
    symbols = (
        ("path_offset", "grey dashes: the driver's path"),
        ("friction_fl", "circles: friction times load"),
        ("force_along_fl", "arrows: tyre forces" + (", in % of it" if "friction_fl" in drawn else "")),
        ("sideslip", "arrow from the centre of mass: its direction of motion"),
        ("yaw_moment", "grey arc: requested yaw moment"),
    )
    parts = [text for name, text in symbols if name in drawn]
    frictions = sorted({friction for ground in grounds for friction, _ in ground})
    if frictions:
        numbers = [f"{mu:g}" for mu in frictions]
        values = listed(numbers) if len(numbers) <= NAMED else f"{numbers[0]} to {numbers[-1]}"
        parts.append(f"ground: the bluer the more slippery, friction {values}")
    key = "; ".join(parts)
    return f"{key[:1].upper()}{key[1:]}." if key else ""


def _friction(run: Results, wheel: str, *, tyre: str) -> str | float | None:
    """Return the column of the friction at a wheel, or the number that is constant for the tyre."""
    if columns := columns_of(run, f"friction_{wheel}"):
        return columns[0]
    fmu = run.record.fmus.get(tyre)
    constants = fmu.constants if fmu else {}
    friction = constants.get(f"friction_{wheel}", constants.get("friction"))
    return float(friction) if isinstance(friction, (int, float)) else None


def _parameters(run: Results, role: str) -> Iterator[Mapping[str, Any]]:
    """Yield the parameters of the instances with a role."""
    for instance in run.instances_of_role(role):
        fmu = run.record.fmus[instance]
        yield {**fmu.defaults, **fmu.parameters}


def _car(run: Results) -> tuple[CarOutline, bool]:
    """Return the car's outline, and whether the plant has any of its dimensions."""
    sizes: dict[str, float] = {}
    for parameters in _parameters(run, "plant"):
        sizes |= {
            name: float(value)
            for name, value in parameters.items()
            if name in USUAL and isinstance(value, (int, float)) and math.isfinite(value) and value > 0
        }
    front, rear, track = (sizes.get(name, usual) for name, usual in USUAL.items())
    ends = {"front": front + OVERHANG_FRONT, "rear": rear + OVERHANG_REAR, "width": track + BESIDE}
    for parameters in _parameters(run, "driver"):  # the cones are judged with the driver's dimensions
        if lanes_of(parameters):
            ends["width"] = float(parameters["vehicle_width"])
            ends["front"] = float(parameters.get("cg_to_front_end", ends["front"]))
            ends["rear"] = float(parameters.get("cg_to_rear_end", ends["rear"]))
    return CarOutline(front, rear, track, ends["front"], ends["rear"], ends["width"]), bool(sizes)


# ---- friction by place ----

AROUND = (50.0, 25.0)
"""Ground drawn beyond the car's path along x and y [m]; chosen: about the visible surroundings."""
POLYGONS = 4000
"""Largest number of polygons; chosen: a 2 m chequerboard of 200 m by 60 m, which browsers draw at once."""

Bounds = tuple[float, float]


class FrictionPatch(NamedTuple):
    """A polygon of constant friction."""

    friction: float
    corners: tuple[Point, ...]


def ground_of(parameters: Mapping[str, Any], x: Bounds, y: Bounds) -> list[FrictionPatch]:
    """Return the polygons around a path within x[0] to x[1], y[0] to y[1] [m], in drawing order.

    Empty without patches and table, or if there would be more than `POLYGONS` polygons.
    """
    text, base, patch = (parameters.get(name) for name in ("patches", "base_friction", "patch_friction"))
    if not isinstance(text, str) or not isinstance(base, (int, float)) or not isinstance(patch, (int, float)):
        return []
    patches, table = patches_of(text), table_of(str(parameters.get("friction_table") or ""))
    box = tuple((low - more, high + more) for (low, high), more in zip((x, y), AROUND, strict=True))
    pieces = [FrictionPatch(float(base), _rectangle(*box))]
    try:
        for friction, corners in chain(_of_table(table, box), _of_patches(patches, float(patch), box)):
            pieces.append(FrictionPatch(friction, corners))
            if len(pieces) > POLYGONS:
                return []
    except _TooFineError:
        return []
    return pieces if len(pieces) > 1 or patches or table else []


class _TooFineError(Exception):
    """Error: more intervals than can be drawn."""


def _of_table(table: FrictionTable | None, box: Sequence[Bounds]) -> Iterator[FrictionPatch]:
    """Yield for every point of a table the area nearest to it, within a box."""
    if table is None:
        return
    along, across = (_around(axis, within) for axis, within in zip((table.x, table.y), box, strict=True))
    for (j, y), (i, x) in product(across, along):
        yield FrictionPatch(table.rows[j][i], _rectangle(x, y))


def _around(places: Sequence[float], within: Bounds) -> list[tuple[int, Bounds]]:
    """Return (index, interval between midpoints) of the positions whose interval overlaps `within`."""
    middles = [0.5 * (a + b) for a, b in pairwise(places)]
    edges = np.clip([places[0], *middles, places[-1]], *within).tolist()
    return [(i, (a, b)) for i, (a, b) in enumerate(pairwise(edges)) if a < b]


def _of_patches(patches: Iterable[Patch], otherwise: float, box: Sequence[Bounds]) -> Iterator[FrictionPatch]:
    """Yield the parts of patches within a box; `otherwise`: friction of patches that state none."""
    for patch in patches:
        for corners in _polygons(patch, box):
            yield FrictionPatch(otherwise if patch.friction is None else patch.friction, corners)


def _polygons(patch: Patch, box: Sequence[Bounds]) -> Iterable[tuple[Point, ...]]:
    """Yield the parts of a patch within a box."""
    along, across = (_intervals((s for s in patch.spans if s.axis == axis), box[axis]) for axis in (0, 1))
    for x, y in product(along, across):
        corners = clipped(patch.corners, x, y) if patch.corners else _rectangle(x, y)
        if corners:
            yield corners


def _intervals(spans: Iterable[Span], within: Bounds) -> list[Bounds]:
    """Return the intervals within `within` in which all spans of an axis hold."""
    intervals = [within]
    for _, low, high, period in spans:
        if period:
            if (within[1] - within[0]) / period * len(intervals) > POLYGONS:
                raise _TooFineError
            first, last = (floor(end / period) for end in within)
            low, high = max(low, 0.0), min(high, period)
            held = [(k * period + low, k * period + high) for k in range(first, last + 1)]
        else:
            held = [(low, high)]
        pairs = [(max(a, c), min(b, d)) for (a, b), (c, d) in product(intervals, held)]
        intervals = [(a, b) for a, b in pairs if a < b]
    return intervals


def _rectangle(x: Bounds, y: Bounds) -> tuple[Point, ...]:
    return ((x[0], y[0]), (x[1], y[0]), (x[1], y[1]), (x[0], y[1]))


def clipped(corners: Sequence[Point], x: Bounds, y: Bounds) -> tuple[Point, ...]:
    """Return the part of a polygon within a rectangle."""
    from matplotlib.path import Path
    from matplotlib.transforms import Bbox

    closed = Path([*corners, corners[0]], closed=True)
    inside = closed.clip_to_bbox(Bbox.from_extents(x[0], y[0], x[1], y[1]))
    return tuple((a, b) for a, b in np.asarray(inside.vertices)[:-1].tolist())
