"""Isolated import of a component's sources as a separate package.

The build imports the component, because its class creates the model description. The package is named
`yawbench_<hash>` and removed from `sys.modules` afterwards; modules of the same name that are in use
(by an FMU loaded in this process) are restored.
"""

from __future__ import annotations

import importlib
import os
import sys
import tempfile
import traceback
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from types import FrameType
from typing import Any
from xml.etree.ElementTree import Element

from yawbench.foundation.errors import BuildError
from yawbench.vocabulary.roles import Role
from yawbench.vocabulary.wheels import wheels

from .source_files import Parts

ENTRY = '''"""Entry module of the FMU {name}."""
{needs}
from {package}.{module} import {component}

# At every instantiation PythonFMU's library runs these lines again, with separate locals,
# and then releases a reference to the globals that it never acquired. Acquire it here.
if locals() is not globals():
    try:
        import ctypes

        ctypes.pythonapi.Py_IncRef(ctypes.py_object(globals()))
    except Exception:  # a Python without ctypes
        globals().setdefault("_references", []).append(globals())
'''

NEEDS = """
import sys
from importlib.util import find_spec

missing = [package for package in {packages!r} if find_spec(package) is None]
if missing:
    raise ImportError("{name} needs " + ", ".join(missing) + ", which this Python lacks: " + sys.prefix)
"""

VARIANT = '''"""{module} with another name or other default values."""

from __future__ import annotations

from dataclasses import dataclass

from ..fmi.variables import like
from .{module} import {component} as Base


@dataclass(frozen=True)
class Parameters(Base.Parameters):
    """The parameters with other defaults."""

{fields}


class {component}(Base):
    fmu_name = {name!r}
    Parameters = Parameters


{component}.__doc__ = Base.__doc__
'''


@contextmanager
def isolated_modules(*packages: str) -> Iterator[None]:
    """Import modules of these packages afresh within the block, and remove them afterwards."""

    def ours(name: str) -> bool:
        return name.partition(".")[0] in packages

    path, quiet = list(sys.path), sys.dont_write_bytecode
    in_use = {name: module for name, module in sys.modules.items() if ours(name)}
    for name in in_use:
        del sys.modules[name]
    sys.dont_write_bytecode = True
    importlib.invalidate_caches()
    try:
        yield
    finally:
        sys.path[:], sys.dont_write_bytecode = path, quiet
        for name in [name for name in sys.modules if ours(name)]:
            del sys.modules[name]
        sys.modules.update(in_use)


@dataclass(frozen=True)
class StagingFolder:
    """Temporary folder with the package of a component, see `staged`.

    Attributes:
        read: files outside that the package opened when it was imported, each with file and line in it.
    """

    folder: Path
    package: str
    read: list[tuple[str, str]] = field(default_factory=list)

    def component(self, module: Parts) -> type[Any]:
        """Return the component class defined in a module of the package.

        Raises:
            BuildError: importing it fails, or it does not define exactly one component.
        """
        name = f"{self.package}.{'.'.join(module)}"
        try:
            base = importlib.import_module(f"{self.package}.fmi.component").Component
            with _noting_files(self):
                loaded = importlib.import_module(name)
        except (Exception, SystemExit) as error:
            raise BuildError(self.explain(error)) from None
        classes = [
            value
            for value in vars(loaded).values()
            if issubclass(type(value), type) and issubclass(value, base) and value.__module__ == name
        ]
        final = [c for c in classes if not any(other is not c and issubclass(other, c) for other in classes)]
        if len(final) != 1:
            names = ", ".join(c.__name__ for c in final)
            raise BuildError(f"must define one component (defines {names or 'none'})")
        (component,) = final
        assert isinstance(component, type)
        return component

    def description(self, component: type[Any]) -> Element:
        """Return the model description of a component.

        Raises:
            BuildError: creating an instance fails.
        """
        try:
            description: Element = component(instance_name="described", resources=str(self.folder)).to_xml()
        except (Exception, SystemExit) as error:
            raise BuildError(self.explain(error)) from None
        return description

    def explain(self, error: BaseException) -> str:
        """Return an exception as a message with the file and line in the package."""
        where = ""
        for frame in traceback.extract_tb(error.__traceback__):
            file = Path(frame.filename)
            if file.is_relative_to(self.folder / self.package):
                shown = file.relative_to(self.folder / self.package).as_posix()
                if shown not in _MACHINERY:
                    where = f" ({shown}:{frame.lineno})"
        return f"{type(error).__name__}: {error}{where}"


