"""Axes of an experiment: their schema, the points of a design, and the overrides at each point.

A design is a full grid, a list or a sample (`sampling`): then axes with a range or a distribution are drawn,
and every value of the others is combined with all points drawn. A region has axes, too: the values that a
paper leaves open, with the range over which claims are judged again.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import partial
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import ConfigDict, Field, PlainSerializer, PlainValidator, WithJsonSchema, model_validator

from yawbench.fmus.fmu import Value
from yawbench.foundation.messages import resolved, short
from yawbench.orchestrator.plan import Override, OverrideOrigin
from yawbench.orchestrator.scenario import catalogue, overrides, yaml_lines
from yawbench.orchestrator.scenario.fault_schema import FaultSpec, by_location
from yawbench.orchestrator.scenario.quantities import parse_unit
from yawbench.orchestrator.scenario.schema import AlgorithmName, Scalar
from yawbench.orchestrator.scenario.schema_validation import StrictModel, Time, exactly_one
from yawbench.orchestrator.signal_names import INPUTS, OF_RUN, VEHICLE, Target

from .claim_schema import LEVELS as VALUES
from .claim_schema import Number, Patterns, is_finite, text_of
from .on_demand import OnDemand
from .sampling import Distribution, Normal, Tabulated, Uniform, table_of

MOST = 100_000
"""Largest number of runs in an experiment; chosen: more is a typo, and planning them takes minutes."""

AxisKind = Literal["setting", "fmu", "file", "variant"]


def _targets(value: object) -> list[Target]:
    return [_target(one) for one in value] if isinstance(value, list) and value else [_target(value)]


def _target(value: object) -> Target:
    if isinstance(value, Target):  # made already
        return value
    if not isinstance(value, str) or not value:
        raise ValueError(
            "must be instance.parameter, vehicle.parameter, inputs.pattern, an instance, vehicle or tyres "
            f"(got {short(value)})"
        )
    return Target.parse(value)


def _levels(value: object) -> dict[Any, str]:
    """Return the values of an axis with their labels."""
    if isinstance(value, dict) and value and all(isinstance(words, str) for words in value.values()):
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


_TARGET = {"type": "string", "pattern": r"^[^.]+(\..+)?$"}
_TARGETS = {"anyOf": [_TARGET, {"type": "array", "items": _TARGET, "minItems": 1}]}

TargetText = Annotated[Target, PlainValidator(_target), PlainSerializer(str), WithJsonSchema(_TARGET)]
TargetList = Annotated[
    list[Target],
    PlainValidator(_targets),
    PlainSerializer(lambda targets: [*map(str, targets)]),
    WithJsonSchema(_TARGETS),
]
Levels = Annotated[dict[Any, str], PlainValidator(_levels), WithJsonSchema(VALUES)]


class OverrideSpec(StrictModel):
    """Overrides of a scenario."""

    swap: dict[str, str] = Field({}, description="Instance -> FMU, a name or a path")
    set: dict[TargetText, Scalar] = Field({}, description="instance.parameter -> value")
    vehicle: str | None = Field(None, description="Vehicle file, relative to this file")
    faults: list[FaultSpec] = Field([], description="In place of the scenario's at these locations")
    stop_time: Time | None = Field(None, description="In place of the scenario's")
    step_size: Time | None = Field(None, description="In place of the scenario's")
    algorithm: AlgorithmName | None = Field(None, description="In place of the scenario's")

    @property
    def targets(self) -> list[Target]:
        """The targets of these overrides."""
        own = [Target.parse(name) for name in (VEHICLE, *OF_RUN) if getattr(self, name, None) is not None]
        faults = [Target("faults", variable=str(fault.on)) for fault in self.faults]
        return [*map(Target.of_instance, self.swap), *self.set, *faults, *own]


class VariantSpec(OverrideSpec):
    """A named group of overrides; an empty one changes nothing."""

    scenario: str = Field(
        "", description="In place of a run's own, whose name is `{scenario}`; relative to this file"
    )


class AxisSpec(StrictModel):
    """An axis: targets with their values, listed or as a range; or variants that change several targets."""

    model_config = ConfigDict(json_schema_extra=exactly_one("vary", "variants"))

    vary: TargetList = Field(
        [], description="instance.parameter, inputs.pattern, an instance (its FMU), vehicle or tyres (files)"
    )
    variants: dict[str, VariantSpec] = Field({}, description="Words -> changes that belong together")
    values: Levels | None = Field(None, description="A list, or a mapping of values to words")
    start: Number | None = Field(None, alias="from", description="The first of `count` values")
    end: Number | None = Field(None, alias="to", description="The last")
    count: int | None = Field(
        None, ge=2, le=MOST, description="Number of values; without it the range is drawn from"
    )
    spacing: Literal["linear", "log"] = Field("linear", description="Equal steps or equal factors")
    unit: str | None = Field(None, description="Unit of the numbers; default: that of the parameter")
    says: str = Field("", description="Label in figures; default: the parameter in words")

    @property
    def distribution(self) -> Distribution | None:
        """What is drawn; None: listed values, or a counted range."""
        listed = self.values is not None or self.variants or self.count is not None
        if listed or self.start is None or self.end is None:
            return None
        return Uniform(self.start, self.end, self.spacing == "log")

    @property
    def kind(self) -> AxisKind:
        """Kind of its targets: a value, an FMU, a file, or several at once."""
        if self.variants:
            return "variant"
        target = self.vary[0]
        return "fmu" if target.kind == "fmu" else "file" if target.names_file else "setting"

    @property
    def targets(self) -> list[Target]:
        """The targets that the axis overrides."""
        return self.vary or list(dict.fromkeys(t for spec in self.variants.values() for t in spec.targets))

    @property
    def length(self) -> int | None:
        """The number of values; None for a range without a count."""
        levels = self.variants or self.values
        return self.count if levels is None else len(levels)

    @property
    def drawn(self) -> bool:
        """Whether its values are drawn."""
        return self._describes or self.distribution is not None

    @property
    def _describes(self) -> bool:
        """Whether it describes a distribution other than its range."""
        return False

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
            bounds = (self.values, self.start, self.end, self.count, self.unit)
            if any(bound is not None for bound in bounds):
                raise ValueError("variants have no values, from, to, count or unit")
            return self
        if Target.of_instance(INPUTS) in self.vary:
            raise ValueError("vary: inputs needs a name, for example inputs.friction*")
        if len(self.vary) > 1 and any(target.names_file for target in self.vary):
            raise ValueError("vary: only several instance.parameter may share an axis")
        ends = (self.start, self.end)
        if self.values is not None and (ends != (None, None) or self.count is not None):
            raise ValueError("give either values, or from, to and count")
        if self.values is None:
            if None in ends and not self._describes:
                raise ValueError("needs values, or from, to and count")
            if self.kind != "setting":
                raise ValueError(f"{self.vary[0]} takes names: give values, not from and to")
            if None not in ends:
                self._check_ends()
        elif self.kind != "setting" and not all(isinstance(value, str) for value in self.values):
            raise ValueError(f"values: {self.vary[0]} takes names of files or FMUs")
        if self.unit is not None:
            if not self.numeric:
                raise ValueError("unit: the values must be numbers")
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
            raise ValueError(f"from must be below to (got {' and '.join(resolved(self.start, self.end))})")
        if self.spacing == "log" and self.start * self.end <= 0:
            raise ValueError("from and to must both be above 0, or both below, for spacing log")


class NormalSpec(StrictModel):
    """A normal distribution; `from` and `to` of the axis, one or both, truncate it."""

    mean: Number = Field(description="In the unit of the axis")
    deviation: Annotated[Number, Field(gt=0)] = Field(description="Standard deviation")


def _table(value: object) -> Any:
    """Normalize a table of a distribution: to pairs of value and cumulative share, or a file."""
    if isinstance(value, str) and value:
        return value
    if not isinstance(value, (list, tuple)) or not value:
        raise ValueError(
            "must be a list of values, of pairs [value, cumulative share], or a CSV file of one or both"
        )
    return table_of(value)


_TABLE_JSON: dict[str, Any] = {
    "anyOf": [
        {"type": "string"},
        {"type": "array", "items": {"anyOf": [
            {"type": "number"}, {"type": "array", "items": {"type": "number"}, "minItems": 2, "maxItems": 2},
        ]}, "minItems": 2},
    ]
}  # fmt: skip


class DesignAxisSpec(AxisSpec):
    """An axis of an experiment's design."""

    normal: NormalSpec | None = Field(None, description="Values are drawn from a normal distribution")
    table: Annotated[Any, PlainValidator(_table), WithJsonSchema(_TABLE_JSON)] = Field(
        None,
        description="Values are drawn from a table: measured values, of which each is as likely, pairs of a "
        "value and the share of values up to it, straight between them, or a CSV file of one or both",
    )
    whole: bool = Field(False, description="Whether drawn values are rounded to whole numbers, as for seeds")
    runs: Patterns = Field(["*"], description="Which runs it changes; the others are the same all along it")
    repeats: bool = Field(
        False,
        description="Whether its values, seeds say, make repeats of one and the same: every number is then "
        "the mean over them, with its confidence interval; listed, with at least 2 of them",
    )

    @property
    def distribution(self) -> Distribution | None:
        """What is drawn; None: listed values, or a counted range."""
        if self.normal:
            return Normal(self.normal.mean, self.normal.deviation, self.start, self.end)
        return Tabulated(self.table) if isinstance(self.table, tuple) else super().distribution

    @property
    def _describes(self) -> bool:
        return self.normal is not None or self.table is not None

    @model_validator(mode="after")
    def _drawn(self) -> DesignAxisSpec:
        if self.normal and self.table is not None:
            raise ValueError("give either normal or table")
        if self._describes and (self.values is not None or self.count is not None or self.variants):
            raise ValueError("normal and table take no values, count or variants")
        if self.table is not None and (self.start, self.end) != (None, None):
            raise ValueError("table: takes no from and to")
        if self._describes and self.spacing == "log":
            raise ValueError("spacing: is of ranges, not of normal or table")
        if self.whole and not self.drawn:
            raise ValueError("whole: is of drawn values: a range without count, normal or table")
        if self.normal:
            self.distribution.check()  # type: ignore[union-attr]
        return self

    @model_validator(mode="after")
    def _repeated(self) -> DesignAxisSpec:
        if self.repeats and len(self.values or ()) < 2:
            raise ValueError("repeats: needs a list of two values or more")
        return self


