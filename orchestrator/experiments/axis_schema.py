"""The schema of axes: what varies from run to run, the values it takes."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field, PlainValidator, model_validator

from ..plan import FACTS, FAULTS, OF_RUN, TYRES, Algorithm
from ..scenario.fault_schema import FaultSpec
from ..scenario.measurement_units import parse_unit
from ..scenario.scenario_schema import Scalar
from ..scenario.strict import Strict, Time
from ..wording import short
from .judged_schema import Patterns
from .numbers import Number, is_finite, text_of

MOST = 100_000
"""Runs of an experiment; chosen: more is a slip of the pen, and would be planned for an hour."""

FILES = ("vehicle", TYRES, f"{TYRES}.front", f"{TYRES}.rear")
"""Places that take names of files, relative to the experiment's."""

Kind = Literal["setting", "fmu", "file", "variant"]


def _places(value: object) -> list[str]:
    places = [value] if isinstance(value, str) else value
    if not isinstance(places, list) or not places or not all(isinstance(p, str) and p for p in places):
        raise ValueError(
            "must be unit.parameter, vehicle.parameter, inputs.pattern, a unit, vehicle or tyres "
            f"(got {short(value)})"
        )
    return places


def _levels(value: object) -> dict[Any, str]:
    """Return the values of an axis, each with its words."""
    if isinstance(value, dict) and value and all(isinstance(said, str) for said in value.values()):
        return dict(value)
    if not isinstance(value, list) or not all(_is_plain(v) for v in value):
        raise ValueError("must be a list of values, or a mapping of values to words")
    if not value:
        raise ValueError("has no values")
    if len({text_of(v) for v in value}) < len(value):
        again = next(text_of(v) for i, v in enumerate(value) if text_of(v) in map(text_of, value[:i]))
        raise ValueError(f"names {again} twice")
    return {v: text_of(v) for v in value}


def _is_plain(value: object) -> bool:
    return isinstance(value, (str, bool)) or is_finite(value)


Places = Annotated[list[str], PlainValidator(_places)]
Levels = Annotated[dict[Any, str], PlainValidator(_levels)]


class Changes(Strict):
    """What is other than in the scenario file."""

    swap: dict[str, str] = Field({}, description="Unit -> FMU, a name or a path")
    set: dict[str, Scalar] = Field({}, description="unit.parameter -> value")
    vehicle: str | None = Field(None, description="Vehicle file, relative to this file")
    faults: list[FaultSpec] = Field([], description="In place of the scenario's at these places")
    stop_time: Time | None = Field(None, description="In place of the scenario's")
    step_size: Time | None = Field(None, description="In place of the scenario's")
    algorithm: Algorithm | None = Field(None, description="In place of the scenario's")

    @property
    def places(self) -> list[str]:
        """What is changed."""
        own = [place for place in ("vehicle", *OF_RUN) if getattr(self, place, None) is not None]
        return [*self.swap, *self.set, *(f"{FAULTS}.{one.on}" for one in self.faults), *own]


class VariantSpec(Changes):
    """Changes that belong together."""


class AxisSpec(Strict):
    """What is varied, and the values it takes: listed, or so many from one to another; or variants."""

    vary: Places = Field(
        [], description="unit.parameter, inputs.pattern, a unit (its FMU), vehicle or tyres (files)"
    )
    variants: dict[str, VariantSpec] = Field({}, description="Words -> changes that belong together")
    values: Levels | None = Field(None, description="A list, or a mapping of values to words")
    start: Number | None = Field(None, alias="from", description="The first of `count` values")
    end: Number | None = Field(None, alias="to", description="The last")
    count: int | None = Field(None, ge=2, le=MOST, description="How many; a Latin hypercube needs none")
    spacing: Literal["linear", "log"] = Field("linear", description="Equal steps or equal factors")
    unit: str | None = Field(None, description="Of the numbers; left out: the parameter's own")
    says: str = Field("", description="What figures call it; default: the parameter in words")

    @property
    def kind(self) -> Kind:
        """What the axis varies."""
        if self.variants:
            return "variant"
        place = self.vary[0]
        return "setting" if _is_setting(place) else "file" if place in FILES else "fmu"

    @property
    def places(self) -> list[str]:
        """What the axis changes."""
        return self.vary or list(dict.fromkeys(p for one in self.variants.values() for p in one.places))

    @property
    def length(self) -> int | None:
        """How many values there are, None if the axis does not say."""
        levels = self.variants or self.values
        return self.count if levels is None else len(levels)

    @property
    def numeric(self) -> bool:
        """Whether all values are numbers."""
        if self.kind != "setting":
            return False
        return self.values is None or all(
            isinstance(v, (int, float)) and not isinstance(v, bool) for v in self.values
        )

    @model_validator(mode="after")
    def _consistent(self) -> AxisSpec:
        if bool(self.vary) == bool(self.variants):
            raise ValueError("needs either vary or variants")
        if self.variants:
            given = (self.values, self.start, self.end, self.count, self.unit)
            if any(one is not None for one in given):
                raise ValueError("variants have no values, from, to, count or unit")
            return self
        if "inputs" in self.vary:
            raise ValueError("vary: inputs needs a name, for example inputs.friction*")
        if len(self.vary) > 1 and not all(map(_is_setting, self.vary)):
            raise ValueError("vary: only several unit.parameter may share an axis")
        ends = (self.start, self.end)
        if self.values is not None and (ends != (None, None) or self.count is not None):
            raise ValueError("give either values, or from, to and count")
        if self.values is None:
            if None in ends:
                raise ValueError("needs values, or from, to and count")
            if self.kind != "setting":
                raise ValueError(f"{self.vary[0]} takes names: give values, not from and to")
            self._check_ends()
        elif self.kind != "setting" and not all(isinstance(value, str) for value in self.values):
            raise ValueError(f"values: {self.vary[0]} takes names of files or FMUs")
        if self.unit is not None:
            if not self.numeric:
                raise ValueError("unit: the values are no numbers")
            parse_unit(self.unit)
        elif self.values is not None and self.kind == "setting":
            quantity = next((v for v in self.values if _is_quantity(v)), None)
            if quantity is not None:
                raise ValueError(f"values: {quantity!r}: give plain numbers, and their unit in `unit`")
        return self

    def _check_ends(self) -> None:
        assert self.start is not None
        assert self.end is not None
        if not self.start < self.end:
            raise ValueError(f"from must be below to (got {self.start:g} and {self.end:g})")
        if self.spacing == "log" and self.start * self.end <= 0:
            raise ValueError("from and to must both be above 0, or both below, where spacing is log")


class DesignAxisSpec(AxisSpec):
    """An axis of the points at which the runs of an experiment are made."""

    runs: Patterns = Field(["*"], description="Which runs it changes; the others are the same all along it")
    repeats: bool = Field(
        False,
        description="Whether its values, seeds say, make repeats of one and the same: every number is then "
        "the mean over them, with its confidence interval; listed, with at least 2 of them",
    )

    @model_validator(mode="after")
    def _repeated(self) -> DesignAxisSpec:
        if self.repeats and len(self.values or ()) < 2:
            raise ValueError("repeats: needs a list of two values or more")
        return self


def _is_setting(place: str) -> bool:
    return place not in FILES and ("." in place or place in (*OF_RUN, *FACTS))


def _is_quantity(value: object) -> bool:
    return isinstance(value, str) and value[:1].isdigit() and not value.isidentifier() and " " in value
