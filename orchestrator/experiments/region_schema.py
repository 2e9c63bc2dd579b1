"""The schema of regions: the values that a paper leaves open, how far each may lie from the chosen one."""

from __future__ import annotations

from pydantic import Field, model_validator

from ..scenario.strict import Strict
from .axis_schema import AxisSpec, VariantSpec
from .judged_schema import Patterns

LEVELS = 5
"""Of an open value from one number to another. Chosen: enough for a straight line between two to do."""


class OpenVariantSpec(VariantSpec):
    """Changes that belong together; none: as chosen."""

    scenario: str = Field(
        "", description="In place of a run's own, whose name is `{scenario}`; relative to this file"
    )


class OpenValueSpec(AxisSpec):
    """A value that is open, as an axis of which every run has a value of its own: the chosen one."""

    variants: dict[str, OpenVariantSpec] = Field(  # type: ignore[assignment]
        {}, description="Words -> changes that belong together"
    )
    times: bool = Field(False, description="Whether the values are factors on what each run has")
    runs: Patterns = Field(["*"], description="Which runs it may touch; those that set it themselves keep it")
    because: str = Field(description="Why this range: a source, or `chosen:` and why", min_length=1)

    @model_validator(mode="after")
    def _complete(self) -> OpenValueSpec:
        if self.times and (not self.numeric or self.unit is not None):
            raise ValueError("times: factors are plain numbers")
        return self

    @property
    def stepped(self) -> OpenValueSpec:
        """The same with so many levels along it."""
        return (
            self if self.values or self.variants else self.model_copy(update={"count": self.count or LEVELS})
        )

    @property
    def continuous(self) -> OpenValueSpec:
        """The same with every number of its range."""
        return self.model_copy(update={"count": None})


class RegionSpec(Strict):
    """Where claims are judged beside the chosen point: along each open value, and over all together."""

    points: int = Field(24, ge=10, le=10_000, description="Of a Latin hypercube over all open values")
    seed: int = Field(1, ge=0, description="Of the Latin hypercube")
    open_values: dict[str, OpenValueSpec] = Field(description="Name -> range", min_length=1)
