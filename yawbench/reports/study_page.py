"""The page of an experiment, a single HTML file.

It has the verdicts, runs, system, tables and parameters of the experiment, and how to repeat it.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime, timezone
from pathlib import Path
from typing import Any, ClassVar, NamedTuple
from urllib.parse import quote

from markupsafe import Markup

from yawbench.figures.display import LabelledRun, shown
from yawbench.foundation.errors import ResultsError
from yawbench.foundation.messages import counted, listed
from yawbench.measurements.measured_results import filtered_alike
from yawbench.metrics.expressions import columns_of, evaluate, metric, reference_of
from yawbench.metrics.verdict import SYMBOLS, VerdictText
from yawbench.orchestrator.plan import Plan
from yawbench.orchestrator.results.reader import Results
from yawbench.orchestrator.results.record_of_plan import run_record
from yawbench.orchestrator.results.run_folder import load_record
from yawbench.orchestrator.results.run_record import RunRecord, RunStatus
from yawbench.orchestrator.scenario.loader import LoadedScenario
from yawbench.orchestrator.scenario.overrides import changed
from yawbench.planner import Planner
from yawbench.studies.claim_schema import Claim
from yawbench.studies.claims import ClaimResult, Comparison, OpenValueScan
from yawbench.studies.confidence import CONFIDENCE
from yawbench.studies.experiment import FIGURES
from yawbench.studies.experiment_result import Each, ExperimentResult
from yawbench.studies.jobs import Job
from yawbench.studies.open_value_regions import runs_of as runs_of_claim
from yawbench.studies.result_figures import runs_of, title_of
from yawbench.studies.result_tables import (
    counts_of,
    derived_tables,
    heading,
    limit_tables,
    line_table,
    margin_words,
    measured_words,
    reach,
    region_table,
    region_words,
    run_tables,
    verdict,
)
from yawbench.studies.sections import sections
from yawbench.studies.tables import Cell, Table
from yawbench.studies.uncertainty import sample_tables

from .comparison_page import ComparisonView
from .diagram import diagram, systems_of
from .page_parts import FigureImage, Page, ViewerPage, anchor, image_of
from .provenance import ParameterGroup, count_kinds, fmus_of, groups_of, programs_of
from .sweep_view import SWEEP_ASSETS, sweep_sentence, sweep_view, write_sides
from .viewer import LARGEST, MOST, Carried, Settings, answer_of, assets, carried, embedded
from .viewer_views import View, views_of


@dataclass(frozen=True)
class JudgedClaim:
    """A claim or check with its measured values, verdict and margin.

    Attributes:
        verdict, margin: in words.
        agreeing: share [%] of the region's points with the same verdict; None: not judged over a region.
    """

    claim: Claim
    measured: Sequence[str]  # the values
    verdict: VerdictText
    margin: str | None
    region: Sequence[str]  # how robust the verdict is, a line each
    agreeing: float | None
    robust: bool  # whether less than a tenth of the region flips the verdict
    lines: Table | None  # values along the lines of the region
    strip: Markup  # the same drawn: the margin at each level of each open value; "" without a region
    link: str  # state of the viewer that shows the claim's runs; "" if it has none of them


class SystemDrawing(NamedTuple):
    """The diagram of a set of instances, and the scenarios that it applies to."""

    drawing: Markup
    runs: str


@dataclass(frozen=True, kw_only=True)
class StudyPage(Page):
    """The page of an experiment.

    Attributes:
        claims, checks: as judged.
        groups, kinds: parameters, and how many have each kind of source.
        command, folder: that repeats it; of its results.
        runs, not_made: number of all runs, and of those that were not made yet.
        fmus, programs: that made the runs.
    """

    template = "study.html.j2"
    long: ClassVar[int] = 16
    """Chosen: with the claims, a page stays below 2,000 elements."""
    id: str  # anchor on the overview, key of its side file there
    source: str  # of the experiment
    counts: Mapping[str, int]  # verdict of claims -> how many
    reach: str  # where claims were judged
    answer: str  # the result in sentences
    claims: Sequence[JudgedClaim]
    checks: Sequence[JudgedClaim]
    region: Table | None  # the open values and their ranges; None: not judged over a region
    limits: Sequence[Table]  # their tables
    systems: Sequence[SystemDrawing]  # a diagram for each set of instances
    content: Carried | None  # of the viewer; None: there are no runs to show
    sweep: Markup | None  # the view of runs along axes
    figures: Sequence[tuple[str, str]]  # title and file, without suffix, of those shown in another form
    charts: Sequence[FigureImage]  # drawn figures, as images
    tables: Sequence[Table]  # numbers of runs; further ones are folded after `long` rows
    definitions: Sequence[tuple[str, str, str]]  # heading, definition and formula of the metrics
    groups: Sequence[ParameterGroup]
    kinds: Mapping[str, int]
    failed: Mapping[str, str]  # run -> why
    stale: Mapping[str, str]  # run -> why its results are not those of its plan
    remarkable: str  # warnings of runs along axes
    repeats: str  # what numbers over repeats mean
    quick: str  # what a quick look leaves out
    command: str
    folder: Path
    settings: Table  # overrides of every run
    grid: Sequence[str]  # algorithms, step sizes and stop times, with how many runs
    runs: int
    not_made: int
    validations: Sequence[ViewerPage]  # of runs, by measured cars
    fmus: Table
    programs: Mapping[str, str]
    comparison: ComparisonView | None = None  # metrics side by side, and where the runs part
    results: Sequence[Table] = ()  # further tables

    @property
    def viewer(self) -> Markup | None:
        """The viewer of its runs."""
        return embedded(self.content, VIEW) if self.content else None


def chapter(
    findings: ExperimentResult,
    *,
    command: str,
    stale: Mapping[str, str],
    folder: Path,
    views: Sequence[View] = (),
    measured: Sequence[LabelledRun] = (),
    each: Each = map,
) -> StudyPage:
    """Return what the page of an experiment shows; write the side files of its runs along axes.

    Args:
        findings: the experiment and its results.
        command: command line that repeats it.
        stale: run -> why its results are not those of its plan.
        folder: of its results, figures and page.
        views: of the viewer, before those of the figures.
        measured: recordings that the viewer shows beside the runs.
        each: `map`, or a parallel equivalent, to write side files with.
    """
    experiment, spec = findings.experiment, findings.spec
    plans = plans_of(findings)
    groups = groups_of([(record_of(job, plan), plan) for job, (_, plan) in plans])
    runs = runs_made(findings)
    kinds = [kind for kind, _ in runs]
    content, numbers = viewer_of(findings, views, measured)
    sweep = None
    if spec.axes and findings.planned and len(findings.records) > 1:
        sweep = sweep_view(findings, "sweep", write_sides(findings, folder, each))
    validations = [
        sections()[section].view(finding, f"{section}-{number}")
        for section, found in findings.sections.items()
        for number, finding in enumerate(found, start=1)
    ]
    return StudyPage(
        id=anchor(f"{experiment.path.absolute().parent.name} {experiment.path.stem}"),
        title=experiment.title,
        assets=assets(*SWEEP_ASSETS if sweep else ()) if content or sweep or validations else None,
        source=spec.source,
        counts=counts_of(findings.claims),
        reach=reach(findings),
        answer=" ".join(filter(None, (answer(findings), sweep and sweep_sentence(findings)))),
        claims=[judged(result, link_to_runs(findings, result, numbers)) for result in findings.claims],
        checks=[judged(result, link_to_runs(findings, result, numbers)) for result in findings.checks],
        region=region_table(findings) if findings.regions else None,
        limits=limit_tables(findings),
        systems=systems(plans, experiment.title),
        content=content,
        sweep=sweep,
        figures=figure_files(findings),
        charts=charts(findings, folder / FIGURES),
        tables=[*run_tables(findings), *derived_tables(findings, apart=True), *sample_tables(findings)],
        definitions=definitions(findings),
        groups=groups,
        kinds=count_kinds(groups),
        failed=findings.failed,
        stale=stale,
        remarkable=findings.remarkable() if spec.axes else "",
        repeats=repeats(findings),
        quick=experiment.quick,
        command=command,
        folder=folder,
        settings=settings(findings),
        grid=grid_of_times(runs),
        runs=len(findings.records),
        not_made=findings.not_made,
        validations=validations,
        fmus=fmus_of(kinds),
        programs=programs_of(kinds),
    )


def link_to_runs(findings: ExperimentResult, result: ClaimResult, numbers: Mapping[str, int]) -> str:
    """Return the state of the viewer that shows a claim's runs; "" if it has none of them.

    The run that decides is the baseline; the signal that decides is highlighted, with its bound if that is
    one of the signal's values.

    Args:
        findings: the experiment and its results.
        result: the judged claim.
        numbers: run -> its number in the viewer.
    """
    runs = [numbers[run] for run in runs_of_claim(findings.experiment, result.claim) if run in numbers]
    if not runs:
        return ""
    first, lit = runs[0], ""
    judged = [
        (verdict.margin, comparison, one.run)
        for comparison in result.compared
        for verdict, one in zip(comparison.verdicts, comparison.measured, strict=False)
        if verdict.margin is not None and one.run in numbers
    ]
    if judged:
        _, comparison, run = min(judged, key=lambda item: item[0])
        first = numbers[run]
        if highlighted := _highlighted(findings, comparison, findings.results[run]):
            lit = f"&lit={quote(json.dumps(highlighted, ensure_ascii=False, separators=(',', ':')))}"
    return f"{VIEW}?shown={runs}&baseline={first}".replace(" ", "") + lit


def _highlighted(findings: ExperimentResult, comparison: Comparison, run: Results) -> list[Any] | None:
    """Return the signal of a condition's metric, as a panel names it, its bound on it or None, and a text."""
    spec = findings.spec.metrics.get(comparison.condition.metric)
    chosen = metric(spec.metric) if spec else None
    columns = columns_of(run, chosen.signal) if chosen else []
    if chosen is None or not columns or comparison.bound is None:
        return None
    signal, bound = columns[0], comparison.bound
    if chosen.other or chosen.measure.needs_reference:
        others = columns_of(run, chosen.other) if chosen.other else [reference_of(run, signal) or ""]
        if not others or not others[0]:
            return None
        signal = f"{signal} - {others[0]}"
    relation = comparison.condition.relation
    text = f"{chosen.title} {SYMBOLS[relation]} {shown(bound, comparison.unit)}"
    return [signal, bound if chosen.name.partition("(")[0] in ON_SIGNAL else None, text]


