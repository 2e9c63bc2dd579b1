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

from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import NamedTuple

from vocabulary.lane_change import Lane

from ..mathematics.quadratic_program import Rows, solution
from ..mathematics.sums import dot
from .track import Outline

LEAD, TAIL = 15.0, 15.0
"""Path before the first and after the last cones [m]. Chosen: time to turn the wheel at 25 m/s."""
INTERVALS = 40
"""Number of intervals between knots. Chosen: with half of them the largest force is 2 % higher."""
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
        knots = [self.start + self.spacing * k for k in range(INTERVALS + 1)]
        demands = _demands(self.spacing, levers, [easing(x) for x in knots])
        rows, bounds = self._constraints(lanes, outline, margin, slip)
        rows = [[bend / give * value for value in row] for row in rows]
        program = _Program(demands, rows, [bound / give for bound in bounds], self.spacing)
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

    def _constraints(
        self, lanes: Sequence[Lane], outline: Outline, margin: float, slip: float
    ) -> tuple[Rows, list[float]]:
        """Return the rows of the inequality constraints on y'' at the knots, and their upper bounds [m]."""
        basis = _Basis(self.spacing)
        front, rear, half = outline
        body = [-rear + (front + rear) * k / (POINTS - 1) for k in range(POINTS)]
        rows: Rows = []
        bounds: list[float] = []
        for lane in lanes:
            cones = [lane.start + (lane.end - lane.start) * k / CONES for k in range(CONES + 1)]
            for cone in cones:
                for s in body if cone in (lane.start, lane.end) else (-rear, front):
                    row = basis.place(cone - s - self.start, s, slip)
                    rows += [row, [-value for value in row]]
                    bounds += [lane.left - half - margin, -lane.right - half - margin]
        end = [AHEAD * value for value in basis.slopes[-1]]
        rows += [end, [-value for value in end]]
        bounds += [0.0, 0.0]
        return rows, bounds


class _Demand(NamedTuple):
    """Axle force at a knot k: `here` y''(k) + `next` y''(k + 1)."""

    k: int
    here: float
    next: float


def _demands(spacing: float, levers: tuple[float, float], easing: Sequence[float]) -> list[_Demand]:
    """Return the forces of both axles at both ends of every interval."""
    return [
        _Demand(k, ease * (1.0 - end - lever / spacing), ease * (end + lever / spacing))
        for k, ease in enumerate(easing[:-1])
        for end in (0.0, 1.0)
        for lever in levers
    ]


class _Basis:
    """Linear maps from the values of y'' at the knots to y, y' and y'', as rows."""

    def __init__(self, spacing: float) -> None:
        self.spacing = h = spacing
        count = INTERVALS + 1
        self.bends = [[1.0 if i == k else 0.0 for i in range(count)] for k in range(count)]
        self.slopes, self.places = [[0.0] * count], [[0.0] * count]
        for bend, next_bend in pairwise(self.bends):
            rows = zip(self.places[-1], self.slopes[-1], bend, next_bend, strict=True)
            self.places.append([y + h * slope + h * h * (c / 3.0 + d / 6.0) for y, slope, c, d in rows])
            rows = zip(self.places[-1], self.slopes[-1], bend, next_bend, strict=True)
            self.slopes.append([slope + 0.5 * h * (c + d) for _, slope, c, d in rows])

    def place(self, x: float, s: float, slip: float) -> list[float]:
        """Return the row of y + s (y' - slip y'') at x [m] from the first knot."""
        k = min(max(int(x / self.spacing), 0), INTERVALS - 1)
        t = x - k * self.spacing
        row = []
        for y, slope, bend, next_bend in zip(
            self.places[k], self.slopes[k], self.bends[k], self.bends[k + 1], strict=True
        ):
            steeper = (next_bend - bend) / self.spacing
            there = y + t * (slope + t * (0.5 * bend + t * steeper / 6.0))
            turned = slope + t * (bend + 0.5 * t * steeper) - slip * (bend + t * steeper)
            row.append(there + s * turned)
        return row


class _Program:
    """Cost of axle forces and violated constraints, and its minimization."""

    def __init__(
        self, demands: Sequence[_Demand], rows: Rows, bounds: Sequence[float], spacing: float
    ) -> None:
        self.demands, self.rows, self.bounds = demands, rows, bounds
        self.weight = spacing / 4.0  # four forces per interval

    def solved(self) -> list[float]:
        """Return the values of y'' at the knots, in units of the bend of cost 1."""
        z = [0.0] * (INTERVALS + 1)
        cost = self._cost(z)
        for _ in range(MOST_STEPS):
            slope, hessian = self._derivatives(z)
            step = solution(hessian, [-value for value in slope])
            share, nearer, less = 1.0, z, cost
            while share > 1e-6:
                nearer = [a + share * b for a, b in zip(z, step, strict=True)]
                less = self._cost(nearer)
                if less < cost:
                    break
                share *= 0.5
            if not less < cost:
                break
            gained = cost - less
            z, cost = nearer, less
            if gained < CLOSE * cost:
                break
        return z

    def _cost(self, z: Sequence[float]) -> float:
        total = 0.0
        for k, here, further in self.demands:
            force = here * z[k] + further * z[k + 1]
            total += self.weight * (force**POWER / POWER + 0.5 * CALM * force * force)
        for row, bound in zip(self.rows, self.bounds, strict=True):
            lacking = dot(row, z) - bound
            if lacking > 0.0:
                total += 0.5 * lacking * lacking
        return total

    def _derivatives(self, z: Sequence[float]) -> tuple[list[float], Rows]:
        """Return the first and second derivatives of the cost."""
        slope = [0.0] * len(z)
        hessian = [[0.0] * len(z) for _ in z]
        for k, here, further in self.demands:
            force = here * z[k] + further * z[k + 1]
            first = self.weight * (force ** (POWER - 1) + CALM * force)
            second = self.weight * ((POWER - 1) * force ** (POWER - 2) + CALM)
            slope[k] += here * first
            slope[k + 1] += further * first
            hessian[k][k] += here * here * second
            hessian[k + 1][k + 1] += further * further * second
            hessian[k][k + 1] += here * further * second
            hessian[k + 1][k] += here * further * second
        for row, bound in zip(self.rows, self.bounds, strict=True):
            lacking = dot(row, z) - bound
            if lacking > 0.0:
                for i, value in enumerate(row):
                    if value:
                        slope[i] += lacking * value
                        hessian[i] = [a + value * b for a, b in zip(hessian[i], row, strict=True)]
        return slope, hessian
