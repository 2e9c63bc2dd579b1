"""Bitwise comparison of a native library with its Python component under the same sequence of calls.

The library notes which of its branches are reached. Inputs for the others are searched in the library alone,
which is fast, and what reaches more of them is compared as well (`_search`).

Both run 2,000 steps at each of three step sizes, with inputs in their usual ranges, a hundredth and three
times these ranges; with every choice of parameters and with changed parameters; with reset, a second start,
saved, restored and serialized states; with outputs read, and parameters changed, before initialization ends;
from other start times; with parameters out of range and inputs that are not finite. Values,
statuses and messages must be the same, except that for huge inputs a native library may refuse to compute an
integer of 2^53 or more. All NaNs are equal.
"""

from __future__ import annotations

import ctypes
import json
import math
import os
import random
import signal
import struct
from collections.abc import Callable, Iterator, Sequence
from ctypes import CFUNCTYPE, byref, c_char_p, c_double, c_int, c_size_t, c_uint, c_void_p
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..usual_ranges import usual_range
from .ir import ALONE

STEPS = 2000
LENGTHS = (0.001, 0.005, 0.02)
"""Step sizes [s]: those of plants, controllers and sensors."""
FEW, FEWEST, IN_ALL = 100, 2, 3000
"""Steps per other value of a parameter, at most and at least, and approximate number for all values."""
STARTS = (-1.0, 3600.0)
"""Further start times [s]."""
MANY = 60
"""Number of numeric parameters above which each is changed only once."""
ALL_MOVED = "all parameters moved"
LIMIT = 240
"""Largest processor time [s] of a comparison, since a wrongly translated loop may never end."""
SEARCH, EPISODE, LONGEST_EPISODE = 120_000, 150, 50_000
"""Steps of the search for branches that were not reached, of one try, and at most of one; chosen: the search
takes half a second, as long as the comparison, and a controller is followed for 50,000 samples."""
PATIENCE = 100
"""Tries in a row that reach nothing new, after which the search ends; chosen: a tenth of a second."""
SEARCH_SECONDS = 5
"""Processor time [s] after which a search is given up: with odd parameters a unit may sample without end."""
MOST_FOUND = 15
"""Largest number of tries that are compared; chosen: a start of the slowest component takes half a second."""
AFTER = 60
"""Steps of a comparison after the last new branch was reached, in which what the branch did shows."""
_LOGGER = CFUNCTYPE(None, c_void_p, c_char_p, c_int, c_char_p, c_char_p)


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
    """Instance of a native library."""

    def __init__(self, library: Path, guid: str) -> None:
        self.library = ctypes.CDLL(str(library))
        self.library.fmi2Instantiate.restype = c_void_p
        self.messages: list[str] = []
        self._callbacks = _Callbacks(_LOGGER(self._log))
        call = self.library.fmi2Instantiate
        made = call(b"native", c_int(1), guid.encode(), None, byref(self._callbacks), c_int(0), c_int(0))
        if made is None:
            raise Difference(f"the native library does not start: {'; '.join(self.messages)}")
        self.instance = c_void_p(made)

    def _log(self, environment: Any, name: bytes, status: int, category: bytes, text: bytes) -> None:
        self.messages.append(text.decode("utf-8", "replace").replace("%%", "%"))

    def _answer(self, status: int, values: bytes = b"") -> Answer:
        messages, self.messages = self.messages, []
        return status == 0, messages, values

    def reset(self) -> Answer:
        return self._answer(self.library.fmi2Reset(self.instance))

    def set(self, kind: str, refs: Sequence[int], values: Sequence[Any]) -> Answer:
        type: Any = {"Real": c_double, "String": c_char_p}.get(kind, c_int)
        encoded = [v.encode() if isinstance(v, str) else v for v in values]
        call = getattr(self.library, f"fmi2Set{kind}")
        n = len(refs)
        return self._answer(call(self.instance, (c_uint * n)(*refs), c_size_t(n), (type * n)(*encoded)))

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
        return self._answer(self.library.fmi2ExitInitializationMode(self.instance))

    def step(self, t: float, h: float) -> Answer:
        return self._answer(self.library.fmi2DoStep(self.instance, c_double(t), c_double(h), c_int(1)))

    def save(self) -> bytes:
        """Return the serialized state."""
        state, size = c_void_p(), c_size_t()
        self.library.fmi2GetFMUstate(self.instance, byref(state))
        self.library.fmi2SerializedFMUstateSize(self.instance, state, byref(size))
        content = ctypes.create_string_buffer(size.value)
        self.library.fmi2SerializeFMUstate(self.instance, state, content, size)
        self.library.fmi2FreeFMUstate(self.instance, byref(state))
        return content.raw

    def restore(self, content: bytes) -> Answer:
        state = c_void_p()
        size = c_size_t(len(content))
        status = self.library.fmi2DeSerializeFMUstate(self.instance, content, size, byref(state))
        if status == 0:
            status = self.library.fmi2SetFMUstate(self.instance, state)
            self.library.fmi2FreeFMUstate(self.instance, byref(state))
        return self._answer(status)


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
        getattr(self.instance, f"set_{kind.lower()}")(list(refs), list(values))
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


