"""The run record, run.json: everything needed to repeat a run and to judge it.

`RunRecord` is its only definition: a run fills and writes it, and what is read back is validated against it.
"""

from __future__ import annotations

import contextlib
import json
import math
from collections.abc import Mapping
from enum import Enum
from pathlib import Path
from typing import Annotated, Any, Literal, cast

from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    NonNegativeInt,
    PlainSerializer,
    PlainValidator,
    ValidationError,
)
from pydantic_core import PydanticKnownError
from typing_extensions import TypedDict

from yawbench.foundation.errors import Diagnostic, ResultsError, warnings_in
from yawbench.foundation.messages import short
from yawbench.vocabulary.roles import role_of

from ..plan import NEUTRAL, Override, OverrideOrigin, SourceKind, ValueSource
from ..signal_names import SignalName
from .file_formats import RESULTS_FILE

RUN_FILE = "run.json"
LARGEST = 100_000_000
"""Largest size of a record [bytes]. Chosen: a thousand times that of ours."""


class RunStatus(str, Enum):
    """Status of a run, as its record has it."""

    UNKNOWN = ""  # the record has none that is known
    PLANNED = "planned"
    RUNNING = "running"
    COMPLETED = "completed"
    FAILED = "failed"
    INTERRUPTED = "interrupted"
    DIED = "died"  # the process ended without a word; its results may be salvaged
    UNREADABLE = "unreadable"  # the record cannot be read or has been changed

    @classmethod
    def _missing_(cls, value: object) -> RunStatus:
        return cls.UNKNOWN

    @property
    def final(self) -> bool:
        """Whether a run has ended with it."""
        return self in (RunStatus.COMPLETED, RunStatus.FAILED, RunStatus.INTERRUPTED, RunStatus.DIED)


RecordedDiagnostic = Annotated[Diagnostic, PlainSerializer(Diagnostic.record)]


class _Part(BaseModel):
    """Base of the parts of a record. Any field may be missing, and earlier versions may have written more.

    Only fields that are set are written, in the order of their definition.
    """

    model_config = ConfigDict(strict=True, extra="allow", populate_by_name=True)


class SeriesRecord(_Part):
    """The file and column that a time-series input comes from."""

    file: str = ""
    column: str = ""
    interpolation: str = ""
    sha256: str = ""


class SourceRecord(_Part):
    """The source of a value: its kind, the source in words, and the file and line that give the value."""

    kind: str = NEUTRAL  # see `plan.ValueSource`
    says: str = ""
    file: str = ""
    line: int = 0


class FmuRecord(_Part):
    """An FMU with the values that its instance had in the run."""

    name: str = ""
    role: str | None = None  # of the instance; earlier versions did not write it
    file: str = ""
    sha256: str = ""
    guid: str | None = None
    generation_tool: str | None = None
    fmi_version: str = ""
    built: dict[str, Any] | None = None
    runs_as: str | None = None  # see `fmu.archive.runs_as`
    step_size: float | None = None
    tolerance: float | None = None
    parameters: dict[str, Any] = {}
    origins: dict[str, str] = {}  # of the values that are not the FMU's
    sources: dict[str, NonNegativeInt] = {}  # of the same: index into `RunRecord.sources`
    defaults: dict[str, Any] = {}  # the FMU's values of parameters that the run does not set
    constants: dict[str, Any] = {}
    series: dict[str, SeriesRecord] = {}

    def role_as(self, instance: str) -> str:
        """The role of the instance of that name."""
        return self.role or role_of(instance, self.name)


class ErrorRecord(_Part):
    """Failure of a run."""

    message: str = ""
    instance: str | None = Field(None, validation_alias="unit", serialization_alias="unit")
    time: float | None = None
    inputs: dict[str, Any] = {}
    traceback: list[str] = []


class EndRecord(_Part):
    """Early end of a run: the instance that ended it, the time [s] and its reason."""

    instance: str | None = Field(None, validation_alias="unit", serialization_alias="unit")
    time: float | None = None
    message: str = ""


def _signal(value: object) -> SignalName:
    if isinstance(value, SignalName):
        return value
    if not isinstance(value, str):
        raise PydanticKnownError("string_type")
    return SignalName.parse(value)


RecordedName = Annotated[SignalName, PlainValidator(_signal), PlainSerializer(str)]


class ConnectionRecord(_Part):
    """A wire; `gain`, `offset` and the resulting unit only if it converts, `delay` only if it has one."""

    source: RecordedName = Field(SignalName("", ""), validation_alias="from", serialization_alias="from")
    target: RecordedName = Field(SignalName("", ""), validation_alias="to", serialization_alias="to")
    gain: float | None = None
    offset: float = 0.0
    unit: str | None = None
    delay: str | None = None


NotFinite = Literal["nan", "inf", "-inf"]
"""Text for numbers that JSON cannot represent."""


class WarningRecord(_Part):
    """A message of an instance that did not end the run, with its time [s] and FMI status."""

    instance: str = Field("", validation_alias="unit", serialization_alias="unit")
    time: float | str = 0.0
    status: str = ""
    text: str = ""


class FaultRecord(_Part):
    """A fault and the time span [s] in which it acts."""

    on: str
    fault: str
    begin: float | None = Field(None, validation_alias="from", serialization_alias="from")
    until: float | None = None
    at: list[str] = []

    @property
    def words(self) -> str:
        """The fault in words."""
        return f"{self.on}: {self.fault}"


class EventRecord(_Part):
    """Something that happened in a run: when it began and ended [s], where, how far beyond which limit."""

    time: float = 0.0
    until: float | None = None  # None: it lasted to the end of the run
    kind: str = ""
    where: str = ""  # a wheel, an axle, a signal; "" for the whole car
    value: float | None = None  # furthest, in `unit`
    limit: float | None = None
    unit: str = ""
    signal: str = ""  # the column in which it is seen best


