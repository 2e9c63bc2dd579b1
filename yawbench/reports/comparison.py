"""Comparison of runs: metrics with differences, differences between records, signals that diverge.

`divergence` finds when and how far the signals of two runs diverge, `differences` what differs between their
records, `comparison_facts` what a page on several runs shows.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from yawbench.figures.style import LabelledRun, digits_of, shown, shown_unit, unit_of_signal
from yawbench.foundation.messages import counted, resolved, span, star
from yawbench.metrics.expressions import MetricValue, angles_in, metric, standing_in
from yawbench.metrics.measures import variable_of
from yawbench.orchestrator.recordings.gaps import gaps_noted, outside
from yawbench.orchestrator.results.measurement_results import MeasuredResults
from yawbench.orchestrator.results.reader import Results
from yawbench.orchestrator.results.run_record import RunRecord
from yawbench.orchestrator.scenario.overrides import changed
from yawbench.orchestrator.signal_names import SignalName
from yawbench.studies.experiment_result import ExperimentResult
from yawbench.studies.tables import Table, marked, remarks
from yawbench.vehicles.motion import nearest_turn
from yawbench.vocabulary.wheels import WHEELS

from .viewer import View

SAME = 1e-9
"""Differences below this, relative to the signal's peak, are ignored; chosen: far above rounding, far below
any physics."""
SEEN = 0.01
"""Difference that is visible in a figure, relative to the signal's peak; chosen: the width of a line."""


@dataclass(frozen=True)
class SignalDifference:
    """A signal that differs between two runs: from when on, and by how much."""

    signal: str  # instance.variable, four wheels as one with `*`
    targets: tuple[str, ...]  # instances that take it as an input
    first: float  # s
    seen: float | None  # [s], when they differ by SEEN of the signal's peak; None: never
    largest: float  # in the signal's unit
    largest_at: float  # s
    unit: str
    relative: float = 1.0  # largest difference over the signal's peak


@dataclass(frozen=True)
class RunComparison:
    """All signals that differ, earliest first, and those that could not be compared."""

    partings: tuple[SignalDifference, ...]
    compared: int  # number of signals
    notes: tuple[str, ...]
    times: int  # number of times at which they were compared

    @property
    def compares_nothing(self) -> bool:
        """Whether the runs have no signal or no time in common."""
        return not self.compared or not self.times


@np.errstate(all="ignore")
def divergence(first: Results, second: Results) -> RunComparison:
    """Compare all signals that both runs recorded, at their common times.

    A recording has times of its own: the other run is interpolated to them, as far as both reach and outside
    gaps. Signals that begin to differ at the same time are in evaluation order, so that causes come first.
    """
    rows, others = _common(first.time, second.time)
    measured = next((run for run in (first, second) if isinstance(run, MeasuredResults)), None)
    notes = [
        f"only {which} recorded {', '.join(dict.fromkeys(star(name) for name in missing))}"
        for which, missing in (
            ("the first", [name for name in first if name not in second]),
            ("the other", [name for name in second if name not in first]),
        )
        if missing
    ]
    shared = [name for name in first if name in second]
    if measured is not None and (inside := _inside(measured, second if measured is first else first)).size:
        time = measured.time[inside]
        values = [{name: _at(time, run, name) for name in shared} for run in (first, second)]
        if any(not np.array_equal(run.time, time) for run in (first, second)):
            where = f"of the recording, {span(time[0], time[-1])} s"
            notes.append(f"compared at {counted(time.size, 'time')} {where}")
    else:
        time = first.time[rows]
        values = [
            {name: run.columns[name][kept] for name in shared}
            for run, kept in ((first, rows), (second, others))
        ]
        if not rows.size:
            notes.append(_no_common_time(first, second))
        elif rows.size < max(first.time.size, second.time.size):
            notes.append(f"compared at the {rows.size} times that both runs have")
    by_signal: dict[str, SignalDifference] = {}
    angles = angles_in(first)
    for name in shared if time.size else []:
        ours, theirs = (run[name] for run in values)
        if name in angles:  # they mean something while both cars move
            for run in (first, second):
                if (stands := standing_in(run, name)) is not None:
                    there = np.interp(time, run.time, stands) > 0.0
                    ours, theirs = (np.where(there, np.nan, x) for x in (ours, theirs))
            if first.units[name] == second.units[name] == "rad":
                ours = nearest_turn(ours, theirs)
        parting = _parting(name, time, ours, theirs, first)
        if parting is not None:
            known = by_signal.get(parting.signal)
            by_signal[parting.signal] = parting if known is None else _together(known, parting)
    order = {instance: i for i, instance in enumerate(first.record.evaluation_order)}
    ranked = sorted(
        by_signal.values(),
        key=lambda p: (p.first, order.get(SignalName.parse(p.signal).instance, len(order))),
    )
    return RunComparison(tuple(ranked), len(shared), tuple(notes), time.size)


