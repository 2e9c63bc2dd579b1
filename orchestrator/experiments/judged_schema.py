"""The schema of what is computed of runs: metrics, grids, derived numbers, conditions on them."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import AfterValidator, Discriminator, Field, PlainValidator, PrivateAttr, Tag, model_validator

from ..errors import ScenarioError
from ..metrics.run_metrics import during, metric, window_of
from ..scenario.strict import Strict
from ..wording import listed, short
from . import derived
from .numbers import Quantity, is_finite, is_quantity, si_number, text_of

CELLS = 10_000
"""Of a grid. Chosen: a hundred times the largest of ours."""
OPERATORS = {"above": ">", "at_least": "≥", "below": "<", "at_most": "≤"}
"""Key of a condition -> its sign."""


def alternatives(value: object) -> dict[str, str]:
    """Return the values of one `for` key with their words."""
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


Alternatives = Annotated[dict[str, str], PlainValidator(alternatives)]
Window = Annotated[tuple[float, float], PlainValidator(_window)]
MetricName = Annotated[str, AfterValidator(_metric_name)]
Patterns = Annotated[list[str], Field(min_length=1)]
"""Names of runs, with `*` and `?` for many."""


class MetricSpec(Strict):
    """A number per run."""

    metric: MetricName = Field(description="measure(signal)")
    window: Window | None = Field(None, description="[from, to] in s; left out: the whole run")
    heading: str = Field("", description="Heading of its column; default: the formula")

    def during(self, lead: str = "") -> str:
        """Return the window as the end of a phrase: ", 1 to 6 s", after a `lead` such as "from "."""
        return during(self.window or metric(self.metric).window, lead)


def _single(value: dict[str, dict[str, str]]) -> dict[str, dict[str, str]]:
    if len(value) != 1:
        raise ValueError(f"needs exactly one name with its values (got {len(value)})")
    return value


Axis = Annotated[dict[str, Alternatives], AfterValidator(_single)]
"""The name that stands for a row's or a column's value, and its values."""


class BesideSpec(Strict):
    """A run that stands outside a grid."""

    run: str = Field(min_length=1)
    says: str = Field(description="What the run is", min_length=1)
    published: float | None = Field(None, description="In SI")


class GridSpec(Strict):
    """A metric of many runs in rows and columns, beside what a paper prints."""

    title: str = Field(min_length=1)
    metric: str = ""
    run: str = Field("", description="Names of the runs, with {name} for row and column")
    derived: str = Field(
        "", description="In place of metric and run: keys of `derived`, with {name} for row and column"
    )
    rows: Axis
    columns: Axis
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
            raise ValueError(f"{len(rows) * len(columns)} runs; at most {CELLS} are taken")
        if row == column:
            raise ValueError(f"rows and columns are both called {row!r}")
        if self.published and [len(line) for line in self.published] != [len(columns)] * len(rows):
            raise ValueError(f"published: must have {len(rows)} rows of {len(columns)} numbers")
        return self


class Source(Strict):
    """A metric of a run."""

    run: str
    metric: str


def _expression(text: str) -> str:
    derived.parse(text)
    return text


class DerivedSpec(Strict):
    """A number derived from several runs: an expression of metrics, or a grid's rank correlation."""

    says: str = Field(description="What the number is", min_length=1)
    for_each: dict[str, Alternatives] = Field(
        {}, alias="for", description="Key -> values; one number per combination, named in its key by {key}"
    )
    expression: Annotated[str, AfterValidator(_expression)] | None = None
    of: dict[str, Source] = Field({}, description="Name in the expression -> metric of a run")
    rank_correlation: str | None = Field(None, description="Grid whose order is compared with the paper's")
    only: dict[str, Alternatives] = Field(
        {}, description="Rows or columns of the grid -> those of their values that count"
    )
    unit: str = Field("1", description="Of the expression's value; '%' shows a ratio in per cent")
    published: Quantity | None = Field(None, description="What the paper prints, in SI or with its unit")

    @model_validator(mode="after")
    def _complete(self) -> DerivedSpec:
        if (self.expression is None) == (self.rank_correlation is None):
            raise ValueError("needs exactly one of expression and rank_correlation")
        if self.only and self.rank_correlation is None:
            raise ValueError("only: belongs to a rank_correlation")
        for name in derived.names_in(self.expression) if self.expression else ():
            if name not in self.of:
                raise ValueError(f"expression: {name} stands for nothing; 'of' has {listed(self.of)}")
        if self.published is not None:
            try:
                si_number(self.published, self.unit)
            except ValueError as error:
                raise ValueError(f"published: {error}") from None
        return self