class _Beside:
    """Both instances, called in the same way."""

    def __init__(self, native: Native, twin: Twin, variables: Sequence[Any]) -> None:
        self.native, self.twin, self.variables = native, twin, variables
        self.of = {
            c: [i for i, v in enumerate(variables) if v.causality == c]
            for c in ("input", "output", "parameter")
        }
        self.label = ""
        self.extreme = False  # whether inputs are so large that integers computed from them may be inexact

    def call(self, what: str, *args: Any) -> bool:
        """Call both and return whether they succeeded."""
        native, python = getattr(self.native, what)(*args), getattr(self.twin, what)(*args)
        if self.extreme and not native[0] and any(ALONE in text for text in native[1]):
            return False
        if native[0] != python[0] or native[1] != python[1] or not _same(native[2], python[2]):
            raise Difference(f"{self.label}{what}{_shown(args)}: {self._apart(native, python)}")
        return native[0]  # type: ignore[no-any-return]

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

    def start(
        self,
        chosen: Callable[[], None],
        t: float,
        inputs: Sequence[float],
        early: Iterator[list[float]] | None = None,
    ) -> bool:
        """Reset both, set parameters, and start; with `early` inputs, read outputs while initializing."""
        self.call("reset")
        if early:
            self._read_early(early)
        chosen()
        if inputs:
            self.call("set", "Real", self.of["input"], inputs)
        begun = self.call("begin", t)
        if early:
            self._read_early(early)
        return begun and self.call("end_initialization") and self.outputs()

    def _read_early(self, inputs: Iterator[list[float]]) -> None:
        for _ in range(2):
            if self.of["input"]:
                self.call("set", "Real", self.of["input"], next(inputs))
            self.outputs()

    def outputs(self) -> bool:
        return self.call("get", self.of["output"])

    def steps(self, count: int, h: float, inputs: Iterator[list[float]], t: float) -> float:
        """Run steps of both until they fail; return the time."""
        for k in range(count):
            if self.of["input"]:
                self.call("set", "Real", self.of["input"], next(inputs))
            if not self.call("step", t, h):
                break
            t += h
            self.outputs()
            if k % 50 == 49:  # another step size, as a host uses at an event
                self.call("step", t, 0.37 * h)
                t += 0.37 * h
        return t


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


def random_inputs(variables: Sequence[Any], seed: str) -> Iterator[list[float]]:
    """Yield inputs endlessly: random walks, jumps and constants in usual, smaller and larger ranges."""
    chance = random.Random(seed)
    ranges = [usual_range(v.name) for v in variables if v.causality == "input"]
    now = [0.5 * (low + high) for low, high in ranges]
    scale, kind = 1.0, "walk"
    while True:
        if chance.random() < 0.01:
            scale = chance.choice((0.01, 0.3, 1.0, 1.0, 1.0, 3.0))
            kind = chance.choice(("walk", "walk", "jump", "stay", "rest"))
        for i, (low, high) in enumerate(ranges):
            middle, half = 0.5 * (low + high), 0.5 * (high - low) * scale
            if kind == "walk":
                moved = now[i] + half * chance.gauss(0.0, 0.05)
                now[i] = min(max(moved, middle - half), middle + half)
            elif kind == "jump" and chance.random() < 0.3:
                now[i] = middle + half * chance.uniform(-1.0, 1.0)
            elif kind == "rest":
                now[i] = 0.0
        yield list(now)


