"""Interactive viewer of runs: signals over time, differences, the road from above; part of a page, or a page.

    {{ assets() }}              once per page: style and scripts
    {{ viewer(runs) }}          once per viewer

A page needs no server and no network. It carries every recorded sample (`viewer_data`); axes and zooming are
those of uPlot, taken from the installed package `uplot-python`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from importlib.metadata import distribution
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
from markupsafe import Markup

from vocabulary.lane_change import lanes_of
from vocabulary.wheels import WHEELS

from ..errors import ResultsError
from ..figures.panels import spans_of
from ..figures.style import LINES, LabelledRun, line_style, shown, shown_unit
from ..messages import listed
from ..metrics.measures import words
from ..metrics.run_metrics import columns_of, evaluate, metric, reference_of
from ..results.read_and_salvage import Results
from .diagram_and_friction_map import ground_of
from .page_parts_and_provenance import render
from .viewer_data import PackedRun, is_numeric, pack

SCRIPTS = ("data", "panels", "draw", "scene", "close_up", "road", "")
MOST = 200
"""Largest number of runs in one viewer. Chosen: beyond the runs of any study; colours repeat after seven."""
PANELS = ("sideslip", "yaw_rate", "acceleration_y", "yaw_moment", "steer_angle")
"""Signals shown first, with their references; chosen: what all four papers draw."""
METRICS = ("peak(sideslip)", "peak(yaw_rate)", "peak(acceleration_y)", "peak(yaw_moment)")
"""Metrics in the table of runs, by default."""
STILL = ("sideslip", "yaw_rate")
"""Signals whose largest value sets the cursor at first."""

OVERHANG_FRONT, OVERHANG_REAR = 0.85, 1.0
"""Overhangs beyond the axles [m], if the driver has no dimensions of the car; chosen: a saloon."""
BESIDE = 0.2
"""Width of the body minus track width [m]; chosen: a tyre's width."""
USUAL = {"cg_to_front_axle": 1.3, "cg_to_rear_axle": 1.4, "track_width": 1.55}
"""Dimensions for a plant that has none [m]; chosen: a mid-size car."""
NAMED = 6
"""Number of ground frictions listed in the legend; if there are more, only the range is given."""

POSE = {"x": "position_x", "y": "position_y", "yaw": "yaw_angle"}
MOTION = (
    "velocity_x", "velocity_y", "sideslip", "yaw_rate", "steer_angle", "yaw_moment", "cone_overrun",
    "path_offset",
)  # fmt: skip


@dataclass(frozen=True)
class View:
    """A selection of runs and signals that the reader can choose.

    Attributes:
        title: of the choice.
        panels: signals, `instance.variable` or the variable alone, `x_error` for its error, `x - y`; a comma
            overlays further ones.
        shown: numbers of the runs; None: all.
        x: signal on the horizontal axis, or time.
    """

    title: str = ""
    panels: Sequence[str] = PANELS
    shown: Sequence[int] | None = None
    x: str = "time"


@dataclass(frozen=True)
class Settings:
    """What a viewer has beside its runs.

    Attributes:
        views: to choose from; the first is shown at first.
        metrics: those in the table of runs.
        marks: instants [s] with a text, as vertical lines.
        limits: signal, level in SI units and a text, as horizontal lines.
        exact: keep all samples as 32-bit floats.
        largest: size of the samples [bytes]; beyond it, the page carries the signals of the views and of the
            road alone. 0: no limit.
        ghosts: numbers of runs that are drawn faintly behind the others.
    """

    views: Sequence[View] = (View(),)
    metrics: Sequence[str] = METRICS
    marks: Sequence[tuple[float, str]] = ()
    limits: Sequence[tuple[str, float, str]] = ()
    exact: bool = False
    largest: int = 0
    ghosts: Sequence[int] = ()


SETTINGS = Settings()