ON_SIGNAL = ("peak", "peak_error", "final", "value")
"""Measures whose value is one of their signal."""


def runs_made(findings: ExperimentResult) -> list[tuple[RunRecord, int]]:
    """Return the records of all runs; along axes, one of each kind that was made; with their numbers.

    Runs along axes, known by their key in the journal, have today's versions: the key includes them.
    """
    if not findings.spec.axes or findings.planned is None:
        return [(results.record, 1) for results in findings.results.values()]
    return [(record_to_be(plan), number) for plan, number in findings.kinds_made]


def repeats(findings: ExperimentResult) -> str:
    """Return a sentence that explains numbers over repeats; "" without repeats."""
    spec = findings.spec
    if not spec.repeats:
        return ""
    names = " and ".join(spec.axes[name].says or name for name in spec.repeats)
    sure = f"the interval that contains the true mean with {100 * CONFIDENCE:.0f} % confidence (Student)"
    return (
        f"Numbers with ± are means over {findings.experiment.repeats} repeats ({names}), with {sure}. "
        "A verdict whose threshold lies inside reads undecided."
    )


def record_of(job: Job, plan: Plan) -> RunRecord:
    """Return the record of a job's run, or as it would be if the run has kept none."""
    try:
        return load_record(job.out)
    except ResultsError:
        return record_to_be(plan)


