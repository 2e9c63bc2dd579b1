"""Schema of experiment files: studies, sweeps and tunings, with metrics, claims and figures.

An experiment is a list of runs (a study, for example of a paper), or one scenario varied along axes (a
sweep), or both. A run entry with `for` becomes one run per combination of its values; `{name}` in its texts
is replaced by the value.

    title: What a paper says
    runs:
      - for: {speed: [15, 25], controller: {off: no control, fnn: neural network}}
        name: "{speed}mps/{controller}"
        label: "{controller}"              # legends and tables show the words: "no control"
        row: "{speed} m/s, {controller}"
        scenario: "{speed}mps.yaml"        # relative to this file
        swap: {controller: "controller_{controller}"}
    metrics:
      error: {metric: relative_peak_error(sideslip), window: [1, 6]}
    claims:
      - says: Without control the error exceeds 100 %.
        source: section 3.1
        holds_if:
          - {run: 15mps/off, metric: error, above: 100 %}
          - {run: 15mps/fnn, metric: error, below: {run: 15mps/off, metric: error, times: 0.5}}
    figures:
      - {name: overlay, runs: ["15mps/*"], panels: [sideslip, path]}

Grids show one metric of many runs in rows and columns, next to the paper's numbers; `derived` are
numbers computed from several runs, which claims may refer to (`{derived: gain, at_least: 50 %}`).

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
        published: 30 %                    # by the paper, in SI units or with a unit

A value of a run's `for` may come with overrides, including faults; claims, checks and derived numbers may
have a `for`, too. A grid of derived numbers with `holds` shows down to which row the claims about each
column's cells hold.

    runs:
      - for:
          fault:
            none: nothing is wrong
            frozen: {says: gyro frozen, faults: [{on: sensor.yaw_rate, kind: freeze, from: 1}]}
        name: "{fault}"
        scenario: measured.yaml
    checks:
      - says: The car is held with its {fault}.
        for: {fault: {frozen: gyro frozen}}
        holds_if: [{run: "{fault}", metric: sideslip, at_most: 5 deg}]

A verdict at one point may flip nearby. A region names the values that the paper leaves open, each with a
range; claims are judged again along each of them, and at the points of a Latin hypercube over all together.

    region:
      points: 16
      seed: 1
      open_values:
        amplitude: {vary: driver.amplitude, times: true, from: 0.8, to: 1.2, says: steering amplitude,
                    because: "chosen: the figure can be read to a fifth"}
        tyre: {vary: tyre, values: [tyre_dugoff, tyre_magic_formula], because: "the paper names neither"}
        actuators: {variants: {none: {}, slow: {scenario: "{scenario}_slow.yaml"}}, because: "none is named"}

An open value applies to the runs that have its target and do not override it themselves; with `times` it is a
factor on each run's value. A variant may replace a run's scenario. A claim depends on all open values that
apply to its runs, or on those listed in its `open_values`. Checks are judged over the region if the runs for
the claims suffice. Margin, share, flip and the verdicts are defined in
`docs/regions.md`.

With axes, a limit is how far one of them may go; curves and maps show a metric over one or two of them.

    title: How fast may the car enter the manoeuvre?
    scenario: 25mps.yaml                   # several, [25mps.yaml, 30mps.yaml], are an axis `scenario`
    set: {driver.amplitude: 0.05}          # for all runs; swap, stop_time, ... likewise
    design: grid                           # every combination; list: first with first, second with
    axes:                                  #   second; samples: see below
      friction: {vary: inputs.friction*, from: 0.1, to: 1.0, count: 10}
      speed: {vary: plant.initial_speed, from: 36, to: 144, count: 10, unit: km/h, says: Entry speed}
      control: {vary: controller, values: {controller_off: no control, controller_fnn: neural network}}
      car: {vary: vehicle, values: [../vehicles/small.yaml, ../vehicles/large.yaml]}
    metrics:
      sideslip: {metric: peak(sideslip)}
    limits:
      stable: {says: Largest stable entry speed, of: speed, holds_if: [{metric: sideslip, at_most: 10 deg}]}
    figures:
      - {name: stable, kind: limit, limit: stable, x: friction, lines: control, panels: car}

    keep: limits                           # or all, none: the runs whose results are kept

Targets are written as on the command line: `instance.parameter`, `vehicle.parameter` and `inputs.pattern`
take values, as do `stop_time`, `step_size` and `algorithm`; an instance alone takes FMUs
(`fmu:parameter=value` also sets parameters), `vehicle` takes vehicle files, `tyres` (`tyres.front`,
`tyres.rear`) tyre property files. Several targets may share an axis. Instead of `vary` and `values`,
`variants` override several targets at once:

    control:
      variants:
        no control: {swap: {controller: controller_off}}
        with slip control: {swap: {wheel_control: wheel_control_slip}, set: {driver.amplitude: 0.04}}

A sample draws from axes without listed values: from a range, a normal distribution, which `from` and `to`
truncate, or a table. Every combination of the other axes, laws and scenarios say, has the same points.
`design` is latin_hypercube, sobol, random (independent points) or saltelli (for Sobol indices, with `points`
times the drawn axes and two runs for each combination). Results are means, deviations, percentiles,
probabilities, differences from the first law at the same points, and sensitivities.

    design: sobol
    points: 256                            # a power of two for sobol and saltelli
    seed: 1
    axes:
      friction: {vary: inputs.friction*, from: 0.3, to: 1.0}      # uniform; with spacing: log its logarithm
      mass: {vary: vehicle.mass, normal: {mean: 1500, deviation: 80}, from: 1300, to: 1750}
      speed: {vary: plant.initial_speed, table: [[60, 0], [80, 0.7], [120, 1]], unit: km/h}
      noise: {vary: sensor.seed, from: 1, to: 1000000, whole: true}
      control: {vary: controller, values: {controller_off: no control, controller_fnn: neural network}}
    probabilities:
      held: {says: The car is held, holds_if: [{metric: sideslip, at_most: 10 deg}]}
    figures:
      - {name: sideslip, kind: distribution, metric: sideslip, lines: control}
      - {name: gain, kind: distribution, metric: sideslip, lines: control, against: no control}
      - {name: causes, kind: sensitivity, metric: sideslip, lines: control}

An axis of seeds with `repeats` gives every number as the mean over it, with a confidence interval
(`confidence.interval`); a verdict whose bound lies inside is undecided. `runs` names the runs it applies to.

    axes:
      seed: {vary: sensor.seed, values: [1, 2, 3, 4, 5], runs: ["*/noisy"], repeats: true}

A tuning searches ranges of parameters for several laws, by one objective and one budget: `yawbench tune`.

    tuning:
      objective: cost                      # a derived number, to be minimized
      population: 8                        # trials of a generation
      generations: 8
      seed: 1
      runs: ["*/tuned"]                    # those with the laws; default: all
      laws:
        PD:
          swap: {controller: controller_pid}
          axes:
            gain: {vary: controller.sideslip_proportional_gain, from: 1e4, to: 1e6, spacing: log}
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, ConfigDict, Field, WithJsonSchema, model_validator

from yawbench.figures.plots import OVERVIEW
from yawbench.foundation.messages import listed
from yawbench.orchestrator.scenario.schema import LIKE_SAYS, Scalar
from yawbench.orchestrator.scenario.schema_validation import OneOf, StrictModel, exactly_one
from yawbench.orchestrator.scenario.yaml_lines import KeyPath

from .axes import MOST, SCENARIO, AxisSpec, DesignAxisSpec, OverrideSpec
from .claim_schema import LEVELS as VALUES
from .claim_schema import (
    Alternatives,
    Assertion,
    Claim,
    Condition,
    DerivedKey,
    DerivedSpec,
    GridSpec,
    LimitSpec,
    MetricKey,
    MetricSpec,
    NameOf,
    Patterns,
    QuantityText,
    alternatives,
)
from .open_value_schema import RegionSpec
from .sampling import SAMPLES, runs_of_design


class ChoiceSpec(OverrideSpec):
    """A value of a run's `for`, with its overrides."""

    says: str = Field("", description="Label in texts; default: the value")


