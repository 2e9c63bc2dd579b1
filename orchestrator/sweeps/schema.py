"""The schema of sweep files: axes, design, metrics, limits, figures; every key, strictly.

    title: How fast may the car enter the manoeuvre?
    scenario: 25mps.yaml                  # relative to the sweep file
    set: {driver.amplitude: 0.05}         # for all runs; swap, stop_time, ... likewise
    design: grid                          # every combination; list: first with first, second with
    axes:                                 #   second; latin_hypercube: `runs` points by `seed`
      friction: {vary: inputs.friction*, from: 0.1, to: 1.0, count: 10}
      speed: {vary: plant.initial_speed, from: 36, to: 144, count: 10, unit: km/h, says: Entry speed}
      control: {vary: controller, values: {controller_off: no control, controller_fnn: neural network}}
      car: {vary: vehicle, values: [../vehicles/small.yaml, ../vehicles/large.yaml]}
    metrics:
      sideslip: {metric: peak(sideslip)}
    limits:
      stable: {says: Largest stable entry speed, of: speed, holds_if: [{metric: sideslip, at_most: 10 deg}]}
    figures:
      - {name: stable, kind: limit, limit: stable, x: friction, lines: control}
      - {name: sideslip, kind: map, metric: sideslip, x: friction, y: speed, panels: control}

What an axis varies is written as on the command line: `unit.parameter`, `vehicle.parameter` and
`inputs.pattern` take values, as do `stop_time`, `step_size` and `algorithm`; a unit alone takes FMUs
(`fmu:parameter=value` brings parameters along), `vehicle` takes vehicle files. Several places may
share an axis. In place of `vary` and `values`, `variants` change several things at once:

    control:
      variants:
        no control: {swap: {controller: controller_off}}
        with slip control: {swap: {wheel_control: wheel_control_slip}, set: {driver.amplitude: 0.04}}
"""

from __future__ import annotations

import math
import re
from typing import Annotated, Any, Literal

from pydantic import Field, PlainValidator, model_validator

from ..plan import FACTS, OF_RUN, Algorithm, Value
from ..scenario.measurement_units import parse_unit
from ..scenario.schema import Scalar, Time
from ..scenario.strict import Strict
from ..studies.study_schema import OPERATORS, MetricSpec, text_of
from ..wording import listed, short

MOST = 100_000
"""Runs of a sweep; chosen: more is a slip of the pen, and would be planned for an hour."""

Kind = Literal["setting", "fmu", "vehicle", "variant"]


def _places(value: object) -> list[str]:
    places = [value] if isinstance(value, str) else value
    if not isinstance(places, list) or not places or not all(isinstance(p, str) and p for p in places):
        raise ValueError(
            "must be unit.parameter, vehicle.parameter, inputs.pattern, a unit or vehicle "
            f"(got {short(value)})"
        )
    return places


def _levels(value: object) -> dict[Value, str]:
    """Return the values of an axis, each with its words."""
    if isinstance(value, dict) and value and all(isinstance(said, str) for said in value.values()):
        return dict(value)
    if not isinstance(value, list) or not all(_plain(v) for v in value):
        raise ValueError("must be a list of values, or a mapping of values to words")
    if not value:
        raise ValueError("has no values")
    if len({text_of(v) for v in value}) < len(value):
        again = next(text_of(v) for i, v in enumerate(value) if text_of(v) in map(text_of, value[:i]))
        raise ValueError(f"names {again} twice")
    return {v: text_of(v) for v in value}


def _plain(value: object) -> bool:
    return isinstance(value, (str, bool, int)) or (isinstance(value, float) and math.isfinite(value))


def _number(value: object) -> float | int:
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
        raise ValueError(f"must be a number (got {short(value)})")
    return value


def _quantity(value: object) -> float | int | str:
    if isinstance(value, str) and re.match(r"\s*[+-]?\.?\d", value):
        return value
    if isinstance(value, str):
        raise ValueError(f"must be a number, or a number with its unit ('10 deg') (got {short(value)})")
    return _number(value)


Places = Annotated[list[str], PlainValidator(_places)]
Levels = Annotated[dict[Any, str], PlainValidator(_levels)]
Number = Annotated[float | int, PlainValidator(_number)]
Quantity = Annotated[float | int | str, PlainValidator(_quantity)]


class VariantSpec(Strict):
    """Changes that belong together."""

    swap: dict[str, str] = Field({}, description="Unit -> FMU")
    set: dict[str, Scalar] = Field({}, description="unit.parameter -> value")
    vehicle: str | None = Field(None, description="Vehicle file, relative to the sweep file")

    @property
    def places(self) -> list[str]:
        """What the variant changes."""
        return [*self.swap, *self.set, *(["vehicle"] if self.vehicle else [])]


class AxisSpec(Strict):
    """What is varied, and the values it takes: listed, or so many from one to another; or variants."""

    vary: Places = Field([], description="unit.parameter, inputs.pattern, a unit (its FMU) or vehicle")
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
        return "setting" if _is_setting(place) else "vehicle" if place == "vehicle" else "fmu"

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
        if self.spacing == "log" and self.start <= 0:
            raise ValueError("from must be above 0 where spacing is log")


def _is_setting(place: str) -> bool:
    return "." in place or place in (*OF_RUN, *FACTS)


