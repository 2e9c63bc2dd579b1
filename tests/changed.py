"""Changes of a scenario, as tests write them."""

from collections.abc import Iterable

from yawbench.fmus.fmu import Value
from yawbench.orchestrator.plan import Override
from yawbench.orchestrator.scenario.overrides import read_changes


def changed(
    swaps: Iterable[str] = (), settings: Iterable[str] = (), faults: Iterable[str] = (), **of_run: Value
) -> tuple[Override, ...]:
    """Return what --swap, --set and --fault with these texts change, and times and the algorithm by name."""
    named = [Override.of(place, value, "test") for place, value in of_run.items()]
    return (*read_changes(swaps, settings, faults), *named)