def record_to_be(plan: Plan) -> RunRecord:
    """Return the record of a run that has kept none, by its plan."""
    return run_record(plan, status=RunStatus.UNKNOWN, started=datetime.now(timezone.utc))


def plans_of(findings: ExperimentResult) -> list[tuple[Job, tuple[LoadedScenario, Plan]]]:
    """Return jobs with scenario and plan: all named runs; along axes the first with each set of FMUs."""
    jobs: dict[Any, Job] = {}
    for job in findings.planned.jobs if findings.planned else ():
        fmus = tuple(instance.fmu.sha256 for instance in job.plan.instances) if job.plan else ()
        jobs.setdefault((job.scenario, fmus) if findings.spec.axes else job.label, job)
    planner = Planner()
    return [
        (job, (planner.load(job.scenario, job.changes), job.plan))
        for job in jobs.values()
        if job.plan is not None
    ]


def answer(findings: ExperimentResult) -> str:
    """Return the result in one sentence: how many claims (or checks) hold, and where they were judged.

    Without claims and checks, what the named runs came to.
    """
    kind, results = ("claims", findings.claims) if findings.claims else ("checks", findings.checks)
    if not results:
        runs = findings.experiment.runs
        named = [
            LabelledRun(runs[name].label, run) for name, run in findings.results.items() if run.time.size
        ]
        return answer_of(named) if named else ""
    where = reach(findings)
    return f"Of {len(results)} {kind}, {in_sentence(counts_of(results))}{f', {where}' if where else ''}."


