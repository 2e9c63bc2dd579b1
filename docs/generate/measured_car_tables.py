"""Tables on the measured car.

They come from windows.csv and laps_of_estimators.csv in notebooks/ferrari_250_lm, which `convert.py --run`
there writes from a public recording.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from scipy.special import stdtr, stdtrit

from yawbench.foundation.messages import listed
from yawbench.studies.confidence import TAIL, interval, jackknife
from yawbench.studies.pair_comparisons import holm
from yawbench.studies.tables import Table

from .published import markdown, pages_with, rows_in, wrapped

ROOT = Path(__file__).resolve().parents[2]
FOLDER = ROOT / "notebooks" / "ferrari_250_lm"
LAPS, WINDOWS = FOLDER / "laps_of_estimators.csv", FOLDER / "windows.csv"
PAGE, ESTIMATORS_PAGE, LIMITS_PAGE = (
    ROOT / "docs" / f"{n}.md" for n in ("measured_cars", "estimators", "limits")
)
ZERO, OBSERVER, KINEMATIC = "constant zero", "observer", "kinematic"
CAR, SINGLE_TRACK = "Seven degrees of freedom, tyres of Dugoff", "single track with Fiala tyres"
SIGNALS = {"yaw_rate": "yaw rate", "acceleration_y": "lateral acceleration", "sideslip": "sideslip"}
"""Compared signals -> words."""


def laps() -> dict[str, dict[str, float]]:
    """Return case -> rms of the sideslip error of each lap, of all and of the worst second [deg]."""
    return {
        row["case"]: {key: float(value) for key, value in row.items() if key != "case"}
        for row in rows_in(LAPS)
    }


def of_laps(case: Mapping[str, float]) -> list[float]:
    """Return the rms of each whole lap [deg]."""
    return [value for key, value in case.items() if key.startswith("lap ")]


def windows() -> dict[tuple[str, str], np.ndarray]:
    """Return model and signal -> rms differences in the held-out windows [SI]."""
    found: dict[tuple[str, str], list[float]] = {}
    for row in rows_in(WINDOWS):
        found.setdefault((row["model"], row["signal"]), []).append(float(row["rms"]))
    return {key: np.array(rms) for key, rms in found.items()}


def rms_of(rms: np.ndarray) -> float:
    """Return the rms over windows of equal length."""
    return math.sqrt(float(np.mean(rms**2)))


def ratios() -> dict[str, tuple[float, float, float, float]]:
    """Return signal -> rms over that of the single track, bounds, and probability if neither is better.

    On held-out windows; by the jackknife of the ratio's logarithm over pairs of windows.
    """
    held = windows()
    found = {}
    for signal in SIGNALS:
        own, other = held[CAR, signal] ** 2, held[SINGLE_TRACK, signal] ** 2

        def statistic(chosen: np.ndarray, own: np.ndarray = own, other: np.ndarray = other) -> np.ndarray:
            return np.array([0.5 * math.log(own[chosen].sum() / other[chosen].sum())])

        (value,), (half,) = jackknife(statistic, own.size)
        student = value / half * stdtrit(own.size - 1, 1.0 - TAIL)
        probability = 2.0 * float(stdtr(own.size - 1, -abs(student)))
        found[signal] = math.exp(value), math.exp(value - half), math.exp(value + half), probability
    return found


def fit_sentences() -> str:
    """Return how much better the car is than the single track on held-out windows."""
    found = ratios()
    told = [
        f"{value:.2f} ({low:.2f} to {high:.2f}) in {SIGNALS[signal]}"
        for signal, (value, low, high, _) in found.items()
    ]
    corrected = dict(zip(found, holm([p for *_, p in found.values()]), strict=True))
    clear = listed([SIGNALS[signal] for signal, p in corrected.items() if p < 2.0 * TAIL], last="and")
    number = windows()[CAR, "yaw_rate"].size
    return (
        f"On the {number} held-out windows the rms differences of the car with Dugoff's tyres are "
        f"{listed(told, last='and')} of those of the single track (95 %, jackknife over the pairs of "
        f"windows, which holds the truth in 92 to 95 % of simulations). Corrected for "
        f"three comparisons it is clearly better in {clear or 'none of them'}. "
        "The windows are of one lap: they tell of its bends, and of no other track."
    )


def estimators_table() -> Table:
    """Return the errors of the sideslip: over all, by laps, against no estimator, in the worst second."""
    found = laps()
    rows = []
    for case, errors in found.items():
        each = of_laps(errors)
        mean = interval(each)
        assert mean
        share = [own / zero for own, zero in zip(each, of_laps(found[ZERO]), strict=True)]
        shares = "-" if case == ZERO else f"{min(share):.2f} to {max(share):.2f}"
        rows.append([
            case, f"{errors['all']:.2f}°", f"{mean.mean:.2f}° ± {mean.half:.2f}°", shares,
            f"{errors['worst second']:.1f}°",
        ])  # fmt: skip
    note = (
        f"Lap: mean of the rms of {len(of_laps(found[ZERO]))} laps, with Student's 95 % interval, for "
        "further laps of this car on this track (93 to 95 % in simulations). Errors follow the "
        "bends, which every lap repeats, so they "
        "tell nothing of another track."
    )
    headings = ["", "rms, 550 s", "rms of a lap", "over that of constant zero, by laps", "worst second"]
    return Table("", headings, [*rows], [note], set(range(1, len(headings))))


def estimators_sentence() -> str:
    """Return what the estimators are worth in sideslip."""
    found = laps()
    zero, observer, kinematic = (of_laps(found[case]) for case in (ZERO, OBSERVER, KINEMATIC))
    share = [own / none for own, none in zip(observer, zero, strict=True)]
    good = sorted(value for value in share if value < 1.0)
    bad = [f"{value:.2f}" for value in share if value >= 1.0]
    worse = sum(own > none for own, none in zip(kinematic, zero, strict=True))
    return (
        f"The observer errs by {found[OBSERVER]['all']:.2f}° rms, where a constant zero would err by "
        f"{found[ZERO]['all']:.2f}°, the rms of the sideslip itself: by {good[0]:.2f} to {good[-1]:.2f} of "
        f"that in {len(good)} of {len(share)} laps, and by {listed(bad, last='and')} of it in the other. The "
        f"kinematic estimator, with {found[KINEMATIC]['all']:.2f}°, is worse than a constant zero in {worse} "
        f"of {len(zero)} laps."
    )


def parameters_sentence() -> str:
    """Return what a wrong stiffness or mass does to the observer's errors."""
    found = laps()
    own = of_laps(found[OBSERVER])
    wrong = [of_laps(errors) for case, errors in found.items() if case.endswith("%")]
    first = sum(errors[0] < own[0] for errors in wrong)
    moved = max(abs(a - b) for errors in wrong for a, b in zip(errors[1:], own[1:], strict=True))
    return (
        "A stiffness wrong by 20 % or a mass wrong by 15 % moves the observer's error in laps 2 to "
        f"{len(own)} by at most {moved:.2f}°; in the first lap {first} of these {len(wrong)} errors help."
    )