def _inside(measured: MeasuredResults, other: Results) -> np.ndarray:
    """Return the rows of a recording whose times lie within another run, and outside its gaps."""
    if not other.time.size:
        return np.zeros(0, dtype=int)
    time = measured.time
    inside = (time >= other.time[0] - 1e-9) & (time <= other.time[-1] + 1e-9)
    notes = (*measured.record.all_diagnostics, *other.record.all_diagnostics)
    return np.flatnonzero(inside & outside((gap for _, gap in gaps_noted(notes)), time))


def _at(time: np.ndarray, run: Results, name: str) -> np.ndarray:
    """Return a signal of a run at some times, interpolated; text as of the row before."""
    values = run.columns[name]
    if not np.issubdtype(values.dtype, np.number):
        return values[np.clip(np.searchsorted(run.time, time + 1e-9, side="right") - 1, 0, None)]
    return np.asarray(np.interp(time, run.time, values))


def _no_common_time(first: Results, second: Results) -> str:
    """Return that two runs have no time in common, and what moves a recording to the run."""
    ends = [
        f"{span(run.time[0], run.time[-1])} s" if run.time.size else "no time at all"
        for run in (first, second)
    ]
    words = f"the runs have no time in common: the first has {ends[0]}, the other {ends[1]}"
    both = first.time.size and second.time.size
    measured = next((run for run in (first, second) if isinstance(run, MeasuredResults)), None)
    if measured is None or not both:
        return words
    return f"{words}; --from '{measured.time[0]:.12g} s' begins the recording with the run"


