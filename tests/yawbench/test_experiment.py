"""Many runs of a scenario from Python: the design, the table, figures, what is refused."""

from __future__ import annotations

import itertools
import re
import subprocess
import sys

import numpy as np
import pytest

import yawbench as yb
from tests.refusals import mentions, refused


class Proportional:
    """A controller whose runs are made in this process."""

    inputs = ("yaw_rate_ref", "yaw_rate")
    outputs = ("yaw_moment",)

    def __init__(self, gain=2e4, step_size=0.005):
        self.gain, self.step_size = gain, step_size

    def output(self, t, u):
        return self.gain * (u.yaw_rate_ref - u.yaw_rate)


@pytest.fixture(scope="module")
def base():
    return yb.load("fnn_sideslip/25mps").set({"stop_time": 1.6})


@pytest.fixture(scope="module")
def runs(base):
    """Two controllers at two speeds, one of them in plain Python."""
    axes = {"controller": ["controller_off", Proportional()], "plant.initial_speed": ["54 km/h", "90 km/h"]}
    return yb.experiment(base, axes, metrics=["peak(sideslip)", "peak(yaw_moment)"]).run(workers=1)


def test_the_table_has_a_row_per_combination_in_si_with_units(runs):
    table = runs.table
    assert table["controller"].tolist() == ["controller_off"] * 2 + ["Proportional"] * 2
    assert table["plant.initial_speed"].tolist() == [15.0, 25.0, 15.0, 25.0]
    assert set(table["status"]) == {"completed"}
    assert table.attrs["units"]["plant.initial_speed"] == "m/s"
    assert table.attrs["units"]["peak(sideslip)"] == "rad"
    assert table["key"].nunique() == 4


def test_every_row_is_what_the_run_alone_comes_to(base, runs):
    for number, change in ((1, "controller_off"), (3, Proportional())):
        alone = base.swap(controller=change).set({"plant.initial_speed": 25.0}).run()
        assert runs.table["peak(sideslip)"][number] == alone.metric("peak(sideslip)")
        assert runs.runs[number].metric("peak(yaw_moment)") == alone.metric("peak(yaw_moment)")


def test_a_metric_is_drawn_over_an_axis_with_a_line_per_level(runs):
    (axes,) = runs.plot("peak(sideslip)", x="plant.initial_speed", lines="controller").axes
    assert [line.get_xdata().tolist() for line in axes.get_lines()] == [[54.0, 90.0], [54.0, 90.0]]
    with refused(yb.ScenarioError, "figure-invalid", names=("'controller'", "axis", "figure")):
        runs.plot("peak(sideslip)", x="plant.initial_speed")
    with refused(yb.ScenarioError, "name-unknown", names=("'peak(sideslp)'", "'peak(sideslip)'")):
        runs.plot("peak(sideslp)", x="plant.initial_speed", lines="controller")


def test_levels_may_come_from_anything_that_gives_them_and_take_the_place_of_what_was_swapped(base):
    axes = {"driver.amplitude": (x for x in (0.01, 0.02)), "plant.initial_speed": range(20, 23)}
    assert len(yb.experiment(base, axes)) == 6
    axes = {"controller": ["controller_off", Proportional()]}
    swapped = base.swap(controller=Proportional(step_size=0.1))
    one, other = (yb.experiment(before, axes) for before in (base, swapped))
    assert one._design == other._design


def test_a_run_that_fails_is_a_row_with_its_reason_and_the_others_are_made(base):
    def careless(yaw_rate_ref, yaw_rate):
        return 20000 * yaw_rate_ref / yaw_rate

    made = yb.experiment(base, {"controller": [careless, "controller_off"]}).run(workers=1, keep=False)
    assert made.table["status"].tolist() == ["failed", "completed"]
    assert mentions(made.table["reason"][0], "float", "division", "zero")
    assert made.runs is None
    rows = [line for line in made.to_latex(["controller"]).splitlines() if line.endswith(r"\\")]
    assert rows == [r"controller & status \\", r"careless & failed \\", r"controller\_off & completed \\"]


@pytest.mark.parametrize(
    ("axes", "names"),
    [
        ({"controlller": ["a"]}, ("'controlller'", "'controller'")),
        ({"driver.amplitude": []}, ("axes.driver.amplitude.values", "values")),
        ({"driver.amplitude": ["1 deg", 2]}, ("driver.amplitude", "levels", "unit")),
        ({"driver.amplitude": ["1.2.3 deg"]}, ("'1.2.3 deg'", "plain", "numbers")),
        ({"driver.amplitde": [1, 2]}, ("'amplitde'", "'amplitude'")),
        ({"driver.amplitude": 1}, ("driver.amplitude", "1")),
        ({"controller": "controller_off"}, ("controller", "list", "levels")),
        ({"driver.amplitude": ["0.01", "0.02"]}, ("driver.amplitude", "numbers", "text")),
        ({"driver.amplitude": np.ones((2, 2))}, ("driver.amplitude", "0")),
        ({"driver.amplitude": itertools.count(0.01, 0.01)}, ("driver.amplitude", "100,000")),
        ({"driver.amplitude": {"small": 0.02}}, ("driver.amplitude",)),  # only instances have labels
        ({"controller": [Proportional(), Proportional()]}, ("controller", "'Proportional'")),
    ],
)
def test_what_is_wrong_is_said_before_any_run_is_made(base, axes, names):
    with refused(yb.ScenarioError, names=names):
        yb.experiment(base, axes).run()


