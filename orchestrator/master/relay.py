"""A log that passes everything on to the process on the other side of a pipe."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from .exchange import LOG, Channel
from .log import KEPT, Log, Message


class Relay(Log):
    """Passes on what FMUs log at once, for one may be about to crash; a flood it only counts.

    Args:
        told: what is passed on of a message.
    """

    def __init__(self, channel: Channel, told: Callable[[Message], tuple[Any, ...]]) -> None:
        super().__init__()
        self._channel = channel
        self._told = told
        self._untold = 0  # messages that were dropped

    def add(self, unit: str, status: int, category: str, text: str, time: float | None = None) -> None:
        kept = len(self.messages)
        super().add(unit, status, category, text, time)
        if len(self.messages) > kept:
            self._channel.send(LOG, self._told(self.messages[-1]))

    def drop(self, count: int) -> None:
        super().drop(count)
        self._untold += count
        if self._untold >= KEPT:
            self.finish()

    def finish(self) -> None:
        """Pass on how many messages have been dropped since that was told last."""
        if self._untold:
            count, self._untold = self._untold, 0
            self._channel.send(LOG, count)
