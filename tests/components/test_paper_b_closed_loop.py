"""Paper B in one process: reference, controllers, allocators, slip control, actuators, car and tyres."""

from __future__ import annotations

import functools
from dataclasses import dataclass

import numpy as np
import pytest

from yawbench.components.actuators.lag import Lag
from yawbench.components.allocators.load_proportional import LoadProportional
from yawbench.components.allocators.side_share import SideShare
from yawbench.components.controllers.fuzzy_sliding_mode import FuzzySlidingMode
from yawbench.components.controllers.off import Off
from yawbench.components.controllers.sliding_mode import SlidingMode
from yawbench.components.drivers.sine import Sine
from yawbench.components.plants.eight_dof import EightDof
from yawbench.components.references.single_track import SingleTrack
from yawbench.components.tyres.magic_formula import MagicFormula
from yawbench.components.wheel_controls.direct import Direct
from yawbench.components.wheel_controls.slip import Slip
from yawbench.vocabulary.wheels import WHEELS

from .loop import Loop

pytestmark = pytest.mark.exhaustive  # the papers' studies check the same on FMUs

STEP = 0.001
START = 0.5  # s, of the steering sine
PERIODS = {"controller": 5, "allocator": 5}  # communication steps; all else steps at each
CONTROLLERS = {
    "none": (Off, {}),
    "sign": (SlidingMode, {}),
    "saturation": (SlidingMode, {"switching": "saturation"}),
    "fuzzy": (FuzzySlidingMode, {}),
}
RUNS = {"high": (100 / 3.6, 1.0), "low": (50 / 3.6, 0.3), "beyond": (80 / 3.6, 0.3)}  # m/s, mu
SLIP: tuple = (Slip, {})
DIRECT = (Direct, {"wheel_radius": 0.313, "torque_limit": 3300.0})
BY_LOAD = (LoadProportional, {"cg_to_front_axle": 1.04, "track_width": 1.48})
RECORD = ("yaw_rate", "yaw_rate_ref", "sideslip", "velocity_x", *(f"wheel_torque_{w}" for w in WHEELS))


class MultiRateLoop(Loop):
    """The extrapolated algorithm with sampled units of their own periods."""

    count = 0

    def step(self, h: float) -> None:
        self.count += 1
        for k, unit in enumerate(self.units):
            period = PERIODS.get(unit.slave.fmu_name.split("_")[0], 1)
            if self.count % period:
                unit.before = unit.now  # held
                continue
            unit.slave.set_real(unit.in_refs, [self._input(k, unit, name) for name in unit.inputs])
            unit.slave.do_step(self.time - (period - 1) * h, period * h)
            self._check(unit)
            unit.read()
        self.time += h


def drive(controller, *, speed, mu, steer=0.09, until=5.0, allocator=BY_LOAD, wheel=SLIP, **plant):
    """Return the recorded signals by name, at every communication point."""
    loop = MultiRateLoop(
        [
            (Sine, {"amplitude": steer, "frequency": 0.4, "start_time": START}),
            (SingleTrack, {}),
            controller,
            allocator,
            wheel,
            (Lag, {}),
            (EightDof, {"initial_speed": speed, **plant}),
            (MagicFormula, {}),
        ],
        algorithm="extrapolated",
        constants={"friction": mu} | {f"friction_{wheel}": mu for wheel in WHEELS},
    )
    rows = loop.run(until, round(until / STEP), lambda each: [each[name] for name in RECORD])
    return dict(zip(RECORD, np.array(rows).T, strict=True))


@dataclass(frozen=True)
class Figures:
    """Tracking and chatter of one run."""

    mean: float  # of |r_ref - r| from the start of the sine on [rad/s]
    peak: float  # largest |r_ref - r| over the reference's peak
    sideslip: float  # largest |beta| [rad]
    torque_chatter: float  # total variation per second, mean of the wheels [N.m/s]
    yaw_chatter: float  # total variation of the yaw acceleration per second [rad/s3]


def figures(run) -> Figures:
    error = np.abs(run["yaw_rate_ref"] - run["yaw_rate"])
    duration = STEP * (len(error) - 1)
    torques = [np.abs(np.diff(run[f"wheel_torque_{wheel}"])).sum() for wheel in WHEELS]
    return Figures(
        error[round(START / STEP) :].mean(),
        error.max() / np.abs(run["yaw_rate_ref"]).max(),
        np.abs(run["sideslip"]).max(),
        sum(torques) / 4 / duration,
        np.abs(np.diff(run["yaw_rate"], 2)).sum() / STEP / duration,
    )


