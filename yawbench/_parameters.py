"""Parameters of plain Python: default values of functions, and constructor arguments of objects.

An object has a parameter for every argument of its constructor that it keeps under its own name, as in
scikit-learn, and for every number in the body of its class. Another value makes the object anew, so that
what the constructor derives follows.
"""

from __future__ import annotations

import copy
import dataclasses
import functools
import inspect
import math
import pickle
import sys
import sysconfig
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import CellType, FunctionType, MethodType
from typing import Any, Literal, get_args, get_origin

import numpy as np

from components.fmi.component import Component
from components.fmi.variables import VariableSpec, parameter, parameter_class
from orchestrator.plan import Value
from orchestrator.signal_names import SETTINGS

from . import arguments

PLAIN = (bool, int, float, str)
"""Types of the values that FMI has."""
DECLARATIONS = frozenset({"inputs", "outputs", "sampled", *SETTINGS})
"""Attributes of an object that declare it, and settings of every instance."""
INSTALLED = tuple({sysconfig.get_path(name) for name in ("stdlib", "purelib", "platlib")})
"""Folders of Python and of installed packages."""
UNIT = "1"
"""Placeholder for units that Python does not know, until `without_units` removes it."""


@dataclass(frozen=True)
class ProgramParameters:
    """The parameters of a function or an object.

    Attributes:
        values: name -> value in Python.
        declared: name -> what `parameter` returned, in the same order.
        fixed: arguments of the constructor that are not parameters.
        attributes: names of those that are attributes of the class.
        unitless: names of those without a declared unit.
    """

    values: dict[str, Any] = field(default_factory=dict)
    declared: dict[str, Any] = field(default_factory=dict)
    fixed: dict[str, Any] = field(default_factory=dict)
    attributes: frozenset[str] = frozenset()
    unitless: frozenset[str] = frozenset()

    def __or__(self, other: ProgramParameters) -> ProgramParameters:
        """Return the parameters of both; what an object is made with is that of `other`."""
        return replace(
            other,
            values=self.values | other.values,
            declared=self.declared | other.declared,
            unitless=self.unitless | other.unitless,
        )

    def members(self, name: str) -> dict[str, Any]:
        """Return the members of a component class that declare the parameters."""
        return {"Parameters": parameter_class(__name__, f"{name}Parameters", self.declared)}

    def chosen(self, p: Any) -> dict[str, Any]:
        """Return the values of a run as Python had them: one that is unchanged is the same object.

        Args:
            p: the parameters of the component.
        """
        return {name: _as_written(value, getattr(p, name)) for name, value in self.values.items()}

    def without_units(self, component: type[Component]) -> type[Component]:
        """Return a component class whose parameters have units only where they were declared."""
        component.variables = tuple(
            replace(v, unit=None) if v.name in self.unitless and v.causality == "parameter" else v
            for v in component.variables
        )
        return component


def of_function(function: Callable[..., Any]) -> ProgramParameters:
    """Return the parameters of a function: its arguments with a default value that FMI has."""
    defaults = [p for p in _arguments_of(function) if p.default is not p.empty and p.name not in SETTINGS]
    return _declared({p.name: (p.default, p.annotation, None) for p in defaults})


