"""The standard tests by their names: what evaluates a run, what draws it, what is shown of many."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:  # numpy and all that follows are loaded when a test is evaluated, not when it is named
    from matplotlib.figure import Figure

    from .judgement import Judgement
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


def _slow_steer(trace: Trace, _: float | None) -> Evaluated:
    from .slow_steer import evaluate_slow_steer

    return Evaluated(trace, evaluate_slow_steer(trace))


def _dwell(trace: Trace, angle: float | None) -> Evaluated:
    from .dwell_run import evaluate_dwell

    judged, course = evaluate_dwell(trace, angle)
    if course is None:
        return Evaluated(trace, judged)

    def draw() -> Figure:
        from .dwell_drawing import draw_dwell

        return draw_dwell(trace, judged, course)

    return Evaluated(trace, judged, draw)


def _step(trace: Trace, _: float | None) -> Evaluated:
    from .step_response import evaluate_step

    return Evaluated(trace, evaluate_step(trace))


def _understeer(trace: Trace, _: float | None) -> Evaluated:
    from .understeer import evaluate_understeer

    return Evaluated(trace, evaluate_understeer(trace))


def _lane_change(trace: Trace, _: float | None) -> Evaluated:
    from .lane_change_run import evaluate_lane_change

    return Evaluated(trace, evaluate_lane_change(trace))


def _turn(trace: Trace, _: float | None) -> Evaluated:
    from .turn_response import evaluate_turn

    return Evaluated(trace, evaluate_turn(trace))


def _sweep(trace: Trace, _: float | None) -> Evaluated:
    from .frequency_response import evaluate_sweep

    return Evaluated(trace, evaluate_sweep(trace))


TESTS: dict[str, StandardTest] = {
    test.name: test
    for test in (
        StandardTest(
            "slowly-increasing-steer",
            "the hand-wheel angle at 0.3 g, from which sine with dwell follows (UN R140, GTR 8)",
            _slow_steer,
            ("angle", "slope", "spread", "speed"),
        ),
        StandardTest(
            "sine-with-dwell",
            "stability and responsiveness of the regulation on stability control (UN R140, GTR 8, FMVSS 126)",
            _dwell,
            ("amplitude", "ratio_1000", "ratio_1750", "displacement", "sideslip", "speed_end"),
            needs_angle=True,
        ),
        StandardTest(
            "step-steer",
            "gains, response times, overshoots of a step of the hand wheel (after ISO 7401)",
            _step,
            ("yaw_rate_gain", "yaw_rate_response", "yaw_rate_overshoot", "acceleration_y_response", "t_beta"),
        ),
        StandardTest(
            "frequency-response",
            "gains and phases over frequency, from a sweep of the hand wheel (after ISO 7401)",
            _sweep,
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
            _understeer,
            ("gradient", "gradient_hand", "characteristic_speed", "gradient_4", "largest"),
        ),
        StandardTest(
            "turn-response",
            "what becomes of a steady turn when the car is braked (after ISO 7975) or lifted off (ISO 9816)",
            _turn,
            ("deceleration", "yaw_ratio", "yaw_ratio_peak", "a_y_ratio", "sideslip", "sideslip_peak"),
        ),
        StandardTest(
            "lane-change",
            "a double lane change between cones, clean or not (ISO 3888)",
            _lane_change,
            ("entry", "exit", "overrun", "sideslip", "acceleration", "hand"),
        ),
    )
}
"""Name -> test, in the order in which they are driven."""
