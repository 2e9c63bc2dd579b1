"""The schema of study files: runs, metrics, tables, claims of a paper, figures; every key, strictly.

A run entry with `for` stands for one run per combination; `{name}` in its texts is then the value.

    runs:
      - for: {speed: [15, 25], controller: {off: no control, fnn: neural network}}
        name: "{speed}mps/{controller}"
        label: "{controller}"              # in legends and tables the words: "no control"
        row: "{speed} m/s, {controller}"
        scenario: "{speed}mps.yaml"        # relative to the study file
        swap: {controller: "controller_{controller}"}
    metrics:
      error: {metric: relative_peak_error(sideslip), window: [1, 6]}
    claims:
      - says: Without control the error exceeds 100 %.
        source: section 3.1
        holds_if:
          - {run: 15mps/off, metric: error, above: 100 %}
          - {run: 15mps/fnn, metric: error, below: {run: 15mps/off, metric: error, times: 0.5}}

Grids put one metric of many runs into rows and columns, beside what the paper prints; `derived` are
numbers computed from several runs, which claims may speak of (`{derived: gain, at_least: 50 %}`).

    grids:
      shares:
        title: Mean error, rows front share left, columns front share right
        metric: error
        run: "shares/{left}_{right}"
        rows: {left: [0, 0.5]}
        columns: {right: [0, 0.5]}
        published: [[0.3966, 0.1576], [0.1312, 0.0069]]
    derived:
      order: {says: Rank correlation with table 3, rank_correlation: shares}
      gain:
        says: Share of the error that learning removes
        expression: (frozen - learning) / frozen
        of: {frozen: {run: frozen, metric: error}, learning: {run: learning, metric: error}}
        unit: "%"
        published: 30 %                    # what the paper prints, in SI or with a unit
"""

from __future__ import annotations

import math
import re
from typing import Annotated, Any

from pydantic import AfterValidator, Discriminator, Field, PlainValidator, Tag, model_validator

from ..errors import ScenarioError
from ..figures.plots import OVERVIEW
from ..metrics.run_metrics import during, metric, window_of
from ..plan import Algorithm
from ..scenario.quantities import convert
from ..scenario.schema import Scalar, Time
from ..scenario.strict import Strict
from ..wording import listed, short
from . import derived

CELLS = 10_000
"""Of a grid. Chosen: as many as a study has runs."""

OPERATORS = ("above", "at_least", "below", "at_most")


def _alternatives(value: object) -> dict[str, str]:
    """Return the values of one `for` key with their words."""
    if isinstance(value, list) and value and all(isinstance(v, (str, int, float)) for v in value):
        return {text_of(v): text_of(v) for v in value}
    if isinstance(value, dict) and value and all(isinstance(v, str) for v in value.values()):
        return {str(k): v for k, v in value.items()}
    raise ValueError("must be a list of values, or a mapping of values to words")


def text_of(value: object) -> str:
    """Return a plain value as a YAML file would have it."""
    return str(value).lower() if isinstance(value, bool) else str(value)


def _is_finite(value: object) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value)


def _window(value: object) -> tuple[float, float]:
    if isinstance(value, str):
        return window_of(value)
    numbers = isinstance(value, list) and len(value) == 2 and all(map(_is_finite, value))
    if not numbers or not value[0] < value[1]:  # type: ignore[index]
        raise ValueError(f"must be [from, to] in s, from before to, or 1 s to 3 s (got {short(value)})")
    return float(value[0]), float(value[1])  # type: ignore[index]


def _metric_name(name: str) -> str:
    try:
        return metric(name).name
    except ScenarioError as error:
        raise ValueError(str(error)) from None


Alternatives = Annotated[dict[str, str], PlainValidator(_alternatives)]
Window = Annotated[tuple[float, float], PlainValidator(_window)]
MetricName = Annotated[str, AfterValidator(_metric_name)]
Patterns = Annotated[list[str], Field(min_length=1)]
"""Names of runs, with `*` and `?` for many."""


class RunSpec(Strict):
    """One run, or with `for` one per combination."""

    name: str = Field(description="Name of the run and of its folder, e.g. 25mps/fnn", min_length=1)
    scenario: str = Field(description="Scenario file, relative to the study file", min_length=1)
    for_each: dict[str, Alternatives] = Field({}, alias="for", description="Key -> values")
    label: str = Field("", description="What legends call it; default: the name")
    row: str = Field("", description="What tables call it; default: the label")
    swap: dict[str, str] = Field({}, description="Unit -> FMU, a name or a path")
    set: dict[str, Scalar] = Field({}, description="unit.parameter -> value")
    stop_time: Time | None = Field(None, description="In place of the scenario's")
    step_size: Time | None = Field(None, description="In place of the scenario's")
    algorithm: Algorithm | None = Field(None, description="In place of the scenario's")


class MetricSpec(Strict):
    """A number per run."""

    metric: MetricName = Field(description="measure(signal)")
    window: Window | None = Field(None, description="[from, to] in s; left out: the whole run")
    heading: str = Field("", description="Heading of its column; default: the formula")

    def during(self, lead: str = "") -> str:
        """Return the window as the end of a phrase: ", 1 to 6 s", after a `lead` such as "from "."""
        return during(self.window or metric(self.metric).window, lead)


