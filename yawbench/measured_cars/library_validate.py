"""`validate` of the Python library: runs compared with measurements."""

from __future__ import annotations

from pathlib import Path

from yawbench import arguments
from yawbench._run import Run
from yawbench.measurements.measurement import load_measurement

from .validation import BANDS, Validation, compare_run, load_bands


def validate(run: Run, file: str | Path, *, bands: str | Path = BANDS) -> Validation:
    """Compare a run with measurements of the car, by bands around its cross plots.

        >>> ramp = yb.load("proving_ground/slow_ramp").run()  # doctest: +SKIP
        >>> yb.validate(ramp, "measured.yaml").verdicts["steering_wheel_angle"].value  # doctest: +SKIP
        0.77

    Args:
        run: run of a steady-state test.
        file: the measurement file; each of its segments is a test.
        bands: file of tolerances, or its name in `scenarios/bands`.

    Raises:
        ScenarioError: a file cannot be used.
        ResultsError: the signal over which the others are plotted was not recorded.
    """
    simulated = arguments.instance(run, "run", Run, "Scenario.run")
    path = arguments.path(file, "file")
    tolerances = load_bands(arguments.path(bands, "bands"))
    return compare_run(simulated.results, load_measurement(path), tolerances)