def _common(first: np.ndarray, second: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the row indices of both arrays at which the times agree to a nanosecond."""
    _, rows, others = np.intersect1d(
        np.round(first * 1e9).astype(np.int64), np.round(second * 1e9).astype(np.int64), return_indices=True
    )
    return rows, others


def _parting(
    name: str, time: np.ndarray, a: np.ndarray, b: np.ndarray, run: Results
) -> SignalDifference | None:
    if not (np.issubdtype(a.dtype, np.number) and np.issubdtype(b.dtype, np.number)):
        unlike = np.flatnonzero(a.astype(str) != b.astype(str))
        if not unlike.size:
            return None
        first = float(time[unlike[0]])
        return SignalDifference(
            star(name), targets_of(run.record, name), first, first, float("nan"), first, ""
        )
    with np.errstate(invalid="ignore"):
        apart = np.abs(a - b)
    apart = np.where(np.isnan(a) & np.isnan(b), 0.0, np.where(np.isnan(apart), np.inf, apart))
    sizes = np.abs(np.concatenate([a, b]))
    sizes = sizes[np.isfinite(sizes)]
    peak = float(sizes.max()) if sizes.size else 0.0
    unlike = np.flatnonzero(apart > SAME * peak)
    if not unlike.size:
        return None
    visible = np.flatnonzero(apart > SEEN * peak)
    largest = int(np.argmax(apart))
    return SignalDifference(
        signal=star(name) if name[-2:] in WHEELS else name,
        targets=targets_of(run.record, name),
        first=float(time[unlike[0]]),
        seen=float(time[visible[0]]) if visible.size else None,
        largest=float(apart[largest]),
        largest_at=float(time[largest]),
        unit=run.units[name],
        relative=float(apart[largest]) / peak,
    )


def _together(first: SignalDifference, second: SignalDifference) -> SignalDifference:
    """Merge the differences of two wheels: the earliest times, the largest difference."""
    widest = max(first, second, key=lambda parting: parting.largest)
    times = [parting.seen for parting in (first, second) if parting.seen is not None]
    return SignalDifference(
        first.signal, first.targets, min(first.first, second.first), min(times, default=None),
        widest.largest, widest.largest_at, first.unit, widest.relative,
    )  # fmt: skip


def targets_of(record: RunRecord, signal: str) -> tuple[str, ...]:
    """Return the instances that a recorded signal is connected to, taken from the run record."""
    name = SignalName.parse(signal)
    return tuple(dict.fromkeys(wire.target.instance for wire in record.connections if wire.source == name))


OF_RUN = ("status", "title", "algorithm", "step_size", "stop_time", "rows")
"""Entries of a record that have a row each."""


class RecordDifference(NamedTuple):
    """An entry that differs between two records; None where a record does not have it."""

    place: str
    first: Any
    second: Any


def differences(a: RunRecord, b: RunRecord) -> list[RecordDifference]:
    """Return the differences between the records of two runs: scenario, instances, wires, versions."""
    first, second = dict(_facts(a)), dict(_facts(b))
    exchanged = tuple(
        f"{instance}." for instance in _names(a) if _names(a)[instance] != _names(b).get(instance)
    )
    both = first.keys() & second.keys()
    return [
        RecordDifference(place, first.get(place), second.get(place))
        for place in dict.fromkeys([*first, *second])
        # different FMUs have different parameters: list only those that both have
        if first.get(place) != second.get(place) and (place in both or not place.startswith(exchanged))
    ]


def _names(record: RunRecord) -> dict[str, str]:
    return {instance: fmu.name for instance, fmu in record.fmus.items()}


def _facts(record: RunRecord) -> Iterator[tuple[str, Any]]:
    """Yield location and value of all entries of a record that are compared."""
    yield "scenario", record.scenario.get("file")
    yield "vehicle file", record.scenario.get("vehicle")
    yield "changed", changed(record.overrides) or None
    for key in OF_RUN:
        yield key, getattr(record, key) if key in record.model_fields_set else None
    for instance, fmu in record.fmus.items():
        yield instance, f"{fmu.name} ({fmu.sha256[:8]})"
        yield f"{instance}.step_size", fmu.step_size
        for values in (fmu.defaults, fmu.parameters, fmu.constants):
            for name, value in values.items():
                yield f"{instance}.{name}", value
    for wire in record.connections:
        yield f"{wire.source} -> {wire.target}", "connected"
    for fault in record.faults:
        yield f"fault of {fault.on}", fault.fault
    yield from record.versions.items()


def differences_table(changes: list[RecordDifference], first: str, second: str) -> Table:
    """Return the table of differences between two records; `first`, `second`: the names of the runs."""
    rows: list[Any] = [[place, _text(a), _text(b)] for place, a, b in changes]
    return Table("Inputs of the runs", ["", first, second], rows)


def _text(value: Any) -> str | None:
    if isinstance(value, bool) or not isinstance(value, float):
        return None if value is None else str(value)
    return f"{value:.10g}"


MOST_DIFFERENT = 6
"""Number of most different signals drawn; chosen: three rows of two panels fill a screen."""
AT_ONCE = 8
"""Differences shown; the rest are collapsed. Chosen: more than the wires of one instance."""
RULE = (
    f"A difference counts from {SAME * 1e9:g} billionth of the signal's largest value; curves can be seen to "
    f"part from {100 * SEEN:g} %."
)
LESS_IS_BETTER = (
    "relative_peak_error", "mean_error", "rms_error", "stability_index", "overshoot", "settling_time",
    "slope_variation_rate", "effort", "total_variation_rate",
)  # fmt: skip
"""Measures that are better the smaller they are; for others, such as displacement, it depends."""
OF_CONTROL = ("effort", "total_variation_rate")
"""Measures of control activity: a controller that does nothing has small values, too."""


def comparison_facts(findings: ExperimentResult) -> dict[str, Any] | None:
    """Return the template data of a page that compares runs with the first one; None if none has results.

    `views`: of its viewer, with the signals that differ most.
    """
    runs = [
        LabelledRun(run.label, findings.results[name])
        for name, run in findings.experiment.runs.items()
        if name in findings.results
    ]
    if not runs:
        return None
    first, *others = runs
    divergences = [divergence(first.results, other.results) for other in others]
    return {
        "table": metric_table(findings, runs),
        "views": _most_different(divergences),
        "partings": [
            _parted(run.label, first.label, difference)
            for run, difference in zip(others, divergences, strict=True)
        ],
        "rule": RULE,
    }


BEST = "★"
"""Mark of the best value of a metric."""


def metric_table(findings: ExperimentResult, runs: Sequence[LabelledRun]) -> Table:
    """Return the metrics of all runs with results, each with its difference from the first below it."""
    headings = ["metric", "definition", *(marked(*run) for run in runs)]
    table = Table("", headings, notes=remarks(runs), numbers=range(2, len(headings)))
    if len(runs) > 1:
        table.notes.append(
            f"Below each value: the difference from {headings[2]}. {BEST}: the best value, for metrics where "
            "less is better."
        )
    idle = _idle(findings)
    for key, spec in findings.spec.metrics.items():
        chosen = metric(spec.metric)
        values = [findings.values.get((name, key)) for name in findings.results]
        measure = chosen.name.partition("(")[0]
        least = _best(values, idle if measure in OF_CONTROL else ()) if measure in LESS_IS_BETTER else None
        cells = [
            shown(value.number, value.shown_in)
            + f" {BEST}" * (k == least)
            + (f"\n{apart}" if k and (apart := difference(values[0], value)) else "")
            if value
            else None
            for k, value in enumerate(values)
        ]
        table.rows.append([chosen.title, chosen.formula, *cells])
    return table


def _idle(findings: ExperimentResult) -> set[int]:
    """Return the indices of runs without control: the effort or chatter of some signal is zero."""
    of_control = [
        key
        for key, spec in findings.spec.metrics.items()
        if metric(spec.metric).name.partition("(")[0] in OF_CONTROL
    ]
    controls = [[findings.values.get((name, key)) for key in of_control] for name in findings.results]
    return {
        k
        for k, values in enumerate(controls)
        if any(value is not None and value.number == 0 for value in values)
    }


def _best(values: Sequence[MetricValue | None], apart: Collection[int]) -> int | None:
    """Return the index of the run whose displayed value is smallest; None if several share it.

    Args:
        values: of all runs.
        apart: indices of runs to leave out.
    """
    known = sorted(
        (value.number, k) for k, value in enumerate(values) if value is not None and k not in apart
    )
    if len(known) < 2:
        return None
    (first, best), (second, _) = known[:2]
    unit = next(value.shown_in for value in values if value is not None)
    return None if shown(first, unit) == shown(second, unit) else best


def _most_different(comparisons: Sequence[RunComparison]) -> list[View]:
    """Return the view of the signals that differ most from the first run, relative to their peaks."""
    apart: dict[str, float] = {}
    for parting in (parting for comparison in comparisons for parting in comparison.partings):
        name = variable_of(parting.signal)
        if "*" not in name and not name.startswith("position_"):  # one line per run in each panel
            apart[name] = max(apart.get(name, 0.0), parting.relative)
    names = sorted(apart, key=lambda name: -apart[name])[:MOST_DIFFERENT]
    return [View("The signals that differ most", names)] if names else []


def difference(first: MetricValue | None, other: MetricValue | None) -> str:
    """Return the signed difference of a value from the first; ratios in per cent differ by points."""
    if first is None or other is None:
        return ""
    apart = other.number - first.number
    if not math.isfinite(apart):
        return ""
    unit, factor = shown_unit(other.shown_in)
    if apart == 0:
        return "the same"
    size = digits_of(abs(apart) * factor)
    return f"{'+' if apart > 0 else '−'}{size} {'points' if unit == '%' else unit}".rstrip()


def _parted(label: str, first: str, comparison: RunComparison) -> dict[str, Any]:
    return {
        "title": f"{label} against {first}",
        "summary": parting_summary(comparison),
        "table": partings_table(comparison.partings[:AT_ONCE]),
        "rest": partings_table(comparison.partings[AT_ONCE:]),
        "notes": comparison.notes,
    }


def parting_summary(comparison: RunComparison) -> str:
    """Return a sentence on the signals that differ first."""
    if not comparison.compared:
        return "The runs have no signal in common."
    if not comparison.times:
        return "The runs have no time in common, so nothing was compared."
    if not comparison.partings:
        which = (
            "The only signal they share is"
            if comparison.compared == 1
            else f"All {comparison.compared} signals are"
        )
        return f"{which} the same throughout."
    first = comparison.partings[0]
    others = [parting.signal for parting in comparison.partings if parting.first == first.first][1:]
    more = " and others" if len(others) > 3 else ""
    then = f", then {', '.join(others[:3])}{more} in the same step" if others else ""
    visible = [(parting.seen, parting.signal) for parting in comparison.partings if parting.seen is not None]
    sentence = "The difference is not visible in any curve."
    if visible:
        at, signal = min(visible, key=lambda item: item[0])
        sentence = f"It is visible from {at:g} s on, first in {signal}."
    return f"The first to differ is {first.signal}, at {first.first:g} s{then}. {sentence}"


def partings_table(partings: Sequence[SignalDifference], title: str = "") -> Table:
    """Return the table of signals that differ between two runs, the earliest first."""
    headings = ["signal", "goes to", "differs from", "visible from", "largest difference", "at"]
    table = Table(title, headings, numbers={2, 3, 4, 5} if partings else set())
    for parting in partings:
        table.rows.append([
            parting.signal,
            ", ".join(parting.targets) or "recorded only",
            f"{parting.first:g} s",
            None if parting.seen is None else f"{parting.seen:g} s",
            None if math.isnan(parting.largest) else shown(parting.largest, unit_of_signal(parting.unit)),
            f"{parting.largest_at:g} s",
        ])  # fmt: skip
    return table


def outcome_table(comparison: RunComparison, first: Results, second: Results) -> Table:
    """Return the table of all signals that differ, with notes on what could not be compared."""
    table = partings_table(comparison.partings, "What came out")
    ended = [float(run.time[-1]) for run in (first, second) if run.time.size]
    ends = {f"{end} s" for end in resolved(*ended)}
    table.notes += comparison.notes
    table.notes += [f"The runs end at {' and '.join(sorted(ends))}."] if len(ends) > 1 else []
    if comparison.compares_nothing:
        table.notes.append("Nothing was compared.")
    else:
        compared = f"{counted(comparison.compared, 'signal')} compared at {counted(comparison.times, 'time')}"
        same = "the others are the same" if comparison.partings else "no difference"
        table.notes.append(f"{compared}; {same}.")
    return table
