"""The inputs that every output is declared to follow directly are those that it does follow.

"Directly" means: at the same instant. So one input is changed and a step of no length is taken from
the same state; what changes then depends on that input, and nothing else does. Initialization is
the other case: there a plant's accelerations and wheel loads may depend on its forces too, since
afterwards they are carried on from step to step.
"""

from __future__ import annotations

import importlib
import random
import struct

import pytest

from tests.components.stand import Stand
from tests.fmus.plausible import plausible
from yawbench.components.fmi.component import Component
from yawbench.fmus.build import find_components
from yawbench.vocabulary.wheels import WHEELS

COMPONENTS = find_components()
ALL_TRIALS = 21
"""Least number of trials of a unit in the second tier."""
FORCES = {"steer_angle", "yaw_moment", "slope", "bank", "wind_force_y", "wind_moment_z"} | {
    f"tyre_{signal}_{wheel}" for signal in ("force_x", "force_y", "moment_z") for wheel in WHEELS
}
SLOW = {
    "controller_esc",
    "estimator_kinematic",
    "estimator_observer",
    "monitor_parity",
    "monitor_redundancy",
    "sensor_poor",
    "sensor_production",
}
RARE = {"reference_esc", "wheel_control_esc", "wheel_control_slip"}
"""Units some of whose dependencies show in few states: they are sought in the second tier."""
GIVEN = {
    "road_patchwork": {
        "patches": "y > 0; 0.3: 40 < x < 60",
        **{"road_slope": 0.05, "road_bank": 0.03, "incline_start": 30.0, "incline_run": 20.0},
        **{"wind_force": 500.0, "wind_start": 50.0, "wind_run": 20.0},
    }
}
"""Parameters without which a unit does nothing."""


def component_class(name: str) -> type[Component]:
    module = importlib.import_module("yawbench.components." + ".".join(COMPONENTS[name]))
    found = [c for c in vars(module).values() if issubclass(type(c), type) and issubclass(c, Component)]
    return max((c for c in found if c.__module__ == module.__name__), key=lambda c: len(c.__mro__))


def bits(outputs):
    return {name: struct.pack("d", value) for name, value in outputs.items()}


def varied(component: type[Component], source: random.Random) -> dict:
    """Return other values for some parameters: choices and switches at random, numbers scaled."""
    values: dict = {}
    for v in component.variables:
        if v.causality != "parameter":
            continue
        if v.choices:
            values[v.name] = source.choice(v.choices)
        elif v.type == "Boolean":
            values[v.name] = source.random() < 0.5
        elif v.type == "Real" and source.random() < 0.3:
            value = v.start * source.choice((0.2, 0.5, 2.0)) if v.start else source.choice((-0.3, 0.3, 1.0))
            low = -1e300 if v.minimum is None else v.minimum
            high = 1e300 if v.maximum is None else v.maximum
            values[v.name] = min(max(value, low), high)
    return values


class Probe:
    """A component in some state, asked what follows what."""

    def __init__(self, component: type[Component], source: random.Random, *, vary: bool = False) -> None:
        self.names = [v.name for v in component.variables if v.causality == "input"]
        self.component = component
        self.source = source
        self.parameters = (varied(component, source) if vary else {}) | GIVEN.get(component.fmu_name, {})
        self.slow = vary and source.random() < 0.2

    def inputs(self) -> dict[str, float]:
        return plausible(self.names, self.source, slow=self.slow)

    def driven(self) -> Stand:
        """Return a unit that has been driven a while."""
        stand = Stand(self.component, **self.parameters)
        stand.start(**self.inputs())
        for _ in range(self.source.randint(2, 6)):
            stand.step(0.002, **self.inputs())
        return stand

    def changes(self, answer):
        """Yield (input, output) for every output that changes when `answer` is given another input."""
        base = self.inputs()
        before = bits(answer(base))
        for name in self.names:
            other = plausible([name], self.source, slow=self.slow)
            after = bits(answer(base | other))
            yield from ((name, output) for output in after if after[output] != before[output])

    def at_a_step(self, h: float):
        """Return the (input, output) that are seen to be connected at a step of `h` [s]."""
        stand = self.driven()
        state, time = stand.unit._get_fmu_state(), stand.time

        def answer(inputs):
            stand.unit._set_fmu_state(state)
            stand.time = time
            return stand.step(h, **inputs)

        return set(self.changes(answer))

    def at_initialization(self):
        return set(self.changes(lambda inputs: Stand(self.component, **self.parameters).start(**inputs)))


def declared(component):
    return {(name, v.name) for v in component.variables if v.causality == "output" for name in v.depends_on}


@pytest.mark.parametrize("name", list(COMPONENTS))
@pytest.mark.parametrize("trials", [4, pytest.param(ALL_TRIALS, marks=pytest.mark.exhaustive)])
def test_declared_dependencies_are_exactly_those_found(name, trials):
    """A rate over the step, and what is learnt in it, show at a step of some length only.

    For a unit that samples, all that shows there is direct: it knows nothing of what happens in
    between. In the others the inputs may have been integrated, so there it proves nothing. An estimator
    follows by what it has learned straight ahead, too, sensors answer late, and a supervisor confirms before
    it acts, of which so short a drive shows little.
    """
    component = component_class(name)
    source = random.Random(name)
    expected = declared(component)
    seen = set()
    for trial in range(400):
        probe = Probe(component, source, vary=trial % 4 != 0)
        try:
            at_once = probe.at_a_step(0.0)
            proves = component.sampled or not expected <= seen | at_once
            later = probe.at_a_step(0.002) if proves else set()
        except AssertionError:
            assert trial % 4 != 0  # the component may refuse parameters, but not its own defaults
            continue
        # hydraulics that go on within a step are a state: what a step does to them shows at its end
        direct = at_once | later if component.sampled and name != "wheel_control_esc" else at_once
        assert direct <= expected, f"not declared: {sorted(direct - expected)}"
        seen |= at_once | later
        enough = expected <= seen or name in SLOW or (name in RARE and trials < ALL_TRIALS)
        if enough and trial >= trials:
            return
    assert expected <= seen, f"declared, but never seen: {sorted(expected - seen)}"


@pytest.mark.parametrize("name", list(COMPONENTS))
@pytest.mark.parametrize("trials", [3, pytest.param(10, marks=pytest.mark.exhaustive)])
def test_initial_values_depend_on_nothing_else(name, trials):
    """But for a plant's, whose accelerations and wheel loads start from the forces there are, a
    closed-loop driver's, whose delays and limits start where the road they see has them settled, a road's
    delayed friction, and a tyre's with relaxation, whose deflections start settled at the slips there are."""
    component = component_class(name)
    source = random.Random(name)
    for _ in range(trials):
        extra = Probe(component, source).at_initialization() - declared(component)
        if name.startswith("plant_"):
            extra = {(i, o) for i, o in extra if i not in FORCES}
        if name.endswith("_transient"):
            extra = {(i, o) for i, o in extra if not i.startswith(("slip_", "wheel_"))}
        if name.startswith("road_"):
            extra = {(i, o) for i, o in extra if o != "friction_delayed"}
        if name.startswith("driver_"):
            extra = {(i, o) for i, o in extra if o not in ("steer_angle", "steering_wheel_angle")}
        if name == "wheel_control_esc":  # the driver brakes already
            extra -= {("drive_force", "master_pressure")}
        assert extra == set()
