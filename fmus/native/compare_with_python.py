"""Bitwise comparison of a native library with its Python component under the same sequence of calls.

The library is called twice, by the functions of FMI 2.0 and by those of FMI 3.0.

The library notes which of its branches are reached. Inputs for the others are searched in the library alone,
which is fast, and what reaches more of them is compared as well (`_search`).

A comparison is a sequence of cases: calls as a host makes them. Both run 2,000 steps at each of three step
sizes, with inputs in their usual ranges, a hundredth and three times these ranges; then a case for every
choice of a parameter, changed numbers, parameters out of range and inputs that are not finite, with other
start times, saved, restored and serialized states, reset, outputs read and inputs changed before
initialization ends. Values, statuses and messages must be the same, except that for huge inputs a native
library may refuse to compute an integer of 2^53 or more. All NaNs are equal.
"""

from __future__ import annotations

import ctypes
import itertools
import json
import math
import os
import random
import signal
import struct
from collections.abc import Callable, Iterator, Sequence
from ctypes import (
    CFUNCTYPE,
    byref,
    c_bool,
    c_char_p,
    c_double,
    c_int,
    c_longlong,
    c_size_t,
    c_uint,
    c_void_p,
)
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

from ..usual_ranges import pattern_of, usual_range
from .ir import ALONE

STEPS = 2000
LENGTHS = (0.001, 0.005, 0.02)
"""Step sizes [s]: those of plants, controllers and sensors."""
FEW, FEWEST, IN_ALL = 100, 2, 3000
"""Steps per other value of a parameter, at most and at least, and approximate number for all values."""
STARTS = (-1.0, 3600.0)
"""Further start times [s]."""
MOVED, MANY = 20, 60
"""Number of cases in which all parameters are moved, and of parameters above which each moves only once."""
EXTREME = (math.nan, math.inf, -math.inf, 1e300, -0.0)
"""Values of each input that are compared."""
LIMIT = 240
"""Largest processor time [s] of a comparison, since a wrongly translated loop may never end."""
SEARCH, EPISODE, LONGEST_EPISODE = 240_000, 150, 50_000
"""Steps of the search for branches that were not reached, of one try, and at most of one; chosen: the search
takes a second, twice as long as the comparison, and a controller is followed for 50,000 samples."""
PATIENCE = 200
"""Tries in a row that reach nothing new, after which the search ends; chosen: two tenths of a second."""
SEARCH_SECONDS = 5
"""Processor time [s] after which a search is given up: with odd parameters a unit may sample without end."""
MOST_FOUND = 30
"""Largest number of tries that are compared; chosen: a start of the slowest component takes half a second."""
TOGETHER = 0.5
"""Share of the turns of an input in which those of the other wheels turn with it, in half of the tries."""
OFF = (0.05, 0.3, 1.0)
"""Shares of the parameters that are switched off, in half of the tries."""
AFTER = 60
"""Steps of a comparison after the last new branch was reached, in which what the branch did shows."""
_LOGGER = CFUNCTYPE(None, c_void_p, c_char_p, c_int, c_char_p, c_char_p)
_LOGGER_3 = CFUNCTYPE(None, c_void_p, c_int, c_char_p, c_char_p)


class _Callbacks(ctypes.Structure):
    _fields_ = (
        ("logger", _LOGGER),
        *((name, c_void_p) for name in ("allocate", "free", "finished", "environment")),
    )


class Difference(Exception):
    """Error: a difference between a native library and its Python component."""


@dataclass(frozen=True)
class Compared:
    """Outcome of a comparison.

    Attributes:
        difference: the first difference, "" if none.
        reached: for each branch of the library, whether it was compared.
        untried: files and lines of the branches that were not.
    """

    difference: str = ""
    reached: bytes = b""
    untried: tuple[str, ...] = ()


Answer = tuple[bool, list[str], bytes]
"""Whether a call succeeded, the logged messages, and the returned values."""


