"""What the master needs of an FMU's instance, whichever version of FMI it follows."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Sequence
from typing import NamedTuple, Protocol

import numpy as np

from ..plan import Place, Value

Status = int


class Calls(NamedTuple):
    """The calls of a communication step, each without arguments, returning an FMI status."""

    set: Callable[[], Status]
    step: Callable[[], Status]
    get: Callable[[], Status]


class Buffers(NamedTuple):
    """Where master and instance meet in a step: arrays of floating-point values, one item per place."""

    inputs: np.ndarray
    input_places: Sequence[Place]
    outputs: np.ndarray
    output_places: Sequence[Place]
    time: ctypes.c_double  # at which the step begins [s], read at every call
    step: ctypes.c_double  # its size [s], likewise


class Experiment(NamedTuple):
    """What an instance is told of the run before it is initialized."""

    start: float  # [s]
    stop: float  # [s]
    tolerance: float | None = None  # relative, of its own solver; None: its default


class Slave(Protocol):
    """An instance of an FMU. Statuses are FMI's, never exceptions."""

    name: str

    def connect(self, buffers: Buffers) -> Calls:
        """Return the calls of a step, which exchange floating-point values through the buffers."""

    def part(self, kind: str) -> str:
        """Return which kind of call (set, step, get) has failed when one of `kind` did not return OK."""

    def put(self, places: Sequence[Place], values: Sequence[Value]) -> Status:
        """Set variables of one type; of an array all elements."""

    def fetch(self, places: Sequence[Place]) -> tuple[Status, list[Value]]:
        """Return variables of one type."""

    def setup(self, experiment: Experiment) -> Status:
        """Tell the instance of the run."""

    def enter(self) -> Status:
        """Enter initialization mode."""

    def exit(self) -> Status:
        """Leave initialization mode."""

    def ended(self) -> float | None:
        """Return the time [s] that an instance which wants to end has reached, None if it does not.

        Asked after a step that was answered with Discard. Not a number: it does not say how far it is.
        """

    def note(self, status: Status) -> Status:
        """Remember what a call has returned, which decides how the instance may be ended, and return it.

        The master says so of every call that counts. A number that is no status comes back as UNKNOWN.
        """

    def free(self) -> None:
        """End the instance as its state allows. Once; further calls do nothing."""
