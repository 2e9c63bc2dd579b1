"""Tables of results for people: an experiment's runs, grids, derived numbers, verdicts and limits."""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

from yawbench.figures.display import DIGITS, digits_apart, digits_of, shown, shown_value
from yawbench.metrics.expressions import MetricValue, metric
from yawbench.metrics.verdict import Status, Verdict, VerdictText, worded
from yawbench.orchestrator.scenario.overrides import changed

from .axes import levels_of
from .claim_schema import GridSpec, MetricReference, MetricSpec, si_number
from .claims import ClaimResult, Comparison, RunValue
from .confidence import Bounds
from .derived import GridCell, cells, correlation, ranked
from .experiment import NamedRun
from .experiment_result import ExperimentResult
from .jobs import NOT_MADE
from .limits import limit_table
from .run_remarks import marked, remarks
from .schema import TableSpec
from .sections import sections
from .tables import Cell, Column, Table
from .uncertainty import sample_tables

CARRIES = ("margin", "region", "nearest flip")
"""Headings about the robustness of a verdict; the last two need a region."""


def all_tables(findings: ExperimentResult) -> list[Table]:
    """Return all tables of an experiment, in reading order."""
    return [
        *run_tables(findings),
        *derived_tables(findings),
        *claim_tables(findings),
        *(sections()[name].table(one) for name, found in findings.sections.items() for one in found),
        *limit_tables(findings),
        *sample_tables(findings),
    ]


def limit_tables(findings: ExperimentResult) -> list[Table]:
    """Return the tables of all limits, and the grids with `holds`."""
    tables = [limit_table(findings, name) for name in findings.spec.limits]
    tables += [
        table for grid in findings.spec.grids.values() if grid.holds for table in _grid_tables(findings, grid)
    ]
    if words := changed(findings.experiment.by_options):
        for table in tables:
            table.notes.append(f"changed: {words}")
    return tables


def _grid_tables(findings: ExperimentResult, spec: GridSpec) -> list[Table]:
    """Return the table of a grid's measured numbers and that of published ones, in SI units, three digits.

    A grid with `holds`, of derived numbers or of means over repeats has its numbers in display units.
    """
    ((_, rows),), ((_, columns),) = spec.rows.items(), spec.columns.items()
    every, width, values = cells(spec), len(columns), findings.values_of_grids
    lines = [(row, every[i * width : (i + 1) * width]) for i, row in enumerate(rows.values())]
    beside = every[len(rows) * width :]
    headings, numbers = [spec.corner, *columns.values()], set(range(1, width + 1))
    measured = [values.get(cell.key) for cell in every]
    if spec.holds or spec.derived or any(value and (value.half or value.between) for value in measured):
        return [_display_table(findings, spec, Table(spec.title, headings, numbers=numbers), lines, beside)]

    def digits(cell: GridCell) -> Cell:
        value = values.get(cell.key)
        return None if value is None else digits_of(value.number)

    def published(cell: GridCell) -> Cell:
        return None if cell.published is None else digits_of(cell.published)

    units = {value.shown_in for (_, key), value in values.items() if key == spec.metric}
    title = spec.title if units <= {"1", "%"} else f"{spec.title} [{units.pop()}]"
    tables = [Table(title, headings, [[row, *map(digits, line)] for row, line in lines], [], numbers)]
    if spec.published:
        printed = [[row, *map(published, line)] for row, line in lines]
        tables.append(Table(f"{title}: published values", headings, printed, [], numbers))
    notes = tables[-1].notes
    for cell in beside:
        theirs = "" if cell.published is None else f", the paper: {published(cell)}"
        notes.append(f"{cell.row}: {digits(cell)}{theirs}")
    if spec.published:
        coefficient, count = correlation(spec, values), len(ranked(spec))
        notes.append(
            f"rank correlation (Spearman) with the paper over {count} runs: "
            f"{'not all runs have results' if coefficient is None else digits_of(coefficient)}"
        )
    return tables


