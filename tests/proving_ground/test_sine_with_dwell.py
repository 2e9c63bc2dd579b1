"""Sine with dwell evaluated over traces whose answers have closed forms, at several ways of sampling."""

from __future__ import annotations

import json
import math
from math import cosh, degrees, radians, tanh
from pathlib import Path

import numpy as np
import pytest

from tests.command_line import status_of
from tests.refusals import mentions
from yawbench.components.drivers.sine_with_dwell import SineWithDwellParameters, sine_with_dwell
from yawbench.measurements.measured_results import load_run
from yawbench.metrics.verdict import NotJudged, Status, Verdict, apart
from yawbench.proving_ground.sine_with_dwell import amplitudes, evaluate_dwell, is_series, judge_series
from yawbench.proving_ground.standard_tests import Evaluation
from yawbench.proving_ground.steady_state_steering import G, characteristic_angle, evaluate_slow_steer
from yawbench.proving_ground.trace import Trace, trace_of

A, LARGE = radians(36.0), radians(270.0)
START = 1.5
END = START + 1.0 / 0.7 + 0.5
PEAK_AT, PEAK, FALL = START + 1.2, 0.8, 0.45  # yaw rate -PEAK / cosh((t - PEAK_AT) / FALL)
FIRST, REVERSAL = 0.5, START + 0.5 / 0.7
FAR, MIDDLE, RISE = 2.4, START + 0.9, 0.18  # displacement FAR (1 + tanh((t - MIDDLE) / RISE)) / 2


def uneven(step: float, last: float) -> np.ndarray:
    """Return times whose steps differ by up to a half."""
    rng = np.random.default_rng(1)
    times = np.cumsum(step * rng.uniform(0.75, 1.25, int(last / step) + 50))
    return np.concatenate([[0.0], times[times < last]])


SAMPLING = {
    "1 kHz": lambda last: np.arange(0.0, last, 0.001),
    "200 Hz": lambda last: np.arange(0.0, last, 0.005),
    "uneven": lambda last: uneven(0.004, last),
}
as_sampled = pytest.mark.parametrize("sampling", SAMPLING.values(), ids=SAMPLING)


def fall(t: np.ndarray, width: float) -> np.ndarray:
    """Return a yaw rate that has next to nothing before the reversal, a peak, and a tail of 1 / cosh."""
    return -PEAK / np.cosh((t - PEAK_AT) / width) * 0.5 * (1.0 + np.tanh((t - START - 0.6) / 0.1))


def answer(t: np.ndarray) -> np.ndarray:
    """Return the yaw rate of the first half wave; nothing before and after it."""
    share = np.clip((t - START) / (REVERSAL - START), 0.0, 1.0)
    return FIRST * np.sin(np.pi * share) ** 2


def trace(
    amplitude=LARGE, *, sampling=SAMPLING["1 kHz"], last=7.0, yaw_rate=None, offset=0.0, **more
) -> Trace:
    """Return a run whose signals are closed forms; `amplitude` negative: right first."""
    t = sampling(last)
    side = math.copysign(1.0, amplitude)
    p = SineWithDwellParameters(amplitude=amplitude, start_time=START)
    x = np.tanh((t - MIDDLE) / RISE)
    signals = {
        "steering_wheel_angle": np.array([sine_with_dwell(s, p) for s in t]) + 2.0 * offset,
        "yaw_rate": side * (answer(t) + (fall(t, FALL) if yaw_rate is None else yaw_rate(t))) + offset,
        "acceleration_y": side * -FAR * x * (1.0 - x * x) / RISE**2 + offset,
        "sideslip": np.where(t > END, radians(3.0), 0.0),
        "velocity_x": np.full_like(t, 80.0 / 3.6),
    }
    return Trace("made up", t, signals, **{"mass": 1800.0, **more})


def verdicts(judged: Evaluation) -> dict[str, str]:
    return {name: verdict.status.value for name, verdict in judged.criteria.items()}


