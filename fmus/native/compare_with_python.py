"""Bitwise comparison of a native library with its Python component under the same sequence of calls.

Both run 2,000 steps at each of three step sizes, with inputs in their usual ranges, a hundredth and three
times these ranges; with every choice of parameters and with changed parameters; with reset, a second start,
saved, restored and serialized states; with outputs read, and parameters changed, before initialization ends;
from other start times; with parameters out of range and inputs that are not finite. Values,
statuses and messages must be the same, except that for huge inputs a native library may refuse to compute an
integer of 2^53 or more. All NaNs are equal.
"""

from __future__ import annotations

import ctypes
import math
import os
import random
import signal
import struct
from collections.abc import Callable, Iterator, Sequence
from ctypes import CFUNCTYPE, byref, c_char_p, c_double, c_int, c_size_t, c_uint, c_void_p
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
_LOGGER = CFUNCTYPE(None, c_void_p, c_char_p, c_int, c_char_p, c_char_p)


class _Callbacks(ctypes.Structure):
    _fields_ = (
        ("logger", _LOGGER),
        *((name, c_void_p) for name in ("allocate", "free", "finished", "environment")),
    )


class Difference(Exception):
    """Error: a difference between a native library and its Python component."""


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


def compare(library: Path, guid: str, component: type[Any], resources: Path, steps: int = STEPS) -> None:
    """Compare a native library with its Python component in all cases.

    Raises:
        Difference: the first difference.
    """
    variables = component.variables
    beside = _Beside(Native(library, guid), Twin(component, resources), variables)
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


def differences(library: Path, guid: str, component: type[Any], resources: Path, limit: int = LIMIT) -> str:
    """Return the first difference between a native library and its component, "" if none; in another process.

    Args:
        library, guid: of the native library.
        component, resources: of the Python component.
        limit: largest processor time [s].

    Raises:
        TimeoutError: the comparison takes longer.
    """
    import resource  # POSIX only, as os.fork

    reading, writing = os.pipe()
    child = os.fork()
    if child == 0:
        text = "the comparison ends"
        try:
            os.close(reading)
            resource.setrlimit(resource.RLIMIT_CPU, (limit, limit + 1))
            compare(library, guid, component, resources)
            text = ""
        except Difference as difference:
            text = str(difference)
        except BaseException as error:
            text = f"{type(error).__name__}: {error}"
        finally:
            os.write(writing, b"." + text.encode()[:4000])
            os._exit(0)
    os.close(writing)
    with open(reading, "rb") as answers:
        content = answers.read()
    _, status = os.waitpid(child, 0)
    if content:
        return content[1:].decode("utf-8", "replace")
    if os.WTERMSIG(status) in (signal.SIGXCPU, signal.SIGKILL):
        raise TimeoutError(f"the comparison with Python takes more than {limit} s of processor time")
    return f"it dies of signal {os.WTERMSIG(status)}"


__all__ = ["Difference", "compare", "differences", "random_inputs"]
