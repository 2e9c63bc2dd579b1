"""Tune PID and fuzzy PID of paper C by the same objective, search and budget, for a fair comparison.

    J = mean over three runs of the mean of (peak sideslip, yaw rate, lateral acceleration), each over
        that without control, + the moment's total variation per second over 10 kN.m/s

Without the second part gains would grow until the brakes chatter. Six gains each are moved in logarithms
by a (1 + 1) evolution strategy with the 1/5 success rule (I. Rechenberg, Evolutionsstrategie, 1973), with
the same seeds and number of evaluations. Steps of 5 ms, the controllers' own, move J by less than 0.001.
Run it from the checkout; either takes two to three minutes on two cores:

    .venv/bin/python scenarios/fuzzy_pid/tuning.py pid
    .venv/bin/python scenarios/fuzzy_pid/tuning.py fuzzy_pid
"""

from __future__ import annotations

import random
import sys
import tempfile
from math import exp, inf
from pathlib import Path

import numpy as np

from orchestrator.experiments.jobs import Job
from orchestrator.experiments.workers import execute
from orchestrator.metrics.measures import peak, total_variation_rate
from orchestrator.plan import Change
from orchestrator.results.read import load_results

FOLDER = Path(__file__).parent
RUNS = ("double_lane_change", "sine", "ramp")
PEAKS = ("sideslip", "yaw_rate", "acceleration_y")
CHATTER = 10e3  # N.m/s of the moment that count as much as all peaks without control
STEP_SIZE = 0.005  # s
EVALUATIONS = 50
SEEDS = (1, 2, 3)
SPREAD = 0.5  # of a gain's logarithm, at first

START = {
    "pid": {
        "yaw_rate_proportional_gain": 8000.0,
        "yaw_rate_integral_gain": 2000.0,
        "yaw_rate_derivative_gain": 100.0,
        "sideslip_proportional_gain": 4000.0,
        "sideslip_integral_gain": 200.0,
        "sideslip_derivative_gain": 100.0,
    },
    "fuzzy_pid": {
        "yaw_rate_proportional_gain": 8000.0,
        "yaw_rate_proportional_range": 40000.0,
        "sideslip_proportional_gain": 4000.0,
        "sideslip_proportional_range": 30000.0,
        "yaw_rate_error_range": 0.05,
        "sideslip_error_range": 0.02,
    },
}
"""Controller -> what is tuned, from the defaults on.

They end at J = 0.8406 (PID) and 0.8404 (fuzzy PID). Of fuzzy PID those six that served it best when they were
chosen, with rolling resistance on the body and the tyre's `low_friction: scale`: ranges of dK_d in place
of the error ranges ended 0.003 higher, all its twelve gains and ranges 0.002."""

Found = dict[str, tuple[np.ndarray, float]]
"""Run -> its peaks, and its chatter [N.m/s]."""


def drive(controller: str, gains: dict[str, float], out: Path) -> Found:
    """Return what the three runs come to; nothing of a run that failed."""
    jobs = [
        Job(
            run,
            FOLDER / f"{run}.yaml",
            out / run,
            (
                Change("controller", f"controller_{controller}", "tuning"),
                *(Change(f"controller.{name}", value, "tuning") for name, value in gains.items()),
                Change("step_size", STEP_SIZE, "tuning"),
            ),
            record=(*(f"plant.{name}" for name in PEAKS), "controller.yaw_moment"),
        )
        for run in RUNS
    ]
    found = {}
    for outcome in execute(jobs):
        if outcome.ok:
            results = load_results(outcome.job.out)
            peaks = np.array([peak(results.time, results[f"plant.{name}"]) for name in PEAKS])
            chatter = total_variation_rate(results.time, results["controller.yaw_moment"])
            found[outcome.job.label] = (peaks, chatter)
    return found


def objective(found: Found, free: Found) -> float:
    """Return J, infinite if a run failed."""
    if len(found) < len(RUNS):
        return inf
    return float(np.mean([(found[run][0] / free[run][0]).mean() + found[run][1] / CHATTER for run in RUNS]))


def search(controller: str, seed: int, free: Found, folder: Path) -> tuple[float, dict[str, float]]:
    """Return the lowest J and its gains; print every change for the better."""
    chance = random.Random(seed)
    best = dict(START[controller])
    lowest = objective(drive(controller, best, folder), free)
    print(f"seed {seed}, 0: J = {lowest:.4f}", flush=True)
    spread = SPREAD
    for k in range(1, EVALUATIONS):
        tried = {name: float(f"{v * exp(spread * chance.gauss(0, 1)):.3g}") for name, v in best.items()}
        value = objective(drive(controller, tried, folder), free)
        if value < lowest:
            best, lowest = tried, value
            spread *= 1.5
            print(f"seed {seed}, {k}: J = {lowest:.4f}  {best}", flush=True)
        else:
            spread *= 1.5**-0.25
    return lowest, best


def tune(controller: str) -> None:
    """Search from every seed and print what is best."""
    with tempfile.TemporaryDirectory() as folder:
        free = drive("off", {}, Path(folder))
        lowest, best = min(
            (search(controller, seed, free, Path(folder)) for seed in SEEDS), key=lambda found: found[0]
        )
    print(f"best: J = {lowest:.4f}", *(f"controller.{name}: {v:g}" for name, v in best.items()), sep="\n")


if __name__ == "__main__":
    if len(sys.argv) != 2 or sys.argv[1] not in START:
        sys.exit(f"usage: tuning.py {' | '.join(START)}")
    tune(sys.argv[1])
