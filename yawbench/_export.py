"""Export of controllers in plain Python as FMUs, for this bench and other tools."""

from __future__ import annotations

import dis
import functools
import hashlib
import inspect
import struct
import sys
import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from yawbench.components.fmi.component import Component
from yawbench.fmus.archive import runs_as
from yawbench.fmus.build import COMPONENTS, put
from yawbench.fmus.build_stamp import BuildStamp, Edition
from yawbench.fmus.fmi3_archive import to_fmi3
from yawbench.fmus.native.compare_with_python import Twin, random_inputs
from yawbench.fmus.packing import DESCRIPTION, to_bytes
from yawbench.fmus.presentation import presented
from yawbench.fmus.recipe import TOOL, PythonRecipe
from yawbench.fmus.source_files import Parts, Sources, UserModules
from yawbench.fmus.staging import staged
from yawbench.foundation.errors import BuildError, ScenarioError, YawbenchWarning
from yawbench.foundation.messages import listed, short
from yawbench.foundation.progress import bar
from yawbench.vocabulary.roles import ROLES

from . import _parameters, arguments
from ._controller import ControllerLike, PythonComponent
from ._export_source import Cut, literal, refuse
from ._parameters import ProgramParameters

STEPS, FEW, STEP = 400, 60, 0.001
"""Number of steps of an FMU's comparison with its program, with other parameters, and step size [s]."""
NOWHERE = "/"
"""Not a valid folder name, so that an exported FMU is never stale: its program may be gone."""


def export_fmu(
    controller: ControllerLike, file: str | Path, *, role: str = "controller", fmi: int = 2
) -> Path:
    """Write a controller in plain Python as an FMU, and return its path.

        >>> def follow(yaw_rate_ref, yaw_rate, gain=2e4):
        ...     return gain * (yaw_rate_ref - yaw_rate)
        >>> fmu = yb.export_fmu(follow, "follow.fmu")
        >>> by_fmu, by_python = base.swap(controller=fmu).run(), base.swap(controller=follow).run()
        >>> bool((by_fmu["controller.yaw_moment"] == by_python["controller.yaw_moment"]).all())
        True

    A `YawbenchWarning` names branches of its native library that were never compared with Python.

    The FMU is for co-simulation, with a native library where the program can be translated. It has the
    program's parameters, and its `step_size` as that of the default experiment; it declares that it takes
    other steps, too, unless the program's `advance` does not read its step `h`. One of FMI 2.0 contains the
    modules of the user's own package that it imports; one of FMI 3.0 is native only. Before it is written,
    its outputs are compared with those of the program, bit for bit.

    Args:
        controller: plain Python as in `Scenario.swap`.
        file: the FMU; its name without `.fmu` is the name of the model.
        role: role of its instances, such as "driver"; it determines the outputs of a function.
        fmi: version of FMI, 2 or 3.

    Raises:
        ScenarioError: the controller, the role or the version is invalid.
        BuildError: the program needs something that an FMU cannot contain, or cannot be translated for
            FMI 3.0.
    """
    path = arguments.path(file, "file").absolute()
    role = arguments.text(role, "role")
    folders = {item.name: folder for folder, item in ROLES.items()}
    if path.suffix != ".fmu" or not (path.stem.isidentifier() and path.stem.isascii()):
        raise ScenarioError(
            f"file: must be a name of letters, digits and _ that ends with .fmu (got {path.name!r})",
            code="argument-invalid",
        )
    if type(fmi) is not int or fmi not in (2, 3):
        raise ScenarioError(f"fmi: must be 2 or 3 (got {short(fmi)})", code="argument-invalid")
    if role not in folders:
        raise ScenarioError(
            f"role: must be one of {listed(folders, last='or')} (got {short(role)})", code="argument-invalid"
        )
    if arguments.names_file(controller):
        raise ScenarioError(f"controller: {short(controller)} is an FMU already", code="controller-invalid")
    with bar(f"Export {path.name}"):
        _write(controller, path, role, folders[role], Edition(fmi))
    return path


