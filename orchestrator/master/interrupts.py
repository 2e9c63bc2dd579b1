"""Ctrl-C and SIGTERM as a wish that is looked at between steps.

Python's own answer to Ctrl-C is an exception wherever the program happens to be, which inside an
FMU would end in half a step or a dead process.
"""

from __future__ import annotations

import contextlib
import signal
import threading
import time
from collections.abc import Callable, Iterator
from types import FrameType

from ..errors import Interrupted

_requested_at: float | None = None


class StopFlag:
    """Whether the run is to end, and the signal that asks for it."""

    def __init__(self) -> None:
        self.requested = False
        self.number: int = signal.SIGINT

    def request(self, number: int = signal.SIGINT) -> None:
        """Let it end."""
        global _requested_at
        self.requested, self.number = True, number
        _requested_at = _requested_at or time.monotonic()

    def interrupted(self, how: str, *, unit: str | None = None, time: float | None = None) -> Interrupted:
        """Return what to raise; `how` continues "the run was interrupted"."""
        space = "" if how.startswith(":") else " "
        return Interrupted(f"the run was interrupted{space}{how}", unit=unit, time=time, number=self.number)


def stop_requested_at() -> float | None:
    """Return when this process was asked to stop, by `time.monotonic` [s]; None if it was not."""
    return _requested_at


@contextlib.contextmanager
def terminable() -> Iterator[None]:
    """Let SIGTERM end the block as Ctrl-C does, with an exception.

    Raises:
        Interrupted: it came.
    """

    def handle(number: int, frame: FrameType | None) -> None:
        raise Interrupted(number=number)

    if threading.current_thread() is not threading.main_thread():
        yield
        return
    earlier = signal.signal(signal.SIGTERM, handle)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, signal.SIG_DFL if earlier is None else earlier)


@contextlib.contextmanager
def interrupts(flag: StopFlag, again: Callable[[], None]) -> Iterator[None]:
    """Let SIGINT and SIGTERM raise `flag` while the block runs; `again` is called if they repeat.

    Outside the main thread, where Python allows no handlers, the block just runs.

    Raises:
        Interrupted: one of them came too late for the block to end because of it.
    """

    def handle(number: int, frame: FrameType | None) -> None:
        if flag.requested:
            again()
        flag.request(number)

    if threading.current_thread() is not threading.main_thread():
        yield
        return
    global _requested_at
    _requested_at = None
    numbers = (signal.SIGINT, signal.SIGTERM)
    earlier = [signal.signal(number, handle) for number in numbers]
    try:
        yield
    finally:
        _requested_at = None
        for number, handler in zip(numbers, earlier, strict=True):
            signal.signal(number, signal.SIG_DFL if handler is None else handler)
    if flag.requested:
        raise flag.interrupted("when it had ended")
