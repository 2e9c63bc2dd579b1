"""Carrying a value from the middles of steps to the end of the last: what keeps loads second order.

A plant knows the tyre forces of a step at its middle. Loads and accelerations are outputs, wanted at
the step's end; they follow from the forces, these from the loads. To leave that loop open, the
forces are carried to the end along the straight line nearest to the last three middles.

Two values would do for second order. Three keep the loop of loads and forces calm: it swings up where
(change of the sum of forces) / (m times change of acceleration) falls below -0.60, with two
values already below -0.25, which a car on dry road reaches with locked rear wheels.
"""

from __future__ import annotations

from collections.abc import Sequence

Values = Sequence[float]


def weights(t_1: float, t_2: float, t_3: float) -> tuple[float, float, float]:
    """Return what three values, `t_1` <= `t_2` <= `t_3` [s] old, weigh in the line's value at age zero.

    The line is that of least squares. The weights add up to one; for steps of equal length, ages
    h/2, 3h/2, 5h/2, they are 13/12, 4/12, -5/12. The ages must not all be the same.
    """
    t = (t_1 + t_2 + t_3) / 3.0
    d_1, d_2, d_3 = t_1 - t, t_2 - t, t_3 - t
    slope = t / (d_1 * d_1 + d_2 * d_2 + d_3 * d_3)
    third = 1.0 / 3.0
    return third - slope * d_1, third - slope * d_2, third - slope * d_3


class Carried:
    """Values at the middles of the last two steps and the lengths [s] of these; at the start `values`."""

    def __init__(self, values: Values) -> None:
        self.values_1 = self.values_2 = values
        self.h_1 = self.h_2 = self.h_3 = 0.0
        self.weights = (1.0, 0.0, 0.0)

    def to_end(self, h: float, values: Values) -> Values:
        """Return the values at the end of a step of `h` > 0 [s] from those at its middle."""
        if not h == self.h_1 == self.h_2 == self.h_3:
            h_1, h_2 = self.h_1, self.h_2
            self.weights = weights(0.5 * h, 0.5 * h_1 + h, 0.5 * h_2 + h_1 + h)
            self.h_1, self.h_2, self.h_3 = h, h_1, h_2
        k_0, k_1, k_2 = self.weights
        stages = zip(values, self.values_1, self.values_2)  # noqa: B905 - strict= costs a tenth
        self.values_1, self.values_2 = values, self.values_1
        return [k_0 * a + k_1 * b + k_2 * c for a, b, c in stages]
