"""Values that a paper leaves open and the region over which claims are judged again, as studies name them."""

from __future__ import annotations

from pydantic import Field, model_validator

from yawbench.orchestrator.scenario.schema_validation import StrictModel

from .axes import AxisSpec
from .claim_schema import Patterns

LEVELS = 5
"""Levels of an open value given as a range. Chosen: enough to interpolate linearly between neighbours."""


class OpenValueSpec(AxisSpec):
    """A value that the paper leaves open: an axis on which every run already has its chosen value."""

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
        """The axis with discrete levels, for a scan along it."""
        return (
            self if self.values or self.variants else self.model_copy(update={"count": self.count or LEVELS})
        )

    @property
    def continuous(self) -> OpenValueSpec:
        """The axis as a continuous range, for a Latin hypercube."""
        return self.model_copy(update={"count": None})


class RegionSpec(StrictModel):
    """Region over which claims are judged again: along each open value, and over all of them together."""

    points: int = Field(
        16,
        ge=10,
        le=10_000,
        description="Of a Latin hypercube over all open values; the number that is added at once",
    )
    most: int = Field(128, ge=10, le=10_000, description="Points after which a claim stays undecided")
    seed: int = Field(1, ge=0, description="Of the Latin hypercube")
    open_values: dict[str, OpenValueSpec] = Field(description="Name -> range", min_length=1)

    @model_validator(mode="after")
    def _ordered(self) -> RegionSpec:
        if self.most < self.points:
            raise ValueError(f"most must be at least points (got {self.most} and {self.points})")
        return self

    @property
    def looks(self) -> tuple[int, ...]:
        """The numbers of points after which the verdict on a claim may be decided."""
        return (*range(self.points, self.most, self.points), self.most)
