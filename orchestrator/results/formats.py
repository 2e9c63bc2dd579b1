"""File formats of recorded results: file names, recorders, readers, and the expected size of results."""

from __future__ import annotations

import importlib
import math
import pkgutil
import shutil
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any, Protocol

from ..errors import ResultsError, ScenarioError
from ..messages import hint

if TYPE_CHECKING:
    import numpy as np

    from ..plan import Plan
    from .recorder import Recorder

RESULTS_FILE = "results.csv"


@dataclass(frozen=True)
class Format:
    """A file format of results."""

    file: str
    says: str
    recorder: str  # "module:class" in this package that writes it, a subclass of `Recorder`
    source: str  # "module:class" that reads it, called with its path and the columns that hold text
    bytes: int  # per value; measured on one run of each of the papers A to D, rounded
    package: str = ""  # Python package that it needs besides those of yawbench
    extra: str = ""  # of yawbench, with which that package is installed

    def require(self) -> ModuleType | None:
        """Import and return the package that it needs.

        Raises:
            ResultsError: it is not installed.
        """
        try:
            return importlib.import_module(self.package) if self.package else None
        except ImportError:
            how = f"pip install 'yawbench[{self.extra}]'"
            raise ResultsError(
                f"results as {self.says} need the package {self.package}: {how}", code="package-missing"
            ) from None


FORMATS = {
    "csv": Format(
        RESULTS_FILE, "text that every program reads", "recorder:Recorder", "csv_file:CsvFile", bytes=17
    ),
    "parquet": Format(
        "results.parquet", "Apache Parquet",
        "parquet_and_mdf:ParquetRecorder", "parquet_and_mdf:ParquetFile", bytes=7,
    ),
    "mf4": Format(
        "results.mf4", "ASAM MDF", "parquet_and_mdf:MdfRecorder", "parquet_and_mdf:MdfFile", bytes=5,
        package="asammdf", extra="mdf",
    ),
}  # fmt: skip
"""Format name -> format. CSV is the default: every program reads it, and killed runs can be salvaged."""
FILES = {name: one.file for name, one in FORMATS.items()}
"""Format name -> file name."""


def check_format(name: str) -> str:
    """Return the name of a format if it can be used.

    Raises:
        ScenarioError: the format does not exist, or a package that it needs is missing.
    """
    if name not in FORMATS:
        raise ScenarioError(
            f"--format {name}: no such format{hint(name, FORMATS, lead='there are')}", code="format-unknown"
        )
    FORMATS[name].require()
    return name


def recorder_of(name: str) -> type[Recorder]:
    """Return the recorder class of a format, a subclass of `Recorder`."""
    recorder: type[Recorder] = _class(FORMATS[check_format(name)].recorder)
    return recorder


def source_of(path: Path, texts: Sequence[str] | None = None) -> ResultsSource:
    """Open a results file for reading.

    Args:
        path: path of the file; its name determines the format.
        texts: columns that hold text, for formats that do not record it; None: guess from the first row.

    Raises:
        OSError, ValueError: it is not a file that a run writes.
        ResultsError: a package that the format needs is missing.
    """
    (source,) = (one.source for one in FORMATS.values() if one.file == path.name)
    opened: ResultsSource = _class(source)(path, texts)
    return opened


def _class(place: str) -> Any:
    return pkgutil.resolve_name(f"{__package__}.{place}")


class ResultsSource(Protocol):
    """A results file that is read in blocks of rows.

    Its methods raise OSError or ValueError if the file is not one that a run writes.
    """

    names: list[str]
    """Names of all columns, `time` first."""

    def blocks(self, columns: Sequence[str]) -> Iterator[list[np.ndarray]]:
        """Yield the chosen columns, a block of rows at a time, each passed through `plain`."""


def plain(array: np.ndarray) -> np.ndarray:
    """Return a column in the type that `Results` uses: float64, or text."""
    return array.astype(str) if array.dtype.kind in "OSU" else array.astype(float, copy=False)


HUGE = 2e9
"""Size of results above which a run warns before it starts [bytes]. Chosen: takes a minute to read."""


def expected_size(plan: Plan, format: str) -> int:
    """Return the approximate size in bytes of the results of a run in a format."""
    return (plan.n_steps + 1) * (len(plan.record) + 1) * FORMATS[format].bytes


def size_note(plan: Plan, folder: Path, format: str) -> str | None:
    """Return a warning if the results will be huge or will not fit on the disk of `folder`, else None."""
    size, free = expected_size(plan, format), _free(folder)
    if size < HUGE and size <= free:
        return None
    note = (
        f"{folder / FORMATS[format].file} will take about {_shown(size)} "
        f"({plan.n_steps + 1} rows of {len(plan.record)} variables)"
    )
    if size > free:
        note += f", and {_shown(free)} are free there"
    shorter = "name the variables that you need under 'record:' in the scenario"
    if format == "csv":
        return f"{note}; {shorter}, or take --format parquet ({_shown(expected_size(plan, 'parquet'))})"
    return f"{note}; {shorter}"


def _free(folder: Path) -> float:
    """Return the free bytes of the disk that a folder is, or will be, on."""
    absolute = folder.absolute()
    try:
        return shutil.disk_usage(
            next(place for place in (absolute, *absolute.parents) if place.exists())
        ).free
    except OSError:
        return math.inf


def _shown(size: float) -> str:
    return f"{size / 1e9:.1f} GB" if size >= 1e9 else f"{size / 1e6:.0f} MB"
