"""Sampled components have a sample time of their own, which a finer communication step leaves as it is."""

from __future__ import annotations

from tests.cars import load_scenario
from tests.components.test_conformance import COMPONENTS
from yawbench.orchestrator.scenario.catalogue import SHIPPED, files


def test_every_sampled_unit_of_a_scenario_has_a_sample_time_of_its_own():
    """But for sensors, whose messages have their times by parameters of theirs."""
    for path, _ in files(SHIPPED, ["a scenario"]):
        units = load_scenario(path).units.items()
        times = {name: unit.step_size for name, unit in units if COMPONENTS[unit.fmu].sampled}
        times.pop("sensor", None)
        assert times and None not in times.values(), (path, times)
