"""Converts a public recording of a Ferrari 250 LM on a race track, fits cars to it, and scores estimators.

    git clone https://github.com/MBDS/sideslip-angle-vehicle-estimation
    python notebooks/ferrari_250_lm/convert.py sideslip-angle-vehicle-estimation ferrari --run

The recording is of the Revs Program at Stanford, 22 February 2014; that repository, whose code has the MIT
licence, carries it for a paper on sideslip estimation (A. Leanza, G. Reina, J.-L. Blanco-Claraco, Sensors 21,
5409, 2021). Terms of the recording itself were not found, so this project holds none of it.

Written into the folder: laps.csv (550 s at 100 Hz), held_out.csv (300 s to 400 s of it), measurement files,
and copies of the fits, scenarios and vehicle file beside this program. With --run, `yawbench fit` and then
`yawbench validate` follow, and the errors of both estimators, neither of which is tuned to the recording:
windows.csv and laps_of_estimators.csv, from which docs/measured_cars.md has its numbers.
"""

from __future__ import annotations

import argparse
import csv
import json
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
from ruamel.yaml import YAML

REPOSITORY = "https://github.com/MBDS/sideslip-angle-vehicle-estimation"
RECORDING = "datasets/20140222_01_01_03_250lm"
COLUMNS = {
    "steer_angle": ("delta", "rad"),
    "velocity_x": ("vx", "m/s"),
    "yaw_rate": ("yawRate", "rad/s"),
    "acceleration_x": ("axCG", "m/s2"),
    "acceleration_y": ("ayCG", "m/s2"),
    "sideslip": ("beta_true", "rad"),
}
"""Signal -> its file in the recording, without .txt, and its unit."""
RATE = 100.0
"""Sample rate of the recording [Hz]; its own times have seven digits, so that steps are uneven."""
LAP = 3100.0
"""Length of a lap [m]: the yaw rate over the distance repeats at this lag, with a correlation of 0.98."""
HELD_OUT = (300.0, 400.0)
"""Laps that no car is fitted to [s]."""
TRACK, WHEEL_RADIUS = 1.35, 0.31
"""Track width [m], as in the repository, and wheel radius, as in car.yaml [m]."""
MEASURED = """files: [{name}.csv]
signals: {{{signals}}}
{filter}vehicle: {{mass: 982 kg, cg_to_front_axle: 1.33 m, cg_to_rear_axle: 1.07 m}}
car: Ferrari 250 LM
source: "Revs Program at Stanford, from {repository}"
licence: "MIT (the repository); terms of the recording not found"
date: 2014-02-22
"""
FITS = ("fit_dugoff", "fit_magic_formula")
FAILED = 1
"""Exit status of `yawbench validate` for a signal outside its band."""
STIFFNESSES = ("cornering_stiffness_front", "cornering_stiffness_rear")
AS_RECORDED = {"estimator.signal_delay": 0.0, "estimator.inertial_bandwidth": 0.0}
CASES: dict[str, tuple[str, dict[str, float], dict[str, float]]] = {
    "observer": ("observer", {}, {}),
    "observer, signals neither late nor filtered": ("observer", AS_RECORDED, {}),
    "observer, stiffness + 20 %": ("observer", {}, dict.fromkeys(STIFFNESSES, 1.2)),
    "observer, stiffness - 20 %": ("observer", {}, dict.fromkeys(STIFFNESSES, 0.8)),
    "observer, mass + 15 %": ("observer", {}, {"mass": 1.15}),
    "observer, mass - 15 %": ("observer", {}, {"mass": 0.85}),
    "kinematic": ("kinematic", {}, {}),
}
"""Case -> estimator, parameters that are set, factors of those in its file."""
ZERO = "constant zero"
"""The estimate without an estimator: its error is the sideslip itself."""
WINDOWS, LAPS = "windows.csv", "laps_of_estimators.csv"


