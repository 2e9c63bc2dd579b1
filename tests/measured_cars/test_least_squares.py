"""Estimates where the truth is known: values, intervals that cover, what cannot be identified."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import pytest

from yawbench.measured_cars import single_track
from yawbench.measured_cars.least_squares import (
    NotIdentifiable,
    Parameter,
    Residuals,
    StartFailed,
    Window,
    covariance,
    estimate,
    identifiability,
    intervals_of,
)
from yawbench.measured_cars.single_track import SingleTrack, SingleTrackWindow

TRUTH = {
    "stiffness_front": 95e3, "stiffness_rear": 130e3, "friction_front": 0.95, "friction_rear": 1.0,
    "yaw_inertia": 2700.0, "mass": 1650.0,
}  # fmt: skip
ERRORS = {"yaw_rate": np.radians(0.1), "acceleration_y": 0.05}
RATE = 50.0
RATIO = 16.0
"""Steering ratio."""
LONG = 8.0
"""Duration of the sweep [s]."""


@pytest.fixture(autouse=True)
def _long_steps(monkeypatch):
    """Steps of the integration twice as long: the true car is simulated with the same."""
    monkeypatch.setattr(single_track, "STEP", 0.02)


@dataclass(frozen=True)
class Car:
    """A single track whose mass may be free, and its steering ratio, as its hand wheel is measured.

    Attributes:
        fixed: values in place of those of the truth.
    """

    windows: Sequence[SingleTrackWindow]
    fixed: Mapping[str, float] = field(default_factory=dict)

    def __call__(self, sets: Sequence[Mapping[str, float]]) -> list[list[Any]]:
        alike: dict[tuple[float, float], list[int]] = {}
        for k, values in enumerate(sets):
            car = values.get("mass", TRUTH["mass"]), values.get("steering_ratio", RATIO)
            alike.setdefault(car, []).append(k)
        found: list[Any] = [None] * len(sets)
        for (mass, ratio), places in alike.items():
            windows = [replace(one, steer_angle=RATIO / ratio * one.steer_angle) for one in self.windows]
            whole = [TRUTH | dict(self.fixed) | dict(sets[k]) for k in places]
            for k, signals in zip(places, SingleTrack(windows, mass, 1.3, 1.5)(whole), strict=True):
                found[k] = signals
        return found


def measured(steering: Any, speeds: Sequence[float], duration: float, **measurement: float) -> list[Any]:
    """Return windows measured of the true car without noise, one for each speed."""
    times = np.arange(0.0, duration + 0.5 / RATE, 1.0 / RATE)
    beyond = np.arange(-0.5, duration + 0.5, 1.0 / RATE)
    found = []
    for speed in speeds:
        window = Window(f"{speed:g} m/s", times, {})
        one = SingleTrackWindow(window, beyond, steering(beyond), np.full_like(beyond, speed), (0.0, 0.0))
        ((signals,),) = Car([one])([measurement])
        found.append(replace(one, window=replace(window, measured=signals)))
    return found


def with_noise(windows: Sequence[SingleTrackWindow], errors: Mapping[str, float], seed: int) -> list[Any]:
    chance = np.random.default_rng(seed)
    return [
        replace(one, window=replace(one.window, measured={
            name: x + errors.get(name, 0.0) * chance.standard_normal(len(x))
            for name, x in one.window.measured.items()
        }))
        for one in windows
    ]  # fmt: skip


def off(*names: str, by: float = 1.25) -> list[Parameter]:
    """Return parameters that start off the truth."""
    return [Parameter(one, by * TRUTH[one], 0.3 * TRUTH[one], 3.0 * TRUTH[one]) for one in names]


def offset(name: str, most: float = 0.1) -> Parameter:
    kind: Any = "run" if name.startswith("steer") else "offset"
    return Parameter(name, 0.0, -most, most, kind, name.removeprefix("measured.").removesuffix(".offset"))


def residuals_of(
    windows: Sequence[SingleTrackWindow],
    parameters: Sequence[Parameter],
    errors: Mapping[str, float] = ERRORS,
    *,
    settling: float = 0.0,
    **fixed: float,
) -> Residuals:
    of_car = [one.window for one in windows]
    return Residuals(Car(windows, fixed), of_car, parameters, errors, settling=settling)


def sweep(times: np.ndarray) -> np.ndarray:
    phase = 2.0 * np.pi * (0.1 * times + 0.5 * 2.9 / LONG * times**2)
    return np.where((times > 0) & (times < LONG), np.radians(20.0) / 16.0 * np.sin(phase), 0.0)


def step(times: np.ndarray) -> np.ndarray:
    """Return the steer angle of a step to 2 m/s2 at 27.8 m/s."""
    return np.radians(0.9) * np.clip((times - 1.0) / 0.15, 0.0, 1.0)


def dwell(amplitude: float) -> Any:
    """Return the steering of a sine with dwell: 0.7 Hz, held for 0.5 s at its second peak."""

    def angle(times: np.ndarray) -> np.ndarray:
        since, third = np.clip(times - 0.5, 0.0, None), 0.75 / 0.7
        after = np.where(since < third + 0.5, third, since - 0.5)
        phase = np.minimum(np.where(since < third, since, after), 1.0 / 0.7)
        return np.radians(amplitude) * np.sin(2.0 * np.pi * 0.7 * phase)

    return angle


LINEAR = ("stiffness_front", "stiffness_rear", "yaw_inertia")
PEAKS = ("friction_front", "friction_rear")
POOR = {"yaw_rate": np.radians(0.3), "acceleration_y": 0.2}
"""Noise of poor sensors; that of production sensors is `ERRORS`."""
MANOEUVRES: dict[str, Any] = {
    "sweep": lambda: measured(sweep, [27.8], LONG),
    "two steps": lambda: [*measured(step, [27.8], 5.0), *measured(lambda t: -step(t), [27.8], 5.0)],
    "sine with dwell": lambda: [
        window
        for amplitude in (1.5, 3.0, 5.0, 8.0, -1.5, -3.0, -5.0, -8.0)
        for window in measured(dwell(amplitude), [22.2], 4.0)
    ],
}


@pytest.mark.exhaustive
@pytest.mark.parametrize(
    ("manoeuvre", "names", "noise", "free_ratio", "within"),
    [
        ("two steps", LINEAR, ERRORS, True, 0.03),
        ("sine with dwell", (*LINEAR, *PEAKS), ERRORS, False, 0.002),
        ("two steps", LINEAR, ERRORS, False, 0.02),
        ("sine with dwell", (*LINEAR, *PEAKS), POOR, False, 0.005),
        ("sweep", LINEAR, POOR, False, 0.02),
        ("sweep", LINEAR, ERRORS, True, 0.005),
    ],
)
def test_parameters_are_found_from_noisy_manoeuvres(manoeuvre, names, noise, free_ratio, within, monkeypatch):
    monkeypatch.setitem(globals(), "RATE", 100.0)
    windows = with_noise(MANOEUVRES[manoeuvre](), noise, 0)
    ratio = [Parameter("steering_ratio", 1.1 * RATIO, 10.0, 25.0)] if free_ratio else []
    found = estimate(residuals_of(windows, [*off(*names), *ratio], noise), most_sets=100)
    for name, value in found.values.items():
        assert value == pytest.approx((TRUTH | {"steering_ratio": RATIO})[name], rel=within)


def test_stiffnesses_inertia_and_delay_are_found_from_a_noisy_sweep():
    windows = with_noise(measured(sweep, [27.8], LONG, **{"steer_angle.delay": 0.02}), ERRORS, 1)
    delay = Parameter("steer_angle.delay", 0.0, -0.1, 0.1)
    found = estimate(residuals_of(windows, [*off(*LINEAR), delay]), most_sets=80)
    for name in LINEAR:
        assert found.values[name] == pytest.approx(TRUTH[name], rel=0.005)
    assert found.values["steer_angle.delay"] == pytest.approx(0.02, abs=3e-4)
    assert found.identifiability.condition < 110


def test_without_noise_the_truth_is_found_and_offsets_need_no_simulation():
    windows = measured(sweep, [27.8], LONG)
    plain = estimate(residuals_of(windows, off(*LINEAR)), most_sets=80)
    for name in LINEAR:
        assert plain.values[name] == pytest.approx(TRUTH[name], rel=1e-4)
    zeros = [offset("measured.yaw_rate.offset"), offset("measured.acceleration_y.offset")]
    more = estimate(residuals_of(windows, [*off(*LINEAR), *zeros]), most_sets=80)
    assert more.sets <= plain.sets + 4  # those of the last Jacobian, at most
    assert more.values["measured.yaw_rate.offset"] == pytest.approx(0.0, abs=1e-6)


def test_a_mass_beside_stiffnesses_and_inertia_is_refused_and_all_four_are_named():
    windows = measured(sweep, [27.8], LONG)
    with pytest.raises(NotIdentifiable) as refused:
        estimate(residuals_of(windows, off(*LINEAR, "mass")), most_sets=80)
    assert refused.value.identifiability.condition > 1e4
    assert set(refused.value.identifiability.weakest) == {*LINEAR, "mass"}


def test_a_prior_makes_a_mass_identifiable():
    windows = measured(sweep, [27.8], LONG)
    *others, mass = off(*LINEAR, "mass")
    known = replace(mass, prior=(TRUTH["mass"], 20.0))
    found = estimate(residuals_of(windows, [*others, known]), most_sets=120)
    assert found.values["mass"] == pytest.approx(TRUTH["mass"], rel=0.01)


LINEAR_TYRES = {"friction_front": 1e3, "friction_rear": 1e3}


@pytest.mark.parametrize(("speeds", "refused"), [([27.8], True), ([16.0, 33.0], False)])
def test_zero_points_are_refused_at_one_speed_and_accepted_at_two(speeds, refused):
    names = ("steer_angle.offset", "measured.yaw_rate.offset", "measured.acceleration_y.offset")
    parameters = [*off(*LINEAR), *map(offset, names)]
    windows = measured(sweep, speeds, LONG, **LINEAR_TYRES)
    residuals = residuals_of(windows, parameters, settling=3.0, **LINEAR_TYRES)
    jacobian = residuals.jacobian(np.array([one.start for one in parameters]))
    found = identifiability(jacobian, [one.name for one in parameters])
    assert found.refused == refused
    assert set(found.weakest) == set(names)
    assert refused or found.condition < 20


def test_a_start_that_fails_is_named():
    windows = measured(sweep, [27.8], LONG)
    residuals = residuals_of(windows, off(*LINEAR))
    residuals.model = lambda sets: [[None] for _ in sets]
    with pytest.raises(StartFailed, match="27"):
        estimate(residuals, most_sets=80)


def test_intervals_cover_the_truth_under_correlated_noise():
    """Signals and noise have a correlation time of 0.5 s; 40 s at 50 Hz, two parameters."""
    from scipy.signal import lfilter  # not at the top: it takes long, and few tests need it

    chance = np.random.default_rng(7)
    decay = np.exp(-1.0 / (RATE * 0.5))
    rows = int(40 * RATE)

    def slow(*shape: int) -> np.ndarray:
        white = chance.standard_normal((*shape, rows + 500))
        return lfilter([np.sqrt(1 - decay**2)], [1, -decay], white)[..., 500:]

    jacobian = slow(2).T
    pieces = (np.arange(rows) / (5 * RATE)).astype(int)
    hits = []
    for _ in range(100):
        noise = 0.05 * slow()  # well below 1, where soft_l1 is quadratic
        errors = np.linalg.lstsq(jacobian, noise, rcond=None)[0]
        spread = covariance(noise - jacobian @ errors, jacobian, pieces)
        hits.append(np.abs(errors) <= intervals_of(spread, int(pieces.max()) + 1))
    assert np.mean(hits) >= 0.85  # of intervals that take samples for independent, 0.3


def test_there_are_no_intervals_from_few_pieces():
    assert covariance(np.ones(40), np.ones((40, 1)), np.repeat(np.arange(4), 10)) is None