@as_sampled
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_instants_ratios_and_displacement_are_those_of_the_closed_forms(sampling, side):
    judged = evaluate_dwell(trace(side * radians(270.0), sampling=sampling, offset=0.01), A)
    assert judged["amplitude"] == pytest.approx(side * radians(270.0), abs=radians(0.02))
    assert judged["begin"] == pytest.approx(START, abs=0.004)
    # the corner at the end of the steering, behind the low pass of 10 Hz
    assert judged["end"] == pytest.approx(END + 0.0143, abs=0.0005)
    assert judged["peak_at"] == pytest.approx(PEAK_AT, abs=0.0051)
    assert judged["peak"] == pytest.approx(-side * PEAK, rel=2e-4)
    for late, key in ((1.0, "ratio_1000"), (1.75, "ratio_1750")):
        exact = 1.0 / cosh((judged["end"] + late - PEAK_AT) / FALL)
        assert judged[key] == pytest.approx(exact, abs=5e-4), key

    def y(t: float) -> float:
        return 0.5 * FAR * (1.0 + tanh((t - MIDDLE) / RISE))

    begin = judged["begin"]
    rate = 0.5 * FAR / RISE / cosh((begin - MIDDLE) / RISE) ** 2
    exact = y(begin + 1.07) - y(begin) - 1.07 * rate
    assert judged["displacement"] == pytest.approx(exact, abs=0.002)
    assert verdicts(judged) == {"stability": "passed", "responsiveness": "passed"}


@pytest.mark.parametrize(
    "width, verdict, says",
    # 1 / cosh(x) is 35 % at x = 1.708, and COS + 1 s is 1.743 s after the peak: x = 1.708 at 1.020
    [(1.015, "passed", "34.8 %"), (1.019246, "failed", "35.01 %"), (1.025, "failed", "35.3 %")],
)
def test_the_limit_of_35_per_cent_decides_and_no_ratio_reads_like_it(width, verdict, says):
    def yaw_rate(t):
        return fall(t, width) * 0.5 * (1.0 - np.tanh((t - END - 1.4) / 0.1))  # good at 1.75 s

    judged = evaluate_dwell(trace(yaw_rate=yaw_rate), A)
    assert judged.criteria["stability"].status.value == verdict
    assert (judged["ratio_1000"] > 0.35) == (verdict == "failed")
    assert judged.criteria["stability"].why.startswith(f"{says} of at most 35 % at COS + 1 s")


@pytest.mark.parametrize(
    "value, bounds, decimals, text",
    [
        (34.8, [35.0], 1, "34.8"), (35.04, [35.0], 1, "35.04"), (34.9996, [35.0], 1, "34.9996"),
        (35.0, [35.0], 1, "35.0"), (-0.01, [35.0], 1, "0.0"), (0.0003, [0.0], 3, "0.0003"),
        (82.04, [78.0, 82.0], 1, "82.04"), (math.inf, [35.0], 1, "inf"),
    ],
)  # fmt: skip
def test_numbers_have_as_many_digits_as_make_them_differ_from_their_bounds(value, bounds, decimals, text):
    assert apart(value, *bounds, decimals=decimals) == text


def test_the_limit_of_20_per_cent_decides_at_1_75_seconds():
    def yaw_rate(t):
        return fall(t, FALL) - 0.21 * PEAK * np.exp(-(((t - END - 1.75) / 0.25) ** 2))

    judged = evaluate_dwell(trace(yaw_rate=yaw_rate), A)
    assert judged["ratio_1000"] < 0.35 < 1.0
    assert judged["ratio_1750"] > 0.20
    assert judged.criteria["stability"].status is Status.FAILED


def test_a_yaw_rate_that_never_falls_has_no_second_peak_and_is_unstable():
    judged = evaluate_dwell(trace(yaw_rate=lambda t: -PEAK * 0.5 * (1 + np.tanh(t - PEAK_AT))), A)
    assert judged["peak"] is None
    assert judged.criteria["stability"].status is Status.FAILED
    assert mentions(judged.criteria["stability"].why, "no second peak")


