"""Carrying a value from the middles of steps to the end of the last: what keeps loads second order.

A plant knows the tyre forces of a step at its middle. Loads and accelerations are outputs, wanted at
the step's end; they follow from the forces, these from the loads. To leave that loop open, the
forces are carried to the end along the straight line nearest to the last three middles.

Two values would do for second order. Three keep the loop of loads and forces calm: it swings up where
(change of the sum of forces) / (m times change of acceleration) falls below -0.65, with two
values already below -0.25, which a car on dry road reaches with locked rear wheels.

A line knows nothing of jumps: where a torque steps it would carry the forces past all that they ever
reach. So what is added to the last value is limited (`limited`), which leaves smooth courses alone.
"""

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


def limited(added: float, last: float, before: float) -> float:
    """Return what may be added to the last value of three: nothing that overshoots what was measured.

    Back no further than to the value before. On in the direction of the last change only if the one
    before it had it too; then no further than that one went, and no further than what is left of a value
    that settles as the two do, each `last` / `before` of the one before it (A. C. Aitken's limit):
    last^2 / (before - last).

    Args:
        added: what the line adds.
        last, before: the last change and the one before it, both over times of the same length.
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
    """Values at the middles of the last two steps and the lengths [s] of these; at the start `values`."""

    def __init__(self, values: Values) -> None:
        self.values_1 = self.values_2 = values
        self.h_1 = self.h_2 = self.h_3 = 0.0
        self.weights = (1.0, 0.0)
        self.stretch = 1.0

    def to_end(self, h: float, values: Values) -> Values:
        """Return the values at the end of a step of `h` > 0 [s] from those at its middle."""
        if not h == self.h_1 == self.h_2 == self.h_3:
            h_1, h_2 = self.h_1, self.h_2
            t_1, t_2, t_3 = 0.5 * h, 0.5 * h_1 + h, 0.5 * h_2 + h_1 + h
            k_0, _, k_2 = weights(t_1, t_2, t_3)
            self.weights = k_0 - 1.0, -k_2  # of the last change and the one before it
            self.stretch = (t_2 - t_1) / (t_3 - t_2) if t_3 > t_2 else 0.0  # the first step
            self.h_1, self.h_2, self.h_3 = h, h_1, h_2
        k_1, k_2 = self.weights
        stretch = self.stretch
        stages = zip(values, self.values_1, self.values_2)  # noqa: B905 - strict= costs a tenth
        self.values_1, self.values_2 = values, self.values_1
        if not stretch:  # a line through two points, of which nothing tells a jump
            return [a + k_1 * (a - b) for a, b, _ in stages]
        return [a + limited(k_1 * (a - b) + k_2 * (b - c), a - b, stretch * (b - c)) for a, b, c in stages]