def main() -> None:
    """Convert the recording; with --run, fit, validate and score."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("checkout", type=Path, help=f"clone of {REPOSITORY}")
    parser.add_argument("folder", type=Path, help="where to write")
    parser.add_argument("--run", action="store_true", help="fit, validate and score, too")
    options = parser.parse_args()
    place = options.checkout / RECORDING
    if not place.is_dir():
        sys.exit(f"{place}: no such folder; clone {REPOSITORY} first")
    options.folder.mkdir(parents=True, exist_ok=True)
    convert(place, options.folder)
    print(f"{options.folder}: {REPOSITORY}, code under the MIT licence, terms of the recording not found")
    if options.run:
        run(options.folder)


def convert(recording: Path, folder: Path) -> None:
    """Write the recording as CSV, with measurement files and what belongs to them."""
    columns = {
        f"{name} [{unit}]": np.loadtxt(recording / f"{file}.txt") for name, (file, unit) in COLUMNS.items()
    }
    v_x, r = columns["velocity_x [m/s]"], columns["yaw_rate [rad/s]"]
    for wheel, side in (("fl", -1.0), ("fr", 1.0), ("rl", -1.0), ("rr", 1.0)):
        # The recording has no wheel speeds: those of wheels that roll freely at the measured speed.
        columns[f"wheel_speed_{wheel} [rad/s]"] = (v_x + side * 0.5 * TRACK * r) / WHEEL_RADIUS
    table = np.column_stack([np.arange(len(v_x)) / RATE, *columns.values()])
    begin, end = (round(RATE * time) for time in HELD_OUT)
    header = ",".join(["time [s]", *columns])
    for name, rows in (("laps", slice(None)), ("held_out", slice(begin, end + 1))):
        np.savetxt(folder / f"{name}.csv", table[rows], "%.8g", ",", header=header, comments="")
    names = [heading.partition(" ")[0] for heading in columns]
    signals = ", ".join(f"{name}: {name}" for name in names)
    low_pass = "filter: {low_pass: 5 Hz}\n"
    for name, file, filtered in (
        ("laps", "laps", low_pass), ("held_out", "held_out", low_pass), ("unfiltered", "laps", "")
    ):  # fmt: skip
        text = MEASURED.format(name=file, signals=signals, filter=filtered, repository=REPOSITORY)
        (folder / f"{name}.yaml").write_text(text, encoding="utf-8")
    for file in Path(__file__).parent.glob("*.yaml"):
        shutil.copy(file, folder)


def run(folder: Path) -> None:
    """Fit the cars, validate the better one, score the estimators; end if a command cannot work."""
    for fit in FITS:
        _yawbench("fit", folder / f"{fit}.yaml", "--out", folder / fit)
    text = (folder / "dugoff.yaml").read_text(encoding="utf-8")
    fitted = folder / "dugoff_fitted.yaml"
    fitted.write_text(text.replace("vehicle: car.yaml", "vehicle: fit_dugoff/vehicle.yaml"), encoding="utf-8")
    _yawbench(
        "validate", fitted, "--measured", folder / "held_out.yaml",
        "--bands", folder / "bands.yaml", "--out", folder / "validation",
    )  # fmt: skip
    write_windows(folder)
    score(folder)


def _yawbench(*arguments: object) -> None:
    done = subprocess.run([sys.executable, "-m", "yawbench", *map(str, arguments)], check=False)
    if done.returncode not in (0, FAILED):
        sys.exit(done.returncode)


def write_windows(folder: Path) -> None:
    """Write the rms differences of the fitted car and the single track in each held-out window [SI]."""
    found = json.loads((folder / FITS[0] / "fit.json").read_text(encoding="utf-8"))
    with (folder / WINDOWS).open("w", encoding="utf-8", newline="") as out:
        writer = csv.writer(out, lineterminator="\n")
        writer.writerow(["model", "signal", "window", "rms"])
        for title, model in found["models"].items():
            for signal, windows in model["windows"]["held_out"].items():
                writer.writerows([title, signal, k, f"{rms:.6g}"] for k, rms in enumerate(windows, 1))


def score(folder: Path) -> None:
    """Write the errors of the estimated sideslip: rms of each lap, of all, of the worst second [deg]."""
    import yawbench as yb

    measured = yb.measured(folder / "unfiltered.yaml")
    lap = np.floor(np.cumsum(measured["velocity_x"]) / RATE / LAP).astype(int)
    rows = list[tuple[str, np.ndarray]]()
    for case, (name, settings, factors) in CASES.items():
        file = folder / f"{name}.yaml"
        own = YAML(typ="safe").load(file.read_text(encoding="utf-8"))["units"]["estimator"]["parameters"]
        changes = {f"estimator.{key}": factor * own[key] for key, factor in factors.items()}
        estimate = yb.load(file).set(settings | changes).run()
        angle = np.interp(measured.time, estimate.time, estimate["sideslip"])
        rows.append((case, angle - measured["sideslip"]))
    rows.append((ZERO, measured["sideslip"]))
    with (folder / LAPS).open("w", encoding="utf-8", newline="") as out:
        writer = csv.writer(out, lineterminator="\n")
        writer.writerow(["case", *(f"lap {k}" for k in range(1, lap[-1] + 1)), "all", "worst second"])
        for case, angle in rows:
            squares = np.degrees(angle) ** 2
            second = np.convolve(squares, np.ones(round(RATE)) / RATE, "valid").max()
            means = [*(squares[lap == k].mean() for k in range(lap[-1])), squares.mean(), second]
            writer.writerow([case, *(f"{np.sqrt(mean):.4f}" for mean in means)])


if __name__ == "__main__":
    main()
