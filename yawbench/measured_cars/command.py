"""`yawbench measured`, `fit` and `validate`: examine recordings, fit runs to them, compare runs with them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from yawbench.commands import json_and_latex
from yawbench.commands.json_and_latex import tabular
from yawbench.commands.options import CHANGES, MAKING, RunOptions, takes
from yawbench.commands.output import print_tables
from yawbench.commands.strict_and_junit import judged, judging
from yawbench.commands.terminal_progress import hold, say, stoppable
from yawbench.foundation.errors import ScenarioError
from yawbench.foundation.messages import resolved, span

if TYPE_CHECKING:
    from yawbench.measurements.measurement import Measurement
    from yawbench.planner import Planner
    from yawbench.studies.tables import Table

    from .fit_result import FitResult

MeasuredAction = Annotated[Literal["show"], typer.Argument(help="show: examine the recording.")]
MeasurementFile = Annotated[Path, typer.Argument(metavar="FILE", help="Measurement file.")]
FitFile = Annotated[Path, typer.Argument(metavar="FIT", help="Fit file: YAML.")]
Validated = Annotated[
    Path, typer.Argument(metavar="SCENARIO", help="Scenario, run first if needed, or results folder.")
]
MeasuredOption = Annotated[Path, typer.Option("--measured", metavar="FILE", help="Measurement file.")]
BandsOption = Annotated[
    str,
    typer.Option("--bands", metavar="NAME", help="File of tolerances, or its name in scenarios/bands."),
]
ValidationPage = Annotated[
    bool, typer.Option("--page", help="Also write validation.html, an interactive page.")
]
FigureFile = Annotated[
    Path | None, typer.Option("--out", metavar="FILE.svg", help="Figure of all signals to write.")
]
SETS = "sets"
"""Subfolder with the simulated signals of each set of values, until the fit has ended."""


@tabular
def measured(action: MeasuredAction, file: MeasurementFile, out: FigureFile = None) -> None:
    """Examine a recording: signals, flaws, what a fit can find.

    Flaws are stretches without samples, spikes, times that are uneven, repeated or restart, and signals that
    contradict the motion of a
    rigid car: wrong signs, mistaken units, lag, position and zero points of sensors, a speed that does not
    match the recorded position. The table of effects shows which parameters of a car the recording
    determines. Exit status 1 if there is any flaw.
    """
    from yawbench.measurements.measurement import load_measurement
    from yawbench.studies.tables import Cell, Table

    from .flaws import FlawKind, flaws_of, not_examined

    flaws = flaws_of(file)
    unexamined = ""
    if not any(flaw.kind is FlawKind.REFUSED for flaw in flaws):
        measurement = load_measurement(file)
        unexamined = not_examined(measurement)
        say(f"{measurement.title}; {measurement.origin or 'source and licence not stated'}")
        for note in measurement.notes:
            if note.code == "recording-rows":
                say(f"note: {note.message}")
        rows: list[Sequence[Cell]] = [
            (
                segment.name,
                *resolved(segment.time[0], segment.time[-1]),
                f"{segment.rate:.4g}",
                ", ".join(segment.signals),
            )
            for segment in measurement.segments
        ]
        tables = [Table("Segments", ["segment", "from [s]", "to [s]", "rate [Hz]", "signals"], rows)]
        if not flaws:
            try:
                tables.append(effects_table(measurement))
            except ValueError as error:
                say(f"note: cannot tell which parameters a fit can identify: {error}")
        print_tables(tables)
        if out is not None:
            draw_measurement(file, measurement, out)
    json_and_latex.answer(
        flaws=[
            {"kind": flaw.kind.value, "signal": flaw.signal, "value": flaw.value, "text": flaw.text}
            | ({"begin": flaw.gap.begin, "end": flaw.gap.end} if flaw.gap else {})
            for flaw in flaws
        ],
        examined=not unexamined,
    )
    for flaw in flaws:
        say(f"{flaw.signal}: {flaw.text}" if flaw.signal else flaw.text)
    if unexamined:
        say(f"note: {unexamined}")
    if flaws:
        raise typer.Exit(1)
    say("no flaws")


def effects_table(measurement: Measurement) -> Table:
    """Return the table of parameters that a fit to a measurement can identify.

    Raises:
        ValueError: steering, speed, mass or axles are not known.
    """
    from yawbench.measurements.measurement import MEASURABLE
    from yawbench.metrics.expressions import MetricValue
    from yawbench.studies.tables import Table

    from .single_track import CHANGE, SEEN, effects_in

    headings = [f"rms change of {name}" for name in SEEN]
    table = Table(
        f"Effects of parameters that are {100 * CHANGE:g} % larger, in a single track driven like the car",
        ["parameter", *headings, "seen"],
        numbers=range(1, 1 + len(SEEN)),
    )
    for effect in effects_in(measurement):
        numbers = [MetricValue(effect.changes[name], MEASURABLE[name].unit) for name in SEEN]
        table.rows.append([effect.parameter, *numbers, "yes" if effect.seen else "no"])
    table.notes.append("mass scales with stiffnesses and yaw inertia: give it, or a prior, in a fit")
    return table


def draw_measurement(file: Path, measurement: Measurement, out: Path) -> None:
    """Write a figure of all signals of a measurement, its segments overlaid.

    Raises:
        ScenarioError: the format is unknown.
        ResultsError: the figure cannot be written.
    """
    from yawbench.figures.display import LabelledRun
    from yawbench.figures.plots import draw
    from yawbench.figures.style import KINDS, save
    from yawbench.measurements.measured_results import (
        filtered_alike,
        measured_results,
        segments_of,
    )

    if out.suffix[1:] not in KINDS:
        raise ScenarioError(
            f"--out {out}: must end in {', '.join(f'.{k}' for k in KINDS)}", code="option-invalid"
        )
    results = filtered_alike([measured_results(path) for path in segments_of(file)])
    runs = [
        LabelledRun(segment.name, run) for segment, run in zip(measurement.segments, results, strict=True)
    ]
    figure = draw(
        runs, list(measurement.segments[0].signals), title=measurement.title, note=measurement.origin
    )
    (written,) = save(figure, out.with_suffix(""), [out.suffix[1:]])
    say(str(written))


@tabular
@takes("out", "fmus", "no_build", "jobs")
def fit(context: typer.Context, file: FitFile, options: RunOptions) -> None:
    """Fit parameters of a scenario to a measured car.

    Prints the parameters with their intervals, and the differences on training and held-out windows next to
    those of a single track with Fiala tyres, fitted to the same windows. Writes fit.json, vehicle.yaml (the
    vehicle file with the fitted values) and fit.html (the same with time histories). Parameters that cannot
    be identified are refused. Without --out, results go to results/<folder of the fit file>/<its name>. An
    interrupted fit resumes where it stopped.
    """
    import json

    from yawbench.foundation.safe_files import write_whole
    from yawbench.orchestrator.results.folder_names import default_folder
    from yawbench.planner import Planner

    from .fit_file import load_fit
    from .fit_page import fit_page, parameter_table, score_table
    from .fit_result import make_fit
    from .least_squares import CONVERGED

    loaded = load_fit(file)
    for note in loaded.measurement.notes:
        say(f"note: {note}")
    folder = options.out or default_folder(file)
    hold(context, folder)
    planner = Planner(build=options.build)
    with stoppable(folder):
        result = make_fit(
            loaded, planner=planner, workers=options.jobs, fmus=options.fmus, folder=folder / SETS, say=say
        )
    write_whole(folder / "fit.json", json.dumps(result.data, indent=1, ensure_ascii=False) + "\n")
    write_whole(folder / "vehicle.yaml", vehicle_text(result, folder, planner))
    json_and_latex.answer(folder=folder, fit=result.data)
    scores = score_table(result)
    scores.notes.append(result.verdict)
    print_tables([*map(parameter_table, result.models), scores])
    for model in result.models:
        if model.estimate.message != CONVERGED:
            say(f"note: {model.title}: the search ended early: {model.estimate.message} (most_sets)")
    write_whole(folder / "fit.html", fit_page(result))
    say(f"Written: {folder / 'fit.json'}, vehicle.yaml, fit.html")


def vehicle_text(result: FitResult, folder: Path, planner: Planner) -> str:
    """Return the base scenario's vehicle file with the fitted values, for a folder, as YAML."""
    import json
    import os

    from yawbench.orchestrator.signal_names import Target

    from .fit_file import MEASURED

    fit, model = result.fit, result.scenario
    scenario = planner.load(fit.scenario)
    intervals = model.estimate.intervals()
    of = fit.measurement
    title = f"{scenario.vehicle_file.title or of.title}, fitted"
    source = f"fitted to {of.title}: {of.origin or of.path.name} ({fit.spec.title})"
    lines = [
        f"title: {json.dumps(title, ensure_ascii=False)}",
        f"source: {json.dumps(source, ensure_ascii=False)}",
    ]
    tyres = {axle: os.path.relpath(file.path, folder) for axle, file in scenario.tyre_files.items()}
    if tyres:
        lines.append(f"tyres: {json.dumps(tyres)}")
    fitted = {
        Target.parse(parameter.name).variable: parameter
        for parameter in model.parameters
        if not parameter.name.startswith(f"{MEASURED}.")
        and Target.parse(parameter.name).kind in ("vehicle_parameter", "parameter")
    }
    lines.append("parameters:")
    for name, value in scenario.vehicle_file.values.items():
        if name not in fitted:
            lines.append(f"  {name}: {json.dumps(value)}")
    for name, parameter in fitted.items():
        interval = intervals[parameter.name]
        bounds = f"95 % {span(*interval, digits=4)}" if interval else "no interval"
        lines.append(
            f"  {name}: {model.estimate.values[parameter.name]:.6g}  # {parameter.unit}; fitted, {bounds}"
        )
    return "\n".join(lines) + "\n"