@dataclass(frozen=True)
class CarOutline:
    """A car seen from above: its axles and ends from the centre of mass, its widths [m]."""

    front_axle: float
    rear_axle: float
    track: float
    front_end: float
    rear_end: float
    width: float


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
    if not 1 <= len(runs) <= MOST:
        raise ResultsError(f"a viewer shows one to {MOST} runs, not {len(runs)}.")
    if empty := [run.label for run in runs if not run.results.time.size]:
        raise ResultsError(f"{empty[0]}: no samples were recorded.")
    results = [run.results for run in runs]
    grounds: list[Any] = []
    roads = [_road(run.results, grounds) for run in runs]
    drawn = [_drawn(view, results) for view in settings.views]
    views = [view for view in drawn if view["panels"]] or drawn[:1]
    packed = packed or pack(results, exact=settings.exact)
    if partial := 0 < settings.largest < sum(len(one.block) for one in packed):
        needed = _needed(views, roads)
        results = [
            replace(one, columns={k: x for k, x in one.columns.items() if k in needed}) for one in results
        ]
        packed = pack(results, exact=settings.exact)
    data = {
        "alone": alone,
        "file": name,
        "views": views,
        "grounds": grounds,
        "still": still_of(results),
        "limits": [
            [column, level, text]
            for signal, level, text in settings.limits
            for column in _columns(results, signal)
        ],
        "marks": [list(one) for one in settings.marks],
        "signals": _signals(results),
        "dashes": [_dash(number) for number in range(len(LINES))],
        "runs": [
            {
                "label": run.label,
                "faults": [[span.begin, span.end, span.label] for span in spans_of([run])],
                "notes": _notes(run.results, road),
                "road": road,
                "ghost": number in settings.ghosts,
                **block.header,
            }
            for number, (run, road, block) in enumerate(zip(runs, roads, packed, strict=True))
        ],
    }
    rows = [(metric(one).title, values) for one in settings.metrics if any(values := _values(runs, one))]
    text = render(
        "viewer.html.j2", name=name, data=data, blocks=packed, metrics=rows,
        placed=any(roads), key=_key(roads, grounds), partial=partial,
    )  # fmt: skip
    return Markup(text)


def assets(*scripts: str) -> Markup:
    """Return the style and the scripts that all viewers of a page share, and further scripts of `static/`."""
    static = files(__package__) / "static"
    foreign = Path(str(distribution("uplot-python").locate_file("uplot/static")))
    plotter = (foreign / "uPlot.iife.js").read_text(encoding="utf-8")
    styles = [(foreign / "uPlot.min.css").read_text(encoding="utf-8"), _static(static, "viewer.css")]
    names = [f"viewer_{part}.js" if part else "viewer.js" for part in SCRIPTS]
    script = "\n".join(_static(static, name) for name in (*names, *scripts))
    return Markup(
        "<style>\n{}</style>\n<script>\n(() => {{\n'use strict';\n"
        "const makeUPlot = (devicePixelRatio) => {{\n{}\nreturn uPlot;\n}};\n{}}})();\n</script>"
    ).format(Markup("\n".join(styles)), Markup(plotter), Markup(script))


def page(
    runs: Sequence[LabelledRun],
    settings: Settings = SETTINGS,
    *,
    title: str = "",
    below: str = "",
    changed: str = "",
) -> str:
    """Return a viewer as a page.

    Args:
        runs, settings: see `viewer`.
        title: of the page; default: the labels.
        below: a line under the title.
        changed: overrides of the scenario that the title names.
    """
    return render(
        "viewer_page.html.j2",
        title=title or " and ".join(run.label for run in runs),
        below=below,
        changed=changed,
        assets=assets(),
        viewer=viewer(runs, settings, name="run", alone=True),
    )


def _static(folder: Any, name: str) -> str:
    return str((folder / name).read_text(encoding="utf-8"))


def _dash(number: int) -> Sequence[float]:
    pattern = line_style(number)["linestyle"]
    return pattern[1] if isinstance(pattern, tuple) else ()


def _columns(results: Sequence[Results], signal: str) -> list[str]:
    """Return the columns that a signal names in any run, each once."""
    return list(dict.fromkeys(name for run in results for name in columns_of(run, signal)))


def _drawn(view: View, results: Sequence[Results]) -> dict[str, Any]:
    """Return a view with the columns of its panels."""
    shown = list(range(len(results))) if view.shown is None else list(view.shown)
    runs = [results[number] for number in shown]
    panels = list(dict.fromkeys(panel for spec in view.panels for panel in _panels(runs, spec)))
    x = view.x if view.x == "time" else next(iter(_columns(runs, view.x)), "time")
    return {"title": view.title, "shown": shown, "panels": panels, "x": x}


