"""Rules that every component keeps: each is found by itself and driven through its FMI entry points."""

from __future__ import annotations

import random
import re
from functools import cache
from importlib import import_module
from math import isfinite

import pytest

from yawbench.components.fmi.component import Component
from yawbench.fmus.build import find_components
from yawbench.vocabulary.vehicle import CAR
from yawbench.vocabulary.wheels import wheels

from .stand import Stand


def component_of(module: tuple[str, ...]) -> type[Component]:
    """Return the component class that a file of a role defines."""
    loaded = import_module(f"yawbench.components.{'.'.join(module)}")
    (found,) = (
        value
        for value in vars(loaded).values()
        if isinstance(value, type) and issubclass(value, Component) and value.__module__ == loaded.__name__
    )
    return found


COMPONENTS = {name: component_of(module) for name, module in find_components().items()}
every = pytest.mark.parametrize("component", COMPONENTS.values(), ids=COMPONENTS)
continuous = pytest.mark.parametrize(
    "component",
    [c for c in COMPONENTS.values() if not c.sampled],
    ids=[name for name, c in COMPONENTS.items() if not c.sampled],
)

TEXTS = {
    "patches": {"y > 0": "y < 0"},
    "friction_table": {",-9,9\n-2,0.2,0.4\n0,0.5,0.3\n3,0.9,0.8": ",-9,9\n2,0.2,0.4\n0,0.5,0.3\n-3,0.9,0.8"},
}
"""Parameters that are free text: values, and what the same looks like in a mirror."""

VARIANTS = [
    pytest.param(component, {v.name: other}, id=f"{name}, {v.name}={other}")
    for name, component in COMPONENTS.items()
    for v in component.variables
    if v.causality == "parameter" and v.type in ("Boolean", "String")
    for other in TEXTS.get(v.name) or v.choices or (not v.start,)
    if other != v.start
]
as_every_variant = pytest.mark.parametrize(
    ("component", "parameters"),
    [pytest.param(c, {}, id=name) for name, c in COMPONENTS.items()] + VARIANTS,
)

MIDDLE = {
    "velocity_x": 20.0,
    "vertical_load": 3500.0,
    "friction": 0.7,
    "wheel_speed": 62.0,
    "wheel_velocity": 19.0,
    "slip_stiffness": 60000.0,
}
"""Centres of inputs that are not small about zero."""
SPREAD = {
    "rad": 0.05,
    "rad/s": 0.3,
    "rad/s2": 1.0,
    "m/s": 1.0,
    "m/s2": 3.0,
    "N": 800.0,
    "N.m": 200.0,
    "1": 0.05,
    "m": 2.0,
    "Pa": 1e5,
}
"""Spread about the centres, by unit."""

ODD = {
    "steering_wheel_angle_measured",
    *("velocity_y", "yaw_rate", "sideslip", "sideslip_rate", "acceleration_y", "roll_angle", "roll_rate"),
    *("position_y", "yaw_angle", "steer_angle", "steering_wheel_angle", "yaw_rate_ref", "sideslip_ref"),
    *("added_steer_angle_request", "added_steer_angle", "total_steer_angle"),
    *("yaw_acceleration_ref", "sideslip_rate_ref", "yaw_moment", "path_offset"),
    *("sliding_surface", "learning_error", "integral_term", "yaw_rate_part", "sideslip_part"),
    *wheels("tyre_force_y_*"),
    *wheels("slip_angle_*"),
    *wheels("aligning_moment_*"),
    *wheels("overturning_moment_*"),
    *wheels("tyre_moment_z_*"),
    *wheels("inclination_angle_*"),
    *wheels("patch_slip_angle_*"),
    *("bank", "wind_force_y", "wind_moment_z", "yaw_moment_wanted", "implied_sideslip"),
    "estimated_sideslip",
}
"""Signals that change their sign in a mirror; all others keep it."""
LOPSIDED = {("asymmetric_terms", True), ("table_reading", "printed"), ("wheel_choice", "printed")}
ODD_PARAMETERS = (
    "radius",
    *("amplitude", "final_steer_angle", "lane_offset", "initial_sideslip", "initial_yaw_rate"),
    *("road_bank", "wind_force"),
)
OTHER_SIDE = {"_fl": "_fr", "_fr": "_fl", "_rl": "_rr", "_rr": "_rl"}
OF_WHEEL = re.compile("_[fr][lr](?=(_true)?$)")
FLAWS = ("_noise", "_bias", "_drift")
"""Ends of the names of parameters that give answers without a question."""

