"""Samples: their points, and what runs over them come to, against closed forms of the linear single track."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import stats

import yawbench as yb
from tests.refusals import mentions, refused
from tests.studies.experiment_files import written
from yawbench.foundation.errors import ResultsError, ScenarioError
from yawbench.studies import sampling, uncertainty
from yawbench.studies.load_experiment import load_experiment

UNITS = ("driver_sine", "reference_steady_state", "controller_off", "controller_fuzzy_sideslip")

SCENARIO = """
title: A linear single track
stop_time: {end}
step_size: 0.01
inputs: {{velocity_x: 20, friction: 1, sideslip: 0, sideslip_rate: 0}}
units:
  driver: {{fmu: driver_sine, parameters: {{frequency: 1, start_time: 0}}}}
  reference:
    fmu: reference_steady_state
    parameters: {{limited: false, cornering_stiffness_front: 80000, cornering_stiffness_rear: 100000}}
  controller: {{fmu: controller_fuzzy_sideslip}}
"""
METRIC = "peak(yaw_rate_ref)"
MASS, FRONT, REAR = 1500.0, 1.2, 1.4
BASE = FRONT + REAR
STABILITY = MASS / BASE**2 * (REAR / 80000.0 - FRONT / 100000.0)
"""K of r = v delta / (L (1 + K v²)); Rajamani, Vehicle Dynamics and Control, 2nd ed., (3.14)."""


@pytest.fixture
def base(tmp_path):
    (tmp_path / "track.yaml").write_text(SCENARIO.format(end=0.3))
    return yb.load(tmp_path / "track.yaml").set({
        "reference.mass": MASS, "reference.cg_to_front_axle": FRONT, "reference.cg_to_rear_axle": REAR,
    })  # fmt: skip


def gain(base):
    """Return the yaw rate per amplitude at 20 m/s."""
    return base.set({"driver.amplitude": 0.02}).run().metric(METRIC) / 0.02


def slope(v):
    return v / (BASE * (1.0 + STABILITY * v * v))


def test_mean_deviation_percentiles_and_probability_of_a_normal_amplitude_hold_the_closed_form(base):
    per_amplitude, mu, sigma = gain(base), 0.03, 0.004
    made = yb.experiment(
        base, {"driver.amplitude": yb.normal(mu, sigma)}, metrics=METRIC, points=64, design="random", seed=3
    ).run(progress=False)
    row = made.statistics.iloc[0]
    true = {"mean": per_amplitude * mu, "deviation": per_amplitude * sigma}
    for p in uncertainty.PERCENTILES:
        true[f"p{p}"] = per_amplitude * (mu + sigma * stats.norm.ppf(p / 100))
    for name, number in true.items():
        low, high = row[f"{name} low"], row[f"{name} high"]
        assert not low > number, name
        assert not high < number, name
    assert row["mean high"] - row["mean low"] < 0.15 * row["mean"]
    bound = per_amplitude * (mu + sigma)
    found = made.probability(METRIC, below=bound).iloc[0]
    assert found["probability low"] < stats.norm.cdf(1.0) < found["probability high"]
    assert found["probability high"] - found["probability low"] < 0.25


def test_means_over_a_uniform_speed_and_sobol_indices_hold_the_closed_form(base):
    ratio = gain(base) / slope(20.0)
    a, b, mu, sigma = 15.0, 35.0, 0.03, 0.006
    axes = {"inputs.velocity_x": yb.uniform(a, b), "driver.amplitude": yb.normal(mu, sigma)}
    made = yb.experiment(base, axes, metrics=METRIC, points=128, design="saltelli").run(progress=False)
    assert len(made.table) == 128 * 4
    first = (math.log1p(STABILITY * b * b) - math.log1p(STABILITY * a * a)) / (2 * STABILITY * BASE * (b - a))
    row = made.statistics.iloc[0]
    assert row["mean low"] < ratio * mu * first < row["mean high"]
    speeds = np.linspace(a, b, 100_001)
    second = float(np.mean(slope(speeds) ** 2))
    of_speed, of_amplitude = second - first**2, sigma**2
    variance = of_speed * of_amplitude + of_speed * mu**2 + of_amplitude * first**2
    shares = {
        "inputs.velocity_x": of_speed * mu**2 / variance,
        "driver.amplitude": of_amplitude * first**2 / variance,
    }
    both = of_speed * of_amplitude / variance
    found = made.sensitivity.set_index("axis")
    for axis, share in shares.items():
        assert found.loc[axis, "first low"] < share < found.loc[axis, "first high"]
        assert found.loc[axis, "total low"] < share + both < found.loc[axis, "total high"]
        assert found.loc[axis, "first high"] - found.loc[axis, "first low"] < 0.6


def test_sobol_indices_are_those_of_scipy():
    points = sampling.positions("saltelli", 3, 256, 5)
    x = points - 0.5
    y = np.sin(3 * x[:, 0]) + 2 * x[:, 1] ** 2 * x[:, 2] + x[:, 2]
    a, b, *mixed = y.reshape(5, 256)
    theirs = stats.sobol_indices(
        func={"f_A": a[None], "f_B": b[None], "f_AB": np.array(mixed)[:, None]}, n=256
    )
    for k in range(3):
        ours = uncertainty.sobol_indices(a, b, mixed[k])
        assert ours.first.number == pytest.approx(theirs.first_order[k], abs=0.01)
        assert ours.total.number == pytest.approx(theirs.total_order[k], abs=0.01)


@pytest.mark.parametrize("design", ["random", "latin_hypercube", "sobol"])
def test_intervals_hold_the_truth_as_often_as_they_say(design):
    """200 samples of 64 points of x + y, uniform: mean 1, median 1, P(x + y < 1.5) = 7/8."""
    held = dict.fromkeys(("mean", "median", "probability", "distribution"), 0)
    samples = 200
    for seed in range(samples):
        y = sampling.positions(design, 2, 64, seed).sum(axis=1)
        estimates = {
            "mean": (uncertainty.mean(y), 1.0),
            "median": (uncertainty.percentile(y, 50), 1.0),
            "probability": (uncertainty.probability(int(np.sum(y < 1.5)), 64), 7 / 8),
        }
        for name, (estimate, true) in estimates.items():
            held[name] += estimate.low <= true <= estimate.high
        ordered = np.sort(y)
        true = np.where(ordered < 1, ordered**2 / 2, 1 - (2 - ordered) ** 2 / 2)
        upper, lower = np.arange(1, 65) / 64 - true, true - np.arange(64) / 64
        held["distribution"] += max(upper.max(), lower.max()) <= uncertainty.band(64)
    least = stats.binom.ppf(0.001, samples, 0.95)
    assert all(count >= least for count in held.values()), held


def test_a_distribution_is_what_scipy_says():
    places = np.linspace(0.001, 0.999, 57)
    normal = sampling.Normal(3.0, 0.5)
    cut = sampling.Normal(3.0, 0.5, 2.6, 3.1)
    tail = sampling.Normal(0.0, 1.0, 4.0, None)
    truths = (
        (normal, stats.norm(3.0, 0.5)),
        (cut, stats.truncnorm(-0.8, 0.2, 3.0, 0.5)),
        (tail, stats.truncnorm(4.0, np.inf)),
    )
    for distribution, true in truths:
        assert [distribution.at(place) for place in places] == pytest.approx(true.ppf(places), rel=1e-9)
    assert all(math.isfinite(normal.at(place)) for place in (0.0, 1.0))
    table = sampling.Tabulated(sampling.table_of([[60, 0], [80, 0.7], [120, 1]]))
    assert [table.at(place) for place in (0.0, 0.35, 0.7, 0.85, 1.0)] == [60.0, 70.0, 80.0, 100.0, 120.0]
    measured = sampling.Tabulated(sampling.table_of([3.0, 1.0, 2.0]))
    assert [measured.at(place) for place in (0.0, 0.25, 1.0)] == [1.0, 1.5, 3.0]


def test_every_law_and_scenario_has_the_same_points_and_differences_are_of_these(base, tmp_path):
    (tmp_path / "longer.yaml").write_text(SCENARIO.format(end=0.4))
    axes = {
        "driver.amplitude": yb.uniform(0.01, 0.05),
        "scenario": {"short": str(tmp_path / "track.yaml"), "long": str(tmp_path / "longer.yaml")},
        "controller": ["controller_off", "controller_fuzzy_sideslip"],
    }
    made = yb.experiment(base, axes, metrics=["peak(yaw_rate_ref)", "peak(yaw_moment)"], points=8).run(
        progress=False
    )
    table = made.table
    assert len(table) == 32
    drawn = [tuple(group["driver.amplitude"]) for _, group in table.groupby(["scenario", "controller"])]
    assert len(drawn) == 4
    assert len({*drawn}) == 1
    assert len({*drawn[0]}) == 8
    moments = {
        key: group["peak(yaw_moment)"].to_numpy() for key, group in table.groupby(["scenario", "controller"])
    }
    found = made.differences.set_index(["axis", "scenario", "controller", "metric"])
    row = found.loc[("controller", "long", "controller_fuzzy_sideslip", "peak(yaw_moment)")]
    expected = moments["long", "controller_fuzzy_sideslip"] - moments["long", "controller_off"]
    assert row["mean"] == pytest.approx(expected.mean(), rel=1e-12)
    assert len(made.runs[0]) == 31
    assert len(made.runs[16]) == 41


def test_how_probable_a_spin_is_counts_the_runs_that_are_warned_of_it():
    base = yb.load("fnn_sideslip/25mps").swap(controller="controller_off")
    steered = {"driver.amplitude": yb.uniform(0.15, 0.4)}
    metrics = ("spins(sideslip)", "peak(sideslip)")
    with pytest.warns(yb.YawbenchWarning, match="spins"):
        made = yb.experiment(base, steered, metrics=metrics, points=8).run(progress=False)
    warned = [any(one.code == "car-spins" for one in run.diagnostics) for run in made.runs]
    assert 0 < sum(warned) < len(warned)
    (row,) = made.probability("spins(sideslip)").to_dict("records")
    assert (row["runs"], row["meeting"], row["missing"]) == (8, sum(warned), 0)
    exact = stats.binomtest(sum(warned), 8).proportion_ci(method="exact")
    assert (row["probability low"], row["probability high"]) == pytest.approx((exact.low, exact.high))
    mean = made.statistics.set_index("metric").loc["spins(sideslip)"]
    assert [mean["mean"], mean["mean low"]] == pytest.approx([sum(warned) / 8, exact.low])
    held = made.probability("spins(sideslip)", at_most=0)
    assert held["meeting"].tolist() == [8 - sum(warned)]
    with pytest.raises(ScenarioError) as caught:
        made.probability("peak(sideslip)")
    assert mentions(caught.value, "below", "at_most", "above", "at_least")


def test_a_run_without_a_number_does_not_count_where_it_is_asked_whether_something_happens(base, monkeypatch):
    steered = {"driver.amplitude": yb.uniform(0.02, 0.03)}
    made = yb.experiment(base, steered, metrics="changes(yaw_rate_ref)", points=4).run(progress=False)
    known = uncertainty.numbers_of
    monkeypatch.setattr(uncertainty, "numbers_of", lambda *of: np.append(known(*of)[:3], np.nan))
    (row,) = made.probability("changes(yaw_rate_ref)").to_dict("records")
    assert [row[name] for name in ("runs", "meeting", "missing", "probability")] == [3, 3, 1, 1.0]


FILE = """
title: How sure
scenario: {dry.yaml: dry, wet.yaml: wet}
design: sobol
points: 16
seed: 2
axes:
  speed: {vary: inputs.velocity_x, table: speeds.csv, unit: km/h}
  amplitude: {vary: driver.amplitude, normal: {mean: 0.03, deviation: 0.005}, from: 0.02}
  control: {vary: controller, values: {controller_off: no control, controller_fuzzy_sideslip: fuzzy}}
