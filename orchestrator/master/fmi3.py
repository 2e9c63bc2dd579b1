"""Instances of FMI 3.0 co-simulation, without event mode.

An array is one variable to the FMU and as many scalars to a scenario. Most exchanges are of Float64s
in the FMU's order, and these go straight through the master's buffers; others are converted and
rearranged on the way.
"""

from __future__ import annotations

import ctypes
import functools
import math
import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from fmpy.fmi3 import FMU3Slave, fmi3IntermediateUpdateCallback, fmi3LogMessageCallback

from ..fmu.binary import INTEGERS
from ..plan import Place, Unit
from .log import DISCARD, ERROR, OK, WARNING, listen, receive
from .slave import Buffers, Calls, Experiment, Status
from .unit import FmuSlave, nothing_to_do


class Fmi3Slave(FmuSlave):
    """An instance of an FMI 3.0 co-simulation FMU."""

    prefix = "fmi3"
    library = FMU3Slave
    version = 3
    real = "Float64"
    c_types = {
        "Float32": ctypes.c_float,
        "Float64": ctypes.c_double,
        **{name: getattr(ctypes, f"c_{name.lower()}") for name in INTEGERS},
        "Boolean": ctypes.c_bool,
        "String": ctypes.c_char_p,
    }

    def _instantiate(self, unit: Unit) -> int | None:
        self._listener = listen(self._log, unit.name)
        self._experiment = Experiment(0.0, 0.0)
        self._ended = ctypes.c_bool(False)
        self._reached = ctypes.c_double(math.nan)
        resources = str(Path(unit.fmu.directory, "resources").absolute()) + os.sep
        no, yes = False, True
        return self._function("InstantiateCoSimulation")(
            unit.name.encode(),
            unit.fmu.guid.encode(),
            resources.encode(),
            no,  # visible
            yes,  # logging
            no,  # event mode
            no,  # early return
            None,
            0,
            self._listener,
            _logger,
            fmi3IntermediateUpdateCallback(),
        )

    def connect(self, buffers: Buffers) -> Calls:
        inputs, input_places, outputs, output_places, time, step = buffers
        return Calls(
            self._calls("Set", inputs, input_places),
            self._stepping(time, step),
            self._calls("Get", outputs, output_places),
        )

    def _calls(self, verb: str, values: np.ndarray, places: Sequence[Place]) -> Callable[[], Status]:
        """Return the call that exchanges floating-point values, which may be of both precisions."""
        calls = []
        for kind in dict.fromkeys(place.type for place in places):
            where = [i for i, place in enumerate(places) if place.type == kind]
            calls.append(self._call(verb, values, [places[i] for i in where], where))
        if not calls:
            return nothing_to_do
        return calls[0] if len(calls) == 1 else lambda: max(call() for call in calls)

    def _call(
        self, verb: str, values: np.ndarray, places: Sequence[Place], where: list[int]
    ) -> Callable[[], Status]:
        kind, (references, at, count) = places[0].type, _layout(places)
        straight = kind == self.real and at == where == list(range(len(values))) and count == len(values)
        buffer = (self.c_types[kind] * count)()
        if straight:
            buffer = type(buffer).from_buffer(values.data)
        call = functools.partial(
            self._raw(verb + kind),
            ctypes.c_void_p(self._component),
            references,
            ctypes.c_size_t(len(references)),
            buffer,
            ctypes.c_size_t(count),
        )
        if straight:
            return call
        staged, here, there = np.frombuffer(buffer, self.c_types[kind]), np.array(where), np.array(at)

        def give() -> Status:
            staged[there] = values[here]
            return call()

        def take() -> Status:
            status = call()
            values[here] = staged[there]
            return status

        return give if verb == "Set" else take

    def _stepping(self, time: ctypes.c_double, step: ctypes.c_double) -> Callable[[], Status]:
        component, yes = ctypes.c_void_p(self._component), ctypes.c_bool(True)
        event, early, ended, reached = ctypes.c_bool(), ctypes.c_bool(), self._ended, self._reached
        answers = [ctypes.byref(value) for value in (event, ended, early, reached)]
        do_step = self._raw("DoStep")
        call = functools.partial(do_step, component, time, step, yes, *answers)

        def go_on(status: Status) -> Status:
            """Do what is left of a step from which the FMU has returned early, though it was told not to."""
            end = time.value + step.value
            while status <= WARNING and early.value and not ended.value and reached.value < end:
                begin = reached.value
                rest = do_step(component, ctypes.c_double(begin), ctypes.c_double(end - begin), yes, *answers)
                status = max(status, rest)
                if early.value and not reached.value > begin:
                    self._log.add(self.name, ERROR, "", f"it returned early and stays at t = {begin:.9g} s")
                    return ERROR
            return status

        def take_step() -> Status:
            status = call()
            if early.value:
                status = go_on(status)
            return max(status, DISCARD) if ended.value else status

        return take_step

    def ended(self) -> float | None:
        return self._reached.value if self._ended.value else None

    def _exchange(self, verb: str, places: Sequence[Place], given: Sequence[Any]) -> tuple[Status, list[Any]]:
        kind, (references, at, count) = places[0].type, _layout(places)
        buffer = (self.c_types[kind] * count)()
        for i, value in zip(at, given, strict=False):  # none to get
            buffer[i] = value
            if kind in INTEGERS and buffer[i] != value:
                self._log.add(self.name, ERROR, "", f"{value} does not fit into a variable of type {kind}")
                return ERROR, list(given)
        status = self._function(verb + kind)(self._component, references, len(references), buffer, count)
        return status, [buffer[i] for i in at]

    def setup(self, experiment: Experiment) -> Status:
        self._experiment = experiment
        return OK

    def enter(self) -> Status:
        start, stop, tolerance = self._experiment
        enter = self._function("EnterInitializationMode")
        status = self.note(enter(self._component, tolerance is not None, tolerance or 0.0, start, True, stop))
        self._may_terminate = status < ERROR
        return status


def _layout(places: Sequence[Place]) -> tuple[Any, list[int], int]:
    """Return the references of the variables, the place of each scalar among all values, their number."""
    first: dict[int, int] = {}
    count = 0
    for place in places:
        if place.reference not in first:
            first[place.reference] = count
            count += place.elements
    at = [first[place.reference] + place.element for place in places]
    return (ctypes.c_uint * len(first))(*first), at, count


def _log(environment, status, category, text):
    receive(environment, status, category, text)


_logger = fmi3LogMessageCallback(_log)