ROUNDED = dict.fromkeys(("controller_fnn", "controller_fuzzy_feedback", "controller_fuzzy_sideslip"), 1e-6)
"""Largest loss in a mirror [N.m]: sums over fuzzy sets run from left to right; else not a bit."""
ROUNDED |= {"allocator_weighted_least_squares": 1e-6}  # [N]; an elimination begins at the left wheels

SPLIT = {
    **dict.fromkeys(("plant_seven_dof", "plant_two_dof"), 1e-4),
    "plant_eight_dof": 2e-4,
    "plant_fourteen_dof": 2e-3,
    **dict.fromkeys(("reference_esc", "reference_single_track", "reference_steady_state"), 0.2),
}
"""Largest difference of two half steps from a whole one, over the range of the output; else rounding.

Plants are of second order in the step, their loads and accelerations carried; the rates of references
belong to the step they are taken over."""


OF_A_STEP = {("tyre_magic_formula_62_transient", "slip_stiffness")}
"""Outputs that say what a step of that size does."""


def middle(name: str) -> float:
    return next((value for start, value in MIDDLE.items() if name.startswith(start)), 0.0)


@cache
def some_inputs(component: type[Component], seed: int, spread: float = 1.0) -> dict[str, float]:
    """Return values for all inputs, the same for the same seed; not to be changed."""
    rng = random.Random(f"{component.fmu_name} {seed}")
    drawn = {
        v.name: middle(v.name) + spread * rng.uniform(-1.0, 1.0) * SPREAD[v.unit or "1"]
        for v in component.variables
        if v.causality == "input"
    }
    return {name: abs(x) if name == "friction_true" else x for name, x in drawn.items()}  # handed on as it is


def mirrored(values: dict[str, float]) -> dict[str, float]:
    """Return what the same looks like in a mirror: left is right."""
    turned = {}
    for name, x in values.items():
        other, sign = in_mirror(name)
        turned[other] = sign * x
    return turned


@cache
def in_mirror(name: str) -> tuple[str, float]:
    """Return what a variable is called in a mirror, and its sign there."""
    other = OF_WHEEL.sub(lambda m: OTHER_SIDE[m[0]], name)
    return other, -1.0 if name.removesuffix("_true") in ODD else 1.0


def parameters_of(component: type[Component]) -> dict[str, object]:
    return {v.name: v.start for v in component.variables if v.causality == "parameter"}


def flawless(component: type[Component]) -> dict[str, object]:
    return {name: 0.0 for name in parameters_of(component) if name.endswith(FLAWS)}


def driven(component: type[Component], steps: int = 60, **parameters: object) -> Stand:
    """Return a stand that has been driven for some steps."""
    stand = Stand(component, **parameters)
    stand.start(**some_inputs(component, 0))
    for k in range(steps):
        stand.step(0.001 * (1 + k % 2), **some_inputs(component, k))
    return stand


def frozen(stand: Stand) -> bytes:
    return stand.unit._fmu_state_to_bytes(stand.unit._get_fmu_state())


@as_every_variant
def test_the_mirrored_inputs_give_the_mirrored_outputs(component, parameters):
    if parameters.items() & LOPSIDED:
        pytest.skip("tells left from right on purpose")
    left, right = Stand(component, **parameters), Stand(component, **parameters)
    turned = {n: -x for n, x in parameters_of(component).items() if n in ODD_PARAMETERS}
    texts = {n: TEXTS[n][x] for n, x in parameters.items() if n in TEXTS}
    right.set(**turned, **texts, **flawless(component))
    left.set(**flawless(component))
    inputs = some_inputs(component, 0)
    rounding = ROUNDED.get(component.fmu_name, 0.0)

    def assert_mirrored(found, other):
        expected = mirrored(other)
        assert found == expected or found == pytest.approx(expected, abs=rounding, rel=0)

    assert_mirrored(right.start(**mirrored(inputs)), left.start(**inputs))
    for seed in range(6):
        inputs = some_inputs(component, seed)
        turned_inputs = mirrored(inputs)
        for _ in range(4):
            assert_mirrored(right.step(0.02, **turned_inputs), left.step(0.02, **inputs))


@as_every_variant
def test_a_step_undone_and_repeated_gives_the_same_bits_also_in_another_instance(component, parameters):
    stand = driven(component, **parameters)
    kept, time = frozen(stand), stand.time
    once = [stand.step(0.002, **some_inputs(component, 900 + k)) for k in range(3)]
    other = Stand(component, **parameters)
    other.start()
    for again in (stand, other):
        again.unit._set_fmu_state(again.unit._fmu_state_from_bytes(kept))
        again.time = time
        assert [again.step(0.002, **some_inputs(component, 900 + k)) for k in range(3)] == once


