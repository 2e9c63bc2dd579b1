"""Native units and units in Python write the same results.csv, byte for byte."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from fmus.build import HERE as FMUS
from fmus.build import build_all, find_components
from orchestrator.fmu.archive import runs_as
from orchestrator.plan import RunsAs
from orchestrator.scenario.loader import names

SHORT = ("--set", "stop_time=1.2")
RUNS = {
    "fnn_sideslip/25mps": {"controller": "controller_fuzzy_sideslip", "allocator": "allocator_fixed_share"},
    "fuzzy_feedback/single_sine": {"controller": "controller_dead_band", "tyre": "tyre_linear"},
    "fuzzy_pid/double_lane_change": {},
    "fuzzy_sliding_mode/side_share": {"controller": "controller_sliding_mode"},
    "proving_ground/braking_in_turn": {},
    "proving_ground/iso_3888_1": {},
    "proving_ground/side_wind_gust": {},
    "proving_ground/sine_sweep": {"controller": "controller_lqr"},
    "proving_ground/sine_with_dwell": {},
    "real_signals/monitored_lane_change": {"sensor": "sensor_poor"},
    "real_signals/parity_lane_change": {},
    "real_signals/single_sine": {"estimator": "estimator_kinematic", "sensor": "sensor_ideal"},
    "real_signals/told_fnn": {},
    "road/split_braking": {},
    "tyre_file/lane_change": {"tyre": "tyre_magic_formula_62_transient"},
    "one_car/steady_turn": {"tyre": "tyre_magic_formula_62"},
}
"""Scenarios and swaps in which every native unit takes part."""
PROGRAM = """
import json, sys
from orchestrator.cli import main
for arguments in json.load(sys.stdin):
    try:
        main(arguments)
    except SystemExit as end:
        if end.code:
            sys.exit(f"{arguments}: exit status {end.code}")
"""


def run(commands: list[list[str]], units: str) -> None:
    """Run command lines one after the other in a process whose units are native or in Python."""
    subprocess.run(
        [sys.executable, "-c", PROGRAM],
        input=json.dumps(commands),
        env={**os.environ, "YAWBENCH_UNITS": units},
        stdout=subprocess.DEVNULL,
        text=True,
        check=True,
    )


def ran_as(folder: Path) -> dict[str, str]:
    """Return FMU -> how its instances ran."""
    fmus = json.loads((folder / "run.json").read_text())["fmus"]
    return {fmu["name"]: fmu["runs_as"] for fmu in fmus.values()}


def test_shortened_scenarios_with_every_native_unit_give_the_same_bytes(tmp_path):
    build_all(FMUS)
    commands = {
        units: [
            ["run", name, *SHORT, "--out", str(tmp_path / units / name)]
            + [word for swap in swaps.items() for word in ("--swap", "=".join(swap))]
            for name, swaps in RUNS.items()
        ]
        for units in ("native", "python")
    }
    for units, lines in commands.items():
        run(lines, units)
    native = set()
    for name in RUNS:
        one, other = (tmp_path / units / name for units in ("native", "python"))
        assert (one / "results.csv").read_bytes() == (other / "results.csv").read_bytes(), name
        native |= {fmu for fmu, how in ran_as(one).items() if how == "native"}
        assert {how.partition(":")[0] for how in ran_as(other).values()} == {"Python"}
    own = {"driver_measured"}  # needs a recording: tests/components/test_measured_driver.py drives it
    assert native | own == {name for name in find_components() if runs_as(FMUS / f"{name}.fmu") == RunsAs()}


@pytest.mark.parametrize("name", names("a scenario"))
@pytest.mark.exhaustive
def test_every_scenario_gives_the_same_bytes(tmp_path, name):
    build_all(FMUS)
    for units in ("native", "python"):
        run([["run", name, "--out", str(tmp_path / units)]], units)
    one, other = ((tmp_path / units / "results.csv").read_bytes() for units in ("native", "python"))
    assert one == other
