"""The plan of the one scenario that a command is about, its FMUs up to date."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ..plan import Plan


def plan_of_scenario(
    scenario: Path,
    swap: Sequence[str] | None,
    set_: Sequence[str] | None,
    fault: Sequence[str] | None = None,
    *,
    fmus: Path | None,
    build: bool,
    isolated: bool = False,
    validate: bool = True,
) -> Plan:
    """Return the plan of a scenario with all that options change in it.

    Args:
        scenario: file.
        swap, set_, fault: options as given.
        fmus: folder of FMUs given by name.
        build: build first what is stale of the FMUs that it uses.
        isolated: each unit will have a process of its own.
        validate: refuse FMUs whose model descriptions are formally wrong.

    Raises:
        YawbenchError: the scenario, an option or an FMU is wrong, or a component cannot be built.
    """
    from ..fmu.opener import Opener
    from ..scenario.load import load_scenario
    from ..scenario.overrides import read_changes
    from ..tyres.axle_stiffness import cornering_stiffness
    from ..wiring.make_plan import make_plan

    loaded = load_scenario(
        scenario, changes=read_changes(swap or (), set_ or (), fault or ()), validate=validate
    )
    return make_plan(
        loaded, fmus=fmus, opener=Opener(build=build), isolated=isolated, measure=cornering_stiffness
    )