def _choices(value: object) -> Any:
    """Normalize the values of a run's `for`: a label alone becomes `{says: label}`."""
    if isinstance(value, dict) and any(isinstance(entry, dict) for entry in value.values()):
        return {str(k): {"says": entry} if isinstance(entry, str) else entry for k, entry in value.items()}
    return {k: {"says": words} for k, words in alternatives(value).items()}


Choices = Annotated[
    dict[str, ChoiceSpec],
    BeforeValidator(_choices, json_schema_input_type=Alternatives | dict[str, str | ChoiceSpec]),
]


class RunSpec(OverrideSpec):
    """A run, or with `for` one run per combination of its values."""

    name: str = Field(description="Name of the run and of its folder, e.g. 25mps/fnn", min_length=1)
    scenario: str = Field(description="Scenario file, relative to this file", min_length=1)
    for_each: dict[str, Choices] = Field(
        {}, alias="for", description="Key -> values: a list, or each with its label, or with its overrides"
    )
    label: str = Field("", description="Label in legends; default: the name")
    row: str = Field("", description="Label in tables; default: the label")


class LawSpec(OverrideSpec):
    """A law to be tuned: its ranges and its overrides."""

    axes: dict[str, AxisSpec] = Field(description="Name -> parameter to tune, from and to", min_length=1)

    @model_validator(mode="after")
    def _ranges(self) -> LawSpec:
        for name, axis in self.axes.items():
            if axis.start is None or axis.count is not None:
                raise ValueError(f"axes.{name}: needs from and to, and no count")
        return self


