"""Path through the lanes of a double lane change with the least peak of the tyre forces.

    F_f / m_f = v^2 (y'' + i_f y'''),    i_f = I_z / (m b)        side force of the front axle over the mass
    F_r / m_r = v^2 (y'' - i_r y'''),    i_r = I_z / (m a)        that it carries, of the rear axle likewise

    minimize  integral of  sum (F / m / a_0)^8 / 8  over x  +  sum (lack of margin / s_0)^2 / 2
              (and a small weight of (F / m / a_0)^2, so that the path of a slow car is smooth, too)

The power of eight approximates the peak: the path spreads its curvature, begins to turn in lanes that are
wider than the car, and passes the cones as closely as the tyres require. The acceleration a_0 and the lack of
margin s_0 have equal cost. The speed falls while the car coasts, and so do the forces in a given bend.

y'' is piecewise linear between knots, so that y, y' and y'' at any x are linear in its values at the knots,
as are the positions of the body, y + s (y' - beta) +- w / 2 at s ahead of the centre of mass, with the
sideslip beta = c y'' of a steady turn. The cost is convex; Newton's method minimizes it.

Source: ours. The forces are those of a single-track car with slowly changing sideslip.
"""

from __future__ import annotations

from array import array
from collections.abc import Callable, Sequence
from itertools import pairwise
from math import inf

from yawbench.vocabulary.lane_change import Lane

from ..mathematics.linear_equations import solve
from .track import Outline

LEAD, TAIL = 15.0, 15.0
"""Path before the first and after the last cones [m]. Chosen: time to turn the wheel at 25 m/s."""
INTERVALS = 40
"""Number of intervals between knots. Chosen: with half of them the largest force is 2 % higher."""
KNOTS = INTERVALS + 1
"""Number of knots."""
POWER = 8
MOST_STEPS = 60
"""Largest number of steps of Newton's method; chosen: twice what the standard's tracks need."""
CLOSE = 1e-5
"""Relative decrease of the cost at which Newton's method stops."""
AHEAD = 5.0
"""Length [m] by which the slope at the path's end is converted to an offset. Chosen: a car's length."""
CALM = 0.02
"""Weight of (F / m / a_0)^2 / 2 beside the eighth power, which is negligible for small forces. Chosen: a
twelfth of that power's share at a_0."""
CONES = 4
"""Intervals along a lane; the corners of the body keep the margin at their ends."""
POINTS = 5
"""Points along the side of the body that keep the margin at the outer cones of a lane."""
MOST_POINTS = 3 * (CONES + 1) * POINTS
"""Largest number of points that are kept between the borders of three lanes."""


class LanePath:
    """Path y(x) through lanes, continued in a straight line before and after them.

    Args:
        lanes: each from x to x, between two borders.
        outline: of the car.
        margin: between body and cones [m].
        give: lack of margin s_0 [m].
        bend: curvature a_0 / v^2 at the first cones [1/m].
        levers: i_f and -i_r [m].
        slip: c, sideslip of a steady turn over its curvature [m].
        easing: (v / v at the first cones)^2 as a function of x.
    """

    def __init__(
        self,
        lanes: Sequence[Lane],
        outline: Outline,
        *,
        margin: float,
        give: float,
        bend: float,
        levers: tuple[float, float],
        slip: float,
        easing: Callable[[float], float],
    ) -> None:
        self.start = lanes[0].start - LEAD
        self.spacing = (lanes[-1].end + TAIL - self.start) / INTERVALS
        program = PathProgram(self.spacing, bend / give)
        program.add_forces(self.start, levers, easing)
        for k, lane in enumerate(lanes):
            self._add_points(program, k, lane, outline, margin, give)
        program.bound_points(slip)
        program.bound_end(AHEAD)
        self.bends = [bend * value for value in program.solved()]  # y'' at the knots
        self.slopes, self.places = [0.0], [0.0]  # y' and y there
        h = self.spacing
        for bend, next_bend in pairwise(self.bends):
            self.places.append(self.places[-1] + h * self.slopes[-1] + h * h * (bend / 3.0 + next_bend / 6.0))
            self.slopes.append(self.slopes[-1] + 0.5 * h * (bend + next_bend))

    def __call__(self, x: float) -> float:
        """Return y [m] at `x` [m]."""
        s = (x - self.start) / self.spacing
        if s <= 0.0:
            return 0.0
        k = min(int(s), INTERVALS)
        t = x - self.start - self.spacing * k
        if k == INTERVALS:
            return self.places[k] + t * self.slopes[k]
        bend = self.bends[k]
        steeper = (self.bends[k + 1] - bend) / self.spacing
        return self.places[k] + t * (self.slopes[k] + t * (0.5 * bend + t * steeper / 6.0))

    def _add_points(
        self, program: PathProgram, number: int, lane: Lane, outline: Outline, margin: float, give: float
    ) -> None:
        """Keep points along the body between the borders of a lane where its cones stand."""
        front, rear, half = outline
        left, right = (lane.left - half - margin) / give, (-lane.right - half - margin) / give
        for i in range(CONES + 1):
            cone = lane.start + (lane.end - lane.start) * i / CONES
            outer = cone in (lane.start, lane.end)
            for k in range(POINTS):
                if outer:
                    s = -rear + (front + rear) * k / (POINTS - 1)
                elif k == 0:
                    s = -rear
                elif k == POINTS - 1:
                    s = front
                else:
                    continue
                point = (number * (CONES + 1) + i) * POINTS + k
                program.add_point(point, cone - s - self.start, s, left, right)


