"""The standard tests by their names: what evaluates a run, what draws it, what is shown of many."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:  # numpy and all that follows are loaded when a test is evaluated, not when it is named
    from matplotlib.figure import Figure

    from .judgement import Judgement, Series
    from .trace import Trace


@dataclass(frozen=True)
class Evaluated:
    """A run that was evaluated, and what draws it; None if there is nothing to draw."""

    trace: Trace
    judged: Judgement
    draw: Callable[[], Figure] | None = None


@dataclass(frozen=True)
class StandardTest:
    """A test by its name."""

    name: str  # as commands call it
    says: str
    evaluate: Callable[[Trace, float | None], Evaluated]  # of a run; A [rad], where it is known
    columns: tuple[str, ...]  # keys of quantities that stand in a table of many runs
    needs_angle: bool = False
    draw_series: Callable[[Any, str], Figure] | None = None  # of what many runs come to, and a note


def _plain(module: str, function: str) -> Callable[[Trace, float | None], Evaluated]:
    """Return what evaluates a run by a function of a module here, which needs no A and draws nothing."""

    def evaluate(trace: Trace, _: float | None) -> Evaluated:
        return Evaluated(trace, getattr(import_module(f".{module}", __package__), function)(trace))

    return evaluate


def _drawn(module: str, function: str) -> Callable[[Any, str], Figure]:
    """Return what draws a series by a function of a module here."""

    def draw(series: Series, note: str) -> Figure:
        figure: Figure = getattr(import_module(f".{module}", __package__), function)(series, note)
        return figure

    return draw


def _lane_change(trace: Trace, _: float | None) -> Evaluated:
    from .lane_change_run import evaluate_lane_change

    judged = evaluate_lane_change(trace)

    def draw() -> Figure:
        from .lane_change_drawing import draw_lane_change

        return draw_lane_change(trace, judged)

    return Evaluated(trace, judged, draw)


def _dwell(trace: Trace, angle: float | None) -> Evaluated:
    from .dwell_run import evaluate_dwell

    judged, course = evaluate_dwell(trace, angle)
    if course is None:
        return Evaluated(trace, judged)

    def draw() -> Figure:
        from .dwell_drawing import draw_dwell

        return draw_dwell(trace, judged, course)

    return Evaluated(trace, judged, draw)


TESTS: dict[str, StandardTest] = {
    test.name: test
    for test in (
        StandardTest(
            "slowly-increasing-steer",
            "the hand-wheel angle at 0.3 g, from which sine with dwell follows (UN R140, GTR 8)",
            _plain("slow_steer", "evaluate_slow_steer"),
            ("angle", "slope", "spread", "speed"),
        ),
        StandardTest(
            "sine-with-dwell",
            "stability and responsiveness of the regulation on stability control (UN R140, GTR 8, FMVSS 126)",
            _dwell,
            ("amplitude", "ratio_1000", "ratio_1750", "displacement", "sideslip", "speed_end"),
            needs_angle=True,
            draw_series=_drawn("dwell_drawing", "draw_series"),
        ),
        StandardTest(
            "step-steer",
            "gains, response times, overshoots of a step of the hand wheel (after ISO 7401)",
            _plain("step_response", "evaluate_step"),
            ("yaw_rate_gain", "yaw_rate_response", "yaw_rate_overshoot", "acceleration_y_response", "t_beta"),
        ),
        StandardTest(
            "frequency-response",
            "gains and phases over frequency, from a sweep of the hand wheel (after ISO 7401)",
            _plain("frequency_response", "evaluate_sweep"),
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
            _plain("understeer", "evaluate_understeer"),
            ("gradient", "gradient_hand", "characteristic_speed", "gradient_4", "largest"),
        ),
        StandardTest(
            "turn-response",
            "what becomes of a steady turn when the car is braked (after ISO 7975) or lifted off (ISO 9816)",
            _plain("turn_response", "evaluate_turn"),
            ("deceleration", "yaw_ratio", "yaw_ratio_peak", "a_y_ratio", "sideslip", "sideslip_peak"),
        ),
        StandardTest(
            "straight-braking",
            "stopping distance, yaw and correction on split friction (after ISO 14512) or over a jump of it",
            _plain("straight_braking", "evaluate_braking"),
            ("distance", "deceleration", "yaw_rate", "yaw_angle", "deviation", "hand", "adaptation"),
        ),
        StandardTest(
            "side-wind",
            "how far a gust blows a car off its way while the hand wheel is held (after ISO 12021)",
            _plain("side_wind", "evaluate_side_wind"),
            ("deviation", "yaw_angle", "yaw_rate", "acceleration_y", "sideslip"),
        ),
        StandardTest(
            "lane-change",
            "a double lane change between cones, clean or not (ISO 3888)",
            _lane_change,
            ("entry", "exit", "overrun", "sideslip", "acceleration", "hand"),
            draw_series=_drawn("lane_change_drawing", "draw_entry_speeds"),
        ),
    )
}
"""Name -> test, in the order in which they are driven."""
