"""Interactive viewer of runs: signals over time, differences, the road from above; part of a page, or a page.

`viewer` is a part of a page, `assets` are the page's style sheets and scripts. A page needs no server and no
network. It carries every recorded sample (`viewer_samples`); axes and zooming are those of uPlot, from the
installed package `uplot-python`.
"""

from __future__ import annotations

import json
import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import accumulate, pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from markupsafe import Markup

from yawbench.events.kinds import events_in
from yawbench.events.why import Reason, far_of, label_of, lost_among
from yawbench.figures import panels as of_figures
from yawbench.figures.display import LabelledRun, digits_apart, shown, shown_unit, shown_value, unit_of_signal
from yawbench.figures.plots import changes_of, spans_of
from yawbench.figures.style import LINES, MEASURED_LINE, line_style
from yawbench.foundation.errors import ResultsError
from yawbench.foundation.messages import listed
from yawbench.foundation.safe_files import write_whole
from yawbench.measurements.measured_results import MeasuredResults
from yawbench.metrics.expressions import (
    Metric,
    MetricValue,
    columns_of,
    evaluate,
    metric,
    reference_of,
    while_moving,
)
from yawbench.metrics.measures import words
from yawbench.orchestrator.results.reader import Results
from yawbench.orchestrator.results.run_record import RunStatus
from yawbench.orchestrator.scenario.overrides import with_words

from .page_parts import Assets, Part, ViewerPage, render, static, without_comments
from .phase_planes import planes_of
from .road import legend_of, notes_of, road_of, without_tyres
from .viewer_samples import PackedRun, is_numeric, pack
from .viewer_views import Bound, Mark, View, views_of

SCRIPTS = (
    "viewer_data.js", "viewer_panels.js", "viewer_draw.js", "viewer_picture.js", "viewer_events.js",
    "viewer_scene.js", "viewer_close_up.js", "viewer_space.js", "viewer_road.js", "viewer.js",
    "viewer_side.js",
)  # fmt: skip
SHEETS = ("uPlot.min.css", "viewer.css")
MOST = 200
"""Largest number of runs in one viewer. Chosen: beyond the runs of any study; colours repeat after seven."""
FIRST = 14
"""Largest number of runs shown at first, where none are chosen. Chosen: two of each of seven colours."""
METRICS = ("peak(sideslip)", "peak(yaw_rate)", "peak(acceleration_y)", "peak(yaw_moment)")
"""Metrics in the table of runs, by default."""
FEW = 4
"""Runs that a page's heading and sentence name each. Chosen: more are read better in the table of runs."""
LARGEST = 2_200_000
"""Size of the samples in a page [bytes]. Chosen: with its text a page of 2.5 MB, which opens at once, also by
mail."""
LEAST = 1
"""Size of the samples of runs in files of their own: the signals of views and road alone, without planes."""
STILL = ("sideslip", "yaw_rate")
"""Signals whose largest value sets the cursor at first."""


@dataclass(frozen=True)
class Settings:
    """Settings of a viewer.

    Attributes:
        views: to choose from; the first is shown at first.
        metrics: those in the table of runs.
        marks, limits: dashed lines; those of a run are hidden with it.
        largest: size of the samples [bytes]; beyond it, the page carries the signals of the views and of the
            road alone, still beyond it, of the road without the forces of the tyres, and then no phase planes
            either. 0: no limit.
        ghosts: numbers of runs that are drawn faintly behind the others.
        bands: numbers of runs whose closed line is filled, behind all others; not over time.
        offsets: number of a measured run -> time [s] by which it is drawn later at first.
        comparable: whether the runs are under the same conditions, so that the best of them stands beside one
            that was lost.
    """

    views: Sequence[View] = (View(),)
    metrics: Sequence[str] = METRICS
    marks: Sequence[Mark] = ()
    limits: Sequence[Bound] = ()
    largest: int = 0
    ghosts: Sequence[int] = ()
    bands: Sequence[int] = ()
    offsets: Mapping[int, float] = field(default_factory=dict)
    comparable: bool = True


