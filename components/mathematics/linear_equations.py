"""Linear equations with a symmetric positive definite matrix, in arrays."""

from __future__ import annotations

from array import array


def solve(h: array[float], g: array[float], n: int) -> None:
    """Solve H z = g by Gaussian elimination; `g` becomes z, and `h` is overwritten.

    Args:
        h: H, n x n, by rows, symmetric and positive definite.
        g: n numbers.
        n: number of equations.

    Raises:
        ZeroDivisionError: a pivot is zero, so H is not positive definite.
    """
    for i in range(n):
        for k in range(i + 1, n):
            factor = h[n * i + k] / h[n * i + i]
            if factor:
                for j in range(k, n):
                    h[n * k + j] -= factor * h[n * i + j]
                g[k] -= factor * g[i]
    for done in range(n):
        i = n - 1 - done
        known = 0.0
        for j in range(i + 1, n):
            known += h[n * i + j] * g[j]
        g[i] = (g[i] - known) / h[n * i + i]
