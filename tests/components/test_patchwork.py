"""The road of patches and its table of friction: friction by place, slope and bank, wind."""

from __future__ import annotations

import random
import re
from math import atan2, pi, radians, sin

import pytest

from yawbench.components.roads.patchwork import Patchwork, inclination, section
from yawbench.vocabulary.friction_table import FrictionTable, table_of
from yawbench.vocabulary.patches import friction_at, patches_of

from .stand import Stand, wheel_values
from .test_conformance import mirrored

SIZE = {"cg_to_front_axle": 1.0, "cg_to_rear_axle": 2.0, "track_width": 1.5}


def at(x: float, y: float, text: str) -> float:
    return friction_at((x, y), patches_of(text), base=0.9, patch=0.2)


@pytest.mark.parametrize(
    ("text", "inside", "outside"),
    [
        ("y > 0", [(5, 0.1), (-1e5, 1e5)], [(5, -0.1)]),
        ("y<-1.5", [(0, -2)], [(0, -1.5), (0, 0)]),
        ("60 < x < 80", [(60, 9), (79.9, -9)], [(59.9, 0), (80, 0)]),
        ("x % 40 < 20", [(45, 0), (-25, 0), (0, 0)], [(35, 0), (-5, 0)]),
        ("x % 10 < 5, y % 3 < 1.5", [(1, 1), (11, 4), (-9, -2)], [(6, 1), (1, 2)]),
        ("(20 0) (45 0) (30 2)", [(30, 1), (40, 0.5)], [(21, 1), (44, 1), (30, 2.1), (30, -0.1)]),
        ("(0 0) (4 0) (4 4) (2 1) (0 4), x > 1", [(1.5, 1), (3.5, 3)], [(0.5, 1), (2, 3)]),
        ("x > 90; (0, 0) (1, 0) (0, 1)  # a remark; y > 0", [(91, -5), (0.2, 0.2)], [(50, 50)]),
        ("", [], [(0, 0)]),
    ],
)
def test_a_patch_is_where_its_text_says(text, inside, outside):
    assert [at(*point, text) for point in inside] == [0.2] * len(inside)
    assert [at(*point, text) for point in outside] == [0.9] * len(outside)


def test_a_chequerboard_is_two_patches_and_covers_half_of_any_period():
    board = "x % 10 < 5, y % 3 < 1.5\nx % 10 > 5, y % 3 > 1.5"
    points = [(0.25 + 0.5 * i, 0.05 + 0.1 * j) for i in range(20) for j in range(30)]
    assert sum(at(x, y, board) == 0.2 for x, y in points) == len(points) // 2
    assert all(at(x, y, board) != at(x + 5, y, board) != at(x + 5, y + 1.5, board) for x, y in points)


def test_a_later_patch_lies_upon_earlier_ones_with_its_own_friction():
    assert at(70, 1, "0.5: y > 0; 0.1: 60 < x < 80") == 0.1
    assert at(70, 1, "0.1: 60 < x < 80; 0.5: y > 0") == 0.5
    assert at(50, 1, "0.5: y > 0; 0.1: 60 < x < 80") == 0.5


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("z > 3", "'z > 3' is not a patch (in 'z > 3'): write 'y > 0', "),
        ("x", "'x' is not a patch"),
        ("3 < x > 5", "'3 < x > 5' is not a patch"),
        ("y > 0,", "'' is not a patch (in 'y > 0,')"),
        ("80 < x < 60", "'80 < x < 60' is true nowhere"),
        ("x % 10 > 12", "'x % 10 > 12' is true nowhere"),
        ("x % 0 > 1", "'x % 0 > 1': the period after % must be above zero"),
        ("(0 0) (1 1)", "'(0 0) (1 1)': a polygon needs three or more corners"),
        ("(0 0) (1 1) (2)", "'(0 0) (1 1) (2)': a polygon needs three or more corners"),
        ("1e400: y > 0", "the number 1e400 is too large (in '1e400: y > 0')"),
        ("x % 1e400 > 1", "the number 1e400 is too large"),
        ("(0 0) (1e400 1) (2 0)", "the number 1e400 is too large"),
        ("-0.1: y > 0", "the friction of a patch must not be negative (got '-0.1: y > 0')"),
    ],
)
def test_a_slip_in_the_text_is_told(text, said):
    with pytest.raises(ValueError, match=f"^{re.escape(said)}"):
        patches_of(text)
    with pytest.raises(AssertionError, match="patches: "):
        Stand(Patchwork, patches=text).start()


def test_each_wheel_has_the_friction_of_its_place():
    road = Stand(Patchwork, patches="0.1: x > 0.5, y > 0; 0.3: x < -0.5, y < 0", **SIZE)
    y = road.start()
    assert wheel_values(y, "friction") == [0.1, 0.9, 0.9, 0.3]
    assert y["friction"] == pytest.approx(0.55)
    y = road.step(0.001, yaw_angle=pi)  # turned about: the rear is where the front was
    assert wheel_values(y, "friction") == [0.3, 0.9, 0.9, 0.1]
    y = road.step(0.001, yaw_angle=0.0, position_x=1.6)
    assert wheel_values(y, "friction") == [0.1, 0.9, 0.9, 0.9]


