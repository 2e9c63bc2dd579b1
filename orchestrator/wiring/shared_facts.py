"""What one name tells all units that have to know it: the friction of the road, the speed of the car.

    friction: 0.65         # every parameter `base_friction` of a road, and every input `friction`,
                           # `friction_fl` .. `friction_rr` that no unit drives
    speed: 80 km/h         # every parameter `initial_speed`, `target_speed`

In a scenario a fact stands behind what is given by its own name; as a change (`--set friction=0.3`) it goes
before what the file gives, so that one change reaches all. A line more in the table is a fact more, with
a key of the same name in the schema of scenarios and in `plan.FACTS`.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

from vocabulary.wheels import wheels

from ..plan import FACTS as NAMES
from ..plan import Unit, Value
from ..scenario.load import Scenario


@dataclass(frozen=True)
class Fact:
    """What a fact reaches."""

    unit: str
    inputs: tuple[str, ...] = ()
    parameters: dict[str, str] = field(default_factory=dict)
    """Parameter -> the one of the same unit that turns it off if it is 0; "" if it always counts."""

    def counts(self, unit: Unit, parameter: str) -> bool:
        """Return whether a unit's parameter is one of the fact's, and not turned off."""
        if parameter not in self.parameters:
            return False
        return unit.parameter(self.parameters[parameter]) != 0


FACTS = {
    "friction": Fact("1", ("friction", *wheels("friction_*")), {"base_friction": ""}),
    "speed": Fact("m/s", parameters={"initial_speed": "", "target_speed": "speed_gain"}),
}
assert tuple(FACTS) == NAMES


def facts_of(scenario: Scenario) -> Iterator[tuple[str, Fact, Value, bool]]:
    """Yield name, fact, value and whether a change gave it, of all facts that a scenario tells."""
    for name, fact in FACTS.items():
        value = getattr(scenario, name)
        if value is not None:
            yield name, fact, value, scenario.document.override((name,)) is not None
