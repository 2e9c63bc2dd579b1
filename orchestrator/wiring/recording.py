"""What is recorded: the variables that the scenario's patterns mean."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping

from ..plan import Fmu, Variable
from ..wording import closest, fold, hint
from .opened_system import System
from .patterns import match


def recorded(system: System) -> tuple[tuple[str, str], ...]:
    """Return (unit, variable) of each column, in the order of the scenario's list or units.

    Without a list these are all outputs but text.
    """
    fmus, record = system.fmus, system.scenario.record
    if record is None:
        return tuple((unit, v.name) for unit, fmu in fmus.items() for v in _usual(fmu))
    chosen: dict[tuple[str, str], None] = {}
    for i, (unit, pattern) in enumerate(record):
        units = list(fmus) if unit == "*" else [unit]
        found = _matching(units, fmus, pattern, _usual) or _matching(units, fmus, pattern, _all)
        chosen.update(dict.fromkeys(found))
        if found:
            continue
        if system.had(units, pattern):
            system.notes.append(f"record[{i}] is left out: {unit} has no variable {pattern!r} any more")
            continue
        usual, every = ([v.name for u in units for v in of(fmus[u])] for of in (_usual, _all))
        names = every if closest(pattern, usual) is None and closest(pattern, every) else usual
        who = "no unit has a" if unit == "*" else f"{unit} has no"
        more = hint(pattern, fold(list(dict.fromkeys(names))), lead="its outputs are")
        system.report(("record", i), f"{who} variable {pattern!r} to record{more}")
    return tuple(chosen)


def _usual(fmu: Fmu) -> list[Variable]:
    return [v for v in fmu.of("output") if v.type != "String"]


def _all(fmu: Fmu) -> list[Variable]:
    return list(fmu.variables.values())


def _matching(
    units: Iterable[str], fmus: Mapping[str, Fmu], pattern: str, of: Callable[[Fmu], list[Variable]]
) -> list[tuple[str, str]]:
    return [(unit, v.name) for unit in units for v in of(fmus[unit]) if match(pattern, v.name) is not None]
