"""A host of FMI 2.0 in nothing but the standard library: for the tests, and for Pythons that have nothing.

As a script it runs one FMU by itself and prints its outputs, and the modules it brought, as JSON:

    python -I -S bare.py FOLDER_OF_THE_UNPACKED_FMU [NAME=VALUE ...]
"""

from __future__ import annotations

import ctypes
import json
import sys
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

OK, WARNING, DISCARD, ERROR, FATAL = range(5)
TYPES: dict[str, Any] = {
    "Real": ctypes.c_double,
    "Integer": ctypes.c_int,
    "Boolean": ctypes.c_int,
    "String": ctypes.c_char_p,
    "Enumeration": ctypes.c_int,
}
LOGGER = ctypes.CFUNCTYPE(
    None, ctypes.c_void_p, ctypes.c_char_p, ctypes.c_int, ctypes.c_char_p, ctypes.c_char_p
)


class Callbacks(ctypes.Structure):
    _fields_ = [
        ("logger", LOGGER),
        ("allocate", ctypes.c_void_p),
        ("free", ctypes.c_void_p),
        ("finished", ctypes.c_void_p),
        ("environment", ctypes.c_void_p),
    ]


class Fmu:
    """An unpacked FMU: its variables and its library."""

    def __init__(self, folder: str | Path) -> None:
        self.folder = Path(folder).absolute()
        root = ElementTree.parse(self.folder / "modelDescription.xml").getroot()
        self.name = root.get("modelName") or ""
        self.guid = root.get("guid") or ""
        self.reference: dict[str, int] = {}
        self.type: dict[str, str] = {}
        self.causality: dict[str, str] = {}
        self.start: dict[str, str | None] = {}
        self.items: dict[str, list[str]] = {}
        declared = {
            simple.get("name"): [item.get("name") or "" for item in simple.iter("Item")]
            for simple in root.iter("SimpleType")
        }
        for element in root.iter("ScalarVariable"):
            name = element.get("name") or ""
            self.reference[name] = int(element.get("valueReference") or 0)
            self.causality[name] = element.get("causality") or ""
            self.type[name] = element[0].tag
            self.start[name] = element[0].get("start")
            if element[0].tag == "Enumeration":
                self.items[name] = declared[element[0].get("declaredType")]
        names = list(self.reference)
        self.depends: dict[str, set[str]] = {}
        for element in root.iterfind("ModelStructure/Outputs/Unknown"):
            inputs = (element.get("dependencies") or "").split()
            self.depends[names[int(element.get("index") or 0) - 1]] = {names[int(i) - 1] for i in inputs}
        self.binary = self.folder / "binaries" / "linux64" / f"{self.name}.so"
        self.library = ctypes.CDLL(str(self.binary))
        self.library.fmi2Instantiate.restype = ctypes.c_void_p
        self.library.fmi2FreeInstance.restype = None

    def names(self, causality: str) -> list[str]:
        return [name for name, found in self.causality.items() if found == causality]


class Refused(Exception):
    """A call answered with something else than OK."""

    def __init__(self, call: str, status: int, messages: list[str]) -> None:
        super().__init__(f"{call}: status {status}: {messages[:1]}")
        self.status = status