def _is_quantity(value: object) -> bool:
    return isinstance(value, str) and value[:1].isdigit() and not value.isidentifier() and " " in value


SCENARIO = "scenario"
"""Name of the axis of scenarios, where a file names several."""
RUN = "run"
"""Name of the axis of named runs in figures and tables."""
DesignPoint = tuple["Level", ...]
"""One level per axis, in the order of the axes."""


@dataclass(frozen=True)
class Level:
    """A value of an axis as written in the file, with its label in figures and tables."""

    value: Value
    words: str


def axis_of_levels(target: str, levels: Iterable[Level], **more: Any) -> DesignAxisSpec:
    """Return an axis over computed levels of a target; `more`: its other fields."""
    values = {level.value: level.words for level in levels}
    return DesignAxisSpec.model_construct(vary=[Target.parse(target)], values=values, **more)


def levels_of(axis: AxisSpec) -> Sequence[Level]:
    """Return the levels of an axis with listed values, variants, or a counted range."""
    if axis.variants:
        return [Level(words, words) for words in axis.variants]
    if axis.values is not None:
        return [Level(value, words) for value, words in axis.values.items()]
    assert axis.start is not None
    assert axis.end is not None
    assert axis.count is not None
    last = axis.count - 1
    if axis.spacing == "log":
        return OnDemand(range(axis.count), partial(_by_factors, axis.start, axis.end, last))
    first, step = Fraction(repr(axis.start)), (Fraction(repr(axis.end)) - Fraction(repr(axis.start))) / last
    common = math.lcm(first.denominator, step.denominator)
    return OnDemand(range(axis.count), partial(_by_steps, int(first * common), int(step * common), common))