class TuningSpec(StrictModel):
    """A search for parameters that minimize an objective, with the same budget for all laws."""

    objective: DerivedKey = Field(description="Key of `derived` to minimize")
    population: int = Field(description="Trials of a generation", ge=5)
    generations: int = Field(description="With the first", ge=1)
    seed: int = Field(description="Of the random numbers", ge=0)
    runs: Patterns = Field(["*"], description="Runs with the tuned laws; others are unchanged")
    laws: dict[str, LawSpec] = Field(description="Label -> what is tuned", min_length=1)
    entries: str = Field(
        "", description="Unit that every law swaps; its tuned parameters are written as entries of a ranking"
    )

    @model_validator(mode="after")
    def _of_one_unit(self) -> TuningSpec:
        for name, law in self.laws.items() if self.entries else ():
            sought = [target for axis in law.axes.values() for target in axis.vary]
            other = [target for target in (*law.targets, *sought) if target.instance != self.entries]
            if self.entries not in law.swap or other:
                why = f"also changes {other[0]}" if other else "names no FMU for it"
                raise ValueError(f"entries: an entry is one FMU and its parameters; {name!r} {why}")
        return self


class TableSpec(StrictModel):
    """A table of metrics, one row per run."""

    title: str = ""
    runs: Patterns
    metrics: Annotated[list[str], NameOf("metric")] = Field(
        description="Keys of `metrics`, one column each", min_length=1
    )