@tabular
@judging
@takes(*CHANGES, *MAKING)
def validate(
    scenario: Validated,
    options: RunOptions,
    measured: MeasuredOption,
    bands: BandsOption = "steady_state",
    page: ValidationPage = False,
) -> None:
    """Compare steady-state runs with measurements, by bands.

    Prints a verdict per signal: the largest distance of a measured point from the cross plot, relative to the
    tolerance. Draws the cross plots and writes validation.json. The measurement's low pass is applied to the
    run, too. Without --out, both go to the folder of the run. Exit status 1 if a signal lies outside its
    band, or none could be judged. A study with `validations` has them in its report.
    """
    import json

    from yawbench.commands.recorded_runs import recorded
    from yawbench.figures.style import save
    from yawbench.foundation.safe_files import write_whole
    from yawbench.measurements.measured_results import load_run
    from yawbench.measurements.measurement import load_measurement

    from .validation import compare_run, load_bands
    from .validation_page import conditions_table, validation_page, validation_table

    tolerances = load_bands(bands)
    measurement = load_measurement(measured)
    (folder,) = recorded([scenario], options)
    validation = compare_run(load_run(folder), measurement, tolerances)
    out = options.out or folder
    drawing = save(validation.plot(), out / "validation")
    write_whole(
        out / "validation.json", json.dumps(validation.as_data(), indent=1, ensure_ascii=False) + "\n"
    )
    json_and_latex.answer(folder=out, validation=validation.as_data())
    notes = tuple(dict.fromkeys((*measurement.notes, *validation.diagnostics)))
    json_and_latex.note(notes)
    judged(f"{validation.title}, against {validation.measured}", validation.verdicts.items())
    print_tables([validation_table(validation), conditions_table(validation)])
    for diagnostic in notes:
        say(f"{'note' if diagnostic.severity == 'info' else 'warning'}: {diagnostic}")
    written = [str(out / "validation.json"), *(path.name for path in drawing)]
    if page:
        write_whole(out / "validation.html", validation_page(validation))
        written.append("validation.html")
    say(", ".join(written))
    if not validation.holds:
        raise typer.Exit(1)