class PathProgram:
    """Cost of axle forces and violated constraints as a function of y'' at the knots, and its minimization.

    Every constraint is on a linear function of y'', from both sides. Numbers are in arrays, so that a native
    unit goes through them in loops.

    Args:
        spacing: between knots [m].
        scale: unit of y'' over the unit of constraints, a_0 / v^2 / s_0 [1/m2].
    """

    def __init__(self, spacing: float, scale: float) -> None:
        self.spacing, self.scale = spacing, scale
        self.weight = spacing / 4.0  # four forces per interval
        self.here, self.further = _zeros(4 * INTERVALS), _zeros(4 * INTERVALS)  # force per y''(k), y''(k + 1)
        self.xs, self.offsets = _zeros(MOST_POINTS), _zeros(MOST_POINTS)  # x and s of the points
        self.borders = array("d", [inf] * (2 * MOST_POINTS))  # left, right; infinite if a point is not added
        self.bounds = 0
        self.lefts, self.rights = _zeros(MOST_POINTS + 1), _zeros(MOST_POINTS + 1)
        self.rows = _zeros((MOST_POINTS + 1) * KNOTS)
        self.slopes, self.places = _zeros(KNOTS * KNOTS), _zeros(KNOTS * KNOTS)  # y' and y per y'', at knots
        h = spacing
        for k in range(INTERVALS):
            for j in range(KNOTS):
                now, then = KNOTS * k + j, KNOTS * (k + 1) + j
                bend, next_bend = float(j == k), float(j == k + 1)
                y, slope = self.places[now], self.slopes[now]
                self.places[then] = y + h * slope + h * h * (bend / 3.0 + next_bend / 6.0)
                self.slopes[then] = slope + 0.5 * h * (bend + next_bend)

    def add_forces(self, start: float, levers: tuple[float, float], easing: Callable[[float], float]) -> None:
        """Add the forces of both axles at both ends of every interval."""
        for k in range(INTERVALS):
            ease = easing(start + self.spacing * k)
            for i, (end, lever) in enumerate([(end, lever) for end in (0.0, 1.0) for lever in levers]):
                self.here[4 * k + i] = ease * (1.0 - end - lever / self.spacing)
                self.further[4 * k + i] = ease * (end + lever / self.spacing)

    def add_point(self, point: int, x: float, s: float, left: float, right: float) -> None:
        """Add a point s [m] ahead of the centre of mass, where that is x [m] from the first knot.

        Args:
            point: its number, below `MOST_POINTS`.
            x, s: the point.
            left, right: bounds of its y and -y, in units of s_0.
        """
        self.xs[point], self.offsets[point] = x, s
        self.borders[2 * point], self.borders[2 * point + 1] = left, right

    def bound_points(self, slip: float) -> None:
        """Bound y + s (y' - slip y'') of all points."""
        for point in range(MOST_POINTS):
            if self.borders[2 * point] == inf:
                continue
            x, s = self.xs[point], self.offsets[point]
            k = min(max(int(x / self.spacing), 0), INTERVALS - 1)
            t = x - k * self.spacing
            for j in range(KNOTS):
                y, slope = self.places[KNOTS * k + j], self.slopes[KNOTS * k + j]
                bend, next_bend = float(j == k), float(j == k + 1)
                steeper = (next_bend - bend) / self.spacing
                there = y + t * (slope + t * (0.5 * bend + t * steeper / 6.0))
                turned = slope + t * (bend + 0.5 * t * steeper) - slip * (bend + t * steeper)
                self.rows[KNOTS * self.bounds + j] = self.scale * (there + s * turned)
            self._bound(self.borders[2 * point], self.borders[2 * point + 1])

    def bound_end(self, ahead: float) -> None:
        """Bound the offset `ahead` [m] of the path's end to zero."""
        for j in range(KNOTS):
            self.rows[KNOTS * self.bounds + j] = self.scale * (ahead * self.slopes[KNOTS * INTERVALS + j])
        self._bound(0.0, 0.0)

    def _bound(self, left: float, right: float) -> None:
        self.lefts[self.bounds], self.rights[self.bounds] = left, right
        self.bounds += 1

    def solved(self) -> array[float]:
        """Return the values of y'' at the knots, in units of the bend of cost 1."""
        z, nearer, step = _zeros(KNOTS), _zeros(KNOTS), _zeros(KNOTS)
        slope, hessian = _zeros(KNOTS), _zeros(KNOTS * KNOTS)
        cost = self.cost(z)
        for _ in range(MOST_STEPS):
            self.derive(z, slope, hessian)
            for i in range(KNOTS):
                step[i] = -slope[i]
            solve(hessian, step, KNOTS)
            share, less = 1.0, cost
            while share > 1e-6:
                for i in range(KNOTS):
                    nearer[i] = z[i] + share * step[i]
                less = self.cost(nearer)
                if less < cost:
                    break
                share *= 0.5
            if not less < cost:
                break
            gained = cost - less
            cost = less
            for i in range(KNOTS):
                z[i] = nearer[i]
            if gained < CLOSE * cost:
                break
        return z

    def cost(self, z: array[float]) -> float:
        """Return the cost of y''."""
        total = 0.0
        for m in range(4 * INTERVALS):
            force = self._force(m, z)
            total += self.weight * (force**POWER / POWER + 0.5 * CALM * force * force)
        for bound in range(self.bounds):
            place = self._place(bound, z)
            for lacking in (place - self.lefts[bound], -place - self.rights[bound]):
                if lacking > 0.0:
                    total += 0.5 * lacking * lacking
        return total

    def derive(self, z: array[float], slope: array[float], hessian: array[float]) -> None:
        """Compute the first and second derivatives of the cost."""
        for i in range(KNOTS):
            slope[i] = 0.0
            for j in range(KNOTS):
                hessian[KNOTS * i + j] = 0.0
        for m in range(4 * INTERVALS):
            force, here, further = self._force(m, z), self.here[m], self.further[m]
            first = self.weight * (force ** (POWER - 1) + CALM * force)
            second = self.weight * ((POWER - 1) * force ** (POWER - 2) + CALM)
            k = m // 4
            slope[k] += here * first
            slope[k + 1] += further * first
            hessian[KNOTS * k + k] += here * here * second
            hessian[KNOTS * (k + 1) + k + 1] += further * further * second
            hessian[KNOTS * k + k + 1] += here * further * second
            hessian[KNOTS * (k + 1) + k] += here * further * second
        for bound in range(self.bounds):
            place = self._place(bound, z)
            for side, limit in ((1.0, self.lefts[bound]), (-1.0, self.rights[bound])):
                lacking = side * place - limit
                if lacking > 0.0:
                    self._push(lacking * side, bound, slope, hessian)

    def _push(self, lacking: float, bound: int, slope: array[float], hessian: array[float]) -> None:
        """Add the derivatives of the cost of a lack of margin, negative on the right."""
        for i in range(KNOTS):
            value = self.rows[KNOTS * bound + i]
            if value:
                slope[i] += lacking * value
                for j in range(KNOTS):
                    hessian[KNOTS * i + j] += value * self.rows[KNOTS * bound + j]

    def _force(self, m: int, z: array[float]) -> float:
        return self.here[m] * z[m // 4] + self.further[m] * z[m // 4 + 1]

    def _place(self, bound: int, z: array[float]) -> float:
        total = 0.0
        for i in range(KNOTS):
            total += self.rows[KNOTS * bound + i] * z[i]
        return total


def _zeros(count: int) -> array[float]:
    return array("d", [0.0] * count)