SETTINGS = Settings()


def viewer(
    runs: Sequence[LabelledRun],
    settings: Settings = SETTINGS,
    *,
    name: str = "view",
    alone: bool = False,
    packed: Sequence[PackedRun] | None = None,
) -> Markup:
    """Return the viewer of runs as part of a page.

    Args:
        runs: with their labels; the first of a view is the baseline.
        settings: what it shows.
        name: its anchor, which the page's address refers to; letters, digits and hyphens.
        alone: whether it is the only one, so that keys need no focus.
        packed: the runs' samples; default: packed here.

    Raises:
        ResultsError: there are no runs, more than `MOST`, or one without samples.
    """
    return embedded(carried(runs, settings, packed), name, alone=alone)


class Carried(NamedTuple):
    """Data of a viewer in a page: a description of the runs, and their samples."""

    data: dict[str, Any]
    blocks: Sequence[PackedRun]


@dataclass(frozen=True, kw_only=True)
class ViewerPart(Part):
    """A viewer: its anchor, the description of its runs (None: a script fills it) and their samples."""

    template = "viewer.html.j2"
    name: str
    data: dict[str, Any] | None
    blocks: Sequence[PackedRun]


def embedded(content: Carried | None, name: str, *, alone: bool = False) -> Markup:
    """Return a viewer as part of a page; without content, a script fills it with runs of side files."""
    data = content and content.data | {"alone": alone, "file": name}
    return Markup(render(ViewerPart(name=name, data=data, blocks=content.blocks if content else [])))


DATA = "data"
"""Folder of the side files, beside the page."""


def write_side(folder: Path, key: str, content: Carried | None, *, html: str = "") -> None:
    """Write a script that hands runs to the page that loads it: pages opened as files cannot fetch.

    Args:
        folder: of the page.
        key: by which the page asks for it.
        content: of the viewer; None: the file has only `html`.
        html: markup that the page shows with the runs.
    """
    data, blocks = content or (None, [])
    parts = {"data": data, "blocks": [run.block for run in blocks], "html": html}
    text = f"yawbenchSide({json.dumps(key)}, {json.dumps(parts, ensure_ascii=False)});\n"
    (folder / DATA).mkdir(parents=True, exist_ok=True)
    write_whole(folder / DATA / f"{key}.js", text)


def tidy_sides(folder: Path, keys: Collection[str]) -> None:
    """Remove side files that the page in a folder does not refer to."""
    for file in (folder / DATA).glob("*.js"):
        if file.stem not in keys:
            file.unlink()