@continuous
def test_a_step_with_held_inputs_may_be_split(component):
    whole, halves = driven(component), driven(component)
    held = some_inputs(component, 7)
    for stand in (whole, halves):
        for _ in range(4):
            stand.step(0.001, **held)
    one = whole.step(0.002, **held)
    halves.step(0.001, **held)
    two = halves.step(0.001, **held)
    tolerance = SPLIT.get(component.fmu_name, 1e-9)
    for name, value in one.items():
        if (component.fmu_name, name[:-3]) in OF_A_STEP:
            continue
        size = max(abs(value), abs(two[name]), 1e-3)
        assert abs(value - two[name]) <= tolerance * size, name


@every
def test_an_output_holds_until_the_next_step_and_reading_it_changes_nothing(component):
    stand = driven(component)
    before, held = stand.outputs(), frozen(stand)
    for name in before:
        stand.unit.get_real([stand.reference[name]])
    assert stand.outputs() == before
    assert frozen(stand) == held
    stand.set(**some_inputs(component, 5))
    assert stand.outputs() == before


@every
def test_without_any_input_nothing_stirs(component):
    """Zero in gives zero out; a car at rest stays at rest, and its loads are its weight."""
    moving = ("initial_speed", "amplitude", "final_steer_angle", "force", "speed_gain", "lane_offset")
    still = {name: 0.0 for name in moving if name in parameters_of(component)}
    stand = Stand(component, **still, **flawless(component))
    zero = {v.name: 0.0 for v in component.variables if v.causality == "input"}
    stand.start(**zero)
    for _ in range(100):
        y = stand.step(0.001, **zero)
    loads = [value for name, value in y.items() if name.startswith("vertical_load")]
    if loads and "mass" in parameters_of(component):  # what is only told has none of its own
        assert sum(loads) == pytest.approx(9.81 * stand.unit.p.mass, rel=1e-9)
    for name, value in y.items():
        if not name.startswith(("vertical_load", "slip_stiffness", *FREE)):
            assert abs(value) <= 1e-9, name


FREE = (
    *("yaw_rate_proportional_gain", "sideslip_proportional_gain", "reaching", "path_offset"),
    *("relaxation_length", "friction"),
)
"""Outputs that are settings, not answers."""


@every
@pytest.mark.parametrize("spread", [1.0, 30.0])
def test_outputs_are_finite_and_within_what_is_declared_whatever_comes_in(component, spread):
    limits = {v.name: (v.minimum, v.maximum) for v in component.variables if v.causality == "output"}
    stand = Stand(component)
    stand.start(**some_inputs(component, 0))
    for k in range(25):
        for name, value in stand.step(0.001, **some_inputs(component, k, spread)).items():
            low, high = limits[name]
            assert isfinite(value), name
            assert (low is None or value >= low) and (high is None or value <= high), name


@every
def test_every_default_says_where_it_comes_from(component):
    parameters = [v for v in component.variables if v.causality == "parameter"]
    assert [v.name for v in parameters if not v.source] == []
    assert [v.name for v in parameters if "; chosen" in v.description or "; paper" in v.description] == []


def within(v, x: float) -> bool:
    return (v.minimum is None or v.minimum <= x) and (v.maximum is None or x <= v.maximum)


@every
def test_parameters_arrive_after_the_instance_is_made_and_outputs_read_before_do_not_bind(component):
    declared = parameters_of(component)
    changed = {
        v.name: next((x for x in (1.01 * v.start, 0.99 * v.start) if within(v, x)), v.start)
        for v in component.variables
        if v.causality == "parameter" and v.type == "Real"
    }
    late, fresh = Stand(component), Stand(component, **changed)
    assert {name: late[name] for name in declared} == declared
    late.set(**some_inputs(component, 0))
    late.outputs()
    late.set(**changed)
    for stand in (late, fresh):
        stand.start(**some_inputs(component, 0))
        assert {name: getattr(stand.unit.p, name) for name in declared} == declared | changed
        for k in (1, 2):
            stand.step(0.001, **some_inputs(component, k))
    assert [*map(repr, late.outputs().values())] == [*map(repr, fresh.outputs().values())]


def test_what_units_know_of_a_car_has_the_measure_of_the_vocabulary():
    declared = {
        (v.name, v.unit) for c in COMPONENTS.values() for v in c.variables if v.causality == "parameter"
    }
    assert {(name, unit) for name, unit in declared if name in CAR and unit != CAR[name].unit} == set()
    assert {name for name, one in CAR.items() if one.needed} <= {name for name, _ in declared}
