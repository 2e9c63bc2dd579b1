"""Salvage of runs whose process died: their complete rows become results."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

from yawbench.foundation.errors import ResultsError
from yawbench.foundation.safe_files import open_own, reason, write_whole

from .file_formats import FILES, RESULTS_FILE, CsvFile
from .folder_lock import FolderLock
from .run_folder import PART, is_dead, is_final, is_regular, put_in_place, tidy, unfinished
from .run_record import RUN_FILE, ErrorRecord, RunRecord, RunStatus

WHY = "the process of this run ended abnormally"


def salvage(folder: Path) -> tuple[Path, int]:
    """Turn the rows that a dead run recorded into results: a final record and a file of complete rows.

    They are treated like those of a failed run. Formats other than CSV cannot be read in part: such files are
    removed, and the folder is as it was before the run. If the run had ended and only its files had not been
    renamed yet, everything is kept, in any format.

    Returns:
        The folder of the results, and the number of rows.

    Raises:
        ResultsError: no run has died here, or its results cannot be read or written.
    """
    if not is_dead(folder):
        raise ResultsError(
            f"{folder}: no run has died here; there is nothing to salvage", code="nothing-to-salvage"
        )
    path = folder / f"{RESULTS_FILE}{PART}"
    lock = FolderLock(folder)
    try:
        record = unfinished(folder) or RunRecord()
        if is_final(folder):
            return put_in_place(folder), record.rows
        rows = _keep_whole_rows(path, record.texts) if is_regular(path) else 0
        if rows:
            record.status, record.error = RunStatus.DIED, ErrorRecord(message=WHY, instance=None)
            record.rows, record.size, record.results = rows, path.stat().st_size, RESULTS_FILE
            write_whole(folder / f"{RUN_FILE}{PART}", record.to_json())
            return put_in_place(folder), rows
        tidy(folder)
        return folder, 0
    except OSError as error:
        raise ResultsError(
            f"{folder}: the remaining files cannot be renamed: {reason(error)}.", code="results-unwritable"
        ) from None
    except ValueError as error:
        raise ResultsError(f"{path}: cannot be read: {error}") from None
    finally:
        lock.release()


def _keep_whole_rows(path: Path, texts: Sequence[str]) -> int:
    """Truncate the file after the last complete row; return the number of rows."""
    end = 0
    with os.fdopen(open_own(path, os.O_RDWR), "r+b") as stream:
        position = 0
        while block := stream.read(1 << 20):
            if b"\n" in block:
                end = position + block.rfind(b"\n") + 1
            position += len(block)
        stream.truncate(end)
    return sum(len(time) for (time,) in CsvFile(path, texts).blocks(["time"])) if end else 0


def lost_format(folder: Path) -> str | None:
    """Return the file that a dead run was writing in a format other than CSV, which is lost; else None."""
    others = (name for name in FILES.values() if name != RESULTS_FILE)
    return next((name for name in others if is_regular(folder / f"{name}{PART}")), None)
