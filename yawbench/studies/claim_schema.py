"""Schema of an experiment's results: metrics, grids, derived numbers, claims, limits.

Numbers in experiment files are plain ones in SI units, or text with a unit.

Derived numbers combine the metrics of several runs: arithmetic expressions, or rank correlations. An
expression consists of numbers, the names under its `of`, + - * / and parentheses. It has no value where a
run is missing or a divisor is zero.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Any, Literal, get_args

from pydantic import (
    AfterValidator,
    ConfigDict,
    Discriminator,
    Field,
    PlainValidator,
    PrivateAttr,
    Tag,
    WithJsonSchema,
    model_validator,
)

from yawbench.foundation.errors import ScenarioError
from yawbench.foundation.messages import listed, short
from yawbench.metrics.expressions import during, metric, window_of
from yawbench.metrics.measures import MEASURES
from yawbench.metrics.verdict import SYMBOLS, Relation
from yawbench.orchestrator.scenario.quantities import convert
from yawbench.orchestrator.scenario.schema_validation import StrictModel, exactly_one

from .expression import ExpressionField


def text_of(value: object) -> str:
    """Return a scalar as text in YAML spelling."""
    return str(value).lower() if isinstance(value, bool) else str(value)


def is_finite(value: object) -> bool:
    """Return whether a value is a finite number."""
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return False
    return abs(value) <= sys.float_info.max  # also right for integers too large for a float


def si_number(value: float | str, unit: str) -> float:
    """Return a number in SI units, from a plain number or text with a unit; `%` is a ratio.

    Raises:
        ValueError: the text is not a quantity of this unit; says what is expected.
    """
    return float(convert(value, "1" if unit == "%" else unit) if isinstance(value, str) else value)


def is_quantity(value: object) -> bool:
    """Return whether a value is a number, or text that begins with one."""
    return is_finite(value) or (isinstance(value, str) and re.match(r"\s*[+-]?\.?\d", value) is not None)


def _only(allowed: Callable[[object], bool], wanted: str) -> PlainValidator:
    def check(value: object) -> Any:
        if not allowed(value):
            raise ValueError(f"must be {wanted} (got {short(value)})")
        return value

    return PlainValidator(check)


_NUMBER = {"type": "number"}
_QUANTITY = {"anyOf": [_NUMBER, {"type": "string", "pattern": r"^\s*[+-]?\.?\d"}]}

Number = Annotated[float | int, _only(is_finite, "a number"), WithJsonSchema(_NUMBER)]
QuantityText = Annotated[
    float | int | str,
    _only(is_quantity, "a number, or a number with its unit ('5 %')"),
    WithJsonSchema(_QUANTITY),
]
"""A number in SI units, or text with a number and its unit."""
CELLS = 10_000
"""Largest number of cells in a grid. Chosen: a hundred times our largest."""


def alternatives(value: object) -> dict[str, str]:
    """Return the values of one `for` key with their labels."""
    if isinstance(value, list) and value and all(isinstance(v, (str, int, float)) for v in value):
        return {text_of(v): text_of(v) for v in value}
    if isinstance(value, dict) and value and all(isinstance(v, str) for v in value.values()):
        return {str(k): v for k, v in value.items()}
    raise ValueError("must be a list of values, or a mapping of values to words")


def _window(value: object) -> tuple[float, float]:
    if isinstance(value, str):
        return window_of(value)
    numbers = isinstance(value, list) and len(value) == 2 and all(map(is_finite, value))
    if not numbers or not value[0] < value[1]:  # type: ignore[index]
        raise ValueError(f"must be [from, to] in s, from before to, or 1 s to 3 s (got {short(value)})")
    return float(value[0]), float(value[1])  # type: ignore[index]


def _metric_name(name: str) -> str:
    try:
        return metric(name).name
    except ScenarioError as error:
        raise ValueError(str(error)) from None


LEVELS = {
    "anyOf": [
        {"type": "array", "items": {"type": ["string", "number", "boolean"]}, "minItems": 1},
        {"type": "object", "additionalProperties": {"type": "string"}, "minProperties": 1},
    ]
}
"""JSON Schema of values, or of values with words."""
_WINDOWS = [{"type": "string"}, {"type": "array", "items": _NUMBER, "minItems": 2, "maxItems": 2}]
_METRIC_PATTERN = rf"^\s*({'|'.join(MEASURES)})\s*\(.+\)"

Alternatives = Annotated[dict[str, str], PlainValidator(alternatives), WithJsonSchema(LEVELS)]
WindowField = Annotated[tuple[float, float], PlainValidator(_window), WithJsonSchema({"anyOf": _WINDOWS})]
MetricName = Annotated[
    str, AfterValidator(_metric_name), WithJsonSchema({"type": "string", "pattern": _METRIC_PATTERN})
]


@dataclass(frozen=True)
class NameOf:
    """Mark of a field that names something in its experiment: by its text, texts of a list or keys."""

    kind: Literal[
        "run", "runs", "metric", "axis", "axis or run", "derived number", "grid", "limit", "open value"
    ]


RunName = Annotated[str, NameOf("run")]
MetricKey = Annotated[str, NameOf("metric")]
DerivedKey = Annotated[str, NameOf("derived number")]
Patterns = Annotated[list[str], Field(min_length=1), NameOf("runs")]
"""Names of runs; `*` and `?` are wildcards."""


class MetricSpec(StrictModel):
    """A metric, computed of every run."""

    metric: MetricName = Field(description="measure(signal)")
    window: WindowField | None = Field(None, description="[from, to] in s; default: the whole run")
    heading: str = Field("", description="Heading of its column; default: the formula")
    over_repeats: Literal["mean", "median", "share"] = Field(
        "mean",
        description="Of repeats: mean with Student's interval; median and range, of those that have a value; "
        "share of those that are not 0, with the interval of Clopper and Pearson",
    )

    def during(self, lead: str = "") -> str:
        """Return the window to end a phrase with: ", 1 to 6 s", after a `lead` such as "from "."""
        return during(self.window or metric(self.metric).window, lead)


def _single(value: dict[str, dict[str, str]]) -> dict[str, dict[str, str]]:
    if len(value) != 1:
        raise ValueError(f"needs exactly one name with its values (got {len(value)})")
    return value


_AXIS = {"type": "object", "additionalProperties": LEVELS, "minProperties": 1, "maxProperties": 1}
GridAxis = Annotated[dict[str, Alternatives], AfterValidator(_single), WithJsonSchema(_AXIS)]
"""Placeholder name of the rows or columns -> their values with labels."""


class BesideSpec(StrictModel):
    """A run outside a grid, shown with it."""

    run: str = Field(min_length=1)
    says: str = Field(description="Description of the run", min_length=1)
    published: float | None = Field(None, description="In SI")


class GridSpec(StrictModel):
    """A metric of many runs in rows and columns, with the paper's numbers to compare."""

    title: str = Field(min_length=1)
    metric: MetricKey = ""
    run: str = Field("", description="Names of the runs, with {name} for row and column")
    derived: str = Field(
        "", description="Instead of metric and run: keys of `derived`, with {name} for row and column"
    )
    rows: GridAxis
    columns: GridAxis
    corner: str = Field("", description="Heading of the column of rows")
    published: list[list[float]] | None = Field(None, description="In SI, row by row")
    beside: list[BesideSpec] = Field([], description="Runs outside the grid")
    holds: str = Field(
        "",
        description="Heading of a last row: down to where the claims and checks about a column's cells hold",
    )

    @model_validator(mode="after")
    def _shape(self) -> GridSpec:
        ((row, rows),), ((column, columns),) = self.rows.items(), self.columns.items()
        if bool(self.derived) == bool(self.metric) or bool(self.metric) != bool(self.run):
            raise ValueError("needs run and metric, or derived in place of both")
        if self.derived and (self.published or self.beside):
            raise ValueError("derived: such a grid has nothing published and no run beside it")
        for name in (row, column):
            if f"{{{name}}}" not in self.run + self.derived:
                which = f"derived: {self.derived!r}" if self.derived else f"run: {self.run!r}"
                raise ValueError(f"{which} does not depend on {{{name}}}")
        if len(rows) * len(columns) > CELLS:
            raise ValueError(f"{len(rows) * len(columns)} runs; at most {CELLS} are allowed")
        if row == column:
            raise ValueError(f"rows and columns are both called {row!r}")
        if self.published and [len(line) for line in self.published] != [len(columns)] * len(rows):
            raise ValueError(f"published: must have {len(rows)} rows of {len(columns)} numbers")
        return self


