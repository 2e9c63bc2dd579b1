"""The table of a sweep: one row per run, in the order of the design; equal runs, equal bytes."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from ..errors import ResultsError
from ..metrics.run_metrics import Value, metric
from ..studies.study_schema import si_number
from ..studies.tables import si
from ..writing import reason, write_whole
from .journal import Record
from .planning import Planned, PlannedRun

TABLE = "sweep.parquet"


@dataclass(frozen=True)
class Swept:
    """A sweep whose runs are finished."""

    planned: Planned
    records: Mapping[str, Record]  # key of the run -> what became of it

    def record(self, run: PlannedRun) -> Record:
        """Return what became of a run."""
        return self.records[run.key]

    def value(self, run: PlannedRun, key: str) -> Value | None:
        """Return a metric of a run, None if the run failed or gives none."""
        found = self.record(run).values.get(key)
        return None if found is None else Value(*found)

    def unit(self, key: str) -> str:
        """Return the unit of a metric."""
        return self.planned.metric_units[key]

    def bound(self, key: str, given: float | str) -> float:
        """Return a bound of a metric in SI."""
        return si_number(given, self.unit(key))

    def light(self) -> Swept:
        """Return the sweep without the plans of its runs, to be handed to other processes."""
        runs = [replace(run, plan=None) for run in self.planned.runs]  # type: ignore[arg-type]
        return Swept(replace(self.planned, runs=runs), self.records)

    def findings(self) -> dict[str, int]:
        """Return what was remarkable in runs, by its kind, with the number of such runs."""
        return Counter(kind for run in self.planned.runs for kind in self.record(run).findings)

    @property
    def failed(self) -> list[PlannedRun]:
        """The runs that failed."""
        return [run for run in self.planned.runs if not self.record(run).ok]


def axis_unit(planned: Planned, name: str) -> str:
    """Return the unit of an axis as the file counts it, ` [km/h]`, or nothing."""
    unit = planned.sweep.spec.axes[name].unit or planned.units.get(name, "")
    return f" [{unit}]" if unit not in ("", "1") else ""


def point_text(planned: Planned, run: PlannedRun) -> str:
    """Return a run's point in words: `friction 0.3, speed 25 m/s, no control`."""
    parts = []
    for (name, axis), level in zip(planned.sweep.spec.axes.items(), run.point, strict=True):
        unit = axis_unit(planned, name).replace("[", "").replace("]", "")
        parts.append(f"{name} {level.words}{unit}" if axis.numeric else level.words)
    return ", ".join(parts)


def write_table(swept: Swept, path: Path) -> None:
    """Write the table as Parquet: run, axes, how each ended, metrics, key; units in the fields' metadata.

    Raises:
        ResultsError: it cannot be written.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    runs, spec = swept.planned.runs, swept.planned.sweep.spec
    columns: list[tuple[Any, Any]] = [
        (pa.field("run", pa.int64(), metadata={"description": "number of the run, from 1"}),
         [run.number + 1 for run in runs])
    ]  # fmt: skip
    for i, (name, axis) in enumerate(spec.axes.items()):
        about = {"description": axis.says or ", ".join(axis.places), "varies": ", ".join(axis.places)}
        if axis.numeric:
            about["unit"] = swept.planned.units[name]
            numbers = [swept.planned.number(name, run.point[i]) for run in runs]
            columns.append((pa.field(name, pa.float64(), metadata=about), numbers))
        else:
            words = [run.point[i].words for run in runs]
            columns.append((pa.field(name, pa.string(), metadata=about), words))
    ends = ["completed" if swept.record(run).ok else "failed" for run in runs]
    reasons = ["; ".join(swept.record(run).problems) or None for run in runs]
    columns += [(pa.field("status", pa.string()), ends), (pa.field("reason", pa.string()), reasons)]
    about = {"description": "what was remarkable in the run's course, by its kind"}
    kinds = [", ".join(swept.record(run).findings) or None for run in runs]
    columns.append((pa.field("findings", pa.string(), metadata=about), kinds))
    for key, one in spec.metrics.items():
        chosen = metric(one.metric)
        about = {"metric": chosen.name, "description": chosen.definition, "unit": si(swept.unit(key))}
        values = [swept.value(run, key) for run in runs]
        numbers_or_none = [None if value is None else value.number for value in values]
        columns.append((pa.field(key, pa.float64(), metadata=about), numbers_or_none))
    columns.append((pa.field("key", pa.string()), [run.key for run in runs]))
    schema = pa.schema([field for field, _ in columns], metadata={"sweep": _description(swept)})
    arrays = [pa.array(values, type=field.type) for field, values in columns]
    content = pa.BufferOutputStream()
    pq.write_table(pa.Table.from_arrays(arrays, schema=schema), content, compression="zstd")
    try:
        write_whole(path, content.getvalue().to_pybytes())
    except OSError as error:
        raise ResultsError(f"{path}: cannot be written: {reason(error)}.") from None


def _description(swept: Swept) -> str:
    """Return what the sweep was, as JSON: the file's content, the FMUs with their hashes."""
    spec = swept.planned.sweep.spec
    content = spec.model_dump(by_alias=True, exclude_defaults=True)
    fmus = {fmu.name: digest for digest, fmu in swept.planned.fmus.items()}
    return json.dumps({"sweep": content, "fmus": dict(sorted(fmus.items()))}, ensure_ascii=False, default=str)
