"""The ground of a road: polygons of constant friction, from its patches and its table."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import chain, pairwise, product
from math import floor
from typing import Any, NamedTuple

import numpy as np

from yawbench.vocabulary.friction_table import FrictionTable, table_of
from yawbench.vocabulary.patches import Patch, Point, Span, patches_of

AROUND = (50.0, 25.0)
"""Ground drawn beyond the car's path along x and y [m]; chosen: about the visible surroundings."""
POLYGONS = 4000
"""Largest number of polygons; chosen: a 2 m chequerboard of 200 m by 60 m, which browsers draw at once."""

Bounds = tuple[float, float]


class FrictionPatch(NamedTuple):
    """A polygon of constant friction."""

    friction: float
    corners: tuple[tuple[float, float], ...]


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