@np.errstate(all="ignore")
def carried(
    runs: Sequence[LabelledRun], settings: Settings = SETTINGS, packed: Sequence[PackedRun] | None = None
) -> Carried:
    """Return what a page carries for the viewer of runs.

    Raises:
        ResultsError: see `viewer`.
    """
    if not 1 <= len(runs) <= MOST:
        raise ResultsError(f"a viewer shows one to {MOST} runs, not {len(runs)}.")
    if empty := [run.label for run in runs if not run.results.time.size]:
        raise ResultsError(f"{empty[0]}: no samples were recorded.")
    results = [run.results for run in runs]
    grounds: list[Any] = []
    roads = [road_of(run.results, grounds) for run in runs]
    planes, curves = ([], []) if settings.largest == LEAST else planes_of(results)
    drawn = [_drawn(view, results) for view in (*settings.views, *planes)]
    views = [view for view in drawn if view["panels"]] or drawn[:1]
    own = [view for view in views if any(view is one for one in drawn[: len(settings.views)])] or views[:1]
    packed = packed or pack(results)
    axes_of = {  # of a plane, in which every run has curves
        (x, y): [*zip(_columns(results, x), _panels(results, y), strict=False)]
        for x, y in dict.fromkeys((curve.x, curve.y) for curve in curves)
    }
    notes = [notes_of(run.results, road) for run, road in zip(runs, roads, strict=True)]
    every, sparse = packed, [road and without_tyres(road) for road in roads]
    for views_kept, roads_kept in ((views, roads), (views, sparse), (own, sparse)):
        if not settings.largest or all(size <= settings.largest for size in _sizes(packed)):
            break
        views, roads, needed = views_kept, roads_kept, _needed(views_kept, roads_kept)
        packed = [run.only(needed) for run in every]
    carried = {name for run in packed for name in run.columns}
    data = {
        "views": views,
        "grounds": grounds,
        "still": still_of(results),
        "limits": [
            [column, bound, text, run]
            for signal, bound, text, run in settings.limits
            for column in _columns(results, signal)
        ],
        "marks": [list(mark) for mark in settings.marks],
        "offsets": dict(settings.offsets),
        "curves": [
            [x, y, text, [*xs], [*ys], run]
            for x_name, y_name, text, xs, ys, run in curves
            for x, panel in axes_of[x_name, y_name]
            for y in [panel.partition(",")[0]]
            if {x, *y.split(" + ")} <= carried
        ],
        "why": [
            [number, [_sentence(reason, number, best, reasons[-1]) for reason in reasons], best]
            for number, reasons, best in lost_among(
                [*map(events_in, results)], comparable=settings.comparable
            )
        ],
        "signals": {name: signal for name, signal in _signals(results).items() if name in carried},
        "dashes": [_dash(number) for number in range(len(LINES))],
        "metrics": [
            [metric(name).title, values] for name in settings.metrics if any(values := _values(runs, name))
        ],
        "key": legend_of(roads, grounds),
        "partial": packed is not every,
        "runs": [
            {
                "label": run.label,
                "faults": [[span.begin, span.end, span.label] for span in spans_of([run])],
                "notes": notes[number],
                "events": _events(run.results),
                "folder": str(run.results.folder) if run.results.folder != Path() else "",
                "road": road,
                "ghost": number in settings.ghosts,
                "band": number in settings.bands,
                **({"dash": MEASURED_LINE[1]} if isinstance(run.results, MeasuredResults) else {}),
                **block.header,
            }
            for number, (run, road, block) in enumerate(zip(runs, roads, packed, strict=True))
        ],
    }
    return Carried(data, packed)


def _sentence(reason: Reason, run: int, best: int | None, loss: Reason) -> list[Any]:
    """Return a reason's sentence, its instant, else that of the loss, and the run in which it can be seen."""
    event = reason.event or loss.event
    return [str(reason), event and event.time, best if reason.beside else run]


def _events(run: Results) -> list[dict[str, Any]]:
    """Return the events of a run as the viewer lists them; those that several columns tell alike, once."""
    found: dict[tuple[float, str], dict[str, Any]] = {}
    for event in events_in(run):
        label = label_of(event)
        unit = unit_of_signal(run.units.get(event.signal, "")) if event.unit == "SI" else event.unit
        listed = {"time": event.time, "until": event.until, "label": label, "far": far_of(event, unit)}
        found.setdefault((event.time, label), listed | {"signal": event.signal})
    return [*found.values()]


def _sizes(packed: Sequence[PackedRun]) -> Iterator[int]:
    """Yield the size of the samples, run by run added up, so that no more are compressed than needed."""
    return accumulate(len(run.block) for run in packed)


def assets(*names: str, package: str = __package__) -> Assets:
    """Return what all viewers of a page share, and style sheets and scripts of `static/` of a package."""
    scripts, sheets = ([name for name in names if name.endswith(kind)] for kind in (".js", ".css"))
    plotter = f"const makeUPlot = (devicePixelRatio) => {{\n{static('uPlot.iife.js')}\nreturn uPlot;\n}};"
    script = "\n".join([plotter, *map(static, SCRIPTS), *(static(name, package) for name in scripts)])
    return Assets(
        style="\n".join([*map(static, SHEETS), *(static(name, package) for name in sheets)]),
        script=f"(() => {{\n'use strict';\n{without_comments(script)}}})();\n",
    )


