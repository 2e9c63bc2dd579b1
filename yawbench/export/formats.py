"""The formats of exported runs, and what each gets: the runs with their scenes, events and answers."""

from __future__ import annotations

import importlib
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from pkgutil import resolve_name

import numpy as np

from yawbench.events.kinds import events_in
from yawbench.events.why import why
from yawbench.foundation.errors import ResultsError, ScenarioError
from yawbench.foundation.messages import hint
from yawbench.orchestrator.results.reader import Results
from yawbench.orchestrator.results.run_record import EventRecord
from yawbench.orchestrator.scenario.overrides import with_changes
from yawbench.scene.scene import Scene, scene_of


@dataclass(frozen=True)
class Format:
    """A format of exported runs: the ending of its file, and what is needed to write it."""

    ending: str
    says: str
    writer: str  # "module:function" in this package, of the runs and the file
    packages: tuple[str, ...] = ()  # besides those of yawbench
    extra: str = ""  # of yawbench, with which they are installed

    def require(self) -> None:
        """Import the packages that it needs.

        Raises:
            ResultsError: one is not installed.
        """
        try:
            for package in self.packages:
                importlib.import_module(package)
        except ImportError as missing:
            how = f"pip install 'yawbench[{self.extra}]'"
            raise ResultsError(
                f"{self.says} needs the package {missing.name}: {how}", code="package-missing"
            ) from None


FORMATS = {
    "rerun": Format(".rrd", "a recording of Rerun", "rerun_file:write", ("rerun",), "rerun"),
    "mcap": Format(
        ".mcap", "MCAP", "mcap_file:write", ("mcap", "mcap_protobuf", "foxglove_schemas_protobuf"), "mcap"
    ),
    "mdf": Format(".mf4", "ASAM MDF", "tables:write_mdf", ("asammdf",), "mdf"),
    "parquet": Format(".parquet", "Apache Parquet", "tables:write_parquet"),
    "csv": Format(".csv", "CSV", "tables:write_csv"),
    "mat": Format(".mat", "a MATLAB file", "tables:write_mat"),
}
"""Name of a format, as for `--to`, -> format."""


def format_of(name: str) -> Format:
    """Return a format that can be written.

    Raises:
        ScenarioError: there is no such format.
        ResultsError: a package that it needs is missing.
    """
    if name not in FORMATS:
        raise ScenarioError(
            f"--to {name}: no such format{hint(name, FORMATS, lead='there are')}", code="format-unknown"
        )
    FORMATS[name].require()
    return FORMATS[name]


@dataclass(frozen=True)
class ExportedRun:
    """A run for other programs."""

    label: str
    results: Results

    @property
    def title(self) -> str:
        """Its title with the overrides."""
        return with_changes(self.results.record.title or "", self.results.record.overrides)

    @cached_property
    def events(self) -> Sequence[EventRecord]:
        """Its events, in the order of their begin."""
        return events_in(self.results)

    @cached_property
    def scene(self) -> Scene | None:
        """The run in space; None if position or yaw angle were not recorded."""
        try:
            return scene_of(self.results, self.events)
        except ResultsError:
            return None

    @cached_property
    def signals(self) -> dict[str, np.ndarray]:
        """The recorded columns of numbers, in the order of their recording."""
        return {
            name: np.asarray(values, float)
            for name, values in self.results.columns.items()
            if values.dtype.kind in "fbiu"
        }

    def unit_of(self, column: str) -> str:
        """Return the unit of a column, "" if it has none."""
        return self.results.units.get(column) or ""

    @property
    def reasons(self) -> list[str]:
        """Why the car was lost, in sentences; empty if it was not."""
        return [str(reason) for reason in why(self.events)]


def write(runs: Sequence[ExportedRun], file: Path, format: Format) -> list[Path]:
    """Write runs to a file of a format, and return the files that were written.

    Raises:
        ResultsError: a file cannot be written, or has no place for what was recorded.
    """
    writer = resolve_name(f"{__package__}.{format.writer}")
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        return [file, *writer(runs, file)]
    except OSError as error:
        raise ResultsError(
            f"{file}: cannot be written: {error.strerror or error}", code="results-unwritable"
        ) from None
