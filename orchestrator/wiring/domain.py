"""What wiring is told of the things that scenarios are about, such as cars, and does not know itself."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

from yawbench.foundation.errors import Diagnostic, ScenarioError

from ..plan import Instance
from ..scenario.schema import LoadedScenario
from .context import WiringContext
from .parameters import Parameters

if TYPE_CHECKING:
    from ..recordings.gaps import Gap
    from ..recordings.recording_formats import FileColumn


class Measured(Protocol):
    """Content of a measurement file: signals with times, gaps and units; several segments have numbers."""

    @property
    def sha256(self) -> str:
        """Of the file and of all that it names."""

    def column(self, name: str, number: int | None = None) -> FileColumn:
        """Return a signal of a segment; ValueError: there is no such signal or segment."""

    def gaps(self, name: str, number: int | None = None) -> Sequence[Gap]:
        """Return where a signal of a segment has no samples."""


def _unread(path: Path) -> Measured:
    raise ScenarioError(f"{path}: nothing here reads measurement files", code="file-unreadable")


@dataclass(frozen=True)
class Domain:
    """What is known of the things that scenarios are about; by default nothing."""

    parameters: Callable[[WiringContext], Parameters] = Parameters
    """Distributes parameters, and derives those that follow from others."""
    warnings: Callable[[LoadedScenario, Mapping[str, Instance]], list[Diagnostic]] = lambda *_: []
    """Returns warnings about the values of a scenario's instances."""
    symbols: Mapping[str, str] = field(default_factory=dict)
    """Symbol in names of signals -> the words that it stands for, for suggestions of outputs."""
    measured: Callable[[Path], Measured] = _unread
    """Reads a measurement file that an input follows."""