def _display_table(
    findings: ExperimentResult,
    spec: GridSpec,
    table: Table,
    lines: Sequence[tuple[str, Sequence[GridCell]]],
    beside: Sequence[GridCell],
) -> Table:
    """Fill the table of a grid in display units, with confidence and, if it has `holds`, its last row."""
    signs: dict[tuple[str, str], str] = {}  # of the verdicts on claims about a cell: "" if they hold
    for result in findings.judgements if spec.holds else ():
        about = {(c.run, c.derived or c.metric) for c in result.claim.holds_if}
        if len(about) == 1:
            (key,) = about
            signs[key] = signs.get(key) or {Status.PASSED: "", Status.FAILED: "✗"}.get(result.status, "?")

    def number(cell: GridCell) -> str:
        value = findings.values_of_grids.get(cell.key)
        return shown_value(value) if value else "-"

    def signed(cell: GridCell) -> str:
        return f"{number(cell)} {signs.get(cell.key, '')}".rstrip()

    def down_to(column: Sequence[GridCell]) -> str:
        """Return the last row down to which all claims about a column's cells hold."""
        good = [*itertools.takewhile(lambda cell: not signs.get(cell.key), column)]
        return "all" if len(good) == len(column) else good[-1].row if good else "-"

    table.rows += [[row, *map(signed, line)] for row, line in lines]
    table.rows += [[cell.row, *[number(cell)] * (len(table.columns) - 1)] for cell in beside]
    if spec.holds:
        table.rows.append([spec.holds, *map(down_to, zip(*(line for _, line in lines), strict=True))])
    return table


def _side_by_side(tables: Sequence[Table]) -> Table:
    """Join the tables of measured and published numbers into one."""
    if len(tables) == 1:
        return tables[0]
    ours, theirs = tables
    rows = [[*left, *right] for left, right in zip(ours.rows, theirs.rows, strict=True)]
    columns = [*ours.columns, Column("the paper:"), *theirs.columns[1:]]
    return Table(ours.title, columns, rows, theirs.notes)


def derived_tables(findings: ExperimentResult, *, apart: bool = False) -> list[Table]:
    """Return the tables of grids, and of the derived numbers outside them.

    `apart`: put the published numbers of a grid into a separate table.
    """
    spec, tables = findings.spec, []
    for grid in spec.grids.values():
        if not grid.holds:
            of_grid = _grid_tables(findings, grid)
            tables += of_grid if apart else [_side_by_side(of_grid)]
    in_grids = {cell.metric for grid in spec.grids.values() if grid.derived for cell in cells(grid)}
    if alone := {key: entry for key, entry in spec.derived.items() if key not in in_grids}:
        rows: list[list[Cell]] = [[entry.says, findings.derived.get(key)] for key, entry in alone.items()]
        headings = ["what", "value"]
        if any(entry.published is not None for entry in alone.values()):
            headings.append("the paper says")
            for row, entry in zip(rows, alone.values(), strict=True):
                printed = entry.published
                row.append(
                    None if printed is None else MetricValue(si_number(printed, entry.unit), entry.unit)
                )
        tables.append(Table("Computed from several runs", headings, [*rows]))
    return tables


def heading(spec: MetricSpec) -> str:
    """Return the heading of a metric's column."""
    if spec.heading:
        return spec.heading
    return f"{metric(spec.metric).formula}{spec.during()}"


def verdict(result: ClaimResult) -> VerdictText:
    """Return the verdict on a claim or check in words."""
    return worded(result.status, result.group)


def measured_words(result: ClaimResult) -> list[str]:
    """Return what was measured for each condition of a claim; along axes, where the claim holds."""
    return [*dict.fromkeys(map(_comparison_words, result.compared))] or [result.verdict.why]


def _comparison_words(comparison: Comparison) -> str:
    """Return the numbers of a condition, against that of the run that is its bound: `5 % against 3 %`."""
    other, unit, bound = comparison.taken_from, comparison.unit, comparison.bound
    numbers = [one.value.number for one in comparison.measured if one.value]
    near = [(number, bound) for number in numbers] if bound is not None else []
    digits = digits_apart(near, unit) if numbers else DIGITS
    text = _range(comparison.measured, digits)
    if other is None:
        return text
    times = comparison.condition.bound.times
    factor = f"{times:g} × " if other.value and times != 1.0 else ""
    return f"{text} against {factor}{_range([other], digits)}"


def _range(measured: Sequence[RunValue], digits: int) -> str:
    """Return the value as text, or the smallest and largest with their runs where they read differently."""
    known = sorted(((one.value, one.label) for one in measured if one.value), key=lambda pair: pair[0].number)
    ends: dict[str, str] = {}
    for value, label in (*known[:1], *known[-1:]):
        text = shown_value(value, digits=digits)
        ends.setdefault(text, label)
    text = " to ".join(f"{number} ({label})" if label else number for number, label in ends.items())
    return " and ".join(filter(None, [text, "no result" if len(known) < len(measured) else ""]))


def margin_words(verdict: Verdict) -> str | None:
    """Return a margin as text, `14 %`, negative where the claim fails; None if missing."""
    return None if verdict.margin is None else share(verdict.margin)


