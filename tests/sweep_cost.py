"""What a run of a sweep costs beyond stepping: `python -m tests.sweep_cost [--runs 200] [--steps 50]`.

Prints the processor time of all processes of `yawbench sweep`, per run: the difference between a sweep of
many runs and one of few, which leaves out what a sweep costs once. Stepping alone is measured beside it.
"""

from __future__ import annotations

import argparse
import resource
import subprocess
import sys
import tempfile
from pathlib import Path

from orchestrator.scenario.load import load_scenario
from orchestrator.wiring.make_plan import make_plan

from .bench import DEFAULT, measure

SWEEP = """
title: Short runs
scenario: {scenario}
set: {{stop_time: {stop}}}
axes: {{mass: {{vary: plant.mass, from: 1000, to: 2000, count: {runs}}}}}
metrics: {{sideslip: {{metric: peak(sideslip)}}, yaw_rate: {{metric: rms(yaw_rate)}}}}
"""
FEW = 10
"""Runs of the smaller sweep; it has started all processes."""


def processor_time(folder: Path, runs: int, stop: float, *options: str) -> float:
    """Return the processor time of a sweep with all its processes [s]."""
    file = folder / f"{runs}.yaml"
    file.write_text(SWEEP.format(scenario=DEFAULT, stop=stop, runs=runs))
    command = [sys.executable, "-m", "orchestrator.cli", "sweep", str(file), "--out", str(folder / str(runs))]
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run([*command, *options], check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=200)
    parser.add_argument("--steps", type=int, default=50)
    chosen, options = parser.parse_known_args()
    plan = make_plan(load_scenario(DEFAULT))
    stop = chosen.steps * float(plan.step)
    stepping = chosen.steps * min(measure(plan)["step"] for _ in range(3))
    with tempfile.TemporaryDirectory() as name:
        few, many = (processor_time(Path(name), runs, stop, *options) for runs in (FEW, chosen.runs))
    run = (many - few) / (chosen.runs - FEW)
    print(f"{FEW} runs {few:.2f} s, {chosen.runs} runs {many:.2f} s of processor time")
    beyond = 1e3 * (run - stepping)
    print(f"a run of {chosen.steps} steps {1e3 * run:.1f} ms, beyond stepping {beyond:.1f} ms")


if __name__ == "__main__":
    main()
