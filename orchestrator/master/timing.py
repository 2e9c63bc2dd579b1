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
from .slave import Calls, Status


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
        slave: Any = opener(one, log, corrupted)
        if one.name == unit:
            connect = slave.connect
            slave.connect = lambda buffers: _timed(connect(buffers), clock)
        return slave

    return opened


def _timed(calls: Calls, clock: Clock) -> Calls:
    """Return the calls of a step, timed."""
    now = time.thread_time_ns

    def around(call: Callable[[], Status], steps: int = 0) -> Callable[[], Status]:
        def timed() -> Status:
            begin = now()
            status = call()
            clock.total += now() - begin
            clock.steps += steps
            return status

        return timed

    return Calls(around(calls.set), around(calls.step, 1), around(calls.get))
