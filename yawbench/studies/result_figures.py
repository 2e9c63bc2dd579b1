"""Figures of an experiment: overlaid runs, or metrics, limits and grids over axes (`axis_figures`)."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Sequence
from pathlib import Path
from pkgutil import resolve_name
from typing import TYPE_CHECKING, Any

from yawbench.figures.display import LabelledRun
from yawbench.figures.plots import draw
from yawbench.figures.style import ROW, frame, literal, new_figure, save
from yawbench.foundation.errors import ResultsError
from yawbench.foundation.messages import counted
from yawbench.orchestrator.scenario.overrides import changed

from .axis_figures import FAILED, Drawing
from .experiment import FIGURES
from .experiment_result import Each, ExperimentResult
from .schema import FigureSpec

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


PANELS_IN_A_ROW = 3


def draw_all(findings: ExperimentResult, out: Path, each: Each = map) -> tuple[dict[str, str], list[str]]:
    """Draw all figures as SVG and PNG below `out`; return name -> title, and problems.

    Args:
        findings: result of the experiment.
        out: results folder of the experiment.
        each: `map`, or a parallel equivalent.
    """
    wanted: list[tuple[Any, FigureSpec, str, Path]] = []
    light = findings.light()
    for spec in findings.spec.figures:
        shown = runs_of(findings, spec) if spec.what.shows == "runs" else light
        wanted.append((shown, spec, title_of(findings, spec), out / FIGURES / spec.name))
    drawn, problems = {}, []
    for (_, spec, title, _), problem in zip(wanted, each(_draw, wanted), strict=True):
        if problem:
            problems.append(f"figure {spec.name}: {problem}")
        else:
            drawn[spec.name] = title
    return drawn, problems


def title_of(findings: ExperimentResult, spec: FigureSpec) -> str:
    """Return the title of a figure."""
    return spec.title or f"{findings.spec.title}: {spec.name}"


def runs_of(findings: ExperimentResult, spec: FigureSpec) -> list[LabelledRun]:
    """Return the runs of an overlay, without those that have no results."""
    named = findings.experiment.matching(spec.runs)
    return [
        LabelledRun(run.label, findings.results[run.name]) for run in named if run.name in findings.results
    ]


def _draw(wanted: tuple[Any, FigureSpec, str, Path]) -> str | None:
    shown, spec, title, stem = wanted
    if not shown:
        return "none of its runs has results"
    try:
        overlay = spec.what.shows == "runs"
        save(draw(shown, spec.panels, title=title) if overlay else draw_over_axes(shown, spec), stem)
    except ResultsError as error:
        return str(error)
    return None


def draw_over_axes(findings: ExperimentResult, spec: FigureSpec) -> Figure:
    """Draw a figure over axes.

    Raises:
        ResultsError: there is nothing to draw.
    """
    drawing: Drawing = resolve_name(f"{__package__}.{spec.what.drawing}")(findings, spec)
    panels = drawing.panels()
    columns = min(len(panels), PANELS_IN_A_ROW)
    rows = math.ceil(len(panels) / columns)
    height = rows * (1.7 if columns == 1 else 1.4) * ROW
    with new_figure() as figure:
        grid = figure.subplots(rows, columns, squeeze=False, sharex=True, sharey=True)
        drawn = list(grid.flat[: len(panels)])
        for axes in grid.flat[len(panels) :]:
            axes.remove()
        for k, (axes, (heading, runs)) in enumerate(zip(drawn, panels, strict=True)):
            drawing.fill(axes, runs)
            axes.set_title(literal(heading))
            if k + columns >= len(drawn):  # the lowest panel of its column
                axes.set_xlabel(literal(drawing.label(spec.x) if spec.x else drawing.across))
                axes.tick_params(labelbottom=True)
            if k % columns == 0:
                axes.set_ylabel(literal("\n".join(textwrap.wrap(drawing.upwards, 34))))
        drawing.finish(figure, drawn)
        options = changed(findings.experiment.by_options)
        frame(figure, height, _legend(drawn), spec.title or drawing.what, _provenance(findings), options)
    return figure


def _legend(drawn: Sequence[Axes]) -> list[Artist]:
    """Return one handle per label over all panels, with that of failed runs last."""
    by_label: dict[str, Artist] = {}
    for axes in drawn:
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True):
            by_label.setdefault(label, handle)
    return sorted(by_label.values(), key=lambda handle: handle.get_label() == FAILED["label"])


def _provenance(findings: ExperimentResult) -> str:
    spec = findings.spec
    fmus = [f"{name} {digest[:8]}" for name, digest in findings.fmus]
    scenarios = dict.fromkeys(run.scenario.name for run in findings.experiment.runs.values())
    made = len(findings.records) - findings.not_made
    parts = [f"{counted(made, 'run')} of {', '.join(scenarios)}", f"FMUs: {', '.join(fmus)}"]
    parts += [f"changed in all runs: {words}"] if (words := changed(findings.experiment.changed)) else []
    return " · ".join([spec.source, *parts] if spec.source else parts)