def _by_factors(start: float, end: float, last: int, number: int) -> Level:
    if number in (0, last):
        return _level(float(end if number else start))
    return _level(start * (end / start) ** (number / last))


def _by_steps(first: int, step: int, common: int, number: int) -> Level:
    """Return a level from numerators over a common denominator, which avoid 0.30000000000000004."""
    return _level((first + number * step) / common)


def grid(levels: Sequence[Sequence[Level]]) -> Sequence[DesignPoint]:
    """Return all combinations of levels, of which the last varies fastest."""
    return OnDemand(range(math.prod(map(len, levels))), partial(_in_grid, levels))


def _in_grid(levels: Sequence[Sequence[Level]], number: int) -> DesignPoint:
    point: list[Level] = []
    for several in reversed(levels):
        number, place = divmod(number, len(several))
        point.insert(0, several[place])
    return tuple(point)


def names_of(axis: AxisSpec, level: Level) -> tuple[str, ...]:
    """Return the texts that name a level in a file: its value, that with the unit of the axis, its label."""
    value = text_of(level.value)
    return (value, *([f"{value} {axis.unit}"] if axis.unit else []), level.words)


def _level(number: float) -> Level:
    return Level(number, f"{number:.6g}")


def points_at(axes: Sequence[AxisSpec], positions: np.ndarray) -> Sequence[DesignPoint]:
    """Return the points at relative positions, 0 to 1: an array of (points, axes).

    An axis of listed values takes each of them equally often, up to the remainder of the division.
    """
    return OnDemand(range(len(positions)), partial(_at_position, axes, positions))


