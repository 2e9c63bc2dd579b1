"""Friction as a table over x and y."""

from __future__ import annotations

import random
import re

import pytest

from yawbench.components.roads.patchwork import Patchwork
from yawbench.vocabulary.friction_table import FrictionTable, table_of

from .stand import Stand, wheel_values

X, Y = (0.0, 10.0, 25.0), (-4.0, 0.0, 3.0)


def bilinear(x: float, y: float) -> float:
    return 0.4 + 0.01 * x - 0.05 * y + 0.002 * x * y


def written(xs=X, ys=Y, separator=",") -> str:
    rows = [separator.join(["y \\ x", *map(str, xs)])]
    rows += [separator.join([str(y), *(f"{bilinear(x, y)!r}" for x in xs)]) for y in ys]
    return "# measured\n\n" + "\n".join(rows)


def test_between_its_values_a_table_is_bilinear():
    table = table_of(written())
    rng = random.Random(3)
    for _ in range(100):
        x, y = rng.uniform(0.0, 10.0), rng.uniform(-4.0, 0.0)
        assert table.at((x, y)) == pytest.approx(bilinear(x, y), rel=1e-12)
    assert [table.at((x, y)) for y in Y for x in X] == pytest.approx([bilinear(x, y) for y in Y for x in X])
    assert [table.at(p) for p in ((-0.01, 0.0), (25.01, 0.0), (5.0, -4.01), (5.0, 3.01))] == [None] * 4


@pytest.mark.parametrize("separator", [",", ";", "\t"])
def test_rows_and_columns_may_rise_or_fall_and_stand_apart_as_spreadsheets_have_it(separator):
    assert table_of(written(X[::-1], Y[::-1], separator)) == table_of(written())


def test_it_lies_on_the_base_and_beneath_the_patches():
    text = ", 0, 100\n-5, 0.3, 0.3\n5, 0.5, 0.5"
    size = {"cg_to_front_axle": 1.0, "cg_to_rear_axle": 2.0, "track_width": 2.0}
    road = Stand(Patchwork, friction_table=text, patches="0.1: x > 50", base_friction=0.9, **size)
    y = road.start(position_x=1.0)
    assert wheel_values(y, "friction") == pytest.approx([0.42, 0.38, 0.9, 0.9])
    y = road.step(0.001, position_x=50.5)
    assert wheel_values(y, "friction") == pytest.approx([0.1, 0.1, 0.42, 0.38])


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("y, 0, 10\n0, 0.9", "line 2: must have 2 values of friction, one for each x (got 1)"),
        ("y, 0, 10\n0, 0.9, wet\n1, 1, 1", "line 2: 'wet' is not a finite number"),
        ("y, 0, 10\n0, 0.9, 1e400\n1, 1, 1", "line 2: '1e400' is not a finite number"),
        ("y, 0, 10\n0, 0.9, -0.1\n1, 1, 1", "line 2: friction must not be negative (got -0.1)"),
        ("y, 0, 10\n0, 1, 1\n# more\n0, 1, 1", "line 4: there is already a row for y = 0"),
        ("y, 0, 10\n0, 1, 1", "a table needs at least two values of y (got 1)"),
        ("y, 0\n0, 1\n1, 1", "a table needs at least two values of x (got 1)"),
        ("y, 0, 20, 10\n0, 1, 1, 1\n1, 1, 1, 1", "values of x must strictly rise or fall"),
        ("y, 0, 1\n0, 1, 1\n2, 1, 1\n1, 1, 1", "values of y must strictly rise or fall"),
        ("y\n0\n1", "a table needs at least two values of x (got 0)"),
        ("x y friction", "a table needs at least two values of x (got 0)"),
    ],
)
def test_a_slip_in_it_is_told(text, said):
    with pytest.raises(ValueError, match=f"^{re.escape(said)}"):
        table_of(text)
    with pytest.raises(AssertionError, match="friction_table: "):
        Stand(Patchwork, friction_table=text).start()


def test_nothing_is_no_table():
    assert table_of("  # later\n") is None
    assert isinstance(table_of(written()), FrictionTable)
