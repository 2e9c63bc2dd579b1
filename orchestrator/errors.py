"""Everything that can go wrong, as one tree.

    YawbenchError                 exit status
    ├── ScenarioError             2   the scenario file or a command-line override is wrong
    ├── ModelDescriptionError     2   an FMU is missing, corrupt or not supported
    ├── WiringError               2   units cannot be connected as asked
    ├── ResultsError              2   recorded results are missing or unreadable
    ├── BuildError                1   a component cannot be made into an FMU
    └── SimulationError           1   a run failed; knows unit and time

`Interrupted` (Ctrl-C, SIGTERM) is not part of it: it is a KeyboardInterrupt, so code that goes on after an
error does not go on after Ctrl-C.

All problems of one file are collected and raised once. Each is a sentence that says where, what,
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
"""Kind of the problem that names the results of a run that failed."""


class Problem(str):
    """What is wrong: a sentence that begins with its place, and knows that place.

    Attributes:
        text: the sentence without its place.
        file: in which it is; None: in none.
        line: of the file; None: in no line of it.
        place: the value, such as "units.plant.fmu", or the change that gave it; "" if it is no value.
        kind: KEPT, or "" of most.
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
        text = printable(text)  # of users, FMUs and files: nothing of it may act on a terminal or a page
        made = super().__new__(cls, printable(": ".join(filter(None, (where, place, text)))))
        made.text, made.file, made.line, made.place, made.kind = text, file, line, place, kind
        return made


class YawbenchError(Exception):
    """Base of all errors; `problems` are its sentences, each with its file and line if it has any.

    `file` and `line` are those of the first problem that has them, None where none has.

    >>> try:
    ...     yb.load("fnn_sideslip/26mps")
    ... except yb.YawbenchError as error:
    ...     print(error.problems)
    ["there is no scenario 'fnn_sideslip/26mps'; did you mean 'fnn_sideslip/25mps'?"]
    """

    exit_status = 2

    def __init__(self, problems: str | Iterable[str]) -> None:
        given = [problems] if isinstance(problems, str) else problems
        self.problems = [one if isinstance(one, Problem) else Problem(one) for one in given]
        placed = next((one for one in self.problems if one.file), None)
        self.file = placed.file if placed else None
        self.line = placed.line if placed else None
        super().__init__("\n".join(self.problems))


class YawbenchWarning(UserWarning):
    """Remarks on a run that is no failure but hardly meant: a car that spins, a friction of 65.

    `Scenario.run` and `Experiment.run` give one for each call. Filters of the module `warnings` make it an
    error or silence it.

    >>> import warnings
    >>> with warnings.catch_warnings():
    ...     warnings.simplefilter("error", yb.YawbenchWarning)
    ...     base.set({"speed": 300}).run()
    Traceback (most recent call last):
    orchestrator.errors.YawbenchWarning: ...300 m/s is 1080 km/h; did you mean '300 km/h'?...
    """


class ScenarioError(YawbenchError):
    """The scenario file or a change of it is wrong.

    >>> base.set({"stop_time": -1})
    Traceback (most recent call last):
    orchestrator.errors.ScenarioError: set stop_time=-1: must be a time above 0 s (got -1)
    """


class ModelDescriptionError(YawbenchError):
    """An FMU is missing, corrupt or not supported.

    >>> base.swap(tyre="tyre_pacejka").run()
    Traceback (most recent call last):
    orchestrator.errors.ModelDescriptionError: swap tyre=tyre_pacejka: no FMU 'tyre_pacejka' in ...
    """


class WiringError(YawbenchError):
    """Units cannot be connected as asked.

    >>> base.swap(controller=lambda roll_angle: -1e5 * roll_angle).run()
    Traceback (most recent call last):
    orchestrator.errors.WiringError: ...controller.roll_angle ...
    """


class ResultsError(YawbenchError):
    """Recorded results are missing or unreadable.

    >>> yb.open("results/nothing")
    Traceback (most recent call last):
    orchestrator.errors.ResultsError: results/nothing: no results here, run.json is missing; ...
    """


class RecordWarning(UserWarning):
    """What stands in a folder of results is not what was written there, or cannot be checked.

    >>> import warnings
    >>> warnings.simplefilter("error", yb.RecordWarning)  # to stop where a record carries no checksums
    """


class BuildError(YawbenchError):
    """A component cannot be made into an FMU; raised by a run whose FMUs have to be built first.

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
        self.findings: tuple[Finding, ...] = ()  # on the run's course until then


class Interrupted(KeyboardInterrupt):
    """Ctrl-C or SIGTERM, which has ended a run of `instance` (None: between two calls) at `time` [s]."""

    def __init__(
        self,
        problem: str | Iterable[str] = "Interrupted",
        *,
        instance: str | None = None,
        time: float | None = None,
        number: int = signal.SIGINT,
    ) -> None:
        self.problems = [Problem(one) for one in ([problem] if isinstance(problem, str) else problem)]
        self.instance = instance
        self.time = time
        self.number = number
        super().__init__("\n".join(self.problems))

    @property
    def exit_status(self) -> int:
        """As shells have it: 130 after Ctrl-C, 143 after SIGTERM."""
        return 128 + self.number

    @classmethod
    def of(cls, error: KeyboardInterrupt) -> Interrupted:
        """Return the error itself, or one that stands for a plain KeyboardInterrupt."""
        return error if isinstance(error, cls) else cls()