def of_object(program: Any, signals: Sequence[str]) -> ProgramParameters:
    """Return the parameters of an object; none if its constructor does not make the same object again.

    Args:
        program: the object.
        signals: names of its inputs and outputs, which are not parameters.
    """
    cls = type(program)
    try:
        accepted = _arguments_of(cls.__init__)[1:] if has_constructor(cls) else []
    except (TypeError, ValueError):  # written in C
        return ProgramParameters()
    named = [p for p in accepted if p.kind in (p.POSITIONAL_OR_KEYWORD, p.KEYWORD_ONLY)]
    kept = {p.name: getattr(program, p.name) for p in named if hasattr(program, p.name)}
    fields = {f.name: f for f in dataclasses.fields(cls)} if dataclasses.is_dataclass(cls) else {}
    unfit = DECLARATIONS.union(signals)
    own = {
        p.name: (
            kept[p.name],
            p.annotation,
            fields[p.name].metadata.get("declared") if p.name in fields else None,
        )
        for p in named
        if p.name in kept and p.name not in unfit
    }
    attributes: dict[str, Any] = {}
    for base in reversed(cls.__mro__[:-1]):
        attributes |= {
            name: (getattr(program, name), inspect.get_annotations(base).get(name), None)
            for name, value in vars(base).items()
            if type(value) in PLAIN and not name.startswith("_") and name not in unfit and name not in kept
        }
    made = _declared(own | attributes)
    if not made.values:
        return made
    fixed = {name: value for name, value in kept.items() if name not in made.values}
    made = replace(made, fixed=fixed, attributes=frozenset(attributes) & frozenset(made.values))
    try:
        again = _made_anew(program, made, made.values)
        same = _alike(vars(again), vars(program)) if hasattr(program, "__dict__") else True
        same = same and all(_alike(getattr(again, name), value) for name, value in made.values.items())
    except Exception:  # the user's constructor may raise anything
        same = False
    return made if same else ProgramParameters()


def fresh(program: Any, own: ProgramParameters, p: Any) -> Any:
    """Return a program as it is before a run, so that no run affects the next one.

    Args:
        program: a function or an object.
        own: parameters that an object is made with.
        p: the parameters of the component.
    """
    values = own.chosen(p)
    same = all(values[name] is value for name, value in own.values.items())
    return copy.deepcopy(program) if same else _made_anew(program, own, values)


def _made_anew(program: Any, parameters: ProgramParameters, values: Mapping[str, Any]) -> Any:
    """Return an object like a program, made with other values of its parameters."""
    cls: Any = type(program)
    keywords = {
        name: copy.deepcopy(value)
        for name, value in {**parameters.fixed, **values}.items()
        if name not in parameters.attributes
    }
    made = cls.__new__(cls) if cls.__new__ is object.__new__ else cls.__new__(cls, **keywords)
    for name in parameters.attributes:  # before the constructor, which may derive something from them
        if values[name] is not getattr(cls, name):
            object.__setattr__(made, name, values[name])
    if has_constructor(cls):
        made.__init__(**keywords)
    return made


def _arguments_of(function: Callable[..., Any]) -> list[inspect.Parameter]:
    try:
        return list(inspect.signature(function, eval_str=True).parameters.values())
    except Exception:  # an annotation that has no meaning here
        return list(inspect.signature(function).parameters.values())


def brought_along(program: Any, component: type[Component]) -> dict[str, Value]:
    """Return the values of the parameters that a program has, unless it is a component class itself."""
    if isinstance(program, type):
        return {}
    return {v.name: v.start for v in component.variables if v.causality == "parameter"}


def text_of(program: Any) -> bytes:
    """Return a program's source text and state, as far as Python knows them, to distinguish programs."""
    parts = [] if isinstance(program, (type, FunctionType)) else [_pickled(program)]
    for function in functions_of(program, named=True):
        try:
            parts.append(inspect.getsource(function).encode())
        except Exception:  # there is none
            parts.append(function.__code__.co_code + _pickled(function.__code__.co_consts))
        values = [function.__defaults__, function.__kwdefaults__]
        values += [cell.cell_contents for cell in function.__closure__ or () if not _is_empty(cell)]
        values += [function.__globals__.get(name) for name in function.__code__.co_names]
        parts += map(_pickled, values)
    return b"".join(parts)


