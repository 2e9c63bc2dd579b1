"""Measurement files: every format and correction gives what was recorded; mistakes have a line."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

import yawbench as yb
from tests.command_line import status_of
from tests.refusals import each_mentions, mentions, refused
from tests.reports.made_up import unpacked
from yawbench.foundation.errors import ResultsError, ScenarioError
from yawbench.measured_cars.single_track import start_states
from yawbench.measurements.measured_results import load_run
from yawbench.measurements.measurement import load_measurement
from yawbench.measurements.segment import LowPass, Segment, to_centre_of_mass
from yawbench.orchestrator.plan import InputSeries
from yawbench.orchestrator.scenario.loader import load_scenario
from yawbench.planner import Planner

T = np.arange(0.0, 6.0, 0.01)
STEER = 0.5 * np.sin(2.0 * T)
YAW = 0.2 * np.sin(2.0 * T - 0.3)
SIDE = 4.0 * np.sin(2.0 * T - 0.4)
HEAD = """files: [FILE]
time: {column: Zeit, unit: ms}
signals:
  steering_wheel_angle: {column: Lenkrad, unit: deg}
  yaw_rate: {column: Gier, unit: deg/s}
  acceleration_y: {column: Quer, unit: g}
"""
COLUMNS = {
    "Zeit": 1000.0 * T,
    "Lenkrad": np.degrees(STEER),
    "Gier": np.degrees(YAW),
    "Quer": SIDE / 9.80665,
    "Länge": T,
}


def described(folder: Path, text: str = HEAD, file: str = "run.csv") -> Path:
    """Write a measurement file and return its path."""
    path = folder / "measured.yaml"
    path.write_text(text.replace("FILE", file), encoding="utf-8")
    return path


def measured(folder: Path, text: str = HEAD, **columns: np.ndarray) -> Segment:
    """Write columns and the file that describes them; return the only segment."""
    write_csv(folder / "run.csv", COLUMNS | columns)
    (only,) = load_measurement(described(folder, text)).segments
    return only


def write_csv(path: Path, columns: dict[str, np.ndarray]) -> None:
    """Write columns as text."""
    rows = np.column_stack([*columns.values()])
    np.savetxt(path, rows, "%.12g", ",", header=",".join(columns), comments="", encoding="utf-8")


def test_parquet_and_mdf_give_the_same(tmp_path):
    pq.write_table(pa.table(COLUMNS), tmp_path / "run.parquet")
    (segment,) = load_measurement(described(tmp_path, file="run.parquet")).segments
    assert segment.signals["yaw_rate"] == pytest.approx(YAW, abs=1e-12)
    asammdf = pytest.importorskip("asammdf")
    with asammdf.MDF(version="4.10") as mdf:
        mdf.append([asammdf.Signal(x, T, name=name) for name, x in COLUMNS.items() if name != "Zeit"])
        mdf.save(tmp_path / "run.mf4")
    (segment,) = load_measurement(described(tmp_path, file="run.mf4")).segments
    assert segment.signals["yaw_rate"] == pytest.approx(YAW, abs=1e-12)


def test_sign_gain_offset_and_delay_are_undone(tmp_path):
    late = np.sin(2.0 * (T - 0.02) - 0.3)
    more = "deg/s, sign: -1, gain: 1.25, offset: 3 deg/s, delay: 20 ms, noise: 0.1 deg/s}"
    segment = measured(tmp_path, HEAD.replace("deg/s}", more), Gier=-(np.degrees(0.2 * late) / 1.25) + 3.0)
    kept = np.isin(np.round(T, 6), np.round(segment.time, 6))
    assert T.size - kept.sum() == 2  # no value is made up after the last row
    assert segment.signals["yaw_rate"] == pytest.approx(YAW[kept], abs=1e-5)
    assert segment.signals["steering_wheel_angle"] == pytest.approx(STEER[kept], abs=1e-9)
    noise = load_measurement(tmp_path / "measured.yaml").noise
    assert noise == {"yaw_rate": pytest.approx(np.radians(0.1))}


def test_spikes_are_replaced_and_nothing_else(tmp_path):
    spiked = np.degrees(STEER)
    spiked[[50, 51, 300]] += 40.0
    segment = measured(tmp_path, HEAD.replace("unit: deg}", "unit: deg, spikes: 2 deg}"), Lenkrad=spiked)
    error = np.abs(segment.signals["steering_wheel_angle"] - STEER)
    assert error.max() < np.radians(0.05)
    assert np.flatnonzero(error > 1e-9).tolist() == [50, 51, 300]


def test_a_sensor_elsewhere_is_moved_to_the_centre_of_mass(tmp_path):
    moved = (SIDE + np.gradient(YAW, T) * 1.5 - YAW**2 * 0.4) / 9.80665
    segment = measured(tmp_path, HEAD.replace("unit: g}", "unit: g, at: {x: 1.5 m, y: 0.4 m}}"), Quer=moved)
    inner = slice(100, -100)
    assert segment.signals["acceleration_y"][inner] == pytest.approx(SIDE[inner], abs=5e-3)
    assert np.abs(moved * 9.80665 - SIDE).max() > 0.5


def test_restarts_begin_segments_only_if_asked_for(tmp_path):
    double = {name: np.concatenate([x, x[:200]]) for name, x in COLUMNS.items()}
    lap = np.concatenate([np.full(T.size, 3.0), np.full(200, 4.0)])
    write_csv(tmp_path / "run.csv", double | {"Lap": lap})
    path = described(tmp_path)
    names = ("run.csv", "5.99", "0 s", "value 601", "'segments: {by: time}'")
    with refused(ScenarioError, "measurement-time", names=names) as caught:
        load_measurement(path)
    assert (caught.value.file, caught.value.line) == (path, 1)
    for by, names in (("time", ["run.csv 1", "run.csv 2"]), ("Lap", ["run.csv 3", "run.csv 4"])):
        segments = load_measurement(described(tmp_path, f"segments: {{by: {by}}}\n{HEAD}")).segments
        assert [one.name for one in segments] == names
        assert [one.time.size for one in segments] == [600, 200]
    assert load_run(f"{path}#2").time.size == 200
    with refused(ResultsError, names=("2 segments", "measured.yaml#1")):
        load_run(path)


def test_repeated_times_are_refused_or_averaged(tmp_path):
    order = np.sort(np.concatenate([np.arange(T.size), [7, 7]]))
    columns = {name: x[order].copy() for name, x in COLUMNS.items()}
    columns["Gier"][7:10] += [3.0, 0.0, -3.0]
    write_csv(tmp_path / "run.csv", columns)
    names = ("run.csv", "0.07 s", "value 9", "'time: {column: Zeit, repeated: mean}'")
    with refused(ScenarioError, names=names):
        load_measurement(described(tmp_path))
    text = HEAD.replace("unit: ms}", "unit: ms, repeated: mean}")
    (segment,) = load_measurement(described(tmp_path, text)).segments
    assert segment.signals["yaw_rate"] == pytest.approx(YAW, abs=1e-10)


def test_the_filter_acts_on_all_signals_and_is_there_for_simulated_ones(tmp_path):
    noise = 0.05 * np.sin(2.0 * np.pi * 30.0 * T)
    write_csv(tmp_path / "run.csv", COLUMNS | {"Gier": np.degrees(YAW + noise)})
    path = described(tmp_path, HEAD + "filter: {low_pass: 6 Hz}\n")
    measurement = load_measurement(path)
    inner = slice(100, -100)
    assert measurement.filter == LowPass(6.0, 12, True)
    filtered = measurement.segments[0].signals["yaw_rate"]
    assert np.abs(filtered - YAW)[inner].max() < 1e-4
    assert measurement.filter(YAW + noise, 100.0) == pytest.approx(filtered, abs=1e-6)
    assert np.abs(load_measurement(path, filtered=False).segments[0].signals["yaw_rate"] - YAW).max() > 0.04
    causal = LowPass(6.0, 4, phaseless=False)(YAW, 100.0)
    assert np.abs(causal - YAW)[inner].max() > 0.01


RATE = "unit: deg/s"


@pytest.mark.parametrize(
    ("old", "new", "names"),
    [
        ("FILE", "other.csv", ("files[0]", "other.csv")),
        ("yaw_rate:", "yaw_rat:", ("signals.yaw_rat", "'yaw_rat'", "'yaw_rate'")),
        ("column: Gier", "column: Gear", ("signals.yaw_rate", "run.csv", "'Gear'", "'Gier'")),
        (RATE, "unit: degs", ("signals.yaw_rate.unit", "'degs'")),
        (RATE, "unit: kg", ("signals.yaw_rate", "run.csv", "'Gier'", "'kg'", "rad/s")),
        (RATE, "unit: rad/s", ("'Gier'", "11.46 rad/s", "5 rad/s", "'deg/s'")),
        (
            "{column: Gier, unit: deg/s}", "Gier",
            ("run.csv", "'Gier'", "deg/s", "'yaw_rate: {column: Gier, unit: rad/s}'"),
        ),
        (RATE, f"{RATE}, spikes: 2", ("signals.yaw_rate.spikes", "20 ms", "2")),
        (RATE, f"{RATE}, noise: 2 m", ("signals.yaw_rate.noise", "'2 m'", "rad/s", "rpm")),
        (RATE, f"{RATE}, delay: 20 deg", ("signals.yaw_rate.delay", "'20 deg'", "ms")),
        (RATE, f"{RATE}, at: {{x: 1 m}}", ("signals.yaw_rate.at", "velocity_x", "acceleration_y")),
        ("unit: g", "unit: g, at: {w: 1 m}", ("signals.acceleration_y.at.w", "x", "y", "z")),
        ("files:", "filter: {low_pass: 6 Hz, order: 5}\nfiles:", ("filter.order", "even", "5")),
        ("files:", "vehicle: {mas: 1200 kg}\nfiles:", ("vehicle.mas", "'mass'")),
        ("files:", "vehicle: {mass: 1200}\nfiles:", ("vehicle.mass", "kg", "1200")),
        ("files:", "segments: {by: Runde}\nfiles:", ("segments.by", "'Runde'", "Zeit", "Länge")),
        ("files:", "licens: CC0\nfiles:", ("licens", "'licence'", "files", "date")),
    ],
)  # fmt: skip
def test_a_mistake_is_answered_with_its_line(old, new, names, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_csv(Path("run.csv"), COLUMNS)
    text = HEAD.replace(old, new)
    described(Path(), text)
    wanted = next(k for k, line in enumerate(text.splitlines(), start=1) if line not in HEAD.splitlines())
    with refused(ScenarioError) as caught:
        load_measurement("measured.yaml")
    assert caught.value.line == wanted
    assert each_mentions(caught.value.diagnostics, (f"measured.yaml:{wanted}", *names))


def test_a_recording_is_a_run(tmp_path):
    write_csv(tmp_path / "run.csv", COLUMNS)
    known = (
        "vehicle: {mass: 1600 kg, friction: 0.9}\ncar: saloon\ndate: 2024-05-17\nsource: own\nlicence: CC0\n"
    )
    run = yb.measured(described(tmp_path, HEAD + known))
    assert run["yaw_rate"] == pytest.approx(YAW, abs=1e-10)
    assert run.metric("peak(yaw_rate)") == pytest.approx(0.2, rel=1e-3)
    assert run.unit_of("steering_wheel_angle") == "rad"
    assert run.title == "saloon, 2024-05-17"
    assert not run.diagnostics
    assert {axes.get_label() for axes in run.plot("yaw_rate", "acceleration_y").axes} == {
        "yaw_rate", "acceleration_y",
    }  # fmt: skip
    assert "plant.yaw_rate" in unpacked(yb.view({"measured": run, "again": run}, "yaw_rate").html)


def test_missing_provenance_is_asked_for(tmp_path):
    write_csv(tmp_path / "run.csv", COLUMNS)
    (note,) = yb.measured(described(tmp_path, HEAD + "car: saloon\n")).diagnostics
    assert (note.code, note.severity) == ("measurement-unattributed", "info")
    assert mentions(note.message, "source", "licence", "date")


def test_commands_take_measurement_files(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    write_csv(Path("run.csv"), COLUMNS)
    write_csv(Path("other.csv"), COLUMNS | {"Gier": 1.1 * COLUMNS["Gier"]})
    described(Path())
    Path("other.yaml").write_text(HEAD.replace("FILE", "other.csv"))
    assert status_of("plot", "measured.yaml", "other.yaml", "--panel", "yaw_rate", "--out", "out") == 0
    assert [*Path("out").glob("*.svg")]
    assert status_of("diff", "measured.yaml", "other.yaml") == 0
    assert "plant.yaw_rate" in capsys.readouterr().out
    assert status_of("evaluate", "step-steer", "run.csv") == 2
    names = ("'files: [run.csv]'", "'signals: {yaw_rate: {column: ..., unit: ...}}'")
    assert each_mentions(capsys.readouterr().err, names)


def test_a_measurement_drives_an_input(tmp_path, fmus):
    write_csv(tmp_path / "run.csv", COLUMNS)
    described(tmp_path, HEAD.replace("Lenkrad, unit: deg", "Lenkrad, unit: deg, sign: -1"))
    path = tmp_path / "scenario.yaml"
    path.write_text(
        "stop_time: 2\nstep_size: 0.01\nunits: {tyre: {fmu: tyre_linear}}\n"
        "inputs:\n"
        "  slip_angle_*: {file: measured.yaml, column: steering_wheel_angle, from: 1.5 s}\n"
        "  slip_ratio_*: 0\n  vertical_load_*: 4000\n  friction_*: 1\n"
    )
    plan = Planner().plan(load_scenario(path), fmus=fmus)
    series = plan.instances[0].series["slip_angle_fl"]
    assert isinstance(series, InputSeries)
    assert series.first(0.0) == pytest.approx(-np.interp(1.5, T, STEER), abs=1e-9)


UNITS = ("tyre_linear",)


def test_the_sideslip_of_a_car_that_spins_is_moved_to_its_centre_of_mass_and_that_at_rest_is_left():
    turned = np.radians([0.0, 40.0, 120.0, 170.0, 90.0])
    speed, r, ahead = np.array([20.0, 20.0, 10.0, 8.0, 0.01]), 0.5, 1.2
    v_x, v_y = speed * np.cos(turned), speed * np.sin(turned)
    signals = {
        "velocity_x": v_x,
        "yaw_rate": np.full(5, r),
        "sideslip": np.arctan2(v_y + r * ahead, v_x),
    }
    moved = to_centre_of_mass(Segment("a", np.arange(5.0), signals), {"sideslip": (ahead, 0.0, 0.0)})
    np.testing.assert_allclose(moved["sideslip"][:4], turned[:4], atol=1e-9)
    assert moved["sideslip"][4] == signals["sideslip"][4]
    at_rest = Segment(
        "a", np.array([0.0, 1.0]), {"velocity_x": np.array([0.01, 0.01]), "sideslip": np.full(2, 3.1)}
    )
    assert start_states(at_rest, 0.5) == {"initial_sideslip": 0.0, "initial_speed": 0.01}
