"""Everything that can go wrong, as one tree.

    YawbenchError                 exit status
    ├── ScenarioError             2   the scenario file or a command-line override is wrong
    ├── ModelDescriptionError     2   an FMU is missing, corrupt or not supported
    ├── WiringError               2   units cannot be connected as asked
    ├── ResultsError              2   recorded results are missing or unreadable
    ├── BuildError                1   a component cannot be made into an FMU
    └── SimulationError           1   a run failed; knows unit and time

All problems of one file are collected and raised once. Each is a sentence that says where, what,
and what is allowed.
"""

from __future__ import annotations

from collections.abc import Iterable


class YawbenchError(Exception):
    """Base of all errors; `problems` are its sentences."""

    exit_status = 2

    def __init__(self, problems: str | Iterable[str]) -> None:
        self.problems = [problems] if isinstance(problems, str) else list(problems)
        super().__init__("\n".join(self.problems))


class ScenarioError(YawbenchError):
    """The scenario file or a command-line override is wrong."""


class ModelDescriptionError(YawbenchError):
    """An FMU is missing, corrupt or not supported."""


class WiringError(YawbenchError):
    """Units cannot be connected as asked."""


class ResultsError(YawbenchError):
    """Recorded results are missing or unreadable."""


class BuildError(YawbenchError):
    """A component cannot be made into an FMU."""

    exit_status = 1


class SimulationError(YawbenchError):
    """A run failed: `unit` (None if the master itself failed) at `time` [s]."""

    exit_status = 1

    def __init__(self, problem: str, *, unit: str | None, time: float) -> None:
        super().__init__(problem)
        self.unit = unit
        self.time = time
