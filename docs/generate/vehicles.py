"""Reference page of vehicle files: the quantities of a car, and what follows from which."""

from __future__ import annotations

from yawbench.vehicles import derivations
from yawbench.vehicles.derivations import DERIVATIONS
from yawbench.vehicles.quantities import CAR
from yawbench.vocabulary import vehicle
from yawbench.vocabulary.vehicle import VehicleQuantity

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
        "If the file has enough values for the static loads of the car, an FMU is refused that needs a "
        "quantity which is neither given nor derived.",
        table(("quantity", "unit", "optional", "plausible", "meaning"), quantities),
        "## Derived quantities",
        docstring(derivations.__doc__ or ""),
        table(("quantity", "formula", "needs"), formulas),
    ])  # fmt: skip


def _range(one: VehicleQuantity) -> str:
    return "" if one.plausible is None else f"{one.plausible[0]:g} to {one.plausible[1]:g}"
