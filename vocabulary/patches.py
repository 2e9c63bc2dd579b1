"""Road patches: areas with another friction coefficient, written as text.

    y > 0                                    left of the line y = 0: split friction
    60 < x < 80                              from x = 60 m to 80 m: a jump down and up again
    x % 40 < 20                              20 m of every 40 m
    x % 10 < 5, y % 3 < 1.5                  both conditions, repeated every 10 m along x and 3 m along y
    (20 0) (45 0) (30 2)                     polygon with these corners x y
    0.3: y > 0; 0.1: 60 < x < 80             several patches, each with its own friction

Patches are separated by `;` or by line breaks; text after `#` is a comment. A patch without its own friction
has the road's default for patches. Later patches override earlier patches. Coordinates are those of the road
[m], with x = y = 0 where the car starts; the lower edge belongs to the patch.
"""

import re
from math import isfinite
from typing import NamedTuple

_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_FRICTION = re.compile(rf"\s*({_NUMBER})\s*:")
_SPAN = re.compile(
    rf"(?:({_NUMBER})\s*<\s*)?([xy])(?:\s*%\s*({_NUMBER}))?(?:\s*([<>])\s*({_NUMBER}))?", re.ASCII
)
_CORNER = re.compile(rf"\(\s*({_NUMBER})[\s,]\s*({_NUMBER})\s*\)\s*")
_EXAMPLES = "'y > 0', '60 < x < 80', 'x % 10 < 5, y % 3 < 1.5' or corners '(20 0) (45 0) (30 2)'"

Point = tuple[float, float]


class Span(NamedTuple):
    """Condition low <= x < high (or y), within each period if there is one (0: none) [m]."""

    axis: int  # 0: x, 1: y
    low: float
    high: float
    period: float


class Patch(NamedTuple):
    """Area of the points that meet all spans and are in the polygon, if there is one."""

    friction: float | None  # None: the road's default for patches
    spans: tuple[Span, ...]
    corners: tuple[Point, ...]

    def holds(self, point: Point) -> bool:
        """Return whether a point x, y [m] lies on the patch."""
        for axis, low, high, period in self.spans:
            place = point[axis] % period if period else point[axis]
            if not low <= place < high:
                return False
        return not self.corners or inside_polygon(point, self.corners)


def patches_of(text: str) -> tuple[Patch, ...]:
    """Parse patches, in the order of the text.

    Raises:
        ValueError: a part of the text is not a patch; the message gives examples.
    """
    parts = ";".join(line.partition("#")[0] for line in text.splitlines()).split(";")
    return tuple(_patch(part.strip()) for part in parts if part.strip())


def friction_at(point: Point, patches: tuple[Patch, ...], *, base: float, patch: float) -> float:
    """Return the friction [1] at x, y [m]: that of the last patch that contains it.

    Args:
        base: friction outside all patches.
        patch: friction of patches without a value of their own.
    """
    for area in reversed(patches):
        if area.holds(point):
            return patch if area.friction is None else area.friction
    return base


def _patch(text: str) -> Patch:
    friction, rest = None, text
    if begin := _FRICTION.match(text):
        friction, rest = _number(begin[1], text), text[begin.end() :]
        if friction < 0.0:
            raise ValueError(f"the friction of a patch must not be negative (got {text!r})")
    spans: list[Span] = []
    corners: tuple[Point, ...] = ()
    for condition in re.split(r",(?![^(]*\))", rest):  # no comma within brackets
        condition = condition.strip()
        if condition.startswith("(") and not corners:
            corners = _corners(condition, text)
        else:
            spans.append(_span(condition, text))
    return Patch(friction, tuple(spans), corners)


def _span(condition: str, text: str) -> Span:
    match = _SPAN.fullmatch(condition)
    low_text, axis, period_text, sign, bound = match.groups("") if match else ("",) * 5
    if not axis or not (low_text or sign) or (low_text and sign == ">"):
        raise ValueError(f"{condition!r} is not a patch (in {text!r}): write {_EXAMPLES}")
    low = _number(low_text, text) if low_text else float("-inf")
    high = float("inf")
    if sign == ">":
        low = _number(bound, text)
    elif sign == "<":
        high = _number(bound, text)
    period = _number(period_text, text) if period_text else 0.0
    if period_text and not period > 0.0:
        raise ValueError(f"{condition!r}: the period after % must be above zero (in {text!r})")
    if not low < high or (period and (low >= period or high <= 0.0)):
        raise ValueError(f"{condition!r} is true nowhere (in {text!r})")
    return Span("xy".index(axis), low, high, period)


def _number(digits: str, text: str) -> float:
    value = float(digits)
    if not isfinite(value):
        raise ValueError(f"the number {digits} is too large (in {text!r})")
    return value


def _corners(condition: str, text: str) -> tuple[Point, ...]:
    corners, at = [], 0
    while match := _CORNER.match(condition, at):
        corners.append((_number(match[1], text), _number(match[2], text)))
        at = match.end()
    if at < len(condition) or len(corners) < 3:
        raise ValueError(
            f"{condition!r}: a polygon needs three or more corners, as (20 0) (45 0) (30 2) (in {text!r})"
        )
    return tuple(corners)


def inside_polygon(point: Point, corners: tuple[Point, ...]) -> bool:
    """Return whether a point is in a polygon: a ray from it crosses an odd number of edges."""
    x, y = point
    inside = False
    x_0, y_0 = corners[-1]
    for x_1, y_1 in corners:
        if (y_0 > y) != (y_1 > y) and x < x_0 + (x_1 - x_0) * (y - y_0) / (y_1 - y_0):
            inside = not inside
        x_0, y_0 = x_1, y_1
    return inside
