"""The registry of standard tests: by name, the functions that evaluate and draw each of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pkgutil import resolve_name
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from .judgement import Evaluation, SeriesDriver, TestSeries
    from .trace import Trace


@dataclass(frozen=True)
class StandardTest:
    """A standard test. Its modules, and NumPy with them, are imported only when they are used."""

    name: str  # on the command line
    says: str
    function: str  # "module:function" in this package that evaluates a run
    columns: tuple[str, ...]  # keys of the quantities in tables of several runs
    needs_angle: bool = False  # whether the function takes A
    drawing: str = ""  # module in this package with `draw_run` and `draw_series`
    together: str = ""  # "module:function" that judges several recorded runs as a series
    driving: str = ""  # "module:function" that makes and judges a series of runs
    driven_as: tuple[str, ...] = ()  # names for `yawbench drive`; their scenarios are named alike
    varies: tuple[str, ...] = ()  # override targets that the series sets itself

    def evaluate(self, trace: Trace, angle: float | None = None) -> Evaluation:
        """Return the evaluation of a run; `angle`: A [rad], if it is known and the test uses it."""
        judged: Evaluation = _named(self.function)(trace, *([angle] if self.needs_angle else []))
        return judged

    def drive(self, driver: SeriesDriver) -> TestSeries:
        """Make the runs of the test and return their verdict; only for tests that are driven."""
        series: TestSeries = _named(self.driving)(driver)
        return series

    def judge_together(self, runs: Sequence[Evaluation], angle: float | None) -> TestSeries | None:
        """Return the verdict on several recorded runs together, None if they form no series."""
        series: TestSeries | None = _named(self.together)(runs, angle) if self.together else None
        return series

    def draw(self, trace: Trace, judged: Evaluation) -> Figure | None:
        """Return the figure of a run, None if there is nothing to draw."""
        figure: Figure | None = _named(f"{self.drawing}:draw_run")(trace, judged) if self.drawing else None
        return figure

    def draw_series(self, series: TestSeries, note: str) -> Figure:
        """Return the figure of a series; only for tests with a drawing module."""
        figure: Figure = _named(f"{self.drawing}:draw_series")(series, note)
        return figure


def _named(place: str) -> Any:
    return resolve_name(f"{__package__}.{place}")


TESTS: dict[str, StandardTest] = {
    test.name: test
    for test in (
        StandardTest(
            "slowly-increasing-steer",
            "the hand-wheel angle at 0.3 g, from which sine with dwell follows (UN R140, GTR 8)",
            "steering_tests:evaluate_slow_steer",
            ("angle", "slope", "spread", "speed"),
        ),
        StandardTest(
            "sine-with-dwell",
            "stability and responsiveness of the regulation on stability control (UN R140, GTR 8, FMVSS 126)",
            "sine_with_dwell:evaluate_dwell",
            ("amplitude", "ratio_1000", "ratio_1750", "displacement", "sideslip", "speed_end"),
            needs_angle=True,
            drawing="sine_with_dwell_figures",
            together="sine_with_dwell:judge_together",
            driving="sine_with_dwell:drive_series",
            driven_as=("sine-with-dwell",),
            varies=("driver.amplitude",),
        ),
        StandardTest(
            "step-steer",
            "gains, response times, overshoots of a step of the hand wheel (after ISO 7401)",
            "steering_tests:evaluate_step",
            ("yaw_rate_gain", "yaw_rate_response", "yaw_rate_overshoot", "acceleration_y_response", "t_beta"),
        ),
        StandardTest(
            "frequency-response",
            "gains and phases over frequency, from a sweep of the hand wheel (after ISO 7401)",
            "steering_tests:evaluate_sweep",
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
            "steering_tests:evaluate_understeer",
            ("gradient", "gradient_hand", "characteristic_speed", "gradient_4", "largest"),
        ),
        StandardTest(
            "turn-response",
            "what becomes of a steady turn when the car is braked (after ISO 7975) or lifted off (ISO 9816)",
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
            "how far a gust blows a car off its way while the hand wheel is held (after ISO 12021)",
            "braking_and_wind:evaluate_side_wind",
            ("deviation", "yaw_angle", "yaw_rate", "acceleration_y", "sideslip"),
        ),
        StandardTest(
            "lane-change",
            "a double lane change between cones, clean or not (ISO 3888)",
            "lane_change:evaluate_lane_change",
            ("entry", "exit", "overrun", "sideslip", "acceleration", "hand"),
            drawing="lane_change",
            driving="lane_change:drive_series",
            driven_as=("iso-3888-1", "iso-3888-2"),
            varies=("speed", "stop_time"),
        ),
    )
}
"""Name -> test, in the order in which they are usually driven."""
DRIVEN = {name: test for test in TESTS.values() for name in test.driven_as}
"""Name for `yawbench drive` -> test."""