def _is_quantity(value: object) -> bool:
    return isinstance(value, str) and value[:1].isdigit() and not value.isidentifier() and " " in value


class Condition(Strict):
    """A comparison of a metric with a bound: a number in SI, or with its unit ('10 deg')."""

    metric: str
    above: Quantity | None = None
    at_least: Quantity | None = None
    below: Quantity | None = None
    at_most: Quantity | None = None

    @model_validator(mode="after")
    def _one(self) -> Condition:
        given = [name for name in OPERATORS if getattr(self, name) is not None]
        if len(given) != 1:
            raise ValueError(f"needs exactly one of {listed(OPERATORS, last='or')}")
        return self

    @property
    def operator(self) -> str:
        """The one operator that is given."""
        return next(name for name in OPERATORS if getattr(self, name) is not None)

    @property
    def bound(self) -> float | str:
        """What the metric is compared with."""
        return getattr(self, self.operator)


class LimitSpec(Strict):
    """The largest value of an axis up to which all conditions hold, for each setting of the others."""

    says: str = Field(description="What it is, in words", min_length=1)
    of: str = Field(description="The axis; its values must be numbers")
    holds_if: list[Condition] = Field(min_length=1)


class FigureSpec(Strict):
    """A figure of a metric or a limit over one or two axes."""

    name: str = Field(description="Name of its files", pattern=r"^[\w.+-]+$")
    kind: Literal["curve", "map", "limit"]
    title: str = ""
    metric: str = Field("", description="Key of `metrics`, for curves and maps")
    limit: str = Field("", description="Key of `limits`, for a limit")
    x: str = Field(description="Axis to the right")
    y: str = Field("", description="Axis upwards, of a map")
    lines: str = Field("", description="Axis with a line per value, of curves and limits")
    panels: str = Field("", description="Axis with a panel per value")
    only: dict[str, list[Scalar]] = Field({}, description="Axis -> those of its values that are drawn")
    scale: Literal["linear", "log"] = Field("linear", description="Of the metric")
    largest: Quantity | None = Field(None, description="Where the metric's scale ends")
    mark: Quantity | None = Field(None, description="A value of the metric to draw a line at")

    @model_validator(mode="after")
    def _complete(self) -> FigureSpec:
        wanted, other = ("limit", "metric") if self.kind == "limit" else ("metric", "limit")
        if not getattr(self, wanted) or getattr(self, other):
            raise ValueError(f"a {self.kind} needs {wanted} and no {other}")
        if (self.kind == "map") != bool(self.y):
            raise ValueError("a map needs y" if self.kind == "map" else f"a {self.kind} has no y")
        if self.kind == "map" and self.lines:
            raise ValueError("a map has no lines; use panels")
        used = [axis for axis in (self.x, self.y, self.lines, self.panels) if axis]
        if len(set(used)) < len(used):
            raise ValueError("x, y, lines and panels must be different axes")
        if self.mark is not None and self.kind == "limit":
            raise ValueError("a limit has no mark")
        return self


class SweepSpec(Strict):
    """A sweep file."""

    title: str = Field(min_length=1)
    source: str = Field("", description="Where the question comes from")
    scenario: str = Field(description="Scenario file, relative to the sweep file", min_length=1)
    swap: dict[str, str] = Field({}, description="Unit -> FMU, in all runs")
    set: dict[str, Scalar] = Field({}, description="unit.parameter -> value, in all runs")
    stop_time: Time | None = Field(None, description="In place of the scenario's")
    step_size: Time | None = Field(None, description="In place of the scenario's")
    algorithm: Algorithm | None = Field(None, description="In place of the scenario's")
    design: Literal["grid", "list", "latin_hypercube"] = "grid"
    runs: int | None = Field(None, ge=1, description="Of a Latin hypercube")
    seed: int | None = Field(None, ge=0, description="Of a Latin hypercube")
    axes: dict[str, AxisSpec] = Field(min_length=1)
    metrics: dict[str, MetricSpec] = Field(min_length=1)
    limits: dict[str, LimitSpec] = {}
    figures: list[FigureSpec] = []

    @model_validator(mode="after")
    def _design(self) -> SweepSpec:
        if self.design == "latin_hypercube":
            if self.runs is None or self.seed is None:
                raise ValueError("a latin_hypercube needs runs and seed")
        elif self.runs is not None or self.seed is not None:
            raise ValueError(f"runs and seed belong to a latin_hypercube; the design is {self.design}")
        else:
            self._check_lengths()
        number = self.number_of_runs()
        if number > MOST:
            raise ValueError(f"{number} runs; at most {MOST} are taken")
        return self

    def number_of_runs(self) -> int:
        """Return how many points the design has."""
        if self.design == "latin_hypercube":
            return self.runs or 0
        lengths = [axis.length or 0 for axis in self.axes.values()]
        return max(lengths) if self.design == "list" else math.prod(lengths)

    def _check_lengths(self) -> None:
        lengths = {name: axis.length for name, axis in self.axes.items()}
        for name, length in lengths.items():
            if length is None:
                raise ValueError(f"axes.{name}: needs count")
        if self.design == "list" and len(set(lengths.values())) > 1:
            counted = ", ".join(f"{name} has {n}" for name, n in lengths.items())
            raise ValueError(f"axes of a list must have equally many values ({counted})")
