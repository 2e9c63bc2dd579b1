"""Measured runs beside simulated ones: filtered alike, dashed, with a time offset of their own."""

from __future__ import annotations

from pathlib import Path

import matplotlib.figure
import numpy as np
import pytest

import yawbench as yb
from tests.command_line import status_of
from tests.refusals import each_mentions
from tests.reports.made_up import unpacked
from yawbench.commands.recorded_runs import read_runs
from yawbench.figures.display import LabelledRun
from yawbench.figures.plots import draw
from yawbench.figures.style import MEASURED_LINE

TIME = np.arange(10.0, 16.0, 0.01)
SLOW, FAST = (np.sin(2.0 * np.pi * f * TIME) for f in (0.5, 15.0))
DASHED = f'"dash":{list(MEASURED_LINE[1])}'.replace(" ", "")
MEASURED = """files: [{name}.csv]
time: {{unit: s}}
signals: {{yaw_rate: r, acceleration_y: a_y, velocity_x: v}}
{more}
car: made up
source: a formula
licence: none
date: 2024-01-01
"""


@pytest.fixture(scope="module")
def places(tmp_path_factory) -> tuple[Path, Path]:
    """The results folder of a run that shakes, and a measurement 10 s later that does not."""
    folder = tmp_path_factory.mktemp("runs")
    for name, start, shake, more in (("run", 10.0, 0.1, ""), ("car", 0.0, 0.0, "filter: {low_pass: 5 Hz}")):
        r = 0.2 * SLOW + shake * FAST
        table = np.column_stack([TIME - start, r, 20.0 * r, 20.0 + 0.0 * r])
        header = "time,r [rad/s],a_y [m/s2],v [m/s]"
        np.savetxt(folder / f"{name}.csv", table, "%.9g", ",", header=header, comments="")
        (folder / f"{name}.yaml").write_text(MEASURED.format(name=name, more=more))
    return yb.measured(folder / "run.yaml").save(folder / "results"), folder / "car.yaml"


def test_the_filter_of_the_measurement_acts_on_the_run_and_its_time_is_moved(places):
    run, car = read_runs(places, 10.0)
    inner = slice(100, -100)
    assert car.time[0] == pytest.approx(0.0) and run.time[0] == pytest.approx(0.0)
    assert run["plant.yaw_rate"][inner] == pytest.approx(car["plant.yaw_rate"][inner], abs=2e-4)
    (alone,) = read_runs(places[:1], 0.0)
    assert np.abs(alone["plant.yaw_rate"] - car["plant.yaw_rate"]).max() > 0.09


def test_measured_runs_are_dashed(places):
    runs = [LabelledRun(str(k), run) for k, run in enumerate(read_runs([*places, places[1]], 10.0))]
    figure = draw(runs, ["yaw_rate"])
    assert isinstance(figure, matplotlib.figure.Figure)
    patterns = [line._unscaled_dash_pattern for line in figure.axes[0].get_lines()[:3]]
    assert patterns[0][1] is None
    assert [tuple(pattern[1]) for pattern in patterns[1:]] == [MEASURED_LINE[1]] * 2


def test_the_commands_take_measurements_beside_runs(places, tmp_path, capsys):
    results, car = places
    options = ("--measured", car, "--from", "10 s")
    assert status_of("plot", results, *options, "--panel", "yaw_rate", "--out", tmp_path / "fig.svg") == 0
    assert (tmp_path / "fig.svg").is_file()
    assert status_of("animate", results, *options, "--out", tmp_path / "view.html") == 0
    assert DASHED in unpacked(tmp_path / "view.html").replace(" ", "")
    capsys.readouterr()
    assert status_of("diff", results, car, "--from", "10 s") == 0
    assert "yaw_rate" in capsys.readouterr().out


def test_compare_shows_a_recording_beside_all_runs(places, tmp_path):
    swaps = ("--swap", "controller=controller_off", "--set", "stop_time=0.5 s")
    options = ("--measured", places[1], "--from", "10 s", "--out", tmp_path)
    assert status_of("compare", "fnn_sideslip/25mps", *swaps, *options) == 0
    page = unpacked(tmp_path / "report.html")
    assert "--measured" in page and "--from" in page  # the command that repeats it
    assert page.replace(" ", "").count(DASHED) == 1
    assert status_of("compare", "fnn_sideslip/25mps", *swaps, "--measured", tmp_path / "none.yaml") == 2


def test_a_malformed_time_is_refused(places, capsys):
    assert status_of("plot", places[0], "--measured", places[1], "--from", "soon") == 2
    assert each_mentions(capsys.readouterr().err, ("--from", "'soon'"))
    assert yb.measured(places[1], start=10.0).time[0] == pytest.approx(0.0)
    with pytest.raises(ValueError, match="start"):
        yb.measured(places[1], start=float("nan"))