def _write(controller: Any, path: Path, role: str, folder: str, edition: Edition) -> None:
    """Write the FMU of a program."""
    program = PythonComponent(controller, instance=role, role=role)
    try:
        recipe = _recipe(controller, program, path.stem, folder)
        made = recipe.make(edition=edition)
        files = presented(made.files, recipe.listing(), role=role, credits={})
        if edition.fmi == 3:
            files = to_fmi3(files)
        if program.step_size is not None:
            files[DESCRIPTION] = _with_step(
                files[DESCRIPTION], program.step_size, only=not _takes_any_step(controller)
            )
        key = hashlib.sha256(b"".join(files[name] for name in sorted(files))).hexdigest()[:32]
        stamp = BuildStamp(path.stem, key, source="Python", tool=TOOL, home=NOWHERE, edition=edition)
        put(path, to_bytes(files, stamp), *made.modules)
        if (how := runs_as(path)) and how.note:
            warnings.warn(f"{path.name}: {how.note}", YawbenchWarning, stacklevel=4)
    except BuildError as error:
        sentences = [diagnostic.message for diagnostic in error.diagnostics]
        raise BuildError([f"{path.stem}: {text}" for text in sentences], code=error.code) from None
    except OSError as error:
        raise BuildError(f"{path}: cannot be written: {error}", code="component-unreadable") from None


def _with_step(description: bytes, step: float, *, only: bool) -> bytes:
    """Return a model description with the step [s] of its default experiment; `only`: it takes no other."""
    root = ElementTree.fromstring(description)
    for experiment in root.iter("DefaultExperiment"):
        experiment.set("stepSize", repr(step))
    for kind in root.iter("CoSimulation"):
        kind.set("canHandleVariableCommunicationStepSize", "false" if only else "true")
    text: bytes = ElementTree.tostring(root, encoding="UTF-8", xml_declaration=True)
    return text + b"\n"


def _takes_any_step(program: Any) -> bool:
    """Return whether a law can be simulated with any step: its `advance`, if it has one, reads the step `h`.

    One that does not, such as a difference equation, is right with the step alone that it declares.
    """
    advance = inspect.unwrap(getattr(program, "advance", Component.advance))
    if getattr(advance, "__func__", advance) is Component.advance:
        return True
    code = advance.__code__
    step = code.co_varnames[2]  # of self, t, h, u
    read = (one.argval for one in dis.get_instructions(code) if one.opname.startswith("LOAD_"))
    return step in code.co_cellvars or any(step in (x if isinstance(x, tuple) else (x,)) for x in read)


@dataclass(frozen=True)
class _ProgramRecipe(PythonRecipe):
    """Recipe of an FMU whose sources are not in files."""

    texts: dict[str, str] = field(default_factory=dict)

    @cached_property
    def _files(self) -> dict[str, str]:
        return self.texts

    def listing(self) -> dict[str, str]:
        """Sources of component and program, as path -> text."""
        folder, name = self.module
        return {path: self.texts[path] for path in (f"{folder}/{name}.py", f"{folder}/{name}_program.py")}


def _recipe(program: Any, known: PythonComponent, name: str, folder: str) -> PythonRecipe:
    """Return the recipe of the first form of a program that gives the same values."""
    target = program.func if isinstance(program, functools.partial) else program
    is_class = isinstance(program, type)
    code = target if is_class or inspect.isfunction(target) else type(target)
    if not (is_class or inspect.isfunction(target) or hasattr(target, "output")):
        raise refuse(f"{type(target).__name__}: give a function, or an object with a method output(t, u)")
    sources = Sources(COMPONENTS, user=_user_modules(code))
    cut = Cut(sources, (folder,), code.__module__)
    called = code.__name__ if code.__name__.isidentifier() else "law"
    cut.add(called, code, called)
    texts = {f"{folder}/{name}_program.py": cut.text()}
    for module in sorted({("fmi", "component"), *cut.imports}):
        texts |= sources.closure(module)
    texts.setdefault(f"{folder}/__init__.py", "")
    difference = ""
    for exact in (False, True):
        form = _Form(name, called, known.component, exact)
        if is_class:
            text = form.of_class()
        else:
            text = form.of_function(program) if code is target else form.of_object(target)
        if known.step_size is not None:  # into the sources, which the GUID is made of
            text += f"\n\nSTEP_SIZE = {known.step_size!r}  # s, of the law\n"
        texts[f"{folder}/{name}.py"] = text
        difference = _difference(known, texts, (folder, name))
        if not difference:
            return _ProgramRecipe(name, (folder, name), sources, texts=dict(sorted(texts.items())))
    raise refuse(f"its values would differ from those of {called} in Python: {difference}")


