"""What an animation carries of a run."""

from __future__ import annotations

import base64
import re
from dataclasses import replace

import numpy as np
import pytest

from components.driving.track import LaneChangeParameters, Track
from orchestrator.errors import ResultsError
from orchestrator.pages.animation import (
    FRAMES,
    data_of,
    force_scale,
    frames_of,
    page,
    rotated,
    still_of,
    thinned,
)
from tests.orchestrator.recorded import car, noted
from vocabulary.lane_change import lanes_of
from vocabulary.wheels import WHEELS

from .made_up import MU, SIZES, data_in, odd, whole_car, without


def unpacked(text: str) -> np.ndarray:
    return np.frombuffer(base64.b64decode(text), "<f4")


def test_thinning_keeps_both_ends_and_never_more_than_the_frames():
    for n in (2, 599, 600, 601, 8001, 50_000):
        kept = thinned(np.linspace(0.0, 8.0, n))
        assert kept[0] == 0 and kept[-1] == n - 1
        assert kept.size == min(n, FRAMES)
        assert np.all(np.diff(kept) > 0)


def test_thinning_is_even_in_time_where_samples_are_not():
    time = np.concatenate([np.linspace(0.0, 1.0, 9000, endpoint=False), np.linspace(1.0, 10.0, 1000)])
    kept = thinned(time)
    assert np.max(np.diff(time[kept])) < 2 * 10.0 / FRAMES
    assert kept[-1] == time.size - 1


def test_every_frame_is_a_recorded_sample():
    recorded = whole_car(n=8001)
    channels = frames_of(recorded).channels
    rows = np.searchsorted(recorded.time, channels["time"])
    np.testing.assert_array_equal(recorded.time[rows], channels["time"])
    np.testing.assert_array_equal(recorded["plant.position_x"][rows], channels["x"])
    np.testing.assert_array_equal(recorded["controller.yaw_moment"][rows], channels["yaw_moment"])


def test_a_quarter_turn_of_the_wheel_turns_its_axle_forces_to_the_side():
    x, y = rotated(np.array([100.0, 0.0]), np.array([0.0, 50.0]), np.full(2, np.pi / 2))
    np.testing.assert_allclose(x, [0.0, -50.0], atol=1e-12)
    np.testing.assert_allclose(y, [100.0, 0.0], atol=1e-12)


def test_front_forces_are_turned_into_vehicle_axes_and_rear_ones_are_not():
    recorded = whole_car()
    channels = frames_of(recorded).channels
    rows = thinned(recorded.time)
    delta = recorded["driver.steer_angle"][rows]
    f_x, f_y = (recorded[f"tyre.tyre_force_{axis}_fl"][rows] for axis in "xy")
    np.testing.assert_allclose(channels["force_x_fl"], f_x * np.cos(delta) - f_y * np.sin(delta))
    np.testing.assert_allclose(channels["force_y_fl"], f_x * np.sin(delta) + f_y * np.cos(delta))
    np.testing.assert_array_equal(channels["force_y_rl"], recorded["tyre.tyre_force_y_rl"][rows])


def test_a_mirrored_run_gives_the_mirrored_animation():
    left, right = frames_of(whole_car()).channels, frames_of(whole_car(mirrored=True)).channels
    assert set(left) == set(right)
    for name, values in left.items():
        other = name.translate(str.maketrans("lr", "rl")) if name[-3:-1] in ("_f", "_r") else name
        side = -1.0 if name in ("y", "yaw") or odd(name) or name.startswith("force_y") else 1.0
        swapped = f"{name[:-1]}{other[-1]}" if other != name else name
        np.testing.assert_array_equal(values, side * right[swapped], err_msg=name)


def test_the_radius_of_a_friction_circle_is_friction_times_load():
    channels = frames_of(whole_car()).channels
    assert channels["grip_fl"] == pytest.approx(MU * 3000.0 * 1.1 * 1.2)
    recorded = whole_car()
    rough = {f"road.friction_{w}": np.linspace(0.2, 0.8, recorded.time.size) for w in WHEELS}
    channels = frames_of(replace(recorded, columns={**recorded.columns, **rough})).channels
    assert channels["grip_rr"][[0, -1]] == pytest.approx([0.2 * 2160.0, 0.8 * 2160.0])


def test_the_friction_that_a_controller_believes_in_makes_no_circle():
    recorded = whole_car()
    fmus = {"reference": {"name": "reference_made_up", "constants": {"friction": 0.4}}}
    fmus["tyre"] = {"name": "tyre_made_up", "constants": {}}
    frames = frames_of(noted(recorded, fmus=fmus))
    assert "grip_fl" not in frames.channels
    assert frames.notes == ("friction or vertical loads were not recorded: no friction circles",)


def test_friction_circles_of_an_axle_touch_at_most():
    runs = [frames_of(whole_car()), frames_of(whole_car(2.0))]
    scale = force_scale(runs)
    widest = max(
        np.max(frames.channels[f"grip_{axle}l"] + frames.channels[f"grip_{axle}r"])
        for frames in runs
        for axle in "fr"
    )
    assert 0.9 * SIZES["track_width"] < widest * scale < SIZES["track_width"]


def test_channels_survive_the_page():
    recorded = whole_car()
    carried = data_in(page([("one", recorded)]))["runs"][0]["channels"]
    frames = frames_of(recorded).channels
    assert set(carried) == set(frames)
    for name, values in frames.items():
        np.testing.assert_array_equal(unpacked(carried[name]), values.astype(np.float32))


