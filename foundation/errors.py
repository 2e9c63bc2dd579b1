"""Diagnostics, and the exceptions and warnings of this package that carry them, as one hierarchy.

    YawbenchError                 exit status
    ├── ScenarioError             2   the scenario file or a command-line override is wrong
    ├── ModelDescriptionError     2   an FMU is missing, corrupt or not supported
    ├── WiringError               2   instances cannot be connected as requested
    ├── ResultsError              2   recorded results are missing or unreadable
    ├── BuildError                1   a component cannot be made into an FMU
    └── SimulationError           1   a run failed; has the instance and the time

`Interrupted` (Ctrl-C, SIGTERM) is a KeyboardInterrupt instead, so that code which continues after an error
does not continue after Ctrl-C.

All errors of one file are collected and raised together. Each is a `Diagnostic`: a code for programs, and a
sentence that says where, what, and what is allowed.
"""

from __future__ import annotations

import functools
import os
import re
import signal
import warnings
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

from .messages import printable

Severity = Literal["error", "warning", "info"]
"""Severity of a diagnostic."""


@dataclass(frozen=True)
class Location:
    """Location of a diagnostic; every part may be unknown.

    Attributes:
        file: the file with the value.
        line: its line in the file.
        target: the key of the value, such as "units.plant.fmu", or the override that set it.
        instance: the instance that failed.
        signal: the signal or parameter, "instance.variable", that the message is about.
        time: simulation time at which it began [s].

    >>> from pathlib import Path
    >>> str(yb.Location(Path("a.yaml"), 3, "units.plant.fmu"))
    'a.yaml:3: units.plant.fmu'
    """

    __pydantic_config__ = {"strict": False}

    file: Path | None = None
    line: int | None = None
    target: str = ""
    instance: str | None = None
    signal: str | None = None
    time: float | None = None

    def __str__(self) -> str:
        """File, line and target; messages name the other parts themselves."""
        where = f"{self.file}:{self.line}" if self.file and self.line else f"{self.file or ''}"
        return ": ".join(filter(None, (where, self.target)))


@dataclass(frozen=True)
class Diagnostic:
    """Something to tell the user: an error, a warning or an information.

    Attributes:
        code: what it is about, for programs; docs/diagnostics.md lists all.
        message: one sentence, without the location.
        severity: "error", "warning" or "info".
        location: where it points.
        value: the number that it is about, such as the largest one.

    >>> spinning = base.set({"plant.initial_sideslip": "60 deg"}).run().diagnostics[-1]
    >>> spinning.code, spinning.severity, spinning.location.signal
    ('car-spins', 'warning', 'plant.sideslip')
    """

    __pydantic_config__ = {"strict": False}

    code: str
    message: str
    severity: Severity = "error"
    location: Location = Location()
    value: float | None = None

    def __str__(self) -> str:
        """The text for users: the location, then the message, without control characters."""
        return printable(": ".join(filter(None, (str(self.location), self.message))))

    def record(self) -> dict[str, Any]:
        """Return the diagnostic as JSON-ready data, without the parts that are unknown."""
        where = {
            name: str(part) if isinstance(part, Path) else part
            for name, part in vars(self.location).items()
            if part not in (None, "")
        }
        value = {} if self.value is None else {"value": self.value}
        own = {"code": self.code, "severity": self.severity, "message": self.message}
        return {**own, **({"location": where} if where else {}), **value}

    @classmethod
    def of(cls, record: Mapping[str, Any]) -> Diagnostic:
        """Return the diagnostic of which `record` is the data."""
        where = dict(record.get("location", {}))
        if "file" in where:
            where["file"] = Path(where["file"])
        return cls(**{**record, "location": Location(**where)})


def errors_in(diagnostics: Iterable[Diagnostic]) -> tuple[Diagnostic, ...]:
    """Return the diagnostics that are errors."""
    return tuple(diagnostic for diagnostic in diagnostics if diagnostic.severity == "error")


