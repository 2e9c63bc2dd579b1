"""What a study leaves on disk: figures, metrics of all runs, tables with verdicts (Markdown, JSON)."""

from __future__ import annotations

import json
import math
from dataclasses import asdict
from pathlib import Path
from typing import Any

from ..errors import ResultsError
from ..figures.panels import Run
from ..figures.plots import draw
from ..figures.style import save
from ..metrics.run_metrics import Value, metric
from ..results.read import Results
from ..writing import write_whole
from .claims import Judgement, condition_text
from .study import Each, Findings, all_tables, heading, verdict
from .study_file import FIGURES
from .study_schema import si_number
from .tables import for_markdown, harmless, si, write_csv

REPORT, METRICS, RECORD = "study.md", "metrics.csv", "study.json"


def write_study(findings: Findings, out: Path, *, each: Each = map) -> list[str]:
    """Write everything that a study leaves on disk into `out`; return what could not be drawn."""
    drawn, problems = draw_figures(findings, out, each)
    write_metrics(findings, out / METRICS)
    write_whole(out / REPORT, harmless(_markdown(findings, drawn)))
    record = json.dumps(_record(findings, drawn), indent=1, ensure_ascii=False, allow_nan=False)
    write_whole(out / RECORD, record + "\n")
    return problems


def draw_figures(findings: Findings, out: Path, each: Each = map) -> tuple[dict[str, Path], list[str]]:
    """Draw the study's figures; return each one's PNG by its title, and problems as sentences."""
    study = findings.study
    wanted = []
    for spec in study.spec.figures:
        runs = [
            Run(run.label, findings.results[run.name])
            for run in study.matching(spec.runs)
            if run.name in findings.results
        ]
        title = spec.title or f"{study.spec.title}: {spec.name}"
        wanted.append((runs, spec.panels, title, out / FIGURES / spec.name))
    drawn: dict[str, Path] = {}
    problems: list[str] = []
    for (_, _, title, stem), problem in zip(wanted, each(_draw, wanted), strict=True):
        if problem:
            problems.append(f"figure {stem.name}: {problem}")
        else:
            drawn[title] = stem.with_name(f"{stem.name}.png")
    return drawn, problems


def _draw(wanted: tuple[list[Run], list[str], str, Path]) -> str | None:
    runs, panels, title, stem = wanted
    if not runs:
        return "none of its runs has results"
    try:
        save(draw(runs, panels, title=title), stem)
    except ResultsError as error:
        return str(error)
    return None


def write_metrics(findings: Findings, path: Path) -> None:
    """Write the metrics of all runs as CSV, in SI."""
    specs = findings.study.spec.metrics
    units = {key: value.unit for (_, key), value in findings.values.items()}
    headings = [f"{key} [{si(units[key])}]" if key in units else key for key in specs]
    rows = [
        [name, "failed" if name in findings.failed else "completed"]
        + [findings.values.get((name, key)) for key in specs]
        for name in findings.study.runs
    ]
    write_csv(path, ["run", "status", *headings], rows)


def _markdown(findings: Findings, drawn: dict[str, Path]) -> str:
    spec = findings.study.spec
    parts = [f"# {spec.title}\n", f"{spec.source}\n" if spec.source else ""]
    parts += ["All numbers are computed from the recorded results in this folder.\n"]
    parts += [for_markdown(table) for table in all_tables(findings)]
    if findings.failed:
        failed = [f"- {name}: {reason}" for name, reason in findings.failed.items()]
        parts.append("\n".join(["Runs that did not reach their end:\n", *failed]) + "\n")
    parts.append("## How it was measured\n")
    parts += [_definition(key, findings) for key in spec.metrics]
    if drawn:
        parts.append("\n## Figures\n")
    parts += [f"![{title}]({FIGURES}/{png.name})\n" for title, png in drawn.items()]
    return "\n".join(part for part in parts if part)


def _definition(key: str, findings: Findings) -> str:
    spec = findings.study.spec.metrics[key]
    chosen = metric(spec.metric)
    return f"- {key}: {chosen.definition}{spec.during('from ')}: `{chosen.formula}`"


def _record(findings: Findings, drawn: dict[str, Path]) -> dict[str, Any]:
    spec = findings.study.spec
    return {
        "title": spec.title,
        "source": spec.source,
        "file": str(findings.study.path),
        "runs": {
            run.name: {
                "label": run.label,
                "scenario": str(run.scenario),
                "changes": [asdict(change) for change in run.changes],
                "failed": findings.failed.get(run.name),
                "fmus": _hashes(findings.results.get(run.name)),
                "metrics": {
                    key: _value(findings.values[run.name, key])
                    for key in spec.metrics
                    if (run.name, key) in findings.values
                },
            }
            for run in findings.study.runs.values()
        },
        "metrics": {
            key: {
                "metric": item.metric,
                "heading": heading(item),
                "formula": metric(item.metric).formula,
                "definition": metric(item.metric).definition,
                "window": item.window,
            }
            for key, item in spec.metrics.items()
        },
        "derived": {
            key: {
                "says": one.says,
                "expression": one.expression,
                "of": {word: [source.run, source.metric] for word, source in one.of.items()},
                "rank_correlation": one.rank_correlation,
                "published": None if one.published is None else si_number(one.published, one.unit),
                **(_value(findings.derived[key]) if key in findings.derived else {"value": None}),
            }
            for key, one in spec.derived.items()
        },
        "claims": [_judgement(one, "claims") for one in findings.claims],
        "checks": [_judgement(one, "checks") for one in findings.checks],
        "figures": {png.stem: title for title, png in drawn.items()},
    }


def _hashes(results: Results | None) -> dict[str, str]:
    fmus = results.run.get("fmus", {}) if results else {}
    return {fmu["name"]: fmu["sha256"] for fmu in fmus.values() if "name" in fmu and "sha256" in fmu}


def _value(value: Value) -> dict[str, Any]:
    number = value.number if math.isfinite(value.number) else "inf"
    return {"value": number, "unit": si(value.unit)}


def _judgement(one: Judgement, group: str) -> dict[str, Any]:
    return {
        "says": one.claim.says,
        "source": one.claim.source,
        "holds_if": [condition_text(condition) for condition in one.claim.holds_if],
        "measured": list(one.measured),
        "holds": one.holds,
        "verdict": verdict(one, group),
        "note": one.claim.note,
    }