metrics:
  yaw: {metric: peak(yaw_rate_ref)}
  turned: {metric: changes(yaw_rate_ref), heading: the reference turns}
probabilities:
  slow: {says: The yaw rate stays below 15 deg/s, holds_if: [{metric: yaw, below: 15 deg/s}]}
figures:
  - {name: share, kind: distribution, metric: yaw, lines: control, panels: scenario, mark: 15 deg/s}
  - {name: gain, kind: distribution, metric: yaw, lines: scenario, panels: control, against: dry}
  - {name: causes, kind: sensitivity, metric: yaw, lines: control, panels: scenario}
"""


@pytest.fixture
def file(tmp_path):
    """Write the file with texts of it replaced."""
    (tmp_path / "speeds.csv").write_text("speed,share\n60,0\n80,0.7\n120,1\n")
    scenario = SCENARIO.format(end=0.3)
    return lambda *changes: written(tmp_path, FILE, *changes, dry=scenario, wet=scenario)


def test_a_file_draws_writes_tables_and_figures_and_its_page_shows_the_points(file, yawbench, tmp_path):
    status, said, _ = yawbench("sweep", file(), "--out", tmp_path / "out", "--jobs", 2)
    assert status == 0
    assert mentions(said, "Probability: The yaw rate stays below 15 deg/s")
    assert mentions(said, "Probability: the reference turns")
    found = yb.open(tmp_path / "out")
    assert len(found.table) == 64
    assert {"statistics", "probabilities", "differences", "sensitivity", "table"} <= set(found.tables)
    assert len(found.tables["statistics"]) == 8
    assert found.tables["probabilities"]["probability of"].tolist() == ["slow"] * 4 + ["turned"] * 4
    assert found.table["speed"].between(60 / 3.6, 120 / 3.6).all()
    drawn = {path.name for path in (tmp_path / "out" / "figures").glob("*.svg")}
    assert drawn == {"share.svg", "gain.svg", "causes.svg"}
    assert "<img" in (tmp_path / "out" / "report.html").read_text()


REFUSED = [
    ("points: 16", "points: 15", ("power of two", "8", "16", "15")),
    ("seed: 2\n", "", ("sobol", "seed")),
    ("table: speeds.csv", "table: none.csv", ("none.csv", "cannot be read")),
    ("table: speeds.csv", "table: [[1, 0], [2, 0.5]]", ("cumulative", "1")),
    ("deviation: 0.005", "deviation: -1", ("deviation", "greater than 0")),
    ("from: 0.02}", "from: 5}", ("between from and to", "1e-06")),
    ("design: sobol\npoints: 16\nseed: 2\n", "design: grid\n", ("probabilities", "latin_hypercube")),
    ("against: dry", "against: dy", ("'dy'", "'dry'")),
    ("lines: scenario, panels: control", "lines: speed, panels: control", ("speed", "drawn")),
    (", panels: scenario, mark", ", mark", ("scenario", "lines or panels")),
    ("from: 0.02}", "from: 0.02, values: [1]}", ("values", "from")),
]


@pytest.mark.parametrize(("old", "new", "names"), REFUSED)
def test_a_sample_that_is_wrong_is_refused_in_a_sentence(old, new, names, file):
    with refused(ScenarioError, names=names):
        load_experiment(file((old, new)))


def test_what_was_not_drawn_has_no_statistics(base):
    with pytest.raises(ResultsError):
        yb.experiment(base, {"driver.amplitude": [0.01]}, metrics=METRIC).run(progress=False).statistics  # noqa: B018
    for axis, more in ((yb.uniform(0.01, 0.02), {"metrics": METRIC}), ([0.01], {"points": 8})):
        with pytest.raises(ScenarioError):
            yb.experiment(base, {"driver.amplitude": axis}, **more)