def _user_modules(code: Any) -> UserModules:
    """Return the modules beside a function or class; without a file, those of the working folder."""
    try:
        file = Path(inspect.getsourcefile(code) or "").resolve()
    except (TypeError, OSError):
        file = Path()
    if not file.is_file():  # in a notebook or an interactive session
        return UserModules(Path.cwd() / "__main__.py", "__main__")
    spec = getattr(sys.modules.get(code.__module__), "__spec__", None)
    return UserModules(file, spec.name if spec else code.__module__)


HEAD = '''"""{doc}"""

from __future__ import annotations

from collections import namedtuple
from dataclasses import dataclass, field, replace

from ..fmi.component import Component
from ..fmi.variables import VariableSpec
from .{module} import {called} as program


@dataclass(frozen=True)
class Parameters:
    """Its parameters."""

{fields}


Inputs = namedtuple("Inputs", {scalars!r})


def whole(x):
    return int(x) if x == int(x) else x


class Exported(Component):
    """{doc}"""

    fmu_name = {name!r}
    Parameters = Parameters
    inputs = {inputs}
    outputs = {outputs}
    sampled = {sampled}
'''
RESULT = "        return result if isinstance(result, (tuple, list)) else (result,)\n"
UNITLESS = '''

Exported.variables = tuple(replace(v, unit=None) if v.name in {names!r} else v for v in Exported.variables)
"""Python does not know the units of these."""
'''
CLASS = '''"""{doc}"""

from .{module} import {called} as program


class Exported(program):
    fmu_name = {name!r}


Exported.__doc__ = program.__doc__
'''


@dataclass(frozen=True)
class _Form:
    """Generator of the source of an exported component.

    Attributes:
        name: name of the FMU.
        called: the function or class in the program's module.
        known: the component that runs in this process.
        exact: keep integers as integers, and set attributes of a class before the constructor is called, as
            in Python; the translator supports neither.
    """

    name: str
    called: str
    known: type[Component]
    exact: bool

    def of_class(self) -> str:
        """Return a component class with another name."""
        return CLASS.format(**self._names())

    def of_function(self, program: Any) -> str:
        """Return a component that calls a function, or a `functools.partial` of it."""
        own = _parameters.of_function(program)
        first, named = getattr(program, "args", ()), getattr(program, "keywords", {})
        inputs = [v.name for v in self.known.variables if v.causality == "input"]
        passed = [literal(value, f"argument {k + 1} of {self.called}") for k, value in enumerate(first)]
        passed += [f"{name}=u[{k}]" for k, name in enumerate(inputs)]
        passed += ["t=t"] if "t" in inspect.signature(program).parameters else []
        passed += [f"{x}={literal(value, x)}" for x, value in named.items() if x not in own.values]
        passed += [f"{x}={self._value(x, value)}" for x, value in own.values.items()]
        call = f"\n    def output(self, t, u):\n        result = program({', '.join(passed)})\n"
        return self._head(own) + call + RESULT + self._unitless(own)

    def of_object(self, program: Any) -> str:
        """Return a component that creates an object and calls its methods."""
        names = [v.name for v in self.known.variables if v.causality != "parameter"]
        own = _parameters.of_object(program, names)
        passed = [f"{x}={literal(value, x)}" for x, value in own.fixed.items()]
        passed += [f"{x}={self._value(x, v)}" for x, v in own.values.items() if x not in own.attributes]
        attributes = [f"        made.{x} = {self._value(x, own.values[x])}\n" for x in sorted(own.attributes)]
        made = f"        made = program({', '.join(passed)})\n"
        if not own.values:  # as it is, however it came to be
            held = [(x, literal(value, f"{self.called}.{x}")) for x, value in vars(program).items()]
            made = "        made = program.__new__(program)\n"
            attributes = [f"        made.{x} = {text}\n" for x, text in held]
        elif self.exact:
            made = "        made = program.__new__(program)\n"
            attributes += [f"        made.__init__({', '.join(passed)})\n"]
        parts = ["\n    def configure(self):\n", made, *attributes, "        self.program = made\n"]
        if hasattr(program, "start"):
            parts.append("\n    def start(self, t, u):\n        self.configure()  # each is started once\n")
            parts.append("        self.program.start(t, Inputs(*u))\n")
        if hasattr(program, "advance"):
            parts.append(
                "\n    def advance(self, t, h, u):\n        self.program.advance(t, h, Inputs(*u))\n"
            )
        parts.append("\n    def output(self, t, u):\n        result = self.program.output(t, Inputs(*u))\n")
        return "".join([self._head(own), *parts, RESULT, self._unitless(own)])

    def _value(self, name: str, written: Any) -> str:
        is_whole = self.exact and type(arguments.plain(written)) is int
        return f"whole(self.p.{name})" if is_whole else f"self.p.{name}"

    def _head(self, own: ProgramParameters) -> str:
        specs = {name: made.metadata["declared"] for name, made in own.declared.items()}
        kinds = {"Real": "float", "Integer": "int", "Boolean": "bool", "String": "str"}
        fields = [
            f"    {x}: {kinds[spec.type]} = field(default={spec.start!r}, metadata={{'declared': {spec!r}}})"
            for x, spec in specs.items()
        ]
        return HEAD.format(
            fields="\n".join(fields),
            scalars=tuple(v.name for v in self.known.variables if v.causality == "input"),
            inputs=repr(self.known.inputs),
            outputs=repr(self.known.outputs),
            sampled=self.known.sampled,
            **self._names(),
        )

    def _names(self) -> dict[str, str]:
        doc = (self.known.__doc__ or self.called).strip().splitlines()[0].replace("\\", " ").replace('"', "'")
        return {"name": self.name, "module": f"{self.name}_program", "called": self.called, "doc": doc}

    @staticmethod
    def _unitless(own: ProgramParameters) -> str:
        return UNITLESS.format(names=tuple(sorted(own.unitless))) if own.unitless else ""


