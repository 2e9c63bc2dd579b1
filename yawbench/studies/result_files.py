"""Files of an experiment's result: its table as CSV and Parquet, verdicts, record as JSON.

The table has one row per case, in the order of the design; equal runs give equal bytes.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from yawbench.foundation.safe_files import write_whole
from yawbench.metrics.expressions import MetricValue, metric
from yawbench.metrics.measures import si
from yawbench.orchestrator.results.reader import Results

from .claim_schema import si_number, text_of
from .claims import ClaimResult, Region
from .experiment_result import ExperimentResult
from .limits import limits_of
from .result_tables import heading, measured_words, verdict
from .tables import Cell, Column, Kind, Table, column, to_csv
from .uncertainty import sample_columns

if TYPE_CHECKING:
    import pyarrow as pa

TABLE = "table.csv", "table.parquet"
VERDICTS = "verdicts.csv"


def columns_of(findings: ExperimentResult) -> Table:
    """Return the columns of the table: run, axes, status, reason, warnings, metrics, key."""
    cases, spec, planned = findings.experiment.cases, findings.spec, findings.planned
    records = findings.records
    if spec.runs:
        columns = [column("run", "string", [case.run.name for case in cases], {"description": "its name"})]
    else:
        numbers = [case.number + 1 for case in cases]
        columns = [column("run", "int64", numbers, {"description": "number of the run, from 1"})]
    for i, (name, axis) in enumerate(spec.axes.items()):
        varied = ", ".join(map(str, axis.targets))
        about = {"description": axis.says or varied, "varies": varied}
        if axis.numeric and planned:
            levels = [planned.number(name, case.point[i]) for case in cases]
            columns.append(column(name, "float64", levels, about | {"unit": planned.units[name]}))
        else:
            columns.append(column(name, "string", [case.point[i].words for case in cases], about))
    codes = {"description": "codes of the warnings about the run, see docs/diagnostics.md"}
    columns += [
        column("status", "string", [record.status for record in records]),
        column("reason", "string", [record.reason for record in records]),
        column("warnings", "string", [", ".join(record.warning_codes) or None for record in records], codes),
    ]
    for key, metric_spec in spec.metrics.items():
        chosen, unit = metric(metric_spec.metric), findings.unit(key)
        about = {
            "metric": chosen.name,
            "description": f"{chosen.definition}{metric_spec.during()}",
            "unit": si(unit),
        }
        values = [findings.value(case, key) for case in cases]
        columns.append(column(key, "float64", [value.number if value else None for value in values], about))
    keys = planned.keys if planned else [None] * len(cases)
    return Table.of_columns([*columns, column("key", "string", keys)])


def verdict_columns(findings: ExperimentResult) -> Table:
    """Return columns with verdict, margin and region, a row per claim and check."""
    kinds: dict[str, Kind] = {
        "group": "string", "says": "string", "verdict": "string", "margin": "float64", "spread": "float64",
        "points": "int64", "holds at": "int64", "flips": "int64", "share from": "float64",
        "share to": "float64", "without result": "int64", "flips by": "string", "flips at": "string",
        "chosen": "string", "robust": "string",
    }  # fmt: skip
    shares = ("margin", "spread", "share from", "share to")
    columns = [Column(name, kind, {"unit": "1"} if name in shares else {}) for name, kind in kinds.items()]
    rows = []
    for result in findings.judgements:
        row: dict[str, Cell] = {
            "group": result.group, "says": result.claim.says, "verdict": verdict(result),
            "margin": result.verdict.margin,
        }  # fmt: skip
        if region := result.region:
            bounds, flip = region.flip_bounds, region.flip
            row |= {
                "spread": region.spread, "points": len(region.points), "holds at": region.holding,
                "flips": region.flipping, "share from": bounds.low, "share to": bounds.high,
                "without result": region.without_result, "robust": text_of(region.robust),
            }  # fmt: skip
            if flip:
                row |= {"flips by": flip.open_value, "flips at": flip.words, "chosen": flip.chosen or None}
        rows.append([row.get(name) for name in kinds])
    return Table("", columns, rows)


def _parquet(findings: ExperimentResult, table: Table) -> bytes:
    import pyarrow as pa
    import pyarrow.parquet as pq

    kinds = [getattr(pa, table.kind(k))() for k in range(len(table.columns))]
    fields = [
        pa.field(column.heading, kind, metadata=column.about or None)
        for column, kind in zip(table.columns, kinds, strict=True)
    ]
    schema = pa.schema(fields, metadata={"experiment": _encodable(_description(findings))})
    arrays = [_arrow_column(table.values(k), table.kind(k)) for k in range(len(table.columns))]
    content = pa.BufferOutputStream()
    pq.write_table(pa.Table.from_arrays(arrays, schema=schema), content, compression="zstd")
    written: bytes = content.getvalue().to_pybytes()
    return written


def _arrow_column(values: Sequence[Any], kind: str) -> pa.Array:
    """Return a column of a table for Arrow, without `pyarrow.array`, which imports pandas first."""
    import pyarrow as pa

    present = np.array([value is not None for value in values], bool)
    if kind == "string":
        texts = [b"" if value is None else _encodable(value).encode() for value in values]
        ends = np.cumsum([0, *map(len, texts)]).astype(np.int32)
        memory = [pa.py_buffer(ends), pa.py_buffer(b"".join(texts))]
    else:
        memory = [pa.py_buffer(np.array([0 if value is None else value for value in values], kind))]
    validity = None if present.all() else pa.py_buffer(np.packbits(present, bitorder="little"))
    return pa.Array.from_buffers(getattr(pa, kind)(), len(values), [validity, *memory])


def _encodable(value: Any) -> Any:
    """Return a value; in text, lone surrogates are escaped, as by `write_whole`."""
    return value.encode("utf-8", "backslashreplace").decode() if isinstance(value, str) else value


def _description(findings: ExperimentResult) -> str:
    """Describe the experiment as JSON: the content of its file, its FMUs with their SHA-256."""
    content = findings.spec.model_dump(by_alias=True, exclude_defaults=True)
    about = {"experiment": content, "fmus": dict(findings.fmus)}
    return json.dumps(about, ensure_ascii=False, default=str)


RECORD = "experiment.json"


def write_findings(findings: ExperimentResult, drawn: dict[str, str], out: Path) -> None:
    """Write table (also as Parquet, with units in it), verdicts, what a sample tells, and the record.

    Args:
        findings: of the experiment.
        drawn: name -> title of its figures.
        out: folder.

    Raises:
        OSError: a file cannot be written.
    """
    table = columns_of(findings)
    record = json.dumps(record_of(findings, drawn), indent=1, ensure_ascii=False, allow_nan=False)
    contents: dict[str, str | bytes] = {TABLE[0]: to_csv(table), TABLE[1]: _parquet(findings, table)}
    if findings.spec.claims or findings.spec.checks:
        contents[VERDICTS] = to_csv(verdict_columns(findings))
    contents |= {f"{name}.csv": to_csv(columns) for name, columns in sample_columns(findings).items()}
    for name, content in {**contents, RECORD: record + "\n"}.items():
        write_whole(out / name, content)


def record_of(findings: ExperimentResult, drawn: Mapping[str, str] | None = None) -> dict[str, Any]:
    """Return the record of an experiment as JSON-ready data; `drawn`: name -> title of its figures."""
    spec, settings = findings.spec, findings.experiment.settings
    alone = not spec.axes or (len(settings) == 1 and bool(spec.runs))  # else see the table
    return {
        "title": spec.title,
        "source": spec.source,
        "file": str(findings.experiment.path),
        "runs": {
            run.name: {
                "label": run.label,
                "scenario": str(run.scenario),
                "changes": [change.record for change in run.changes],
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
                "says": number.says,
                "expression": number.expression and str(number.expression),
                "of": {word: [source.run, source.metric] for word, source in number.of.items()},
                "rank_correlation": number.rank_correlation,
                "published": None if number.published is None else si_number(number.published, number.unit),
                **(_value(findings.derived[key]) if key in findings.derived else {"value": None}),
            }
            for key, number in spec.derived.items()
        },
        "claims": [_judgement(result) for result in findings.claims],
        "checks": [_judgement(result) for result in findings.checks],
        **{name: [finding.as_data() for finding in found] for name, found in findings.sections.items()},
        "limits": {
            key: [
                {
                    "at": {axis: level.value for axis, level in reached.others.items()},
                    "up_to": reached.largest,
                    "not_at": None if reached.missing else reached.beyond,
                    **reached.verdict.as_data(),
                }
                for reached in limits_of(findings, limit)
            ]
            for key, limit in spec.limits.items()
        },
        "figures": dict(drawn or {}),
    }


def _hashes(results: Results | None) -> dict[str, str]:
    fmus = results.record.fmus.values() if results else ()
    return {fmu.name: fmu.sha256 for fmu in fmus if fmu.name and fmu.sha256}


def _value(value: MetricValue) -> dict[str, Any]:
    number = value.number if math.isfinite(value.number) else "inf"
    half = {"half": value.half} if value.half and not value.between else {}
    between = {"between": [*map(_finite, value.between)]} if value.between else {}
    return {"value": number, "unit": value.unit, **half, **between}


def _judgement(result: ClaimResult) -> dict[str, Any]:
    deciding = result.verdict.as_data()
    return {
        "says": result.claim.says,
        "source": result.claim.source,
        "holds_if": [str(condition) for condition in result.claim.holds_if],
        "measured": measured_words(result),
        "holds": result.verdict.holds,
        "verdict": verdict(result),
        **{key: deciding[key] for key in ("value", "relation", "bound", "unit", "margin")},
        "region": result.region and _region(result.region),
        "note": result.claim.note,
    }


def _region(region: Region) -> dict[str, Any]:
    """Return the verdicts over a region; numbers of open values are in SI units, or factors."""
    flip = region.flip
    return {
        "points": len(region.points),
        "holds_at": region.holding,
        "without_result": region.without_result,
        "spread": _finite(region.spread),
        "flipping": region.flipping,
        "flip_bounds": [*region.flip_bounds],
        "robust": region.robust,
        "flip": flip and {"open_value": flip.open_value, "at": flip.number, "words": flip.words,
                          "chosen": flip.chosen or None},
        "margins": [_finite(point.margin) for point in region.points],
        "open_values": {
            line.open_value: {
                "chosen": line.chosen.number,
                "levels": [
                    {"at": level.words if level.number is None else level.number,
                     "holds": level.verdict.holds, "margin": _finite(level.verdict.margin)}
                    for level in line.levels
                ],
                "flip": line.flip and (line.flip.words if line.flip.number is None else line.flip.number),
            }
            for line in region.lines
        },
    }  # fmt: skip


def _finite(number: float | None) -> float | str | None:
    return number if number is None or math.isfinite(number) else str(number)
