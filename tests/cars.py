"""Scenarios of cars, loaded and planned with all that is known of cars."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from yawbench.orchestrator.plan import Plan
from yawbench.orchestrator.scenario import loader
from yawbench.orchestrator.scenario.loader import LoadedScenario
from yawbench.orchestrator.wiring import make_plan as wiring
from yawbench.vehicles.car import TyreMeasurement, cars
from yawbench.vehicles.tir import read_tir


def load_scenario(path: Path | str, **options: Any) -> LoadedScenario:
    """Load a scenario that may name tyre property files."""
    return loader.load_scenario(path, read_tyre=read_tir, **options)


def make_plan(scenario: LoadedScenario, *, measure: TyreMeasurement | None = None, **options: Any) -> Plan:
    """Plan a scenario, with the quantities that follow from its vehicle file, and warnings."""
    return wiring.make_plan(scenario, domain=cars(measure), **options)
