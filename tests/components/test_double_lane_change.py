"""The track of ISO 3888-1 and the driver who takes it."""

from __future__ import annotations

import math
import random

import pytest

from yawbench.components.drivers.double_lane_change import DoubleLaneChange
from yawbench.components.driving.track import LaneChangeParameters, Track

from .stand import Stand

WIDTH = 1.85


def test_lanes_have_the_lengths_and_widths_of_the_standard():
    lanes = Track(LaneChangeParameters(vehicle_width=WIDTH, track_start=0.0)).lanes
    assert [(lane.start, lane.end) for lane in lanes] == [(0.0, 15.0), (45.0, 70.0), (95.0, 125.0)]
    widths = [1.1 * WIDTH + 0.25, 1.2 * WIDTH + 0.25, 1.3 * WIDTH + 0.25]
    assert [lane.left - lane.right for lane in lanes] == pytest.approx(widths)
    assert lanes[1].right - lanes[0].right == pytest.approx(3.5)
    assert lanes[2].right == pytest.approx(lanes[0].right)


def test_the_path_runs_along_the_middles_but_in_lane_three_and_is_level_where_lanes_end():
    track = Track(LaneChangeParameters(vehicle_width=WIDTH))
    first, second, third = track.lanes
    for lane, y in ((first, 0.0), (second, 3.5), (third, third.middle)):
        assert track.path(lane.start) == pytest.approx(y, abs=1e-12)
        assert track.path(lane.end) == pytest.approx(y, abs=1e-12)
        assert (track.path(lane.end + 1e-4) - track.path(lane.end)) / 1e-4 == pytest.approx(0.0, abs=1e-4)
    assert first.middle == pytest.approx(0.0, abs=1e-12)
    assert second.middle - 3.5 == pytest.approx(0.05 * WIDTH)
    assert track.path(0.5 * (first.end + second.start)) == pytest.approx(1.75)


def test_overrun_is_what_sticks_out_of_the_lane():
    track = Track(LaneChangeParameters())
    lane = track.lanes[0]
    inside = 0.5 * (lane.left - lane.right) - 0.5 * WIDTH
    x = 0.5 * (lane.start + lane.end)
    assert track.overrun(x, inside - 0.01, 0.0) == 0.0
    assert track.overrun(x, inside + 0.2, 0.0) == pytest.approx(0.2)
    assert track.overrun(lane.start - 30.0, 9.0, 0.0) == 0.0


def drive(speed, seconds=10.0, h=0.01):
    """Return the largest |path offset| [m] and overrun [m] of a car that answers at once."""
    stand = Stand(DoubleLaneChange, target_speed=speed)
    p = stand.unit
    x = y = psi = 0.0
    found = stand.start(velocity_x=speed, position_x=x, position_y=y, yaw_angle=psi)
    gain, _ = p.car.gains(speed)
    worst = overrun = 0.0
    for _ in range(round(seconds / h)):
        psi += h * gain * found["steer_angle"]
        x += h * speed * math.cos(psi)
        y += h * speed * math.sin(psi)
        found = stand.step(h, velocity_x=speed, position_x=x, position_y=y, yaw_angle=psi)
        worst = max(worst, abs(found["path_offset"]))
        overrun = max(overrun, found["cone_overrun"])
    return worst, overrun, found["path_offset"]


def test_a_slow_car_that_answers_at_once_stays_near_the_path_and_ends_on_it():
    worst, _, end = drive(10.0, 18.0)
    assert worst < 0.5
    assert end == pytest.approx(0.0, abs=0.02)


def test_hand_wheel_angle_and_rate_are_limited():
    stand = Stand(DoubleLaneChange)
    far = {"velocity_x": 25.0, "position_x": 0.0, "position_y": 50.0, "yaw_angle": 0.0}
    last = stand.start(**far)["steering_wheel_angle"]
    for _ in range(300):
        now = stand.step(0.01, **far)["steering_wheel_angle"]
        assert abs(now - last) <= 12.0 * 0.01 + 1e-12
        assert abs(now) <= 6.0 + 1e-12
        last = now
    assert last == pytest.approx(-6.0, rel=1e-6)


def test_the_lanes_of_part_2_have_the_lengths_widths_and_gap_of_the_standard():
    lanes = Track(LaneChangeParameters(vehicle_width=2.2, track_start=0.0, track_standard="iso_3888_2")).lanes
    assert [(lane.start, lane.end) for lane in lanes] == [(0.0, 12.0), (25.5, 36.5), (49.0, 61.0)]
    assert [lane.left - lane.right for lane in lanes] == pytest.approx(
        [1.1 * 2.2 + 0.25, 3.2, 1.3 * 2.2 + 0.25]
    )
    assert lanes[1].right - lanes[0].left == pytest.approx(1.0)
    narrow = Track(LaneChangeParameters(vehicle_width=1.7, track_standard="iso_3888_2")).lanes[2]
    assert narrow.left - narrow.right == 3.0  # at least


def clipped(polygon, a, b, c):
    """Return the part of a polygon with a x + b y <= c (Sutherland and Hodgman)."""
    kept = []
    for (x, y), (u, v) in zip(polygon, [*polygon[1:], *polygon[:1]], strict=True):
        one, other = c - a * x - b * y, c - a * u - b * v
        if one >= 0.0:
            kept.append((x, y))
        if one * other < 0.0:
            share = one / (one - other)
            kept.append((x + share * (u - x), y + share * (v - y)))
    return kept


def sticking_out(p, track, x, y, psi):
    """Return by how much [m] what of the body is between a lane's ends is beyond its borders."""
    c, s, half = math.cos(psi), math.sin(psi), 0.5 * p.vehicle_width
    front, rear = p.cg_to_front_end, -p.cg_to_rear_end
    corners = [(front, half), (front, -half), (rear, -half), (rear, half)]
    body = [(x + u * c - w * s, y + u * s + w * c) for u, w in corners]
    worst = 0.0
    for lane in track.lanes:
        part = clipped(clipped(body, -1.0, 0.0, -lane.start), 1.0, 0.0, lane.end)
        worst = max([worst, *(max(v - lane.left, lane.right - v) for _, v in part)])
    return worst


@pytest.mark.parametrize("standard, shortest", [("iso_3888_1", 25), ("iso_3888_2", 15)])
def test_the_largest_overrun_of_a_drive_is_that_of_the_outline_clipped_to_the_lanes(standard, shortest):
    """Within 15 mm, along paths that leave the lanes by up to 0.4 m; beyond, no cone stands any more."""
    p = LaneChangeParameters(track_standard=standard)
    track = Track(p)
    chance = random.Random(3)
    compared = 0
    while compared < 15:
        size, length, phase, shift = (
            chance.uniform(*r) for r in ((0.0, 0.4), (shortest, 60), (0, 6), (-0.2, 0.2))
        )

        def y_of(x, size=size, length=length, phase=phase, shift=shift):
            return track.path(x) + shift + size * math.sin(2 * math.pi * x / length + phase)

        most = clip = 0.0
        for k in range(720):
            x = 17.0 + 0.2 * k
            y, psi = y_of(x), math.atan((y_of(x + 0.01) - y_of(x - 0.01)) / 0.02)
            most = max(most, track.overrun(x, y, psi))
            clip = max(clip, sticking_out(p, track, x, y, psi))
        if 0.0 < clip < 0.4:
            compared += 1
            assert most == pytest.approx(clip, abs=0.015)