def limits_sentence() -> str:
    """Return what is known of a real car."""
    held = windows()
    yaw_rate, acceleration = (rms_of(held[CAR, signal]) for signal in ("yaw_rate", "acceleration_y"))
    found = laps()
    return (
        "One car has been compared with a measurement, a racing car in one recording of 550 s "
        "([figures](measured_cars.md#a-real-car)). A fitted car of seven degrees of freedom with Dugoff's "
        f"tyres follows its yaw rate to {yaw_rate:.3f} rad/s and its lateral acceleration to "
        f"{acceleration:.2f} m/s² rms in a lap that it was not fitted to, over the same bends; the "
        f"observer's sideslip errs by {found[OBSERVER]['all']:.1f}° rms, that of the kinematic estimator by "
        f"{found[KINEMATIC]['all']:.1f}°. No controller, no other plant, no passenger car and no wet road "
        "has been compared with a measurement."
    )


def pages_with_tables() -> dict[Path, str]:
    """Return the pages with their tables and sentences written anew."""
    estimators = [
        markdown(estimators_table()), wrapped(f"{estimators_sentence()} {parameters_sentence()}"),
    ]  # fmt: skip
    return pages_with({
        PAGE: {"fit": wrapped(fit_sentences()), "estimators": "\n\n".join(estimators)},
        ESTIMATORS_PAGE: {"real car": wrapped(estimators_sentence())},
        LIMITS_PAGE: {"real car": wrapped(limits_sentence())},
    })  # fmt: skip