def _difference(known: PythonComponent, texts: dict[str, str], module: Parts) -> str:
    """Return how the values of a component in `texts` differ from those of a program, "" if they do not."""
    package = "yawbench_" + hashlib.sha256(repr(sorted(texts.items())).encode()).hexdigest()[:12]
    with staged(texts, package) as stage:
        made = stage.component(module)
        variables = made.variables
        inputs = [i for i, v in enumerate(variables) if v.causality == "input"]
        outputs = [i for i, v in enumerate(variables) if v.causality == "output"]
        walk = random_inputs(variables, made.fmu_name)
        rows = [next(walk) for _ in range(STEPS)]
        for setting, kind, refs, values, steps in _settings(variables):
            answers = []
            for component in (type("Known", (known.component,), {}), made):
                twin = Twin(component, Path(stage.folder))
                if refs:
                    twin.set(kind, refs, values)
                answers.append(list(_outputs(twin, inputs, outputs, rows[:steps])))
            for k, (expected, actual) in enumerate(zip(*answers, strict=False)):
                if expected != actual:
                    return f"{setting} at t = {k * STEP:.3f} s, {_shown(expected)} and {_shown(actual)}"
            if len(answers[0]) != len(answers[1]):
                return f"{setting}, only one of them ends early"
    return ""


def _settings(variables: Sequence[Any]) -> Iterator[tuple[str, str, list[int], list[Any], int]]:
    """Yield the settings of a comparison: label; type, references and values of parameters; steps."""
    other: dict[str, Callable[[Any], Any]] = {
        "Real": lambda x: 1.25 * x + 0.01,
        "Integer": lambda x: x + 1,
        "Boolean": lambda x: not x,
    }
    yield "as it is", "Real", [], [], STEPS
    for i, v in enumerate(variables):
        if v.causality != "parameter":
            continue
        values = range(1, 1 + len(v.choices)) if v.choices else (other[v.type](v.start),)
        for value in values:
            if v.maximum is None or v.type != "Real" or value <= v.maximum:
                yield f"with {v.name} = {value!r}", v.fmi_type, [i], [value], FEW


def _outputs(
    twin: Twin, inputs: list[int], outputs: list[int], rows: list[list[float]]
) -> Iterator[bytes | str]:
    """Yield the outputs of a component in every step, until it fails."""
    if inputs:
        twin.set("Real", inputs, rows[0])
    if not (twin.begin(0.0)[0] and twin.end_initialization()[0]):
        yield "it fails"
        return
    for k, row in enumerate(rows):
        if inputs:
            twin.set("Real", inputs, row)
        yield twin.get(outputs)[2]
        if not twin.step(k * STEP, STEP)[0]:
            yield "it fails"
            return


def _shown(values: bytes | str) -> str:
    return values if isinstance(values, str) else f"{struct.unpack(f'{len(values) // 8}d', values)}"
