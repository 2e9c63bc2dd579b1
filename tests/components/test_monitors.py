"""Monitor of redundant signals: what it takes for a fault and when, and what it lets pass."""

from __future__ import annotations

from itertools import pairwise
from math import cos, exp, pi, sin

import pytest

from yawbench.components.monitors.redundancy import ACCELEROMETER, GYRO, HAND_WHEEL, WHEEL, Redundancy
from yawbench.vocabulary.gravity import G

from .stand import Stand

H = 0.01
V, LENGTH, RADIUS = 20.0, 2.6, 0.313


def watched(signals, until=4.0, moment=1000.0, **parameters):
    """Return time, fault, moment and implied sideslip of every step; `signals(t)`: all but zeros."""
    stand = Stand(Redundancy, **parameters)
    at_rest = dict.fromkeys(("yaw_rate", "acceleration_y", "steer_angle"), 0.0)
    wheels = {f"wheel_speed_{w}": V / RADIUS for w in ("fl", "fr", "rl", "rr")}
    inputs = {**at_rest, **wheels, "friction": 1.0, "yaw_moment_wanted": moment}
    stand.start(**inputs | signals(0.0))
    seen = []
    for k in range(1, round(until / H)):
        out = stand.step(H, **inputs | signals(k * H))
        seen.append((k * H, out["fault"], out["yaw_moment"], out["implied_sideslip"]))
    return seen


def weaving(t, **other):
    """Return the signals of a neutral car in a weave that lasts, without sideslip."""
    r = 0.2 * sin(pi * t)
    return {"yaw_rate": r, "acceleration_y": V * r, "steer_angle": r * LENGTH / V, **other}


def found(seen):
    """Return the fault that was found first and when; None if there was none."""
    return next(((fault, t) for t, fault, *_ in seen if fault), None)


def told(seen):
    """Return the faults that were told, in their order."""
    faults = [fault for _, fault, *_ in seen]
    return [now for before, now in pairwise([0.0, *faults]) if now != before]


def test_a_car_whose_signals_agree_keeps_its_moment():
    seen = watched(weaving)
    assert found(seen) is None
    assert {moment for _, _, moment, _ in seen} == {1000.0}


@pytest.mark.parametrize(("name", "fault"), [("yaw_rate", GYRO), ("acceleration_y", ACCELEROMETER)])
def test_a_signal_that_stands_still_while_others_move_is_found_once_they_have(name, fault):
    frozen = weaving(1.0)[name]
    number, at = found(watched(lambda t: weaving(t, **({name: frozen} if t >= 1.0 else {}))))
    assert number == fault
    # 0.2 sin(pi t) has moved by 0.05 rad/s from t = 1 s on
    assert at == pytest.approx(1.0 + 0.0804 + 0.02, abs=2 * H)


@pytest.mark.parametrize(("name", "fault"), [("yaw_rate", GYRO), ("acceleration_y", ACCELEROMETER)])
def test_a_jump_that_no_car_makes_is_found_at_once(name, fault):
    number, at = found(watched(lambda t: weaving(t, **({name: 0.0} if t >= 1.5 else {}))))
    assert (number, at) == (fault, pytest.approx(1.5, abs=H / 2))


def test_the_implied_sideslip_of_a_bias_follows_its_washout_and_tells_which_of_the_two_is_wrong():
    def biased(t):  # from the start on
        return weaving(t, yaw_rate=weaving(t)["yaw_rate"] - 0.15)

    seen = watched(biased, until=0.8, largest_sideslip=10.0)
    for t, _, _, implied in seen:
        assert implied == pytest.approx(0.15 * (1.0 - exp(-t)), abs=0.15 * H)
    number, at = found(watched(biased))
    assert number == GYRO
    assert 0.15 * (1.0 - exp(-at)) == pytest.approx(0.12, abs=0.15 * H)
    assert found(watched(lambda t: weaving(t, acceleration_y=weaving(t)["acceleration_y"] + 0.15 * V)))[
        0
    ] == (ACCELEROMETER)


def test_a_hand_wheel_against_both_others_is_found_after_a_time_and_within_what_the_road_bears():
    wrong = watched(lambda t: weaving(t, steer_angle=-0.1) if t >= 1.0 else weaving(t))
    number, at = found(wrong)
    assert number == HAND_WHEEL
    assert at == pytest.approx(1.31, abs=3 * H)
    slippery = {"friction": 0.1 * V / G}  # at most 0.1 rad/s
    assert found(watched(lambda t: {"steer_angle": 0.2 * cos(t), **slippery})) is None


