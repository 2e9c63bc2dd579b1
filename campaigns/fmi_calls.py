"""Calls of FMI 2.0, right and wrong ones, and a host that makes them and notes every answer."""

from __future__ import annotations

import ctypes
import random
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tests.fmus.bare import LOGGER, OK, TYPES, Callbacks, Fmu

LOCATIONS: dict[str, Callable[[Path], str]] = {
    "URI": lambda folder: folder.as_uri(),
    "URI of one slash": lambda folder: folder.as_uri().replace("file://", "file:"),
    "URI with a host": lambda folder: folder.as_uri().replace("file://", "file://localhost"),
    "URI with a slash behind": lambda folder: folder.as_uri() + "/",
    "path": str,
}
"""Ways to say where the resources are."""
ALTERED = ("none", "cut", "random", "longer", "empty")
"""Ways to alter the bytes of a state."""
OURS = "ours"
"""Stands for the GUID of the unit."""
STATUS_TYPES = {"Real": ctypes.c_double, "String": ctypes.c_char_p}


class Host:
    """One library of a unit, its instances, and what it was given of them; all by numbers.

    Attributes:
        instances: number -> instance.
        states: number -> saved state.
        owners: number of a state -> number of the instance that it is of.
        serialized: number -> bytes of a state.
    """

    def __init__(self, folder: Path) -> None:
        self.fmu = Fmu(folder)
        self.instances: dict[int, ctypes.c_void_p] = {}
        self.states: dict[int, ctypes.c_void_p] = {}
        self.owners: dict[int, int] = {}
        self.serialized: dict[int, bytes] = {}
        self._log: list[tuple[Any, ...]] = []
        self._callbacks = Callbacks(logger=LOGGER(self._note))
        self._silent = Callbacks()
        self.answer(New(0))  # the launcher decides at the first instance how it runs
        self.answer(Free(0))

    def _note(self, _: Any, instance: bytes, status: int, category: bytes, message: bytes) -> None:
        text = None if message is None else message.replace(str(self.fmu.folder).encode(), b"FOLDER")
        if category != b"traceback":  # Python's alone
            self._log.append((instance, status, category, text))

    def answer(self, call: Call) -> str:
        """Make a call; return result and log as text, in which floats are exact and all NaN the same."""
        result = call.made(self) if isinstance(call, New) or call.instance in self.instances else "no call"
        log, self._log = self._log, []
        return f"{result}, says {log}" if log else repr(result)

    def instantiate(self, new: New) -> bool:
        """Make an instance; return whether there is one."""
        resources = self.fmu.folder / "resources"
        given = new.location
        location = LOCATIONS[given](resources).encode() if isinstance(given, str) else given
        callbacks = {"log": self._callbacks, "silent": self._silent, "none": None}[new.callbacks]
        pointer = self.fmu.library.fmi2Instantiate(
            new.name,
            new.kind,
            self.fmu.guid.encode() if new.guid == OURS else new.guid,
            location,
            None if callbacks is None else ctypes.byref(callbacks),
            new.visible,
            new.logging_on,
        )
        if pointer:
            self.instances[new.instance] = ctypes.c_void_p(pointer)
        return bool(pointer)

    def free(self, instance: int) -> None:
        """Free an instance and its states."""
        for state in [state for state, owner in self.owners.items() if owner == instance]:
            self.ask(instance, "FreeFMUstate", ctypes.byref(self.states.pop(state)))
            del self.owners[state]
        self.fmu.library.fmi2FreeInstance(self.instances.pop(instance))

    def free_all(self) -> None:
        """Free everything, for the next sequence."""
        for instance in list(self.instances):
            self.free(instance)
        self.serialized.clear()
        self._log.clear()

    def ask(self, instance: int, function: str, *arguments: Any) -> int:
        """Call a function of an instance."""
        return getattr(self.fmu.library, f"fmi2{function}")(self.instances[instance], *arguments)

    def receive(self, instance: int, number: int, function: str, *arguments: Any) -> int:
        """Call a function whose last argument receives a state."""
        state = self.states.get(number, ctypes.c_void_p())
        status = self.ask(instance, function, *arguments, ctypes.byref(state))
        if status == OK:
            self.states[number], self.owners[number] = state, instance
        return status