def test_workers_that_are_no_number_are_refused(base):
    with refused(TypeError, names=("workers", "'x'")):
        yb.experiment(base, {"driver.amplitude": [0.02]}).run(workers="x")


def test_a_script_runs_an_experiment_without_a_guard_and_only_once(tmp_path):
    script = tmp_path / "mine.py"
    script.write_text(
        "import yawbench as yb\n"
        "print('begun')\n"
        "base = yb.load('fnn_sideslip/25mps').set({'stop_time': 0.01})\n"
        "runs = yb.experiment(base, {'plant.initial_speed': [20, 25]}, metrics='final(velocity_x)').run()\n"
        "print(runs.table['final(velocity_x)'].round().tolist())\n"
    )
    done = subprocess.run([sys.executable, script], cwd=tmp_path, capture_output=True, text=True, check=True)
    assert (done.stdout, done.stderr) == ("begun\n[20.0, 25.0]\n", "")
    assert list(tmp_path.iterdir()) == [script]


@pytest.fixture(scope="module")
def labelled(base):
    axes = {"controller": {"low": Proportional(1e4), "high": Proportional(2e4), "1/2": "controller_off"}}
    return yb.experiment(base, {**axes, "driver.amplitude": [0.02, 0.03]}).run(workers=1)


def test_labels_tell_objects_of_a_class_apart(base, labelled):
    assert labelled.table["controller"].tolist() == [*["low"] * 2, *["high"] * 2, *["1/2"] * 2]
    alone = base.swap(controller=Proportional(2e4)).set({"driver.amplitude": 0.02}).run()
    assert np.array_equal(labelled.runs[2]["plant.yaw_rate"], alone["plant.yaw_rate"])
    error = labelled.runs[0]["yaw_rate_ref"] - labelled.runs[0]["plant.yaw_rate"]
    assert np.abs(labelled.runs[0]["controller.yaw_moment"]).max() == pytest.approx(
        1e4 * np.abs(error).max(), rel=0.05
    )


def test_xarray_has_the_runs_over_axes_and_time(labelled):
    pytest.importorskip("xarray")
    data = labelled.to_xarray()
    assert data["plant.yaw_rate"].dims == ("controller", "driver.amplitude", "time")
    assert data["plant.yaw_rate"].attrs["units"] == "rad/s"
    picked = data["plant.yaw_rate"].sel({"controller": "high", "driver.amplitude": 0.03})
    assert np.array_equal(picked, labelled.runs[3]["plant.yaw_rate"])
    single = labelled.runs[3].to_xarray()
    assert np.array_equal(single["plant.yaw_rate"], picked)
    assert single["time"].attrs["units"] == "s"


def test_a_table_for_latex_has_the_columns_that_are_asked_for_in_displayed_units(runs):
    whole = runs.to_latex()
    assert r"controller & plant.initial\_speed & peak(sideslip) & peak(yaw\_moment) \\" in whole
    assert whole.count("km/h") == 4
    chosen = runs.to_latex({"controller": "law", "peak(sideslip)": "side & slip"}, caption="", label="tab:x")
    lines = chosen.splitlines()
    assert lines[2:6] == [r"\label{tab:x}", r"\begin{tabular}{lr}", r"\toprule", r"law & side \& slip \\"]
    angle = np.degrees(runs.table["peak(sideslip)"][0])
    assert lines[7] == rf"controller\_off & {angle:.3g} \ensuremath{{^\circ}} \\"
    with refused(yb.ScenarioError, "argument-invalid", names=("columns", "'peak(sideslip)'")):
        runs.to_latex(["peak(sidesli)"])


def test_what_a_sample_comes_to_is_a_table_for_latex_per_metric_with_intervals(base):
    axes = {"driver.amplitude": yb.uniform(0.02, 0.03), "controller": ["controller_off", "controller_fnn"]}
    metrics = ["peak(sideslip)", "spins(sideslip)"]
    made = yb.experiment(base, axes, metrics=metrics, points=8).run()
    found = made.statistics.set_index(["controller", "metric"]).loc[("controller_off", "peak(sideslip)")]
    low, mean, high = (np.degrees(found[name]) for name in ("mean low", "mean", "mean high"))
    text = made.to_latex({"peak(sideslip)": "How far aside"}, of="statistics", label="tab:s")
    assert r"\caption{How far aside}" in text and r"\label{tab:s}" in text
    rows = [line for line in text.splitlines() if line.startswith("controller")]
    assert [row.split(" & ")[0] for row in rows] == ["controller", r"controller\_off", r"controller\_fnn"]
    shown = [float(part) for part in re.findall(r"\d[-\d.e]*", rows[1].split(" & ")[2])]
    assert shown == pytest.approx([mean, low, high], rel=0.01)
    (probability,) = made.probability("spins(sideslip)").to_dict("records")[:1]
    text = made.to_latex(of="probabilities")
    assert f"0 (0 to {100 * probability['probability high']:.3g})" in text
    assert made.to_latex(of="sensitivity").count(r"\begin{table}") == 1  # no car spins: of one metric
    with refused(yb.ScenarioError, "argument-invalid", names=("label", *metrics)):
        made.to_latex(of="differences", label="tab:s")
    with refused(yb.ScenarioError, "argument-invalid", names=("of", "'statistic'", "'statistics'")):
        made.to_latex(of="statistic")
    with refused(yb.ResultsError, "results-missing", names=("drawn",)):
        yb.experiment(base, {"driver.amplitude": [0.02]}, metrics=metrics).run().to_latex(of="statistics")