class Native:
    """Instance of a native library, called by the functions of FMI 2.0."""

    fmi = 2
    _STATE, _DESERIALIZE = "FMUstate", "DeSerialize"

    def __init__(self, library: Path, guid: str) -> None:
        self.library = ctypes.CDLL(str(library))
        self.messages: list[str] = []
        made = self._instantiate(guid.encode())
        if made is None:
            raise Difference(f"the native library does not start: {'; '.join(self.messages)}")
        self.instance = c_void_p(made)

    def _instantiate(self, guid: bytes) -> int | None:
        self._callbacks = _Callbacks(_LOGGER(self._log))
        call = self.library.fmi2Instantiate
        call.restype = c_void_p
        made: int | None = call(b"native", c_int(1), guid, None, byref(self._callbacks), c_int(0), c_int(0))
        return made

    def _log(self, environment: Any, name: bytes, status: int, category: bytes, text: bytes) -> None:
        self.messages.append(text.decode("utf-8", "replace").replace("%%", "%"))

    def _answer(self, status: int, values: bytes = b"") -> Answer:
        messages, self.messages = self.messages, []
        return status == 0, messages, values

    def _function(self, name: str) -> Any:
        return getattr(self.library, f"fmi{self.fmi}{name}")

    def reset(self) -> Answer:
        return self._answer(self._function("Reset")(self.instance))

    def set(self, kind: str, refs: Sequence[int], values: Sequence[Any]) -> Answer:
        type = c_double if kind == "Real" else c_int
        call = getattr(self.library, f"fmi2Set{kind.replace('Enumeration', 'Integer')}")
        n = len(refs)
        return self._answer(call(self.instance, (c_uint * n)(*refs), c_size_t(n), (type * n)(*values)))

    def get(self, refs: Sequence[int]) -> Answer:
        n = len(refs)
        values = (c_double * n)()
        status = self.library.fmi2GetReal(self.instance, (c_uint * n)(*refs), c_size_t(n), values)
        return self._answer(status, bytes(values))

    def begin(self, t: float) -> Answer:
        setup = self.library.fmi2SetupExperiment
        status = setup(self.instance, c_int(0), c_double(0), c_double(t), c_int(0), c_double(0))
        status |= self.library.fmi2EnterInitializationMode(self.instance)
        return self._answer(status)

    def end_initialization(self) -> Answer:
        return self._answer(self._function("ExitInitializationMode")(self.instance))

    def step(self, t: float, h: float) -> Answer:
        return self._answer(self.library.fmi2DoStep(self.instance, c_double(t), c_double(h), c_int(1)))

    def save(self) -> bytes:
        """Return the serialized state."""
        state, size = c_void_p(), c_size_t()
        self._function(f"Get{self._STATE}")(self.instance, byref(state))
        self._function(f"Serialized{self._STATE}Size")(self.instance, state, byref(size))
        content = ctypes.create_string_buffer(size.value)
        self._function(f"Serialize{self._STATE}")(self.instance, state, content, size)
        self._function(f"Free{self._STATE}")(self.instance, byref(state))
        return content.raw

    def restore(self, content: bytes) -> Answer:
        state = c_void_p()
        size = c_size_t(len(content))
        deserialize = self._function(f"{self._DESERIALIZE}{self._STATE}")
        status = deserialize(self.instance, content, size, byref(state))
        if status == 0:
            status = self._function(f"Set{self._STATE}")(self.instance, state)
            self._function(f"Free{self._STATE}")(self.instance, byref(state))
        return self._answer(status)


class Native3(Native):
    """Instance of a native library, called by the functions of FMI 3.0."""

    fmi = 3
    _STATE, _DESERIALIZE = "FMUState", "Deserialize"
    _TYPES: ClassVar[dict[str, tuple[str, Any]]] = {
        "Real": ("Float64", c_double),
        "Integer": ("Int32", c_int),
        "Boolean": ("Boolean", c_bool),
        "Enumeration": ("Int64", c_longlong),
    }

    def _instantiate(self, guid: bytes) -> int | None:
        self._logger = _LOGGER_3(self._log_3)
        call = self.library.fmi3InstantiateCoSimulation
        call.restype = c_void_p
        no = c_bool(False)
        made: int | None = call(
            b"native", guid, None, no, no, no, no, None, c_size_t(0), None, self._logger, None
        )
        return made

    def _log_3(self, environment: Any, status: int, category: bytes, text: bytes) -> None:
        self.messages.append(text.decode("utf-8", "replace"))

    def set(self, kind: str, refs: Sequence[int], values: Sequence[Any]) -> Answer:
        name, type = self._TYPES[kind]
        n = len(refs)
        arrays = (c_uint * n)(*(r + 1 for r in refs)), c_size_t(n), (type * n)(*values), c_size_t(n)
        return self._answer(getattr(self.library, f"fmi3Set{name}")(self.instance, *arrays))

    def get(self, refs: Sequence[int]) -> Answer:
        n = len(refs)
        values = (c_double * n)()
        arrays = (c_uint * n)(*(r + 1 for r in refs)), c_size_t(n), values, c_size_t(n)
        return self._answer(self.library.fmi3GetFloat64(self.instance, *arrays), bytes(values))

    def begin(self, t: float) -> Answer:
        no, nothing = c_bool(False), c_double(0)
        enter = self.library.fmi3EnterInitializationMode
        return self._answer(enter(self.instance, no, nothing, c_double(t), no, nothing))

    def step(self, t: float, h: float) -> Answer:
        flags, reached = [c_bool() for _ in range(3)], c_double()
        step = self.library.fmi3DoStep
        done = step(self.instance, c_double(t), c_double(h), c_bool(True), *map(byref, flags), byref(reached))
        return self._answer(done)