@dataclass(frozen=True)
class FigureKind:
    """A kind of figure: the key that it shows, and its drawing function."""

    shows: Literal["runs", "metric", "limit", "grid"]  # the key that it needs
    drawing: str = ""  # "module:class" in this package, an `axis_figures.Drawing`; "": runs are overlaid
    upwards: bool = False  # whether a second axis points upwards (y), in place of lines
    of_sample: bool = False  # whether it is about all points drawn, and so has no x

    @property
    def over_axes(self) -> bool:
        """Whether it is drawn over axes of the experiment."""
        return self.shows in ("metric", "limit")

    @property
    def needs(self) -> tuple[str, ...]:
        """The keys that such a figure must have."""
        of_runs = ("panels",) if self.shows == "runs" else ()
        return (
            self.shows, *of_runs, *("x",) * (self.over_axes and not self.of_sample), *("y",) * self.upwards
        )  # fmt: skip

    @property
    def takes(self) -> tuple[str, ...]:
        """The keys that such a figure may have besides."""
        of_axes: tuple[str, ...] = ()
        if self.over_axes:
            of_axes = ("only", "panels", *("lines",) * (not self.upwards))
        of_axes += ("against",) * self.of_sample
        of_scale = () if self.shows == "runs" else ("scale", "largest", *("mark",) * (self.shows != "limit"))
        return (*of_axes, *of_scale)


FIGURE_KINDS = {
    "overlay": FigureKind("runs"),
    "curve": FigureKind("metric", "axis_figures:CurveDrawing"),
    "map": FigureKind("metric", "axis_figures:MapDrawing", upwards=True),
    "limit": FigureKind("limit", "axis_figures:LimitDrawing"),
    "grid": FigureKind("grid", "axis_figures:GridDrawing"),
    "distribution": FigureKind("metric", "sample_figures:DistributionDrawing", of_sample=True),
    "sensitivity": FigureKind("metric", "sample_figures:SensitivityDrawing", of_sample=True),
}
"""Name -> kind of figure."""
ShownAxis = Annotated[str, NameOf("axis or run")]
Chosen = Annotated[
    list[Scalar],
    BeforeValidator(
        lambda value: value if isinstance(value, list) else [value],
        json_schema_input_type=list[Scalar] | Scalar,
    ),
    Field(min_length=1),
]


class FigureSpec(StrictModel):
    """A figure: overlaid runs, a metric or a limit over one or two axes, or a grid."""

    name: str = Field(description="Name of its files", pattern=r"^[\w.+-]+$")
    title: str = ""
    kind: Annotated[str, OneOf(FIGURE_KINDS)] = Field("overlay", description=listed(FIGURE_KINDS, last="or"))
    runs: Annotated[list[str], NameOf("runs")] = Field(
        [], description="Of an overlay: names of runs, with `*` and `?` for many"
    )
    panels: list[str] | str = Field(
        list(OVERVIEW),
        description="Of an overlay, in order: a signal, its error (`x_error`), one over another (`y(x)`) or "
        "`path`; of others: axis with a panel per value",
    )
    metric: MetricKey = Field("", description="Key of `metrics`, for curves and maps")
    limit: Annotated[str, NameOf("limit")] = Field("", description="Key of `limits`, for a limit")
    grid: Annotated[str, NameOf("grid")] = Field(
        "", description="Key of `grids`, for a line (with `holds`) or markers per column over the rows"
    )
    x: ShownAxis = Field("", description="Horizontal axis")
    y: ShownAxis = Field("", description="Vertical axis, of a map")
    lines: ShownAxis = Field("", description="Axis with a line per value, of curves and limits")
    against: str = Field(
        "", description="Of a distribution: value of `lines`, whose number at the same point is subtracted"
    )
    only: Annotated[dict[str, Chosen], NameOf("axis")] = Field(
        {}, description="Axis -> that of its values, or those, which are drawn"
    )
    scale: Literal["linear", "log"] = Field("linear", description="Of the metric")
    largest: QuantityText | None = Field(None, description="Upper end of the metric's scale")
    mark: QuantityText | None = Field(None, description="A value of the metric to draw a line at")

    @property
    def what(self) -> FigureKind:
        """The kind."""
        return FIGURE_KINDS[self.kind]

    @property
    def panel_axis(self) -> str:
        """The axis with one panel per value; "" if there is none."""
        return self.panels if isinstance(self.panels, str) else ""

    @property
    def axes(self) -> dict[str, str]:
        """Key -> axis, of the axes used."""
        axes = {"x": self.x, "y": self.y, "lines": self.lines, "panels": self.panel_axis}
        return {key: axis for key, axis in axes.items() if axis}

    @model_validator(mode="after")
    def _complete(self) -> FigureSpec:
        what, a_figure = self.what, f"a{'n' * (self.kind[0] in 'aeiou')} {self.kind}"
        missing = [key for key in what.needs if not getattr(self, key)]
        extra = self.model_fields_set - {"name", "title", "kind", *what.needs, *what.takes}
        if missing or extra:
            raise ValueError(f"{a_figure} {f'needs {missing[0]}' if missing else f'has no {min(extra)}'}")
        if "panels" in self.model_fields_set and bool(self.panel_axis) != what.over_axes:
            panels = "those of one axis" if what.over_axes else "listed"
            raise ValueError(f"panels: of {a_figure} are {panels}")
        if len(set(self.axes.values())) < len(self.axes):
            raise ValueError("x, y, lines and panels must be different axes")
        return self