def test_a_ratio_is_signed_and_a_spin_that_passes_is_flagged():
    made = trace(yaw_rate=lambda t: PEAK * np.tanh((t - END) / 0.3) * (t > START) * np.exp(-((t - END) ** 2)))
    made.signals["sideslip"][made.time > END] = radians(60.0)
    judged = evaluate_dwell(made, A)
    assert judged["ratio_1000"] < 0.0
    assert judged.criteria["stability"].status is Status.PASSED
    assert judged["sideslip"] == radians(60.0)
    assert mentions(judged.diagnostics, "60 degrees", "sideslip")


def test_below_26_8_degrees_the_zeroing_range_ends_at_the_first_instant_above_75_degrees_per_second():
    """A 2 pi 0.7 Hz cos(2 pi 0.7 Hz 0.2 s) = 75 deg/s at 26.8 degrees."""
    low = evaluate_dwell(trace(radians(26.0)), radians(17.0))
    high = evaluate_dwell(trace(radians(30.0)), radians(17.0))
    assert mentions(low.diagnostics, "200 ms", "stay")
    assert high.diagnostics == []
    assert low["end"] == pytest.approx(END + 0.0143, abs=0.001)  # the zero holds the first degrees, too


@pytest.mark.parametrize(
    "changes, why",
    [
        ({"last": END + 1.5}, ("1.75 s",)),
        ({"last": END - 0.1}, ("completion", "steer")),
        ({"sampling": lambda last: np.arange(0.7, last, 0.001)}, ("1 s",)),
        ({"sampling": lambda last: np.arange(0.0, last, 0.04)}, ("50 Hz",)),
        ({"amplitude": radians(12.0)}, ("75 deg/s", "exceed")),
    ],
    ids=["short", "no end", "late", "coarse", "slow"],
)
def test_what_cannot_be_judged_says_why_and_passes_nothing(changes, why):
    judged = evaluate_dwell(trace(**changes), radians(4.0))
    assert judged.criteria["stability"].status is Status.NOT_JUDGED
    assert mentions(judged.criteria["stability"].why, *why)
    assert judged.verdict.status is Status.NOT_JUDGED


def noise(size: float, seed: int = 1):
    """Return a yaw rate that is nothing but noise [rad/s], smooth enough to pass the filter."""
    phases = np.random.default_rng(seed).uniform(0.0, 2.0 * np.pi, 12)
    return lambda t: (
        size * sum(np.sin(2.0 * np.pi * (1.0 + 0.4 * k) * t + phase) for k, phase in enumerate(phases))
    )


def turned(made: Trace, *names: str) -> Trace:
    for name in names:
        made.signals[name] = -made.signals[name]
    return made


def unanswered(yaw_rate) -> Trace:
    made = trace()
    made.signals["yaw_rate"] = yaw_rate(made.time)
    return made


@pytest.mark.parametrize(
    "made, why",
    [
        (turned(trace(), "steering_wheel_angle"), "the yaw rate opposes the steering"),
        (turned(trace(), "yaw_rate"), "the yaw rate opposes the steering"),
        (turned(trace(-LARGE), "yaw_rate"), "the yaw rate opposes the steering"),
        (turned(trace(), "acceleration_y"), "the lateral acceleration opposes the steering"),
        (unanswered(np.zeros_like), "the yaw rate does not follow the steering"),
        (trace(yaw_rate=noise(1e-4)), "the yaw rate barely responds to the reversal"),
    ],
    ids=["steering", "yaw rate", "right first", "acceleration", "still", "no answer to the reversal"],
)
def test_a_car_that_does_not_answer_the_steering_is_not_judged(made, why):
    judged = evaluate_dwell(made, A)
    assert set(verdicts(judged)) == {"stability", "responsiveness"}
    assert set(verdicts(judged).values()) == {"not judged"}
    assert all(why in verdict.why for verdict in judged.criteria.values())
    assert judged.judges_nothing


