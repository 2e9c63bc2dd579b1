"""Parameters of plain Python: default values of functions, and constructor arguments of objects.

An object has a parameter for every constructor argument that it stores under the same name, as in
scikit-learn, and for every number in the body of its class. With another value the object is created anew, so
that attributes derived by the constructor follow.
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
from types import CellType, CodeType, FunctionType, MethodType, ModuleType
from typing import Any, Literal, get_args, get_origin
from weakref import WeakKeyDictionary

import numpy as np

from yawbench.components.fmi.component import Component
from yawbench.components.fmi.variables import VariableSpec, parameter, parameter_class
from yawbench.fmus.fmu import Value
from yawbench.orchestrator.signal_names import SETTINGS

from . import arguments

PLAIN = (bool, int, float, str)
"""Python types of FMI values."""
DECLARATIONS = frozenset({"inputs", "outputs", "sampled", *SETTINGS})
"""Attributes of an object that are declarations, and settings of every instance."""
INSTALLED = tuple({sysconfig.get_path(name) for name in ("stdlib", "purelib", "platlib")})
"""Folders of Python and of installed packages."""
UNIT = "1"
"""Placeholder for undeclared units, until `without_units` removes it."""
_SOURCES: WeakKeyDictionary[CodeType, bytes] = WeakKeyDictionary()
"""Code of a function -> its source text."""


@dataclass(frozen=True)
class ProgramParameters:
    """Parameters of a function or an object.

    Attributes:
        values: name -> value in Python.
        declared: name -> result of `parameter`, in the same order.
        fixed: constructor arguments that are not parameters.
        attributes: names of parameters that are attributes of the class.
        unitless: names of parameters without a declared unit.
    """

    values: dict[str, Any] = field(default_factory=dict)
    declared: dict[str, Any] = field(default_factory=dict)
    fixed: dict[str, Any] = field(default_factory=dict)
    attributes: frozenset[str] = frozenset()
    unitless: frozenset[str] = frozenset()

    def __or__(self, other: ProgramParameters) -> ProgramParameters:
        """Return the parameters of both; constructor arguments are those of `other`."""
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
        """Return the values of a run in Python; an unchanged value is the original object.

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
    """Return the parameters of a function: arguments whose default value has an FMI type."""
    defaults = [p for p in _arguments_of(function) if p.default is not p.empty and p.name not in SETTINGS]
    return _declared({p.name: (p.default, p.annotation, None) for p in defaults})


def of_object(program: Any, signals: Sequence[str]) -> ProgramParameters:
    """Return the parameters of an object; none if its constructor cannot recreate the object.

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
    """Return a program in its state before a run, so that runs do not affect each other.

    Args:
        program: a function or an object.
        own: constructor parameters of an object.
        p: the parameters of the component.
    """
    values = own.chosen(p)
    same = all(values[name] is value for name, value in own.values.items())
    return copy.deepcopy(program) if same else _made_anew(program, own, values)


def _made_anew(program: Any, parameters: ProgramParameters, values: Mapping[str, Any]) -> Any:
    """Create an object like a program with other values of its parameters."""
    cls: Any = type(program)
    keywords = {
        name: copy.deepcopy(value)
        for name, value in {**parameters.fixed, **values}.items()
        if name not in parameters.attributes
    }
    made = cls.__new__(cls) if cls.__new__ is object.__new__ else cls.__new__(cls, **keywords)
    for name in parameters.attributes:  # before the constructor, which may use them
        if values[name] is not getattr(cls, name):
            object.__setattr__(made, name, values[name])
    if has_constructor(cls):
        made.__init__(**keywords)
    return made


def _arguments_of(function: Callable[..., Any]) -> list[inspect.Parameter]:
    try:
        return list(inspect.signature(function, eval_str=True).parameters.values())
    except Exception:  # an annotation that cannot be evaluated here
        return list(inspect.signature(function).parameters.values())


def brought_along(program: Any, component: type[Component]) -> dict[str, Value]:
    """Return the values of a program's parameters, unless it is a component class itself."""
    if isinstance(program, type):
        return {}
    return {v.name: v.start for v in component.variables if v.causality == "parameter"}


def text_of(program: Any) -> bytes:
    """Return a program's source text and state, as far as available, to distinguish programs."""
    parts = []
    for value in _reached([program], named=True):
        if isinstance(value, FunctionType):
            parts.append(_source_of(value))
            parts += map(
                _pickled, [value.__defaults__, value.__kwdefaults__, *_closed_over(value), *_used(value)]
            )
        elif issubclass(type(value), type):
            parts.append(_pickled({k: x for k, x in vars(value).items() if not k.startswith("__")}))
        else:
            parts.append(_pickled(value))
    return b"".join(parts)


def _source_of(function: FunctionType) -> bytes:
    """Return a function's source text, or its code where there is none.

    It is kept by the code of the innermost function, whose source `inspect` shows: finding it takes a
    millisecond, and a component has hundreds of functions.
    """
    try:
        inner = inspect.unwrap(function)
    except ValueError:  # wrapped in itself
        inner = function
    if not isinstance(inner, FunctionType):
        return _found_source(function)
    if inner.__code__ not in _SOURCES:
        _SOURCES[inner.__code__] = _found_source(inner)
    return _SOURCES[inner.__code__]


