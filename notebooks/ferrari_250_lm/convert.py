"""Converts a public recording of a Ferrari 250 LM on a race track, fits cars to it, and scores estimators.

    git clone https://github.com/MBDS/sideslip-angle-vehicle-estimation
    python notebooks/ferrari_250_lm/convert.py sideslip-angle-vehicle-estimation ferrari --run

The recording is of the Revs Program at Stanford, 22 February 2014; that repository, whose code has the MIT
licence, carries it for a paper on sideslip estimation (A. Leanza, G. Reina, J.-L. Blanco-Claraco, Sensors 21,
5409, 2021). Terms of the recording itself were not found, so this project holds none of it.

Written into the folder: laps.csv (550 s at 100 Hz), held_out.csv (300 s to 400 s of it), measurement files,
and copies of the fits, scenarios and vehicle file beside this program. With --run, `yawbench fit` and then
`yawbench validate` follow, and the errors of both estimators, neither of which is tuned to the recording.
"""

from __future__ import annotations

import argparse
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np

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
PIECE = 10.0
"""Duration of the pieces that intervals are of [s]; chosen: longer than a bend."""
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
FAILED = 1
"""Exit status of `yawbench validate` for a signal outside its band."""
ESTIMATORS = ("observer", "kinematic")


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
    for fit in ("fit_dugoff", "fit_magic_formula"):
        _yawbench("fit", folder / f"{fit}.yaml", "--out", folder / fit)
    text = (folder / "dugoff.yaml").read_text(encoding="utf-8")
    fitted = folder / "dugoff_fitted.yaml"
    fitted.write_text(text.replace("vehicle: car.yaml", "vehicle: fit_dugoff/vehicle.yaml"), encoding="utf-8")
    _yawbench(
        "validate", fitted, "--measured", folder / "held_out.yaml",
        "--bands", folder / "bands.yaml", "--out", folder / "validation",
    )  # fmt: skip
    score(folder)


def _yawbench(*arguments: object) -> None:
    done = subprocess.run([sys.executable, "-m", "yawbench", *map(str, arguments)], check=False)
    if done.returncode not in (0, FAILED):
        sys.exit(done.returncode)


def score(folder: Path) -> None:
    """Print rms, its interval and worst second of the estimators' sideslip, in degrees."""
    import yawbench as yb

    measured = yb.measured(folder / "unfiltered.yaml")
    as_recorded = {"estimator.signal_delay": 0.0, "estimator.inertial_bandwidth": 0.0}
    for name in ESTIMATORS:
        for words, changes in (("defaults", {}), ("signals neither late nor filtered", as_recorded)):
            estimate = yb.load(folder / f"{name}.yaml").set(changes).run()
            truth = np.interp(estimate.time, measured.time, measured["sideslip"])
            error = np.degrees(estimate["sideslip"] - truth)
            second = np.convolve(error**2, np.ones(round(RATE)) / RATE, "valid")
            low, high = rms_bounds(error)
            print(
                f"{name}, {words}: rms {np.sqrt(np.mean(error**2)):.2f} ({low:.2f} to {high:.2f}), "
                f"worst second {np.sqrt(second.max()):.2f} degrees"
            )


def rms_bounds(error: np.ndarray) -> tuple[float, float]:
    """Return the 95 % interval of an rms, of a bootstrap that draws pieces longer than bends."""
    samples = round(PIECE * RATE)
    squares = (error[: error.size // samples * samples] ** 2).reshape(-1, samples).mean(axis=1)
    drawn = np.random.default_rng(1).integers(squares.size, size=(2000, squares.size))
    low, high = np.quantile(np.sqrt(squares[drawn].mean(axis=1)), [0.025, 0.975])
    return float(low), float(high)


if __name__ == "__main__":
    main()
