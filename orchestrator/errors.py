"""Exceptions and warnings of this package, as one hierarchy.

    YawbenchError                 exit status
    ├── ScenarioError             2   the scenario file or a command-line override is wrong
    ├── ModelDescriptionError     2   an FMU is missing, corrupt or not supported
    ├── WiringError               2   instances cannot be connected as requested
    ├── ResultsError              2   recorded results are missing or unreadable
    ├── BuildError                1   a component cannot be made into an FMU
    └── SimulationError           1   a run failed; has the instance and the time

`Interrupted` (Ctrl-C, SIGTERM) is a KeyboardInterrupt instead, so that code which continues after an error
does not continue after Ctrl-C.

All problems of one file are collected and raised together. Each is a sentence that says where, what,
and what is allowed.
"""

from __future__ import annotations

import signal
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

from .messages import printable

if TYPE_CHECKING:
    from .plan import Finding

KEPT = "kept"
"""Kind of the problem that names the saved results of a failed run."""


class Problem(str):
    """An error message that begins with its location, which its attributes give separately.

    Attributes:
        text: the message without its location.
        file: the file with the error, if any.
        line: the line in the file, if any.
        place: the key of the value, such as "units.plant.fmu", or the override that set it; "" if neither.
        kind: KEPT, or "".
    """

    text: str
    file: Path | None
    line: int | None
    place: str
    kind: str

    def __new__(
        cls, text: str, *, file: Path | None = None, line: int | None = None, place: str = "", kind: str = ""
    ) -> Problem:
        where = f"{file}:{line}" if file and line else f"{file or ''}"
        text = printable(text)  # from users, FMUs and files: must not contain control characters
        made = super().__new__(cls, printable(": ".join(filter(None, (where, place, text)))))
        made.text, made.file, made.line, made.place, made.kind = text, file, line, place, kind
        return made


class YawbenchError(Exception):
    """Base class of all errors; `problems` are its messages, each with file and line where known.

    `file` and `line` are those of the first problem that has them, else None.

    >>> try:
    ...     yb.load("fnn_sideslip/26mps")
    ... except yb.YawbenchError as error:
    ...     print(error.problems)
    ["there is no scenario 'fnn_sideslip/26mps'; did you mean 'fnn_sideslip/25mps'?"]
    """

    exit_status = 2

    def __init__(self, problems: str | Iterable[str]) -> None:
        texts = [problems] if isinstance(problems, str) else problems
        self.problems = [text if isinstance(text, Problem) else Problem(text) for text in texts]
        located = next((problem for problem in self.problems if problem.file), None)
        self.file = located.file if located else None
        self.line = located.line if located else None
        super().__init__("\n".join(self.problems))


class YawbenchWarning(UserWarning):
    """A run succeeded but is probably not as intended: the car spins, a friction coefficient is 65.

    `Scenario.run` and `Experiment.run` issue one per call. Filters of the module `warnings` turn it into an
    error or silence it.

    >>> import warnings
    >>> with warnings.catch_warnings():
    ...     warnings.simplefilter("error", yb.YawbenchWarning)
    ...     base.set({"speed": 300}).run()
    Traceback (most recent call last):
    yawbench.YawbenchWarning: ...300 m/s is 1080 km/h; did you mean '300 km/h'?...
    """


class ScenarioError(YawbenchError):
    """The scenario file or an override of it is wrong.

    >>> base.set({"stop_time": -1})
    Traceback (most recent call last):
    yawbench.ScenarioError: set stop_time=-1: must be a time above 0 s (got -1)
    """


class ModelDescriptionError(YawbenchError):
    """An FMU is missing, corrupt or not supported.

    >>> base.swap(tyre="tyre_pacejka").run()
    Traceback (most recent call last):
    yawbench.ModelDescriptionError: swap tyre=tyre_pacejka: no FMU 'tyre_pacejka' in ...
    """


class WiringError(YawbenchError):
    """Instances cannot be connected as requested.

    >>> base.swap(controller=lambda roll_angle: -1e5 * roll_angle).run()
    Traceback (most recent call last):
    yawbench.WiringError: ...controller.roll_angle ...
    """


class ResultsError(YawbenchError):
    """Recorded results are missing or unreadable.

    >>> yb.open("results/nothing")
    Traceback (most recent call last):
    yawbench.ResultsError: results/nothing: no results here, run.json is missing; ...
    """


class RecordWarning(YawbenchWarning):
    """A results folder was changed after it was written, or cannot be verified.

    >>> import warnings
    >>> warnings.simplefilter("error", yb.RecordWarning)  # to stop where a record carries no checksums
    """


class BuildError(YawbenchError):
    """An FMU cannot be built from its component; also raised by runs that have to build FMUs first.

    >>> try:
    ...     run = base.run()
    ... except yb.BuildError as error:
    ...     print("mend this first:", error)
    """

    exit_status = 1


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

    def __init__(self, problem: str, *, instance: str | None, time: float) -> None:
        super().__init__(problem)
        self.instance = instance
        self.time = time
        self.findings: tuple[Finding, ...] = ()  # about the run up to that time


class Interrupted(KeyboardInterrupt):
    """Ctrl-C or SIGTERM stopped a run at `time` [s], during a call of `instance` (None: between calls)."""

    def __init__(
        self,
        problem: str | Iterable[str] = "Interrupted",
        *,
        instance: str | None = None,
        time: float | None = None,
        number: int = signal.SIGINT,
    ) -> None:
        self.problems = [Problem(text) for text in ([problem] if isinstance(problem, str) else problem)]
        self.instance = instance
        self.time = time
        self.number = number
        super().__init__("\n".join(self.problems))

    @property
    def exit_status(self) -> int:
        """Exit status by the convention of shells: 130 after Ctrl-C, 143 after SIGTERM."""
        return 128 + self.number

    @classmethod
    def of(cls, error: KeyboardInterrupt) -> Interrupted:
        """Convert a KeyboardInterrupt to this type; return the error itself if it is of it already."""
        return error if isinstance(error, cls) else cls()


for _public in (YawbenchError, *YawbenchError.__subclasses__(), YawbenchWarning, RecordWarning):
    _public.__module__ = "yawbench"  # where users import them from, and what tracebacks shall say
