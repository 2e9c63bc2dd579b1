"""Paper A in one process: plant, tyre, reference, controllers and allocator in closed loop, no FMU."""

from __future__ import annotations

import functools
import itertools
from dataclasses import dataclass

import pytest

from tests.components.loop import Loop
from yawbench.components.allocators.load_proportional import LoadProportional
from yawbench.components.controllers.fnn import Fnn
from yawbench.components.controllers.fuzzy_sideslip import FuzzySideslip
from yawbench.components.controllers.off import Off
from yawbench.components.drivers.sine import Sine
from yawbench.components.plants.seven_dof import SevenDof
from yawbench.components.references.steady_state import SteadyState
from yawbench.components.tyres.dugoff import Dugoff
from yawbench.components.wheel_controls.direct import Direct
from yawbench.vocabulary.wheels import WHEELS

pytestmark = pytest.mark.exhaustive  # the papers' studies check the same on FMUs

STEP = 0.001
AMPLITUDE = {15: 0.05, 25: 0.0325, 40: 0.0165}  # rad; one waveform per speed, the same for every controller
SPEEDS = tuple(AMPLITUDE)


class MultiRateLoop(Loop):
    """The extrapolated algorithm with sampled units that step every `period` communication steps."""

    period = 1
    count = 0

    def _initialize(self) -> None:
        for wheel in WHEELS:
            self.source[f"wheel_torque_{wheel}"] = self.source[f"torque_request_{wheel}"]
        super()._initialize()

    def step(self, h: float) -> None:
        self.count += 1
        for k, unit in enumerate(self.units):
            period = self._period(unit)
            if self.count % period == 0:
                unit.slave.set_real(unit.in_refs, [self._input(k, unit, name) for name in unit.inputs])
                unit.slave.do_step(self.time - (period - 1) * h, period * h)
                self._check(unit)
                unit.read()
        self.time += h

    def _period(self, unit) -> int:
        return self.period if unit.discrete else 1

    def _input(self, target: int, unit, name: str) -> float:
        k, i = self.source.get(name, (None, None))
        if k is not None and k < target and self.count % self._period(self.units[k]):
            return self.units[k].now[i]  # a sampled source that holds its value at this point
        return super()._input(target, unit, name)


@dataclass(frozen=True)
class Run:
    """Numbers by which a run is judged."""

    error: float  # max |beta - beta_ref| over max |beta_ref|
    error_of_period: tuple[float, ...]  # the same within each period of the steering
    variation: float  # total variation of the yaw moment over the duration of the run [N.m/s]
    manoeuvre_variation: float  # the same over the steering alone
    sideslip: float  # max |beta| [rad]


@functools.cache
def drive(
    speed: int,
    controller=Fnn,
    *,
    sample_time: float = 0.002,
    periods: int = 1,
    amplitude: float | None = None,
    parameters: tuple[tuple[str, float], ...] = (),
) -> Run:
    """Drive whole sine periods of 5 s from 1 s on at mu 0.65, then 2 s straight ahead."""
    loop = MultiRateLoop(
        [
            (Sine, {"amplitude": amplitude or AMPLITUDE[speed], "periods": float(periods)}),
            (SteadyState, {}),
            (controller, dict(parameters)),
            (LoadProportional, {}),
            (Direct, {}),
            (SevenDof, {"initial_speed": float(speed)}),
            (Dugoff, {}),
        ],
        algorithm="extrapolated",
        constants={"friction": 0.65} | {f"friction_{wheel}": 0.65 for wheel in WHEELS},
    )
    loop.period = round(sample_time / STEP)
    duration = 5.0 * periods + 3.0
    rows = loop.run(
        duration,
        round(duration / STEP),
        lambda at: (at.time, at["sideslip"], at["sideslip_ref"], at["yaw_moment"]),
    )
    peak = max(abs(ref) for _, _, ref, _ in rows)
    errors = [(t, abs(ref - beta) / peak) for t, beta, ref, _ in rows]
    variation = sum(abs(b[3] - a[3]) for a, b in itertools.pairwise(rows))
    return Run(
        error=max(e for _, e in errors),
        error_of_period=tuple(
            max(e for t, e in errors if 1.0 + 5.0 * k <= t < 6.0 + 5.0 * k) for k in range(periods)
        ),
        variation=variation / duration,
        manoeuvre_variation=variation / (5.0 * periods),
        sideslip=max(abs(beta) for _, beta, _, _ in rows),
    )


FROZEN = (("learning", False),)
WIDE = (("error_range", 0.02), ("error_rate_range", 0.2))


@pytest.mark.parametrize("speed, least", [(15, 1.0), (25, 2.0), (40, 2.0)])
def test_without_control_sideslip_misses_its_reference_by_as_much_as_the_paper_says(speed, least):
    assert drive(speed, Off).error > least


@pytest.mark.parametrize("speed", SPEEDS)
@pytest.mark.parametrize("sample_time, most", [(0.001, 0.05), (0.002, 0.05), (0.005, 0.06)])
def test_one_network_follows_the_reference_at_all_speeds_and_sample_times(speed, sample_time, most):
    run = drive(speed, sample_time=sample_time)
    assert run.error <= most
    assert run.variation <= 15e3


@pytest.mark.parametrize("speed", SPEEDS)
def test_conventional_control_lies_between_no_control_and_the_network(speed):
    assert drive(speed).error < drive(speed, FuzzySideslip).error < drive(speed, Off).error


@pytest.mark.parametrize("sample_time", [0.002, 0.005])
def test_conventional_control_was_tuned_to_be_no_busier_than_the_network(sample_time):
    fuzzy = max(drive(v, FuzzySideslip, sample_time=sample_time).variation for v in SPEEDS)
    network = max(drive(v, sample_time=sample_time).variation for v in SPEEDS)
    assert fuzzy <= network


def test_the_paper_s_ten_per_cent_of_conventional_control_needs_wide_ranges():
    wide = {v: drive(v, FuzzySideslip, parameters=WIDE).error for v in SPEEDS}
    assert wide[15] > 0.10
    assert wide[25] < 0.40 and wide[40] < 0.40  # the paper's "> 40 %" does not reproduce


def test_learning_at_least_halves_the_error_at_15_mps():
    assert drive(15).error <= 0.5 * drive(15, parameters=FROZEN).error


@pytest.mark.parametrize("speed", [15, 25])
def test_learning_lowers_the_error_from_period_to_period(speed):
    first, second, third = drive(speed, periods=3).error_of_period
    assert first > second > third
    assert third < 0.6 * first


@pytest.mark.parametrize("speed", [15, 25])
def test_over_periods_learning_gains_more_than_the_slowing_car_gives_frozen_weights(speed):
    learnt = drive(speed, periods=3).error_of_period
    frozen = drive(speed, periods=3, parameters=FROZEN).error_of_period
    assert learnt[2] / learnt[0] < 0.75 * frozen[2] / frozen[0]


def test_under_harsh_excitation_learning_loses_what_frozen_weights_and_recall_hold():
    lost = drive(40, amplitude=0.03)
    frozen = drive(40, amplitude=0.03, parameters=FROZEN)
    recalled = drive(40, amplitude=0.03, parameters=(("recall", 0.1),))
    assert lost.error > 1.0
    assert frozen.error < 0.15 and recalled.error < 0.15


@pytest.mark.parametrize("speed", SPEEDS)
def test_recall_costs_nothing_where_learning_is_safe(speed):
    assert drive(speed, parameters=(("recall", 0.1),)).error <= 1.01 * drive(speed).error


def test_a_sample_time_of_20_ms_is_too_slow():
    assert drive(40, sample_time=0.02).error > 1.0
