"""Made-up recordings with one flaw each: it is named, and no other."""

from __future__ import annotations

import json
from collections import namedtuple
from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from tests.refusals import mentions
from yawbench.measured_cars.flaws import FlawKind, flaws_of
from yawbench.measured_cars.single_track import effects_in
from yawbench.measurements.measurement import load_measurement

T = np.arange(0.0, 30.0, 0.01)
Drive = Callable[[int], tuple[np.ndarray, np.ndarray]]


Car = namedtuple("Car", "mass inertia a b front rear friction ratio")
"""A single-track car whose tyres saturate, SI."""


SALOON = Car(1600.0, 2400.0, 1.2, 1.5, 90e3, 110e3, 1e3, 16.0)  # its tyres are linear
SPORT = Car(1300.0, 1700.0, 1.3, 1.2, 110e3, 150e3, 1.2, 12.0)


def drive(seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Return hand-wheel angle and speed of two sines."""
    hand = 0.6 * np.sin((0.8 + 0.1 * seed) * T) + 0.4 * np.sin(2.3 * T + seed)
    return hand, 22.0 + 4.0 * np.sin(0.2 * T + seed)


def lane_changes(seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Return hand-wheel angle and speed of lane changes of any length to any side."""
    chance, hand, begin = np.random.default_rng(seed), np.zeros(T.size), 1.0
    while begin < T[-1] - 5.0:
        length = chance.uniform(1.5, 3.0)
        change = (begin < T) & (begin + length > T)
        size = chance.choice([-1.0, 1.0]) * chance.uniform(0.3, 0.9)
        hand[change] = size * np.sin(2.0 * np.pi * (T[change] - begin) / length)
        begin += length + chance.uniform(0.5, 2.0)
    return hand, 24.0 + 5.0 * np.sin(0.25 * T + seed)


@cache
def recording(seed: int, car: Car = SALOON, driven: Drive = drive) -> dict[str, np.ndarray]:
    """Return a drive of a single-track car with noise of production sensors, in SI."""
    noise = np.random.default_rng(seed)
    hand, v = driven(seed)
    most = car.friction * car.mass * 9.81 / (car.a + car.b) * np.array([car.b, car.a])
    v_y = r = 0.0
    found = []
    for k in range(T.size):
        slips = (v_y + car.a * r) / v[k] - hand[k] / car.ratio, (v_y - car.b * r) / v[k]
        force_f, force_r = -most * np.tanh(np.array([car.front, car.rear]) * slips / most)
        found.append((r, v_y, (force_f + force_r) / car.mass))
        v_y += 0.01 * ((force_f + force_r) / car.mass - r * v[k])
        r += 0.01 * (car.a * force_f - car.b * force_r) / car.inertia
    r_, v_y_, a_y = np.array(found).T
    return {
        "steering_wheel_angle": hand + noise.normal(0.0, 0.002, T.size),
        "yaw_rate": r_ + noise.normal(0.0, np.radians(0.1), T.size),
        "acceleration_y": a_y + noise.normal(0.0, 0.05, T.size),
        "velocity_x": v + noise.normal(0.0, 0.03, T.size),
        "velocity_y": v_y_ + noise.normal(0.0, 0.02, T.size),
    }


UNITS = {"yaw_rate": "rad/s", "acceleration_y": "m/s2", "velocity_x": "m/s", "velocity_y": "m/s"}
UNITS |= {"steering_wheel_angle": "rad", "position_x": "m", "position_y": "m"}


def write(folder: Path, signals: dict[str, np.ndarray], time: np.ndarray = T) -> Path:
    """Write a recording and its measurement file."""
    table = np.column_stack([time, *signals.values()])
    np.savetxt(folder / "run.csv", table, "%.9g", ",", header=",".join(["time", *signals]), comments="")
    lines = [f"  {name}: {{column: {name}, unit: {UNITS[name]}}}" for name in signals]
    path = folder / "measured.yaml"
    path.write_text("\n".join(["files: [run.csv]", "time: {column: time, unit: s}", "signals:", *lines, ""]))
    return path


def spoilt(signals: dict[str, np.ndarray], spoil: Callable[..., None]) -> dict[str, np.ndarray]:
    """Return a copy of a recording with a flaw."""
    copy = {name: x.copy() for name, x in signals.items()}
    spoil(copy)
    return copy


SIDE, BOTH = "acceleration_y", "yaw_rate, acceleration_y"
SEEDS = (0, *(pytest.param(seed, marks=pytest.mark.exhaustive) for seed in (1, 2)))


@pytest.mark.parametrize("seed", SEEDS)
def test_a_clean_recording_has_no_flaw(seed, tmp_path):
    assert flaws_of(write(tmp_path, recording(seed))) == ()


def late(name: str):
    def spoil(signals: dict[str, np.ndarray]) -> None:
        signals[name] = np.interp(T - 0.02, T, signals[name])

    return spoil


def elsewhere(signals: dict[str, np.ndarray]) -> None:
    smooth = np.convolve(signals["yaw_rate"], np.ones(9) / 9.0, "same")
    signals["acceleration_y"] += 0.8 * np.gradient(smooth, T)


def spiked(signals: dict[str, np.ndarray]) -> None:
    signals["yaw_rate"][[300, 900, 1700]] += 2.0


def altered(name: str, factor: float = 1.0, *, by: float = 0.0):
    def spoil(signals: dict[str, np.ndarray]) -> None:
        signals[name] = factor * signals[name] + by

    return spoil


FLAWS = {
    "sign": (altered("acceleration_y", -1.0), "sign", "acceleration_y", -1.0, 0.0),
    "57.3": (altered("yaw_rate", np.pi / 180.0), "factor", "yaw_rate", np.pi / 180.0, 1e-9),
    "9.81": (altered("acceleration_y", 1.0 / 9.80665), "factor", "acceleration_y", 1.0 / 9.80665, 1e-9),
    "3.6": (altered("velocity_x", 1.0 / 3.6), "factor", "velocity_x", 1.0 / 3.6, 1e-9),
    "lag": (late("acceleration_y"), "lag", "acceleration_y", 0.02, 0.001),
    "lag of the gyro": (late("yaw_rate"), "lag", "yaw_rate", 0.02, 0.002),
    "sign of v_y": (altered("velocity_y", -1.0), "sign", "velocity_y", -1.0, 0.0),
    "offset": (altered("acceleration_y", by=0.4), "zero", "acceleration_y", 0.4, 0.02),
    "spikes": (spiked, "spikes", "yaw_rate", 3, 0),
    "place": (elsewhere, "position", "acceleration_y", 0.8, 0.1),
}


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize(("spoil", "kind", "name", "value", "within"), FLAWS.values(), ids=FLAWS)
def test_that_flaw_is_named_and_no_other(spoil, kind, name, value, within, seed, tmp_path):
    (flaw,) = flaws_of(write(tmp_path, spoilt(recording(seed), spoil)))
    assert (flaw.kind, flaw.signal) == (kind, name)
    assert flaw.value == pytest.approx(value, abs=within)


JITTERS = ("of the sampling", "of the times alone")


def jittered(
    signals: dict[str, np.ndarray], which: str | None, kind: str = ""
) -> tuple[dict[str, np.ndarray], np.ndarray]:
    """Return signals and times that jitter by 3 ms: sampled at these times, or only said to be.

    Samples of a spike are not between others, so a recording with spikes is always of the second kind.
    """
    if not which:
        return signals, T
    times = T + np.random.default_rng(0).uniform(-0.003, 0.003, T.size)
    if which == "of the times alone" or kind == "spikes":
        return signals, times
    return {name: np.interp(times, T, x) for name, x in signals.items()}, times


@pytest.mark.sampled(2)
@pytest.mark.parametrize("which", JITTERS)
@pytest.mark.parametrize("car, driven", [(SALOON, drive), (SPORT, lane_changes)], ids=["saloon", "sport"])
def test_jitter_hides_no_flaw(which, car, driven, tmp_path):
    whole = recording(1, car, driven)
    (alone,) = flaws_of(write(tmp_path, *jittered(whole, which)))
    assert alone.kind is FlawKind.UNEVEN_TIME
    assert "even times" in alone.text and "interpolate" in alone.text  # what to do about it
    for spoil, kind, name, value, within in FLAWS.values():
        found = flaws_of(write(tmp_path, *jittered(spoilt(whole, spoil), which, kind)))
        assert {(flaw.kind.value, flaw.signal) for flaw in found} == {("uneven time", ""), (kind, name)}
        (flaw,) = [flaw for flaw in found if flaw.kind == kind]
        assert flaw.value == pytest.approx(value, abs=max(2.0 * within, 1e-9))


@pytest.mark.parametrize(
    ("gaps", "jitter"),
    [
        ([(12.0, 14.5)], None),  # at a swing
        ([(8.0, 8.1)], JITTERS[0]),
        ([(5.0, 5.3), (12.0, 14.5), (20.0, 21.0)], JITTERS[1]),
    ],
)
def test_gaps_hide_no_flaw_and_make_none(gaps, jitter, tmp_path):
    kept = np.ones(T.size, dtype=bool)
    for begin, end in gaps:
        kept &= (begin + 1e-9 >= T) | (end - 1e-9 <= T)
    uneven = [("uneven time", "")] * (jitter is not None)
    for spoil, kind, name, _, _ in [(dict, None, "", 0.0, 0.0), *FLAWS.values()]:
        signals, times = jittered(spoilt(recording(0), spoil), jitter, kind)
        found = flaws_of(write(tmp_path, {key: x[kept] for key, x in signals.items()}, times[kept]))
        lost = [flaw for flaw in found if flaw.kind is FlawKind.GAP]
        assert [flaw.gap for flaw in lost] == [pytest.approx(gap, abs=0.0031) for gap in gaps]
        others = [flaw for flaw in found if flaw not in lost]
        if kind == "lag" and len(gaps) > 1:  # what is left of the drive tells a lag from a position less well
            assert any(name in f"{flaw.signal} {flaw.text}" for flaw in others)
        else:
            wanted = {*uneven, *([(kind, name)] if kind else [])}
            assert {(flaw.kind.value, flaw.signal) for flaw in others} == wanted


@pytest.mark.parametrize("reversed_", ["yaw_rate", "acceleration_y"])
@pytest.mark.parametrize("jitter", [None, *JITTERS])
def test_without_a_steering_signal_both_of_two_opposed_signals_are_named(reversed_, jitter, tmp_path):
    whole = spoilt(recording(0), altered(reversed_, -1.0))
    del whole["velocity_y"]
    alone = {name: x for name, x in whole.items() if name != "steering_wheel_angle"}
    still = whole | {"steering_wheel_angle": np.zeros(T.size)}  # decides nothing either
    for signals, blamed in ((whole, reversed_), (alone, BOTH), (still, BOTH)):
        found = flaws_of(write(tmp_path, *jittered(signals, jitter)))
        (flaw,) = [flaw for flaw in found if flaw.kind is FlawKind.SIGN]
        assert flaw.signal == blamed
        if blamed is BOTH:
            assert "steering_wheel_angle" in flaw.text and "do not tell which" in flaw.text


def test_signals_of_a_straight_drive_contradict_nothing(tmp_path):
    rng = np.random.default_rng(0)
    signals = {
        "yaw_rate": rng.normal(0.0, 0.01, T.size),
        "acceleration_y": rng.normal(0.0, 1.5, T.size),
        "velocity_x": 30.0 + rng.normal(0.0, 0.03, T.size),
    }
    assert flaws_of(write(tmp_path, signals)) == ()


@pytest.mark.parametrize("lacking", ["yaw_rate", "acceleration_y", "velocity_x"])
def test_no_flaws_without_a_comparison_says_what_was_not_examined(lacking, tmp_path, yawbench):
    path = write(tmp_path, {name: x for name, x in recording(0).items() if name != lacking})
    status, _, said = yawbench("measured", "show", path)
    assert status == 0 and mentions(said, "not examined", lacking)
    assert json.loads(yawbench("measured", "show", path, "--json")[1])["examined"] is False


@pytest.mark.parametrize("kind", ["repeated", "restarts"])
def test_times_that_do_not_increase_are_named(kind, tmp_path):
    time = T.copy()
    if kind == "repeated":
        time[1000] = time[999]
    else:
        time[1500:] -= time[1500]
    (flaw,) = flaws_of(write(tmp_path, recording(0), time))
    assert flaw.kind is FlawKind.REFUSED
    assert {"repeated": "occurs twice", "restarts": "goes back"}[kind] in flaw.text


def test_the_command_lists_segments_flaws_and_effects_and_draws_the_signals(tmp_path, yawbench):
    path = write(tmp_path, recording(0))
    path.write_text(path.read_text() + VEHICLE)
    status, shown, _ = yawbench("measured", "show", path, "--out", tmp_path / "signals.svg")
    assert status == 0 and (tmp_path / "signals.svg").is_file()
    assert "run.csv" in shown and "stiffness_front" in shown
    status, _, said = yawbench("measured", "show", path, "--out", tmp_path / "signals.doc")
    assert status == 2 and mentions(said.splitlines()[-1], "--out", "signals.doc")
    status, _, said = yawbench("measured", "show", write(tmp_path, spoilt(recording(0), late(SIDE))))
    assert status == 1 and "acceleration_y: lags by" in said


@pytest.mark.parametrize(("factor", "named"), [(1.0, False), (1.08, True)])
def test_a_speed_other_than_that_of_the_position_is_named(factor, named, tmp_path):
    rng = np.random.default_rng(4)
    speed, heading = 22.0 + 4.0 * np.sin(0.2 * T), 0.3 * np.sin(0.3 * T)
    x, y = (np.cumsum(speed * part(heading)) * 0.01 for part in (np.cos, np.sin))
    signals = {"velocity_x": factor * speed, "position_x": x + rng.normal(0.0, 0.02, T.size)}
    signals["position_y"] = y + rng.normal(0.0, 0.02, T.size)
    flaws = flaws_of(write(tmp_path, signals))
    assert [(flaw.kind, flaw.signal) for flaw in flaws] == [("factor", "velocity_x")] * named
    assert not named or flaws[0].value == pytest.approx(factor, rel=5e-3)


VEHICLE = "vehicle: {mass: 1600 kg, cg_to_front_axle: 1.2 m, cg_to_rear_axle: 1.5 m, steering_ratio: 16}\n"


@pytest.mark.parametrize(("factor", "friction_seen"), [(0.2, False), (1.2, True)])
def test_a_gentle_drive_shows_stiffnesses_and_no_friction(factor, friction_seen, tmp_path):
    less = spoilt(spoilt(recording(0), altered("steering_wheel_angle", factor)), altered(SIDE, factor))
    path = write(tmp_path, less)
    path.write_text(path.read_text() + VEHICLE)
    seen = {effect.parameter: effect.seen for effect in effects_in(load_measurement(path))}
    assert seen["stiffness_front"] and seen["stiffness_rear"]
    assert seen["friction_front"] == friction_seen
