"""Runs as tables: CSV, Apache Parquet, ASAM MDF 4 and MATLAB files.

CSV and Parquet have a row per run and instant; `run` is the label. CSV names units in its header,
`plant.yaw_rate [rad/s]`, Parquet in the metadata of fields. MDF has a group of channels per run. A MATLAB
file has a structure per run: `r.plant.yaw_rate`, with units in `r.units.plant.yaw_rate`. What a run has not
recorded is missing there.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from datetime import datetime
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from yawbench.foundation.errors import ResultsError
from yawbench.foundation.safe_files import write_whole
from yawbench.orchestrator.results.file_formats import column_of
from yawbench.orchestrator.results.parquet import UNIT

from .formats import ExportedRun

LONGEST = 63
"""Characters of a name in MATLAB."""


def write_csv(runs: Sequence[ExportedRun], file: Path) -> list[Path]:
    """Write a row per run and instant, with units in the header."""
    from pyarrow import BufferOutputStream, csv

    table, units = _table(runs)
    named = [f"{name} [{unit}]" if unit else name for name, unit in units.items()]
    sink = BufferOutputStream()
    csv.write_csv(table.rename_columns(named), sink)
    write_whole(file, sink.getvalue().to_pybytes(), named=True)
    return []


def write_parquet(runs: Sequence[ExportedRun], file: Path) -> list[Path]:
    """Write a row per run and instant, with units in the metadata of fields."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    table, units = _table(runs)
    fields = [one.with_metadata({UNIT: units[one.name]}) if units[one.name] else one for one in table.schema]
    sink = pa.BufferOutputStream()
    pq.write_table(table.cast(pa.schema(fields)), sink, compression="zstd")
    write_whole(file, sink.getvalue().to_pybytes(), named=True)
    return []


def _table(runs: Sequence[ExportedRun]) -> tuple[Any, dict[str, str]]:
    """Return the rows of all runs, and the unit of each column, "" if it has none."""
    import pyarrow as pa

    units: dict[str, str] = {}
    for run in runs:
        for name in run.signals:
            units.setdefault(name, run.unit_of(name))
    parts = []
    for run in runs:
        rows, signals = run.results.time.size, run.signals
        columns = {"run": pa.array([run.label] * rows), "time": column_of(run.results.time)}
        columns |= {
            name: column_of(signals[name]) if name in signals else pa.nulls(rows, pa.float64())
            for name in units
        }
        parts.append(pa.table(columns))
    return pa.concat_tables(parts), {"run": "", "time": "s", **units}


def write_mdf(runs: Sequence[ExportedRun], file: Path) -> list[Path]:
    """Write a group of channels per run, named by its label.

    Data are not compressed: programs that read one channel after the other, as most do, would decompress the
    whole group for each, 3.4 s for the 95 channels of a run of 6.5 s where it takes 0.2 s now.
    """
    from asammdf import MDF, Signal

    with MDF(version="4.10") as mdf:
        if started := runs[0].results.record.started:
            mdf.header.start_time = datetime.fromisoformat(started)
        for run in runs:
            signals = [
                Signal(_samples(array), run.results.time, name=name, unit=run.unit_of(name), encoding="utf-8")
                for name, array in run.results.columns.items()
            ]
            mdf.append(signals, acq_name=run.label, comment=run.title, common_timebase=True)
        data = BytesIO()
        mdf.save(data, compression=0)
    write_whole(file, data.getvalue(), named=True)
    return []


def _samples(array: np.ndarray) -> np.ndarray:
    if array.dtype.kind in "OU":
        return np.array([str(value).encode() for value in array])
    return array


def write_mat(runs: Sequence[ExportedRun], file: Path) -> list[Path]:
    """Write a structure per run: time, and a structure per instance; the same with units.

    Raises:
        ResultsError: the file would be too large for MATLAB 5.
    """
    from scipy.io import savemat
    from scipy.io.matlab import MatWriteError

    content: dict[str, Any] = {}
    for run in runs:
        one: dict[str, Any] = {"title": run.title, "label": run.label, "time": run.results.time[:, None]}
        units: dict[str, Any] = {"time": "s"}
        for column, values in run.signals.items():
            instance, _, variable = column.partition(".")
            inner = _identifier(variable, one.get(_identifier(instance), {}))
            one.setdefault(_identifier(instance), {})[inner] = values[:, None]
            units.setdefault(_identifier(instance), {})[inner] = run.unit_of(column) or "1"
        content[_identifier(run.label, content)] = {**one, "units": units}
    data = BytesIO()
    try:
        savemat(data, content, long_field_names=True, do_compression=True)
    except (MatWriteError, OverflowError):
        raise ResultsError(
            f"{file}: a MATLAB file holds 2 GB a variable at most; record less, or take --to parquet",
            code="results-unwritable",
        ) from None
    write_whole(file, data.getvalue(), named=True)
    return []


def _identifier(name: str, taken: Any = ()) -> str:
    """Return a name as MATLAB allows it, unlike those taken: letters, digits and _, a letter first."""
    text = re.sub(r"[^A-Za-z0-9_]", "_", name)
    text = (text if text[:1].isalpha() else f"r_{text}")[: LONGEST - 4]
    number = 2
    while (numbered := text if number == 2 else f"{text}_{number}") in taken or numbered == "units":
        number += 1
    return numbered
