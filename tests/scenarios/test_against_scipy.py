"""The master and the FMUs of paper A against one system of equations solved by scipy."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import pytest

from tests.cars import load_scenario, make_plan
from tests.changed import changed
from tests.components import monolith
from tests.evidence import measured
from tests.fmu_copies import put_fmus
from yawbench.orchestrator.master.simulate import simulate
from yawbench.orchestrator.results.reader import load_results

OPEN_LOOP = """
title: Open-loop sine, no control
stop_time: {stop}
step_size: 0.001
algorithm: extrapolated
inputs: {{"friction*": 0.65, "wheel_torque_*": 0.0}}
units:
  driver:
    fmu: driver_sine
    parameters: {{amplitude: {amplitude}, frequency: {frequency}, start_time: {start}}}
  plant: {{fmu: plant_seven_dof, parameters: {{initial_speed: 25.0}}}}
  tyre: {{fmu: tyre_dugoff}}
"""
UNITS = ("driver_sine", "plant_seven_dof", "tyre_dugoff")
AMPLITUDE, FREQUENCY, START, STOP = 0.05, 0.25, 0.5, 5.0


@cache
def exact():
    """The yaw rate [rad/s] at every millisecond."""
    return monolith.solve(
        np.arange(0.0, STOP + 5e-4, 1e-3),
        steer=monolith.sine(AMPLITUDE, FREQUENCY, START, 1.0),
        speed=25.0,
        mu=(0.65,) * 4,
        kinks=(START, START + 1 / FREQUENCY),
    )[2]


@pytest.fixture(scope="module")
def error(tmp_path_factory):
    """Return the largest yaw-rate error of a run, as a share of the peak yaw rate."""
    fmus = tmp_path_factory.mktemp("fmus")
    put_fmus(fmus, components=UNITS)
    file = fmus / "open_loop.yaml"
    values = {"amplitude": AMPLITUDE, "frequency": FREQUENCY, "start": START, "stop": STOP}
    file.write_text(OPEN_LOOP.format(**values), encoding="utf-8")

    @cache
    def of(algorithm, milliseconds):
        scenario = load_scenario(
            file, changes=changed(stop_time=STOP, step_size=milliseconds / 1000, algorithm=algorithm)
        )
        folder = tmp_path_factory.mktemp("run")
        simulate(make_plan(scenario, fmus=fmus), folder)
        found = load_results(folder)["plant.yaw_rate"]
        wanted = exact()[::milliseconds]
        return float(np.max(np.abs(found - wanted)) / np.max(np.abs(wanted)))

    return of


def order(error, algorithm):
    """Return the observed order between steps of 4 ms and 1 ms."""
    return math.log(error(algorithm, 4) / error(algorithm, 1), 4)


def test_extrapolated_is_within_a_ten_thousandth_of_the_exact_solution_at_1_ms(error):
    whole = "the whole chain of FMUs, plant_seven_dof, tyre_dugoff"
    measured("cars", whole, "scipy, one system of equations", error("extrapolated", 1), at_most=1e-4)


def test_extrapolated_is_of_second_order(error):
    found = order(error, "extrapolated")
    measured("order", "`extrapolated`, FMUs of paper A", "scipy", found, at_least=1.8)


@pytest.mark.parametrize("algorithm", ["gauss_seidel", "jacobi"])
def test_the_classical_algorithms_are_of_first_order(error, algorithm):
    assert order(error, algorithm) == pytest.approx(1.0, abs=0.1)