def page(runs: Sequence[LabelledRun], settings: Settings = SETTINGS, *, title: str = "") -> str:
    """Return a viewer as a page.

    Args:
        runs, settings: see `viewer`.
        title: of the page; default: the scenario's title of a single run with its overrides, else the
            labels, of many runs the first.
    """
    titles = dict.fromkeys(filter(None, (run.results.record.title for run in runs)))
    made = with_words("; ".join(titles), changes_of(runs))
    alone = len(runs) == 1 and bool(titles) and not title
    view = ViewerPage(
        title=made if alone else title or _title(runs),
        sentence=answer_of(runs),
        below="" if alone else made,
        viewer=viewer(runs, settings, name="run", alone=True),
        assets=assets(),
    )
    return render(view)


def _title(runs: Sequence[LabelledRun]) -> str:
    if len(runs) > FEW:
        return f"{runs[0].label} and {len(runs) - 1} other runs"
    return " and ".join(run.label for run in runs)


def answer_of(runs: Sequence[LabelledRun]) -> str:
    """Return how runs ended and their largest sideslip angle, or else the first metric that all have.

    A sentence; "" if they completed and share no metric.
    """
    ends = [
        f"{run.label} failed at {shown(float(run.results.time[-1]), 's')}"
        for run in runs
        if run.results.record.status not in (RunStatus.UNKNOWN, RunStatus.COMPLETED)
    ]
    ends += [f"{run.label}: {run.results.ended.rstrip('.')}" for run in runs if run.results.ended]
    parts = ends[:FEW]
    if len(ends) > FEW:
        parts.append(f"{len(ends) - FEW} more of {len(runs)} runs failed or ended early")
    for name in METRICS:
        values = [value for run in runs if (value := evaluate(run.results, metric(name)))]
        if 0 < len(values) == len(runs):
            parts.append(f"largest {words(metric(name).signal).lower()}: {_compared(runs, values)}")
            break
    sentence = "; ".join(parts)
    return f"{sentence[:1].upper()}{sentence[1:]}." if sentence else ""


def _compared(runs: Sequence[LabelledRun], values: Sequence[MetricValue]) -> str:
    """Return the values of a metric with their runs; of many runs, the smallest and the largest."""
    unit, numbers = values[0].shown_in, [value.number for value in values]
    digits = digits_apart(pairwise(sorted(numbers)), unit)
    texts = [
        f"{shown(number, unit, digits=digits)} ({run.label})"
        for number, run in zip(numbers, runs, strict=True)
    ]
    if len(texts) == 1:
        return shown(numbers[0], unit)
    if len(texts) <= FEW:
        return listed(texts)
    ends = (texts[numbers.index(pick(numbers))] for pick in (min, max))
    return f"{' to '.join(ends)}, of {len(texts)} runs"


def _dash(number: int) -> Sequence[float]:
    pattern = line_style(number)["linestyle"]
    return pattern[1] if isinstance(pattern, tuple) else ()


def _columns(results: Sequence[Results], signal: str) -> list[str]:
    """Return the columns that a signal names in any run, each once."""
    return list(dict.fromkeys(name for run in results for name in columns_of(run, signal)))


def _drawn(view: View, results: Sequence[Results]) -> dict[str, Any]:
    """Return a view with the columns of its panels."""
    shown = list(range(len(results)) if view.shown is None else view.shown)
    runs = [results[number] for number in shown]
    panels = list(dict.fromkeys(panel for spec in view.panels for panel in _panels(runs, spec)))
    x = view.x if view.x == "time" else next(iter(_columns(runs, view.x)), "time")
    return {"title": view.title, "shown": shown if view.shown else shown[:FIRST], "panels": panels, "x": x}