@functools.cache
def measured(run: str, controller: str) -> Figures:
    speed, mu = RUNS[run]
    return figures(drive(CONTROLLERS[controller], speed=speed, mu=mu))


@pytest.mark.parametrize("run", ["high", "low"])
def test_without_control_the_car_misses_its_reference(run):
    assert measured(run, "none").peak > 0.8


def test_without_control_the_car_is_lost_beyond_the_papers_runs():
    assert measured("beyond", "none").sideslip > 0.6


@pytest.mark.parametrize("controller", ["sign", "saturation", "fuzzy"])
@pytest.mark.parametrize("run", ["high", "low"])
def test_controlled_the_car_follows_its_reference(run, controller):
    now = measured(run, controller)
    assert now.peak < 0.3
    assert now.mean < 0.25 * measured(run, "none").mean


@pytest.mark.parametrize("controller", ["sign", "saturation", "fuzzy"])
def test_controlled_the_car_is_kept_beyond_the_papers_runs(controller):
    now = measured("beyond", controller)
    assert np.degrees(now.sideslip) < 3.0
    assert now.mean < 0.25 * measured("beyond", "none").mean


@pytest.mark.parametrize("run", RUNS)
def test_the_fuzzy_law_chatters_at_most_half_as_much_as_the_sign_at_no_worse_tracking(run):
    fuzzy, sign = measured(run, "fuzzy"), measured(run, "sign")
    assert fuzzy.torque_chatter < 0.5 * sign.torque_chatter
    assert fuzzy.yaw_chatter < 0.5 * sign.yaw_chatter
    assert fuzzy.mean < 1.1 * sign.mean


@pytest.mark.parametrize("run", RUNS)
def test_most_of_the_drop_in_chatter_is_the_boundary_layers(run):
    sign, saturation = measured(run, "sign"), measured(run, "saturation")
    fuzzy = measured(run, "fuzzy")
    by_layer = sign.torque_chatter - saturation.torque_chatter
    assert by_layer > 0.9 * (sign.torque_chatter - fuzzy.torque_chatter)


SLIDING = {"speed": 80 / 3.6, "mu": 0.3, "steer": 0.0, "initial_sideslip": -0.3, "initial_yaw_rate": 0.8}


@pytest.mark.parametrize("wheel", [DIRECT, SLIP], ids=["direct torque", "slip control"])
@pytest.mark.parametrize("law", [SlidingMode, FuzzySlidingMode])
def test_a_sliding_car_is_caught_again(law, wheel):
    run = drive((law, {}), wheel=wheel, until=6.0, **SLIDING)
    assert np.degrees(np.abs(run["sideslip"]).max()) < 45.0
    assert np.abs(run["sideslip"][-1000:]).max() < 0.02
    assert np.abs(run["yaw_rate"][-1000:]).max() < 0.02


def test_a_more_negative_weight_catches_it_sooner_and_a_positive_one_loses_it():
    def settling(weight: float) -> float:
        run = drive((SlidingMode, {"sideslip_weight": weight}), wheel=DIRECT, until=6.0, **SLIDING)
        return STEP * np.nonzero(np.abs(run["sideslip"]) > 0.02)[0][-1]

    assert settling(-1.0) < settling(-0.25) < settling(0.0) < 5.5
    spun = drive((SlidingMode, {"sideslip_weight": 1.0}), wheel=DIRECT, until=3.0, **SLIDING)
    assert np.abs(spun["sideslip"]).max() > 1.5


def test_with_one_side_braked_sharing_by_load_is_best_and_a_zero_share_worst():
    def mean_error(allocator) -> float:
        run = drive(CONTROLLERS["fuzzy"], speed=80 / 3.6, mu=1.0, until=3.5, allocator=allocator)
        return figures(run).mean

    def shared(left: float, right: float):
        return SideShare, {"front_share_left": left, "front_share_right": right}

    by_load = mean_error((LoadProportional, {**BY_LOAD[1], "side_forces": "one_side_braked"}))
    equal, none, one = (mean_error(shared(*shares)) for shares in ((0.5, 0.5), (0.0, 0.0), (0.0, 0.5)))
    assert by_load < equal < one < none
    assert one > 3.0 * by_load