class OverrideRecord(_Part):
    """An override of a value of the scenario file."""

    place: str
    value: Any
    origin: str = ""


NOT_RECORDED = ValueSource(NEUTRAL, "source not recorded")
"""Source of values in records of earlier versions."""


class RecordedInstance(TypedDict, total=False):
    """An instance as in a scenario file."""

    __pydantic_config__ = ConfigDict(extra="allow", strict=True)  # type: ignore[misc]
    parameters: dict[str, Any]


class RecordedScenario(TypedDict, total=False):
    """The scenario of a run: what of it is read back."""

    __pydantic_config__ = ConfigDict(extra="allow", strict=True)  # type: ignore[misc]
    file: Any
    source: Any
    vehicle_parameters: dict[str, Any]
    units: dict[str, RecordedInstance]


def _run_status(value: object) -> RunStatus:
    if not isinstance(value, str):
        raise PydanticKnownError("string_type")
    return RunStatus(value)


RecordedStatus = Annotated[
    RunStatus, PlainValidator(_run_status), PlainSerializer(lambda status: status.value, return_type=str)
]


class RunRecord(_Part):
    """The record of a run."""

    id: str | None = None
    key: str | None = None  # see `freshness.key_of`
    status: RecordedStatus = RunStatus.UNKNOWN
    error: ErrorRecord | None = None
    title: str | None = None
    started: str | None = None  # ISO 8601
    wall_time: float = 0.0  # [s]
    rows: NonNegativeInt = 0
    algorithm: str = ""
    step_size: float = 0.0  # [s]
    start_time: float = 0.0  # [s]
    stop_time: float = 0.0  # [s]
    ended: EndRecord | None = None
    evaluation_order: list[str] = []
    units: dict[str, str | None] = {}  # units of time and of the columns
    texts: list[str] = []  # columns that hold text
    fmus: dict[str, FmuRecord] = {}
    sources: list[SourceRecord] = []  # of values of parameters and constants, each once
    changes: list[OverrideRecord] = []
    connections: list[ConnectionRecord] = []
    faults: list[FaultRecord] = []
    events: list[EventRecord] = []  # in the order of their begin
    geometry: dict[str, Any] = {}  # of where the run took place, e.g. lanes
    diagnostics: list[RecordedDiagnostic] = []
    scenario: RecordedScenario = {}
    versions: dict[str, str] = {}
    warnings: list[WarningRecord] = []
    more_warnings: NonNegativeInt = 0
    units_freed: bool = False
    loop: str = ""  # that made the steps: "compiled", or "Python: " and why
    results: str = RESULTS_FILE  # name of the file
    size: int | None = None  # of that file [bytes]
    smallest: Mapping[str, float | NotFinite] = {}
    largest: Mapping[str, float | NotFinite] = {}

    @property
    def overrides(self) -> tuple[Override, ...]:
        """The overrides of the scenario file."""
        overrides = []
        for item in self.changes:
            with contextlib.suppress(ValueError):  # the record was edited
                overrides.append(Override.of(item.place, item.value, cast(OverrideOrigin, item.origin)))
        return tuple(overrides)

    def source(self, instance: str, name: str) -> ValueSource | None:
        """Return the source of a parameter's or constant's value, None for the FMU's default."""
        fmu = self.fmus[instance]
        if name not in fmu.origins and "origins" in fmu.model_fields_set:
            return None
        index = fmu.sources.get(name, len(self.sources))
        if index >= len(self.sources):
            return NOT_RECORDED
        source = self.sources[index]
        return ValueSource(cast(SourceKind, source.kind), source.says, source.file, source.line)

    @property
    def all_diagnostics(self) -> tuple[Diagnostic, ...]:
        """The diagnostics of the run."""
        if (self.model_extra or {}).get("findings"):
            says = f"a run of version 0.2, which warns: see 'findings' in {RUN_FILE}"
            return (*self.diagnostics, Diagnostic("earlier-warnings", says, "warning"))
        return tuple(self.diagnostics)

    @property
    def course_warnings(self) -> tuple[Diagnostic, ...]:
        """The warnings about the course of the run, such as a car that spins."""
        return tuple(
            warning for warning in warnings_in(self.all_diagnostics) if warning.location.time is not None
        )

    @property
    def scenario_file(self) -> str:
        """The path of the scenario file."""
        return str(self.scenario.get("file") or "")

    def content(self) -> dict[str, Any]:
        """Return the content of run.json, as JSON represents it: non-finite numbers become text."""
        content: dict[str, Any] = _plain(self.model_dump(by_alias=True, exclude_unset=True))
        return content

    def to_json(self) -> str:
        """Return the text of run.json."""
        return json.dumps(self.content(), indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {str(k): _plain(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(v) for v in value]
    if isinstance(value, bool) or value is None or isinstance(value, (int, str)):
        return value
    if isinstance(value, float):
        return value if math.isfinite(value) else repr(value)
    return str(value)


def check_record(run: Any, file: Path) -> RunRecord:
    """Return the record with this content, after validating it.

    Raises:
        ResultsError: something in it is not what a run writes.
    """
    if not isinstance(run, dict):
        raise ResultsError(f"{file}: is not the record of a run.")
    try:
        return RunRecord.model_validate(run)
    except ValidationError as errors:
        first, *others = errors.errors(include_url=False)
        key = ".".join(map(str, first["loc"]))
        more = f" ({len(others)} more like it)" if others else ""
        wrong = f"{key}: {first['msg'].lower().partition(' or instance')[0]} (got {short(first['input'])})"
        raise ResultsError(f"{file}: is not the record of a run: {wrong}{more}.") from None
