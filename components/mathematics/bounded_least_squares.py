"""Weighted least squares within bounds, solved by an active set method.

    minimize sum_i w_i (x_i - d_i)^2 + sum_k v_k (B_k x - c_k)^2      subject to      low <= x <= high

Some elements of x are held at a bound, the others minimize the cost. If they leave their bounds, x moves
towards that minimum until the first of them meets its bound, which is held from then on. Else, of the held
elements whose release would lower the cost, the one with the steepest slope is released; without any, x is
the solution. With w_i > 0 the cost is strictly convex, so the solution is unique and found in finitely many
steps.

Source: O. Haerkegaard, Efficient active set algorithms for solving constrained least squares problems in
aircraft control allocation, 41st IEEE Conference on Decision and Control, 2002 (report LiTH-ISY-R-2426; its
abstract and introduction were read), the formulation `WLS` of his toolbox QCAT; J. Nocedal, S. J. Wright,
Numerical Optimization, 2nd edition, algorithm 16.3. Ours differs: normal equations in place of a QR
factorization, which suffices for a few unknowns of comparable weights.
"""

from array import array
from collections.abc import Sequence

from .linear_equations import solve

STEPS = 40
"""Largest number of steps. Chosen: several times what four unknowns can need."""


def bounded(
    weights: Sequence[float],
    desired: Sequence[float],
    rows: Sequence[Sequence[float]],
    row_weights: Sequence[float],
    values: Sequence[float],
    low: Sequence[float],
    high: Sequence[float],
) -> list[float]:
    """Return the x of least cost within its bounds.

    Args:
        weights, desired: w, positive, and d, one per unknown.
        rows, row_weights, values: B, by rows, v and c, one per row.
        low, high: bounds, low <= high.
    """
    n = len(weights)
    h = [
        [_weighted(rows, row_weights, i, j) + (weights[i] if i == j else 0.0) for j in range(n)]
        for i in range(n)
    ]
    g = [weights[i] * desired[i] + _toward(rows, row_weights, values, i) for i in range(n)]
    x = [min(max(desired[i], low[i]), high[i]) for i in range(n)]
    held = [0] * n  # -1: at the lower bound, 1: at the upper one
    for i in range(n):
        if desired[i] <= low[i]:
            held[i] = -1
        elif desired[i] >= high[i]:
            held[i] = 1
    for _ in range(STEPS):
        best = _minimum(h, g, x, held, n)
        share, first = 1.0, -1
        for i in range(n):
            room = share
            if held[i] == 0 and best[i] < low[i]:
                room = (low[i] - x[i]) / (best[i] - x[i])
            elif held[i] == 0 and best[i] > high[i]:
                room = (high[i] - x[i]) / (best[i] - x[i])
            if room < share:
                share, first = room, i
        for i in range(n):
            if held[i] == 0:
                x[i] += share * (best[i] - x[i])
        if first >= 0:
            held[first] = -1 if best[first] < low[first] else 1
            x[first] = low[first] if held[first] < 0 else high[first]
            continue
        steepest, released = 0.0, -1
        for i in range(n):
            if held[i] != 0:
                slope = -g[i]
                for j in range(n):
                    slope += h[i][j] * x[j]
                gain = slope * held[i]  # positive: the cost falls inwards
                if gain > steepest:
                    steepest, released = gain, i
        if released < 0:
            break
        held[released] = 0
    return x


def _weighted(rows: Sequence[Sequence[float]], row_weights: Sequence[float], i: int, j: int) -> float:
    total = 0.0
    for row, weight in zip(rows, row_weights, strict=True):
        total += weight * row[i] * row[j]
    return total


def _toward(
    rows: Sequence[Sequence[float]], row_weights: Sequence[float], values: Sequence[float], i: int
) -> float:
    total = 0.0
    for row, weight, value in zip(rows, row_weights, values, strict=True):
        total += weight * row[i] * value
    return total


def _minimum(
    h: Sequence[Sequence[float]], g: Sequence[float], x: Sequence[float], held: Sequence[int], n: int
) -> list[float]:
    """Return x with its free elements at the minimum for the held ones."""
    a = array("d", [0.0] * (n * n))
    b = array("d", [0.0] * n)
    for i in range(n):
        a[n * i + i] = 1.0
        b[i] = x[i]
        if held[i] == 0:
            b[i] = g[i]
            for j in range(n):
                if held[j] == 0:
                    a[n * i + j] = h[i][j]
                else:
                    b[i] -= h[i][j] * x[j]
    solve(a, b, n)
    return [b[i] for i in range(n)]
