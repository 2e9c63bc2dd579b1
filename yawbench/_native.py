"""Native libraries of components in plain Python, by the translator of `fmus.native`, compared with Python.

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
from orchestrator.fmu.binary import PYTHON_WANTED, REASON, binary_of, python_wanted
from orchestrator.plan import Fmu, RunsAs

from ._parameters import ProgramParameters

LIMIT = 20
"""Processor time [s] that the comparison with Python may take, in a run; chosen: a short law takes one."""
PLAIN = (bool, int, float, str, type(None))
"""Types of values that an object may hold before its first step."""


def _values(result: Any) -> Any:
    """Return the value of a law as a sequence; True and False are refused, as in Python."""
    values = result if isinstance(result, (tuple, list)) else (result,)
    for value in values:
        if isinstance(value, bool):
            raise TypeError("must be a number")
    return values


def of_function(
    function: Callable[..., Any], inputs: Sequence[str], timed: bool, parameters: Sequence[str]
) -> dict[str, Any]:
    """Return the methods of a component that only calls a function.

    Args:
        function: of its inputs and parameters, and of `t` if `timed`.
        inputs, timed, parameters: what it is called with.
    """

    def output(self: Component, t: float, u: Sequence[float]) -> Any:
        values = dict(
            zip([*inputs, *parameters], [*u, *[getattr(self.p, x) for x in parameters]], strict=True)
        )
        result = function(**values, t=t) if timed else function(**values)
        return _values(result)

    return {"output": output}


def of_object(program: Any, own: ProgramParameters) -> dict[str, Any]:
    """Return the members of a component that makes an object with its parameters, or is the object itself.

    Without parameters, the attributes of the object become the state.

    Raises:
        TypeError: the object holds something else than numbers and texts.
    """
    if own.values:
        return _with_parameters(program, own)
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
        return _values(result)

    members |= {"configure": configure, "output": output}
    members |= {"start": start} if its_start else {}
    return members | ({"advance": advance} if its_advance else {})


def _with_parameters(program: Any, own: ProgramParameters) -> dict[str, Any]:
    cls: Any = type(program)
    for name, value in own.fixed.items():
        if type(value) not in PLAIN:
            raise TypeError(f"{name} is a {type(value).__name__}")
    fixed, attributes = own.fixed, sorted(own.attributes)
    arguments = [name for name in own.values if name not in own.attributes]

    def configure(self: Any) -> None:
        self._program = cls(
            **fixed, **dict(zip(arguments, [getattr(self.p, x) for x in arguments], strict=True))
        )
        for name in attributes:
            setattr(self._program, name, getattr(self.p, name))

    def start(self: Any, t: float, u: Sequence[float]) -> None:
        self._program.start(t, self._named(*u))

    def advance(self: Any, t: float, h: float, u: Sequence[float]) -> None:
        self._program.advance(t, h, self._named(*u))

    def output(self: Any, t: float, u: Sequence[float]) -> Any:
        result = self._program.output(t, self._named(*u))
        return _values(result)

    members = {"configure": configure, "output": output}
    members |= {"start": start} if hasattr(cls, "start") else {}
    return members | ({"advance": advance} if hasattr(cls, "advance") else {})


def in_native_code(component: type[Component], translated: type[Component], fmu: Fmu, xml: bytes) -> Fmu:
    """Return the FMU of a component with a native library, or with the reason why it runs in Python.

    Args:
        component: its class.
        translated: a class that gives the same, for the translator.
        fmu: as described.
        xml: its model description.
    """
    if python_wanted():
        return replace(fmu, runs_as=PYTHON_WANTED)
    from fmus.native.build import NATIVE_LIBRARY, native  # here, because most scenarios need none of it

    functions = (function for cls in translated.__mro__ for function in _functions(cls))
    codes = [function.__code__ for function in functions]
    # dataclasses write methods that have no file
    generated = [code for code in codes if code.co_filename == "<string>" and code.co_name.startswith("__")]
    folders = {Path(code.co_filename).parent for code in codes if code not in generated}
    with tempfile.TemporaryDirectory(prefix="yawbench_") as folder:
        made = native(
            component,
            *(Path(package.__path__[0]) for package in (components, vocabulary)),
            *sorted(folders),
            source=f"{fmu.name}, plain Python",
            guid=fmu.guid,
            resources=Path(folder),
            translated=translated,
            limit=LIMIT,
        )
        if made.why_not:
            return replace(fmu, runs_as=RunsAs(made.why_not))
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
            return replace(fmu, runs_as=RunsAs(str(error)))
    return replace(fmu, directory=unpacked, runs_as=RunsAs())


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
        for held in (cell.cell_contents for cell in function.__closure__ or ()):
            classes = held.__mro__ if issubclass(type(held), type) else ()  # `isinstance` asks the object
            within = [x for base in classes for x in vars(base).values()] or [held]
            functions += [x for x in within if type(x) is FunctionType and x not in functions]
    return functions
