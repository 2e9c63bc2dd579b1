"""The formats of recorded results: what each one's file is called, who writes and who reads it."""

from __future__ import annotations

import importlib
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

import numpy as np

from ..errors import ScenarioError
from ..wording import hint
from .folder import FILES

if TYPE_CHECKING:
    from .recorder import Recorder

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


def source_of(path: Path, texts: Sequence[str] | None = None) -> Source:
    """Return a file of results, to be read.

    Args:
        path: of the file; its name says the format.
        texts: columns that hold text, if the file itself does not say; None: they look like it.

    Raises:
        OSError, ValueError: it is not what a run writes.
        ResultsError: a package that the format needs is missing.
    """
    if path.name == FILES["csv"]:
        from .csv_file import CsvFile

        return CsvFile(path, texts)
    if path.name == FILES["parquet"]:
        from .parquet import ParquetFile

        return ParquetFile(path)
    from .mdf import MdfFile

    return MdfFile(path)


class Source(Protocol):
    """A file of results that is read in blocks of rows.

    Its methods raise OSError or ValueError if the file is not what a run writes.
    """

    names: list[str]
    """Of all columns, `time` first."""

    def blocks(self, columns: Sequence[str]) -> Iterator[list[np.ndarray]]:
        """Yield some rows after the other of chosen columns: float64, or text."""