def in_sentence(counts: Mapping[str, int]) -> str:
    """Return how many verdicts are of each kind: `1 holds, 2 do not reproduce and 3 are undecided`."""
    parts = []
    for words, count in counts.items():
        verb, space, more = words.partition(" ")
        several = {"holds": "hold", "does": "do", "depends": "depend"}.get(verb)
        said = f"{several if count > 1 else verb}{space}{more}" if several else words
        parts.append(f"{count} {said}" if several else f"{count} {'is' if count == 1 else 'are'} {said}")
    return listed(parts, last="and")


def judged(result: ClaimResult, link: str) -> JudgedClaim:
    """Return a claim as the page shows it."""
    return JudgedClaim(
        claim=result.claim,
        measured=measured_words(result),
        verdict=verdict(result),
        margin=margin_words(result.verdict),
        region=region_words(result),
        agreeing=100 * result.region.agreeing if result.region else None,
        robust=result.region is not None and result.region.robust,
        lines=line_table(result) if result.region else None,
        strip=margin_strip(result.region.lines) if result.region else Markup(""),
        link=link,
    )


STRIP = (150, 360, 16)
"""Where the margins of a strip begin and end, and the height of an open value [pixels]."""
LABEL = 24
"""Characters of an open value that have room in the strip."""


def margin_strip(scans: Sequence[OpenValueScan]) -> Markup:
    """Return the margins at the levels of each open value as a drawing, a line each: the verdict flips at 0.

    Margins beyond 100 % are drawn at the end of their side; the chosen value has a ring.
    """
    begin, end, high = STRIP
    middle, half = (begin + end) / 2, (end - begin) / 2 - 8
    dots: dict[str, list[str]] = {"good": [], "bad": [], "ring": []}
    texts, axes = [], []
    for row, scan in enumerate(scans):
        y = high * row + 10
        label = scan.says if len(scan.says) <= LABEL else f"{scan.says[: LABEL - 1]}…"
        texts.append(Markup('<text x="0" y="{}">{}</text>').format(y + 4, label))
        axes.append(f"M{begin} {y}H{end}")
        for level in (scan.chosen, *scan.levels):
            margin = level.verdict.margin
            if margin is None:
                continue
            x, radius = middle + half * max(-1.0, min(1.0, margin)), 5 if level is scan.chosen else 3
            arc = f"a{radius} {radius} 0 1 0"
            circle = f"M{x - radius:.1f} {y}{arc} {2 * radius} 0{arc} {-2 * radius} 0"
            dots["ring" if level is scan.chosen else "good" if level.verdict.holds else "bad"].append(circle)
    bottom = high * len(scans) + 4
    ends = [(begin, "start", "−100 %"), (middle, "middle", "flips"), (end, "end", "100 %")]
    texts += [
        Markup('<text x="{}" y="{}" text-anchor="{}">{}</text>').format(x, bottom + 12, anchored, words)
        for x, anchored, words in ends
    ]
    paths = [f'<path class="axis" d="{"".join(axes)}M{middle} 2V{bottom}"/>']
    paths += [f'<path class="{kind}" d="{"".join(circles)}"/>' for kind, circles in dots.items() if circles]
    drawing = Markup("".join(paths)) + Markup("").join(texts)
    says = (
        "The margin at each level of each open value; the ring is the chosen one. The table has the numbers."
    )
    return Markup('<svg class="strip" viewBox="0 0 {} {}" role="img" aria-label="{}">{}</svg>').format(
        end + 2, bottom + 16, says, drawing
    )


def systems(plans: Sequence[tuple[Job, tuple[LoadedScenario, Plan]]], title: str) -> list[SystemDrawing]:
    """Return a diagram for each set of instances, with the scenarios that it applies to."""
    drawn = []
    for system, numbers in systems_of([plan for _, (_, plan) in plans]):
        files = dict.fromkeys(plans[k][0].scenario.name for k in numbers)
        drawn.append(SystemDrawing(diagram(system, title), ", ".join(files)))
    return drawn


LIVELY = tuple(map(metric, ("peak(sideslip)", "peak(yaw_rate)")))
"""Metrics of how lively a run is; the first that all runs have is used."""
VIEW = "view"
"""Anchor of the viewer."""