@pytest.mark.parametrize(
    ("one", "other"),
    [
        ({"patches": "y > 0"}, {"patches": "y < 0"}),
        ({"patches": "0.4: (0 0) (30 1) (9 5)"}, {"patches": "0.4: (0 0) (30 -1) (9 -5)"}),
        ({"road_bank": 0.05, "road_slope": 0.1}, {"road_bank": -0.05, "road_slope": 0.1}),
        ({"wind_force": 900.0, "wind_start": 3.0}, {"wind_force": -900.0, "wind_start": 3.0}),
    ],
)
def test_the_mirrored_road_gives_the_mirrored_wheels_to_the_bit(one, other):
    rng = random.Random(7)
    left, right = Stand(Patchwork, **one), Stand(Patchwork, **other)
    left.start()
    right.start()
    for _ in range(300):
        place = {
            "position_x": rng.uniform(-5, 30),
            "position_y": rng.uniform(-5, 5),
            "yaw_angle": rng.uniform(-2, 2),
        }
        assert right.step(0.01, **mirrored(place)) == mirrored(left.step(0.01, **place))


def test_the_delayed_friction_follows_the_truth_after_its_delay():
    road = Stand(Patchwork, patches="x > 10", friction_delay=0.3, **SIZE)
    road.start()
    known, told = [], []
    for k in range(1, 1001):
        y = road.step(0.001, position_x=0.02 * k)  # 20 m/s
        known.append(y["friction"])
        told.append(y["friction_delayed"])
    assert {0.9, 0.2} < set(known)  # one axle after the other
    assert known[0] == told[0] == 0.9
    changes = [[i for i in range(999) if column[i + 1] != column[i]] for column in (known, told)]
    assert [b - a for a, b in zip(*changes, strict=True)] == pytest.approx([300, 300], abs=1)


def test_slope_and_bank_are_those_of_one_plane_whichever_way_the_car_looks():
    sigma, epsilon = radians(8), radians(-5)
    assert inclination(sigma, epsilon, 0.0) == pytest.approx((sigma, epsilon))
    assert inclination(sigma, epsilon, pi / 2) == pytest.approx((epsilon, -sigma))
    assert inclination(sigma, epsilon, pi) == pytest.approx((-sigma, -epsilon))
    for psi in (0.4, 2.5, -1.9):  # the normal of the plane stays where it is
        slope, bank = inclination(sigma, epsilon, psi)
        assert sin(slope) ** 2 + sin(bank) ** 2 == pytest.approx(sin(sigma) ** 2 + sin(epsilon) ** 2)
    downhill = atan2(sin(epsilon), sin(sigma)) + pi
    assert inclination(sigma, epsilon, downhill + pi / 2)[0] == pytest.approx(0.0, abs=1e-15)


def test_inclines_and_gusts_hold_on_their_sections_and_come_and_go_in_proportion():
    assert [section(x, 10.0, 20.0, 4.0) for x in (5, 6, 8, 10, 15, 20, 21, 24)] == [
        0, 0, 0.5, 1, 1, 1, 0.75, 0,
    ]  # fmt: skip
    assert [section(x, 10.0, 20.0, 0.0) for x in (9.99, 10, 20, 20.01)] == [0, 1, 1, 0]
    gust = {"wind_force": 1000.0, "wind_arm": 0.5, "wind_start": 10.0, "wind_end": 20.0, "wind_run": 4.0}
    road = Stand(Patchwork, road_slope=0.1, incline_start=50.0, incline_run=10.0, **gust)
    road.start()
    y = road.step(0.001, position_x=8.0)
    assert (y["wind_force_y"], y["wind_moment_z"], y["slope"], y["bank"]) == (500.0, 250.0, 0.0, 0.0)
    y = road.step(0.001, position_x=45.0)
    assert (y["wind_force_y"], y["slope"]) == (0.0, pytest.approx(0.05))
    with pytest.raises(AssertionError, match="steeper than 45 degrees"):
        Stand(Patchwork, road_slope=0.7, road_bank=-0.7).start()


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


def test_the_table_lies_on_the_base_and_beneath_the_patches():
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
def test_a_slip_in_the_table_is_told(text, said):
    with pytest.raises(ValueError, match=f"^{re.escape(said)}"):
        table_of(text)
    with pytest.raises(AssertionError, match="friction_table: "):
        Stand(Patchwork, friction_table=text).start()


def test_nothing_is_no_table():
    assert table_of("  # later\n") is None
    assert isinstance(table_of(written()), FrictionTable)
