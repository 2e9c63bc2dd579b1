"""Sine with dwell (UN R140, GTR 8): evaluation of a run by both criteria, and of the series of runs.

One run:

1. Zero: subtract from all signals their means over the 1.0 s before the steering rate stays above 75 deg/s
   for 200 ms (below 26.8 degrees of amplitude it never does: before it first exceeds 75 deg/s).
2. BOS: the angle then reaches 5 degrees. COS: it is back at zero after the second half wave.
3. Second peak: the first local peak of the yaw rate, of 5 % prominence, after the steering has changed sign;
   at COS + 1.000 s at the latest, and at least a fifth of the largest yaw rate before.
4. Stability: yaw rate over that peak, signed, at COS + 1.000 s at most 35 %, at COS + 1.750 s at most 20 %.
   Without a second peak the car is unstable.
5. Responsiveness, from 5 A of amplitude on: a_y integrated twice from BOS is at least 1.83 m at BOS + 1.07 s,
   1.52 m for cars above 3500 kg.

The ratio is signed, so a car that spins can pass it: a peak of the sideslip angle beyond 20 degrees is noted.
Where the yaw rate does not follow the first half wave, or opposes it, nothing is judged.

The series has runs at the amplitudes

    1.5 A, 2 A, 2.5 A, ... up to the last run, of max(6.5 A, 270 degrees), or 300 degrees where 6.5 A is more;

once left first and once right first. Steps of 0.5 A go on beyond 6.5 A where the last run is 270 degrees.
The series passes if all these runs exist and pass every criterion that applies to them.

Source: UN Regulation No. 140 (2017), GTR 8, as adopted in GB/T 30677-2014; the numbers are the same in FMVSS
126. Our readings: order of the filters (see `trace`), prominence and bounds of the second peak, lateral
displacement as the double integral (not the path, which differs by up to 0.36 m), ratios timed from COS.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from yawbench.figures.display import shown
from yawbench.foundation.messages import listed
from yawbench.metrics.measures import running_integral
from yawbench.metrics.verdict import NotJudged, Status, Verdict, apart, compare, not_judged, worded, worst
from yawbench.vehicles.motion import largest

from .standard_tests import Evaluation, Limit, Mark, SeriesDriver, SeriesRun, TestSeries, evaluation
from .trace import Trace, at, first_crossing, likeness, opposed, prepared, refuse_opposed, running_mean

RATE, LASTS, MEAN = math.radians(75.0), 0.2, 0.1
"""Steering rate that starts the test [rad/s], how long it must last, and width of its running mean [s]."""
BEFORE = 1.0
"""Length of the zeroing range [s]."""
BEGUN = math.radians(5.0)
"""Hand-wheel angle of BOS [rad]."""
PROMINENCE = 0.05
"""Prominence of the second peak relative to the largest yaw rate of that half wave; chosen: above the
ripple of filters."""
LEAST_PEAK = 0.2
"""Height of the second peak relative to the largest yaw rate of the first half wave. Chosen: 96 runs of
six cars with and without control, 45 to 270 degrees on mu 0.4 and 0.9, have 0.95 to 2.1; less is noise."""
FOLLOWS = 0.5
"""`likeness` of yaw rate and hand wheel in the first half wave, below which the yaw rate is not
that of the car that was steered. Chosen: those runs have 0.90 to 0.98, noise has about 0."""
RATIOS = ((1.0, 0.35), (1.75, 0.20))
"""Time after COS [s], largest allowed ratio of the yaw rate."""
AT, FAR, FAR_HEAVY, HEAVY = 1.07, 1.83, 1.52, 3500.0
"""Lateral displacement: time after BOS [s], least value [m], that for heavy cars, their mass [kg]."""
FROM = 5.0
"""Multiple of A above which responsiveness is judged."""
DRY = 0.9
"""Friction of the road that the regulation requires."""
SPEED, SLACK = 80.0 / 3.6, 2.0 / 3.6
"""Speed at the start and its tolerance [m/s]."""
SPUN = math.radians(20.0)
"""Sideslip that is noted even if the ratios pass [rad]; chosen: beyond what a driver can control."""
SLIGHT = 1e-6
"""Relative tolerance when an amplitude is compared with a multiple of A, for rounding."""


@dataclass(frozen=True)
class DwellCourse:
    """The zeroed signals of a run and its characteristic times; None for those that do not exist."""

    time: np.ndarray
    angle: np.ndarray  # of the hand wheel, the first half wave positive [rad]
    yaw_rate: np.ndarray  # [rad/s], likewise
    displacement: np.ndarray  # from BOS [m], likewise; zero before
    zeroed: tuple[float, float]
    begin: float  # BOS
    end: float  # COS
    peak: float | None  # instant of the second peak
    side: float  # 1: left first
    early: str = ""  # why the zeroing range may end too early


def course_of(trace: Trace) -> DwellCourse:
    """Return the zeroed signals and instants of a run, found as the regulation prescribes.

    Raises:
        NotJudged: the record is too short, the steering is not a sine with dwell, COS is not reached.
        ResultsError: a signal is missing.
    """
    signals = prepared(trace, ("steering_wheel_angle", "yaw_rate", "acceleration_y"))
    t, rate = signals["time"], trace.even.rate
    start, early = _start(t, signals["steering_wheel_angle"], rate)
    if start - BEFORE < t[0] - 1e-9:
        raise NotJudged(
            f"the record begins {start - t[0]:.2f} s before the steering; {BEFORE:g} s are needed"
        )
    quiet = (t >= start - BEFORE) & (t <= start)
    zeroed = {name: x - x[quiet].mean() for name, x in signals.items() if name != "time"}
    angle = zeroed["steering_wheel_angle"]
    side = _first_side(t, angle, start)
    angle, r, a_y = side * angle, side * zeroed["yaw_rate"], side * zeroed["acceleration_y"]
    begin = first_crossing(t, angle, BEGUN, start)
    if begin is None:
        raise NotJudged(f"the hand wheel does not reach {math.degrees(BEGUN):g} degrees")
    reversed_ = first_crossing(t, -angle, 0.0, float(t[np.argmax(np.where(t >= begin, angle, -np.inf))]))
    if reversed_ is None or not np.any((t > reversed_) & (angle < -BEGUN)):
        raise NotJudged("there is no second half wave of steering")
    end = first_crossing(t, angle, 0.0, float(t[np.argmin(np.where(t >= reversed_, angle, np.inf))]))
    if end is None:
        raise NotJudged("completion of steer is not reached: the hand wheel does not return to zero")
    displacement = _displacement(t, a_y, begin)
    _check_answers(t, angle, r, displacement, begin, reversed_)
    return DwellCourse(
        t,
        angle,
        r,
        displacement,
        (start - BEFORE, start),
        begin,
        end,
        _second_peak(t, r, begin, reversed_, end),
        side,
        early,
    )


def _start(t: np.ndarray, angle: np.ndarray, rate: float) -> tuple[float, str]:
    """Return the end of the zeroing range [s], and why it may be too early."""
    turning = running_mean(np.gradient(angle, t), MEAN, rate)
    first = np.flatnonzero(np.abs(turning) > RATE)
    if not first.size:
        raise NotJudged(f"the steering rate does not exceed {math.degrees(RATE):g} deg/s")
    side = _first_side(t, angle - angle[0], float(t[0]))
    lasting = max(1, round(LASTS * rate))  # samples
    stays = np.convolve(side * turning > RATE, np.ones(lasting), "valid") >= lasting - 0.5
    starts = np.flatnonzero(stays)
    if starts.size:
        return float(t[starts[0]]), ""
    early = (
        f"zeroed before the first instant above {math.degrees(RATE):g} deg/s: the first half wave does not "
        f"stay above it for {1000 * LASTS:g} ms"
    )
    return float(t[first[0]]), early


def _first_side(t: np.ndarray, angle: np.ndarray, start: float) -> float:
    beyond = np.flatnonzero((np.abs(angle) >= BEGUN) & (t >= start))
    if not beyond.size:
        raise NotJudged(f"the hand wheel does not reach {math.degrees(BEGUN):g} degrees")
    return math.copysign(1.0, float(angle[beyond[0]]))


def _check_answers(
    t: np.ndarray, angle: np.ndarray, r: np.ndarray, displacement: np.ndarray, begin: float, reversed_: float
) -> None:
    """Raise NotJudged if the car does not respond to the first half wave, or responds to the wrong side."""
    first = (t >= begin) & (t <= reversed_)
    refuse_opposed(angle[first], r[first], "yaw rate")
    correlation = likeness(angle[first], r[first])
    if correlation < FOLLOWS:
        raise NotJudged(
            "the yaw rate does not follow the steering: their likeness in the first half wave is "
            f"{correlation:.2f}, at least {FOLLOWS:g} is needed"
        )
    if at(t, displacement, min(begin + AT, float(t[-1]))) < 0.0:
        raise opposed("lateral acceleration")


def _second_peak(t: np.ndarray, r: np.ndarray, begin: float, reversed_: float, end: float) -> float | None:
    """Return the time of the second peak; None if there is none.

    Raises:
        NotJudged: the yaw rate barely responds to the steering reversal.
    """
    from scipy.signal import find_peaks

    after, latest = t >= reversed_, end + RATIOS[0][0]
    x, instants = -r[after], t[after]
    before = float(r[(t >= begin) & (t <= reversed_)].max())
    answered = float(x[instants <= latest].max(initial=0.0))
    if answered < LEAST_PEAK * before:
        raise NotJudged(
            f"the yaw rate barely responds to the reversal: {math.degrees(answered):.2g} deg/s after "
            f"{math.degrees(before):.2g} deg/s in the first half wave"
        )
    peaks, _ = find_peaks(x, prominence=PROMINENCE * float(x.max()), height=LEAST_PEAK * before)
    peak_times = instants[peaks]
    return float(peak_times[0]) if peak_times.size and peak_times[0] <= latest else None


def _displacement(t: np.ndarray, a_y: np.ndarray, begin: float) -> np.ndarray:
    """Return the double integral of a_y from BOS on, by the trapezoidal rule."""
    late = t > begin
    times = np.concatenate([[begin], t[late]])
    a = np.concatenate([[at(t, a_y, begin)], a_y[late]])
    displacement = np.zeros_like(t)
    displacement[late] = running_integral(times, running_integral(times, a))[1:]
    return displacement


def percent(ratio: float) -> str:
    """Return a ratio in per cent with one decimal, never "-0.0 %"."""
    return f"{round(100 * ratio, 1) + 0.0:.1f} %"


@evaluation
def evaluate_dwell(judged: Evaluation, trace: Trace, angle: float | None = None) -> None:
    """Evaluate a run of sine with dwell; without A [rad] in `angle`, responsiveness is not judged."""
    try:
        course = course_of(trace)
    except NotJudged as why:
        for criterion in ("stability", "responsiveness"):
            judged.rule(criterion, not_judged(str(why)))
        return
    if course.early:
        judged.report("steering-unusual", course.early)
    steered = np.abs(trace["steering_wheel_angle"] - _zero_of(trace, course))
    amplitude = float(steered.max())
    nominal = trace.facts.get("amplitude")
    if isinstance(nominal, float) and abs(abs(nominal) - amplitude) < math.radians(0.5):
        amplitude = abs(nominal)  # exact, where the largest sample is not
    judged.add("amplitude", "amplitude", course.side * amplitude, "rad", "hand wheel, positive: left first")
    if angle:
        judged.add("multiple", "amplitude over A", amplitude / angle, "1")
    judged.add("begin", "beginning of steer", course.begin, "s", "5 degrees, filtered and zeroed")
    judged.add("end", "completion of steer", course.end, "s", "zero, filtered and zeroed")
    _stability(judged, course)
    _responsiveness(judged, course, trace, angle, amplitude)
    _add_beyond(judged, course, trace)


def marks_of(judged: Evaluation) -> tuple[list[Mark], list[Limit]]:
    """Return the instants at which a run is judged, and the largest yaw rates [rad/s] allowed then."""
    begin, end, peak = judged["begin"], judged["end"], judged["peak"]
    marks: list[Mark] = []
    if begin is not None:
        marks += [(begin, "beginning of steer"), (begin + AT, f"beginning of steer + {AT:g} s")]
    if end is not None:
        marks += [(end, "completion of steer")]
        marks += [(end + late, f"completion of steer + {late:g} s") for late, _ in RATIOS]
    limits = [] if peak is None else [
        ("yaw_rate", most * peak, f"{100 * most:g} % of the second peak, {late:g} s after steering")
        for late, most in RATIOS
    ]  # fmt: skip
    return marks, limits


def _zero_of(trace: Trace, course: DwellCourse) -> float:
    quiet = (trace.time >= course.zeroed[0]) & (trace.time <= course.zeroed[1])
    return float(trace["steering_wheel_angle"][quiet].mean())


def _stability(judged: Evaluation, course: DwellCourse) -> None:
    t, r = course.time, course.yaw_rate
    last = course.end + RATIOS[-1][0]
    value = None if course.peak is None else at(t, r, course.peak)
    judged.add("peak", "second peak of the yaw rate", None if value is None else course.side * value, "rad/s")
    judged.add("peak_at", "instant of the second peak", course.peak, "s")
    short = last > t[-1] + 1e-9
    ratios = []
    for late, most in RATIOS:
        known = value is not None and course.end + late <= t[-1] + 1e-9
        ratio = at(t, r, course.end + late) / value if known and value else None
        name = f"yaw-rate ratio at COS + {late:.3f} s"
        judged.add(f"ratio_{round(1000 * late)}", name, ratio, "%", "signed, over the second peak")
        if ratio is not None:
            reached = apart(100 * ratio, 100 * most, decimals=1)
            why = f"{reached} % of at most {100 * most:g} % at COS + {late:g} s"
            ratios.append(compare(ratio, "at_most", most, "%", why=why))
    if short:
        why = f"the record ends {t[-1] - course.end:.2f} s after completion of steer; "
        judged.rule("stability", not_judged(f"{why}{RATIOS[-1][0]:g} s are needed"))
    elif (deciding := worst(ratios)) is None:
        why = "the yaw rate has no second peak after the reversal"
        judged.rule("stability", Verdict(Status.FAILED, why=why))
    else:
        judged.rule("stability", replace(deciding, why="; ".join(ratio.why for ratio in ratios)))


def _responsiveness(
    judged: Evaluation, course: DwellCourse, trace: Trace, angle: float | None, amplitude: float
) -> None:
    instant = course.begin + AT
    there = instant <= course.time[-1]
    displacement = at(course.time, course.displacement, instant) if there else None
    reading = "double integral of the filtered lateral acceleration of the centre of mass"
    judged.add("displacement", f"lateral displacement at BOS + {AT:g} s", displacement, "m", reading)
    criterion = "responsiveness"
    if angle is None:
        judged.rule(criterion, not_judged("A is unknown: give runs of slowly increasing steer"))
    elif amplitude < FROM * angle * (1.0 - SLIGHT):
        return  # the criterion does not apply to this run
    elif displacement is None:
        judged.rule(criterion, not_judged(f"the record ends before BOS + {AT:g} s"))
    elif trace.friction is not None and trace.friction < DRY * (1.0 - SLIGHT):
        why = f"friction {trace.friction:g}; a dry road, {DRY:g}, is required"
        judged.rule(criterion, not_judged(why))
    else:
        least = FAR_HEAVY if trace.mass is not None and trace.mass > HEAVY else FAR
        why = f"{apart(displacement, least, decimals=2)} m of at least {least:g} m"
        judged.rule(criterion, compare(displacement, "at_least", least, "m", why=why))
        if trace.mass is None:
            judged.report("mass-unknown", f"mass unknown: assumed to be at most {HEAVY:g} kg", "info")


def _add_beyond(judged: Evaluation, course: DwellCourse, trace: Trace) -> None:
    """Add quantities and diagnostics beyond the regulation: sideslip and speeds."""
    after = trace.time >= course.begin
    if "sideslip" in trace:
        peak = largest(trace.while_moving("sideslip")[after])
        judged.add("sideslip", "peak sideslip", peak, "rad", "from BOS to the end of the record")
        if peak is not None and peak > SPUN:
            stable = worded(judged.criteria["stability"].status)
            reached = apart(math.degrees(peak), math.degrees(SPUN), decimals=0)
            why = f"sideslip reaches {reached} degrees (stability: {stable})"
            judged.report("sideslip-large", why)
    else:
        judged.report("sideslip-unknown", "sideslip was not recorded: a spin may pass the ratios undetected")
    if "velocity_x" in trace:
        speed = at(trace.time, trace["velocity_x"], course.begin)
        judged.add("speed", "speed at BOS", speed, "m/s")
        judged.add("speed_end", "speed at COS", at(trace.time, trace["velocity_x"], course.end), "m/s")
        if abs(speed - SPEED) > SLACK:
            ends = (3.6 * (SPEED - SLACK), 3.6 * (SPEED + SLACK))
            why = f"{apart(3.6 * speed, *ends, decimals=1)} km/h at BOS; 80 +- 2 km/h are required"
            for criterion in judged.criteria:
                judged.rule(criterion, not_judged(why))


FIRST, STEP, LAST = 1.5, 0.5, 6.5
"""Amplitudes over A: first run, step, last run."""
LEAST, MOST = 270.0, 300.0
"""Bounds of the last amplitude [deg]."""
NEAR = math.radians(1.0)
"""Tolerance of an amplitude of the series [rad]; chosen: the accuracy of steering robots."""
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
    in_degrees = [(FIRST + STEP * k) * a for k in range(steps + 1)] if FIRST * a < last else []
    if not in_degrees or last - in_degrees[-1] > 1e-6:
        in_degrees.append(last)
    return [math.radians(round(x, 6)) for x in in_degrees]


def is_series(runs: Sequence[Evaluation]) -> bool:
    """Return whether runs can form a series: more than one, all with different amplitudes."""
    ordered = sorted(_amplitude(run) for run in runs if run["amplitude"] is not None)
    return len(runs) > 1 and all(b - a > SAME for a, b in itertools.pairwise(ordered))


def judge_together(runs: Sequence[Evaluation], angle: float | None) -> TestSeries | None:
    """Judge recorded runs as a series if they can form one and A [rad] is known."""
    return judge_series(runs, angle) if angle and is_series(runs) else None


AMPLITUDE = "driver.amplitude"
"""Target that the series varies: amplitude of the hand-wheel angle [rad], positive to the left."""
SIDES = (("left", 1.0), ("right", -1.0))


def drive_series(driver: SeriesDriver) -> TestSeries:
    """Make the runs at all amplitudes, left first and right first, and judge them."""
    assert driver.angle is not None
    runs = []
    for name, side in SIDES:
        for amplitude in amplitudes(driver.angle):
            folder = f"{name}_first/{math.degrees(amplitude):.2f}"
            runs.append(SeriesRun(folder, folder, {AMPLITUDE: side * amplitude}))
    return judge_series(driver.make(runs), driver.angle)


def judge_series(runs: Sequence[Evaluation], angle: float) -> TestSeries:
    """Judge a series of runs, ordered by amplitude; `angle`: A [rad]."""
    ordered = sorted(runs, key=lambda run: (-math.copysign(1.0, _amplitude(run)), abs(_amplitude(run))))
    missing = [
        math.degrees(side * wanted)
        for side in (1.0, -1.0)
        for wanted in amplitudes(angle)
        if not any(abs(_amplitude(run) - side * wanted) <= NEAR for run in runs)
    ]
    criteria = {criterion: _over_runs(criterion, ordered, missing) for criterion in CRITERIA}
    passed = all(verdict.holds for verdict in criteria.values())
    status = Status.PASSED if passed else Status.FAILED
    data = {name: verdict.as_data() for name, verdict in criteria.items()}
    series_data = {"A": angle, "verdict": status, "criteria": data}
    sentence = f"The series has {conclusion(criteria)}, with A = {shown(angle, 'rad')}."
    return TestSeries(ordered, sentence, series_data, criteria)


def conclusion(criteria: Mapping[str, Verdict]) -> str:
    """Return whether the criteria of a series are met, with the names of those that are not."""
    if failed := [name for name, verdict in criteria.items() if verdict.holds is False]:
        return f"failed ({listed(failed)})"
    if unknown := [name for name, verdict in criteria.items() if verdict.holds is None]:
        return f"not passed ({listed(unknown)} not judged)"
    return "passed"


def _over_runs(criterion: str, runs: Sequence[Evaluation], missing: Sequence[float]) -> Verdict:
    """Return the verdict on a criterion over all runs; `missing`: amplitudes [deg] without a run."""
    verdicts = [run.criteria[criterion] for run in runs if criterion in run.criteria]
    deciding = worst(verdicts)
    if deciding and deciding.holds is False:
        failed = [run for run in runs if criterion in run.criteria and run.criteria[criterion].holds is False]
        return replace(deciding, why=f"{len(failed)} of {len(verdicts)} runs fail: {_failures(failed)}")
    if reasons := [verdict.why for verdict in verdicts if verdict.holds is None]:
        return not_judged(f"{len(reasons)} of {len(verdicts)} runs are not judged: {reasons[0]}")
    if missing:
        degrees = ", ".join(f"{x:+.1f}" for x in missing)
        return not_judged(f"{len(missing)} runs are missing, of {degrees} degrees")
    if deciding is None:
        return not_judged("no run is required")
    return replace(deciding, why=f"all {len(verdicts)} runs pass")


def _amplitude(run: Evaluation) -> float:
    """Return the amplitude of a run [rad], positive if left first; NaN if unknown."""
    value = run["amplitude"]
    return math.nan if value is None else value


def _failures(runs: Sequence[Evaluation]) -> str:
    """Describe how many runs fail in each direction, and the smallest failing amplitude."""
    words = []
    for name, side in (("left first", 1.0), ("right first", -1.0)):
        failed = [math.degrees(abs(_amplitude(run))) for run in runs if side * _amplitude(run) > 0]
        if failed:
            words.append(f"{name} {len(failed)}, the smallest at {min(failed):.1f} degrees")
    return "; ".join(words)
