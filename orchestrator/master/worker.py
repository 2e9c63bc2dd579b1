"""The process of an isolated unit: it does with the FMU what the master asks for, and nothing else.

It ends when the master does, and with it all that the FMU has started (see `guardian`).
"""

from __future__ import annotations

import contextlib
import os
from collections.abc import Sequence
from typing import Any

from ..errors import YawbenchError
from ..plan import Place, Unit
from .exchange import FAILED, GET, REPLY, SET, STEP, Board, Channel, Relay, told
from .guardian import stand_guard
from .log import OK, WARNING, known
from .opening import open_unit
from .slave import Buffers
from .surroundings import Surroundings, flush_output
from .unit import FmuSlave


class Worker:
    """One FMU instance and the requests that concern it."""

    def __init__(self, channel: Channel, memory: int) -> None:
        self._channel = channel
        self._memory = memory
        self._log = Relay(channel, timed=False)
        self._surroundings: Surroundings | None = Surroundings()  # until it is stepped
        self._slave: FmuSlave

    def serve(self) -> None:
        """Answer until there is no master any more, or in a copy that the FMU has made of this process."""
        hear, say, answers = self._channel.hear, self._channel.say, [bytes([i]) for i in range(256)]
        process, count = os.getpid(), 0
        while (asked := hear()) is not None:
            parts = asked if asked <= SET | STEP | GET else 0
            if parts:
                answer, count = self.exchange(parts), count + 256
            else:
                name, arguments = self._channel.ordered()
                reply = getattr(self if hasattr(self, name) else self._slave, name)(*arguments)
                if self._surroundings is not None:
                    self._surroundings.restore("", self._log)
            if os.getpid() != process:
                return
            if parts:
                self._answer.value = count + answer
                say(answers[answer])
            else:
                self._channel.send(REPLY, reply)

    def exchange(self, parts: int) -> int:
        """Do parts of a step in order; return the worst status, and 16 times the part it belongs to.

        Nothing is done after a status worse than Warning.
        """
        answer = OK
        for part, call in self._calls:
            if not parts & part:
                continue
            self._part.value = part
            status = known(call())
            if status > answer % 16:
                answer = 16 * part + status
            if status > WARNING:
                break
        self._part.value = 0
        return answer

    def open(self, unit: Unit) -> dict[str, Any] | None:
        """Instantiate the FMU; return what there is to tell if that fails."""
        try:
            self._slave = open_unit(unit, self._log, set())
        except YawbenchError as error:
            return told(error)
        return None

    def connect(self, input_places: Sequence[Place], output_places: Sequence[Place]) -> None:
        board = Board(self._memory, len(input_places), len(output_places))
        calls = self._slave.connect(
            Buffers(board.inputs, input_places, board.outputs, output_places, board.time, board.step)
        )
        self._part = board.part
        self._answer = board.answer
        self._calls = ((SET, calls.set), (STEP, calls.step), (GET, calls.get))

    def exit(self) -> int:
        self._surroundings = None
        return self._slave.exit()

    def free(self) -> None:
        """End the instance, and what its library has still to print."""
        self._slave.free()
        self._log.finish()
        flush_output()


def main(*descriptors: str) -> None:
    """Serve the master at the other ends of two pipes, with memory that is shared with it."""
    reading, writing, memory = map(int, descriptors)
    stand_guard(reading, (writing, memory))
    channel = Channel(reading, writing)
    channel.send(REPLY, "ready")
    try:
        Worker(channel, memory).serve()
    except Exception as error:
        with contextlib.suppress(OSError):
            channel.send(FAILED, f"{type(error).__name__}: {error}")
        os._exit(1)
    os._exit(0)