class ExperimentSpec(OverrideSpec):
    """An experiment file: a study, a sweep or a tuning."""

    model_config = ConfigDict(json_schema_extra=exactly_one("scenario", "runs"))

    like: str = Field("", description=LIKE_SAYS, min_length=1)
    title: str = Field(min_length=1)
    source: str = Field(
        "", description="The paper, with all that is needed to find it, or whose question it is"
    )
    scenario: Annotated[str, WithJsonSchema({"anyOf": [{"type": "string"}, *VALUES["anyOf"]]})] = Field(
        "", description="Scenario of the only run, relative to this file; several are an axis `scenario`"
    )
    runs: list[RunSpec] = Field([], description="In place of a scenario")
    axes: dict[str, DesignAxisSpec] = Field({}, description="Name -> what varies")
    design: Literal["grid", "list", "latin_hypercube", "sobol", "random", "saltelli"] = Field(
        "grid", description="Which points of the axes; the last four draw a sample"
    )
    points: int | None = Field(None, ge=1, le=MOST, description="Of a sample: how many are drawn")
    seed: int | None = Field(None, ge=0, description="Of a sample")
    metrics: dict[str, MetricSpec] = {}
    tables: list[TableSpec] = []
    grids: dict[str, GridSpec] = {}
    derived: dict[str, DerivedSpec] = {}
    claims: list[Claim] = Field([], description="Claims of the paper")
    checks: list[Claim] = Field([], description="Checks of this project on its results")
    region: RegionSpec | None = Field(None, description="Open values over which claims are judged again")
    limits: dict[str, LimitSpec] = {}
    probabilities: dict[str, Assertion] = Field(
        {}, description="Name -> conditions, of which a sample tells how probable it is that all hold"
    )
    figures: list[FigureSpec] = []
    keep: Literal["limits", "all", "none"] = Field(
        "limits",
        description="Runs along axes whose results are kept, for the page to show: `limits` are the last run "
        "within each limit, the first beyond it, and those that failed",
    )
    tuning: TuningSpec | None = Field(None, description="What `yawbench tune` tunes")

    @model_validator(mode="before")
    @classmethod
    def _scenarios(cls, data: Any) -> Any:
        """Make an axis of several scenarios."""
        several = data.get("scenario") if isinstance(data, dict) else None
        if not isinstance(several, (dict, list)):
            return data
        files = alternatives(several)
        axes = data.get("axes") or {}
        if not isinstance(axes, dict) or SCENARIO in axes:
            raise ValueError(f"scenario: several are an axis {SCENARIO!r}, which there is already")
        if len({*files.values()}) < len(files) or len(files) < 2:
            raise ValueError("scenario: names two or more, each with its own words")
        variants = {words: {"scenario": file} for file, words in files.items()}
        return {**data, "scenario": next(iter(files)), "axes": {SCENARIO: {"variants": variants}, **axes}}

    @model_validator(mode="after")
    def _consistent(self) -> ExperimentSpec:
        if bool(self.scenario) == bool(self.runs):
            raise ValueError("needs either a scenario or runs")
        if self.scenario and not self.axes and not self.tuning:
            raise ValueError("a single run needs axes")
        if self.region and self.axes:
            raise ValueError("region: runs along axes have none; it is for named runs at one point")
        if self.tuning and (self.axes or self.region):
            raise ValueError("tuning has axes of its own, law by law, and no region")
        if self.sampled:
            self._check_sample()
        elif self.points is not None or self.seed is not None:
            raise ValueError(
                f"points and seed belong to a design that draws: add `design: sobol`, or "
                f"{listed([one for one in SAMPLES if one != 'sobol'], last='or')} (it is {self.design})"
            )
        elif self.probabilities:
            raise ValueError(f"probabilities need a design that draws: {listed(SAMPLES, last='or')}")
        else:
            self._check_lengths()
        if self.repeats and self.design != "grid":
            raise ValueError(f"axes.{self.repeats[0]}: repeats need a grid")
        number = self.number_of_points() * max(1, len(self.runs))
        if number > MOST:
            raise ValueError(f"{number} runs; at most {MOST} are allowed")
        return self

    def assertions(self) -> Iterator[tuple[str, int, Claim]]:
        """Yield every claim and check as (group, index in the file, claim)."""
        for group, claims in (("claims", self.claims), ("checks", self.checks)):
            for i, claim in enumerate(claims):
                yield group, claim.number(i), claim

    def conditions(self) -> Iterator[tuple[KeyPath, Condition]]:
        """Yield every condition of claims, checks and limits, with its key in the file."""
        judged: list[tuple[str, str | int, Assertion]] = [*self.assertions()]
        judged += [("limits", name, limit) for name, limit in self.limits.items()]
        judged += [("probabilities", name, one) for name, one in self.probabilities.items()]
        for group, which, assertion in judged:
            for k, condition in enumerate(assertion.holds_if):
                yield (group, which, "holds_if", k), condition

    @property
    def repeats(self) -> list[str]:
        """The axes with `repeats`."""
        return [name for name, axis in self.axes.items() if axis.repeats]

    @property
    def sampled(self) -> bool:
        """Whether the design draws points."""
        return self.design in SAMPLES

    @property
    def drawn(self) -> list[str]:
        """The axes that are drawn, if the design draws."""
        return [name for name, axis in self.axes.items() if axis.drawn] if self.sampled else []

    def number_of_points(self) -> int:
        """Return the number of points of the design."""
        if self.sampled:
            listed_ones = [axis.length or 0 for axis in self.axes.values() if not axis.drawn]
            return math.prod(listed_ones) * runs_of_design(self.design, len(self.drawn), self.points or 0)
        lengths = [axis.length or 0 for axis in self.axes.values()]
        return max(lengths, default=1) if self.design == "list" else math.prod(lengths)

    def _check_sample(self) -> None:
        if self.points is None or self.seed is None:
            lacking = [name for name in ("points", "seed") if getattr(self, name) is None]
            raise ValueError(f"the design {self.design} needs {listed(lacking, last='and')}")
        if not self.drawn:
            raise ValueError(f"a {self.design} needs an axis to draw from: a range, normal or table")
        if self.design in ("sobol", "saltelli") and self.points & (self.points - 1):
            lower = 1 << (self.points.bit_length() - 1)
            raise ValueError(
                f"points: of a Sobol sequence are a power of two, {lower} or {2 * lower} (got {self.points})"
            )

    def _check_lengths(self) -> None:
        lengths = {name: axis.length for name, axis in self.axes.items()}
        for name, length in lengths.items():
            if length is None:
                other = f", or a design that draws: {listed(SAMPLES, last='or')}"
                raise ValueError(f"axes.{name}: needs count{other}")
        if self.design == "list" and len(set(lengths.values())) > 1:
            counted = ", ".join(f"{name} has {n}" for name, n in lengths.items())
            raise ValueError(f"axes of a list must have the same number of values ({counted})")
