"""The program that converts a public recording: its files can be fitted, validated and estimated from."""

from __future__ import annotations

import csv
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import yawbench as yb
from docs.generate import measured_car_tables
from tests.checkout import ROOT
from tests.refusals import mentions
from yawbench.measured_cars.fit_file import load_fit
from yawbench.measured_cars.validation import load_bands

PLACE = ROOT / "notebooks" / "ferrari_250_lm"
FILES = ("delta", "vx", "yawRate", "axCG", "ayCG", "beta_true")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder that the program makes of a made-up recording in the form of the public one."""
    place = tmp_path_factory.mktemp("recording")
    recording = place / "clone" / "datasets" / "20140222_01_01_03_250lm"
    recording.mkdir(parents=True)
    times = 0.01 * np.arange(40_101)
    turning = 0.3 * np.sin(times)
    signals = (0.03 * np.sin(times), 30.0 + 0.0 * times, turning, 0.0 * times, 30.0 * turning, 0.02 * turning)
    for name, values in zip(FILES, signals, strict=True):
        np.savetxt(recording / f"{name}.txt", values, "%.6e")
    command = [sys.executable, PLACE / "convert.py", place / "clone", place / "ferrari"]
    ended = subprocess.run(command, check=True, capture_output=True, text=True)
    assert "MIT" in ended.stdout and "github.com/MBDS" in ended.stdout
    return place / "ferrari"


@pytest.mark.exhaustive
@pytest.mark.parametrize(
    "name", ["fit_dugoff", pytest.param("fit_magic_formula", marks=pytest.mark.exhaustive)]
)
def test_the_fits_of_the_recording_load(folder, name):
    fit = load_fit(folder / f"{name}.yaml")
    assert len(fit.training) == 8 and len(fit.held_out) == 10
    assert fit.measurement.filter is not None and "MIT" in fit.measurement.licence


def test_its_scenarios_follow_the_recording(folder):
    assert yb.load(folder / "dugoff.yaml").plan().instances
    estimate = yb.load(folder / "kinematic.yaml").set({"stop_time": 5.0}).run()
    assert estimate["velocity_x"][-1] == pytest.approx(30.0, abs=0.5)
    assert load_bands(folder / "bands.yaml").judged == ["steer_angle"]


def test_a_folder_without_the_recording_is_refused(tmp_path):
    command = [sys.executable, PLACE / "convert.py", tmp_path, tmp_path / "ferrari"]
    ended = subprocess.run(command, check=False, capture_output=True, text=True)
    assert ended.returncode == 1
    assert mentions(ended.stderr, "github.com", "MBDS", "sideslip-angle-vehicle-estimation")


@pytest.mark.exhaustive
def test_the_errors_of_estimators_are_told_lap_by_lap(folder):
    program = (
        "import sys; sys.path.insert(0, sys.argv[1]); import convert; "
        "convert.score(convert.Path(sys.argv[2]))"
    )
    subprocess.run([sys.executable, "-c", program, PLACE, folder], check=True)
    with (folder / measured_car_tables.LAPS.name).open(encoding="utf-8", newline="") as lines:
        made = list(csv.DictReader(lines))
    assert [row["case"] for row in made] == [*measured_car_tables.laps()]
    zero = made[-1]
    laps = [float(rms) for key, rms in zero.items() if key.startswith("lap ")]
    assert len(laps) == 3  # of 3.1 km, in 12 km
    assert laps == pytest.approx([np.degrees(0.02 * 0.3) / np.sqrt(2)] * 3, rel=0.02)


def test_the_windows_are_those_of_the_table_of_fits():
    held, page = measured_car_tables.windows(), measured_car_tables.PAGE.read_text(encoding="utf-8")
    for model, row in (
        (measured_car_tables.CAR, "seven degrees of freedom, tyres of Dugoff"),
        (measured_car_tables.SINGLE_TRACK, "single track with Fiala tyres"),
    ):
        rms = {
            signal: measured_car_tables.rms_of(held[model, signal]) for signal in measured_car_tables.SIGNALS
        }
        sideslip = np.degrees(rms["sideslip"])
        told = f"{rms['yaw_rate']:.4f} rad/s, {rms['acceleration_y']:.2f} m/s², {sideslip:.2f}°"
        assert any(line.startswith(f"| {row} |") and told in line for line in page.splitlines())