@pytest.mark.parametrize("seed", range(6))
def test_noise_is_no_answer_and_passes_nothing(seed):
    judged = evaluate_dwell(unanswered(noise(0.01, seed)), A)
    assert judged.criteria["stability"].status is not Status.PASSED


def test_a_second_peak_that_comes_later_than_the_first_ratio_is_none():
    def yaw_rate(late):
        return lambda t: -PEAK * np.exp(-(((t - END - late) / 0.5) ** 2))

    assert evaluate_dwell(trace(yaw_rate=yaw_rate(0.8)), A)["peak_at"] == pytest.approx(END + 0.8, abs=0.005)
    judged = evaluate_dwell(trace(yaw_rate=yaw_rate(1.2)), A)
    assert judged["peak"] is None
    assert judged.criteria["stability"].status is Status.FAILED


def test_a_slow_steer_whose_acceleration_opposes_it_has_no_angle():
    judged = evaluate_slow_steer(turned(slow_steer(), "acceleration_y"))
    assert judged["angle"] is None
    assert mentions(str(judged.diagnostics[0]), "'sign: -1'", "lateral", "acceleration")


def test_responsiveness_is_asked_from_5_a_on_a_dry_road_at_80_km_h():
    assert "responsiveness" not in evaluate_dwell(trace(4.99 * A), A).criteria
    slow = trace()
    slow.signals["velocity_x"][:] = 77.0 / 3.6
    for made, angle, stability, responsiveness in (
        (trace(5.0 * A), A, "passed", "passed"),
        (trace(friction=0.4), A, "passed", "not judged"),
        (trace(), None, "passed", "not judged"),
        (slow, A, "not judged", "not judged"),
    ):
        wanted = {"stability": stability, "responsiveness": responsiveness}
        assert verdicts(evaluate_dwell(made, angle)) == wanted


def test_a_heavy_car_may_be_slower():
    made = trace()
    made.signals["acceleration_y"] *= 1.65 / evaluate_dwell(made, A)["displacement"]  # of 1.52 to 1.83 m
    heavy = Trace("heavy", made.time, made.signals, mass=3501.0)
    assert 1.52 < evaluate_dwell(made, A)["displacement"] < 1.83
    assert verdicts(evaluate_dwell(made, A))["responsiveness"] == "failed"
    assert verdicts(evaluate_dwell(heavy, A))["responsiveness"] == "passed"


@pytest.mark.parametrize(
    "angle, runs, last", [(16.0, 32, 270.0), (36.0, 13, 270.0), (44.3, 11, 287.95), (50.0, 10, 300.0)]
)
def test_the_ladder_goes_in_steps_of_half_a_up_to_the_last_run(angle, runs, last):
    ladder = [degrees(x) for x in amplitudes(radians(angle))]
    assert len(ladder) == runs
    assert ladder[0] == pytest.approx(1.5 * angle)
    assert ladder[-1] == pytest.approx(last)
    assert np.diff(ladder)[:-1] == pytest.approx(0.5 * angle)
    assert np.diff(ladder)[-1] <= 0.5 * angle + 1e-9


def test_a_car_that_hardly_steers_has_the_largest_amplitude_for_its_only_one():
    assert [degrees(x) for x in amplitudes(radians(350.0))] == pytest.approx([300.0])


