"""The system of one run or of several alike: its units, what may stand for each, what flows between them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from ..plan import Plan
from ..wording import fold_wires


@dataclass(frozen=True)
class Block:
    """A unit and the FMUs that stand for it in one run or another."""

    name: str
    fmus: tuple[str, ...]


@dataclass(frozen=True)
class System:
    """Blocks in the order of the scenario, and the signals from one to another."""

    blocks: tuple[Block, ...]
    signals: dict[tuple[str, str], tuple[str, ...]]  # (source, target) -> names, four wheels as one with `*`

    def sources_of(self, target: str) -> list[str]:
        """Return the units that a unit has inputs from, in order."""
        return [block.name for block in self.blocks if (block.name, target) in self.signals]


def system_of(plans: Iterable[Plan]) -> System:
    """Return what the plans have together; they have the same units."""
    fmus: dict[str, dict[str, None]] = {}
    wires: dict[tuple[str, str], dict[tuple[str, str], None]] = {}
    for plan in plans:
        by_name = {unit.name: unit for unit in plan.units}
        for name in [*plan.scenario.get("units", {}), *by_name]:
            if name in by_name:
                fmus.setdefault(name, {})[by_name[name].fmu.name] = None
        for wire in plan.wires:
            wires.setdefault((wire.source, wire.target), {})[wire.output, wire.input] = None
    signals = {
        ends: tuple(
            output if output == name else f"{output} → {name}" for output, name in fold_wires(list(pairs))
        )
        for ends, pairs in wires.items()
    }
    return System(tuple(Block(name, tuple(found)) for name, found in fmus.items()), signals)


def systems_of(plans: Sequence[Plan]) -> list[tuple[System, list[int]]]:
    """Return one system for each set of units that the plans have, with the numbers of its plans."""
    groups: dict[frozenset[str], list[int]] = {}
    for number, plan in enumerate(plans):
        groups.setdefault(frozenset(unit.name for unit in plan.units), []).append(number)
    return [(system_of([plans[k] for k in numbers]), numbers) for numbers in groups.values()]
