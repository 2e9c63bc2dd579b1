"""Monitor by parity relations: which small faults it finds and locates, and what gives no alarm."""

from __future__ import annotations

from itertools import pairwise
from math import pi, radians, sin

import pytest

from yawbench.components.estimation.steered_track import SteeredTrack
from yawbench.components.monitors.parity import (
    ACCELEROMETER,
    GYRO,
    HAND_WHEEL,
    UNLOCATED,
    WHEEL,
    Parity,
    ParityParameters,
)
from yawbench.vocabulary.gravity import G

from .stand import Stand

H = 0.01
V = 20.0
CAR = ParityParameters()
NONE_USED = dict.fromkeys(
    ("uses_yaw_rate", "uses_acceleration", "uses_steer_angle", "uses_wheel_speeds"), False
)


class Car:
    """The single track on a dry road with the wheel speeds that belong to it."""

    def __init__(self):
        self.track = SteeredTrack(CAR)

    def signals(self, delta, v=V):
        self.track.advance(H, v, delta, 1.0, 0.0)
        r, half = self.track.yaw_rate, 0.5 * CAR.track_width
        wheels = {
            f"wheel_speed_{name}": (v + side * half * r) / CAR.wheel_radius
            for name, side in (("fl", -1), ("fr", 1), ("rl", -1), ("rr", 1))
        }
        return {"yaw_rate": r, "acceleration_y": self.track.acceleration, "steer_angle": delta, **wheels}


def watched(fault=None, until=8.0, v=V, amplitude=0.015, start=2.0, **parameters):
    """Return (time, outputs) of every step of a weave; `fault(signals)` changes signals from `start` on."""
    car, stand = Car(), Stand(Parity, **parameters)
    common = {"friction": 1.0, "yaw_moment_wanted": 100.0}
    stand.start(**car.signals(0.0, v), **common)
    seen = []
    for k in range(1, round(until / H)):
        signals = car.signals(amplitude * sin(pi * k * H), v)
        if fault and k * H >= start:
            signals |= fault(signals)
        seen.append((k * H, stand.step(H, **signals, **common)))
    return seen


def told(seen):
    """Return time and number of every fault that is output."""
    faults = [(0.0, 0.0), *((t, out["fault"]) for t, out in seen)]
    return [(t, now) for (_, before), (t, now) in pairwise(faults) if now != before]


def test_a_car_whose_signals_agree_keeps_its_moment():
    seen = watched(until=20.0)
    assert told(seen) == []
    assert {out["yaw_moment"] for _, out in seen} == {100.0}
    assert max(out["contradiction"] for _, out in seen) < 0.5


def off(name, by):
    return lambda signals: {name: signals[name] + by}


def times(name, factor):
    return lambda signals: {name: signals[name] * factor}


@pytest.mark.parametrize(
    ("fault", "number", "within"),
    [
        (off("yaw_rate", radians(3.0)), GYRO, 1.0),
        (off("yaw_rate", radians(-3.0)), GYRO, 1.0),
        (off("yaw_rate", radians(5.0)), GYRO, 0.7),
        (times("yaw_rate", 0.5), GYRO, 1.5),
        (off("acceleration_y", 1.0), ACCELEROMETER, 1.5),
        (off("acceleration_y", -2.0), ACCELEROMETER, 1.0),
        (off("steer_angle", radians(1.0)), HAND_WHEEL, 1.0),
        (times("wheel_speed_fl", 0.5), WHEEL, 0.3),
        (times("wheel_speed_rr", 1.1), WHEEL, 0.5),
        (times("wheel_speed_fr", 0.0), WHEEL, 0.3),
    ],
)
def test_a_small_fault_is_located_at_its_signal(fault, number, within):
    (*_, (at, last)) = told(watched(fault, **NONE_USED, until=2.0 + within + 0.5))[:2]
    assert last == number
    assert at <= 2.0 + within


@pytest.mark.parametrize(("name", "number"), [("yaw_rate", GYRO), ("acceleration_y", ACCELEROMETER)])
def test_a_signal_that_stands_still_or_jumps_is_found_within_the_time_of_stillness(name, number):
    for wrong in (0.0, 9.0):
        at, first = told(watched(lambda signals, wrong=wrong: {name: wrong}))[0]
        assert first == number
        assert at <= 2.0 + 0.35


def test_noise_of_the_gyro_is_averaged_out():
    signs = iter(range(10_000))
    noisy = watched(lambda signals: {"yaw_rate": signals["yaw_rate"] + radians(5.0) * (-1) ** next(signs)})
    assert told(noisy) == []


def test_a_contradiction_without_a_third_witness_is_told_and_takes_nothing_away():
    """After hand wheel and two wheels, gyro and accelerometer stand against each other."""
    faults = [
        (0.5, off("steer_angle", 0.02)),
        (3.0, times("wheel_speed_fl", 0.0)),
        (5.0, times("wheel_speed_rr", 0.0)),
        (7.0, off("yaw_rate", radians(4.0))),
    ]
    step = iter(range(10_000))

    def wrong(signals):
        t = next(step) * H
        return {name: value for at, fault in faults if t >= at for name, value in fault(signals).items()}

    seen = watched(wrong, start=H, until=12.0, **NONE_USED)
    assert [number for _, number in told(seen)] == [HAND_WHEEL, WHEEL, UNLOCATED]
    assert {out["yaw_moment"] for _, out in seen} == {100.0}


def test_an_unlocated_fault_becomes_located_once_the_evidence_is_clear():
    """A bias of the gyro on a road whose grip is told as used up: only time tells which signal is wrong."""
    seen = watched(
        off("yaw_rate", radians(4.0)), amplitude=0.0, evidence_time=4.0, ratio=0.1, **NONE_USED, until=12.0
    )
    numbers = [number for _, number in told(seen)]
    assert numbers[-1] == GYRO
    assert numbers in ([GYRO], [UNLOCATED, GYRO])


def test_the_moment_fades_for_good_where_control_needs_the_signal():
    seen = watched(off("yaw_rate", radians(4.0)), fade_time=0.2)
    at = told(seen)[-1][0]
    for t, out in seen:
        share = 1.0 if t <= at else max(0.0, 1.0 - (t - at) / 0.2)
        assert out["yaw_moment"] == pytest.approx(100.0 * share, abs=1e-6)


def test_at_walking_pace_nothing_is_judged():
    assert told(watched(off("yaw_rate", 1.0), v=4.0)) == []


def test_the_single_track_turns_as_its_formula_says_and_no_more_than_the_road_bears():
    track = SteeredTrack(CAR)
    for _ in range(500):
        track.advance(H, V, 0.01, 1.0, 0.0)
    a, b = CAR.cg_to_front_axle, CAR.cg_to_rear_axle
    c_f, c_r = CAR.cornering_stiffness_front, CAR.cornering_stiffness_rear
    length = a + b
    gradient = CAR.mass * (b * c_r - a * c_f) / (length**2 * c_f * c_r)
    # saturation makes 3 % at a fifth of the grip
    assert track.yaw_rate == pytest.approx(V * 0.01 / (length * (1.0 + gradient * V**2)), rel=0.05)
    assert track.acceleration == pytest.approx(V * track.yaw_rate, rel=1e-6)
    for _ in range(500):
        track.advance(H, V, 0.3, 0.3, 0.0)
    assert abs(track.yaw_rate) <= 1.3 * 0.3 * G / V