@dataclass(frozen=True)
class Call:
    """A call of a function of an instance."""

    instance: int

    def made(self, host: Host) -> Any:
        """Make it; return what it gives."""
        raise NotImplementedError


@dataclass(frozen=True)
class New(Call):
    """fmi2Instantiate, in place of an instance of this number."""

    location: str | bytes | None = "URI"
    name: bytes | None = b"unit"
    guid: str | bytes | None = OURS
    kind: int = 1
    callbacks: str = "log"
    visible: int = 0
    logging_on: int = 0

    def made(self, host: Host) -> bool:
        if self.instance in host.instances:
            host.free(self.instance)
        return host.instantiate(self)


@dataclass(frozen=True)
class Free(Call):
    """fmi2FreeInstance."""

    def made(self, host: Host) -> None:
        host.free(self.instance)


@dataclass(frozen=True)
class Plain(Call):
    """A function of nothing but the instance."""

    function: str

    def made(self, host: Host) -> int:
        return host.ask(self.instance, self.function)


@dataclass(frozen=True)
class Setup(Call):
    """fmi2SetupExperiment; without a stop time if it is None."""

    start: float = 0.0
    stop: float | None = None
    tolerant: int = 0

    def made(self, host: Host) -> int:
        times = ctypes.c_double(self.start), self.stop is not None, ctypes.c_double(self.stop or 0.0)
        return host.ask(self.instance, "SetupExperiment", self.tolerant, ctypes.c_double(1e-6), *times)


@dataclass(frozen=True)
class Step(Call):
    """fmi2DoStep."""

    t: float
    h: float
    no_return: int = 1

    def made(self, host: Host) -> int:
        times = ctypes.c_double(self.t), ctypes.c_double(self.h)
        return host.ask(self.instance, "DoStep", *times, self.no_return)


@dataclass(frozen=True)
class Get(Call):
    """fmi2GetReal, or that of another type; `count` may be less than there are references."""

    type: str
    references: tuple[int, ...] | None
    count: int
    into_nothing: bool = False

    def made(self, host: Host) -> Any:
        values = None if self.into_nothing else (TYPES[self.type] * max(self.count, 1))()
        references = _array(ctypes.c_uint, self.references)
        status = host.ask(self.instance, f"Get{self.type}", references, ctypes.c_size_t(self.count), values)
        return status, list(values or ())


@dataclass(frozen=True)
class Set(Call):
    """fmi2SetReal, or that of another type."""

    type: str
    references: tuple[int, ...] | None
    values: tuple[Any, ...] | None
    count: int

    def made(self, host: Host) -> int:
        references, values = _array(ctypes.c_uint, self.references), _array(TYPES[self.type], self.values)
        return host.ask(self.instance, f"Set{self.type}", references, ctypes.c_size_t(self.count), values)


@dataclass(frozen=True)
class Save(Call):
    """fmi2GetFMUstate; an instance does not overwrite the state of another."""

    state: int
    into_nothing: bool = False

    def made(self, host: Host) -> Any:
        if self.into_nothing:
            return host.ask(self.instance, "GetFMUstate", None)
        if host.owners.get(self.state, self.instance) != self.instance:
            return None
        return host.receive(self.instance, self.state, "GetFMUstate")


@dataclass(frozen=True)
class Restore(Call):
    """fmi2SetFMUstate, perhaps with the state of another instance, or none."""

    state: int

    def made(self, host: Host) -> int:
        return host.ask(self.instance, "SetFMUstate", host.states.get(self.state))


