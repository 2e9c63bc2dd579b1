"""A plan as far as OMSimulator can run it: it reads no texts, no steps of units, no transformations."""

from __future__ import annotations

from dataclasses import replace

from ..errors import WiringError
from ..plan import Plan, Unit, Value, Wire
from ..wiring.fitting import conversion_between
from ..wording import listed

UNREAD = ("String", "Enumeration")
"""Types of values that it does not read."""


def for_omsimulator(plan: Plan) -> tuple[Plan, list[str]]:
    """Return the plan without what OMSimulator refuses, and a remark for everything left out that matters.

    Raises:
        WiringError: a connection has a gain of its own, which it would pass over without a word.
    """
    fmus = {unit.name: unit.fmu.variables for unit in plan.units}

    def by_units(wire: Wire) -> bool:
        source, target = fmus[wire.source][wire.output], fmus[wire.target][wire.input]
        known = source.unit is not None and target.unit is not None
        return not wire.converts or (known and conversion_between(source, target) == (wire.gain, wire.offset))

    problems = [
        f"{wire.source}.{wire.output} to {wire.target}.{wire.input}: OMSimulator knows no gain and offset "
        "of a connection, only the units of its ends"
        for wire in plan.wires
        if not by_units(wire)
    ]
    if problems:
        raise WiringError(problems)
    notes = []
    slow = [unit.name for unit in plan.units if unit.period > 1]
    if slow:
        notes.append(f"OMSimulator steps all units alike: the steps of {listed(slow)} are left out")
    texts = [f"{unit.name}.{name} = {value!r}" for unit in plan.units for name, value in _texts(unit).items()]
    if texts:
        notes.append(f"OMSimulator takes no texts from an archive; set there: {listed(texts)}")
    wires = tuple(replace(wire, gain=1.0, offset=0.0) for wire in plan.wires)
    units = tuple(_without_texts(unit) for unit in plan.units)
    return replace(plan, units=units, wires=wires), notes


def _texts(unit: Unit) -> dict[str, Value]:
    """Return the texts, and items of enumerations, that the FMU would not have by itself."""
    given, variables = {**unit.parameters, **unit.constants}, unit.fmu.variables
    return {k: v for k, v in given.items() if variables[k].type in UNREAD and v != variables[k].start}


def _without_texts(unit: Unit) -> Unit:
    parameters, constants = (
        {name: value for name, value in given.items() if unit.fmu.variables[name].type not in UNREAD}
        for given in (unit.parameters, unit.constants)
    )
    return replace(unit, period=1, parameters=parameters, constants=constants)
