"""Sampled components have a sample time of their own, which a finer communication step leaves as it is."""

from __future__ import annotations

import pytest

from tests.cars import load_scenario
from tests.components.test_conformance import COMPONENTS
from yawbench.orchestrator.scenario.catalogue import SHIPPED, files

SCENARIOS = [path for path, _ in files(SHIPPED, ["a scenario"])]


@pytest.mark.parametrize("path", SCENARIOS, ids=lambda path: f"{path.parent.name}/{path.stem}")
def test_every_sampled_unit_of_a_scenario_has_a_sample_time_of_its_own(path):
    """But for sensors, whose messages have their times by parameters of theirs."""
    units = {name: unit for name, unit in load_scenario(path).units.items() if name != "sensor"}
    assert units
    sampled = {name for name, unit in units.items() if COMPONENTS[unit.fmu].sampled}
    assert sampled
    assert {name for name in sampled if units[name].step_size is None} == set()