def warnings_in(diagnostics: Iterable[Diagnostic]) -> tuple[Diagnostic, ...]:
    """Return the warnings without duplicates; of those with a time, the earliest of each code."""
    earliest: dict[tuple[str, str], Diagnostic] = {}
    for diagnostic in diagnostics:
        if diagnostic.severity == "warning":
            time = diagnostic.location.time
            key = (diagnostic.code, diagnostic.message if time is None else "")
            if (time or 0.0) < (earliest.setdefault(key, diagnostic).location.time or 0.0):
                earliest[key] = diagnostic
    return tuple(earliest.values())


class InvalidValueError(ValueError):
    """A value that cannot be used, as low-level parsers refuse it; callers add where it comes from."""

    def __init__(self, message: str, code: str) -> None:
        super().__init__(message)
        self.code = code


def code_of(error: Exception, default: str = "value-invalid") -> str:
    """Return the code that an error was raised with, `default` if with none."""
    return getattr(error, "code", default)


Messages = str | Diagnostic | Iterable[str | Diagnostic]
"""Arguments of errors: messages, or diagnostics where each has its own code or location."""


def text_of(diagnostics: Iterable[Diagnostic]) -> str:
    """Return diagnostics as one line."""
    return "; ".join(map(str, diagnostics))


class YawbenchError(Exception):
    """Base class of all errors; `diagnostics` are its messages, with code and location.

    `code` is that of the first one; `file` and `line` are those of the first that has them, else None.

    >>> try:
    ...     yb.load("fnn_sideslip/26mps")
    ... except yb.YawbenchError as error:
    ...     print(error.code, error.diagnostics[0].message, sep="\\n")
    scenario-unknown
    there is no scenario 'fnn_sideslip/26mps'; did you mean 'fnn_sideslip/25mps'?
    """

    exit_status = 2
    default_code = "internal-error"

    def __init__(self, messages: Messages, *, code: str | None = None) -> None:
        self.diagnostics = _diagnostics(messages, code or self.default_code)
        located = next(
            (diagnostic.location for diagnostic in self.diagnostics if diagnostic.location.file), Location()
        )
        self.file = located.file
        self.line = located.line
        super().__init__("\n".join(map(str, self.diagnostics)))

    @property
    def code(self) -> str:
        """Code of the first error; docs/diagnostics.md lists all codes."""
        return self.diagnostics[0].code


def _diagnostics(messages: Messages, code: str) -> list[Diagnostic]:
    items = [messages] if isinstance(messages, (str, Diagnostic)) else messages
    return [item if isinstance(item, Diagnostic) else Diagnostic(code, item) for item in items]


class YawbenchWarning(UserWarning):
    """A run succeeded but is probably not as intended: the car spins, a friction coefficient is 65.

    `Scenario.run` and `Experiment.run` issue one per call. Filters of the module `warnings` turn it into an
    error or silence it.

    >>> import warnings
    >>> with warnings.catch_warnings():
    ...     warnings.simplefilter("error", yb.YawbenchWarning)
    ...     base.set({"speed": 300}).run()
    Traceback (most recent call last):
    yawbench.foundation.errors.YawbenchWarning: ...300 m/s is implausible ...; did you mean '300 km/h'?...
    """


class ScenarioError(YawbenchError):
    """The scenario file or an override of it is wrong.

    >>> base.set({"stop_time": -1})
    Traceback (most recent call last):
    yawbench.foundation.errors.ScenarioError: set stop_time=-1: must be a time above 0 s (got -1)
    """

    default_code = "value-invalid"


class ModelDescriptionError(YawbenchError):
    """An FMU is missing, corrupt or not supported.

    >>> base.swap(tyre="tyre_pacejka").run()
    Traceback (most recent call last):
    yawbench.foundation.errors.ModelDescriptionError: swap tyre=tyre_pacejka: no FMU 'tyre_pacejka' in ...
    """

    default_code = "fmu-invalid"