def _panels(results: Sequence[Results], spec: str) -> Iterator[str]:
    """Yield the panels that a name selects: columns, each with the column of its reference."""
    first, *others = (part.strip() for part in spec.split(","))
    if " + " in first:
        terms = [_columns(results, term)[:1] for term in first.split(" + ")]
        if all(terms):
            yield " + ".join(column for term in terms for column in term)
        return
    minuend, _, subtrahend = first.partition(" - ")
    error = minuend.removesuffix("_error")
    for column in _columns(results, minuend) or _columns(results, error):
        names = (reference_of(run, column) for run in results if column in run.columns)
        references = [name for name in dict.fromkeys(names) if name]
        if subtrahend or (error != minuend and not _columns(results, minuend)):
            taken = _columns(results, subtrahend) if subtrahend else references
            yield from (f"{column} - {name}" for name in taken[:1])
        else:
            beside = [name for other in others for name in _columns(results, other)]
            yield ",".join([column, *(beside or references[:1])])


def check_panels(runs: Sequence[LabelledRun], names: Sequence[str], *, option: str = "--panel ") -> None:
    """Check that every name selects a panel of a page of runs; raises as `figures.panels.check_panels`."""
    of_figures.check_panels(runs, names, option=option, selected=_on_page)


def _on_page(runs: Sequence[LabelledRun], name: str) -> Sequence[str]:
    """Return the panels that a name selects on a page: none if a part of it selects none."""
    if name == "path":
        return [name]
    results = [run.results for run in runs]
    (view,) = views_of((name,))
    found = [[*_panels(results, part)] for panel in view.panels for part in panel.split(",")]
    known = all(found) and (view.x == "time" or _columns(results, view.x))
    return view.panels if known else []


def _needed(views: Sequence[Mapping[str, Any]], roads: Sequence[Mapping[str, Any] | None]) -> set[str]:
    """Return the columns of all views and roads."""
    panels = (panel for view in views for panel in view["panels"])
    named = {part for panel in panels for spec in panel.split(",") for part in re.split(" [-+] ", spec)}
    named |= {view["x"] for view in views}
    return named | {name for road in roads for name in (road or {}).values() if isinstance(name, str)}


def _signals(results: Sequence[Results]) -> dict[str, dict[str, Any]]:
    """Return label, displayed unit, factor to it, unit and inputs fed of every numeric column."""
    signals = {}
    for run in results:
        for name, values in run.columns.items():
            if name not in signals and is_numeric(values):
                unit = unit_of_signal(run.units.get(name, ""))
                text, factor = shown_unit(unit)
                label = words(run.names[name].variable)
                signals[name] = {"label": label, "unit": text, "factor": factor, "si": unit}
                if fed := run.inputs_fed(name):
                    signals[name]["fed"] = fed
    return signals


def _values(runs: Sequence[LabelledRun], name: str) -> list[str]:
    """Return a metric of every run as text, "" where a run has none."""
    wanted = metric(name)
    values = [(run.results, evaluate(run.results, wanted)) for run in runs]
    return [
        shown_value(value) + (", still growing" if _grows(run, wanted) else "") if value is not None else ""
        for run, value in values
    ]


def _grows(run: Results, wanted: Metric) -> bool:
    """Return whether a peak is that of the last sample: it would have become larger."""
    columns = columns_of(run, wanted.signal) if wanted.name.startswith("peak(") and not wanted.other else ()
    if wanted.window:
        return False
    for column in columns[:1]:
        size = np.abs(while_moving(run).columns[column])
        return bool(size.size > 1 and size[-1] > np.max(size[:-1]))
    return False


def still_of(results: Sequence[Results]) -> float:
    """Return the instant [s] of the cursor at first: that of the largest sideslip angle of any run.

    Without sideslip, that of the largest yaw rate; without both, the middle of the first run.
    """
    for signal in STILL:
        peaks = []
        for run in map(while_moving, results):
            for column in columns_of(run, signal)[:1]:
                size = np.nan_to_num(np.abs(run.columns[column]), posinf=0.0)
                peaks.append((float(size.max()), -float(run.time[np.argmax(size)])))
        if peaks and max(peaks)[0] > 0:
            return -max(peaks)[1]
    time = results[0].time
    return float(0.5 * (time[0] + time[-1]))
