"""What an experiment leaves on disk beside its runs and its page: the table, and all it comes to as JSON."""

from __future__ import annotations

import json
import math
from dataclasses import asdict
from pathlib import Path
from typing import Any

from .. import checksums
from ..files import read_bytes
from ..metrics.run_metrics import Value, metric
from ..metrics.symbols import si
from ..results.folder import LARGEST
from ..results.read import Results
from ..writing import write_whole
from .findings import Findings
from .judging import Judgement
from .limits import limits_of
from .margins import Region
from .numbers import si_number
from .table import write_table
from .verdicts import heading, verdict

RECORD = "experiment.json"


def write_findings(findings: Findings, drawn: dict[str, str], out: Path) -> None:
    """Write table and record into a folder; `drawn`: name -> title of the figures in it.

    Raises:
        ResultsError: they cannot be written.
    """
    write_table(findings, out)
    _tell_of_changes(out / RECORD)
    content = checksums.with_checksums(_record(findings, drawn))
    write_whole(out / RECORD, json.dumps(content, indent=1, ensure_ascii=False, allow_nan=False) + "\n")


def _tell_of_changes(file: Path) -> None:
    """Warn that a record was changed since it was written: it is about to be written anew from the runs."""
    try:
        found = json.loads(read_bytes(file, largest=LARGEST))
        words = checksums.changed_since(found) if isinstance(found, dict) else "it is no record"
    except FileNotFoundError:
        return
    except (OSError, ValueError, RecursionError):
        words = "it cannot be read"
    if words:
        checksums.warn(f"{file}: {words} since it was written; it is written anew from the runs")


def _record(findings: Findings, drawn: dict[str, str]) -> dict[str, Any]:
    spec, settings = findings.spec, findings.experiment.settings
    alone = not spec.axes or (len(settings) == 1 and bool(spec.runs))  # else the table has them
    return {
        "title": spec.title,
        "source": spec.source,
        "file": str(findings.experiment.path),
        "runs": {
            run.name: {
                "label": run.label,
                "scenario": str(run.scenario),
                "changes": [asdict(change) for change in run.changes],
                "status": findings.record(findings.cases_of(run, settings[0])[0]).status if alone else None,
                "failed": (findings.failure(run, settings[0]) or None) if alone else None,
                "fmus": _hashes(findings.results.get(run.name)),
                "metrics": {
                    key: _value(findings.values[run.name, key])
                    for key in spec.metrics
                    if alone and (run.name, key) in findings.values
                },
            }
            for run in findings.experiment.runs.values()
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
        "claims": [_judgement(one) for one in findings.claims],
        "checks": [_judgement(one) for one in findings.checks],
        "limits": {
            key: [
                {
                    "at": {axis: level.value for axis, level in one.others.items()},
                    "up_to": one.largest,
                    "not_at": one.beyond,
                }
                for one in limits_of(findings, limit)
            ]
            for key, limit in spec.limits.items()
        },
        "figures": drawn,
    }


def _hashes(results: Results | None) -> dict[str, str]:
    fmus = results.record.fmus.values() if results else ()
    return {fmu.name: fmu.sha256 for fmu in fmus if fmu.name and fmu.sha256}


def _value(value: Value) -> dict[str, Any]:
    number = value.number if math.isfinite(value.number) else "inf"
    half = {"half": value.half} if value.half else {}
    return {"value": number, "unit": si(value.unit), **half}


def _judgement(one: Judgement) -> dict[str, Any]:
    return {
        "says": one.said.says,
        "source": one.said.source,
        "holds_if": [str(condition) for condition in one.said.holds_if],
        "measured": list(one.measured),
        "holds": one.holds,
        "verdict": verdict(one),
        "margin": _finite(one.margin),
        "region": one.region and _region(one.region),
        "note": one.said.note,
    }


def _region(region: Region) -> dict[str, Any]:
    """Return how far a verdict carries; numbers of open values in SI, or as factors."""
    flip = region.flip
    return {
        "points": len(region.points),
        "holds_at": region.holding,
        "without_result": region.without_result,
        "spread": _finite(region.spread),
        "decided": region.decided,
        "robust": region.robust,
        "flip": flip and {"open_value": flip.open_value, "at": flip.place, "words": flip.words,
                          "chosen": flip.chosen or None},
        "margins": [_finite(one.margin) for one in region.points],
        "open_values": {
            line.open_value: {
                "chosen": line.chosen.place,
                "levels": [
                    {"at": one.words if one.place is None else one.place, "holds": one.spot.holds,
                     "margin": _finite(one.spot.margin)}
                    for one in line.stops
                ],
                "flip": line.flip and (line.flip.words if line.flip.place is None else line.flip.place),
            }
            for line in region.lines
        },
    }  # fmt: skip


def _finite(number: float | None) -> float | str | None:
    return number if number is None or math.isfinite(number) else str(number)
