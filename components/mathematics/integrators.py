"""Fixed-step integration by the classical fourth-order Runge-Kutta method.

    k1 = f(t, y)                    k2 = f(t + h/2, y + h/2 k1)
    k3 = f(t + h/2, y + h/2 k2)     k4 = f(t + h, y + h k3)
    y(t + h) = y + h/6 (k1 + 2 (k2 + k3) + k4)

Source: W. Kutta, Zeitschrift für Mathematik und Physik 46, 1901, 435-453.
"""

from collections.abc import Callable, Sequence

Derivatives = Callable[[float, Sequence[float]], Sequence[float]]


def rk4(f: Derivatives, t: float, h: float, y: Sequence[float]) -> tuple[float, ...]:
    """Return the state at `t + h` [s] of dy/dt = f(t, y), from the state `y` at `t` [s].

    The local error is of order h^5. The order of summation is fixed, without branches, so a mirror-symmetric
    system stays symmetric to the last bit.
    """
    half = 0.5 * h
    k1 = f(t, y)
    k2 = f(t + half, [a + half * b for a, b in zip(y, k1)])  # noqa: B905 - strict= costs a tenth
    k3 = f(t + half, [a + half * b for a, b in zip(y, k2)])  # noqa: B905
    k4 = f(t + h, [a + h * b for a, b in zip(y, k3)])  # noqa: B905
    sixth = h / 6.0
    stages = zip(y, k1, k2, k3, k4)  # noqa: B905
    return tuple([a + sixth * (b + 2.0 * (c + d) + e) for a, b, c, d, e in stages])
