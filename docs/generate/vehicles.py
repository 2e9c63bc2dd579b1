"""Reference page of vehicle files: the quantities of a car, and what follows from which."""

from __future__ import annotations

from orchestrator.wiring import derivations
from orchestrator.wiring.derivations import DERIVATIONS
from vocabulary import vehicle
from vocabulary.vehicle import CAR, VehicleQuantity

from .text import NOTE, cell, code, docstring, table


def page() -> str:
    """Return the page of quantities and derivations."""
    quantities = [
        (code(name), code(one.unit), "no" if one.needed else "yes", _range(one), cell(one.text))
        for name, one in CAR.items()
    ]
    formulas = [(code(one.name), cell(one.formula), ", ".join(map(code, one.inputs))) for one in DERIVATIONS]
    return "\n\n".join([
        "# Vehicle files",
        NOTE,
        docstring(vehicle.__doc__ or ""),
        "A unit that declares a quantity it cannot do without, neither given nor derived, is refused, if the "
        "file says enough of the car for its static loads.",
        table(("quantity", "unit", "units do without", "plausible", "meaning"), quantities),
        "## What follows from what",
        docstring(derivations.__doc__ or ""),
        table(("quantity", "formula", "needs"), formulas),
    ])  # fmt: skip


def _range(one: VehicleQuantity) -> str:
    return "" if one.plausible is None else f"{one.plausible[0]:g} to {one.plausible[1]:g}"
