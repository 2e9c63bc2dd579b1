"""A study as a chapter of the report: verdicts, system, figures, tables, parameters, how to repeat it."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ..figures.panels import Run
from ..figures.plots import title_of
from ..metrics.run_metrics import metric
from ..plan import Plan
from ..results.read import Results
from ..scenario.load import Scenario
from ..studies.claims import Judgement, condition_text
from ..studies.study import (
    FAILS,
    HOLDS,
    NOT_JUDGED,
    Each,
    Findings,
    derived_tables,
    heading,
    run_tables,
    verdict,
)
from ..studies.study_file import FIGURES
from ..studies.tables import Cell, Table
from ..titles import changed
from ..wording import counted
from .diagram import diagrams
from .facts import anchor, animation_of, figure_of, fmus_of, programs_of
from .provenance import count_kinds, groups_of
from .system import systems_of

PAPER = "the paper:"
"""Heading of the column that separates what a grid measured from what the paper prints."""


def chapter(
    findings: Findings,
    plans: dict[str, tuple[Scenario, Plan]],
    stale: dict[str, str],
    *,
    folder: Path,
    shown_in: Path,
    each: Each = map,
) -> dict[str, Any]:
    """Return what a study's chapter says.

    Args:
        findings: the study and what it comes to.
        plans: run -> its scenario and plan.
        stale: run -> why its results are not those of its plan.
        folder: of the study's results and figures.
        shown_in: folder of the page.
        each: how to draw many panels.
    """
    study = findings.study
    name = anchor(f"{study.path.absolute().parent.name} {study.path.stem}")
    groups = groups_of(list(plans.values()))
    return {
        "id": name,
        "title": study.spec.title,
        "source": study.spec.source,
        "counts": counts(findings.claims, "claims"),
        "claims": [judged(one, "claims") for one in findings.claims],
        "checks": [judged(one, "checks") for one in findings.checks],
        "systems": systems(findings, plans),
        "animation": animation(findings),
        "figures": figures(findings, name, _beside(folder / FIGURES, shown_in), each),
        "tables": [*run_tables(findings), *_apart(derived_tables(findings))],
        "definitions": definitions(findings),
        "groups": groups,
        "kinds": count_kinds(groups),
        "failed": findings.failed,
        "stale": stale,
        "command": f"yawbench study {shlex.quote(str(study.path))}",
        "folder": str(folder),
        "settings": settings(findings),
        "grid": grid_of_times(findings.results.values()),
        "fmus": fmus_of(findings.results.values()),
        "programs": programs_of(findings.results.values()),
    }


def counts(judgements: Sequence[Judgement], group: str) -> dict[str, int]:
    """Return how many judgements have each verdict, those that occur."""
    words = [verdict(one, group) for one in judgements]
    return {word: words.count(word) for word in (HOLDS, FAILS[group], NOT_JUDGED) if word in words}


def judged(one: Judgement, group: str) -> dict[str, Any]:
    """Return a claim with what was measured and its verdict."""
    return {
        "says": one.claim.says,
        "source": one.claim.source,
        "measured": one.measured,
        "conditions": [condition_text(condition) for condition in one.claim.holds_if],
        "verdict": verdict(one, group),
        "note": one.claim.note,
    }


def systems(findings: Findings, plans: dict[str, tuple[Scenario, Plan]]) -> list[dict[str, Any]]:
    """Return a drawing for each set of units, and of which scenarios it is."""
    names = list(plans)
    drawn = []
    for system, numbers in systems_of([plan for _, plan in plans.values()]):
        files = dict.fromkeys(findings.study.runs[names[k]].scenario.name for k in numbers)
        drawn.append({"drawing": diagrams(system, findings.study.spec.title), "runs": ", ".join(files)})
    return drawn


def animation(findings: Findings) -> dict[str, Any] | None:
    """Return the animation of the first figure with a path: its first run and its last."""
    study = findings.study
    for figure in study.spec.figures:
        runs = [run for run in study.matching(figure.runs) if run.name in findings.results]
        if "path" in figure.panels and runs:
            ends = [runs[0], *runs[-1:]] if len(runs) > 1 else runs
            pair = [(run.label, findings.results[run.name]) for run in ends]
            seen = animation_of(pair, " and ".join(label for label, _ in pair))
            if seen is not None:
                return {"title": figure.title or title_of(_runs(pair)), "drawing": seen}
    return None


def _runs(pairs: Sequence[tuple[str, Results]]) -> list[Run]:
    return [Run(label, results) for label, results in pairs]


def figures(findings: Findings, chapter: str, files: str, each: Each = map) -> list[Any]:
    """Return the study's figures, those that its runs have results for."""
    study = findings.study
    wanted = []
    for spec in study.spec.figures:
        matching = study.matching(spec.runs)
        runs = [
            Run(run.label, findings.results[run.name]) for run in matching if run.name in findings.results
        ]
        title = spec.title or f"{study.spec.title}: {spec.name}"
        paths = tuple(f"{files}/{spec.name}.{kind}" for kind in ("svg", "png"))
        if runs:
            wanted.append((f"{chapter}-{anchor(spec.name)}", title, runs, spec.panels, paths))
    return [figure for figure in each(figure_of, wanted) if figure is not None]


def _apart(tables: Sequence[Table]) -> list[Table]:
    """Return the tables; what a grid measured and what the paper prints as two."""
    found: list[Table] = []
    for table in tables:
        if PAPER not in table.headings:
            found.append(table)
            continue
        middle = table.headings.index(PAPER)
        numbers = set(range(1, middle))
        corner = table.headings[0]
        ours = Table(table.title, table.headings[:middle], [row[:middle] for row in table.rows], [], numbers)
        theirs = Table(
            f"{table.title}: what the paper prints", [corner, *table.headings[middle + 1 :]],
            [row[middle:] for row in table.rows], table.notes, numbers,
        )  # fmt: skip
        found += [ours, theirs]
    return found


def definitions(findings: Findings) -> list[dict[str, str]]:
    """Return how every metric of the study is defined."""
    found = []
    for spec in findings.study.spec.metrics.values():
        chosen = metric(spec.metric)
        found.append(
            {
                "heading": heading(spec),
                "definition": f"{chosen.definition}{spec.during('from ')}",
                "formula": chosen.formula,
            }
        )
    return found


def settings(findings: Findings) -> Table:
    """Return how every run differs from its scenario."""
    rows: list[Sequence[Cell]] = [
        [
            run.name,
            run.scenario.name,
            changed(run.changes) or None,
        ]
        for run in findings.study.runs.values()
    ]
    kept = [k for k in range(3) if any(row[k] is not None for row in rows)]
    headings = ["run", "scenario", "changed"]
    return Table("", [headings[k] for k in kept], [[row[k] for k in kept] for row in rows])


def grid_of_times(recorded: Any) -> list[str]:
    """Return algorithm, step and end of the runs, each combination once, as their records say."""
    found: dict[str, int] = {}
    for results in recorded:
        run = results.run
        text = (
            f"{run.get('algorithm')}, {1000 * run.get('step_size', 0):g} ms, until {run.get('stop_time'):g} s"
        )
        found[text] = found.get(text, 0) + 1
    return [f"{text} ({counted(count, 'run')})" for text, count in found.items()]


def _beside(path: Path, folder: Path) -> str:
    """Return a path as a reader of a page in a folder finds it."""
    try:
        return path.resolve().relative_to(folder.resolve()).as_posix()
    except ValueError:
        return path.as_posix()