def share(ratio: float) -> str:
    """Return a margin in per cent with two digits, 1.6 %; beyond 100 % its size no longer matters."""
    if abs(ratio) > 1.0:
        return "by far" if ratio > 0 else "missed by far"
    return shown(ratio, "%", digits=2)


def reach(findings: ExperimentResult) -> str:
    """Describe where claims were judged; "" without a region."""
    if findings.spec.region is None or not findings.claims:
        return ""
    if not findings.regions:
        return "at the chosen point only; the region of the open values has not been run"
    alone = [replace(claim, region=None) for claim in findings.claims]
    return f"over the region of the open values; at the chosen point alone {tally_words(counts_of(alone))}"


def tally_words(counts: Mapping[str, int]) -> str:
    """Return counts of verdicts as text: `holds: 13, undecided: 2`."""
    return ", ".join(f"{word}: {count}" for word, count in counts.items())


def region_words(judgement: ClaimResult) -> list[str]:
    """Describe the robustness of a verdict: `0 of 48 flip, at most 7.4 %`, `flips at amplitude 0.08 rad`."""
    region = judgement.region
    if region is None:
        return []
    flip = region.flip
    return [
        share_words(region.flipping, len(region.points), region.flip_bounds, region.without_result),
        flip_words(flip.says, flip.words, flip.chosen) if flip else NO_FLIP,
    ]


NO_FLIP = "no flip at any level tried"


def share_words(flipping: int, points: int, bounds: Bounds, without_result: int = 0) -> str:
    """Describe the share of a region that flips a verdict: `4 of 112 flip, 1.1 to 9.7 %`."""
    low, high = (f"{digits_of(100 * bound, 2)} %" for bound in bounds)
    between = f"{low.removesuffix(' %')} to {high}"
    interval = f"at most {high}" if not flipping else f"at least {low}" if flipping == points else between
    failed = f", {without_result} of them without a result" if without_result else ""
    return f"{flipping} of {points} flip{failed}, {interval}"


def flip_words(says: str, level: str, chosen: str = "") -> str:
    """Describe a flip: the open value, the level, and the chosen level if known."""
    return f"flips at {says} {level}" + (f" (chosen: {chosen})" if chosen else "")


def counts_of(judgements: Sequence[ClaimResult]) -> dict[str, int]:
    """Return verdict -> number of judgements, of the verdicts that occur."""
    words = sorted(map(verdict, judgements), key=lambda word: [*Status].index(word.status))
    return dict(Counter(words))


def run_tables(findings: ExperimentResult) -> list[Table]:
    """Return the tables of metrics: one row per run, with the paper's claims about that run alone."""
    return [_run_table(findings, table) for table in findings.spec.tables]


def _run_table(findings: ExperimentResult, spec: TableSpec) -> Table:
    study = findings.experiment
    runs = study.matching(spec.runs)
    alone = len(study.settings) == 1
    claims = {run.name: _claims_of(findings, run, spec) if alone else [] for run in runs}
    columns = [study.spec.metrics[key] for key in spec.metrics]
    table = Table(spec.title, ["run", *map(heading, columns)])
    formulas: dict[str, list[str]] = {}
    for column in columns:
        if column.heading:
            formulas.setdefault(metric(column.metric).formula, []).append(column.heading)
    table.notes = [f"{', '.join(named)}: {formula}" for formula, named in formulas.items()]
    some = any(claims.values())
    carries = CARRIES if findings.regions else CARRIES[:1]
    if some and not findings.regions and (only := reach(findings)):
        table.notes.append(f"verdicts: {only}")
    if some:  # next to the first metric, which the claims are about
        table.columns[2:2] = map(Column, ["the paper says", "verdict", *carries])
    for run, setting in itertools.product(runs, study.settings):
        row = ", ".join(filter(None, [run.row, *(level.words for level in setting)]))
        if not findings.made(run, setting):
            cells: list[Cell] = [NOT_MADE.status, *[None] * (len(table.headings) - 2)]
        elif why := findings.failure(run, setting):
            cells = [worded(Status.FAILED), *[None] * (len(table.headings) - 2)]
            table.notes.append(f"{row}: {why}")
        else:
            cells = [findings.at[setting].get((run.name, key)) for key in spec.metrics]
            ended = (findings.record(case).ended for case in findings.cases_of(run, setting))
            if early := next(filter(None, ended), None):
                table.notes.append(
                    f"{row}: {early}; metrics of the whole run or of later windows have no value"
                )
            if some:
                cells[1:1] = _beside(claims[run.name], len(carries))
                table.notes += [f"{run.row}: {j.claim.note}" for j in claims[run.name] if j.claim.note]
        results = findings.results.get(run.name)
        table.rows.append([marked(row, results) if results else row, *cells])
        table.notes += remarks([(row, results)]) if results else []
    return table


