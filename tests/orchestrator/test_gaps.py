"""Gaps of recordings: each is named, and nothing that reads a recording goes through one in silence."""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np
import pytest

import yawbench as yb
from tests.command_line import status_of
from yawbench.figures.display import LabelledRun
from yawbench.figures.plots import spans_of
from yawbench.foundation.errors import Diagnostic, ScenarioError
from yawbench.measured_cars.fit_file import load_fit
from yawbench.measured_cars.flaws import FlawKind, flaws_of
from yawbench.measured_cars.single_track import effects_in
from yawbench.measurements.measured_results import load_run
from yawbench.measurements.measurement import load_measurement
from yawbench.orchestrator.recordings.gaps import gaps_in
from yawbench.orchestrator.scenario.loader import load_scenario
from yawbench.planner import Planner
from yawbench.proving_ground.steering_response import evaluate_step
from yawbench.proving_ground.trace import trace_of

UNITS = ("tyre_linear",)
T = np.round(np.arange(0.0, 8.005, 0.01), 2)
SIGNALS = "signals: {velocity_x: speed, yaw_rate: gyro, acceleration_y: lat}\n"


def kept(*gaps: tuple[float, float]) -> np.ndarray:
    """Return the times without those inside gaps."""
    times = T
    for begin, end in gaps:
        times = times[(times <= begin) | (times >= end)]
    return times


COLUMNS = ("speed [m/s]", "gyro [rad/s]", "lat [m/s2]")


def table(folder: Path, times: np.ndarray, *columns: np.ndarray, heads: Iterable[str] = COLUMNS) -> None:
    """Write columns beside their times."""
    head = ",".join(["time [s]", *heads])
    rows = np.column_stack([times, *columns])
    np.savetxt(folder / "m.csv", rows, "%.15g", ",", header=head, comments="")


def recording(folder: Path, times: np.ndarray, period=2.5, yaw=1.0, begin=0.0, more="") -> Path:
    """Write a drive through swings with a factor of the yaw rate, by a clock that begins so, and its file."""
    swing = 0.2 * np.sin(2.0 * np.pi * times / period)
    table(folder, begin + times, 25.0 + 0.0 * times, yaw * swing, 25.0 * swing)
    path = folder / "m.yaml"
    path.write_text(f"files: [m.csv]\ntime: time\n{SIGNALS}{more}")
    return path


def mdf(file: Path, **channels: tuple[np.ndarray, np.ndarray, str]) -> None:
    """Write channels, each with its own times: values, times and unit."""
    asammdf = pytest.importorskip("asammdf")
    with asammdf.MDF(version="4.10") as made:
        for name, (values, times, unit) in channels.items():
            made.append([asammdf.Signal(values, times, name=name, unit=unit)])
        made.save(file)


def gap_notes(noted: Sequence[Diagnostic]) -> list[Diagnostic]:
    """Return the diagnostics that tell of gaps."""
    return [one for one in noted if one.code == "measurement-gap"]


@pytest.mark.parametrize(
    ("gaps", "period"),
    [
        ([(3.0, 5.5)], 2.5),
        ([(3.0, 5.0)], 1.0),
        ([(0.5, 0.6), (3.0, 5.5), (7.0, 7.9)], 2.5),
        ([(7.8, 7.9)], 1.0),
        ([(3.13, 3.21)], 1.0),
    ],
    ids=["a swing", "two seconds", "several", "at the end", "short"],
)
def test_a_stretch_without_samples_is_named_with_its_ends_and_nothing_else_is(gaps, period, tmp_path, capsys):
    path = recording(tmp_path, kept(*gaps), period=period)
    flaws = flaws_of(path)
    assert [(flaw.kind, tuple(flaw.gap)) for flaw in flaws] == [(FlawKind.GAP, gap) for gap in gaps]
    for flaw, (begin, end) in zip(flaws, gaps, strict=True):
        assert f"from {begin:g} to {end:g} s" in flaw.text
    assert status_of("measured", "show", path, "--json") == 1
    printed = capsys.readouterr()
    assert "spike" not in printed.err and "no flaws" not in printed.err
    first = json.loads(printed.out)["flaws"][0]
    assert (first["kind"], first["begin"], first["end"]) == ("gap", *gaps[0])


