"""Which variables a pattern with a `*` means, now and before a swap."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable

from ..plan import Fmu
from ..scenario.load import Scenario

Replaced = Callable[[str], Fmu | None]
"""Returns the FMU of a unit that a change has replaced, None if it is not there."""


def match(pattern: str, name: str) -> str | None:
    """Return what the `*` of a pattern stands for in a name, '' without `*`, None if they differ."""
    head, star, tail = pattern.partition("*")
    if not star:
        return "" if name == pattern else None
    fits = len(name) >= len(head) + len(tail) and name.startswith(head) and name.endswith(tail)
    return name[len(head) : len(name) - len(tail)] if fits else None


def matching(pattern: str, names: Collection[str]) -> dict[str, str]:
    """Return the names that fit a pattern, each under what the `*` stands for in it."""
    if "*" not in pattern:
        return {"": pattern} if pattern in names else {}
    return {part: name for name in names if (part := match(pattern, name)) is not None}


def had(
    scenario: Scenario, replaced: Replaced, units: Iterable[str], pattern: str, causality: str | None = None
) -> bool:
    """Return whether an FMU that a change has replaced in one of the units has such a variable.

    Args:
        causality: of the variable; None: any.
    """
    before = (replaced(unit) for unit in units if unit in scenario.replaced)
    return any(
        match(pattern, v.name) is not None and causality in (None, v.causality)
        for fmu in before
        if fmu is not None
        for v in fmu.variables.values()
    )