_watched: list[StagingFolder] = []
"""The folder whose imports are watched, if any."""


@cache
def _watch() -> None:
    """Install the audit hook, which cannot be removed."""
    sys.addaudithook(_note_file)


def _note_file(event: str, args: tuple[Any, ...]) -> None:
    """Note a file that a watched package opens."""
    if event != "open" or not _watched or not isinstance(args[0], (str, bytes)):
        return
    stage = _watched[-1]
    package = os.path.join(stage.folder, stage.package, "")
    opened = os.path.abspath(os.fsdecode(args[0]))
    frame: FrameType | None = sys._getframe(1)
    while frame is not None and "importlib._bootstrap" not in frame.f_code.co_filename:
        file = frame.f_code.co_filename
        if file.startswith(package) and not opened.startswith(package):
            stage.read.append((opened, f"{file[len(package) :].replace(os.sep, '/')}:{frame.f_lineno}"))
            return
        frame = frame.f_back


@contextmanager
def _noting_files(stage: StagingFolder) -> Iterator[None]:
    _watch()
    _watched.append(stage)
    try:
        yield
    finally:
        _watched.pop()


_MACHINERY = ("fmi/component.py", "fmi/variables.py")
"""Files that detect a wrong declaration but do not contain it."""


@contextmanager
def staged(files: Mapping[str, str], package: str) -> Iterator[StagingFolder]:
    """Write `files` as `package` into a temporary folder from which it can be imported."""
    with tempfile.TemporaryDirectory(prefix="yawbench_") as temporary, isolated_modules(package):
        folder = Path(temporary).resolve()
        for path, text in files.items():
            file = folder / package / path
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_bytes(text.encode())
        sys.path.insert(0, str(folder))
        importlib.invalidate_caches()
        yield StagingFolder(folder, package)


def entry_module(name: str, component: type[Any]) -> str:
    """Return the source of the module that PythonFMU's library loads for the FMU `name`."""
    package, _, module = component.__module__.partition(".")
    packages = component.host_packages
    needs = NEEDS.format(name=name, packages=packages) if packages else ""
    return ENTRY.format(name=name, package=package, module=module, component=component.__name__, needs=needs)


def variant(component: type[Any], name: str, defaults: Mapping[str, Any]) -> str:
    """Return the source of a module that defines a component with another name and other defaults.

    Raises:
        BuildError: a default belongs to no parameter, has the wrong type, or is not allowed.
    """
    parameters = {v.name: v for v in component.variables if v.causality == "parameter"}
    annotation = {"Real": "float", "Integer": "int", "Boolean": "bool", "String": "str"}
    package = component.__module__.partition(".")[0]
    check = importlib.import_module(f"{package}.fmi.variables").check_parameter
    fields = []
    for key, value in defaults.items():
        if key not in parameters:
            raise BuildError(f"has no parameter {key!r}; it has: {', '.join(parameters) or 'none'}")
        kind = annotation[parameters[key].type]
        if kind == "float" and type(value) is int:
            value = float(value)
        if type(value).__name__ != kind:
            raise BuildError(f"parameter {key} must be of type {kind} (got {type(value).__name__})")
        try:
            check(parameters[key], value)
        except ValueError as error:
            raise BuildError(str(error)) from None
        fields.append(f"    {key}: {kind} = like(Base.Parameters, {key!r}, {value!r})")
    module = component.__module__.rpartition(".")[2]
    return VARIANT.format(
        module=module, component=component.__name__, name=name, fields="\n".join(fields)
    ).replace("\n\n\n\n\n", "\n\n\n")


def missing_signals(role: Role, variables: Iterable[Any]) -> list[str]:
    """Return a message for every signal that the role requires and the component does not declare."""
    declared = {(v.causality, v.name) for v in variables}
    problems = []
    for causality, patterns in (("input", role.inputs), ("output", role.outputs)):
        for pattern in patterns:
            names = wheels(pattern)
            lacking = [name for name in names if (causality, name) not in declared]
            if lacking:
                shown = pattern if len(lacking) == len(names) else ", ".join(lacking)
                article = "an" if role.name[0] in "aeiou" else "a"
                problems.append(f"{article} {role.name} must declare the {causality} {shown}")
    return problems