def functions_of(*programs: Any, named: bool = False) -> list[FunctionType]:
    """Return the functions of programs: their own, of their classes, and of what they hold.

    Args:
        programs: functions, classes, and objects.
        named: with those of the user that they call by the names of modules.
    """
    functions: list[FunctionType] = []
    waiting, seen = list(reversed(programs)), set()
    while waiting:
        value = waiting.pop()
        if id(value) in seen or type(value) in (*PLAIN, type(None), np.ndarray):
            continue
        seen.add(id(value))
        if isinstance(value, FunctionType):
            functions.append(value)
            waiting += [cell.cell_contents for cell in value.__closure__ or () if not _is_empty(cell)]
            if named:
                there = (value.__globals__.get(name) for name in value.__code__.co_names)
                waiting += [x for x in there if isinstance(x, (FunctionType, type)) and _is_of_user(x)]
        elif issubclass(type(value), type):  # `isinstance` would ask the object
            waiting += [x for base in value.__mro__[:-1] for x in vars(base).values()]
        elif type(value) in (list, tuple):
            waiting += value
        elif type(value) is dict:
            waiting += value.values()
        elif type(value) is functools.partial:
            waiting += [value.func, *value.args, *value.keywords.values()]
        elif type(value) is MethodType:
            waiting += [value.__func__, value.__self__]
        elif type(value) in (classmethod, staticmethod) and isinstance(value.__func__, FunctionType):
            waiting.append(value.__func__)
        elif type(value) is property:
            waiting += [value.fget, value.fset]
        elif any(value is program for program in programs) or _is_of_user(type(value)):
            waiting += [type(value), getattr(value, "__dict__", None)]
    return functions


def _is_of_user(value: Any) -> bool:
    """Return whether a function or class is neither Python's nor of an installed package."""
    file = getattr(sys.modules.get(value.__module__ or ""), "__file__", None) or ""
    return value.__module__ != "builtins" and not file.startswith(INSTALLED)


def _is_empty(cell: CellType) -> bool:
    try:
        return cell.cell_contents is cell
    except ValueError:
        return True


def _pickled(value: Any) -> bytes:
    try:
        return pickle.dumps(value)
    except Exception:
        return type(value).__name__.encode()


def has_constructor(cls: type) -> bool:
    """Return whether a class has a constructor of its own."""
    return cls.__init__ is not object.__init__  # type: ignore[misc]


def _declared(candidates: Mapping[str, tuple[Any, Any, VariableSpec | None]]) -> ProgramParameters:
    """Return the parameters among values; others are left as they are.

    Args:
        candidates: name -> value, annotation, and what was declared by `yawbench.parameter`, if anything.
    """
    values, declared, unitless = {}, {}, set()
    for name, (value, annotation, spec) in candidates.items():
        start = arguments.plain(value)
        if type(start) not in PLAIN or (type(start) is float and not math.isfinite(start)):
            continue
        if type(start) is int and not (_is_named(annotation, "int") or abs(start) > 2**53):
            start = float(start)  # 20000 means a gain, but `n: int = 3` a number of things
        if type(start) is int and not -(2**31) <= start < 2**31:
            continue
        choices = get_args(annotation) if get_origin(annotation) is Literal else None
        unit = UNIT if type(start) is float else None
        if spec is None:
            declared[name] = parameter(start, unit, name.replace("_", " "), choices=choices)
            unitless |= {name} if unit else set()
        else:
            spec = replace(spec, start=type(spec.start)(start))
            declared[name] = field(default=spec.start, metadata={"declared": spec})
        values[name] = value
    return ProgramParameters(values, declared, unitless=frozenset(unitless))


def _is_named(annotation: Any, name: str) -> bool:
    return bool(getattr(annotation, "__name__", annotation) == name)


def _as_written(written: Any, value: Any) -> Any:
    """Return the value of a run; integers stay integers where possible."""
    plain = arguments.plain(written)
    if type(value) in (bool, str):
        return written if plain == value else value
    if plain == value and math.copysign(1.0, plain) == math.copysign(1.0, value):
        return written
    return int(value) if type(plain) is int and value == int(value) else value


def _alike(first: Any, second: Any) -> bool:
    """Return whether two values are the same for a computation."""
    if first is second:
        return True
    if type(first) is not type(second):
        return False
    if isinstance(first, dict):
        return first.keys() == second.keys() and all(_alike(first[key], second[key]) for key in first)
    if isinstance(first, np.ndarray):
        return bool(np.array_equal(first, second, equal_nan=first.dtype.kind in "fc"))
    try:
        return bool(first == second) or pickle.dumps(first) == pickle.dumps(second)
    except Exception:  # what cannot be compared
        return False
