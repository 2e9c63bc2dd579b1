"""Interactive view of an experiment along axes: a map with numbers, parallel coordinates, a limit to move.

A click on a point opens its run in the viewer: runs whose results are kept have a file each beside the page,
`data/<key>.js`; for the others the page has the command that makes them.
"""

from __future__ import annotations

import math
import shlex
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

from markupsafe import Markup

from yawbench.figures.display import LabelledRun, digits_of, shown, shown_unit
from yawbench.foundation.errors import ResultsError
from yawbench.foundation.messages import counted, listed
from yawbench.metrics.expressions import metric
from yawbench.metrics.measures import variable_of
from yawbench.metrics.verdict import RELATIONS
from yawbench.orchestrator.plan import Override
from yawbench.orchestrator.results.reader import load_results
from yawbench.orchestrator.results.run_record import RUN_FILE
from yawbench.studies.axes import RUN, Level, changes_at
from yawbench.studies.claim_schema import MetricReference, si_number
from yawbench.studies.experiment import Case, LoadedExperiment
from yawbench.studies.experiment_result import Each, ExperimentResult
from yawbench.studies.jobs import NOT_MADE, Job
from yawbench.studies.limits import Limit, limits_of

from .page_parts import Part, option_of, render
from .viewer import DATA, LEAST, METRICS, Settings, carried, embedded, tidy_sides, write_side
from .viewer_views import PANELS, Bound, View

SWEEP_ASSETS = ("sweep.js", "sweep.css")
"""Script and style sheet of the view."""
KEY = 12
"""Characters of a run's key that name its file, as they name its folder."""
DIGITS = 6
"""Significant digits of the numbers that the view carries; chosen: more than it shows."""
MOST_METRICS = 8
"""Metrics in the table of an opened run."""


@dataclass(frozen=True, kw_only=True)
class SweepPart(Part):
    """A view of a sweep: its anchor, data for the script, the viewer of a run, how runs ended."""

    template = "sweep.html.j2"
    name: str
    data: dict[str, Any]
    frame: Markup
    counts: str


def sweep_view(findings: ExperimentResult, name: str, sides: Mapping[int, str]) -> Markup:
    """Return the view of an experiment along axes as part of a page.

    Args:
        findings: the experiment and the records of its runs.
        name: its anchor.
        sides: number of a case -> key of its side file; see `write_sides`.
    """
    view = SweepPart(
        name=name, data=_data(findings, sides) | {"folder": DATA},
        frame=embedded(None, f"{name}-run"), counts=status_counts(findings),
    )  # fmt: skip
    return Markup(render(view))


def status_counts(findings: ExperimentResult) -> str:
    """Return how many runs there are, and how many of them ended with each status."""
    counts = Counter(record.status for record in findings.records)
    words = [f"{count} {status}" for status, count in counts.items()]
    return f"{counted(len(findings.records), 'run')}: {listed(words)}"


def sweep_sentence(findings: ExperimentResult) -> str:
    """Return the limits of an experiment along axes, or else the range of its first metric."""
    return " ".join(limit_sentences(findings)) or range_sentence(findings)


def limit_sentences(findings: ExperimentResult) -> list[str]:
    """Return a sentence per limit: its smallest and largest value for each run and value of named axes."""
    planned, sentences = findings.planned, []
    assert planned is not None
    for spec in findings.spec.limits.values():
        unit = planned.axis_unit(spec.of).strip(" []")
        groups: dict[tuple[str, ...], list[Limit]] = {}
        ranges: dict[str, list[Level]] = {}
        for limit in limits_of(findings, spec):
            named = [k for k in limit.others if k == RUN or not findings.spec.axes[k].numeric]
            groups.setdefault(tuple(limit.others[k].words for k in named), []).append(limit)
            for k in limit.others.keys() - set(named):
                ranges.setdefault(k, []).append(limit.others[k])
        parts = [f"{', '.join(words)} {_reach(limits, unit)}".strip() for words, limits in groups.items()]
        over = [
            f"{k} {min(levels, key=_number).words} to {max(levels, key=_number).words}"
            f"{planned.axis_unit(k).replace('[', '').replace(']', '')}"
            for k, levels in ranges.items()
        ]
        where = f", over {listed(over)}" if over else ""
        sentences.append(f"{spec.says.rstrip('.')}: {'; '.join(parts)}{where}.")
    return sentences


def _number(level: Level) -> float:
    return float(level.value)


def _reach(limits: Sequence[Limit], unit: str) -> str:
    """Return the values of limits as a range; `at least` where no value fails, or its run is missing."""
    tried = [limit for limit in limits if limit.largest is not None or not limit.missing]
    if not tried:
        return "unknown, as no run was made"
    known = [(limit.largest, limit) for limit in tried if limit.largest is not None]
    if not known:
        return "at no value tried"
    least, most = (end(known, key=lambda pair: pair[0]) for end in (min, max))
    ends = [most] if least[0] == most[0] else [least, most]
    texts = [
        ("at least " if limit.beyond is None or limit.missing else "") + digits_of(largest)
        for largest, limit in ends
    ]
    if len(known) < len(tried):
        texts = ["from none", texts[-1]]
    return f"{' to '.join(texts)} {unit}".rstrip()


