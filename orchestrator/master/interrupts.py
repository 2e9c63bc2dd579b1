"""Ctrl-C and SIGTERM as a wish that is looked at between steps.

Python's own answer to Ctrl-C is an exception wherever the program happens to be, which inside an
FMU would end in half a step or a dead process.
"""

from __future__ import annotations

import contextlib
import signal
import threading
from collections.abc import Callable, Iterator
from types import FrameType


class StopFlag:
    """Whether the run is to end."""

    def __init__(self) -> None:
        self.requested = False


@contextlib.contextmanager
def interrupts(flag: StopFlag, again: Callable[[], None]) -> Iterator[None]:
    """Let SIGINT and SIGTERM raise `flag` while the block runs; `again` is called if they repeat.

    Outside the main thread, where Python allows no handlers, the block just runs.
    """

    def handle(number: int, frame: FrameType | None) -> None:
        if flag.requested:
            again()
        flag.requested = True

    if threading.current_thread() is not threading.main_thread():
        yield
        return
    numbers = (signal.SIGINT, signal.SIGTERM)
    earlier = [signal.signal(number, handle) for number in numbers]
    try:
        yield
    finally:
        for number, handler in zip(numbers, earlier, strict=True):
            signal.signal(number, signal.SIG_DFL if handler is None else handler)
