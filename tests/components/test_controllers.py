"""What every controller does: counter a spin, keep its limit, leave alone a car that does as it is asked."""

from __future__ import annotations

import math
import random

import pytest

from yawbench.components.controllers.envelope_mpc import EnvelopeMpc
from yawbench.components.controllers.esc import EscController
from yawbench.components.controllers.feedforward_pi import FeedforwardPi
from yawbench.components.controllers.gain_scheduled import GainScheduled
from yawbench.components.controllers.integral_sliding_mode import IntegralSlidingMode
from yawbench.components.controllers.internal_model import InternalModel
from yawbench.components.controllers.lqg import Lqg
from yawbench.components.controllers.phase_plane import PhasePlane
from yawbench.components.controllers.steering_and_braking import SteeringAndBraking
from yawbench.components.controllers.super_twisting import SuperTwistingController
from yawbench.components.steering_actuators.superposition import Superposition

from .stand import Stand
from .test_conformance import COMPONENTS, ROUNDED, parameters_of

LIMITED = {
    name: c
    for name, c in COMPONENTS.items()
    if name.startswith("controller_") and "moment_limit" in parameters_of(c)
}
every = pytest.mark.parametrize("component", LIMITED.values(), ids=LIMITED)
SETTINGS = {EnvelopeMpc: {"actuation": "moment"}}
"""What a controller needs to make yaw moments."""


def inputs_of(component):
    return {v.name for v in component.variables if v.causality == "input"}


def started(component, **parameters):
    """Return a controller of a car that drives straight on at 25 m/s, and a way to step it."""
    stand = Stand(component, **SETTINGS.get(component, {}), **parameters)
    takes = inputs_of(component)

    def step(**signals):
        signals = {"velocity_x": 25.0, "friction": 0.9} | signals
        return stand.step(0.005, **{name: x for name, x in signals.items() if name in takes})["yaw_moment"]

    stand.start(**{name: x for name, x in (("velocity_x", 25.0), ("friction", 0.9)) if name in takes})
    return step


@every
def test_a_spin_to_the_left_is_countered_to_the_right(component):
    step = started(component)
    straight = dict.fromkeys(inputs_of(component), 0.0)
    spin = {
        "yaw_rate": 0.6,
        "yaw_rate_ref": 0.2,
        "sideslip": -0.25,
        "acceleration_y": 8.0,
        "velocity_x": 25.0,
    }
    for _ in range(5 if component is EscController else 1):  # which waits for 20 ms
        moment = step(**straight | spin | {"friction": 0.9})
    assert moment < -1000.0


@every
def test_moments_keep_their_limit_and_fade_out_at_rest(component):
    rng = random.Random(3)
    step = started(component, moment_limit=2000.0)
    others = sorted(inputs_of(component) - {"velocity_x"})
    moments = [
        step(**{name: rng.uniform(-0.5, 0.5) for name in others}, velocity_x=rng.uniform(0.0, 40.0))
        for _ in range(40)
    ]
    assert max(map(abs, moments)) <= 2000.0
    assert max(map(abs, moments)) > 1000.0
    if "velocity_x" in inputs_of(component):
        assert step(velocity_x=0.0, yaw_rate=0.5) == 0.0


@every
def test_a_car_that_drives_straight_on_as_asked_is_left_alone(component):
    step = started(component)
    assert max(abs(step()) for _ in range(10)) <= ROUNDED.get(component.fmu_name, 0.0)


REFUSED = {
    FeedforwardPi: {"crossover_frequency": 0.0, "integral_time": -1.0, "feedforward_share": -0.1},
    SuperTwistingController: {
        "disturbance_slope": 0.0, "integral_factor": 0.0, "square_root_factor": -1.0
    },
    IntegralSlidingMode: {"switching_gain": -1.0, "boundary_layer": -0.1, "filter_time": -0.1},
    InternalModel: {"filter_time": 0.0, "scheduling_speed": 0.0},
    Lqg: {"yaw_rate_deviation": 0.0, "sideslip_wander": math.inf},
    GainScheduled: {"boundary": 0.0, "schedule_begin": 1.0, "moment_scale": -1.0},
    EnvelopeMpc: {"penalty": 0.0, "moves": 0, "actuation": "brakes"},
    PhasePlane: {"boundary": 0.0, "spin_gain": -1.0, "lead_time": -0.1},
    SteeringAndBraking: {"boundary": 0.0, "spin_gain": -1.0, "lead_time": -0.1},
    COMPONENTS["allocator_weighted_least_squares"]: {
        "moment_weight": 0.0, "usable_grip": 0.0, "force_weight": -1.0
    },
    Superposition: {"rate_limit": 0.0, "range": -0.1, "time_constant": -1.0},
}  # fmt: skip


@pytest.mark.parametrize(
    ("component", "name", "value"),
    [(component, name, value) for component, wrong in REFUSED.items() for name, value in wrong.items()],
)
def test_a_parameter_that_makes_no_sense_is_refused_by_name(component, name, value):
    with pytest.raises(AssertionError, match=rf"\b{name} must"):
        Stand(component, **{name: value}).start()
