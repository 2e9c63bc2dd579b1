"""Metrics of runs, from expressions such as `peak(sideslip)`: parsed, evaluated over a run or a part of it.

A metric is a measure of a signal, written `measure(signal)`: `relative_peak_error(sideslip)`,
`total_variation_rate(wheel_torque_*)`. Signals are named as in the vocabulary, whatever the scenario calls
its instances or an FMU from another tool its outputs. If several instances have a signal of that name, it is
the plant's, or the only one that is neither measured nor estimated; `estimator.sideslip` selects any of them.
A bare name never means a measured or estimated signal.

The reference of a signal `x` is the signal `x_ref`; if several instances have one, that of the instance whose
output is used. Another reference follows a comma, `relative_peak_error(yaw_rate, ideal.yaw_rate_ref)`, which
makes explicit against which truth a metric judges. Measures that need no reference also take a difference,
`rms(estimator.sideslip - plant.sideslip)`. Of four wheels (`*`) the largest value counts. A metric whose
signals a run does not have is absent, never zero. A metric may be restricted to a time window,
`peak(sideslip) from 1 s to 3 s`, or to a point in time, `value(sideslip) at 2 s`.

Sideslip, its rate and slip angles are measured while the car moves (`motion`): the clock stands while the car
does. A run in which it never moves does not have such a metric.
"""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from yawbench.foundation.errors import ScenarioError
from yawbench.foundation.messages import closest, fold, hint, listed, short, span
from yawbench.orchestrator.plan import SENSING
from yawbench.orchestrator.scenario.quantities import convert
from yawbench.orchestrator.signal_names import VARIABLE, SignalName
from yawbench.vehicles.motion import nearest_turn, standing
from yawbench.vocabulary.motion import ANGLES, LEAST_SPEED, SPEED_SIGNALS
from yawbench.vocabulary.wheels import WHEELS, wheels

from .measures import MEASURES, Measure, si_of, symbol, variable_of, words
from .verdict import WithUnit

if TYPE_CHECKING:
    from yawbench.orchestrator.plan import Plan
    from yawbench.orchestrator.results.reader import Results

STANDARD = (
    "relative_peak_error(sideslip)",
    "mean_error(sideslip)",
    "rms_error(sideslip)",
    "peak(sideslip)",
    "stability_index(sideslip)",
    "relative_peak_error(yaw_rate)",
    "mean_error(yaw_rate)",
    "rms_error(yaw_rate)",
    "overshoot(yaw_rate)",
    "settling_time(yaw_rate)",
    "slope_variation_rate(yaw_rate)",
    "peak(acceleration_y)",
    "displacement(position_y)",
    "final(velocity_x)",
    "peak(yaw_moment)",
    "effort(yaw_moment)",
    "total_variation_rate(yaw_moment)",
    "total_variation_rate(wheel_torque_*)",
)
"""The default metrics."""

AT_A_TIME = "value"
"""The measure for a point in time; all others need a time span."""
TimeWindow = tuple[float, float]
"""Start and end [s]; equal: a point in time."""


@dataclass(frozen=True)
class Metric:
    """A measure of a signal, perhaps relative to another signal."""

    name: str
    measure: Measure
    signal: str
    window: TimeWindow | None = None  # default: the whole run
    other: str = ""  # a reference other than the signal's own, or the signal to subtract

    @property
    def formula(self) -> str:
        x = symbol(variable_of(self.signal))
        x_ref = f"{x}_ref"
        if self.other:
            needs = self.measure.needs_reference
            x, x_ref = (self.signal, self.other) if needs else (f"({self.signal} - {self.other})", "")
        return self.measure.formula.replace("{x_ref}", x_ref).replace("{x}", x)

    @property
    def definition(self) -> str:
        of_wheels = ", the largest of the four wheels" if "*" in self.signal else ""
        return f"{self.measure.definition}{self._against}{of_wheels}"

    @property
    def _against(self) -> str:
        if not self.other:
            return ""
        return f", {'against' if self.measure.needs_reference else 'of the difference from'} {self.other}"

    @property
    def title(self) -> str:
        """The signal and the measure in a few words."""
        measure = self.name.partition("(")[0].replace("_", " ").replace("rms", "RMS")
        return f"{words(variable_of(self.signal))}: {measure}{self._against}{during(self.window)}"

    def unit(self, signal_unit: str) -> str:
        """Return the metric's unit for a signal in `signal_unit`."""
        x = signal_unit or "1"
        if self.measure.unit == "{x}2/s":
            return f"{x}2/s" if x.isalpha() else f"({x})2/s"
        powers = {"{x}/s": -1, "{x}/s2": -2, "{x}.s": 1}
        if self.measure.unit in powers:
            return _times_seconds(x, powers[self.measure.unit])
        return self.measure.unit.replace("{x}", x)


