"""Native libraries of components in plain Python, translated by `fmus.native`.

A component is translated in its state when a run is planned, with the values of its module at that time;
compiled libraries are cached. Functions and objects are wrapped in a class for the translator, which unlike
the class for Python does not check the returned values, since that is not arithmetic.
"""

from __future__ import annotations

import copy
import io
import sysconfig
import tempfile
import zipfile
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from yawbench import components, vocabulary
from yawbench.components.fmi.component import Component
from yawbench.fmus.archive import PYTHON_WANTED, REASON, open_fmu, python_wanted
from yawbench.fmus.description import binary_of
from yawbench.fmus.fmu import Fmu, RunsAs
from yawbench.foundation.errors import YawbenchError

from ._parameters import ProgramParameters, functions_of, has_constructor

LIMIT = 20
"""Largest processor time [s] of the comparison with Python, in a run; chosen: a short law takes 1 s."""


def _values(result: Any, outputs: Sequence[str]) -> Any:
    """Return the value of a law as a sequence; True and False are refused, as in Python."""
    values = result if isinstance(result, (tuple, list)) else (result,)
    for name, value in zip(outputs, values):  # noqa: B905 - their number is checked by the translator
        if isinstance(value, bool):
            raise TypeError(f"{name}: must be a number (got {value})")
    return values


def of_function(
    function: Callable[..., Any],
    inputs: Sequence[str],
    outputs: Sequence[str],
    timed: bool,
    called: Sequence[str],
    made: ProgramParameters,
) -> dict[str, Any]:
    """Return the methods of a component that only calls a function, or an object that can be called.

    Args:
        function: function of the inputs and parameters, and of `t` if `timed`.
        inputs, timed: its arguments.
        outputs: names of its outputs.
        called: parameters that are arguments, too.
        made: parameters that are arguments of an object's constructor.
    """
    fresh = _maker(function, made)

    def result(self: Any, t: float, u: Sequence[float]) -> Any:
        values = dict(zip([*inputs, *called], [*u, *[getattr(self.p, x) for x in called]], strict=True))
        return _values(self._program(**values, t=t) if timed else self._program(**values), outputs)

    def start(self: Any, t: float, u: Sequence[float]) -> None:
        self._program = fresh(self)
        self._returned = result(self, t, u)

    def advance(self: Any, t: float, h: float, u: Sequence[float]) -> None:
        self._returned = result(self, t + h, u)

    def output(self: Any, t: float, u: Sequence[float]) -> Any:
        return self._returned

    return {"start": start, "advance": advance, "output": output}


def of_object(program: Any, outputs: Sequence[str], own: ProgramParameters) -> dict[str, Any]:
    """Return the members of a component that calls the methods of an object with these outputs."""
    fresh = _maker(program, own)

    def configure(self: Any) -> None:
        self._program = fresh(self)

    def start(self: Any, t: float, u: Sequence[float]) -> None:
        self._program = fresh(self)
        self._program.start(t, self._named(*u))

    def advance(self: Any, t: float, h: float, u: Sequence[float]) -> None:
        self._program.advance(t, h, self._named(*u))

    def output(self: Any, t: float, u: Sequence[float]) -> Any:
        return _values(self._program.output(t, self._named(*u)), outputs)

    members = {"configure": configure, "output": output}
    members |= {"start": start} if hasattr(program, "start") else {}
    return members | ({"advance": advance} if hasattr(program, "advance") else {})


def _maker(program: Any, own: ProgramParameters) -> Callable[[Any], Any]:
    """Return a method of a component that creates its object in the state before a run.

    Args:
        program: the object.
        own: its constructor parameters; without any, it is copied.
    """
    if not own.values:
        return lambda self: copy.deepcopy(program)
    cls: Any = type(program)
    fixed, attributes, constructed = own.fixed, sorted(own.attributes), has_constructor(cls)
    arguments = [name for name in own.values if name not in own.attributes]

    def made(self: Any) -> Any:
        program = cls.__new__(cls)
        for name in attributes:  # before the constructor, which may use them
            setattr(program, name, getattr(self.p, name))
        if constructed:
            passed = zip(arguments, [getattr(self.p, x) for x in arguments], strict=True)
            program.__init__(**copy.deepcopy(fixed), **dict(passed))
        return program

    return made


def folders_of(program: Any, translated: type[Component]) -> list[Path]:
    """Return the folders whose functions are translated: those of the library and of the user."""
    # methods generated by dataclasses and named tuples have no file, or a file of Python
    codes = [
        f.__code__
        for f in functions_of(translated, program)
        if not (f.__code__.co_filename == "<string>" and f.__name__.startswith("__"))
    ]
    python = Path(sysconfig.get_path("stdlib"))
    folders = {Path(c.co_filename).parent for c in codes} - {python, python / "collections"}
    return [*(Path(package.__path__[0]) for package in (components, vocabulary)), *sorted(folders)]


def in_native_code(
    program: Any, component: type[Component], translated: type[Component], fmu: Fmu, xml: bytes
) -> Fmu:
    """Return the FMU of a component with a native library, or with the reason why it runs in Python.

    Args:
        program: function, object or class of the component.
        component: component class.
        translated: equivalent class for the translator.
        fmu: description of the FMU.
        xml: model description.
    """
    if python_wanted():
        return replace(fmu, runs_as=PYTHON_WANTED)
    from yawbench.fmus.native.build import (  # here, because most scenarios do not need it
        NATIVE_LIBRARY,
        native,
    )

    with tempfile.TemporaryDirectory(prefix="yawbench_") as folder:
        made = native(
            component,
            *folders_of(program, translated),
            source=f"{fmu.name}, plain Python",
            guid=fmu.guid,
            resources=Path(folder),
            translated=translated,
            unnamed=Path(__file__),
            closed=True,  # a run that ends there is repeated in Python
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
    return replace(fmu, directory=unpacked, runs_as=RunsAs(untried=made.untried))


def zipped(files: dict[str, bytes]) -> bytes:
    """Return an archive of files; equal files give equal bytes."""
    archive = io.BytesIO()
    with zipfile.ZipFile(archive, "w") as members:
        for name, content in files.items():
            members.writestr(zipfile.ZipInfo(name), content)
    return archive.getvalue()