def range_sentence(findings: ExperimentResult) -> str:
    """Return the smallest and largest value of the first metric, and where they are; "" without numbers."""
    for key, spec in findings.spec.metrics.items():
        values = [
            (value.number, case.number)
            for case in findings.experiment.cases
            if (value := findings.value(case, key)) is not None and math.isfinite(value.number)
        ]
        if values:
            unit = findings.unit(key)
            ends = [
                f"{shown(x, unit)} ({findings.words(findings.experiment.cases[number])})"
                for x, number in (min(values), max(values))
            ]
            title = spec.heading or metric(spec.metric).title
            return f"{title[:1].upper()}{title[1:]}: {ends[0]} to {ends[1]}."
    return ""


# ---- data of the view ----


def _data(findings: ExperimentResult, sides: Mapping[int, str]) -> dict[str, Any]:
    experiment, records = findings.experiment, findings.records
    cases, for_all, by_options = experiment.cases, experiment.for_all, experiment.by_options
    axes = [*_axes(findings)]
    statuses = list(dict.fromkeys(record.status for record in records))
    return {
        "axes": [axis for axis, _ in axes],
        "metrics": [_metric(findings, key) for key in findings.spec.metrics],
        "levels": [places for _, places in axes],
        "statuses": statuses,
        "status": [statuses.index(record.status) for record in records],
        "made": [status != NOT_MADE.status for status in statuses],
        "told": {case.number: why for case in cases if (why := _remark(findings, case))},
        "keys": "".join(key[:KEY].ljust(KEY) for key in findings.planned.keys) if findings.planned else "",
        "sides": [number in sides for number in range(len(cases))],
        "base": [
            ["yawbench", "run", str(run.scenario), *_words([*for_all, *run.changes, *by_options])]
            for run in experiment.runs.values()
        ],
        "of_run": [[*experiment.runs].index(case.run.name) for case in cases],
        "grid": findings.spec.design == "grid" and not experiment.design,
        **_chosen(findings),
    }  # fmt: skip


def _axes(findings: ExperimentResult) -> Iterator[tuple[dict[str, Any], list[int]]]:
    """Yield each axis that varies, and the index of the level of every case on it."""
    experiment, planned = findings.experiment, findings.planned
    assert planned is not None
    if len(experiment.runs) > 1:
        runs = [*experiment.runs]
        labels = [run.row or run.label or run.name for run in experiment.runs.values()]
        about: dict[str, Any] = {"name": RUN, "label": "run", "words": labels, "unit": "", "numbers": None}
        yield about | {"log": False}, [runs.index(case.run.name) for case in experiment.cases]
    for k, (name, axis) in enumerate(findings.spec.axes.items()):
        every = dict.fromkeys(point[k] for point in experiment.points)
        levels = sorted(every, key=_number) if axis.numeric else [*every]
        applies = [any(fnmatchcase(run, pattern) for pattern in axis.runs) for run in experiment.runs]
        about = {
            "name": name,
            "label": axis.says or name,
            "unit": planned.axis_unit(name).strip(" []").replace(".", "·"),
            "words": _texts(levels) if axis.numeric else [level.words for level in levels],
            "numbers": [_number(level) for level in levels] if axis.numeric else None,
            "log": axis.spacing == "log",
            "repeats": axis.repeats,
            "drawn": name in findings.spec.drawn,
            "scenarios": _scenarios(experiment, k, levels),
            "options": [_words(changes_at(axis, level, experiment.path.parent)) for level in levels],
            "applies": applies,
        }
        index = {level: number for number, level in enumerate(levels)}
        yield about, [index[case.point[k]] for case in experiment.cases]


def _scenarios(experiment: LoadedExperiment, axis: int, levels: Sequence[Level]) -> list[str] | None:
    """Return the scenario of each level of an axis; None if these leave that of the run."""
    spec = [*experiment.spec.axes.values()][axis]
    named = [spec.variants[str(level.value)].scenario if spec.variants else "" for level in levels]
    return [str(experiment.path.parent / one) if one else "" for one in named] if any(named) else None


def _texts(levels: Sequence[Level]) -> list[str]:
    """Return the words of numbers, rounded as far as the numbers stay apart."""
    for digits in range(3, 7):
        texts = [min(level.words, digits_of(_number(level), digits), key=len) for level in levels]
        if len({*texts}) == len(levels):
            return texts
    return [level.words for level in levels]


def _words(changes: Sequence[Override]) -> list[str]:
    """Return overrides as words of a command line."""
    return [shlex.quote(word) for change in changes for word in option_of(change)]


