"""Extrapolation of values from the middles of steps to the end of the last step, of second order.

A plant has the tyre forces at the middle of a step, but its outputs, loads and accelerations, belong to the
step's end. They depend on the forces, and the forces on the loads. To avoid this algebraic loop, forces are
extrapolated to the end by the least-squares line through the last three middles.

Two values would suffice for second order. Three stabilize the loop of loads and forces: it is unstable where
(change of the sum of forces) / (m times change of acceleration) falls below -0.65; with two values below
-0.25, which a car on a dry road reaches with locked rear wheels.

At jumps, such as a step of torque, a line would overshoot. The extrapolation is therefore limited
(`limited`), which does not affect smooth signals.
"""

from collections.abc import Sequence

Values = Sequence[float]


def weights(t_1: float, t_2: float, t_3: float) -> tuple[float, float, float]:
    """Return the weights of three values, `t_1` <= `t_2` <= `t_3` [s] old, in the line's value at age zero.

    The line is that of least squares. The weights add up to 1; for steps of equal length, ages
    h/2, 3h/2, 5h/2, they are 13/12, 4/12, -5/12. The ages must not all be equal.
    """
    t = (t_1 + t_2 + t_3) / 3.0
    d_1, d_2, d_3 = t_1 - t, t_2 - t, t_3 - t
    slope = t / (d_1 * d_1 + d_2 * d_2 + d_3 * d_3)
    third = 1.0 / 3.0
    return third - slope * d_1, third - slope * d_2, third - slope * d_3


def limited(added: float, last: float, before: float) -> float:
    """Return the extrapolation limited so that it does not overshoot.

    Against the direction of the last change, at most back to the previous value. In its direction, only if
    the previous change had the same direction; then at most by that change, and at most by the remainder
    of a geometric sequence with the ratio `last` / `before` (Aitken's limit): last^2 / (before - last).

    Args:
        added: unlimited extrapolation.
        last, before: the last change and the previous change, over times of the same length.
    """
    size, earlier = abs(last), abs(before)
    if added * last <= 0.0:
        room = size
    elif last * before <= 0.0:
        return 0.0
    else:
        room = min(earlier, size * size / (earlier - size)) if size < earlier else earlier
    return min(max(added, -room), room)


class Carried:
    """Extrapolation from the middles of the last steps; it starts with constant `values`."""

    def __init__(self, values: Values) -> None:
        self.values_1 = self.values_2 = values
        self.h_1 = self.h_2 = self.h_3 = 0.0
        self.weights = (1.0, 0.0)
        self.stretch = 1.0

    def to_end(self, h: float, values: Values) -> Values:
        """Return the values extrapolated to the end of a step of `h` > 0 [s] from those at its middle."""
        if not h == self.h_1 == self.h_2 == self.h_3:
            h_1, h_2 = self.h_1, self.h_2
            t_1, t_2, t_3 = 0.5 * h, 0.5 * h_1 + h, 0.5 * h_2 + h_1 + h
            k_0, _, k_2 = weights(t_1, t_2, t_3)
            self.weights = k_0 - 1.0, -k_2  # of the last change and the previous change
            self.stretch = (t_2 - t_1) / (t_3 - t_2) if t_3 > t_2 else 0.0  # the first step
            self.h_1, self.h_2, self.h_3 = h, h_1, h_2
        k_1, k_2 = self.weights
        stretch = self.stretch
        stages = zip(values, self.values_1, self.values_2)  # noqa: B905 - strict= costs a tenth
        self.values_1, self.values_2 = values, self.values_1
        if not stretch:  # only two points: a jump cannot be detected
            return [a + k_1 * (a - b) for a, b, _ in stages]
        return [a + limited(k_1 * (a - b) + k_2 * (b - c), a - b, stretch * (b - c)) for a, b, c in stages]
