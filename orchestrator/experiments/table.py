"""The table of an experiment: one row per case, in the order of the design; equal runs, equal bytes."""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from ..errors import ResultsError
from ..files import reason
from ..metrics.run_metrics import metric
from ..metrics.symbols import si
from ..writing import write_whole
from .findings import Findings
from .numbers import text_of
from .verdicts import verdict

if TYPE_CHECKING:
    import pandas as pd

TABLE = "table.csv", "table.parquet"
VERDICTS = "verdicts.csv"


@dataclass(frozen=True)
class Column:
    """A column of the table; numbers are in SI, with their unit in `about`."""

    name: str
    kind: Literal["int64", "float64", "string"]
    values: Sequence[Any]
    about: dict[str, str] = field(default_factory=dict)


def columns_of(findings: Findings) -> list[Column]:
    """Return run, axes, how each case ended, what was remarkable, metrics, key."""
    cases, spec, planned = findings.experiment.cases, findings.spec, findings.planned
    records = findings.records
    if spec.runs:
        columns = [Column("run", "string", [case.run.name for case in cases], {"description": "its name"})]
    else:
        numbers = [case.number + 1 for case in cases]
        columns = [Column("run", "int64", numbers, {"description": "number of the run, from 1"})]
    for i, (name, axis) in enumerate(spec.axes.items()):
        about = {"description": axis.says or ", ".join(axis.places), "varies": ", ".join(axis.places)}
        if axis.numeric and planned:
            levels = [planned.number(name, case.point[i]) for case in cases]
            columns.append(Column(name, "float64", levels, about | {"unit": planned.units[name]}))
        else:
            columns.append(Column(name, "string", [case.point[i].words for case in cases], about))
    kinds = {"description": "what was remarkable in the run's course, by its kind"}
    columns += [
        Column("status", "string", [one.status for one in records]),
        Column("reason", "string", [one.reason for one in records]),
        Column("findings", "string", [", ".join(one.findings) or None for one in records], kinds),
    ]
    for key, one in spec.metrics.items():
        chosen, unit = metric(one.metric), findings.unit(key)
        about = {"metric": chosen.name, "description": f"{chosen.definition}{one.during()}", "unit": si(unit)}
        values = [findings.value(case, key) for case in cases]
        columns.append(Column(key, "float64", [value.number if value else None for value in values], about))
    keys = [job.key for job in planned.jobs] if planned else [None] * len(cases)
    return [*columns, Column("key", "string", keys)]


def verdict_columns(findings: Findings) -> list[Column]:
    """Return what was said, its verdict, margin and region: a row per claim and check."""
    every = findings.judgements
    regions = [one.region for one in every]
    flips = [region and region.flip for region in regions]
    return [
        Column("group", "string", [one.group for one in every]),
        Column("says", "string", [one.said.says for one in every]),
        Column("verdict", "string", [verdict(one) for one in every]),
        Column("margin", "float64", [one.margin for one in every], {"unit": "1"}),
        Column("spread", "float64", [region and region.spread for region in regions], {"unit": "1"}),
        Column("points", "int64", [region and len(region.points) for region in regions]),
        Column("holds at", "int64", [region and region.holding for region in regions]),
        Column("without result", "int64", [region and region.without_result for region in regions]),
        Column("flips by", "string", [flip and flip.open_value for flip in flips]),
        Column("flips at", "string", [flip and flip.words for flip in flips]),
        Column("chosen", "string", [(flip and flip.chosen) or None for flip in flips]),
        Column("robust", "string", [region and text_of(region.robust) for region in regions]),
    ]


def to_pandas(columns: Sequence[Column]) -> pd.DataFrame:
    """Return the table; `attrs["units"]` holds the units of its numbers."""
    import pandas as pd

    frame = pd.DataFrame({one.name: pd.Series(one.values, dtype=_dtype(one)) for one in columns})
    frame.attrs["units"] = {one.name: one.about["unit"] for one in columns if "unit" in one.about}
    return frame


def _dtype(column: Column) -> str:
    return "object" if column.kind == "string" else column.kind


def write_table(findings: Findings, out: Path) -> None:
    """Write the table into a folder, as CSV and as Parquet with units in the fields' metadata.

    Raises:
        ResultsError: it cannot be written.
    """
    columns = columns_of(findings)
    contents: dict[str, str | bytes] = {TABLE[0]: to_csv(columns), TABLE[1]: _parquet(findings, columns)}
    if findings.spec.claims or findings.spec.checks:
        contents[VERDICTS] = to_csv(verdict_columns(findings))
    for name, content in contents.items():
        try:
            write_whole(out / name, content)
        except OSError as error:  # noqa: PERF203 - two files
            raise ResultsError(f"{out / name}: cannot be written: {reason(error)}.") from None


def to_csv(columns: Sequence[Column]) -> str:
    """Return columns as CSV, their units in the headings."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(f"{c.name} [{c.about['unit']}]" if "unit" in c.about else c.name for c in columns)
    writer.writerows(map(_plain, zip(*(c.values for c in columns), strict=True)))
    return text.getvalue()


def _plain(row: Sequence[Any]) -> list[str]:
    """Return numbers with all their digits, nothing for nothing."""
    return [
        "" if x is None else repr(x) if isinstance(x, float) and math.isfinite(x) else str(x) for x in row
    ]


def _parquet(findings: Findings, columns: Sequence[Column]) -> bytes:
    import pyarrow as pa
    import pyarrow.parquet as pq

    fields = [pa.field(c.name, getattr(pa, c.kind)(), metadata=c.about or None) for c in columns]
    schema = pa.schema(fields, metadata={"experiment": _encodable(_description(findings))})
    arrays = [pa.array(map(_encodable, c.values), type=f.type) for c, f in zip(columns, fields, strict=True)]
    content = pa.BufferOutputStream()
    pq.write_table(pa.Table.from_arrays(arrays, schema=schema), content, compression="zstd")
    return content.getvalue().to_pybytes()


def _encodable(value: Any) -> Any:
    """Return a value, of a text with halves of characters written out, as `write_whole` does."""
    return value.encode("utf-8", "backslashreplace").decode() if isinstance(value, str) else value


def _description(findings: Findings) -> str:
    """Return what the experiment was, as JSON: the file's content, the FMUs with their hashes."""
    content = findings.spec.model_dump(by_alias=True, exclude_defaults=True)
    about = {"experiment": content, "fmus": dict(findings.fmus)}
    return json.dumps(about, ensure_ascii=False, default=str)
