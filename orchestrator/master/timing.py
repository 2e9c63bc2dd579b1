"""How long the steps of one unit of a run take, by the processor time of the thread that makes them."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..plan import Unit
from .course import Opener
from .log import Log
from .slave import Buffers, Calls, Status


@dataclass
class Clock:
    """What has been counted."""

    steps: int = 0
    total: int = 0  # [ns]

    @property
    def mean(self) -> float:
        """Time of a step with its exchange of inputs and outputs [s]."""
        return 1e-9 * self.total / self.steps


def timing(opener: Opener, unit: str, clock: Clock) -> Opener:
    """Return an opener whose instance of a unit is timed; the numbers of the run stay as they are."""

    def opened(one: Unit, log: Log, corrupted: set[Path]) -> Any:
        slave = opener(one, log, corrupted)
        return _Timed(slave, clock) if one.name == unit else slave

    return opened


class _Timed:
    """An instance whose calls in a step are timed; all else it passes on."""

    def __init__(self, slave: Any, clock: Clock) -> None:
        self._slave = slave
        self._clock = clock

    def __getattr__(self, name: str) -> Any:
        return getattr(self._slave, name)

    def connect(self, buffers: Buffers) -> Calls:
        """Return the calls of a step, timed."""
        calls = self._slave.connect(buffers)
        return Calls(self._timed(calls.set), self._timed(calls.step, 1), self._timed(calls.get))

    def _timed(self, call: Callable[[], Status], steps: int = 0) -> Callable[[], Status]:
        clock, now = self._clock, time.thread_time_ns

        def timed() -> Status:
            begin = now()
            status = call()
            clock.total += now() - begin
            clock.steps += steps
            return status

        return timed