def _times_seconds(unit: str, power: int) -> str:
    """Return a unit times a power of a second: "m/s3" for "m/s" and -2."""
    per_time = re.fullmatch(r"(.+)/s(\d*)", unit)
    base, total = (per_time[1], power - int(per_time[2] or 1)) if per_time else (unit, power)
    if total > 0:
        return "s" if base == "1" else f"{base}.s"
    return base if total == 0 else f"{base}/s{-total if total < -1 else ''}"


@dataclass(frozen=True)
class MetricValue(WithUnit):
    """The value of a metric in one run, in SI; `percent`: tables show it, a ratio, in per cent.

    `whether`: it is 1 if something happens in a run and 0 if not, which tables show as yes and no.

    Over several repeats it is the mean, and `half` is half the width of its confidence interval. If it is
    their median or a share, `between` has their range or the share's interval, `half` its larger distance.

    >>> peak = run.metrics()["peak(sideslip)"]
    >>> round(peak.number, 4), peak.unit
    (0.0198, 'rad')
    """

    number: float
    unit: str
    half: float = 0.0
    between: tuple[float, float] | None = None
    percent: bool = field(default=False, kw_only=True, repr=False)
    whether: bool = field(default=False, kw_only=True, repr=False, compare=False)


def during(window: TimeWindow | None, lead: str = "") -> str:
    """Return a window as the end of a phrase: ", 1 to 6 s", with `lead` before the times; ", at 2 s"."""
    if window is None:
        return ""
    first, last = window
    return f", at {first:g} s" if first == last else f", {lead}{span(first, last)} s"


def window_of(text: str) -> TimeWindow:
    """Return the window [s] written as `from 1 s to 3 s`, `1 to 3 s` or `at 2 s`.

    Raises:
        ValueError: the text is not a window.
    """
    match = re.fullmatch(r"at\s+(.+)|(?:from\s+)?(.+?)\s+to\s+(.+)", text.strip())
    if match is None:
        raise ValueError(f"{short(text)} is not a window: write from 1 s to 3 s, or at 2 s")
    at, begin, end = match.groups()
    first, last = (_time(time) for time in ((at, at) if at else (begin, end)))
    if at is None and not first < last:
        raise ValueError(f"{short(text)} ends before it begins")
    return first, last


def _time(text: str) -> float:
    """Return a time in s from a text with or without unit."""
    return float(convert(text if re.search(r"[a-z]", text) else f"{text} s", "s"))


def metric(name: str) -> Metric:
    """Parse a metric written as `measure(signal)`, perhaps followed by a window: see `window_of`.

    The signal may be `signal, reference` or `signal - other`.

    Raises:
        ScenarioError: the name is not of that form, or the measure does not exist.
    """
    match = _METRIC.fullmatch(name)
    if match is None:
        meant = [f"{m}({name[len(m) + 1 :]})" for m in MEASURES if name.startswith(f"{m}_")]
        likely = max(meant, key=lambda text: text.index("("), default=closest(name, STANDARD))
        guess = f"did you mean {likely!r}? " if likely else ""
        raise ScenarioError(
            f"{short(name)} is not a metric; {guess}write measure(signal), for example {STANDARD[0]}.",
            code="metric-unknown",
        )
    measure, signal, between, other, rest = match.groups()
    if measure not in MEASURES:
        raise ScenarioError(
            f"{name!r}: there is no measure {measure!r}{hint(measure, MEASURES, lead='known')}",
            code="metric-unknown",
        )
    try:
        window = window_of(rest) if rest else None
    except ValueError as error:
        raise ScenarioError(f"{short(name)}: {error}", code="metric-invalid") from None
    point = window is not None and window[0] == window[1]
    if point != (measure == AT_A_TIME):
        allowed = (
            f"{AT_A_TIME}({signal}) takes a point in time, as at 2 s; all other measures take a time span"
        )
        raise ScenarioError(f"{short(name)}: {allowed}", code="metric-invalid")
    needs = MEASURES[measure].needs_reference
    if between and (between == ",") != needs:
        right = f"{measure}({signal}{', ' if needs else ' - '}{other})"
        why = "compares with a reference" if needs else "takes a difference, not a reference"
        raise ScenarioError(f"{short(name)}: {measure} {why}: write {right}", code="metric-invalid")
    written = f"{measure}({signal})"
    if between:
        written = f"{measure}({signal}, {other})" if needs else f"{measure}({signal} - {other})"
    if window is not None:
        written += f" at {window[0]!r} s" if point else f" from {window[0]!r} s to {window[1]!r} s"
    return Metric(written, MEASURES[measure], signal, window, other or "")