class Branches:
    """Branches of a native library, which notes those that are reached."""

    def __init__(self, library: ctypes.CDLL) -> None:
        self.count, self.places = 0, []
        if hasattr(library, "yawbench_branches"):
            count, places = c_int(), ctypes.POINTER(c_char_p)()
            library.yawbench_branches.restype = c_void_p
            self.place = library.yawbench_branches(byref(count), byref(places))
            self.count = count.value
            self.places = [(places[i] or b"").decode()[2:-1] for i in range(count.value)]
        self.compared = bytes(self.count)

    def now(self) -> bytes:
        """Return those that were reached since the last `forget`."""
        return ctypes.string_at(self.place, self.count) if self.count else b""

    def forget(self) -> None:
        if self.count:
            ctypes.memset(self.place, 0, self.count)

    def new(self) -> bool:
        """Return whether some were reached that were not compared."""
        return any(a > b for a, b in zip(self.now(), self.compared, strict=True))

    def keep(self) -> None:
        """Count those that were reached since the last `forget` as compared."""
        self.compared = bytes(a | b for a, b in zip(self.now(), self.compared, strict=True))
        self.forget()


class Twin:
    """Instance of the Python component."""

    def __init__(self, component: type[Any], resources: Path) -> None:
        self.messages: list[str] = []
        messages = self.messages

        def log(
            instance: Any, text: str, status: int = 0, category: str | None = None, debug: object = None
        ) -> None:
            if category != "traceback":
                messages.append(text)

        component.log = log
        self._make: Callable[[], Any] = lambda: component(instance_name="native", resources=str(resources))
        self.instance = self._make()

    def _answer(self, succeeded: Any = True, values: Sequence[float] = ()) -> Answer:
        messages = list(self.messages)
        self.messages.clear()
        return succeeded is not False and not messages, messages, struct.pack(f"{len(values)}d", *values)

    def reset(self) -> Answer:
        self.instance = self._make()
        return self._answer()

    def set(self, kind: str, refs: Sequence[int], values: Sequence[Any]) -> Answer:
        getattr(self.instance, f"set_{kind.replace('Enumeration', 'Integer').lower()}")(
            list(refs), list(values)
        )
        return self._answer()

    def get(self, refs: Sequence[int]) -> Answer:
        values = self.instance.get_real(list(refs))
        return self._answer(values=values)

    def begin(self, t: float) -> Answer:
        self.instance.setup_experiment(t)
        self.instance.enter_initialization_mode()
        return self._answer()

    def end_initialization(self) -> Answer:
        self.instance.exit_initialization_mode()
        return self._answer()

    def step(self, t: float, h: float) -> Answer:
        return self._answer(self.instance.do_step(t, h))

    def save(self) -> bytes | dict[str, Any]:
        """Return the serialized state, or the state itself if it cannot be pickled (a function is in it)."""
        state = self.instance._get_fmu_state()
        return self.instance._fmu_state_to_bytes(state) or state  # type: ignore[no-any-return]

    def restore(self, content: bytes | dict[str, Any]) -> Answer:
        state = self.instance._fmu_state_from_bytes(content) if isinstance(content, bytes) else content
        self.instance._set_fmu_state(state)
        return self._answer()