def test_a_wheel_off_the_others_is_found_one_that_only_slips_is_not():
    number, at = found(watched(lambda t: weaving(t, wheel_speed_rl=0.0) if t >= 1.0 else weaving(t)))
    assert (number, at) == (WHEEL, pytest.approx(1.3, abs=2 * H))
    assert found(watched(lambda t: weaving(t, wheel_speed_rl=0.75 * V / RADIUS))) is None
    assert found(watched(lambda t: weaving(t, wheel_speed_rl=0.0) if t % 0.3 < 0.2 else weaving(t))) is None


def test_the_moment_fades_and_stays_away():
    seen = watched(lambda t: weaving(t, wheel_speed_rl=0.0) if 1.0 <= t < 2.0 else weaving(t), fade_time=0.2)
    _, at = found(seen)
    for t, _, moment, _ in seen:
        share = 1.0 if t <= at else max(0.0, 1.0 - (t - at) / 0.2)
        assert moment == pytest.approx(1000.0 * share, abs=1e-6)
    assert seen[-1][1] == WHEEL


def test_at_walking_pace_nothing_is_judged():
    wheels = {f"wheel_speed_{w}": 2.9 / RADIUS for w in ("fl", "fr", "rl", "rr")}
    assert found(watched(lambda t: {**wheels, "yaw_rate": sin(50 * t), "wheel_speed_fl": 0.0})) is None


def test_a_fault_of_what_control_does_not_need_is_told_and_takes_nothing_away():
    seen = watched(lambda t: weaving(t, wheel_speed_rl=0.0), uses_wheel_speeds=False)
    assert found(seen)[0] == WHEEL
    assert {moment for _, _, moment, _ in seen} == {1000.0}


ONE_BY_ONE = {"uses_wheel_speeds": False, "uses_acceleration": False, "uses_steer_angle": False}


@pytest.mark.parametrize("first", ["wheel_speed_rl", "acceleration_y", "steer_angle"])
def test_after_a_fault_of_what_control_does_not_need_a_frozen_gyro_is_still_found(first):
    """The first signal is at a wrong constant from 0.5 s on, the gyro stands still from 2.5 s on."""
    frozen = {"yaw_rate": weaving(2.5)["yaw_rate"]}

    def faulty(t):
        wrong = {first: 0.1 if first == "steer_angle" else 0.0} if t >= 0.5 else {}
        return weaving(t, **wrong, **(frozen if t >= 2.5 else {}))

    seen = watched(faulty, **ONE_BY_ONE)
    number = {"wheel_speed_rl": WHEEL, "acceleration_y": ACCELEROMETER, "steer_angle": HAND_WHEEL}[first]
    assert told(seen) == [number, GYRO]
    at = next(t for t, fault, *_ in seen if fault == GYRO)
    assert 2.5 < at < 2.8
    assert [moment for t, _, moment, _ in seen if t < at] == [1000.0] * round(at / H - 1)
    assert seen[-1][2] == 0.0


def test_a_gyro_that_is_off_is_found_without_the_hand_wheel():
    def faulty(t):
        wrong = {"steer_angle": 0.1} if t < 2.0 else {"yaw_rate": weaving(t)["yaw_rate"] - 0.05 * (t - 2.0)}
        return weaving(t, **wrong)

    assert told(watched(faulty, until=8.0, **ONE_BY_ONE)) == [HAND_WHEEL, GYRO]


def test_wheels_that_all_contradict_each_other_end_the_watch_and_keep_the_moment():
    apart = {f"wheel_speed_{w}": V / RADIUS * part for w, part in zip(("fl", "fr"), (0.0, 0.1), strict=True)}
    seen = watched(lambda t: weaving(t, **apart), **ONE_BY_ONE)
    assert found(seen)[0] == WHEEL
    assert (seen[-1][1], seen[-1][2]) == (WHEEL, 1000.0)


def test_a_car_that_understeers_is_no_faulty_hand_wheel_where_that_is_known():
    def turned(t):
        r = 0.4 * sin(pi * t / 2)  # at its characteristic speed it takes twice the steering of a neutral car
        return {"yaw_rate": r, "acceleration_y": V * r, "steer_angle": 2 * r * LENGTH / V}

    assert found(watched(turned))[0] == HAND_WHEEL
    assert found(watched(turned, characteristic_speed=V)) is None
