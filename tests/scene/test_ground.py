"""The ground under the road of a viewer: the same friction at every place as the road gives its wheels."""

from __future__ import annotations

import numpy as np
import pytest

from tests.orchestrator.recorded import noted
from tests.refusals import mentions
from tests.reports.made_up import data_in, unpacked, whole_car
from yawbench.figures.display import LabelledRun
from yawbench.reports.viewer import viewer
from yawbench.scene.ground import POLYGONS, clipped, ground_of
from yawbench.vocabulary.friction_table import table_of
from yawbench.vocabulary.patches import friction_at, inside_polygon, patches_of

TEXTS = (
    "y > 0",
    "0.5: y > 0; 0.1: 20 < x < 30",
    "x % 40 < 20",
    "x % 4 < 2, y % 4 < 2; x % 4 > 2, y % 4 > 2",
    "(0 0) (40 0) (40 8) (20 2) (0 8), x > 10; 0.3: x % 20 > 10, x < 35, y < -3",
)


@pytest.mark.parametrize("text", TEXTS)
def test_the_piece_on_top_has_the_friction_of_the_place(text):
    given = {"patches": text, "base_friction": 0.8, "patch_friction": 0.2}
    pieces = ground_of(given, (0.0, 50.0), (-2.0, 2.0))
    rng = np.random.default_rng(4)
    for point in rng.uniform((-50.0, -27.0), (100.0, 27.0), (300, 2)):
        place = (float(point[0]), float(point[1]))
        drawn = next(piece.friction for piece in reversed(pieces) if inside_polygon(place, piece.corners))
        assert drawn == friction_at(place, patches_of(text), base=0.8, patch=0.2)


def test_around_every_point_of_a_table_lies_its_friction_beneath_the_patches():
    text = "corner, 60, 20, 10\n-30, 0.1, 0.2, 0.3\n0, 0.4, 0.5, 0.6"
    given = {"friction_table": text, "patches": "y > -1", "base_friction": 0.8, "patch_friction": 0.9}
    pieces = ground_of(given, (0.0, 50.0), (-2.0, 2.0))
    table = table_of(text)
    near = {(11.0, -26.0): (10, -30), (16.0, -3.0): (20, 0), (59.0, -16.0): (60, -30)}
    for place, point in near.items():
        drawn = next(piece.friction for piece in reversed(pieces) if inside_polygon(place, piece.corners))
        assert drawn == table.at(point)
    on = [[p.friction for p in pieces if inside_polygon(place, p.corners)] for place in ((30, 5), (9, -9))]
    assert on == [[0.8, 0.9], [0.8]]
    assert len(ground_of(given | {"patches": ""}, (0.0, 50.0), (-2.0, 2.0))) == 7


def test_a_polygon_is_clipped_to_its_part_within():
    assert set(clipped(((0, 0), (4, 0), (4, 4), (0, 4)), (1, 9), (-1, 2))) == {(1, 0), (4, 0), (4, 2), (1, 2)}
    assert clipped(((0, 0), (4, 0), (4, 4)), (5, 9), (0, 1)) == ()


def test_there_is_no_ground_without_patches_or_of_too_many_pieces():
    numbers = {"base_friction": 0.8, "patch_friction": 0.2}
    assert ground_of({"patches": "", **numbers}, (0, 9), (0, 9)) == []
    assert ground_of({}, (0, 9), (0, 9)) == []
    fine = {"patches": "x % 0.02 < 0.01", **numbers}
    assert ground_of(fine, (0, POLYGONS), (0, 9)) == []
    for text in ("x % 1e-9 < 5e-10", "x % 1e-310 > 0", "x % 0.1 < 0.05, x % 0.11 < 0.05, y > 0"):
        assert ground_of({"patches": text, **numbers}, (0, 9), (0, 9)) == []


def test_a_viewer_carries_the_ground_once_and_says_what_its_colours_mean():
    road = {"name": "road_a", "parameters": {"patches": "y > 0", "base_friction": 0.8}, "constants": {},
            "defaults": {"patch_friction": 0.2}}  # fmt: skip
    assert "slippery" not in unpacked(viewer([LabelledRun("a", whole_car())]))
    on_road = noted(whole_car(), fmus={"road": road})
    html = viewer([LabelledRun("a", on_road), LabelledRun("b", on_road)])
    data = data_in(html)
    assert [[friction for friction, _ in ground] for ground in data["grounds"]] == [[0.8, 0.2]]
    assert [one["road"]["ground"] for one in data["runs"]] == [0, 0]
    assert mentions(data["key"], "ground", "0.2", "0.8")
