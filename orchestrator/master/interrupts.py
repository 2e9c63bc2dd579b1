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

_requested_at: float | None = None


class StopFlag:
    """Whether the run is to end."""

    def __init__(self) -> None:
        self.requested = False

    def request(self) -> None:
        """Let it end."""
        global _requested_at
        self.requested = True
        _requested_at = _requested_at or time.monotonic()


def stop_requested_at() -> float | None:
    """Return when this process was asked to stop, by `time.monotonic` [s]; None if it was not."""
    return _requested_at


@contextlib.contextmanager
def interrupts(flag: StopFlag, again: Callable[[], None]) -> Iterator[None]:
    """Let SIGINT and SIGTERM raise `flag` while the block runs; `again` is called if they repeat.

    Outside the main thread, where Python allows no handlers, the block just runs.
    """

    def handle(number: int, frame: FrameType | None) -> None:
        if flag.requested:
            again()
        flag.request()

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
