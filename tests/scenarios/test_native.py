"""Native units and units in Python come to the same samples, bit for bit."""

from __future__ import annotations

import pytest

import yawbench as yb
from yawbench.fmus.archive import runs_as
from yawbench.fmus.build import HERE as FMUS
from yawbench.fmus.build import build_all, find_components
from yawbench.orchestrator.scenario.catalogue import names

pytestmark = pytest.mark.filterwarnings("ignore::yawbench.YawbenchWarning")

RUNS = {
    "fnn_sideslip/25mps": (
        "2 ms", {"controller": "controller_fuzzy_sideslip", "allocator": "allocator_fixed_share"},
    ),
    "fuzzy_feedback/single_sine": ("5 ms", {"controller": "controller_dead_band", "tyre": "tyre_linear"}),
    "fuzzy_pid/double_lane_change": ("5 ms", {}),
    "fuzzy_sliding_mode/side_share": (
        "1 ms", {"controller": "controller_sliding_mode", "tyre": "tyre_magic_formula_62_transient"},
    ),
    "proving_ground/braking_in_turn": ("5 ms", {"allocator": "allocator_weighted_least_squares"}),
    "proving_ground/iso_3888_1": ("5 ms", {"controller": "controller_integral_sliding_mode"}),
    "proving_ground/sine_sweep": ("5 ms", {"controller": "controller_lqr"}),
    "proving_ground/sine_with_dwell_esc": ("1 ms", {}),
    "proving_ground/sine_with_dwell_motors_split": ("2.5 ms", {"controller": "controller_gain_scheduled"}),
    "proving_ground/sine_with_dwell_sensors": ("2.5 ms", {"controller": "controller_phase_plane"}),
    "proving_ground/sine_with_dwell_split": ("2.5 ms", {"controller": "controller_steering_and_braking"}),
    "real_signals/monitored_lane_change": ("1 ms", {"sensor": "sensor_poor"}),
    "real_signals/parity_lane_change": ("1 ms", {"controller": "controller_super_twisting"}),
    "real_signals/single_sine": ("5 ms", {"estimator": "estimator_kinematic", "sensor": "sensor_ideal"}),
    "real_signals/told_fnn": ("1 ms", {}),
    "road/split_braking": ("5 ms", {}),
    "feedforward_pi/step_steer": ("2.5 ms", {}),
    "proving_ground/slow_ramp": (
        "5 ms", {"controller": "controller_internal_model", "tyre": "tyre_magic_formula_62"},
    ),
    "proving_ground/step_steer": ("5 ms", {"controller": "controller_lqg"}),
}  # fmt: skip
"""Scenario -> the largest step size that all its units take, and swaps; every native unit takes part."""


def run_as(units: str, scenario: yb.Scenario) -> yb.Run:
    """Return the run of a scenario whose units are native or in Python."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("YAWBENCH_UNITS", units)
        return scenario.run()


def ways(run: yb.Run) -> dict[str, str]:
    """Return FMU -> how its instances ran."""
    return {fmu["name"]: fmu["runs_as"] for fmu in run.record["fmus"].values()}


def assert_same_bits(one: yb.Run, other: yb.Run) -> None:
    assert list(one) == list(other)
    assert one.time.tobytes() == other.time.tobytes()
    assert [column for column in one if one[column].tobytes() != other[column].tobytes()] == []


def test_shortened_scenarios_with_every_native_unit_give_the_same_bits():
    build_all(FMUS)
    native = set()
    for name, (step, swaps) in RUNS.items():
        scenario = yb.load(name).swap(**swaps).set({"stop_time": 0.25, "step_size": step})
        one, other = (run_as(units, scenario) for units in ("native", "python"))
        assert_same_bits(one, other)
        native |= {fmu for fmu, how in ways(one).items() if how == "native"}
        assert {how.partition(":")[0] for how in ways(other).values()} == {"Python"}
    own = {"driver_measured"}  # needs a recording: tests/components/test_measured_driver.py drives it
    assert native | own == {name for name in find_components() if runs_as(FMUS / f"{name}.fmu").native}


@pytest.mark.parametrize("name", names("a scenario"))
@pytest.mark.exhaustive
def test_every_scenario_gives_the_same_bits(name):
    build_all(FMUS)
    assert_same_bits(*(run_as(units, yb.load(name)) for units in ("native", "python")))
