"""Facts: values of a scenario that reach all instances that need them.

    friction: 0.65         # every parameter `base_friction` of a road, and every input `friction`,
                           # `friction_fl` .. `friction_rr` that no wire drives
    speed: 80 km/h         # every parameter `initial_speed`, `target_speed`

In a scenario file, a value given by its own name takes precedence over a fact; as an override
(`--set friction=0.3`), a fact takes precedence over the file, so that one override reaches all instances. To
add a fact, add a row to `FACTS` and a key to the schema of scenarios.
"""

from typing import NamedTuple, Protocol

from .wheels import wheels


class _Instance(Protocol):
    def parameter(self, name: str, /) -> object: ...


class Fact(NamedTuple):
    """Inputs and parameters that a fact sets."""

    unit: str  # of measurement, of the value
    inputs: tuple[str, ...]
    parameters: dict[str, str]
    """Parameter -> another of the same instance that disables it if 0; "" if it is always in use."""

    def counts(self, instance: _Instance, parameter: str) -> bool:
        """Return whether the fact sets a parameter of an instance, and the parameter is in use."""
        return parameter in self.parameters and instance.parameter(self.parameters[parameter]) != 0


FACTS = {
    "friction": Fact("1", ("friction", *wheels("friction_*")), {"base_friction": ""}),
    "speed": Fact("m/s", (), {"initial_speed": "", "target_speed": "speed_gain"}),
}