@dataclass(frozen=True)
class Case:
    """Sequence of calls that a host may make.

    Attributes:
        label: what distinguishes it, for messages.
        settings: type, index and value of parameters that are set after a reset.
        start: start time [s].
        steps: inputs and step size of each step; the first inputs are set before initialization, too.
        early: read outputs, and change inputs, before initialization and before it ends.
        saved: save the state at the end, go on, restore it, and go on again.
        reset: reset before the state is restored.
        wild: inputs so large are among them that integers computed from them may be inexact.
        tuned: parameters that are set after the steps, which are then repeated.
    """

    label: str
    settings: Sequence[tuple[str, int, Any]]
    start: float
    steps: Sequence[tuple[list[float], float]]
    early: bool = False
    saved: bool = False
    reset: bool = False
    wild: bool = False
    tuned: Sequence[tuple[str, int, Any]] = ()


class _Beside:
    """Instances of the library in both versions of FMI, and of the component, called in the same way."""

    def __init__(self, natives: Sequence[Native], twin: Twin, variables: Sequence[Any]) -> None:
        self.natives, self.twin, self.variables = natives, twin, variables
        self.native = natives[0]
        self.of = {
            c: [i for i, v in enumerate(variables) if v.causality == c]
            for c in ("input", "output", "parameter")
        }
        self.label, self.wild = "", False

    def compare(self, case: Case, count: int | None = None) -> None:
        """Make the calls of a case, with `count` of its steps.

        Raises:
            Difference: the answers of the two differ.
        """
        steps = case.steps[:count]
        self.label, self.wild = case.label, case.wild
        self.call("reset")
        if case.early:
            self._read_early(steps)
        for kind, i, value in case.settings:
            self.call("set", kind, [i], [value])
        self._set_inputs(steps[0][0])
        begun = self.call("begin", case.start)
        if case.early:
            self._read_early(steps)
        if begun and self.call("end_initialization") and self._outputs():
            t = self._run(steps, case.start)
            for kind, i, value in case.tuned:
                self.call("set", kind, [i], [value])
            if case.tuned:
                t = self._run(steps, t)
            if case.saved:
                self._restored(case, t)

    def _read_early(self, steps: Sequence[tuple[list[float], float]]) -> None:
        for inputs, _ in steps[:2]:
            self._set_inputs(inputs)
            self._outputs()

    def _set_inputs(self, inputs: list[float]) -> None:
        if inputs:
            self.call("set", "Real", self.of["input"], inputs)

    def _outputs(self) -> bool:
        return self.call("get", self.of["output"])

    def _run(self, steps: Sequence[tuple[list[float], float]], t: float) -> float:
        """Run steps of both until they fail; return the time."""
        for inputs, h in steps:
            self._set_inputs(inputs)
            if not self.call("step", t, h):
                break
            t += h
            self._outputs()
        return t

    def _restored(self, case: Case, t: float) -> None:
        kept = [native.save() for native in self.natives], self.twin.save()
        if not kept[1]:  # Python cannot copy it
            self.twin.messages.clear()
            return
        self._run(case.steps[:FEW], t)
        if case.reset:
            self.call("reset")
        restored = self.twin.restore(kept[1])[0]
        if any(n.restore(k)[0] != restored for n, k in zip(self.natives, kept[0], strict=True)):
            raise Difference(f"{self.label}: a saved state is not restored")
        self._outputs()
        self._run(case.steps[-FEW:], t)

    def call(self, what: str, *args: Any) -> bool:
        """Call both and return whether they succeeded."""
        natives = [getattr(native, what)(*args) for native in self.natives]
        python = getattr(self.twin, what)(*args)
        if self.wild and not natives[0][0] and any(ALONE in text for text in natives[0][1]):
            return False
        for native, instance in zip(natives, self.natives, strict=True):
            if native[0] != python[0] or native[1] != python[1] or not _same(native[2], python[2]):
                by = f"{self.label}: {what}{_shown(args)}" + " by FMI 3.0" * (instance.fmi == 3)
                raise Difference(f"{by}: {self._apart(native, python)}")
        return natives[0][0]  # type: ignore[no-any-return]

    def _apart(self, native: Answer, python: Answer) -> str:
        if native[0] != python[0]:
            did, reason = "succeeds" if native[0] else "fails", (native[1] or python[1])[:1]
            return f"native {did}, Python does not: {reason}"
        if native[1] != python[1]:
            return f"native says {native[1]}, Python {python[1]}"
        for i, (a, b) in enumerate(zip(_numbers(native[2]), _numbers(python[2]), strict=True)):
            if struct.pack("d", a) != struct.pack("d", b):
                name = self.variables[self.of["output"][i]].name
                return f"{name} is {a!r} natively, {b!r} in Python"
        return "values differ"


