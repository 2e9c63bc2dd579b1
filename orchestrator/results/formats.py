"""The formats of recorded results: what each one's file is called, who writes and who reads it."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..errors import ScenarioError
from ..wording import hint

if TYPE_CHECKING:
    from .recorder import Recorder

RESULTS_FILE = "results.csv"
RUN_FILE = "run.json"

FILES = {"csv": RESULTS_FILE, "parquet": "results.parquet", "mf4": "results.mf4"}
"""Format -> name of its file. CSV is the default: every program reads it, and it survives a kill."""

PART = ".part"
"""What the names of a run's files end in while it goes on."""

Table = dict[str, np.ndarray]
"""Column, `time` first -> its values: float64, or text."""

_RECORDERS = {"csv": "recorder.Recorder", "parquet": "parquet.ParquetRecorder", "mf4": "mdf.MdfRecorder"}


def check_format(name: str) -> str:
    """Return the name of a format, or raise.

    Raises:
        ScenarioError: there is no such format, or a package that it needs is missing.
    """
    if name not in FILES:
        raise ScenarioError(f"--format {name}: no such format{hint(name, FILES, lead='there are')}")
    if name == "mf4":
        from .mdf import asammdf

        asammdf()
    return name


def recorder_of(name: str) -> type[Recorder]:
    """Return what writes a format: a subclass of `Recorder`."""
    module, _, kind = _RECORDERS[check_format(name)].partition(".")
    return getattr(importlib.import_module(f".{module}", __package__), kind)


def reader_of(file: str) -> Callable[[Path], Table] | None:
    """Return what reads a file of results by its name, None if no format's file is called so.

    A reader raises OSError or ValueError if the file is not what a run writes.
    """
    if file == RESULTS_FILE:
        from .read import read_csv

        return read_csv
    if file == FILES["parquet"]:
        from .parquet import read_parquet

        return read_parquet
    if file == FILES["mf4"]:
        from .mdf import read_mdf

        return read_mdf
    return None