def _panels(results: Sequence[Results], spec: str) -> Iterator[str]:
    """Yield the panels that a name selects: columns, each with the column of its reference."""
    first, *others = (part.strip() for part in spec.split(","))
    minuend, _, subtrahend = first.partition(" - ")
    error = minuend.removesuffix("_error")
    for column in _columns(results, minuend) or _columns(results, error):
        found = (reference_of(run, column) for run in results if column in run.columns)
        references = [name for name in dict.fromkeys(found) if name]
        if subtrahend or (error != minuend and not _columns(results, minuend)):
            taken = _columns(results, subtrahend) if subtrahend else references
            yield from (f"{column} - {name}" for name in taken[:1])
        else:
            beside = [name for other in others for name in _columns(results, other)]
            yield ",".join([column, *(beside or references[:1])])


def _needed(views: Sequence[Mapping[str, Any]], roads: Sequence[Mapping[str, Any] | None]) -> set[str]:
    """Return the columns of all views and roads."""
    panels = (panel for view in views for panel in view["panels"])
    named = {part.strip() for panel in panels for spec in panel.split(",") for part in spec.split(" - ")}
    return named | {name for road in roads for name in (road or {}).values() if isinstance(name, str)}


def _signals(results: Sequence[Results]) -> dict[str, dict[str, Any]]:
    """Return label, displayed unit, factor to it and unit of every numeric column."""
    found = {}
    for run in results:
        for name, values in run.columns.items():
            if name not in found and is_numeric(values):
                unit = run.units.get(name, "")
                text, factor = shown_unit(unit)
                label = words(run.names[name].variable)
                found[name] = {"label": label, "unit": text, "factor": factor, "si": unit}
    return found


def _values(runs: Sequence[LabelledRun], name: str) -> list[str]:
    """Return a metric of every run as text, "" where a run has none."""
    values = [evaluate(run.results, metric(name)) for run in runs]
    return [shown(one.number, one.unit) if one is not None else "" for one in values]


def still_of(results: Sequence[Results]) -> float:
    """Return the instant [s] of the cursor at first: that of the largest sideslip angle of any run.

    Without sideslip, that of the largest yaw rate; without both, the middle of the first run.
    """
    for signal in STILL:
        peaks = []
        for run in results:
            for column in columns_of(run, signal)[:1]:
                size = np.nan_to_num(np.abs(run.columns[column]), posinf=0.0)
                peaks.append((float(size.max()), -float(run.time[np.argmax(size)])))
        if peaks and max(peaks)[0] > 0:
            return -max(peaks)[1]
    time = results[0].time
    return float(0.5 * (time[0] + time[-1]))


# ---- the road from above ----


def _road(run: Results, grounds: list[Any]) -> dict[str, Any] | None:
    """Return the columns that the road needs, and the car's outline; None without position or yaw angle.

    Its ground is an index of `grounds`, to which a new one is added; None: none was recorded.
    """
    road: dict[str, Any] = {}
    for key, signal in POSE.items():
        columns = columns_of(run, signal)
        if not columns or not np.isfinite(run.columns[columns[0]][0]):
            return None
        road[key] = columns[0]
    road |= {signal: columns[0] for signal in MOTION if (columns := columns_of(run, signal))}
    along, across = columns_of(run, "tyre_force_x_*"), columns_of(run, "tyre_force_y_*")
    loads = columns_of(run, "vertical_load_*")
    for k, wheel in enumerate(WHEELS if along and across else ()):
        road[f"force_along_{wheel}"], road[f"force_across_{wheel}"] = along[k], across[k]
    frictions = (
        [_friction(run, wheel, tyre=run.names[along[0]].instance) for wheel in WHEELS]
        if along and loads
        else []
    )
    if frictions and None not in frictions:
        for wheel, load, friction in zip(WHEELS, loads, frictions, strict=True):
            road[f"load_{wheel}"], road[f"friction_{wheel}"] = load, friction
    car, known = _car(run)
    lanes = next(filter(None, map(lanes_of, _parameters(run, "driver"))), [])
    x, y = (run.columns[road[key]] for key in ("x", "y"))
    ends = [(float(np.nanmin(one)), float(np.nanmax(one))) for one in (x, y)]
    pieces = next(filter(None, (ground_of(one, *ends) for one in _parameters(run, "road"))), [])
    ground = [[piece.friction, piece.corners] for piece in pieces]
    if ground and ground not in grounds:
        grounds.append(ground)
    road["outline"] = {"car": asdict(car), "lanes": [list(lane) for lane in lanes]}
    road["ground"] = grounds.index(ground) if ground else None
    road["sized"] = known
    return road