def _beside(judged: Sequence[ClaimResult], carries: int) -> list[Cell]:
    """Return the cells of a run's claims: claim, verdict, robustness; several claims share the cells."""
    rows = [
        [f"{result.claim.short} ({result.claim.source})", verdict(result), *_carries(result, carries)]
        for result in judged
    ]
    columns: Iterable[Sequence[str | None]] = zip(*rows, strict=True) if rows else [()] * (2 + carries)
    known = [[text for text in column if text] for column in columns]
    return [texts[0] if len(texts) == 1 else "; ".join(texts) or None for texts in known]


def _claims_of(findings: ExperimentResult, run: NamedRun, table: TableSpec) -> list[ClaimResult]:
    """Return the claims with a `short` text that are only about the table's first metric of this run."""
    return [
        judgement
        for judgement in findings.claims
        if judgement.claim.short
        and all(
            (condition.run, condition.metric) == (run.name, table.metrics[0])
            and not isinstance(condition.bound, MetricReference)
            for condition in judgement.claim.holds_if
        )
    ]


def _carries(judgement: ClaimResult, columns: int) -> list[str | None]:
    """Return the cells of `CARRIES`."""
    how_far: list[str | None] = [*region_words(judgement)] or [None, None]
    return [margin_words(judgement.verdict), *how_far][:columns]


def line_table(judgement: ClaimResult) -> Table:
    """Return a table of the open values that a claim depends on: range of margins, flips."""
    assert judgement.region is not None
    table = Table("", ["open value", "margin, from", "to", "flips at"], numbers={1, 2})
    for line in judgement.region.lines:
        ends = line.margins
        flip = line.flip.words if line.flip else None
        table.rows.append([line.says, *map(share, ends or ()), *([] if ends else [None, None]), flip])
    if (spread := judgement.region.spread) is not None:
        words = share(spread) if spread <= 1.0 else "more than 100 %"
        table.notes = [f"spread of the margin over all of them: {words}"]
    return table


def region_table(findings: ExperimentResult) -> Table:
    """Return a table of a region's open values: chosen value, range, reason for the range."""
    region = findings.spec.region
    assert region is not None
    lines = {line.open_value: line for result in findings.regions.values() for line in result.lines}
    rows: list[list[Cell]] = []
    for name, open_value in region.open_values.items():
        line, levels = lines.get(name), [level.words for level in levels_of(open_value.stepped)]
        unit = open_value.unit or (line.unit if line and line.unit != "1" and not open_value.times else "")
        words = ", ".join(levels) if open_value.start is None else f"{levels[0]} to {levels[-1]}"
        chosen = line.words(line.chosen.number) if line and line.chosen.number is not None else None
        rows.append([
            open_value.says or name, None if open_value.times else chosen,
            f"{words} × as chosen" if open_value.times else f"{words} {unit}".rstrip(), open_value.because,
        ])  # fmt: skip
    title = f"Open values: {region.points} to {region.most} points over all together, and one at a time"
    return Table(title, ["open value", "chosen", "range", "because"], [*rows])


def claim_tables(findings: ExperimentResult) -> list[Table]:
    """Return the tables of claims that are not in a table of runs, and of our own checks."""
    beside = {
        id(judgement)
        for table in findings.spec.tables
        for run in findings.experiment.matching(table.runs)
        for judgement in _claims_of(findings, run, table)
    }
    tables = []
    for title, judged in (
        ("Claims of the paper across runs", findings.claims),
        ("Checks of this project", findings.checks),
    ):
        table = Table(
            title, ["claim", "measured", "verdict", *(CARRIES if findings.regions else CARRIES[:1])]
        )
        for result in judged:
            if id(result) not in beside:
                says = (
                    f"{result.claim.says} ({result.claim.source})"
                    if result.claim.source
                    else result.claim.says
                )
                note = f"\n{result.claim.note}" if result.claim.note else ""
                carries = _carries(result, len(table.headings) - 3)
                numbers = "\n".join(measured_words(result))
                table.rows.append([f"{says}{note}", numbers, verdict(result), *carries])
        if not findings.regions and judged is findings.claims and (only := reach(findings)):
            table.notes.append(f"verdicts: {only}")
        tables += [table] if table.rows else []
    return tables