class TableSpec(Strict):
    """A table of metrics, one row per run."""

    title: str = ""
    runs: Patterns
    metrics: list[str] = Field(description="Keys of `metrics`, one column each", min_length=1)


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
    metric: str
    run: str = Field(description="Names of the runs, with {name} for row and column", min_length=1)
    rows: Axis
    columns: Axis
    corner: str = Field("", description="Heading of the column of rows")
    published: list[list[float]] | None = Field(None, description="In SI, row by row")
    beside: list[BesideSpec] = Field([], description="Runs outside the grid")

    @model_validator(mode="after")
    def _shape(self) -> GridSpec:
        ((row, rows),), ((column, columns),) = self.rows.items(), self.columns.items()
        for name in (row, column):
            if f"{{{name}}}" not in self.run:
                raise ValueError(f"run: {self.run!r} does not depend on {{{name}}}")
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


def _is_number(value: object) -> bool:
    if isinstance(value, str):
        return re.match(r"\s*[+-]?\.?\d", value) is not None
    return _is_finite(value)


def _number(value: object) -> float | str:
    """Return a number in SI, or text that begins with one."""
    if not _is_number(value):
        raise ValueError("must be a number, a number with its unit ('5 %'), or {run: ..., metric: ...}")
    return value  # type: ignore[return-value]


def _printed(value: object) -> float | str:
    if not _is_number(value):
        raise ValueError(f"must be a number, or a number with its unit ('5 %') (got {short(value)})")
    return value  # type: ignore[return-value]


def si_number(bound: float | str, unit: str) -> float:
    """Return a number in SI, given as such or as text with its unit; `%` stands for a ratio.

    Raises:
        ValueError: a sentence that says what the text should have been.
    """
    return float(convert(bound, "1" if unit == "%" else unit) if isinstance(bound, str) else bound)


def _expression(text: str) -> str:
    derived.parse(text)
    return text


class DerivedSpec(Strict):
    """A number derived from several runs: an expression of metrics, or a grid's rank correlation."""

    says: str = Field(description="What the number is", min_length=1)
    expression: Annotated[str, AfterValidator(_expression)] | None = None
    of: dict[str, Source] = Field({}, description="Name in the expression -> metric of a run")
    rank_correlation: str | None = Field(None, description="Grid whose order is compared with the paper's")
    unit: str = Field("1", description="Of the expression's value; '%' shows a ratio in per cent")
    published: Annotated[float | str, PlainValidator(_printed)] | None = Field(
        None, description="What the paper prints, in SI or with its unit"
    )

    @model_validator(mode="after")
    def _complete(self) -> DerivedSpec:
        if (self.expression is None) == (self.rank_correlation is None):
            raise ValueError("needs exactly one of expression and rank_correlation")
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


Bound = Annotated[
    Annotated[float | str, PlainValidator(_number), Tag("number")] | Annotated[Reference, Tag("reference")],
    Discriminator(lambda value: "reference" if isinstance(value, (dict, Reference)) else "number"),
]
"""A number in SI, a number with its unit ('5 %'), or another run's metric."""


class Condition(Strict):
    """A comparison of a metric of a run, or of a derived number, with exactly one bound."""

    run: str = Field("", description="Name of a run; with `*` every run that fits")
    metric: str = ""
    derived: str = Field("", description="Key of `derived`, in place of run and metric")
    above: Bound | None = None
    at_least: Bound | None = None
    below: Bound | None = None
    at_most: Bound | None = None

    @property
    def operator(self) -> str:
        """The one operator that is given."""
        return next(name for name in OPERATORS if getattr(self, name) is not None)

    @property
    def bound(self) -> Any:
        """What the metric is compared with."""
        return getattr(self, self.operator)


class Claim(Strict):
    """What somebody says, and the comparisons that decide whether it holds."""

    says: str = Field(description="The claim in words", min_length=1)
    short: str = Field("", description="The same for the table of runs, e.g. '> 100 %'")
    source: str = Field("", description="Where it is said: section, figure, table")
    holds_if: list[Condition] = Field(description="All must be true", min_length=1)
    note: str = Field("", description="What a reader should know about the verdict")


class FigureSpec(Strict):
    """A figure of several runs laid over each other."""

    name: str = Field(description="Name of its files", pattern=r"^[\w.+-]+$")
    title: str = ""
    runs: Patterns
    panels: list[str] = Field(
        list(OVERVIEW),
        description="In order: a signal, its error (`x_error`), one over another (`y(x)`) or `path`",
        min_length=1,
    )


class StudySpec(Strict):
    """A study file."""

    title: str = Field(min_length=1)
    source: str = Field("", description="The paper, with all that is needed to find it")
    runs: list[RunSpec] = Field(min_length=1)
    metrics: dict[str, MetricSpec] = Field(min_length=1)
    tables: list[TableSpec] = []
    grids: dict[str, GridSpec] = {}
    derived: dict[str, DerivedSpec] = {}
    claims: list[Claim] = Field([], description="What the paper says")
    checks: list[Claim] = Field([], description="What this project asks of its own results")
    figures: list[FigureSpec] = []
