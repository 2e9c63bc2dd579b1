"""Sine with dwell, the whole series: which runs there must be, and what all of them come to.

    1.5 A, 2 A, 2.5 A, ... up to the last run, of max(6.5 A, 270 degrees), or 300 degrees where 6.5 A is more;

once left first and once right first. Steps of 0.5 A go on beyond 6.5 A where the last run is 270 degrees.
The series passes if every run that it asks for is there and passes all that is asked of it.

Source: UN Regulation No. 140, GTR 8.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import asdict

from ..figures.display import shown
from .judgement import Judgement, Ruling, Series, Verdict

FIRST, STEP, LAST = 1.5, 0.5, 6.5
"""Amplitudes over A: of the first run, from run to run, of the last."""
LEAST, MOST = 270.0, 300.0
"""Bounds of the last amplitude [deg]."""
NEAR = math.radians(1.0)
"""How far an amplitude may be from the one asked for [rad]; chosen: what steering robots keep."""
SAME = math.radians(0.05)
"""Amplitudes that differ by less are the same [rad]; chosen: below a tenth of a degree."""
CRITERIA = ("stability", "responsiveness")


def amplitudes(angle: float) -> list[float]:
    """Return the amplitudes of one direction [rad], from A [rad].

    >>> [round(math.degrees(x), 1) for x in amplitudes(math.radians(44.3))][-3:]
    [243.6, 265.8, 287.9]
    """
    a = math.degrees(angle)
    last = min(max(LAST * a, LEAST), MOST)
    steps = int((last / a - FIRST) / STEP + 1e-9)
    found = [(FIRST + STEP * k) * a for k in range(steps + 1)] if FIRST * a < last else []
    if not found or last - found[-1] > 1e-6:
        found.append(last)
    return [math.radians(round(x, 6)) for x in found]


def is_series(runs: Sequence[Judgement]) -> bool:
    """Return whether runs can be a series: several, no two of the same amplitude."""
    found = sorted(_of(run) for run in runs if run["amplitude"] is not None)
    return len(runs) > 1 and all(b - a > SAME for a, b in itertools.pairwise(found))


def judge_series(runs: Sequence[Judgement], angle: float) -> Series:
    """Return what all runs come to, in the order of their amplitudes; `angle`: A [rad]."""
    ordered = sorted(runs, key=lambda run: (-math.copysign(1.0, _of(run)), abs(_of(run))))
    missing = [
        math.degrees(side * wanted)
        for side in (1.0, -1.0)
        for wanted in amplitudes(angle)
        if not any(abs(_of(run) - side * wanted) <= NEAR for run in runs)
    ]
    rulings = {criterion: _ruling(criterion, ordered, missing) for criterion in CRITERIA}
    passed = all(ruling.verdict is Verdict.PASSED for ruling in rulings.values())
    verdict = Verdict.PASSED if passed else Verdict.FAILED
    criteria = {name: asdict(ruling) for name, ruling in rulings.items()}
    found = {"A": angle, "verdict": verdict, "criteria": criteria}
    return Series(ordered, f"A = {shown(angle, 'rad')}; the series has {verdict.value}.", found, rulings)


def _ruling(criterion: str, runs: Sequence[Judgement], missing: Sequence[float]) -> Ruling:
    """Return the verdict of a criterion over all runs; amplitudes [deg] may be missing."""
    asked = [run for run in runs if criterion in run.rulings]
    failed = [run for run in asked if run.rulings[criterion].verdict is Verdict.FAILED]
    if failed:
        return Ruling(Verdict.FAILED, f"{len(failed)} of {len(asked)} runs fail, {_span(failed)}")
    reasons = [one.why for run in asked if (one := run.rulings[criterion]).verdict is Verdict.NOT_JUDGED]
    if reasons:
        said = f"{len(reasons)} of {len(asked)} runs are not judged: {reasons[0]}"
    elif missing:
        lacking = ", ".join(f"{x:+.1f}" for x in missing)
        said = f"{len(missing)} runs are missing, of {lacking} degrees"
    elif not asked:
        said = "no run is asked"
    else:
        return Ruling(Verdict.PASSED, f"all {len(asked)} runs pass")
    return Ruling(Verdict.NOT_JUDGED, said)


def _of(run: Judgement) -> float:
    """Return the amplitude of a run [rad], positive if left first; nothing known sorts last."""
    value = run["amplitude"]
    return math.nan if value is None else value


def _span(runs: Sequence[Judgement]) -> str:
    """Return from which amplitude on runs fail, each direction for itself."""
    words = []
    for name, side in (("left first", 1.0), ("right first", -1.0)):
        found = [math.degrees(abs(_of(run))) for run in runs if side * _of(run) > 0]
        if found:
            words.append(f"{name}: {len(found)}, the smallest of {min(found):.1f} degrees")
    return "; ".join(words)