@dataclass(frozen=True)
class Forget(Call):
    """fmi2FreeFMUstate, perhaps of none."""

    state: int

    def made(self, host: Host) -> Any:
        if host.owners.get(self.state, self.instance) != self.instance:
            return None
        host.owners.pop(self.state, None)
        state = host.states.pop(self.state, ctypes.c_void_p())
        return host.ask(self.instance, "FreeFMUstate", ctypes.byref(state)), bool(state)


@dataclass(frozen=True)
class Serialize(Call):
    """fmi2SerializedFMUstateSize and fmi2SerializeFMUstate, perhaps into too few bytes."""

    state: int
    key: int
    too_few: int = 0

    def made(self, host: Host) -> Any:
        state, size = host.states.get(self.state), ctypes.c_size_t()
        status = host.ask(self.instance, "SerializedFMUstateSize", state, ctypes.byref(size))
        if status != OK:
            return status
        content, room = (ctypes.c_char * size.value)(), ctypes.c_size_t(size.value - self.too_few)
        status = host.ask(self.instance, "SerializeFMUstate", state, content, room)
        if status == OK:
            host.serialized[self.key] = content.raw
        return status


@dataclass(frozen=True)
class Deserialize(Call):
    """fmi2DeSerializeFMUstate of bytes as they are, or altered; `seed` says where."""

    state: int
    key: int
    altered: str = ""
    seed: int = 0

    def made(self, host: Host) -> Any:
        if host.owners.get(self.state, self.instance) != self.instance:
            return None
        content = host.serialized.get(self.key)
        if content is not None:
            content = self._altered(content)
        size = ctypes.c_size_t(len(content or b""))
        return host.receive(self.instance, self.state, "DeSerializeFMUstate", content, size)

    def _altered(self, content: bytes) -> bytes | None:
        chance = random.Random(self.seed)
        if self.altered == "cut":
            return content[: int(chance.random() * len(content))]
        if self.altered == "random":
            return chance.randbytes(chance.choice((1, 40, 300, len(content))))
        if self.altered == "longer":
            return content + b"x" * chance.choice((1, 8, 40))
        return {"none": None, "empty": b""}.get(self.altered, content)


@dataclass(frozen=True)
class Status(Call):
    """fmi2GetStatus, fmi2GetRealStatus and so on: `type` is what stands before Status."""

    type: str
    kind: int

    def made(self, host: Host) -> Any:
        value = STATUS_TYPES.get(self.type, ctypes.c_int)()
        status = host.ask(self.instance, f"Get{self.type}Status", self.kind, ctypes.byref(value))
        return (status, value.value) if status == OK else status


@dataclass(frozen=True)
class Derivatives(Call):
    """fmi2SetRealInputDerivatives, fmi2GetRealOutputDerivatives: of first order."""

    function: str
    count: int
    nothing: bool = False

    def made(self, host: Host) -> int:
        size = ctypes.c_size_t(self.count)
        if self.nothing:
            return host.ask(self.instance, self.function, None, size, None, None)
        orders, values = (ctypes.c_int * 2)(1, 1), (ctypes.c_double * 2)()
        return host.ask(self.instance, self.function, (ctypes.c_uint * 2)(0, 1), size, orders, values)


@dataclass(frozen=True)
class Directional(Call):
    """fmi2GetDirectionalDerivative."""

    def made(self, host: Host) -> int:
        one, size, value = (ctypes.c_uint * 1)(0), ctypes.c_size_t(1), (ctypes.c_double * 1)(1.0)
        return host.ask(self.instance, "GetDirectionalDerivative", one, size, one, size, value, value)


@dataclass(frozen=True)
class DebugLogging(Call):
    """fmi2SetDebugLogging."""

    on: int
    categories: tuple[bytes | None, ...] | None
    count: int

    def made(self, host: Host) -> int:
        categories = _array(ctypes.c_char_p, self.categories)
        return host.ask(self.instance, "SetDebugLogging", self.on, ctypes.c_size_t(self.count), categories)


def _array(ctype: Any, values: Sequence[Any] | None) -> Any:
    return None if values is None else (ctype * len(values))(*values)