_METRIC = re.compile(rf"\s*(\w+)\s*\(\s*({VARIABLE})\s*(?:([,-])\s*({VARIABLE})\s*)?\)\s*(.*?)\s*", re.DOTALL)


def columns_of(results: Results, signal: str) -> list[str]:
    """Return the columns of a signal: one, or four for a `*`; empty if they were not recorded.

    If several instances have the name, the plant's is taken, else the only one that is not of a sensor or an
    estimator. A bare name never means a measured or estimated signal, even if nothing else is recorded.
    """
    names = wheels(signal)
    columns = [column for name in names if (column := _column(results, name)) is not None]
    return columns if len(columns) == len(names) else []


def _column(results: Results, name: str) -> str | None:
    candidates = (results.candidates(name, role=role) for role in (None, "plant"))
    matches = next((found for found in candidates if len(found) == 1), None)
    if matches is None:
        matches = [column for column, signal in results.names.items() if signal.variable == name]
    meant = [one for one in matches if one == name or not _is_measured_or_estimated(results, one)]
    is_number = len(meant) == 1 and np.issubdtype(results.columns[meant[0]].dtype, np.number)
    return meant[0] if is_number else None


@np.errstate(all="ignore")  # of runs that grow without bound; the number says so
def evaluate(results: Results, chosen: Metric, window: TimeWindow | None = None) -> MetricValue | None:
    """Compute a metric over a window [s], by default its own or the whole run.

    None if the run does not have the signal or does not cover the window: over a part of it, it would be a
    different metric.
    """
    time, signals = results.time, _signals(results, chosen)
    if not time.size or not signals:
        return None
    window = window or chosen.window
    first, last = window or (-math.inf, math.inf)
    if window and not time[0] - 1e-9 <= first <= last <= time[-1] + 1e-9:
        return None
    point = first == last
    if point:  # the nearest recorded row
        inside = np.array([np.argmin(np.abs(time - first))])
    else:
        inside = np.flatnonzero((time >= first - 1e-9) & (time <= last + 1e-9))
    angles, numbers = angles_in(results), []
    for columns in signals:
        of_velocity = [column for column in columns if column in angles]
        stands = standing_in(results, of_velocity[0]) if of_velocity else None
        wraps = bool(of_velocity) and si_of(results.units[columns[0]])[0] == "rad"
        rows = inside if stands is None else inside[~stands[inside]]
        if rows.size < (1 if point else 2):
            return None
        stretches = np.split(rows, np.flatnonzero(np.diff(rows) > 1) + 1)
        whole = slice(rows[0], rows[-1] + 1) if len(stretches) == 1 else rows  # a slice needs no copies
        t = time[whole]
        if len(stretches) > 1:  # the clock stands while the car does
            t = t[0] + np.append(0.0, np.cumsum(time[rows[1:]] - time[rows[1:] - 1]))
        samples = [results.columns[c][whole] * si_of(results.units[c])[1] for c in columns]
        if wraps and (chosen.other or chosen.measure.needs_reference):
            samples[0] = nearest_turn(samples[0], samples[1])
        if wraps and chosen.measure.of_changes:
            samples[0] = np.unwrap(samples[0])
        if chosen.other and not chosen.measure.needs_reference:
            samples = [samples[0] - samples[1]]
        if chosen.measure.needs_rate and len(samples) == 1:
            ends = np.cumsum([stretch.size for stretch in stretches])[:-1]
            turning = np.unwrap(samples[0]) if wraps else samples[0]
            parts = zip(np.split(turning, ends), np.split(t, ends), strict=True)
            samples.append(np.concatenate([np.gradient(x, at) if x.size > 1 else 0.0 * x for x, at in parts]))
        numbers.append(chosen.measure.function(t, *samples))
    number = float(np.max(numbers))  # np.max, unlike max, propagates the NaN of any wheel
    if math.isnan(number):
        return None
    unit = chosen.unit(si_of(results.units[signals[0][0]])[0])
    return MetricValue(number, unit, whether=chosen.measure.whether)


