"""Vehicle files, with the quantities of cars that they may have, for editors that know JSON Schema."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import Field, WithJsonSchema

from yawbench.orchestrator.scenario.schema import GivenScalar, Vehicle
from yawbench.orchestrator.scenario.schema_validation import in_unit

from .quantities import CAR


def _of_car() -> dict[str, Any]:
    """Return the JSON Schema of a car's parameters: its quantities, and others that FMUs declare."""
    known = {name: {**in_unit(quantity.unit), "description": quantity.text} for name, quantity in CAR.items()}
    others = {"type": ["number", "string", "boolean"]}
    return {"type": "object", "properties": known, "additionalProperties": others}


class VehicleFile(Vehicle):
    """A vehicle file: parameters for every instance that declares them."""

    parameters: Annotated[dict[str, GivenScalar], WithJsonSchema(_of_car())] = Field(
        {}, description="Parameter name -> value"
    )