def compare(
    library: Path,
    guid: str,
    component: type[Any],
    resources: Path,
    thresholds: Sequence[float] = (),
    steps: int = STEPS,
    usual: Callable[[Branches], None] = lambda branches: None,
) -> Branches:
    """Compare a native library with its Python component in all cases, and return its branches.

    Args:
        library, guid: of the native library.
        component, resources: of the Python component.
        thresholds: numbers with which it compares others.
        steps: number of steps at each step size.
        usual: called after the comparison with usual inputs, before others are searched.

    Raises:
        Difference: the first difference.
    """
    beside = _Beside(Native(library, guid), Twin(component, resources), component.variables)
    branches = Branches(beside.native.library)
    branches.forget()
    _compare_usual(beside, component, steps)
    branches.keep()
    if 0 in branches.compared:
        usual(branches)
        _search(beside, branches, component, thresholds)
    return branches


def _compare_usual(beside: _Beside, component: type[Any], steps: int) -> None:
    variables = beside.variables
    inputs = random_inputs(variables, component.fmu_name)
    first = [0.0 if v.start is None else float(v.start) for v in variables if v.causality == "input"]

    def unchanged() -> None:
        return None

    for h in LENGTHS:
        beside.label = f"steps of {h:g} s: "
        if beside.start(unchanged, 0.0, first):
            t = beside.steps(steps, h, inputs, 0.0)
            _restored(beside, inputs, h, t, FEW)
    for start in STARTS:
        beside.label = f"start at {start:g} s: "
        if beside.start(unchanged, start, first):
            beside.steps(FEW, LENGTHS[0], inputs, start)
    settings = [*_choices(beside, variables), *_all_moved(beside, variables)]
    few = max(FEWEST, min(FEW, IN_ALL // max(len(settings), 1)))
    for label, choose in settings:
        beside.label = f"{label}: "
        if beside.start(choose, 0.25, next(inputs)):
            h = random.Random(label).choice(LENGTHS)
            t = beside.steps(few, h, inputs, 0.25)
            if label.startswith(ALL_MOVED):
                _restored(beside, inputs, h, t, few, reset=True)
    for label, choose in [("", unchanged), *_all_moved(beside, variables)][:2]:
        beside.label = f"{label and label + ', '}outputs read before initialization ends: "
        beside.start(choose, 0.25, next(inputs), inputs)
        beside.steps(few, LENGTHS[0], inputs, 0.25)
    for i in beside.of["input"]:
        for value in (math.nan, math.inf, -math.inf, 1e300, -0.0):
            beside.label = f"{variables[i].name} = {value}: "
            if beside.start(unchanged, 0.0, first):
                t = beside.steps(3, 0.001, inputs, 0.0)
                beside.extreme = True
                beside.call("set", "Real", [i], [value])
                if beside.call("step", t, 0.001):
                    beside.outputs()
                    beside.call("step", t + 0.001, 0.001)
                beside.extreme = False


def _restored(
    beside: _Beside, inputs: Iterator[list[float]], h: float, t: float, count: int, *, reset: bool = False
) -> None:
    """Save both states, continue, optionally reset, restore and continue from there."""
    kept = beside.native.save(), beside.twin.save()
    if not kept[1]:  # Python cannot copy it
        beside.twin.messages.clear()
        return
    beside.steps(count, h, inputs, t)
    if reset:
        beside.call("reset")
    if beside.native.restore(kept[0])[0] != beside.twin.restore(kept[1])[0]:
        raise Difference("a saved state is not restored")
    beside.outputs()
    beside.steps(count, h, inputs, t)


def _choices(beside: _Beside, variables: Sequence[Any]) -> Iterator[tuple[str, Callable[[], None]]]:
    """Yield settings of one parameter: every choice, every number changed, and values out of range."""
    many = len(beside.of["parameter"]) > MANY
    for i in beside.of["parameter"]:
        v = variables[i]
        if v.type == "String":
            values: list[Any] = [*v.choices, "none of them"]
        elif v.type == "Boolean":
            values = [True, False]
        elif v.type == "Integer":
            values = [v.start + 1, max(v.start * 7, 12345), -1]
        else:
            values = [v.start * 1.25 + 0.01]
            if many:
                values += [v.minimum - 1.0] if v.minimum is not None else []
            else:
                values += [v.start * 0.6, 0.0, -1.0]
                values += [x for x in (v.minimum, v.maximum) if x is not None and abs(x) < 1e30]
        for value in values:
            yield f"{v.name} = {value!r}", lambda i=i, k=v.type, x=value: beside.call("set", k, [i], [x])  # type: ignore


def _all_moved(beside: _Beside, variables: Sequence[Any]) -> Iterator[tuple[str, Callable[[], None]]]:
    """Yield settings of all parameters at once, at random near their defaults."""
    reals = [i for i in beside.of["parameter"] if variables[i].type == "Real"]
    others = [i for i in beside.of["parameter"] if variables[i].choices or variables[i].type == "Boolean"]
    for k in range(20):

        def choose(seed: int = k) -> None:
            own = random.Random(seed)
            if reals:
                beside.call(
                    "set", "Real", reals, [variables[i].start * own.uniform(0.8, 1.25) for i in reals]
                )
            for i in others:
                v = variables[i]
                beside.call("set", v.type, [i], [own.choice(v.choices or (True, False))])

        yield f"{ALL_MOVED}, {k}", choose


@dataclass(frozen=True)
class _Try:
    """Sequence of calls: parameters that are set, start time, inputs and step sizes, one per step."""

    settings: list[tuple[str, int, Any]]
    start: float
    first: list[float]
    steps: list[tuple[list[float], float]]


def _search(beside: _Beside, branches: Branches, component: type[Any], thresholds: Sequence[float]) -> None:
    """Search inputs that reach further branches of the native library, and compare them."""
    left, number, last, found = SEARCH, 0, 0, 0
    near = _near(thresholds)
    counts = sorted({int(x) for x in thresholds if x == int(x) and EPISODE < x <= LONGEST_EPISODE})
    patience = max(PATIENCE, 2 * len(counts))
    while left > 0 and found < MOST_FOUND and 0 in branches.compared and number - last < patience:
        chance = random.Random(f"{component.fmu_name} {number}")
        long = counts[number // 2] if number % 2 == 0 and number // 2 < len(counts) else 0
        attempt = _attempt(beside, chance, near, long + AFTER if long else EPISODE)
        number += 1
        taken, needed = _try_natively(beside, branches, attempt)
        left -= taken + 20  # the calls before the first step take as long
        if needed:
            last, found = number, found + 1
            beside.label = f"found by searching, {number}: "
            _compare_try(beside, attempt, needed + AFTER)
            branches.keep()


def _near(thresholds: Sequence[float]) -> list[float]:
    """Return numbers at, before and beyond thresholds, of both signs."""
    found = dict.fromkeys([0.0, 1.0])
    for x in dict.fromkeys(thresholds):
        for near in (x, math.nextafter(x, math.inf), math.nextafter(x, -math.inf), 1.01 * x, 0.99 * x):
            found |= dict.fromkeys((near, -near))
        found |= dict.fromkeys((x + 1.0, x - 1.0, 2.0 * x, 0.5 * x))
    return list(found)


def _attempt(beside: _Beside, chance: random.Random, near: list[float], count: int) -> _Try:
    variables = beside.variables
    parameters = beside.of["parameter"]
    moved = chance.sample(parameters, min(len(parameters), chance.choice((0, 0, 1, 2))))
    settings = [(variables[i].type, i, _parameter(variables[i], chance, near)) for i in moved]
    if chance.random() < 0.5:  # what is off by default is switched on
        off = [i for i in parameters if variables[i].type == "Real" and variables[i].start == 0.0]
        settings += [
            ("Real", i, _within(variables[i], chance.choice((1.0, -1.0)) * 10.0 ** chance.uniform(-2.0, 4.0)))
            for i in off
            if chance.random() < 0.6
        ]
    ranges = [usual_range(variables[i].name) for i in beside.of["input"]]
    modes, now = [""] * len(ranges), [0.5 * (low + high) for low, high in ranges]
    h = chance.choice((*LENGTHS, *LENGTHS, 1e-4, 0.1))
    times = [*near, *(float(x) for kind, _, x in settings if kind in ("Real", "Integer"))]
    start = chance.choice((0.0, 0.0, *STARTS, *[x - 10.3 * h for x in times if 0.0 < x < 1e6]))
    short = [1e-9, 0.37 * h, *(x for x in near if 0.0 < x < 1.0)]  # as hosts make at events and at the end
    steps = []
    turn = chance.choice((0.02, 0.1, 0.5))
    for k in range(count):
        for i, (low, high) in enumerate(ranges):
            if k == 0 or chance.random() < turn:
                modes[i] = chance.choice(("near", "usual", "wide", "walk", "rest", "same"))
                if modes[i] == "near":
                    now[i] = chance.choice(near)
                elif modes[i] == "usual":
                    now[i] = chance.uniform(low, high)
                elif modes[i] == "wide":
                    now[i] = (high - low) * 10.0 ** chance.uniform(-3.0, 3.0) * chance.choice((-1.0, 1.0))
                elif modes[i] == "rest":
                    now[i] = 0.0
                elif modes[i] == "same":
                    now[i] = chance.choice(now)
            elif modes[i] == "walk":
                now[i] += 0.05 * (high - low) * chance.uniform(-1.0, 1.0)
        steps.append((list(now), chance.choice(short) if chance.random() < 0.03 else h))
    return _Try(settings, start, list(steps[0][0]), steps)


def _within(v: Any, value: float) -> float:
    low, high = (
        (-math.inf if v.minimum is None else v.minimum),
        (math.inf if v.maximum is None else v.maximum),
    )
    return float(min(max(abs(value) if low >= 0.0 else value, low), high))


def _parameter(v: Any, chance: random.Random, near: list[float]) -> Any:
    if v.type == "String":
        return chance.choice(v.choices)
    if v.type == "Boolean":
        return chance.random() < 0.5
    low, high = v.minimum, v.maximum
    values = [0.0, 0.6 * v.start, 1.25 * v.start, *(x for x in (low, high) if x is not None)]
    values += [x for x in near if abs(x) >= 0.1 * abs(v.start)]  # far less may mean very many samples
    value = chance.choice(values)
    if not (low is None or value >= low) or not (high is None or value <= high) or abs(value) > 1e9:
        value = v.start
    return int(value) if v.type == "Integer" else float(value)


def _try_natively(beside: _Beside, branches: Branches, attempt: _Try) -> tuple[int, int]:
    """Run a try in the native library; return its steps, and those until its last new branch, 0 if none."""
    native, of = beside.native, beside.of
    library, instance = native.library, native.instance
    branches.forget()
    native.reset()
    for kind, i, value in attempt.settings:
        native.set(kind, [i], [value])
    n = len(of["input"])
    refs, values, count = (c_uint * n)(*of["input"]), (c_double * n)(), c_size_t(n)
    values[:] = attempt.first  # type: ignore[assignment]
    library.fmi2SetReal(instance, refs, count, values)
    begun = native.begin(attempt.start)[0] and native.end_initialization()[0]
    before, needed, taken = branches.compared, 0, 0
    now = branches.now()
    if any(a > b for a, b in zip(now, before, strict=True)):
        needed = 1
    t, last = attempt.start, now
    for taken, (inputs, h) in enumerate(attempt.steps if begun else (), start=1):
        values[:] = inputs  # type: ignore[assignment]
        library.fmi2SetReal(instance, refs, count, values)
        failed = library.fmi2DoStep(instance, c_double(t), c_double(h), 1)
        t += h
        now = branches.now()
        if now != last:
            if any(a > b and not c for a, b, c in zip(now, before, last, strict=True)):
                needed = taken
            last = now
        if failed:
            break
    native.messages.clear()
    branches.forget()
    return taken, needed


def _compare_try(beside: _Beside, attempt: _Try, count: int) -> None:
    def chosen() -> None:
        for kind, i, value in attempt.settings:
            beside.call("set", kind, [i], [value])

    beside.extreme = True
    if beside.start(chosen, attempt.start, attempt.first):
        t = attempt.start
        for inputs, h in attempt.steps[:count]:
            if beside.of["input"]:
                beside.call("set", "Real", beside.of["input"], inputs)
            if not beside.call("step", t, h):
                break
            t += h
            beside.outputs()
    beside.extreme = False


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

        def before_search(branches: Branches) -> None:
            tell("", branches.compared.hex(), branches.places)
            most = int(sum(os.times()[:2])) + SEARCH_SECONDS
            resource.setrlimit(resource.RLIMIT_CPU, (min(most, limit), limit + 1))

        try:
            os.close(reading)
            resource.setrlimit(resource.RLIMIT_CPU, (limit, limit + 1))
            branches = compare(library, guid, component, resources, thresholds, usual=before_search)
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
        # the last line: that before the search, if the search does not end
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