def _metric(findings: ExperimentResult, key: str) -> dict[str, Any]:
    spec = findings.spec.metrics[key]
    unit, factor = shown_unit(findings.unit(key))
    measured = [findings.value(case, key) for case in findings.experiment.cases]
    values = [
        _rounded(value.number * factor) if value and math.isfinite(value.number) else None
        for value in measured
    ]
    return {"name": key, "label": spec.heading or metric(spec.metric).title, "unit": unit, "values": values}


def _rounded(number: float) -> float:
    return float(f"{number:.{DIGITS}g}")


def _remark(findings: ExperimentResult, case: Case) -> str:
    """Return why a run failed or ended early, and its warnings."""
    record = findings.record(case)
    return "; ".join(filter(None, [record.reason if record.made else "", ", ".join(record.warning_codes)]))


def _chosen(findings: ExperimentResult) -> dict[str, Any]:
    """Return the initial state of the view: axes of the map, its metric, and the limits of metrics."""
    spec = findings.spec
    limits: dict[str, dict[str, Any]] = {}
    bounds = [
        (condition.metric, condition.bound, not RELATIONS[condition.relation].upwards)
        for limit in (*spec.limits.values(), *spec.probabilities.values())
        for condition in limit.holds_if
    ]
    bounds += [
        (figure.metric, figure.mark, True)
        for figure in spec.figures
        if figure.metric and figure.mark is not None
    ]
    for key, bound, at_most in bounds:
        if key in spec.metrics and key not in limits and not isinstance(bound, MetricReference):
            unit = findings.unit(key)
            factor = shown_unit(unit)[1]
            limits[key] = {"bound": _rounded(si_number(bound, unit) * factor), "at_most": at_most}
    drawn = next((figure for figure in spec.figures if figure.kind == "map"), None)
    named = [RUN] * (len(findings.experiment.runs) > 1) + [*spec.axes]
    names = sorted(named, key=lambda k: k == RUN or not spec.axes[k].numeric or spec.axes[k].repeats)
    if drawn:
        first = [drawn.x, drawn.y, drawn.panel_axis]
    else:
        of = next((limit.of for limit in spec.limits.values()), "")
        others = [k for k in names if k != of]
        first = [*others[:1], of, *others[1:2]] if of else names[:3]
    if spec.sampled and not drawn:  # what is drawn makes the map, and a listed axis its panels
        apart = [""] if len(spec.drawn) == 1 else []
        first = [*spec.drawn[:2], *apart, *(k for k in named if k not in spec.drawn)]
    else:
        first = [k for k in dict.fromkeys([*first, *names]) if k and (k in first or k not in spec.drawn)]
    return {
        "limits": limits,
        "metric": (drawn.metric if drawn else "") or next(iter(limits), "") or next(iter(spec.metrics), ""),
        "map": first[:3],
    }  # fmt: skip


# ---- the runs beside the page ----


def write_sides(findings: ExperimentResult, folder: Path, each: Each = map) -> dict[int, str]:
    """Write a side file for every run along axes that has results; return number of its case -> key.

    Args:
        findings: the experiment and its plans.
        folder: of its results; the files go to its subfolder `data`.
        each: `map`, or a parallel equivalent.
    """
    jobs = findings.planned.jobs if findings.planned else []
    kept = [
        (case, job)
        for case, job in zip(findings.experiment.cases, jobs, strict=True)
        if job.keep and (job.out / RUN_FILE).is_file()
    ]
    settings = side_settings(findings)
    wanted = [(job, findings.words(case), settings, folder) for case, job in kept]
    written = list(each(_write_side, *zip(*wanted, strict=True))) if wanted else []
    keys = {case.number: job.key[:KEY] for (case, job), done in zip(kept, written, strict=True) if done}
    tidy_sides(folder, set(keys.values()))
    return keys


def side_settings(findings: ExperimentResult) -> Settings:
    """Return the settings of a run's viewer: the signals of its metrics first, their limits, its metrics."""
    metrics = {key: metric(spec.metric) for key, spec in findings.spec.metrics.items()}
    signals = dict.fromkeys(variable_of(each.signal) for each in metrics.values() if "*" not in each.signal)
    panels = tuple(dict.fromkeys([*PANELS, *signals]))
    limits = []
    for key, limit in _chosen(findings)["limits"].items():
        bounded = metrics[key]
        if bounded.name.startswith("peak(") and not bounded.other:
            level = limit["bound"] / shown_unit(findings.unit(key))[1]
            limits += [Bound(bounded.signal, side * level, "limit") for side in (1.0, -1.0)]
    names = [spec.metric for spec in findings.spec.metrics.values()][:MOST_METRICS] or METRICS
    return Settings([View(panels=panels)], names, limits=limits, largest=LEAST)


def _write_side(job: Job, label: str, settings: Settings, folder: Path) -> bool:
    """Write the side file of a run; return False if its results cannot be shown."""
    try:
        content = carried([LabelledRun(label, load_results(job.out))], settings)
    except ResultsError:
        return False
    write_side(folder, job.key[:KEY], content)
    return True