def _at_position(axes: Sequence[AxisSpec], positions: np.ndarray, number: int) -> DesignPoint:
    pairs = zip(axes, positions[number], strict=True)
    return tuple(level_at(axis, float(position)) for axis, position in pairs)


def crossed(axes: Sequence[AxisSpec], positions: np.ndarray) -> Sequence[DesignPoint]:
    """Return the points of a sample: all combinations of listed values, each with the same points drawn.

    Args:
        axes: of the design, in order.
        positions: relative positions on the axes that are drawn, shape (points, such axes); these vary
            fastest.
    """
    listed = grid([levels_of(axis) for axis in axes if not axis.drawn])
    drawn = points_at([axis for axis in axes if axis.drawn], positions)
    return OnDemand(range(len(listed) * len(drawn)), partial(_crossed, axes, listed, drawn))


def _crossed(
    axes: Sequence[AxisSpec], listed: Sequence[DesignPoint], drawn: Sequence[DesignPoint], number: int
) -> DesignPoint:
    combination, draw = divmod(number, len(drawn))
    of_listed, of_drawn = iter(listed[combination]), iter(drawn[draw])
    return tuple(next(of_drawn if axis.drawn else of_listed) for axis in axes)


def level_at(axis: AxisSpec, position: float) -> Level:
    """Return the level at a relative position, 0 to 1, along an axis."""
    if axis.variants or axis.values is not None or axis.count is not None:
        levels = levels_of(axis)
        return levels[min(int(position * len(levels)), len(levels) - 1)]
    assert axis.distribution is not None
    number = axis.distribution.at(position)
    return Level(round(number), str(round(number))) if getattr(axis, "whole", False) else _level(number)


def changes_at(
    axis: AxisSpec, level: Level, folder: Path, origin: OverrideOrigin = "sweep"
) -> list[Override]:
    """Return the overrides of one level of an axis; file names are relative to `folder`."""
    if axis.kind == "file":
        of_car = axis.vary[0].kind == "vehicle_file"
        file = _vehicle(folder, str(level.value), origin).value if of_car else folder / str(level.value)
        return [Override(axis.vary[0], str(file), origin)]
    if axis.kind == "variant":
        return changes_of_file(axis.variants[str(level.value)], folder, origin)
    if axis.kind == "fmu":
        return overrides.changes_of({axis.vary[0].instance: str(level.value)}, {}, folder, origin)
    return [overrides.setting(target, _given(axis, level), origin) for target in axis.vary]


def _given(axis: AxisSpec, level: Level) -> Value:
    """Return the value of a level, with the axis's unit if it has one."""
    if axis.unit:
        return f"{text_of(level.value)} {axis.unit}"
    return yaml_lines.scalar(level.value) if isinstance(level.value, str) else level.value


def _vehicle(folder: Path, name: str, origin: OverrideOrigin) -> Override:
    return Override.of(VEHICLE, str(catalogue.placed(folder, name, "a vehicle file")), origin)


def changes_of_file(spec: OverrideSpec, folder: Path, origin: OverrideOrigin) -> list[Override]:
    """Return the overrides in one part of an experiment file; file names are relative to `folder`."""
    vehicle = [_vehicle(folder, spec.vehicle, origin)] if spec.vehicle else []
    of_run = overrides.changes_of_run(spec, origin)
    at = by_location(entry.fault for entry in spec.faults)
    faults = [
        Override(Target("faults", variable=str(location)), ones, origin) for location, ones in at.items()
    ]
    return vehicle + of_run + overrides.changes_of(spec.swap, spec.set, folder, origin) + faults