@pytest.mark.parametrize(
    "spoilt, why, summary",
    [
        ("missing", ("1 runs", "+108.0 degrees"), "has not passed (stability and responsiveness not judged)"),
        (Status.FAILED, ("1", "26 runs", "144.0 degrees", "fail", "smallest"), "has failed (stability)"),
        (Status.NOT_JUDGED, ("1", "26 runs"), "has not passed (stability not judged)"),
        (Status.PASSED, ("26 runs",), "has passed, with"),
    ],
)
def test_a_series_passes_only_if_no_run_is_missing_fails_or_is_not_judged(spoilt, why, summary):
    runs = []
    for amplitude in (side * amplitude for side in (1.0, -1.0) for amplitude in amplitudes(A)):
        judged = Evaluation(f"{degrees(amplitude):.0f}")
        judged.add("amplitude", "amplitude", amplitude, "rad")
        judged.rule("stability", Verdict(Status.PASSED))
        judged.rule("responsiveness", Verdict(Status.PASSED))
        runs.append(judged)
    if spoilt == "missing":
        del runs[3]
    else:
        runs[5].rule("stability", Verdict(spoilt))
    series = judge_series(runs, A)
    assert series.data["verdict"] is (Status.PASSED if spoilt is Status.PASSED else Status.FAILED)
    assert mentions(series.criteria["stability"].why, *why)
    assert summary in series.summary


def test_runs_of_one_amplitude_are_no_series():
    left, right, other = (evaluate_dwell(trace(x), A) for x in (LARGE, -LARGE, LARGE))
    assert is_series([left, right])
    assert not is_series([left, right, other])
    assert not is_series([left])


def slow_steer(side=1.0, *, sampling=SAMPLING["1 kHz"], offset=0.0) -> Trace:
    """Return 13.5 deg/s of hand wheel, and an acceleration of 0.3 g at 40 degrees; 5 g/rad2 fall off."""
    t = sampling(9.0)
    hand = side * radians(13.5) * np.maximum(t - 2.0, 0.0)
    signals = {"steering_wheel_angle": hand + offset, "acceleration_y": 0.3 * G * hand / radians(40.0)}
    return Trace("slow", t, signals)


@as_sampled
def test_the_angle_at_0_3_g_of_a_straight_line_is_that_of_the_line(sampling):
    both = [evaluate_slow_steer(slow_steer(side, sampling=sampling)) for side in (1.0, -1.0)]
    assert [degrees(one["angle"]) for one in both] == pytest.approx([40.0, -40.0], abs=1e-9)
    assert degrees(characteristic_angle(both)) == pytest.approx(40.0, abs=1e-9)


def test_a_is_rounded_to_a_tenth_of_a_degree_run_by_run_and_as_a_mean():
    both = [evaluate_slow_steer(slow_steer(side, offset=radians(0.26))) for side in (1.0, -1.0)]
    assert [degrees(one["angle"]) for one in both] == pytest.approx([40.3, -39.7], abs=1e-9)
    assert degrees(characteristic_angle(both[:1])) == pytest.approx(40.3, abs=1e-9)
    assert degrees(characteristic_angle(both)) == pytest.approx(40.0, abs=1e-9)


def test_a_run_that_ends_before_0_375_g_has_no_angle():
    made = slow_steer()
    made.signals["acceleration_y"] *= 0.5
    judged = evaluate_slow_steer(made)
    assert judged["angle"] is None
    with pytest.raises(NotJudged) as caught:
        characteristic_angle([judged])
    assert mentions(caught.value, "0.354 g", "0.375 g", "slowly", "steer")


MAPPING = """
time: {column: Zeit, unit: ms}
signals:
  steering_wheel_angle: {column: LRW, unit: deg, sign: -1}
  yaw_rate: Gier
  acceleration_y: {column: ay, unit: cm/s2}
vehicle: {mass: 1.8 t}
files: [run.csv]
"""


COARSE = ("--set", "step_size=0.005")


def write_measured(made: Trace, file: Path) -> None:
    """Write a trace as other programs would, under other names and in other units."""
    columns = {
        "Zeit": 1000.0 * made.time,
        "LRW": -np.degrees(made["steering_wheel_angle"]),
        "Gier [deg/s]": np.degrees(made["yaw_rate"]),
        "ay": made["acceleration_y"] / 0.01,
    }
    table = np.column_stack(list(columns.values()))
    np.savetxt(file, table, "%.12g", ",", header=",".join(columns), comments="")