def angles_in(results: Results) -> set[str]:
    """Return the columns that are angles of velocities, by their names or by the inputs that they feed."""
    return {column for name in ANGLES for column in results.candidates(name)}


def motion_of(results: Results, column: str) -> dict[str, str]:
    """Return the columns from which the speed at an angle of a velocity is computed, by their signals.

    Those of the same instance, unless it measures or estimates; else the car's.
    """
    own = results.names[column].instance
    beside = {name: f"{own}.{name}" for name in SPEED_SIGNALS if f"{own}.{name}" in results}
    if "velocity_x" in beside and not _is_measured_or_estimated(results, column):
        return beside
    return {name: columns[0] for name in SPEED_SIGNALS if (columns := columns_of(results, name))} or beside


def standing_in(results: Results, column: str) -> np.ndarray | None:
    """Return the rows in which an angle of a velocity means nothing; None if there are none."""
    motion = {
        name: results.columns[source] * si_of(results.units[source])[1]
        for name, source in motion_of(results, column).items()
    }
    return standing(motion)


def while_moving(results: Results) -> Results:
    """Return results in which angles of velocities are NaN while the car stands, as figures show them."""
    columns = dict(results.columns)
    for column in angles_in(results):
        stands = standing_in(results, column)
        if stands is not None:
            columns[column] = np.where(stands, np.nan, columns[column])
    return replace(results, columns=columns)


def results_to_be(plan: Plan) -> Results:
    """Return results without rows that have the columns which a plan will record."""
    from yawbench.orchestrator.results.reader import Results
    from yawbench.orchestrator.results.record_of_plan import connections_of, recorded_variables
    from yawbench.orchestrator.results.run_record import FmuRecord, RunRecord

    variables = recorded_variables(plan)
    columns = {name: np.empty(0, float if v.type != "String" else str) for name, v in variables.items()}
    fmus = {
        instance.name: FmuRecord(name=instance.fmu.name, role=instance.role) for instance in plan.instances
    }
    run = RunRecord(fmus=fmus, connections=connections_of(plan))
    return Results(Path(), np.empty(0), columns, {n: v.unit or "" for n, v in variables.items()}, run)


def check_metrics(plan: Plan, chosen: Iterable[Metric]) -> None:
    """Check that a run of a plan will record the signals that metrics need.

    Raises:
        ScenarioError: with a sentence for each metric that cannot be computed.
    """
    results, end = results_to_be(plan), plan.time(plan.n_steps)
    if problems := [why for m in chosen if (why := why_none(results, m, m.window, end))]:
        raise ScenarioError(problems, code="metric-unavailable")


def why_none(results: Results, chosen: Metric, window: TimeWindow | None, end: float) -> str:
    """Return why a metric has no value in a run that ends at `end` [s], "" if it has a value."""
    missing = [s for s in filter(None, (chosen.signal, chosen.other)) if not columns_of(results, s)]
    if missing:
        names = fold(list(dict.fromkeys(signal.variable for signal in results.names.values())))
        whole = list(results) if SignalName.parse(missing[0]).instance else names
        indirect = [
            column
            for column, signal in results.names.items()
            if signal.variable in wheels(missing[0]) and _is_measured_or_estimated(results, column)
        ]
        if indirect:
            named = listed(fold(indirect), last="or")
            return f"{chosen.name}: {missing[0]} is recorded only as measured or estimated: write {named}"
        return f"{chosen.name}: {missing[0]!r} is not recorded{hint(missing[0], whole, lead='there are')}"
    if unit_in(results, chosen) is None:
        return f"{chosen.name}: {_unfit(results, chosen)}"
    if window is not None and not 0.0 <= window[0] <= window[1] <= end:
        return f"{chosen.name}: the window is not within the run, 0 to {end:g} s"
    angles = angles_in(results) & {*itertools.chain(*_signals(results, chosen))}
    stands = standing_in(results, min(angles)) if angles and results.time.size else None
    if stands is not None:
        first, last = window or (-math.inf, math.inf)
        if np.all(stands[(results.time >= first - 1e-9) & (results.time <= last + 1e-9)]):
            return f"{chosen.name}: the car is not faster than {3.6 * LEAST_SPEED:.0f} km/h{during(window)}"
    return ""