def _numbers(content: bytes) -> tuple[float, ...]:
    return struct.unpack(f"{len(content) // 8}d", content)


def _same(first: bytes, second: bytes) -> bool:
    return first == second or all(
        struct.pack("d", a) == struct.pack("d", b) or (math.isnan(a) and math.isnan(b))
        for a, b in zip(_numbers(first), _numbers(second), strict=True)
    )


def _shown(args: Sequence[Any]) -> str:
    text = ", ".join(f"{x:.9g}" if isinstance(x, float) else str(x) for x in args)
    return f"({text[:80]}...)" if len(text) > 80 else f"({text})"


def random_inputs(
    variables: Sequence[Any], seed: str, near: Sequence[float] = (), together: float = 0.0
) -> Iterator[list[float]]:
    """Yield inputs endlessly: random walks, jumps and constants in usual, smaller and larger ranges.

    Args:
        variables: of the component.
        seed: of the numbers drawn.
        near: values that are given too, with those of other inputs, and far larger and smaller ones.
        together: share of the turns of an input in which the same signal of the other wheels does the same.
    """
    chance = random.Random(seed)
    names = [v.name for v in variables if v.causality == "input"]
    ranges = list(map(usual_range, names))
    alike = [[k for k, other in enumerate(names) if pattern_of(other) == pattern_of(x)] for x in names]
    now, half, modes = [0.5 * (low + high) for low, high in ranges], [0.0] * len(ranges), [""] * len(ranges)
    turn = chance.choice((0.02, 0.1, 0.5)) if near else 0.01
    while True:
        for i, (low, high) in enumerate(ranges):
            middle = 0.5 * (low + high)
            if not modes[i] or chance.random() < turn:
                modes[i] = chance.choice(
                    ("walk", "jump", "stay", "rest", *(("near", "same", "wide") if near else ()))
                )
                half[i] = 0.5 * (high - low) * chance.choice((0.01, 0.3, 1.0, 1.0, 1.0, 3.0))
                if modes[i] == "rest":
                    now[i] = 0.0
                elif modes[i] == "wide":
                    now[i] = (high - low) * 10.0 ** chance.uniform(-3.0, 3.0) * chance.choice((-1.0, 1.0))
                elif modes[i] == "stay":
                    now[i] = middle + half[i] * chance.uniform(-1.0, 1.0)
                elif modes[i] in ("near", "same"):
                    now[i] = chance.choice(near if modes[i] == "near" else now)
                for k in alike[i] if together and chance.random() < together else ():
                    modes[k], half[k], now[k] = modes[i], half[i], now[i]
            if modes[i] == "walk":
                moved = now[i] + half[i] * chance.gauss(0.0, 0.05)
                now[i] = min(max(moved, middle - half[i]), middle + half[i])
            elif modes[i] == "jump" and chance.random() < 0.3:
                now[i] = middle + half[i] * chance.uniform(-1.0, 1.0)
        yield list(now)


