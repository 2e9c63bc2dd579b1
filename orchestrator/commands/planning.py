"""The plan of the one scenario that a command is about, its FMUs up to date."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from .options import Wishes

if TYPE_CHECKING:
    from ..plan import Plan


def plan_of_scenario(scenario: Path, wishes: Wishes) -> Plan:
    """Return the plan of a scenario with all that options change in it.

    Raises:
        YawbenchError: the scenario, an option or an FMU is wrong, or a component cannot be built.
    """
    from ..fmu.opener import Opener
    from ..scenario.load import load_scenario
    from ..tyres.axle_stiffness import cornering_stiffness
    from ..wiring.make_plan import make_plan

    loaded = load_scenario(scenario, changes=wishes.changes, validate=not wishes.no_validate)
    opener = Opener(build=wishes.build)
    return make_plan(
        loaded, fmus=wishes.fmus, opener=opener, isolated=wishes.isolate, measure=cornering_stiffness
    )