class MetricSource(StrictModel):
    """A metric of a run."""

    run: RunName
    metric: MetricKey


class DerivedSpec(StrictModel):
    """A number derived from several runs: an expression of metrics, or a grid's rank correlation."""

    model_config = ConfigDict(json_schema_extra=exactly_one("expression", "rank_correlation"))

    says: str = Field(description="Description of the number", min_length=1)
    for_each: dict[str, Alternatives] = Field(
        {}, alias="for", description="Key -> values; one number per combination, named in its key by {key}"
    )
    expression: ExpressionField | None = None
    of: dict[str, MetricSource] = Field({}, description="Name in the expression -> metric of a run")
    rank_correlation: Annotated[str | None, NameOf("grid")] = Field(
        None, description="Grid whose order is compared with the paper's"
    )
    only: dict[str, Alternatives] = Field(
        {}, description="Rows or columns of the grid -> those of their values that count"
    )
    unit: str = Field("1", description="Of the expression's value; '%' shows a ratio in per cent")
    published: QuantityText | None = Field(None, description="The value in the paper, in SI or with its unit")

    @model_validator(mode="after")
    def _complete(self) -> DerivedSpec:
        if (self.expression is None) == (self.rank_correlation is None):
            raise ValueError("needs exactly one of expression and rank_correlation")
        if self.only and self.rank_correlation is None:
            raise ValueError("only: belongs to a rank_correlation")
        for name in self.expression.names if self.expression else ():
            if name not in self.of:
                raise ValueError(f"expression: {name} is undefined; 'of' has {listed(self.of)}")
        if self.published is not None:
            try:
                si_number(self.published, self.unit)
            except ValueError as error:
                raise ValueError(f"published: {error}") from None
        return self


