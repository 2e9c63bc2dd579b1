"""What commands have written, read again."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

from orchestrator.errors import ResultsError
from orchestrator.messages import counted, listed
from orchestrator.results.file_formats import RESULTS_FILE
from orchestrator.results.reader import found_runs, load_results
from orchestrator.results.run_folder import PART, RUN_FILE

from . import arguments
from ._run import Run

if TYPE_CHECKING:
    import pandas as pd

MAIN = ("table", "trials")
"""Names of a command's main table: of experiments and rankings, of tunings."""


def open(folder: str | Path) -> Run | RecordedRuns:
    """Return the run recorded in a folder, or the runs and tables that a command has written into it.

        >>> yb.open("results/mine").title
        'Sideslip tracking at 25 m/s, mu 0.65'

    Args:
        folder: of a run, or of a sweep, a study, a tuning, a ranking or an evaluation.

    Raises:
        ResultsError: there is nothing of the kind, or it is unreadable.
    """
    place = arguments.path(folder, "folder")
    if place.is_dir() and not any((place / name).exists() for name in (RUN_FILE, f"{RUN_FILE}{PART}")):
        tables = {file.stem: file for file in sorted(place.glob("*.csv")) if file.name != RESULTS_FILE}
        if tables:
            return RecordedRuns(place, tables)
        if found_runs(place):
            return RecordedRuns(place, {})
    return Run(load_results(place))


@dataclass(frozen=True, repr=False)
class RecordedRuns:
    """The runs and tables in a folder that a command has written; made by `open`.

        >>> recorded = yb.open("results")
        >>> recorded.runs["mine"].title
        'Sideslip tracking at 25 m/s, mu 0.65'

    Attributes:
        folder: the folder.
        files: name -> CSV file of each table.
    """

    __module__ = "yawbench"

    folder: Path
    files: Mapping[str, Path]

    @property
    def table(self) -> pd.DataFrame:
        """The main table: a row per run, or per controller of a ranking; `attrs["units"]` holds the units."""
        name = next((name for name in (*MAIN, *self.files) if name in self.files), None)
        if name is None:
            raise ResultsError(f"{self.folder}: holds runs, but no table", code="results-missing")
        return self.tables[name]

    @cached_property
    def tables(self) -> dict[str, pd.DataFrame]:
        """All tables by name, their columns named without units."""
        return {name: _frame(file) for name, file in self.files.items()}

    @cached_property
    def runs(self) -> dict[str, Run]:
        """All completed runs whose results are kept, by their folders within this one."""
        try:
            found = found_runs(self.folder)
        except ResultsError:  # a command may keep metrics only
            return {}
        done = [run.folder for run in found if run.status == "completed"]
        return {folder.relative_to(self.folder).as_posix(): Run(load_results(folder)) for folder in done}

    def __repr__(self) -> str:
        held = listed(list(self.files), last="and") or "no table"
        return f"<RecordedRuns in {self.folder}: {counted(len(self.files), 'table')} ({held})>"

    def _repr_html_(self) -> str:
        return str(self.table.to_html(index=False, na_rep="")) if self.files else ""


def _frame(file: Path) -> pd.DataFrame:
    """Return a table that a command has written as CSV."""
    import pandas as pd

    try:
        frame = pd.read_csv(file, float_precision="round_trip")
    except (OSError, ValueError) as error:
        raise ResultsError(f"{file}: cannot be read: {error}", code="results-unreadable") from None
    units = {}
    names = []
    for heading in frame.columns:
        name, bracket, unit = str(heading).rpartition(" [")
        names.append(name if bracket and unit.endswith("]") else str(heading))
        if bracket and unit.endswith("]"):
            units[name] = unit[:-1]
    frame.columns = pd.Index(names)
    frame.attrs["units"] = units
    return frame