def test_of_many_gaps_the_rest_is_counted(tmp_path):
    rows = np.arange(T.size)
    flaws = flaws_of(recording(tmp_path, T[(rows % 50 > 5) | (rows < 50)]))
    assert len(flaws) == 11
    assert "5 more stretches" in flaws[-1].text


@pytest.mark.parametrize(
    "times",
    [
        T[np.arange(T.size) % 40 != 7],  # a sample is lost now and then
        T + np.random.default_rng(0).uniform(-0.003, 0.003, T.size),
        np.cumsum(np.random.default_rng(1).uniform(0.002, 0.02, 500)),
        np.concatenate([np.arange(0.0, 4.0, 0.01), np.arange(4.0, 8.0, 0.1)]),  # another rate
        np.array([0.0, 5.0]),
    ],
    ids=["single losses", "jitter", "uneven", "two rates", "two"],
)
def test_sampling_of_other_kinds_has_no_gaps(times):
    assert gaps_in(times) == ()


def test_a_gap_of_one_channel_is_named_with_its_signal(tmp_path):
    r = 0.2 * np.sin(2.0 * np.pi * T / 2.5)
    lost = (T <= 3.0) | (T >= 5.5)
    speed, lat = (25.0 + 0.0 * T, T, "m/s"), (25.0 * r, T, "m/s2")
    mdf(tmp_path / "m.mf4", speed=speed, lat=lat, gyro=(r[lost], T[lost], "rad/s"))
    path = tmp_path / "m.yaml"
    path.write_text(f"files: [m.mf4]\n{SIGNALS}")
    (flaw,) = flaws_of(path)
    assert (flaw.kind, flaw.signal, tuple(flaw.gap)) == (FlawKind.GAP, "yaw_rate", (3.0, 5.5))
    (note,) = gap_notes(load_measurement(path).notes)
    assert note.location.signal == "yaw_rate" and "yaw_rate" in note.message
    path.write_text(f"files: [m.mf4]\n{SIGNALS}segments: {{by: gaps}}\n")
    ends = [tuple(one.time[[0, -1]]) for one in load_measurement(path).segments]
    assert ends == [(0.0, 3.0), (5.5, 8.0)]


def test_a_recording_can_be_divided_at_its_gaps(tmp_path):
    path = recording(tmp_path, kept((3.0, 5.5), (7.0, 7.5)), more="segments: {by: gaps}\n")
    measurement = load_measurement(path)
    assert [tuple(one.time[[0, -1]]) for one in measurement.segments] == [(0.0, 3.0), (5.5, 7.0), (7.5, 8.0)]
    assert not gap_notes(measurement.notes)
    assert flaws_of(path) == ()


def test_a_filter_takes_nothing_from_beyond_a_gap(tmp_path):
    times = kept((3.0, 5.5))
    path = recording(tmp_path, times, more="filter: {low_pass: 6 Hz}\n")
    before = load_measurement(path).segments[0].signals["yaw_rate"]
    rows = np.loadtxt(tmp_path / "m.csv", delimiter=",", skiprows=1)
    rows[times > 4.0, 2] += 1.0
    table(tmp_path, *rows.T)
    after = load_measurement(path).segments[0].signals["yaw_rate"]
    assert after[times < 4.0].tolist() == before[times < 4.0].tolist()
    assert after[times > 4.0] == pytest.approx(before[times > 4.0] + 1.0, abs=1e-6)


FOLLOWING = """stop_time: STOP
step_size: 0.01
units: {tyre: {fmu: tyre_linear}}
inputs:
  slip_angle_*: SERIES
  slip_ratio_*: 0
  friction_*: 1
  vertical_load_*: 4000
"""
STEERED = "files: [m.csv]\ntime: time\nsignals: {steer_angle: {column: angle, unit: rad}}\n"


def warnings_on_series(folder: Path, fmus: Path, stop: float, series: str) -> list[str]:
    """Return the warnings on gaps in the inputs of a run that follows a file."""
    path = folder / "scenario.yaml"
    path.write_text(FOLLOWING.replace("STOP", str(stop)).replace("SERIES", series))
    plan = Planner().plan(load_scenario(path), fmus=fmus)
    return [one.message for one in plan.diagnostics if one.code == "series-gap"]