def _found_source(function: FunctionType) -> bytes:
    try:
        return inspect.getsource(function).encode()
    except Exception:  # there is none
        return function.__code__.co_code + _pickled(function.__code__.co_consts)


def functions_of(*programs: Any) -> list[FunctionType]:
    """Return the functions of programs: their own, those of their classes, and of their attributes.

    Args:
        programs: functions, classes, and objects.
    """
    return [value for value in _reached(programs) if isinstance(value, FunctionType)]


def _reached(programs: Sequence[Any], named: bool = False) -> list[Any]:
    """Return programs, their classes and all contained objects, except numbers and texts.

    Args:
        programs: functions, classes, and objects.
        named: include objects that their functions use by global names.
    """
    reached: dict[int, Any] = {}
    waiting = list(reversed(programs))
    while waiting:
        value = waiting.pop()
        if id(value) in reached or type(value) in (*PLAIN, type(None), np.ndarray):
            continue
        reached[id(value)] = value
        if isinstance(value, FunctionType):
            waiting += _closed_over(value)
            if named:
                waiting += [value.__defaults__, value.__kwdefaults__]
                waiting += [
                    x for x in _used(value) if not isinstance(x, (FunctionType, type)) or _is_of_user(x)
                ]
        elif issubclass(type(value), type):  # `isinstance` would ask the object
            waiting += value.__mro__[1:-1]
            waiting += [x for name, x in vars(value).items() if name != "__slotnames__"]  # added by pickle
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
        elif type(value) is functools.cached_property:
            waiting.append(value.func)
        elif type(value) is functools._lru_cache_wrapper:
            waiting.append(value.__wrapped__)
        elif any(value is program for program in programs) or _is_of_user(type(value)):
            waiting += [type(value), getattr(value, "__dict__", None)]
    return list(reached.values())


def _closed_over(function: FunctionType) -> list[Any]:
    return [cell.cell_contents for cell in function.__closure__ or () if not _is_empty(cell)]


def _used(function: FunctionType) -> list[Any]:
    """Return the objects that a function uses by names of its module, and of the user's modules it uses."""
    names: dict[str, None] = {}
    codes = [function.__code__]
    for code in codes:  # grows by nested code objects
        names |= dict.fromkeys(code.co_names)
        codes += [x for x in code.co_consts if isinstance(x, CodeType)]
    spaces, used = {id(function.__globals__): function.__globals__}, []
    waiting = list(spaces.values())
    for space in waiting:  # grows by nested modules
        there = [space[name] for name in names if name in space]
        modules = [vars(x) for x in there if isinstance(x, ModuleType) and _is_of_user(x)]
        waiting += [x for x in modules if id(x) not in spaces]
        spaces |= {id(x): x for x in modules}
        used += [x for x in there if not isinstance(x, ModuleType)]
    return used


def _is_of_user(value: Any) -> bool:
    """Return whether a function, class or module is neither Python's nor of an installed package."""
    module = value.__name__ if isinstance(value, ModuleType) else value.__module__ or ""
    file = getattr(sys.modules.get(module), "__file__", None) or ""
    return module != "builtins" and not file.startswith(INSTALLED)


def _is_empty(cell: CellType) -> bool:
    try:
        return cell.cell_contents is cell
    except ValueError:
        return True


def _pickled(value: Any) -> bytes:
    """Return a value as bytes; for unpicklable objects, their type and picklable values."""
    try:
        return pickle.dumps(value)
    except Exception:
        held = value if type(value) is dict else getattr(value, "__dict__", None)
        items = held.items() if held is not None else enumerate(value) if type(value) in (list, tuple) else ()
        plain = {name: x for name, x in items if type(x) in (*PLAIN, np.ndarray)}
        return type(value).__name__.encode() + pickle.dumps(plain)


def has_constructor(cls: type) -> bool:
    """Return whether a class has a constructor of its own."""
    return cls.__init__ is not object.__init__  # type: ignore[misc]


def _declared(candidates: Mapping[str, tuple[Any, Any, VariableSpec | None]]) -> ProgramParameters:
    """Return the parameters among values; others are left as they are.

    Args:
        candidates: name -> value, annotation, and declaration by `yawbench.parameter`, if any.
    """
    values, declared, unitless = {}, {}, set()
    for name, (value, annotation, spec) in candidates.items():
        start = arguments.plain(value)
        if type(start) not in PLAIN or (type(start) is float and not math.isfinite(start)):
            continue
        if type(start) is int and not (_is_named(annotation, "int") or abs(start) > 2**53):
            start = float(start)  # 20000 means a gain, but `n: int = 3` a count
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
    """Return the value of a run, as an integer where possible if it was an integer."""
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
    except Exception:  # cannot be compared
        return False
