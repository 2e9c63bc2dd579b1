"""Linear-quadratic preview control: tracking of a target known in advance, with a scalar input.

    x(k+1) = Phi x(k) + Gamma u(k),       y = c' x
    minimize  sum of  w (y(k) - target(k))^2 + u(k)^2   over all future steps

    u = -K x + sum over j >= 1 of f_j target(k + j)

    P = w c c' + Phi' P (Phi - Gamma K),  K = Gamma' P Phi / s,  s = 1 + Gamma' P Gamma
    f_j = Gamma' ((Phi - Gamma K)')^(j-1) w c / s

The target is known for a number of steps; later values are ignored. P is iterated backwards from the end of a
growing horizon until K converges.

Source: R. S. Sharp, V. Valtetsiotis, Optimal preview car steering control, Vehicle System Dynamics 35
(supplement), 2001, with the target outside the state, which gives the same gains.
"""

from collections.abc import Sequence

from .quadratic_program import Rows
from .sums import added, dot

ORDER = 12
"""Order of the series of the matrix exponential, exact to rounding for arguments up to 1."""
LONGEST = 2000
"""Largest number of steps of the growing horizon."""
STILL = 1e-9
"""Relative change of K per step at which it is converged."""


def discrete(a: Sequence[Sequence[float]], b: Sequence[float], h: float) -> tuple[Rows, list[float]]:
    """Return Phi and Gamma of dx/dt = A x + b u over `h` [s] with constant u, exact to rounding."""
    n = len(b)
    whole = [[*map(float, row), float(gain)] for row, gain in zip(a, b, strict=True)] + [[0.0] * (n + 1)]
    largest = max(added(map(abs, row)) for row in whole)
    halves = 0
    while h * largest > 1.0:
        h, halves = 0.5 * h, halves + 1
    term = [[float(i == j) for j in range(n + 1)] for i in range(n + 1)]
    total = [row[:] for row in term]
    for k in range(1, ORDER):
        term = [[value * h / k for value in row] for row in product(term, whole)]
        total = [[x + y for x, y in zip(p, q, strict=True)] for p, q in zip(total, term, strict=True)]
    for _ in range(halves):
        total = product(total, total)
    return [row[:n] for row in total[:n]], [row[n] for row in total[:n]]


class TrackingLaw:
    """Optimal input for a known target: u = -K x + sum of f_j target(k + j).

    Args:
        phi, gamma: from `discrete`.
        c: output vector, y = c' x.
        weight: w, in squares of the input over those of the target.

    Attributes:
        gains: K, with an element per state.
        line: w c, from which the gains of the target follow one after the other.
    """

    def __init__(self, phi: Rows, gamma: Sequence[float], c: Sequence[float], weight: float) -> None:
        aim = [[weight * x * y for y in c] for x in c]
        across = [list(column) for column in zip(*phi, strict=True)]
        p = aim
        gains = [0.0] * len(c)
        closed, s = phi, 1.0
        for _ in range(LONGEST):
            carried = _applied(p, gamma)
            s = 1.0 + dot(gamma, carried)
            before, gains = gains, [value / s for value in _applied(across, carried)]
            closed = [
                [value - g * k for value, k in zip(row, gains, strict=True)]
                for row, g in zip(phi, gamma, strict=True)
            ]
            p = [
                [x + y for x, y in zip(row, addend, strict=True)]
                for row, addend in zip(aim, product(across, product(p, closed)), strict=True)
            ]
            if max(abs(x - y) for x, y in zip(before, gains, strict=True)) <= STILL * max(map(abs, gains)):
                break
        self.gains = gains
        self.line = [weight * value for value in c]
        self._gamma, self._s = gamma, s
        self._back = [list(column) for column in zip(*closed, strict=True)]

    def gain_ahead(self, line: Sequence[float]) -> float:
        """Return f_j for the line of the step j."""
        return dot(self._gamma, line) / self._s

    def further(self, line: Sequence[float]) -> list[float]:
        """Return the line of the next step, (Phi - Gamma K)' line."""
        return _applied(self._back, line)


def product(left: Sequence[Sequence[float]], right: Sequence[Sequence[float]]) -> Rows:
    """Return the product of two matrices."""
    columns = list(zip(*right, strict=True))
    return [[dot(row, column) for column in columns] for row in left]


def _applied(matrix: Sequence[Sequence[float]], vector: Sequence[float]) -> list[float]:
    return [dot(row, vector) for row in matrix]