class WiringError(YawbenchError):
    """Instances cannot be connected as requested.

    >>> base.swap(controller=lambda roll_angle: -1e5 * roll_angle).run()
    Traceback (most recent call last):
    yawbench.foundation.errors.WiringError: ...controller.roll_angle ...
    """

    default_code = "wiring-invalid"


class ResultsError(YawbenchError):
    """Recorded results are missing or unreadable.

    >>> yb.open("results/nothing")
    Traceback (most recent call last):
    yawbench.foundation.errors.ResultsError: results/nothing: no results here, run.json is missing; ...
    """

    default_code = "results-unreadable"


_OWN = str(Path(__file__).parents[1]) + os.sep
_LIBRARIES = re.compile(r"^<|[/\\\\](?:site|dist)-packages[/\\\\]|[/\\\\]lib[/\\\\]python3")


def hide_library_warnings() -> None:
    """Show no warnings that code of this program or of packages raises, such as NumPy's of overflow.

    Users cannot act on them: what they mean for a run is told as a diagnostic. Warnings of users' own files,
    such as a controller's, are shown. With `YAWBENCH_TRACEBACK`, all are.
    """
    before = warnings.showwarning

    def show(message: Any, category: type[Warning], filename: str, *more: Any, **names: Any) -> None:
        own = filename.startswith(_OWN) or _LIBRARIES.search(filename)
        if not own or issubclass(category, YawbenchWarning) or os.environ.get("YAWBENCH_TRACEBACK"):
            before(message, category, filename, *more, **names)

    warnings.showwarning = show


class BuildError(YawbenchError):
    """An FMU cannot be built from its component; also raised by runs that have to build FMUs first.

    >>> try:
    ...     run = base.run()
    ... except yb.BuildError as error:
    ...     print("mend this first:", error)
    """

    exit_status = 1
    default_code = "component-invalid"


class SimulationError(YawbenchError):
    """A run failed: `instance` (None if the master itself failed) at `time` [s].

    >>> def careless(yaw_rate_ref, yaw_rate):
    ...     return 20000 * yaw_rate_ref / yaw_rate
    >>> try:
    ...     base.swap(controller=careless).run()
    ... except yb.SimulationError as error:
    ...     print(error.instance, error.time, repr(error.__cause__))
    controller 0.0 ZeroDivisionError('float division by zero')
    """

    exit_status = 1
    default_code = "run-failed"

    def __init__(
        self, messages: Messages, *, instance: str | None, time: float, code: str | None = None
    ) -> None:
        where = Location(instance=instance, time=time)
        super().__init__([
            replace(diagnostic, location=where) if diagnostic.location == Location() else diagnostic
            for diagnostic in _diagnostics(messages, code or self.default_code)
        ])  # fmt: skip
        self.instance = instance
        self.time = time
        self.warnings: tuple[Diagnostic, ...] = ()  # about the run up to that time

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle it: the arguments that it was made with are not those of an exception."""
        make = functools.partial(type(self), instance=self.instance, time=self.time)
        return make, self.args, vars(self)


class Interrupted(KeyboardInterrupt):
    """Ctrl-C or SIGTERM stopped a run at `time` [s], during a call of `instance` (None: between calls)."""

    def __init__(
        self,
        messages: Messages = "Interrupted",
        *,
        instance: str | None = None,
        time: float | None = None,
        number: int = signal.SIGINT,
    ) -> None:
        self.diagnostics = _diagnostics(messages, "run-interrupted")
        self.instance = instance
        self.time = time
        self.number = number
        super().__init__("\n".join(map(str, self.diagnostics)))

    @property
    def exit_status(self) -> int:
        """Exit status by the convention of shells: 130 after Ctrl-C, 143 after SIGTERM."""
        return 128 + self.number

    @classmethod
    def of(cls, error: KeyboardInterrupt) -> Interrupted:
        """Convert a KeyboardInterrupt to this type; return the error itself if it is of it already."""
        return error if isinstance(error, cls) else cls()
