"""Mamdani inference with two inputs: min for "and" and implication, max for aggregation, centroid.

The sets of a variable are triangular: neighbours cross at 1/2, grades add up to 1, the outer sets saturate.
At most two sets per input have a non-zero grade, so at most four rules fire, and only those are evaluated.
Between two neighbouring peaks the union of the clipped output sets is piecewise linear and depends only on
their two clips, so its centroid is exact (`clipped_pair`), without a grid. The outer output sets are half
triangles inside the range, so an output approaches the ends of its range only to a third of the outermost
spacing.

A rule table is text: a line per set of the first input, a cell per set of the second, and in each cell the
label of the output's set; with several outputs `PB/NB/PS` in their order, or a common label for all.

Source: E. H. Mamdani, S. Assilian, Int. J. Man-Machine Studies 7(1), 1975, 1-13. The centroid in
closed form is derived here.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Sequence

FIVE = "NB NS Z PS PB"
"""Labels of five sets: negative big, negative small, zero, positive small, positive big."""

SEVEN = "NB NM NS ZO PS PM PB"
"""Labels of seven sets, from negative big to positive big."""


def clipped_pair(a: float, b: float) -> tuple[float, float]:
    """Return area and moment about t = 1/2 of max(min(a, 1 - t), min(b, t)) over 0 <= t <= 1.

    This is the union of two neighbouring sets clipped at `a` (peak at t = 0) and `b` (peak at
    t = 1), both in 0..1, between their peaks. If both exceed 1/2, it has a dip at t = 1/2.
    """
    difference = b * b - a * a
    moment = 0.25 * difference - (b * b * b - a * a * a) / 6.0
    if a > 0.5 and b > 0.5:
        return a + b - 0.5 * (a * a + b * b) - 0.25, moment
    return (a + 0.5 * difference if a >= b else b - 0.5 * difference), moment


def gaussian_grades(x: float, centres: Sequence[float], widths: Sequence[float]) -> list[float]:
    """Return the grades exp(-((x - c) / s)^2) of `x` in Gaussian sets (centres c, widths s)."""
    exp = math.exp
    return [exp(-(((x - c) / s) ** 2)) for c, s in zip(centres, widths, strict=True)]


class Partition:
    """Triangular sets of an input or output variable.

    Args:
        labels: names of the sets, from low to high, separated by blanks.
        peaks: positions of grade 1, strictly rising; at least two.

    Raises:
        ValueError: peaks that do not rise or do not fit the labels, or a repeated label.
    """

    def __init__(self, labels: str, peaks: Sequence[float]) -> None:
        self.labels = tuple(labels.split())
        self.peaks = tuple(float(peak) for peak in peaks)
        if len(self.labels) != len(self.peaks) or len(self.peaks) < 2:
            raise ValueError(f"{len(self.peaks)} peaks for the {len(self.labels)} sets {labels!r}")
        if len(set(self.labels)) != len(self.labels):
            raise ValueError(f"a set is named twice in {labels!r}")
        pairs = list(zip(self.peaks, self.peaks[1:], strict=False))
        if not all(0.0 < q - p < math.inf for p, q in pairs):
            raise ValueError(f"the peaks of {labels!r} must rise strictly (got {self.peaks})")
        self._spans = [(0.5 * (p + q), q - p) for p, q in pairs]  # middle and width

    @classmethod
    def even(cls, labels: str, low: float = -1.0, high: float = 1.0) -> Partition:
        """Return sets with evenly spaced peaks, the outer ones at `low` and `high`."""
        n = len(labels.split()) - 1
        return cls(labels, [low, *(((n - k) * low + k * high) / n for k in range(1, n)), high])

    def locate(self, x: float) -> tuple[int, float]:
        """Return (k, t): set k has the grade 1 - t, set k + 1 the grade t, all others zero."""
        peaks = self.peaks
        if x <= peaks[0]:
            return 0, 0.0
        last = len(peaks) - 2
        if x >= peaks[-1]:
            return last, 1.0
        k = min(bisect_right(peaks, x) - 1, last)
        start = peaks[k]
        return k, (x - start) / (peaks[k + 1] - start)

    def centroid(self, clips: Sequence[float]) -> float:
        """Return the centroid of the union of the sets, each clipped at its value of `clips`.

        Raises:
            ZeroDivisionError: all clips are zero.
        """
        area = moment = 0.0
        b = clips[0]
        for k, (middle, width) in enumerate(self._spans, start=1):
            a = b
            b = clips[k]
            if a or b:
                part, first = clipped_pair(a, b)
                area += width * part
                moment += width * (middle * part + width * first)
        return moment / area


class Mamdani:
    r"""Mamdani system with two inputs and one or more outputs.

    >>> error, rate = Partition.even("N Z P", -0.02, 0.02), Partition.even("N Z P", -0.2, 0.2)
    >>> system = Mamdani(error, rate, [Partition.even("N Z P")], "N N Z \n N Z P \n Z P P")
    >>> system(0.0, 0.0)
    [0.0]

    Args:
        rows, columns: sets of the first and second input.
        outputs: sets of each output.
        table: rules, in the format described in the module's docstring.

    Raises:
        ValueError: the table does not fit the sets; the message names the cell.
    """

    def __init__(self, rows: Partition, columns: Partition, outputs: Sequence[Partition], table: str) -> None:
        self.rows, self.columns, self.outputs = rows, columns, tuple(outputs)
        self.rules = parse_rules(table, rows, columns, self.outputs)
        # The four consequents of each square of neighbouring cells, for each output.
        self._squares = [
            [
                tuple(zip(upper[j], upper[j + 1], lower[j], lower[j + 1], strict=True))
                for j in range(len(columns.peaks) - 1)
            ]
            for upper, lower in zip(self.rules, self.rules[1:], strict=False)
        ]

    def __deepcopy__(self, memo: object) -> Mamdani:
        return self  # immutable: the saved state of a component may share it

    def __call__(self, x: float, y: float) -> list[float]:
        """Return the outputs for the inputs `x` (rows) and `y` (columns); NaN for NaN."""
        if x != x or y != y:
            return [math.nan] * len(self.outputs)
        i, t = self.rows.locate(x)
        j, s = self.columns.locate(y)
        before, ahead = 1.0 - t, 1.0 - s
        strengths = (
            before if before < ahead else ahead,
            before if before < s else s,
            t if t < ahead else ahead,
            t if t < s else s,
        )
        results = []
        for output, consequents in zip(self.outputs, self._squares[i][j], strict=True):
            clips = [0.0] * len(output.peaks)
            for label, strength in zip(consequents, strengths, strict=True):
                if strength > clips[label]:
                    clips[label] = strength
            results.append(output.centroid(clips))
        return results


def parse_rules(
    table: str, rows: Partition, columns: Partition, outputs: Sequence[Partition]
) -> list[list[tuple[int, ...]]]:
    """Return rules[row][column][output] as indices of the outputs' sets.

    Raises:
        ValueError: a wrong number of rows or cells, or a label that the output does not have.
    """
    lines = [line.split() for line in table.splitlines() if line.strip()]
    if len(lines) != len(rows.labels):
        raise ValueError(f"the rule table has {len(lines)} rows for {len(rows.labels)} sets")
    rules = []
    for label, cells in zip(rows.labels, lines, strict=True):
        if len(cells) != len(columns.labels):
            raise ValueError(
                f"row {label} of the rule table has {len(cells)} cells for {len(columns.labels)} sets"
            )
        row = []
        for column, cell in zip(columns.labels, cells, strict=True):
            names = cell.split("/")
            if len(names) == 1:
                names *= len(outputs)
            if len(names) != len(outputs):
                raise ValueError(
                    f"row {label}, column {column} of the rule table has {len(names)} labels "
                    f"for {len(outputs)} outputs ({cell!r})"
                )
            for name, output in zip(names, outputs, strict=True):
                if name not in output.labels:
                    raise ValueError(
                        f"row {label}, column {column} of the rule table names the set {name!r}; "
                        f"allowed: {', '.join(output.labels)}"
                    )
            row.append(tuple(o.labels.index(name) for name, o in zip(names, outputs, strict=True)))
        rules.append(row)
    return rules
