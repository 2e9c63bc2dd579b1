"""The record of a run, run.json, read back: every part that is used is of the kind that a run writes."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from .. import checksums
from ..errors import ResultsError
from ..files import read_bytes, reading, reason
from ..wording import short
from .folder import FAILED, LARGEST, RUN_FILE, refuse_dead
from .formats import FILES
from .run_record import RunRecord


def load_record(folder: Path, *, settled: bool = False) -> dict[str, Any]:
    """Return the record of the run whose results stand in a folder.

    Args:
        folder: of the results.
        settled: read the record of earlier results though the last run has died.

    Raises:
        ResultsError: there is none, it is not what `yawbench run` writes, or the last run here has died.
    """
    if not settled:
        refuse_dead(folder)
    file = folder / RUN_FILE
    with reading("record of a run", file, ResultsError):
        try:
            run = json.loads(read_bytes(file, largest=LARGEST).decode())
        except FileNotFoundError:
            failed = f"; those of a run that failed: {folder / FAILED}" if (folder / FAILED).exists() else ""
            raise ResultsError(
                f"{folder}: no results here, {RUN_FILE} is missing; make them with "
                f"'yawbench run SCENARIO --out {folder}'{failed}."
            ) from None
        except NotADirectoryError:
            holds = f", {folder.parent}" if folder.name in (RUN_FILE, *FILES.values()) else ""
            raise ResultsError(
                f"{folder}: is a file; name the folder that holds the results{holds}."
            ) from None
        except (OSError, ValueError) as error:
            raise ResultsError(f"{file}: cannot be read: {reason(error)}") from None
        return check_record(run, file)


def warn_if_unchecked(run: Mapping[str, Any], folder: Path) -> None:
    """Tell the user of a record without checksums."""
    if not checksums.has_checksums(run):
        checksums.warn(
            f"{folder / RUN_FILE}: has no checksums, it is of an earlier version or was changed; "
            "its units and names are taken as they are"
        )


def check_record(run: Any, file: Path) -> dict[str, Any]:
    """Return the content of a record.

    Raises:
        ResultsError: it was changed, or something in it is not what a run writes.
    """
    if not isinstance(run, dict):
        raise ResultsError(f"{file}: is not the record of a run.")
    if words := checksums.changed_since(run):
        raise ResultsError(
            f"{file}: is not what its run has written: {words}; run it again, or remove "
            f"{checksums.KEY!r} if you have changed the file yourself."
        )
    try:
        RunRecord.model_validate(run)
    except ValidationError as errors:
        first, *others = errors.errors(include_url=False)
        place = ".".join(map(str, first["loc"]))
        more = f" ({len(others)} more like it)" if others else ""
        wrong = f"{place}: {first['msg'].lower().partition(' or instance')[0]} (got {short(first['input'])})"
        raise ResultsError(f"{file}: is not the record of a run: {wrong}{more}.") from None
    return run
