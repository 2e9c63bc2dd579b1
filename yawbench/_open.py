"""Reader of the folders that commands write."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from yawbench.foundation.errors import ResultsError
from yawbench.foundation.messages import counted, listed
from yawbench.orchestrator.results.file_formats import RESULTS_FILE
from yawbench.orchestrator.results.reader import found_runs, load_results
from yawbench.orchestrator.results.run_folder import PART
from yawbench.orchestrator.results.run_record import RUN_FILE, RunStatus
from yawbench.orchestrator.scenario.catalogue import YAML

from . import arguments
from ._dataset import dataset
from ._run import Run, drawn, measured

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr
    from matplotlib.figure import Figure

EVALUATED = "evaluation"
"""Name of file and table of an evaluation."""

MAIN = ("trials", "table", EVALUATED)
"""Names of a command's main table: of tunings, of experiments and rankings, of evaluations."""
STATUS = "status"
"""Column of an experiment's table that follows the run and the axes."""


def open(folder: str | Path) -> Run | RecordedRuns:
    """Return the run recorded in a folder, or the runs and tables that a command has written into it.

        >>> yb.open("results/mine").title
        'Sideslip tracking at 25 m/s, mu 0.65'

    Args:
        folder: folder of a run, sweep, study, tuning, ranking or evaluation; or a measurement file.

    Raises:
        ResultsError: there are no such results, or they are unreadable.
        ScenarioError: the measurement file, or a recording that it names, cannot be used.
    """
    place = arguments.path(folder, "folder")
    if place.suffix in YAML and place.is_file():
        return measured(place)
    if place.is_dir() and not any((place / name).exists() for name in (RUN_FILE, f"{RUN_FILE}{PART}")):
        tables = {file.stem: file for file in sorted(place.glob("*.csv")) if file.name != RESULTS_FILE}
        if (evaluated := place / f"{EVALUATED}.json").is_file():
            tables[EVALUATED] = evaluated
        if tables:
            return RecordedRuns(place, tables)
        if found_runs(place):
            return RecordedRuns(place, {})
    return Run(load_results(place))


@dataclass(frozen=True, repr=False)
class RecordedRuns:
    """Runs and tables in a folder written by a command; created by `open`.

        >>> recorded = yb.open("results")
        >>> recorded.runs["mine"].title
        'Sideslip tracking at 25 m/s, mu 0.65'

    Attributes:
        folder: the folder.
        files: name -> file of each table.
    """

    folder: Path
    files: Mapping[str, Path]

    @property
    def table(self) -> pd.DataFrame:
        """The main table, whose `attrs["units"]` holds the units.

        A row is a run, a trial of a tuning, a controller of a ranking, or an evaluated run.
        """
        name = next((name for name in (*MAIN, *self.files) if name in self.files), None)
        if name is None:
            raise ResultsError(f"{self.folder}: holds runs, but no table", code="results-missing")
        return self.tables[name]

    @cached_property
    def tables(self) -> dict[str, pd.DataFrame]:
        """All tables by name, their columns named without units."""
        return {
            name: _evaluated(file) if file.suffix == ".json" else _frame(file)
            for name, file in self.files.items()
        }

    @cached_property
    def runs(self) -> dict[str, Run]:
        """All completed runs whose results are kept, by their relative folders."""
        try:
            runs = found_runs(self.folder)
        except ResultsError:  # a command may keep only metrics
            return {}
        done = [run.folder for run in runs if run.status is RunStatus.COMPLETED]
        return {folder.relative_to(self.folder).as_posix(): Run(load_results(folder)) for folder in done}

    def to_xarray(self) -> xr.Dataset:
        """Return all columns of all runs over the axes, or the names of the runs, and time.

        Each has its unit in `attrs["units"]`. Missing values are NaN.

        Raises:
            ResultsError: it is not the folder of an experiment, no results were kept, or the times of runs
                differ.
        """
        table = self.tables.get("table")
        if table is None or not {STATUS, "key", "run"} <= set(table.columns):
            raise ResultsError(f"{self.folder}: holds no table of runs", code="results-missing")
        axes = list(table.columns[: list(table.columns).index(STATUS)])
        if len(axes) > 1 and not table.duplicated(axes[1:]).any():
            del axes[0]  # the number or the name of the run
        names = zip(table["key"], table["run"], strict=True)
        runs = [self.runs.get(f"runs/{key[:12]}") or self.runs.get(str(name)) for key, name in names]
        return dataset(self.folder.name, table, axes, runs)

    def plot(self, *panels: str, title: str | None = None) -> Figure:
        """Return a figure of all runs, as `yawbench plot` draws them.

            >>> yb.open("results").plot("sideslip").savefig("runs.svg")

        Args:
            panels, title: as in `Run.plot`.

        Raises:
            ScenarioError: a signal was not recorded.
            ResultsError: no results were kept, or no recorded signal can be drawn.
        """
        if not self.runs:
            raise ResultsError(f"{self.folder}: no results were kept", code="results-missing")
        runs = {name: run.results for name, run in self.runs.items()}
        return drawn(runs, panels, self.folder.name if title is None else title)

    def __repr__(self) -> str:
        held = listed(list(self.files), last="and") or "no table"
        return f"<RecordedRuns in {self.folder}: {counted(len(self.files), 'table')} ({held})>"

    def _repr_html_(self) -> str:
        return str(self.table.to_html(index=False, na_rep="")) if self.files else ""


def _frame(file: Path) -> pd.DataFrame:
    """Return a CSV table written by a command."""
    import pandas as pd
    import pyarrow as pa
    from pyarrow import csv

    try:
        frame = csv.read_csv(file, convert_options=csv.ConvertOptions(strings_can_be_null=True)).to_pandas()
    except (OSError, pa.ArrowException) as error:
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


def _evaluated(file: Path) -> pd.DataFrame:
    """Return the table of an evaluation: a row per run with verdicts of the criteria, and quantities."""
    import pandas as pd

    try:
        runs = json.loads(file.read_bytes())["runs"]
        rows: list[dict[str, Any]] = []
        units: dict[str, str] = {}
        for run in runs:
            row = {"label": run["label"], "verdict": run["verdict"]}
            row |= {name: verdict["verdict"] for name, verdict in run["criteria"].items()}
            row |= {name: quantity["value"] for name, quantity in run["quantities"].items()}
            units |= {name: quantity["unit"] for name, quantity in run["quantities"].items()}
            rows.append(row)
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise ResultsError(f"{file}: cannot be read: {error!r}", code="results-unreadable") from None
    frame = pd.DataFrame(rows)
    frame.attrs["units"] = units
    return frame
