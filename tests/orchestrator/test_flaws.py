"""Made-up recordings with one flaw each: it is named, and no other."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from orchestrator.measured.flaws import flaws_of
from tests.commands import status_of

T = np.arange(0.0, 30.0, 0.01)


def recording(seed: int) -> dict[str, np.ndarray]:
    """Return a drive of a single-track car with noise of production sensors, in SI."""
    noise = np.random.default_rng(seed)
    v = 22.0 + 4.0 * np.sin(0.2 * T + seed)
    hand = 0.6 * np.sin((0.8 + 0.1 * seed) * T) + 0.4 * np.sin(2.3 * T + seed)
    m, inertia, a, b, c_f, c_r = 1600.0, 2400.0, 1.2, 1.5, 90e3, 110e3
    v_y = r = 0.0
    found = []
    for k in range(T.size):
        force_f = -c_f * ((v_y + a * r) / v[k] - hand[k] / 16.0)
        force_r = -c_r * (v_y - b * r) / v[k]
        found.append((r, v_y, (force_f + force_r) / m))
        v_y += 0.01 * ((force_f + force_r) / m - r * v[k])
        r += 0.01 * (a * force_f - b * force_r) / inertia
    r_, v_y_, a_y = np.array(found).T
    return {
        "steering_wheel_angle": hand + noise.normal(0.0, 0.002, T.size),
        "yaw_rate": r_ + noise.normal(0.0, np.radians(0.1), T.size),
        "acceleration_y": a_y + noise.normal(0.0, 0.05, T.size),
        "velocity_x": v + noise.normal(0.0, 0.03, T.size),
        "velocity_y": v_y_ + noise.normal(0.0, 0.02, T.size),
    }


def write(folder: Path, signals: dict[str, np.ndarray], time: np.ndarray = T) -> Path:
    """Write a recording and its measurement file."""
    units = dict(zip(signals, ("rad", "rad/s", "m/s2", "m/s", "m/s"), strict=True))
    table = np.column_stack([time, *signals.values()])
    np.savetxt(folder / "run.csv", table, "%.9g", ",", header=",".join(["time", *signals]), comments="")
    lines = [f"  {name}: {{column: {name}, unit: {unit}}}" for name, unit in units.items()]
    path = folder / "measured.yaml"
    path.write_text("\n".join(["files: [run.csv]", "time: {column: time, unit: s}", "signals:", *lines, ""]))
    return path


SEEDS = range(3)


@pytest.mark.parametrize("seed", SEEDS)
def test_a_clean_recording_has_no_flaw(seed, tmp_path):
    assert flaws_of(write(tmp_path, recording(seed))) == ()


def late(signals: dict[str, np.ndarray]) -> None:
    signals["acceleration_y"] = np.interp(T - 0.02, T, signals["acceleration_y"])


def elsewhere(signals: dict[str, np.ndarray]) -> None:
    signals["acceleration_y"] += 0.8 * np.gradient(
        np.convolve(signals["yaw_rate"], np.ones(9) / 9.0, "same"), T
    )


def spiked(signals: dict[str, np.ndarray]) -> None:
    signals["yaw_rate"][[300, 900, 1700]] += 2.0


def scaled(name: str, factor: float):
    def spoil(signals: dict[str, np.ndarray]) -> None:
        signals[name] *= factor

    return spoil


def shifted(name: str, by: float):
    def spoil(signals: dict[str, np.ndarray]) -> None:
        signals[name] += by

    return spoil


FLAWS = {
    "sign": (scaled("acceleration_y", -1.0), "sign", "acceleration_y", -1.0, 0.0),
    "57.3": (scaled("yaw_rate", np.pi / 180.0), "factor", "yaw_rate", np.pi / 180.0, 1e-9),
    "9.81": (scaled("acceleration_y", 1.0 / 9.80665), "factor", "acceleration_y", 1.0 / 9.80665, 1e-9),
    "3.6": (scaled("velocity_x", 1.0 / 3.6), "factor", "velocity_x", 1.0 / 3.6, 1e-9),
    "lag": (late, "lag", "acceleration_y", 0.02, 0.001),
    "offset": (shifted("acceleration_y", 0.4), "zero", "acceleration_y", 0.4, 0.02),
    "spikes": (spiked, "spikes", "yaw_rate", 3, 0),
    "place": (elsewhere, "place", "acceleration_y", 0.8, 0.1),
}


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize(("spoil", "kind", "name", "value", "within"), FLAWS.values(), ids=FLAWS)
def test_that_flaw_is_named_and_no_other(spoil, kind, name, value, within, seed, tmp_path):
    signals = recording(seed)
    spoil(signals)
    (flaw,) = flaws_of(write(tmp_path, signals))
    assert (flaw.kind, flaw.signal) == (kind, name)
    assert flaw.value == pytest.approx(value, abs=within)


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("kind", ["repeated", "restarts"])
def test_times_that_do_not_increase_are_named(kind, seed, tmp_path):
    time = T.copy()
    if kind == "repeated":
        time[1000 + seed] = time[999 + seed]
    else:
        time[1500 + seed :] -= time[1500 + seed]
    (flaw,) = flaws_of(write(tmp_path, recording(seed), time))
    assert flaw.kind == "refused"
    assert {"repeated": "occurs twice", "restarts": "goes back"}[kind] in flaw.text


def test_the_command_lists_segments_and_flaws(tmp_path, capsys):
    assert status_of("measured", "show", write(tmp_path, recording(0))) == 0
    assert "run.csv" in capsys.readouterr().out
    signals = recording(0)
    late(signals)
    assert status_of("measured", "show", write(tmp_path, signals)) == 1
    assert "acceleration_y: lags by" in capsys.readouterr().err