class MetricReference(StrictModel):
    """A metric of another run as a bound."""

    run: RunName
    metric: MetricKey
    times: float = 1.0


_BOUND = "a number, a number with its unit ('5 %'), or {run: ..., metric: ...}"
Bound = Annotated[
    Annotated[float | int | str, _only(is_quantity, _BOUND), WithJsonSchema(_QUANTITY), Tag("number")]
    | Annotated[MetricReference, Tag("reference")],
    Discriminator(lambda value: "reference" if isinstance(value, (dict, MetricReference)) else "number"),
]
"""A number in SI units, a number with its unit ('5 %'), or another run's metric."""


class Condition(StrictModel):
    """A comparison of a run's metric, or of a derived number, with exactly one bound."""

    model_config = ConfigDict(json_schema_extra=exactly_one(*SYMBOLS))

    run: Annotated[str, NameOf("runs")] = Field(
        "", description="Name of a run; with `*` every run that matches; default: every run"
    )
    metric: MetricKey = ""
    derived: DerivedKey = Field("", description="Key of `derived`, in place of run and metric")
    above: Bound | None = None
    at_least: Bound | None = None
    below: Bound | None = None
    at_most: Bound | None = None

    @model_validator(mode="after")
    def _complete(self) -> Condition:
        if sum(getattr(self, name) is not None for name in SYMBOLS) != 1:
            raise ValueError(f"needs exactly one of {listed(SYMBOLS, last='or')}")
        if bool(self.derived) == bool(self.metric) or (self.derived and self.run):
            raise ValueError("needs run and metric, or derived in place of both")
        return self

    @property
    def relation(self) -> Relation:
        """The relation in which the metric must be to the bound."""
        return next(name for name in get_args(Relation) if getattr(self, name) is not None)

    @property
    def bound(self) -> Any:
        """The bound that the metric is compared with."""
        return getattr(self, self.relation)

    def __str__(self) -> str:
        bound = self.bound
        if isinstance(bound, MetricReference):
            factor = "" if bound.times == 1 else f"{bound.times:g} × "
            bound = factor + (bound.run if bound.metric == self.metric else f"{bound.metric} of {bound.run}")
        of = self.derived or (f"{self.run}: {self.metric}" if self.run else self.metric)
        return f"{of} {SYMBOLS[self.relation]} {bound}"


class Assertion(StrictModel):
    """A statement about runs, and the conditions that decide whether it holds."""

    says: str = Field(description="The statement in words", min_length=1)
    holds_if: list[Condition] = Field(description="All must be true", min_length=1)


class Claim(Assertion):
    """A claim of a paper or a check of our own, with the conditions that decide whether it holds."""

    for_each: dict[str, Alternatives] = Field(
        {}, alias="for", description="Key -> values; one claim per combination, {key} in its texts"
    )
    short: str = Field("", description="The same for the table of runs, e.g. '> 100 %'")
    source: str = Field("", description="Where it is in the paper: section, figure, table")
    note: str = Field("", description="What a reader should know about the verdict")
    open_values: Annotated[list[str] | None, NameOf("open value")] = Field(
        None, description="Open values of the region that it depends on; default: all that affect its runs"
    )
    _number: int | None = PrivateAttr(None)

    def number(self, otherwise: int) -> int:
        """Return the index of the file's entry that the claim was expanded from; else `otherwise`."""
        return otherwise if self._number is None else self._number


class LimitSpec(Assertion):
    """The largest value of an axis up to which all conditions hold, for each setting of the others."""

    of: Annotated[str, NameOf("axis")] = Field(description="The axis; its values must be numbers")