class Cases:
    """Cases of a component, drawn by chance.

    Args:
        component: the Python component.
        thresholds: numbers with which it compares others.
    """

    def __init__(self, component: type[Any], thresholds: Sequence[float]) -> None:
        self.name, self.variables = component.fmu_name, component.variables
        self.parameters = [(i, v) for i, v in enumerate(self.variables) if v.causality == "parameter"]
        self.inputs = sum(v.causality == "input" for v in self.variables)
        self.near = _near(thresholds)
        self.counts = sorted({int(x) for x in thresholds if x == int(x) and EPISODE < x <= LONGEST_EPISODE})

    def usual(self) -> Iterator[Case]:
        """Yield long cases, and one for everything that is compared at least once, else drawn by chance."""
        inputs = random_inputs(self.variables, self.name)

        def steps(h: float, count: int) -> list[tuple[list[float], float]]:
            made = []
            for k in range(count):
                made.append((next(inputs), h))
                if k % 50 == 49:  # another step size, as a host uses at an event
                    made.append((made[-1][0], 0.37 * h))
            return made

        declared = [float(v.start or 0.0) for v in self.variables if v.causality == "input"]
        for h in LENGTHS:
            yield Case(f"steps of {h:g} s", [], 0.0, [(declared, h), *steps(h, STEPS)], saved=True)
        due = [[setting] for setting in self._settings()] + [[]] * MOVED
        few = max(FEWEST, min(FEW, IN_ALL // len(due)))
        for number, settings in enumerate(due):
            chance = random.Random(f"{self.name}, usual {number}")
            label = "".join(f"{self.variables[i].name} = {value!r}, " for _, i, value in settings)
            if not settings:
                label, settings = f"all parameters moved, {number}, ", self._moved(chance)
            start, early = chance.choice((0.25, 0.25, 0.25, 0.25, *STARTS)), number % 5 == 0
            label += f"start at {start:g} s" + ", outputs read before initialization ends" * early
            made = steps(chance.choice(LENGTHS), few)
            tuned = self._tuned(chance) if number % 3 == 0 else []
            saved, reset = number % 4 == 0, number % 8 == 0
            yield Case(label, settings, start, made, early, saved=saved, reset=reset, tuned=tuned)
        for k in range(self.inputs):
            for value in EXTREME:
                made = steps(LENGTHS[0], 4)
                last = [*made[-1][0][:k], value, *made[-1][0][k + 1 :]]
                made = [*made[:-1], (last, LENGTHS[0]), (last, LENGTHS[0])]
                yield Case(f"input {k} = {value}", [], 0.0, made, wild=True)

    def _settings(self) -> Iterator[tuple[str, int, Any]]:
        """Yield values of each parameter: every choice, changed numbers, and what is out of range."""
        for i, v in self.parameters:
            values, wrong = _values(v)
            few = v.type == "Real" and len(self.parameters) > MANY
            yield from ((v.fmi_type, i, x) for x in ([*values[:1], *wrong] if few else [*values, *wrong]))

    def _tuned(self, chance: random.Random) -> list[tuple[str, int, Any]]:
        """Return values of the tunable parameters, some of them wrong now and then."""
        tunable = [(i, v) for i, v in self.parameters if v.variability == "tunable"]
        return [("Real", i, chance.choice((1.25, 0.6, 0.6, -1.0)) * v.start) for i, v in tunable]

    def _moved(self, chance: random.Random) -> list[tuple[str, int, Any]]:
        """Return values of all real parameters near their defaults, and choices of all others."""
        moved: list[tuple[str, int, Any]] = []
        for i, v in self.parameters:
            if v.type == "Real":
                moved.append(("Real", i, v.start * chance.uniform(0.8, 1.25)))
            elif v.type != "Integer":
                moved.append((v.fmi_type, i, chance.choice(_values(v)[0])))
        return moved

    def searched(self) -> Iterator[Case]:
        """Yield cases with inputs of all kinds, endlessly; every text of a choice is chosen in turn.

        In every second case parameters are switched off, and wheels do the same.
        """
        for number in itertools.count():
            chance = random.Random(f"{self.name} {number}")
            turn, odd = divmod(number, 2)
            long = self.counts[turn] + AFTER if not odd and turn < len(self.counts) else EPISODE
            yield self._wild(f"found by searching, {number + 1}", number, chance, long)
            chance = random.Random(f"{self.name} {number}, off")
            yield self._wild(f"found by switching off, {number + 1}", number, chance, EPISODE, off=True)

    def _wild(self, label: str, number: int, chance: random.Random, count: int, *, off: bool = False) -> Case:
        moved = chance.sample(self.parameters, min(len(self.parameters), chance.choice((0, 1, 2, 4))))
        settings = [(v.fmi_type, i, self._value(v, chance)) for i, v in moved]
        settings += [("Enumeration", i, 1 + number % len(v.choices)) for i, v in self.parameters if v.choices]
        if chance.random() < 0.5:  # what is off by default is switched on
            size = [chance.choice((1.0, -1.0)) * 10.0 ** chance.uniform(-2.0, 4.0) for _ in self.parameters]
            reals = [(i, v, x) for (i, v), x in zip(self.parameters, size, strict=True) if v.type == "Real"]
            settings += [
                ("Real", i, _within(v, x)) for i, v, x in reals if v.start == 0.0 and chance.random() < 0.6
            ]
        share = chance.choice(OFF) if off else 0.0
        settings += [
            ("Real", i, _within(v, 0.0))
            for i, v in self.parameters
            if off and v.type == "Real" and chance.random() < share
        ]
        h = chance.choice((*LENGTHS, *LENGTHS, 1e-4, 0.1))
        times = [*self.near, *(float(x) for kind, _, x in settings if kind in ("Real", "Integer"))]
        start = chance.choice((0.0, 0.0, *STARTS, *[x - 10.3 * h for x in times if 0.0 < x < 1e6]))
        short = [1e-9, 0.37 * h, *(x for x in self.near if 0.0 < x < 1.0)]  # at events and at the end
        inputs = random_inputs(self.variables, f"{self.name} {number}", self.near, TOGETHER * off)
        steps = [(next(inputs), chance.choice(short) if chance.random() < 0.03 else h) for _ in range(count)]
        return Case(label, settings, start, steps, wild=True)

    def _value(self, v: Any, chance: random.Random) -> Any:
        """Return a value of a parameter, at its limits or near a threshold."""
        values, _ = _values(v)
        if v.type in ("Real", "Integer"):
            # far less may mean very many samples
            values = [*values, *(x for x in self.near if abs(x) >= 0.1 * abs(v.start))]
        value = chance.choice(values)
        if v.type in ("Real", "Integer") and (_within(v, value) != value or abs(value) > 1e9):
            value = v.start
        return int(value) if v.type == "Integer" else value


def _values(v: Any) -> tuple[list[Any], list[Any]]:
    """Return values of a parameter, which may lie outside its limits, and some that are wrong."""
    limits = [x for x in (v.minimum, v.maximum) if x is not None and abs(x) < 1e30]
    if v.choices is not None:
        return list(range(1, 1 + len(v.choices))), [0, 1 + len(v.choices)]
    if v.type == "Boolean":
        return [True, False], []
    if v.type == "Integer":
        return [v.start + 1, max(v.start * 7, 12345)], [-1]
    values = [v.start * 1.25 + 0.01, v.start * 0.6, 0.0, -1.0, *limits]
    return values, [] if v.minimum is None else [v.minimum - 1.0]


def _near(thresholds: Sequence[float]) -> list[float]:
    """Return numbers at, before and beyond thresholds, of both signs."""
    found = dict.fromkeys([0.0, 1.0])
    for x in dict.fromkeys(thresholds):
        for near in (x, math.nextafter(x, math.inf), math.nextafter(x, -math.inf), 1.01 * x, 0.99 * x):
            found |= dict.fromkeys((near, -near))
        found |= dict.fromkeys((x + 1.0, x - 1.0, 2.0 * x, 0.5 * x))
    return list(found)


def _within(v: Any, value: float) -> float:
    """Return a number moved between the limits of a parameter."""
    low = -math.inf if v.minimum is None else v.minimum
    high = math.inf if v.maximum is None else v.maximum
    return float(min(max(abs(value) if low >= 0.0 else value, low), high))


def compare(
    library: Path,
    guid: str,
    component: type[Any],
    resources: Path,
    thresholds: Sequence[float] = (),
    told: Callable[[Branches], None] = lambda branches: None,
) -> Branches:
    """Compare a native library with its Python component in all cases, and return its branches.

    Args:
        library, guid: of the native library.
        component, resources: of the Python component.
        thresholds: numbers with which it compares others.
        told: called before cases are searched, and after each that was found.

    Raises:
        Difference: the first difference.
    """
    natives = Native(library, guid), Native3(library, guid)
    beside = _Beside(natives, Twin(component, resources), component.variables)
    branches, cases = Branches(beside.native.library), Cases(component, thresholds)
    branches.forget()
    for case in cases.usual():
        beside.compare(case)
    branches.keep()
    if 0 in branches.compared:
        told(branches)
        _search(beside, branches, cases, told)
    return branches


def _search(beside: _Beside, branches: Branches, cases: Cases, told: Callable[[Branches], None]) -> None:
    """Search cases that reach further branches of the native library, and compare them."""
    left, last, found = SEARCH, 0, 0
    patience = max(PATIENCE, 2 * len(cases.counts))
    for number, case in enumerate(cases.searched()):
        if left <= 0 or found >= MOST_FOUND or 0 not in branches.compared or number - last >= patience:
            return
        taken, needed = _natively(beside, branches, case)
        left -= taken + 20  # the calls before the first step take as long
        if needed:
            last, found = number + 1, found + 1
            beside.compare(case, needed + AFTER)
            branches.keep()
            told(branches)


def _natively(beside: _Beside, branches: Branches, case: Case) -> tuple[int, int]:
    """Run a case in the native library; return its steps, and those until its last new branch, 0 if none."""
    native, of = beside.native, beside.of
    library, instance = native.library, native.instance
    branches.forget()
    native.reset()
    for kind, i, value in case.settings:
        native.set(kind, [i], [value])
    n = len(of["input"])
    refs, values, count = (c_uint * n)(*of["input"]), (c_double * n)(), c_size_t(n)
    values[:] = case.steps[0][0]  # type: ignore[assignment]
    library.fmi2SetReal(instance, refs, count, values)
    begun = native.begin(case.start)[0] and native.end_initialization()[0]
    last = branches.now()
    t, taken, needed = case.start, 0, int(branches.new())
    for taken, (inputs, h) in enumerate(case.steps if begun else (), start=1):
        values[:] = inputs  # type: ignore[assignment]
        library.fmi2SetReal(instance, refs, count, values)
        failed = library.fmi2DoStep(instance, c_double(t), c_double(h), 1)
        t += h
        now = branches.now()
        if now != last:
            if any(a > b and not c for a, b, c in zip(now, branches.compared, last, strict=True)):
                needed = taken
            last = now
        if failed:
            break
    native.messages.clear()
    branches.forget()
    return taken, needed


def differences(
    library: Path,
    guid: str,
    component: type[Any],
    resources: Path,
    thresholds: Sequence[float] = (),
    limit: int = LIMIT,
) -> Compared:
    """Compare a native library with its component, in another process.

    Args:
        library, guid: of the native library.
        component, resources: of the Python component.
        thresholds: numbers with which it compares others.
        limit: largest processor time [s].

    Raises:
        TimeoutError: the comparison takes longer.
    """
    import resource  # POSIX only, as os.fork

    reading, writing = os.pipe()
    child = os.fork()
    if child == 0:
        answers = open(writing, "w", encoding="utf-8", buffering=1)  # noqa: SIM115 - until the process ends

        def tell(*made: Any) -> None:
            answers.write(json.dumps(made) + "\n")

        def told(branches: Branches) -> None:
            tell("", branches.compared.hex(), branches.places)
            most = int(sum(os.times()[:2])) + SEARCH_SECONDS
            least, _ = resource.getrlimit(resource.RLIMIT_CPU)
            resource.setrlimit(resource.RLIMIT_CPU, (min(most, least), limit + 1))

        try:
            os.close(reading)
            resource.setrlimit(resource.RLIMIT_CPU, (limit, limit + 1))
            branches = compare(library, guid, component, resources, thresholds, told=told)
            tell("", branches.compared.hex(), branches.places)
        except Difference as difference:
            tell(str(difference)[:4000])
        except BaseException as error:
            tell(f"{type(error).__name__}: {error}"[:4000])
        finally:
            os._exit(0)
    os.close(writing)
    with open(reading, encoding="utf-8") as answers:
        content = answers.read()
    _, status = os.waitpid(child, 0)
    died = os.WTERMSIG(status) if os.WIFSIGNALED(status) else 0
    if content and died in (0, signal.SIGXCPU, signal.SIGKILL):
        # the last line: that of the last case, if the search does not end
        said, *rest = json.loads(content.splitlines()[-1])
        if said or not rest:
            return Compared(said)
        reached = bytes.fromhex(rest[0])
        untried = [place for place, compared in zip(rest[1], reached, strict=True) if place and not compared]
        return Compared("", reached, tuple(dict.fromkeys(untried)))
    if died in (signal.SIGXCPU, signal.SIGKILL):
        raise TimeoutError(f"the comparison with Python takes more than {limit} s of processor time")
    return Compared(f"it dies of signal {died}")


__all__ = ["Compared", "Difference", "compare", "differences", "random_inputs"]