def _unfit(results: Results, chosen: Metric) -> str:
    """Return why a metric cannot be computed although all its signals were recorded, "" if it can."""
    wanted = f"{variable_of(chosen.signal)}_ref"
    having = [column for column, name in results.names.items() if name.variable == wanted]
    if chosen.other:
        columns = (columns_of(results, name)[0] for name in (chosen.signal, chosen.other))
        units = listed(f"{column} [{results.units[column] or '1'}]" for column in columns)
        return f"{units} cannot be compared"
    if chosen.measure.needs_reference and len(having) > 1:
        example = f"{chosen.name.partition('(')[0]}({chosen.signal}, {having[0]})"
        return f"{listed(having)} are recorded: name one of them, as in {example}"
    if chosen.measure.signal:
        beside = chosen.measure.beside
        return f"is defined for {chosen.measure.signal}{f', and needs {listed(beside)}' if beside else ''}"
    return f"{chosen.signal} has no reference or not the right unit"


def unit_in(results: Results, chosen: Metric) -> str | None:
    """Return the unit of a metric in a run, None if the run has not recorded its signals."""
    signals = _signals(results, chosen)
    return chosen.unit(si_of(results.units[signals[0][0]])[0]) if signals else None


def columns_for(results: Results, names: Iterable[str]) -> list[str]:
    """Return the columns that metrics need; `results` may have no rows."""
    every = [signals for name in names for signals in _signals(results, metric(name))]
    needed = dict.fromkeys(column for columns in every for column in columns)
    angles = angles_in(results)
    moving = [motion_of(results, column).values() for column in needed if column in angles]
    return [
        *needed,
        *dict.fromkeys(column for columns in moving for column in columns if column not in needed),
    ]


def _signals(results: Results, chosen: Metric) -> list[list[str]]:
    """Return the columns of each function call, one call per wheel; empty if any is missing."""
    signals = []
    others = columns_of(results, chosen.other) if chosen.other else []
    for k, column in enumerate(columns_of(results, chosen.signal)):
        unit = si_of(results.units[column])[0]
        if chosen.measure.signal_unit not in (None, unit):
            return []
        columns = [column]
        if chosen.other:
            other = others[k if len(others) > 1 else 0] if others else None
            if other is None or (si_of(results.units[other])[0] or "1") != (unit or "1"):
                return []
            columns.append(other)
        elif chosen.measure.needs_reference:
            reference = reference_of(results, column)
            if reference is None:
                return []
            columns.append(reference)
        elif chosen.measure.needs_rate and (rate := _rate_of(results, column)):
            columns.append(rate)
        if chosen.measure.signal is not None:
            beside = _beside(results, column, chosen.measure)
            if beside is None or chosen.other:
                return []
            columns += beside
        signals.append(columns)
    return signals


def _beside(results: Results, column: str, measure: Measure) -> list[str] | None:
    """Return the further columns that a measure takes; None if one is missing, or the signal is another."""
    name, signal = variable_of(column), measure.signal or ""
    if column == _column(results, signal):  # by an input's name, whose column is that of its source
        name = signal
    wheel = name[len(signal) :]
    if not name.startswith(signal) or (wheel and wheel[1:] not in WHEELS):
        return None
    columns = [_column(results, f"{other}{wheel}") for other in measure.beside]
    return [column for column in columns if column] if all(columns) else None


def _rate_of(results: Results, column: str) -> str | None:
    """Return the column of a signal's rate; for measured or estimated signals only of the same instance."""
    if f"{column}_rate" in results:
        return f"{column}_rate"
    return (
        None
        if _is_measured_or_estimated(results, column)
        else _column(results, f"{variable_of(column)}_rate")
    )


def _is_measured_or_estimated(results: Results, column: str) -> bool:
    """Return whether a column is a measurement or an estimate."""
    return any(results.names[column].instance in results.instances_of_role(role) for role in SENSING)


def reference_of(results: Results, column: str) -> str | None:
    """Return the column of the signal's reference, `x_ref` for `x`, if it was recorded.

    If several instances have one, it is that of the instance whose output is connected; others only observe.
    """
    name = f"{variable_of(column)}_ref"
    if reference := _column(results, name):
        return reference
    acting = {wire.source.instance for wire in results.record.connections}
    having = [
        c for c, signal in results.names.items() if signal.variable == name and signal.instance in acting
    ]
    return having[0] if len(having) == 1 else None


def evaluate_all(results: Results, names: Iterable[str] = STANDARD) -> dict[str, MetricValue]:
    """Return the values of those metrics whose signals the run has recorded."""
    values = {name: evaluate(results, metric(name)) for name in names}
    return {name: value for name, value in values.items() if value is not None}
