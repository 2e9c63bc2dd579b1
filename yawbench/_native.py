"""Native libraries of components in plain Python, by the translator and the gate of `fmus.native`.

A component is translated as it is when a run is planned, with the values of its module at that time; what
was compiled before is in the cache. A function or an object becomes a class for the translator: the one that
calls it in Python also checks what it returns, which is not arithmetic.
"""

from __future__ import annotations

import inspect
import io
import tempfile
import zipfile
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from types import FunctionType
from typing import Any

import components
import vocabulary
from components.fmi.component import Component
from orchestrator.errors import YawbenchError
from orchestrator.fmu.archive import open_fmu
from orchestrator.fmu.binary import NATIVE, REASON, WANTED, binary_of, python_wanted
from orchestrator.plan import Fmu

PLAIN = (bool, int, float, str, type(None))
"""Types of what an object may hold before its first step."""


def of_function(function: Callable[..., Any], inputs: Sequence[str], timed: bool) -> dict[str, Any]:
    """Return the methods of a component that only calls a function of its inputs, and of `t` if `timed`."""

    def output(self: Component, t: float, u: Sequence[float]) -> Any:
        values = dict(zip(inputs, u, strict=True))
        result = function(**values, t=t) if timed else function(**values)
        return result if isinstance(result, (tuple, list)) else (result,)

    return {"output": output}


def of_object(program: Any) -> dict[str, Any]:
    """Return the members of a component that is the object itself: its attributes become the state.

    Raises:
        TypeError: the object holds something else than numbers and texts.
    """
    members: dict[str, Any] = {}
    for cls in reversed(type(program).__mro__[:-1]):
        members |= {name: value for name, value in vars(cls).items() if not name.startswith("__")}
    held = {name: value for name, value in members.items() if type(value) in PLAIN} | vars(program)
    for name, value in held.items():
        if type(value) not in PLAIN:
            raise TypeError(f"{name} is a {type(value).__name__}")
    its_start, its_advance, its_output = map(members.get, ("start", "advance", "output"))

    def configure(self: Any) -> None:
        for name, value in held.items():
            setattr(self, name, value)

    def start(self: Any, t: float, u: Sequence[float]) -> None:
        its_start(self, t, self._named(*u))  # type: ignore[misc]

    def advance(self: Any, t: float, h: float, u: Sequence[float]) -> None:
        its_advance(self, t, h, self._named(*u))  # type: ignore[misc]

    def output(self: Any, t: float, u: Sequence[float]) -> Any:
        result = its_output(self, t, self._named(*u))  # type: ignore[misc]
        return result if isinstance(result, (tuple, list)) else (result,)

    members |= {"configure": configure, "output": output}
    members |= {"start": start} if its_start else {}
    return members | ({"advance": advance} if its_advance else {})


def in_native_code(component: type[Component], translated: type[Component], fmu: Fmu, xml: bytes) -> Fmu:
    """Return the FMU of a component with a native library, or with the reason why it runs in Python.

    Args:
        component: its class.
        translated: a class that gives the same, for the translator.
        fmu: as described.
        xml: its model description.
    """
    if python_wanted():
        return replace(fmu, runs_as=f"Python: {WANTED} asks for it")
    from fmus.native.build import NATIVE_LIBRARY, native  # here, because most scenarios need none of it

    functions = (function for cls in translated.__mro__ for function in _functions(cls))
    folders = {Path(function.__code__.co_filename).parent for function in functions}
    with tempfile.TemporaryDirectory(prefix="yawbench_") as folder:
        made = native(
            component,
            *(Path(package.__path__[0]) for package in (components, vocabulary)),
            *sorted(folders),
            source=f"{fmu.name}, plain Python",
            guid=fmu.guid,
            resources=Path(folder),
            translated=translated,
        )
        if made.why_not:
            return replace(fmu, runs_as=f"Python: {made.why_not}")
        archive = Path(folder, f"{fmu.sha256}.fmu")
        library = made.files[f"binaries/linux64/{NATIVE_LIBRARY}"]
        archive.write_bytes(
            zipped({
                "modelDescription.xml": xml, binary_of(fmu.fmi, fmu.model_identifier): library, REASON: b"",
            })
        )  # fmt: skip
        try:
            unpacked = open_fmu(archive).directory
        except YawbenchError as error:
            return replace(fmu, runs_as=f"Python: {error}")
    return replace(fmu, directory=unpacked, runs_as=NATIVE)


def zipped(files: dict[str, bytes]) -> bytes:
    """Return an archive of files; the same ones give the same bytes."""
    archive = io.BytesIO()
    with zipfile.ZipFile(archive, "w") as members:
        for name, content in files.items():
            members.writestr(zipfile.ZipInfo(name), content)
    return archive.getvalue()


def _functions(cls: type) -> list[Any]:
    """Return the functions of a class, with those that they have from around them."""
    functions = [member for member in vars(cls).values() if inspect.isfunction(member)]
    for function in functions:
        cells = (cell.cell_contents for cell in function.__closure__ or ())
        functions += [held for held in cells if type(held) is FunctionType and held not in functions]
    return functions