class Reference(Strict):
    """A metric of another run as a bound."""

    run: str
    metric: str
    times: float = 1.0


def _bound(value: object) -> Any:
    if not is_quantity(value):
        raise ValueError("must be a number, a number with its unit ('5 %'), or {run: ..., metric: ...}")
    return value


Bound = Annotated[
    Annotated[float | int | str, PlainValidator(_bound), Tag("number")]
    | Annotated[Reference, Tag("reference")],
    Discriminator(lambda value: "reference" if isinstance(value, (dict, Reference)) else "number"),
]
"""A number in SI, a number with its unit ('5 %'), or another run's metric."""


class Condition(Strict):
    """A comparison of a metric of a run, or of a derived number, with exactly one bound."""

    run: str = Field("", description="Name of a run; with `*` every run that fits; left out: every run")
    metric: str = ""
    derived: str = Field("", description="Key of `derived`, in place of run and metric")
    above: Bound | None = None
    at_least: Bound | None = None
    below: Bound | None = None
    at_most: Bound | None = None

    @model_validator(mode="after")
    def _complete(self) -> Condition:
        if sum(getattr(self, name) is not None for name in OPERATORS) != 1:
            raise ValueError(f"needs exactly one of {listed(OPERATORS, last='or')}")
        if bool(self.derived) == bool(self.metric) or (self.derived and self.run):
            raise ValueError("needs run and metric, or derived in place of both")
        return self

    @property
    def operator(self) -> str:
        """The one operator that is given."""
        return next(name for name in OPERATORS if getattr(self, name) is not None)

    @property
    def bound(self) -> Any:
        """What the metric is compared with."""
        return getattr(self, self.operator)

    def __str__(self) -> str:
        bound = self.bound
        if isinstance(bound, Reference):
            factor = "" if bound.times == 1 else f"{bound.times:g} × "
            bound = factor + (bound.run if bound.metric == self.metric else f"{bound.metric} of {bound.run}")
        of = self.derived or (f"{self.run}: {self.metric}" if self.run else self.metric)
        return f"{of} {OPERATORS[self.operator]} {bound}"


class Judged(Strict):
    """What is said of runs, and the comparisons that decide whether it is so."""

    says: str = Field(description="In words", min_length=1)
    holds_if: list[Condition] = Field(description="All must be true", min_length=1)


class Claim(Judged):
    """What somebody says, and the comparisons that decide whether it holds."""

    for_each: dict[str, Alternatives] = Field(
        {}, alias="for", description="Key -> values; one claim per combination, {key} in its texts"
    )
    short: str = Field("", description="The same for the table of runs, e.g. '> 100 %'")
    source: str = Field("", description="Where it is said: section, figure, table")
    note: str = Field("", description="What a reader should know about the verdict")
    open_values: list[str] | None = Field(
        None, description="Those of the region that it depends on; left out: all that touch its runs"
    )
    _number: int | None = PrivateAttr(None)

    def number(self, otherwise: int) -> int:
        """Return where it stands in the file, for one of many of one entry; else `otherwise`."""
        return otherwise if self._number is None else self._number


class LimitSpec(Judged):
    """The largest value of an axis up to which all conditions hold, for each setting of the others."""

    of: str = Field(description="The axis; its values must be numbers")