def test_measured_columns_under_other_names_units_and_signs_give_the_same(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    made = trace(sampling=SAMPLING["200 Hz"])
    write_measured(made, tmp_path / "run.csv")
    (tmp_path / "map.yaml").write_text(MAPPING)
    options = ("--angle", "36 deg", "--out", "out", "--no-figures")
    assert status_of("evaluate", "sine-with-dwell", "map.yaml", *options) == 0
    found = json.loads((tmp_path / "out/evaluation.json").read_text())["runs"][0]
    exact = evaluate_dwell(made, A)
    assert found["verdict"] == "passed"
    for key, one in found["quantities"].items():
        assert one["value"] == pytest.approx(exact[key], rel=1e-8), key
    assert mentions([why["message"] for why in found["diagnostics"]], "sideslip", "spin", "ratios")


def test_units_may_stand_in_the_header_and_in_a_row_below(tmp_path):
    made, file = trace(sampling=SAMPLING["200 Hz"]), tmp_path / "run.csv"
    write_measured(made, file)
    heading = "Zeit [ms],LRW,Gier,ay\n-,deg,deg/s,cm/s2\n"
    file.write_text(heading + file.read_text().partition("\n")[2])
    (tmp_path / "map.yaml").write_text(
        "files: [run.csv]\ntime: Zeit\n"
        "signals: {steering_wheel_angle: {column: LRW, sign: -1}, yaw_rate: Gier, acceleration_y: ay}\n"
    )
    read = trace_of(load_run(tmp_path / "map.yaml"))
    assert read.time == pytest.approx(made.time)
    for name in ("steering_wheel_angle", "yaw_rate", "acceleration_y"):
        assert read[name] == pytest.approx(made[name], abs=1e-9), name


def test_a_few_spikes_of_an_accelerometer_are_no_wrong_unit(tmp_path):
    made, file = trace(sampling=SAMPLING["200 Hz"]), tmp_path / "run.csv"
    made.signals["acceleration_y"][:: made.time.size // 5] = 90.0
    write_measured(made, file)
    (tmp_path / "map.yaml").write_text(MAPPING)
    read = trace_of(load_run(tmp_path / "map.yaml"))
    assert read["acceleration_y"].max() == pytest.approx(90.0)


def test_an_evaluation_that_judges_nothing_says_so_and_ends_with_1(tmp_path, yawbench):
    made = trace(sampling=SAMPLING["200 Hz"])
    command = ("evaluate", "sine-with-dwell", tmp_path / "map.yaml", "--out", tmp_path, "--no-figures")
    (tmp_path / "map.yaml").write_text(MAPPING)
    write_measured(turned(made, "steering_wheel_angle"), tmp_path / "run.csv")
    status, shown, said = yawbench(*command)
    assert status == 1 and mentions(shown, "yaw", "rate") and mentions(said, "judged")
    write_measured(turned(made, "steering_wheel_angle"), tmp_path / "run.csv")
    assert yawbench(*command)[0] == 0


@pytest.mark.parametrize(
    "wrong, names",
    [
        (("unit: deg,", "unit: rad,"), ("steering_wheel_angle", "270 rad", "12.57 rad", "'deg'")),
        (("unit: cm/s2", "unit: m/s2"), ("acceleration_y", "car", "reaches")),
        (("unit: cm/s2", "unit: g"), ("acceleration_y", "car", "reaches")),
        (("{column: Zeit, unit: ms}", "Zeit"), ("'Zeit'", "column", "unit")),
        (("1.8 t", "1.8 m"), ("'1.8 m'", "value")),
    ],
)
def test_a_wrong_unit_is_answered_by_a_sentence(wrong, names, tmp_path, yawbench):
    write_measured(trace(sampling=SAMPLING["200 Hz"]), tmp_path / "run.csv")
    (tmp_path / "map.yaml").write_text(MAPPING.replace(*wrong))
    status, _, said = yawbench("evaluate", "sine-with-dwell", tmp_path / "map.yaml")
    assert status in (1, 2) and mentions(said, *names)


@pytest.mark.exhaustive
def test_a_series_is_driven_from_a_and_goes_on_where_it_was(tmp_path, yawbench):
    """With steps of 5 ms; A = 180 degrees asks for two amplitudes to each side."""
    series = tmp_path / "series"
    command = ("drive", "sine-with-dwell", *COARSE, "--angle", "180 deg", "--out", series)
    status, first, _ = yawbench(*command)
    assert status == 0
    found = json.loads((series / "evaluation.json").read_text())
    amplitudes_ = [degrees(one["quantities"]["amplitude"]["value"]) for one in found["runs"]]
    assert amplitudes_ == pytest.approx([270.0, 300.0, -270.0, -300.0])
    assert found["series"]["verdict"] == "failed"  # this car without control turns round
    left, right = ([one["quantities"] for one in found["runs"][k : k + 2]] for k in (0, 2))
    for one, other in zip(left, right, strict=True):
        for key in ("ratio_1000", "ratio_1750", "displacement", "sideslip"):
            assert one[key]["value"] == pytest.approx(other[key]["value"], abs=1e-6), key
    assert (series / "sine_with_dwell_series.png").is_file()
    status, again, said = yawbench(*command)
    assert (status, again) == (0, first) and mentions(said, "4 runs", "sine", "dwell")


@pytest.mark.exhaustive
def test_a_series_with_a_car_that_rolls_over_has_a_verdict(tmp_path, yawbench):
    high = ("--vehicle", "van", "--set", "plant.cg_height=1.1", *COARSE, "--angle", "200 deg")
    status, _, said = yawbench("drive", "sine-with-dwell", *high, "--out", tmp_path)
    assert status == 1 and said.count("the car has rolled over") == 2
    found = json.loads((tmp_path / "evaluation.json").read_text())
    assert found["series"]["verdict"] == "failed"
    assert found["series"]["criteria"]["stability"]["verdict"] == "not judged"


@pytest.mark.parametrize(
    "test, options, names",
    [
        ("sine-with-dwell", ("--vehicle", "large_salon"), ("'large_saloon'",)),
        ("sine-with-dwell", ("--set", "driver.amplitude=1"), ("driver.amplitude", "series", "itself")),
        ("sine-with-dwell", ("--angle", "400 deg"), ("--angle", "0", "360 degrees")),
        ("sine-with-dwell", ("--angle", "3 m"), ("--angle", "'3 m'")),
        ("iso-3888-2", ("--angle", "40 deg"), ("iso-3888-2", "--angle", "--slow-steer")),
        ("iso-3888-2", ("--set", "speed=70km/h"), ("speed", "series", "itself")),
    ],
)
def test_what_a_series_cannot_be_driven_with_is_said_before_any_run(test, options, names, yawbench, tmp_path):
    status, _, said = yawbench("drive", test, *options, "--out", tmp_path / "out")
    assert status == 2 and mentions(said, *names)
    assert not list(tmp_path.rglob("run.json"))


def test_a_series_of_lane_changes_finds_the_highest_clean_speed_and_goes_on_where_it_was(tmp_path, yawbench):
    command = ("drive", "iso-3888-2", *COARSE, "--out", tmp_path)
    status, first, _ = yawbench(*command)
    assert status == 0
    found = json.loads((tmp_path / "evaluation.json").read_text())["series"]
    highest, touched = (3.6 * found[key] for key in ("highest_clean_entry_speed", "lowest_not_clean"))
    assert 55.0 < highest < touched < highest + 0.5
    assert (tmp_path / "lane_change_series.png").is_file()
    status, again, said = yawbench(*command)
    assert (status, again) == (0, first) and mentions(said, "km/h", "1 run")
