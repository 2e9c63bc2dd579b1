"""What CONTRIBUTING's table promises: what is added to its one place works wherever the program uses it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import yawbench as yb
from orchestrator.errors import ScenarioError
from orchestrator.fault_kinds import KINDS, FaultKind
from orchestrator.scenario.overrides import read_changes

UNITS = ("driver_sine",)
STEERED = """\
title: A driver alone
stop_time: 1
step_size: 10 ms
units: {driver: {fmu: driver_sine, parameters: {amplitude: 0.3, frequency: 1.0, start_time: 0.0}}}
"""


@pytest.fixture
def steered(fmus: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> yb.Scenario:
    """A scenario of one FMU."""
    monkeypatch.chdir(tmp_path)
    Path("steered.yaml").write_text(STEERED)
    Path("fmus").symlink_to(fmus)
    return yb.load("steered.yaml")


def test_a_kind_of_fault_is_one_entry(steered, monkeypatch):
    floor = FaultKind("at least value", lambda signal, held: lambda t, x: max(x, signal.value), "{x}")
    monkeypatch.setitem(KINDS, "floor", floor)
    at, healthy = "driver.steer_angle", steered.run()["driver.steer_angle"]
    assert np.min(healthy) < -0.01
    seen = steered.fault(at, kind="floor", value=-0.01).run()["driver.steer_angle"]
    assert seen == pytest.approx(np.maximum(healthy, -0.01))
    assert str(read_changes(faults=[f"{at}: floor 1 deg"])[0]) == f"--fault {at}: floor 1 deg"
    with pytest.raises(ScenarioError, match="floor takes no seed"):
        read_changes(faults=[f"{at}: floor 1 deg seed 3"])
