"""Functions that an FMU's library lacks and a plan needs."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from ..fmu.binary import CORE
from ..plan import Unit, Wire
from ..wording import listed


def missing_functions(
    units: Iterable[Unit], wires: Sequence[Wire], record: Sequence[tuple[str, str]]
) -> list[str]:
    """Return a sentence for every function that is lacking; one that nothing asks for may be."""
    problems = []
    for unit in units:
        if not unit.fmu.lacking:
            continue
        needed: dict[str, list[str]] = {f"fmi{unit.fmu.fmi}{name}": [] for name in CORE[unit.fmu.fmi]}
        given = [*unit.parameters, *unit.constants, *(w.input for w in wires if w.target == unit.name)]
        asked = [
            *(w.output for w in wires if w.source == unit.name),
            *(n for u, n in record if u == unit.name),
        ]
        for verb, names in (("Set", given), ("Get", asked)):
            for name in dict.fromkeys(names):
                kind = unit.fmu.variables[name].place.type
                needed.setdefault(f"fmi{unit.fmu.fmi}{verb}{kind}", []).append(name)
        for function, names in needed.items():
            if function in unit.fmu.lacking:
                purpose = f", which {listed(names)} needs" if names else ""
                problems.append(f"{unit.name}: the library of {unit.fmu.name} lacks {function}{purpose}")
    return problems
