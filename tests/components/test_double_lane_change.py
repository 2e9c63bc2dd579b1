"""The track of ISO 3888-1 and the driver who takes it."""

from __future__ import annotations

import math

import pytest

from components.drivers.double_lane_change import DoubleLaneChange
from components.driving.track import LaneChangeParameters, Track

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


def test_a_negative_offset_mirrors_the_track():
    left, right = (Track(LaneChangeParameters(lane_offset=side * 3.5)) for side in (1.0, -1.0))
    for x in range(0, 180, 7):
        assert right.path(x) == -left.path(x)
        assert right.overrun(x, -1.0, -0.05) == left.overrun(x, 1.0, 0.05)


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