def _notes(run: Results, road: Mapping[str, Any] | None) -> list[str]:
    """Return notes on what cannot be drawn of a run, and why it ended early."""
    notes: list[str] = []
    if road is None:
        return notes
    if "force_along_fl" not in road:
        notes.append("tyre forces not recorded")
    elif "steer_angle" not in road:
        notes.append("steer angle not recorded: front wheels drawn straight")
    if "force_along_fl" in road and "friction_fl" not in road:
        notes.append("friction or vertical loads not recorded: no friction circles")
    if not road["sized"]:
        notes.append("the plant has no dimensions; drawing a mid-size car")
    if run.record.status not in ("", "completed"):
        notes.append(f"the run failed at {run.time[-1]:.2f} s")
    elif run.ended:
        notes.append(run.ended)
    return notes


def _key(roads: Sequence[Mapping[str, Any] | None], grounds: Sequence[Any]) -> str:
    """Return the legend of the symbols on the road."""
    drawn = {name for road in roads for name in road or ()}
    symbols = (
        ("path_offset", "grey dashes: the driver's path"),
        ("friction_fl", "circles: friction times load"),
        ("force_along_fl", "arrows: tyre forces" + (", in % of it" if "friction_fl" in drawn else "")),
        ("sideslip", "arrow from the centre of mass: its direction of motion"),
        ("yaw_moment", "grey arc: requested yaw moment"),
    )
    parts = [text for name, text in symbols if name in drawn]
    frictions = sorted({friction for ground in grounds for friction, _ in ground})
    if frictions:
        numbers = [f"{mu:g}" for mu in frictions]
        values = listed(numbers) if len(numbers) <= NAMED else f"{numbers[0]} to {numbers[-1]}"
        parts.append(f"ground: the bluer the more slippery, friction {values}")
    key = "; ".join(parts)
    return f"{key[:1].upper()}{key[1:]}." if key else ""


def _friction(run: Results, wheel: str, *, tyre: str) -> str | float | None:
    """Return the column of the friction at a wheel, or the number that is constant for the tyre."""
    if columns := columns_of(run, f"friction_{wheel}"):
        return columns[0]
    fmu = run.record.fmus.get(tyre)
    constants = fmu.constants if fmu else {}
    friction = constants.get(f"friction_{wheel}", constants.get("friction"))
    return float(friction) if isinstance(friction, (int, float)) else None


def _parameters(run: Results, role: str) -> Iterator[Mapping[str, Any]]:
    """Yield the parameters of the instances with a role."""
    for instance in run.units_of_role(role):
        fmu = run.record.fmus[instance]
        yield {**fmu.defaults, **fmu.parameters}


def _car(run: Results) -> tuple[CarOutline, bool]:
    """Return the car's outline, and whether the plant has any of its dimensions."""
    sizes: dict[str, float] = {}
    for parameters in _parameters(run, "plant"):
        sizes |= {
            name: float(value)
            for name, value in parameters.items()
            if name in USUAL and isinstance(value, (int, float)) and math.isfinite(value) and value > 0
        }
    front, rear, track = (sizes.get(name, usual) for name, usual in USUAL.items())
    ends = {"front": front + OVERHANG_FRONT, "rear": rear + OVERHANG_REAR, "width": track + BESIDE}
    for parameters in _parameters(run, "driver"):  # the cones are judged with the driver's dimensions
        if lanes_of(parameters):
            ends["width"] = float(parameters["vehicle_width"])
            ends["front"] = float(parameters.get("cg_to_front_end", ends["front"]))
            ends["rear"] = float(parameters.get("cg_to_rear_end", ends["rear"]))
    return CarOutline(front, rear, track, ends["front"], ends["rear"], ends["width"]), bool(sizes)
