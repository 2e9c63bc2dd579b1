"""Small convex quadratic programs, solved in the dual by Hildreth's method.

    minimize 1/2 z' H z + g' z      subject to      A z <= b

H is positive definite. With the multipliers y >= 0 of the constraints, z = -H^-1 (g + A' y), and y minimizes

    1/2 y' P y + d' y,     P = A H^-1 A',     d = b + A H^-1 g

by coordinate descent: each y_i in turn is set to its optimum for fixed other multipliers. This converges to
the solution if there is one. A soft constraint A z <= b + s with the cost w s^2 / 2 adds 1 / w to the
diagonal of P.

Source: C. Hildreth, A quadratic programming procedure, Naval Research Logistics Quarterly 4, 1957; L. Wang,
Model Predictive Control System Design and Implementation Using MATLAB, 2009, section 2.4.4.
"""

from collections.abc import Sequence

Rows = list[list[float]]

SWEEPS = 500
"""Largest number of sweeps. Chosen: ten times what yaw control needs; ends programs without a solution."""
CLOSE = 1e-10
"""Change of the multipliers, relative to the largest, at convergence. Chosen: far below sensor resolution."""


def inverse(h: Sequence[Sequence[float]]) -> Rows:
    """Return the inverse of a symmetric positive definite matrix, by Gauss-Jordan elimination.

    Raises:
        ZeroDivisionError: a pivot is zero, so the matrix is not positive definite.
    """
    n = len(h)
    rows = [[*map(float, row), *(1.0 if i == j else 0.0 for j in range(n))] for i, row in enumerate(h)]
    for i in range(n):
        pivot = 1.0 / rows[i][i]
        rows[i] = [value * pivot for value in rows[i]]
        for k in range(n):
            if k != i and (factor := rows[k][i]):
                rows[k] = [value - factor * above for value, above in zip(rows[k], rows[i], strict=True)]
    return [row[n:] for row in rows]


def multipliers(p: Sequence[Sequence[float]], d: Sequence[float]) -> list[float]:
    """Return y >= 0 that minimizes 1/2 y' P y + d' y.

    Args:
        p: symmetric, positive semidefinite, with a positive diagonal.
        d: vector of the same size; y = 0 if no element is negative.
    """
    y = [0.0] * len(d)
    slopes = list(d)  # d + P y
    if min(slopes, default=0.0) >= 0.0:
        return y
    for _ in range(SWEEPS):
        moved = 0.0
        for i, row in enumerate(p):
            better = y[i] - slopes[i] / row[i]
            change = (better if better > 0.0 else 0.0) - y[i]
            if change:
                y[i] += change
                slopes = [slope + change * value for slope, value in zip(slopes, row, strict=True)]
                moved = max(moved, abs(change))
        if moved <= CLOSE * max(y):
            break
    return y
