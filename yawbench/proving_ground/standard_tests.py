"""Standard tests: their registry, and their results, the quantities and verdicts of a run and of a series.

A criterion is passed, failed or not judged, with a reason. A quantity that does not exist in a run is listed
without a number, and a criterion that needs it is not judged, never passed.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import wraps
from pkgutil import resolve_name
from typing import TYPE_CHECKING, Any, Concatenate, Literal, ParamSpec, Protocol

from yawbench.foundation.errors import Diagnostic, Severity
from yawbench.metrics.verdict import NotJudged, Verdict, WithUnit, worst

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from yawbench.fmus.fmu import Value

    from .trace import Trace

P = ParamSpec("P")
Mark = tuple[float, str]
"""An instant [s] and its description."""
Limit = tuple[str, float, str]
"""A signal, a bound in SI units, and its description."""


@dataclass(frozen=True)
class TestQuantity(WithUnit):
    """A quantity of a run, in SI; `percent`: tables show it, a ratio, in per cent.

    >>> gain = yb.load("proving_ground/step_steer").run().evaluate("step-steer").quantities["yaw_rate_gain"]
    >>> gain.name, gain.unit, gain.value > 0
    ('gain of the yaw rate', '1/s', True)
    """

    __test__ = False  # not a pytest class

    name: str
    value: float | None  # None: not defined for this run
    unit: str
    reading: str = ""  # our reading of the standard
    percent: bool = field(default=False, kw_only=True, repr=False)


@dataclass
class Evaluation:
    """The evaluation of one run by a standard test: its quantities and criteria.

        >>> evaluation = run.evaluate("step-steer")
        >>> evaluation.verdict, evaluation.criteria  # the standard has none
        (None, {})

    Attributes:
        label: of the run.
        quantities: key -> quantity.
        criteria: name -> verdict.
        diagnostics: what limits the evaluation, such as why a run is not judged.
    """

    label: str
    quantities: dict[str, TestQuantity] = field(default_factory=dict)  # key -> quantity
    criteria: dict[str, Verdict] = field(default_factory=dict)
    diagnostics: list[Diagnostic] = field(default_factory=list)

    def add(self, key: str, name: str, value: float | None, unit: str, reading: str = "") -> None:
        """Add a quantity."""
        self.quantities[key] = TestQuantity(name, None if value is None else float(value), unit, reading)

    def report(self, code: str, message: str, severity: Severity = "warning") -> None:
        """Add a diagnostic."""
        self.diagnostics.append(Diagnostic(code, message, severity))

    def rule(self, criterion: str, verdict: Verdict) -> None:
        """Add the verdict on a criterion, made by `metrics.verdict.compare` or `not_judged`."""
        self.criteria[criterion] = verdict

    def __getitem__(self, key: str) -> float | None:
        quantity = self.quantities.get(key)
        return quantity.value if quantity else None

    @property
    def verdict(self) -> Verdict | None:
        """The worst verdict of all criteria; None if the test has none."""
        return worst(self.criteria.values())

    @property
    def judges_nothing(self) -> bool:
        """Whether nothing could be judged: no criterion or, in a test without criteria, no quantity."""
        if self.criteria:
            return all(verdict.holds is None for verdict in self.criteria.values())
        return all(quantity.value is None for quantity in self.quantities.values())

    def as_data(self) -> dict[str, Any]:
        """Return the evaluation as plain data for files, in SI units."""
        return {
            "label": self.label,
            "verdict": self.verdict and self.verdict.status,
            "quantities": {
                key: {name: x for name, x in asdict(quantity).items() if name != "percent"}
                for key, quantity in self.quantities.items()
            },
            "criteria": {name: verdict.as_data() for name, verdict in self.criteria.items()},
            "diagnostics": [diagnostic.record() for diagnostic in self.diagnostics],
        }


def evaluation(
    fill: Callable[Concatenate[Evaluation, Trace, P], None],
) -> Callable[Concatenate[Trace, P], Evaluation]:
    """Decorate a function that fills in an `Evaluation` to return it; NotJudged becomes a diagnostic.

    All such functions raise ResultsError if the trace lacks a signal that the test needs.
    """

    @wraps(fill)
    def evaluate(trace: Trace, /, *args: P.args, **kwargs: P.kwargs) -> Evaluation:
        judged = Evaluation(trace.label)
        try:
            fill(judged, replace(trace, judged=True) if trace.gaps else trace, *args, **kwargs)
        except NotJudged as why:
            judged.report("test-not-judged", str(why))
        return judged

    return evaluate


@dataclass
class TestSeries:
    """The evaluation of all runs of a test together."""

    runs: list[Evaluation]  # in their order
    summary: str  # in a sentence
    data: dict[str, Any]  # plain, for files
    criteria: dict[str, Verdict] = field(default_factory=dict)


@dataclass(frozen=True)
class SeriesRun:
    """A run required by a standard test: a variation of its scenario."""

    folder: str  # below that of the series
    label: str
    values: Mapping[str, Value]  # target of an override -> value
    partly: bool = True  # whether it is judged, as far as it goes, if it fails


class SeriesDriver(Protocol):
    """Interface that makes the runs of a series."""

    angle: float | None  # A [rad], of tests that need it
    judged: list[Evaluation]  # of all runs so far

    @property
    def speed(self) -> float:
        """Speed of the scenario [m/s], above 0."""

    @property
    def duration(self) -> float:
        """Duration of the scenario [s]."""

    def make(self, runs: Sequence[SeriesRun]) -> list[Evaluation]:
        """Make runs that have no results yet; return the evaluations of those that can be judged."""

    def search_highest(self, passes: Callable[[float], bool], **bounds: float) -> None:
        """Search the highest value that passes: in a `step` from the `first`, then by halves.

        Args:
            passes: whether a value does.
            bounds: `first`, `step`, `resolution` at the end, `least` and `most`.
        """


@dataclass(frozen=True)
class StandardTest:
    """A standard test; its modules, and NumPy, are imported when first used."""

    name: str  # on the command line
    says: str
    function: str  # "module:function" in this package that evaluates a run
    columns: tuple[str, ...]  # keys of the quantities in tables of several runs
    needs_angle: bool = False  # whether the function takes A
    drawing: str = ""  # "module:name" of functions name_run and name_series, which draw them
    marking: str = ""  # "module:function" that returns the instants and limits of a run
    together: str = ""  # "module:function" that judges several recorded runs as a series
    driving: str = ""  # "module:function" that makes and judges a series of runs
    driven_as: tuple[str, ...] = ()  # names for `yawbench drive`; their scenarios are named alike
    varies: tuple[str, ...] = ()  # override targets that the series sets itself

    def evaluate(self, trace: Trace, angle: float | None = None) -> Evaluation:
        """Evaluate a run; `angle`: A [rad], if known and used by the test."""
        import numpy as np

        with np.errstate(all="ignore"):  # of runs that grow without bound
            judged: Evaluation = _named(self.function)(trace, *([angle] if self.needs_angle else []))
        return judged

    def drive(self, driver: SeriesDriver) -> TestSeries:
        """Make the runs of the test and return their verdict; only for tests that are driven."""
        series: TestSeries = _named(self.driving)(driver)
        return series

    def judge_together(self, runs: Sequence[Evaluation], angle: float | None) -> TestSeries | None:
        """Return the verdict on several recorded runs; None if they do not form a series."""
        series: TestSeries | None = _named(self.together)(runs, angle) if self.together else None
        return series

    def draw(self, trace: Trace, judged: Evaluation) -> Figure | None:
        """Return the figure of a run, None if there is nothing to draw."""
        figure: Figure | None = _named(f"{self.drawing}_run")(trace, judged) if self.drawing else None
        return figure

    def marks(self, judged: Evaluation) -> tuple[list[Mark], list[Limit]]:
        """Return the instants and limits of an evaluated run, to be drawn with its signals."""
        drawn: tuple[list[Mark], list[Limit]] = _named(self.marking)(judged) if self.marking else ([], [])
        return drawn

    def draw_series(self, series: TestSeries, note: str) -> Figure:
        """Return the figure of a series; only for tests with a drawing."""
        figure: Figure = _named(f"{self.drawing}_series")(series, note)
        return figure


def _named(path: str) -> Any:
    return resolve_name(f"{__package__}.{path}")


TestName = Literal[
    "slowly-increasing-steer",
    "sine-with-dwell",
    "step-steer",
    "frequency-response",
    "understeer-gradient",
    "turn-response",
    "straight-braking",
    "side-wind",
    "lane-change",
]
"""Names of the tests, for type checkers and editors."""

TESTS: dict[str, StandardTest] = {
    test.name: test
    for test in (
        StandardTest(
            "slowly-increasing-steer",
            "the hand-wheel angle at 0.3 g, from which sine with dwell follows (UN R140, GTR 8)",
            "steady_state_steering:evaluate_slow_steer",
            ("angle", "slope", "spread", "speed"),
        ),
        StandardTest(
            "sine-with-dwell",
            "stability and responsiveness of the regulation on stability control (UN R140, GTR 8, FMVSS 126)",
            "sine_with_dwell:evaluate_dwell",
            ("amplitude", "ratio_1000", "ratio_1750", "displacement", "sideslip", "speed_end"),
            needs_angle=True,
            drawing="figures:draw_dwell",
            marking="sine_with_dwell:marks_of",
            together="sine_with_dwell:judge_together",
            driving="sine_with_dwell:drive_series",
            driven_as=("sine-with-dwell",),
            varies=("driver.amplitude",),
        ),
        StandardTest(
            "step-steer",
            "gains, response times, overshoots of a step of the hand wheel (after ISO 7401)",
            "steering_response:evaluate_step",
            ("yaw_rate_gain", "yaw_rate_response", "yaw_rate_overshoot", "acceleration_y_response", "t_beta"),
        ),
        StandardTest(
            "frequency-response",
            "gains and phases over frequency, from a sweep of the hand wheel (after ISO 7401)",
            "steering_response:evaluate_sweep",
            (
                "yaw_rate_gain_0.2",
                "yaw_rate_peak",
                "yaw_rate_peak_at",
                "yaw_rate_bandwidth",
                "yaw_rate_phase_1",
            ),
        ),
        StandardTest(
            "understeer-gradient",
            "extra steering per lateral acceleration, of a slow ramp or a constant radius (after ISO 4138)",
            "steady_state_steering:evaluate_understeer",
            ("gradient", "gradient_hand", "characteristic_speed", "gradient_4", "largest"),
        ),
        StandardTest(
            "turn-response",
            "response of a steady turn to braking (after ISO 7975) or lifting off (ISO 9816)",
            "braking_and_wind:evaluate_turn",
            ("deceleration", "yaw_ratio", "yaw_ratio_peak", "a_y_ratio", "sideslip", "sideslip_peak"),
        ),
        StandardTest(
            "straight-braking",
            "stopping distance, yaw and correction on split friction (after ISO 14512) or over a jump of it",
            "braking_and_wind:evaluate_braking",
            ("distance", "deceleration", "yaw_rate", "yaw_angle", "deviation", "hand", "adaptation"),
        ),
        StandardTest(
            "side-wind",
            "deviation of a car in a gust of side wind while the hand wheel is held (after ISO 12021)",
            "braking_and_wind:evaluate_side_wind",
            ("deviation", "yaw_angle", "yaw_rate", "acceleration_y", "sideslip"),
        ),
        StandardTest(
            "lane-change",
            "a double lane change between cones, clean or not (ISO 3888)",
            "double_lane_change:evaluate_lane_change",
            ("entry", "exit", "overrun", "sideslip", "acceleration", "hand"),
            drawing="figures:draw_lane_change",
            driving="double_lane_change:drive_lane_changes",
            driven_as=("iso-3888-1", "iso-3888-2"),
            varies=("speed", "stop_time"),
        ),
    )
}
"""Name -> test, in the order in which they are usually driven."""
DRIVEN = {name: test for test in TESTS.values() for name in test.driven_as}
"""Name for `yawbench drive` -> test."""