@pytest.mark.parametrize(
    ("file", "column", "stop", "begin", "named"),
    [
        ("steer.yaml", "steer_angle", 6.0, 1.0, "from 2 to 4.5 s"),
        ("m.csv", "angle", 6.0, 0.0, "from 3 to 5.5 s"),
        ("m.csv", "angle", 1.0, 1.0, None),
        ("m.csv", "angle", 2.0, 6.0, None),
    ],
)
def test_a_run_that_follows_a_recording_through_a_gap_has_a_warning(
    file, column, stop, begin, named, tmp_path, fmus
):
    times = kept((3.0, 5.5))
    table(tmp_path, times, 0.1 * np.sin(2.0 * times), heads=["angle [rad]"])
    (tmp_path / "steer.yaml").write_text(STEERED)
    said = warnings_on_series(tmp_path, fmus, stop, f"{{file: {file}, column: {column}, from: {begin} s}}")
    assert len(said) == (named is not None)  # once for all wheels
    for message in said:
        assert named in message and file in message and column in message


def test_a_table_written_by_hand_has_no_gaps(tmp_path, fmus):
    (tmp_path / "m.csv").write_text("time,angle [rad]\n0,0\n0.1,0.1\n0.2,0.2\n0.3,0.1\n9,0\n")
    assert warnings_on_series(tmp_path, fmus, 6.0, "{file: m.csv, column: angle}") == []


def test_results_of_a_measurement_tell_of_its_gap_at_the_time_of_the_run(tmp_path):
    path = recording(tmp_path, kept((3.0, 5.5)))
    run = yb.measured(path, start=1.0)
    (note,) = gap_notes(run.diagnostics)
    assert (note.severity, note.location.time, note.value) == ("warning", 2.0, 2.5)
    assert "2 to 4.5 s" in note.message
    (span,) = spans_of([LabelledRun("car", load_run(path, start=1.0))])
    assert (span.begin, span.end) == (2.0, 4.5) and "no samples" in span.label
    saved = yb.open(run.save(tmp_path / "saved"))
    assert [one.location.time for one in gap_notes(saved.diagnostics)] == [2.0]


def test_a_test_that_needs_a_signal_with_a_gap_is_not_judged(tmp_path, capsys):
    times = kept((3.0, 5.5))
    hand = np.radians(30.0) * np.clip((times - 1.0) / 0.1, 0.0, 1.0)
    r = 0.2 * np.clip((times - 1.1) / 0.2, 0.0, 1.0)
    table(tmp_path, times, 25.0 + 0.0 * times, r, 25.0 * r, hand, heads=[*COLUMNS, "hand [rad]"])
    path = tmp_path / "m.yaml"
    path.write_text(f"files: [m.csv]\n{SIGNALS.replace('}', ', steering_wheel_angle: hand}')}")
    judged = evaluate_step(trace_of(load_run(path)))
    (why,) = [one.message for one in judged.diagnostics if one.code == "test-not-judged"]
    assert "3 to 5.5 s" in why and "by: gaps" in why
    assert judged.judges_nothing
    assert status_of("evaluate", "step-steer", path, "--out", tmp_path / "out", "--no-figures") == 1
    assert "3 to 5.5 s" in "".join(capsys.readouterr())
    path.write_text(path.read_text() + "segments: {by: gaps}\n")
    assert evaluate_step(trace_of(load_run(f"{path}#1"))).quantities["yaw_rate_gain"].value is not None


FIT = """title: Fit
scenario: scenario.yaml
measured: m.yaml
training: [{begin: 0, end: 2 s}]
held_out: [{begin: 2 s, end: END}]
compared: {yaw_rate: 0.1 deg/s}
settling: SETTLING
free: {vehicle.yaw_inertia: {low: 800, high: 4000, start: 2200}}
"""