def test_the_still_picture_shows_the_largest_sideslip_of_all_runs():
    large = whole_car(2.0)
    large.columns["plant.sideslip"] *= np.where(large.time < 4.0, 1.0, 0.5)
    peak = large.time[np.argmax(np.abs(large["plant.sideslip"]))]
    assert peak == pytest.approx(2.25)
    assert still_of([frames_of(whole_car()), frames_of(large)]) == pytest.approx(peak, abs=8.0 / FRAMES)


def test_sizes_that_only_the_fmu_had_are_taken_from_its_defaults():
    recorded = whole_car()
    plant = {"name": "plant_made_up", "parameters": {"track_width": 1.7}, "defaults": SIZES}
    frames = frames_of(noted(recorded, fmus={"plant": plant}))
    assert (frames.car.front_axle, frames.car.rear_axle, frames.car.track) == (1.2, 1.5, 1.7)
    assert not frames.notes


def test_what_was_not_recorded_is_left_out_and_named():
    bare = frames_of(without(whole_car(), "tyre_force", "sideslip", "moment", "velocity"))
    assert not {"force_x_fl", "sideslip", "yaw_moment", "speed"} & set(bare.channels)
    assert bare.notes == ("tyre forces were not recorded",)
    straight = frames_of(without(whole_car(), "steer_angle"))
    assert straight.notes == ("the steer angle was not recorded: the front wheels are drawn straight",)
    loose = frames_of(without(whole_car(), "vertical_load"))
    assert loose.notes == ("friction or vertical loads were not recorded: no friction circles",)
    assert "force_x_fl" in loose.channels and "grip_fl" not in loose.channels
    assert frames_of(car()).notes[-1] == "the plant tells no sizes: a mid-size car is drawn"


def test_a_run_without_positions_cannot_be_animated_and_is_told_what_is_missing():
    with pytest.raises(
        ResultsError, match=r"position_x and position_y were not recorded; .* needs .*yaw_angle"
    ):
        frames_of(without(whole_car(), "position"))
    with pytest.raises(ResultsError, match="yaw_angle was not recorded"):
        frames_of(without(whole_car(), "yaw_angle"))


def test_a_failed_run_is_shown_as_far_as_it_goes():
    recorded = whole_car()
    recorded.columns["plant.position_y"][500:] = np.nan
    frames = frames_of(noted(recorded, status="failed"))
    assert frames.channels["time"][-1] == recorded.time[499]
    assert frames.notes == ("the run did not end as planned; shown until 4.99 s",)


def test_of_two_runs_the_shorter_says_when_it_ends():
    short = replace(
        (long := whole_car()),
        time=long.time[:401],
        columns={name: values[:401] for name, values in long.columns.items()},
    )
    data = data_of([("long", frames_of(long)), ("short", frames_of(short))])
    assert data["runs"][0]["notes"] == []
    assert data["runs"][1]["notes"] == ["this run ends at 4.00 s"]


@pytest.mark.parametrize(
    "change", [{}, {"lane_offset": -3.5}, {"transition_scale": 1.4, "track_start": 40.0}]
)
def test_lanes_are_those_of_the_driver(change):
    parameters = LaneChangeParameters(**{"vehicle_width": 1.7, **change})
    drawn = lanes_of(vars(parameters))
    np.testing.assert_allclose(drawn, Track(parameters).lanes, rtol=0, atol=1e-12)


def test_a_driver_without_a_track_has_no_lanes():
    assert lanes_of({"amplitude": 0.1, "vehicle_width": 1.8}) == []


def test_lanes_path_and_outline_come_from_the_recorded_driver():
    recorded = whole_car()
    driver = {"name": "driver_double_lane_change", "parameters": {"track_start": 30.0}}
    driver["defaults"] = vars(LaneChangeParameters())
    columns = {**recorded.columns, "driver.path_offset": np.full(recorded.time.size, 0.25)}
    frames = frames_of(replace(noted(recorded, fmus={"driver": driver}), columns=columns))
    assert [lane.start for lane in frames.lanes] == [30.0, 75.0, 125.0]
    assert (frames.car.front_end, frames.car.rear_end, frames.car.width) == (2.25, 2.65, 1.85)
    np.testing.assert_allclose(frames.channels["path_y"], frames.channels["y"] - 0.25)


def test_a_car_that_stands_has_no_sideslip_angle():
    recorded = whole_car()
    recorded.columns["plant.velocity_x"][400:] = 0.01
    recorded.columns["plant.velocity_y"] = np.zeros(recorded.time.size)
    channels = frames_of(recorded).channels
    stands = channels["time"] >= recorded.time[400]
    np.testing.assert_array_equal(np.isnan(channels["sideslip"]), stands)
    assert still_of([frames_of(recorded)]) < recorded.time[400]


def test_labels_cannot_break_out_of_the_page():
    nasty = '</script><img src=x onerror="boom()">'
    html = page([(nasty, whole_car())], title=nasty)
    assert "<img" not in html
    assert data_in(html)["runs"][0]["label"] == nasty


def test_a_page_of_two_long_runs_stays_below_half_a_megabyte():
    two = [("one", whole_car(n=60_001)), ("two", whole_car(2.0, n=60_001))]
    html = page(two)
    assert len(html.encode()) < 500_000
    assert not re.search(r"""(?:src|href)=(?!["']data:)|@import|url\(|fetch\(|XMLHttp""", html)
