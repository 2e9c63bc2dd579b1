"""The record of a run, run.json, read back: every part that is used is of the kind that a run writes."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field, NonNegativeInt, ValidationError

from ..errors import ResultsError
from ..files import read_bytes, reading, reason
from ..wording import short
from .folder import FAILED, LARGEST, RUN_FILE, refuse_dead
from .formats import FILES

NotFinite = Literal["nan", "inf", "-inf"]
"""How a record holds what JSON cannot."""


class _Part(BaseModel):
    model_config = ConfigDict(strict=True, extra="allow")


class _Fmu(_Part):
    name: str = ""
    sha256: str = ""
    parameters: dict[str, Any] = {}
    constants: dict[str, Any] = {}
    defaults: dict[str, Any] = {}


class _Change(_Part):
    place: str
    value: Any


class _Error(_Part):
    message: str = ""


class _Finding(_Part):
    kind: str
    place: str | None = None
    value: float | None = None
    time: float | None = None
    says: str = ""


class _Fault(_Part):
    on: str
    fault: str
    begin: float | None = Field(None, alias="from")
    until: float | None = None


class _Record(_Part):
    """What others rely on; all of it may be missing."""

    id: str | None = None
    status: str = ""
    error: _Error | None = None
    title: str | None = None
    started: str | None = None
    wall_time: float = 0.0
    rows: NonNegativeInt = 0
    algorithm: str = ""
    step_size: float = 0.0
    stop_time: float = 0.0
    results: str = ""
    checksum: str = ""
    texts: list[str] | None = None
    evaluation_order: list[str] = []
    units: dict[str, str | None] = {}
    fmus: dict[str, _Fmu] = {}
    changes: list[_Change] = []
    findings: list[_Finding] = []
    faults: list[_Fault] = []
    connections: list[dict[str, Any]] = []
    scenario: dict[str, Any] = {}
    versions: dict[str, str] = {}
    warnings: list[dict[str, Any]] = []
    smallest: dict[str, float | NotFinite] = {}
    largest: dict[str, float | NotFinite] = {}


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


def check_record(run: Any, file: Path) -> dict[str, Any]:
    """Return the content of a record.

    Raises:
        ResultsError: something in it is not what a run writes.
    """
    if not isinstance(run, dict):
        raise ResultsError(f"{file}: is not the record of a run.")
    try:
        _Record.model_validate(run)
    except ValidationError as errors:
        first, *others = errors.errors(include_url=False)
        place = ".".join(map(str, first["loc"]))
        more = f" ({len(others)} more like it)" if others else ""
        wrong = f"{place}: {first['msg'].lower().partition(' or instance')[0]} (got {short(first['input'])})"
        raise ResultsError(f"{file}: is not the record of a run: {wrong}{more}.") from None
    return run
