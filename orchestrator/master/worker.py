"""The process of an isolated unit: it does with the FMU what the master asks for, and nothing else.

It ends when the master does: the kernel kills it (Linux), and where a call of the FMU lets other
threads run, one of them sees that the pipe from the master has no writer any more.
"""

from __future__ import annotations

import ctypes
import os
import select
import signal
import sys
import threading
from collections.abc import Sequence
from typing import Any

from ..errors import ModelDescriptionError, SimulationError
from ..plan import Place, Unit
from .exchange import GET, LOG, REPLY, SET, STEP, Board, Channel
from .log import OK, WARNING, Log
from .opening import open_unit
from .slave import Experiment
from .unit import FmuSlave

_PR_SET_PDEATHSIG = 1  # linux/prctl.h


class _Relay(Log):
    """Passes on to the master what the FMU logs, at once: the FMU may be about to crash."""

    def __init__(self, channel: Channel) -> None:
        super().__init__()
        self._channel = channel

    def add(self, unit: str, status: int, category: str, text: str, time: float | None = None) -> None:
        super().add(unit, status, category, text, time)
        if status != OK:
            self._channel.send(LOG, (status, category, text))


class Worker:
    """One FMU instance and the requests that concern it."""

    def __init__(self, channel: Channel, memory: int) -> None:
        self._channel = channel
        self._memory = memory
        self._slave: FmuSlave

    def serve(self) -> None:
        """Answer until there is no master any more."""
        hear, say, answers = self._channel.hear, self._channel.say, [bytes([i]) for i in range(256)]
        while (asked := hear()) is not None:
            if asked <= SET | STEP | GET:
                say(answers[self.exchange(asked)])
                continue
            name, arguments = self._channel.receive()
            self._channel.send(REPLY, getattr(self, name)(*arguments))

    def exchange(self, parts: int) -> int:
        """Do parts of a step in order; return the worst status, and 16 times the part it belongs to.

        Nothing is done after a status worse than Warning.
        """
        answer = OK
        for part, call in self._calls:
            if not parts & part:
                continue
            self._part.value = part
            status = call()
            if status != OK:
                status = self._slave.note(status)
                if status > answer % 16:
                    answer = 16 * part + status
                if status > WARNING:
                    break
        self._part.value = 0
        return answer

    def open(self, unit: Unit) -> tuple[str, list[str]] | None:
        """Instantiate the FMU; return the name of an error and its sentences if that fails."""
        try:
            self._slave = open_unit(unit, _Relay(self._channel), set())
        except (ModelDescriptionError, SimulationError) as error:
            return type(error).__name__, error.problems
        return None

    def connect(self, input_places: Sequence[Place], output_places: Sequence[Place]) -> None:
        board = Board(self._memory, len(input_places), len(output_places))
        calls = self._slave.connect(
            board.inputs, input_places, board.outputs, output_places, board.time, board.step
        )
        self._part = board.part
        self._calls = ((SET, calls.set), (STEP, calls.step), (GET, calls.get))

    def put(self, *arguments: Any) -> int:
        return self._slave.put(*arguments)

    def fetch(self, *arguments: Any) -> Any:
        return self._slave.fetch(*arguments)

    def look(self, *arguments: Any) -> Any:
        return self._slave.look(*arguments)

    def setup(self, experiment: Experiment) -> int:
        return self._slave.setup(experiment)

    def enter(self) -> int:
        return self._slave.enter()

    def exit(self) -> int:
        return self._slave.exit()

    def note(self, status: int) -> int:
        return self._slave.note(status)

    def free(self) -> None:
        """End the instance, and what its library has still to print."""
        self._slave.free()
        ctypes.CDLL(None).fflush(None)


def _die_with_master(reading: int) -> None:
    """See to it that this process ends when the master does, also in the middle of a call."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL, 0, 0, 0)

    def watch() -> None:
        gone = select.poll()
        gone.register(reading, 0)  # nothing is asked for, so what comes is the end of the pipe
        gone.poll()
        os._exit(0)

    threading.Thread(target=watch, daemon=True).start()


def main(reading: int, writing: int, memory: int) -> None:
    """Serve the master at the other ends of two pipes."""
    _die_with_master(reading)
    channel = Channel(reading, writing)
    channel.send(REPLY, "ready")
    Worker(channel, memory).serve()
    os._exit(0)