@pytest.mark.parametrize(
    ("end", "settling", "said"),
    [("4 s", "0.2 s", "3 to 5.5 s"), ("3 s", "0.2 s", ""), ("3 s", "5 s", "settling")],
    ids=["a gap", "none", "nothing is left to compare"],
)
def test_a_fit_refuses_a_window_of_which_samples_are_missing(end, settling, said, tmp_path):
    recording(tmp_path, kept((3.0, 5.5)))
    (tmp_path / "fit.yaml").write_text(FIT.replace("END", end).replace("SETTLING", settling))
    if not said:
        assert len(load_fit(tmp_path / "fit.yaml").held_out) == 1
        return
    with pytest.raises(ScenarioError) as refused:
        load_fit(tmp_path / "fit.yaml")
    assert {one.code for one in refused.value.diagnostics} == {"fit-window"}
    assert all(said in one.message for one in refused.value.diagnostics)


def test_the_effects_of_parameters_are_those_outside_gaps(tmp_path):
    known = "vehicle: {mass: 1600 kg, cg_to_front_axle: 1.2 m, cg_to_rear_axle: 1.5 m}\n"
    path = recording(tmp_path, kept((3.0, 5.5)), more=known)
    text = path.read_text().replace("acceleration_y: lat", "steer_angle: {column: lat, unit: deg}")
    path.write_text(text)
    (tmp_path / "m.csv").write_text((tmp_path / "m.csv").read_text().replace("lat [m/s2]", "lat"))
    with pytest.raises(ValueError, match="gap"):  # the only window, of 10 s, has one
        effects_in(load_measurement(path))
    path.write_text(text + "segments: {by: gaps}\n")
    assert effects_in(load_measurement(path))


def test_a_validation_compares_no_values_that_were_not_measured(tmp_path):
    a_y = 4.0 * np.sin(2.0 * np.pi * T / 8.0)
    lost = (T <= 1.0) | (T >= 3.0)  # the hand wheel is not recorded while a_y is largest
    mdf(tmp_path / "car.mf4", lat=(a_y, T, "m/s2"), hand=(0.1 * a_y[lost], T[lost], "rad"))
    path = tmp_path / "car.yaml"
    path.write_text("files: [car.mf4]\nsignals: {acceleration_y: lat, steering_wheel_angle: hand}\n")
    table(tmp_path, T, a_y, 0.1 * a_y, heads=["lat [m/s2]", "hand [rad]"])
    (tmp_path / "run.yaml").write_text(path.read_text().replace("car.mf4", "m.csv"))
    validation = yb.validate(yb.measured(tmp_path / "run.yaml"), path)
    assert validation.verdicts["steering_wheel_angle"].value < 0.05
    assert len(gap_notes(validation.diagnostics)) == 1


@pytest.fixture
def diff(tmp_path, capsys):
    """Compare a recording with the results of a run from 0 s on; return the status and what was found."""
    yb.measured(recording(tmp_path, T)).save(tmp_path / "run")

    def of(path: Path, *arguments: object) -> tuple[int, dict]:
        status = status_of("diff", tmp_path / "run", path, *arguments, "--json")
        return status, json.loads(capsys.readouterr().out)

    return of


@pytest.mark.parametrize("begin", [123.0, 1.7e9])
def test_a_comparison_at_no_time_is_no_agreement(begin, diff, tmp_path, capsys):
    path = recording(tmp_path, T, begin=begin)
    status, found = diff(path)
    assert (status, found["identical"], found["compared"]["times"]) == (1, False, 0)
    assert status_of("diff", tmp_path / "run", path) == 1
    said = "".join(capsys.readouterr())
    assert f"{begin:.0f} to {begin + 8.0:.0f} s" in said and "0 to 8 s" in said
    assert f"--from '{begin:.0f} s'" in said and "the same" not in said
    status, found = diff(path, "--from", f"{begin:.0f} s")
    assert (status, found["compared"]["times"]) == (0, T.size)
    assert all(one["visibly_from"] is None for one in found["signals"])


@pytest.mark.parametrize(("factor", "seen"), [(1.0, set()), (1.1, {"plant.yaw_rate"})])
def test_a_recording_with_times_of_its_own_is_compared_there_and_not_in_gaps(factor, seen, diff, tmp_path):
    times = kept((3.0, 5.5)) + 0.0037
    times = times[times < 8.0]
    status, found = diff(recording(tmp_path, times, yaw=factor))
    assert (status, found["compared"]["times"]) == (0, times.size)
    assert {one["signal"] for one in found["signals"] if one["visibly_from"] is not None} == seen
