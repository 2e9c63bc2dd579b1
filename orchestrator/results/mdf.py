"""Results as ASAM MDF 4, the format of measurement tools: one channel group, units in its channels."""

from __future__ import annotations

import io
from datetime import datetime
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from ..errors import ResultsError
from ..titles import changes_in, with_changes
from .columnar import ColumnRecorder, plain
from .formats import FILES, Table


def asammdf() -> ModuleType:
    """Return the package that reads and writes MDF.

    Raises:
        ResultsError: it is not installed.
    """
    try:
        import asammdf
    except ImportError:
        raise ResultsError(
            "results as ASAM MDF need the package asammdf: pip install 'yawbench[mdf]'"
        ) from None
    return asammdf


class MdfRecorder(ColumnRecorder):
    """The results of one run as MDF 4. All rows are in memory until the run has ended."""

    file = FILES["mf4"]

    def _complete(self, run: dict[str, Any]) -> None:
        package = asammdf()
        time, *columns = self._columns.arrays()
        signals = [
            package.Signal(
                _samples(array), time, name=name, unit=self.units.get(name) or "", encoding="utf-8"
            )
            for name, array in zip(self.columns, columns, strict=True)
        ]
        with package.MDF(version="4.10") as mdf:
            if run.get("started"):
                mdf.header.start_time = datetime.fromisoformat(run["started"])
            mdf.append(
                signals,
                comment=with_changes(str(run.get("title") or ""), changes_in(run)),
                common_timebase=True,
            )
            data = io.BytesIO()
            mdf.save(data, compression=2)  # transposed before it is deflated: columns change slowly
        self._append(data.getvalue())


def _samples(array: np.ndarray) -> np.ndarray:
    if array.dtype.kind == "O":
        return np.array([str(value).encode() for value in array])
    return array.astype(np.uint8) if array.dtype == bool else array


def read_mdf(path: Path) -> Table:
    """Return the columns of an MDF file of one channel group.

    Raises:
        OSError, ValueError: it cannot be read.
        ResultsError: asammdf is not installed.
    """
    package = asammdf()
    if not path.exists():
        raise FileNotFoundError(path)
    try:
        with package.MDF(path) as mdf:
            channels = [channel.name for channel in mdf.groups[0].channels]
            table = {"time": plain(mdf.get_master(0))}
            for index, name in enumerate(channels):
                if index != mdf.masters_db.get(0):
                    samples = mdf.get(group=0, index=index).samples
                    table[name] = plain(_decoded(samples))
    except (OSError, ValueError):
        raise
    except Exception as error:  # asammdf raises MdfException and whatever its parsing meets
        raise ValueError(" ".join(str(error).split()) or type(error).__name__) from None
    return table


def _decoded(samples: np.ndarray) -> np.ndarray:
    return np.char.decode(samples, "utf-8") if samples.dtype.kind == "S" else samples