class Unit:
    """One instance. Methods raise `Refused`, `call` does not; `log` holds (status, category, text)."""

    def __init__(
        self,
        fmu: Fmu,
        name: str = "unit",
        *,
        location: str | None = None,
        logging_on: bool = False,
        **values: Any,
    ) -> None:
        self.fmu = fmu
        self.log: list[tuple[int, str, str]] = []
        self.callbacks = Callbacks(logger=LOGGER(self._note))
        location = (fmu.folder / "resources").as_uri() if location is None else location
        self.component = ctypes.c_void_p(
            fmu.library.fmi2Instantiate(
                name.encode(),
                1,
                fmu.guid.encode(),
                location.encode(),
                ctypes.byref(self.callbacks),
                0,
                logging_on,
            )
        )
        if not self.component:
            raise Refused("fmi2Instantiate", ERROR, self.messages)
        self.set(**values)

    def _note(self, environment: Any, name: bytes, status: int, category: bytes, message: bytes) -> None:
        text = message.decode().replace("%%", "%")  # what printf makes of it
        self.log.append((status, category.decode(), text))

    @property
    def messages(self) -> list[str]:
        return [text for _, _, text in self.log]

    def call(self, function: str, *arguments: Any) -> int:
        return getattr(self.fmu.library, function)(self.component, *arguments)

    def do(self, function: str, *arguments: Any) -> None:
        status = self.call(function, *arguments)
        if status != OK:
            raise Refused(function, status, self.messages)

    def set(self, **values: Any) -> None:
        for kind, ctype in TYPES.items():
            names = [name for name in values if self.fmu.type[name] == kind]
            given = [self._given(kind, name, values[name]) for name in names]
            if names:
                function = f"fmi2Set{kind.replace('Enumeration', 'Integer')}"
                self.do(function, self._references(names), _n(names), (ctype * len(names))(*given))

    def _given(self, kind: str, name: str, value: Any) -> Any:
        if kind == "Enumeration" and isinstance(value, str):
            return self.fmu.items[name].index(value) + 1
        return value.encode() if kind == "String" else value

    def get(self, *names: str) -> list[Any]:
        """Return values of one type; of an Enumeration the names of its items."""
        kind = self.fmu.type[names[0]] if names else ""
        values = (TYPES[kind] * len(names))() if names else None
        if names:
            function = f"fmi2Get{kind.replace('Enumeration', 'Integer')}"
            self.do(function, self._references(names), _n(names), values)
        if kind == "Enumeration":
            chosen = zip(names, values or (), strict=True)
            return [self.fmu.items[name][value - 1].encode() for name, value in chosen]
        return list(values or ())

    def outputs(self) -> list[float]:
        return self.get(*self.fmu.names("output"))

    def _references(self, names: Any) -> Any:
        return (ctypes.c_uint * len(names))(*(self.fmu.reference[name] for name in names))

    def start(self, t: float = 0.0) -> None:
        self.do("fmi2SetupExperiment", 0, _f(0), _f(t), 0, _f(0))
        self.do("fmi2EnterInitializationMode")
        self.do("fmi2ExitInitializationMode")

    def try_step(self, t: float, h: float = 0.001) -> int:
        return self.call("fmi2DoStep", _f(t), _f(h), 1)

    def step(self, t: float, h: float = 0.001) -> None:
        self.do("fmi2DoStep", _f(t), _f(h), 1)

    def save(self) -> ctypes.c_void_p:
        state = ctypes.c_void_p()
        self.do("fmi2GetFMUstate", ctypes.byref(state))
        return state

    def restore(self, state: ctypes.c_void_p) -> None:
        self.do("fmi2SetFMUstate", state)

    def forget(self, state: ctypes.c_void_p) -> None:
        self.do("fmi2FreeFMUstate", ctypes.byref(state))

    def to_bytes(self, state: ctypes.c_void_p) -> bytes:
        size = ctypes.c_size_t()
        self.do("fmi2SerializedFMUstateSize", state, ctypes.byref(size))
        content = (ctypes.c_char * size.value)()
        self.do("fmi2SerializeFMUstate", state, content, size)
        return content.raw

    def from_bytes(self, content: bytes) -> ctypes.c_void_p:
        state = ctypes.c_void_p()
        self.do("fmi2DeSerializeFMUstate", content, ctypes.c_size_t(len(content)), ctypes.byref(state))
        return state

    def free(self) -> None:
        self.fmu.library.fmi2FreeInstance(self.component)
        self.component = ctypes.c_void_p()


def _n(names: Any) -> ctypes.c_size_t:
    return ctypes.c_size_t(len(names))


def _f(value: float) -> ctypes.c_double:
    return ctypes.c_double(value)


def main(folder: str, *assignments: str) -> None:
    before, path = set(sys.modules), list(sys.path)
    fmu = Fmu(folder)
    values = {name: float(value) for name, value in (text.split("=") for text in assignments)}
    units = [Unit(fmu, name, **values) for name in ("first", "second")]
    for unit in units:
        unit.start()
        for k in range(10):
            unit.step(k * 0.001)
    first, second = (unit.outputs() for unit in units)
    for unit in units:
        unit.free()
    if first != second or sys.path != path:
        raise SystemExit("the instances differ, or sys.path has been changed")
    files = {getattr(sys.modules[name], "__file__", None) for name in set(sys.modules) - before}
    print(json.dumps({"outputs": first, "files": sorted(file for file in files if file)}))


if __name__ == "__main__":
    main(*sys.argv[1:])
