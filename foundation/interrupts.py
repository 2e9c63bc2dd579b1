"""Ctrl-C and SIGTERM: the signals that stop a run, or end a program.

During a run they set a flag that is checked between steps. Python's default for Ctrl-C is an exception at an
arbitrary point, which inside an FMU would end in half a step or a dead process.
"""

from __future__ import annotations

import contextlib
import ctypes
import signal
import threading
import time
from collections.abc import Callable, Iterator
from types import FrameType

from .errors import Interrupted

_requested_at: float | None = None


class StopFlag:
    """Whether the run should stop, and the signal that requested it."""

    def __init__(self) -> None:
        self.flag = ctypes.c_int32(0)  # read by the compiled loop, too
        self.number: int = signal.SIGINT

    @property
    def requested(self) -> bool:
        return bool(self.flag.value)

    def request(self, number: int = signal.SIGINT) -> None:
        """Ask the run to stop."""
        global _requested_at
        self.flag.value, self.number = 1, number
        _requested_at = _requested_at or time.monotonic()

    def interrupted(self, how: str, *, instance: str | None = None, time: float | None = None) -> Interrupted:
        """Return the exception to raise; `how` continues the message "the run was interrupted"."""
        space = "" if how.startswith(":") else " "
        problem = f"the run was interrupted{space}{how}"
        return Interrupted(problem, instance=instance, time=time, number=self.number)


def stop_requested_at() -> float | None:
    """Return when this process was asked to stop, by `time.monotonic` [s]; None if it was not."""
    return _requested_at


@contextlib.contextmanager
def terminable() -> Iterator[None]:
    """Make SIGTERM end the block with an exception, as Ctrl-C does.

    Raises:
        Interrupted: SIGTERM was received.
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
    """Make SIGINT and SIGTERM set `flag` while the block runs; `again` is called if they repeat.

    Outside the main thread, where Python allows no handlers, the block just runs.

    Raises:
        Interrupted: a signal came too late to stop the block.
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