def viewer_of(
    findings: ExperimentResult, views: Sequence[View] = (), measured: Sequence[LabelledRun] = ()
) -> tuple[Carried | None, dict[str, int]]:
    """Return the content of a viewer of all runs of figures and claims, and the number of each run in it.

    Args:
        findings: the experiment and its results.
        views: of all runs, before those of the figures, of which the liveliest comes first.
        measured: recordings that all views show; their filter acts on the runs, too.
    """
    overlays = [spec for spec in findings.spec.figures if spec.what.shows == "runs"]
    named: dict[str, LabelledRun] = {}
    wanted = [run.name for spec in overlays for run in findings.experiment.matching(spec.runs)]
    wanted += [
        name for result in findings.judgements for name in runs_of_claim(findings.experiment, result.claim)
    ]
    for run in (findings.experiment.runs[name] for name in wanted):
        results = findings.results.get(run.name)
        if results is not None and results.time.size and len(named) < MOST:
            named.setdefault(run.name, LabelledRun(run.row or run.label, results))
    if not named:
        return None, {}
    numbers = {name: number for number, name in enumerate(named)}
    beside = range(len(named), len(named) + len(measured))
    drawn: list[tuple[float, View]] = []
    for spec in overlays:
        shown = [numbers[run.name] for run in findings.experiment.matching(spec.runs) if run.name in numbers]
        lively = _liveliest([run for number, run in enumerate(named.values()) if number in shown])
        drawn += [
            (lively, view)
            for view in views_of(spec.panels, title_of(findings, spec), [*shown, *beside])
            if shown
        ]
    ordered = [view for _, view in sorted(drawn, key=lambda item: -item[0])]
    settings = Settings([*views, *ordered] or [View()], largest=LARGEST)
    runs = [*named.values(), *measured]
    alike = filtered_alike([run.results for run in runs])
    runs = [LabelledRun(run.label, results) for run, results in zip(runs, alike, strict=True)]
    return carried(runs, settings), numbers


def _liveliest(runs: Sequence[LabelledRun]) -> float:
    """Return the largest sideslip of any run, or the largest yaw rate; 0 if neither is known."""
    for signal in LIVELY:
        values = [value.number for run in runs if (value := evaluate(run.results, signal))]
        if values:
            return max(values)
    return 0.0


def figure_files(findings: ExperimentResult) -> list[tuple[str, str]]:
    """Return title and path, without suffix, of the figures that the page shows in another form."""
    return [
        (title_of(findings, spec), f"{FIGURES}/{spec.name}")
        for spec in findings.spec.figures
        if (spec.what.over_axes and not spec.what.of_sample)
        or (spec.what.shows == "runs" and runs_of(findings, spec))
    ]


def charts(findings: ExperimentResult, folder: Path) -> list[FigureImage]:
    """Return the drawn figures of grids and samples as images; the view of the sweep shows the others."""
    drawn = []
    for spec in findings.spec.figures:
        file = folder / f"{spec.name}.svg"
        if (spec.what.shows == "grid" or spec.what.of_sample) and file.is_file():
            drawn.append(image_of(file, title_of(findings, spec)))
    return drawn


def definitions(findings: ExperimentResult) -> list[tuple[str, str, str]]:
    """Return the definition of every metric of the study."""
    every = [(spec, metric(spec.metric)) for spec in findings.spec.metrics.values()]
    return [
        (heading(spec), f"{chosen.definition}{spec.during('from ')}", chosen.formula)
        for spec, chosen in every
    ]


def settings(findings: ExperimentResult) -> Table:
    """Return the table of every run's overrides; along axes, of how many runs ended with each status."""
    statuses = list(dict.fromkeys(record.status for record in findings.records)) if findings.spec.axes else []
    headings = ["run", "scenario", "changed", "faults", *statuses]
    rows: list[list[Cell]] = []
    for run in findings.experiment.runs.values():
        results = findings.results.get(run.name)
        faults = "; ".join(fault.words for fault in results.record.faults) if results else ""
        ended = Counter(findings.record(case).status for case in findings.experiment.cases if case.run == run)
        rows.append([
            run.name or None, run.scenario.name, changed(run.changes) or None, faults or None,
            *(str(ended[status]) for status in statuses),
        ])  # fmt: skip
    kept = [k for k in range(len(headings)) if any(row[k] is not None for row in rows)]
    numbers = {place for place, k in enumerate(kept) if headings[k] in statuses}
    return Table("", [headings[k] for k in kept], [[row[k] for k in kept] for row in rows], [], numbers)


def grid_of_times(runs: Iterable[tuple[RunRecord, int]]) -> list[str]:
    """Return each combination of algorithm, step size and stop time that occurs in the records."""
    counts: Counter[str] = Counter()
    for run, number in runs:
        counts[f"{run.algorithm}, {1000 * run.step_size:g} ms, until {run.stop_time:g} s"] += number
    return [f"{text} ({counted(count, 'run')})" for text, count in counts.items()]
