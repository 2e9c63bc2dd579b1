"""Evaluation of calls of a component's own functions and classes (`built_in`: those of Python)."""

from __future__ import annotations

import abc
import ast
import copy
import dataclasses
import enum
import functools
import inspect
import operator
import sys
import types
from collections.abc import Sequence
from typing import Any

from . import ir
from . import values as v
from .attributes import is_generated, member
from .built_in import built_in, method_of, text_of
from .evaluate import Evaluator
from .read import names_set_by
from .stack import Call
from .values import UNSET, Refused, is_plain, like


def call(e: Evaluator, function: Any, args: list[Any], named: dict[str, Any]) -> Any:
    """Return the value of a call."""
    function = e.paths.narrowed(function)
    if isinstance(function, v.Union):
        return e.paths.by_form(function, lambda f: e.call(f, args, named))
    if isinstance(function, v.Picked):
        function = e.memory.loaded(function)
    if isinstance(function, v.Closure):
        names = _bound(function.node.args, args, named, function.defaults, function.named_defaults)
        frame = v.Frame(names, function.frame)
        call = Call(function.source, frame, base=frame, own=names_set_by(function.node))
        return e.outlining.run(call, function.node)
    if isinstance(function, v.Bound):
        if isinstance(function.function, str):
            return method_of(e, function.owner, function.function, args, named)
        of = function.function
        if isinstance(of, functools.partialmethod):
            return e.call(of.func, [function.owner, *of.args, *args], of.keywords | named)
        return e.call(of, [function.owner, *args], named)
    if isinstance(function, v.Instance):
        method = e.attributes.special(function, "__call__")
        if method is UNSET:
            raise Refused(f"a call of a {function.cls.__name__}")
        return e.call(method, args, named)
    if function is object.__setattr__ and not named:
        return e.attributes.set_as_object(*args)
    if is_generated(function) and args and dataclasses.is_dataclass(_class(args[0])):
        return _of_dataclass(e, function, args, named)
    if isinstance(function, types.MethodType) and isinstance(function.__func__, types.FunctionType):
        return e.call(function.__func__, [function.__self__, *args], named)
    if isinstance(function, functools._lru_cache_wrapper):
        if any(isinstance(x, ir.Var) and x.type != ir.INT and x not in e.fixed for x in args):
            raise Refused(f"{function.__name__} remembers results: of -0.0 it may return that of 0.0")
        function = function.__wrapped__
    if function is copy.deepcopy:
        return _copied(e, args[0], type(args[0]).__name__, {})
    if isinstance(function, types.FunctionType) and e.sources.contains(function):
        return _inlined(e, function, args, named)
    if type(function) is operator.itemgetter:
        keys = function.__reduce__()[1]
        picked = tuple(e.items.at(args[0], key) for key in keys)
        return picked if len(keys) > 1 else picked[0]
    if isinstance(function, functools.partial):
        return e.call(function.func, [*function.args, *args], function.keywords | named)
    if function is object.__new__ and isinstance(args[0], type):
        _makes_objects(args[0])
        return v.Instance(args[0])
    if isinstance(function, type) and not _is_python(function):
        return _made(e, function, args, named)
    method = e.attributes.special(function, "__call__")
    if method is not UNSET:
        return e.call(method, args, named)
    return built_in(e, function, args, named)


def _is_python(cls: type) -> bool:
    return cls.__module__ in ("array", "builtins", "itertools", "operator", "collections", "functools")


def _makes_objects(cls: type) -> None:
    """Refuse a class that makes objects in a way of its own."""
    if type(cls) not in (type, abc.ABCMeta) and type(cls).__name__ != "_ProtocolMeta":
        raise Refused(f"making a {cls.__name__}, whose class has a metaclass")
    if member(cls, "__new__") is not vars(object)["__new__"]:
        raise Refused(f"making a {cls.__name__}, which has a __new__ or is derived from a class of Python")
    if member(cls, "__del__") is not UNSET:
        raise Refused(f"making a {cls.__name__}, which has a __del__")


def _inlined(e: Evaluator, function: types.FunctionType, args: list[Any], named: dict[str, Any]) -> Any:
    source = e.sources.of(function)
    e.stack.entered = f"{source.file}:{source.node.lineno}" if source.file else e.stack.entered
    names = _bound(source.node.args, args, named, function.__defaults__ or (), function.__kwdefaults__ or {})
    return e.outlining.run(Call(source, v.Frame(names)), source.node)


def _bound(
    to: ast.arguments,
    args: list[Any],
    named: dict[str, Any],
    defaults: Sequence[Any],
    named_defaults: dict[str, Any],
) -> dict[str, Any]:
    positional = [a.arg for a in (*to.posonlyargs, *to.args)]
    names = dict(zip(positional, args, strict=False))
    twice = (names.keys() - {a.arg for a in to.posonlyargs}) & named.keys()
    if twice or any(a.arg in named for a in to.posonlyargs):
        raise Refused(f"two values for the argument {next(iter(twice or named))}")
    if to.vararg:
        names[to.vararg.arg] = tuple(args[len(positional) :])
    elif len(args) > len(positional):
        raise Refused("more arguments than parameters")
    rest = dict(named)
    for name in (*positional, *(a.arg for a in to.kwonlyargs)):
        if name in rest:
            names[name] = rest.pop(name)
    first = len(positional) - len(defaults)
    for name, value in (*zip(positional[first:], defaults, strict=True), *named_defaults.items()):
        names.setdefault(name, value)
    if to.kwarg:
        names[to.kwarg.arg] = v.Dict(rest)
    elif rest:
        raise Refused(f"no parameter is called {next(iter(rest))}")
    missing = [n for n in (*positional, *(a.arg for a in to.kwonlyargs)) if n not in names]
    if missing:
        raise Refused(f"no argument for {missing[0]}")
    return names


def _made(e: Evaluator, cls: type, args: list[Any], named: dict[str, Any]) -> Any:
    if isinstance(cls, enum.EnumMeta):
        if len(args) != 1 or not is_plain(args[0]) or named:
            raise Refused(f"a {cls.__name__} of a value that is only known at run time")
        return cls(args[0])
    if issubclass(cls, BaseException):
        if cls.__str__ is not BaseException.__str__ or any(
            isinstance(member(cls, name), types.FunctionType) for name in ("__init__", "__new__")
        ):
            raise Refused(f"a {cls.__name__}, which makes its message itself")
        return v.Failure(cls, text_of(args))
    if issubclass(cls, tuple) and hasattr(cls, "_fields"):
        made_by = next(base for base in cls.__mro__ if "__new__" in vars(base))
        if "_fields" not in vars(made_by):
            raise Refused(f"making a {cls.__name__}, which has a __new__")
        for name in ("__iter__", "__len__", "__getitem__", "__hash__"):
            if isinstance(member(cls, name), types.FunctionType):
                raise Refused(f"making a {cls.__name__}, a named tuple with a {name}")
        return cls(*args, **named)
    if issubclass(cls, (tuple, list, dict, int, float, str)):
        raise Refused(f"making a {cls.__name__}")
    _makes_objects(cls)
    made = v.Instance(cls)
    _initialized(e, made, args, named)
    return made


def _initialized(e: Evaluator, made: v.Instance, args: list[Any], named: dict[str, Any]) -> None:
    init = member(made.cls, "__init__")
    if init is object.__init__:
        if args or named:
            raise Refused(f"arguments of {made.cls.__name__}, which takes none")
    elif not isinstance(init, types.FunctionType):
        raise Refused(f"{made.cls.__name__}.__init__ is a {type(init).__name__}")
    else:
        e.call(init, [made, *args], named)


def _of_dataclass(e: Evaluator, function: types.FunctionType, args: list[Any], named: dict[str, Any]) -> Any:
    """Return the value of a call of a method that a dataclass has generated."""
    name, me = function.__name__, args[0]
    cls = next((x for x in _class(me).__mro__ if vars(x).get(name) is function), None)
    if cls is not None and name == "__init__" and isinstance(me, v.Instance):
        return _fill(e, me, cls, function, args[1:], named)
    if cls is not None and name == "__eq__" and len(args) == 2 and not named:
        return _equal_fields(e, me, args[1], cls)
    raise Refused(f"{name} of a dataclass")


def _equal_fields(e: Evaluator, me: Any, other: Any, cls: type) -> Any:
    if not (isinstance(me, v.Instance) and isinstance(other, v.Instance) and me.cls is other.cls):
        if isinstance(me, v.Instance) and isinstance(other, v.Instance):
            return NotImplemented
        if e.attributes.is_own(me) and e.attributes.is_own(other):
            raise Refused("comparing an object of the state with one of the module")
        return NotImplemented
    names = [f.name for f in dataclasses.fields(cls) if f.compare]
    pairs = [(e.attributes.of(me, name), e.attributes.of(other, name)) for name in names]
    return e.operators.all_equal(pairs, as_items=sys.version_info < (3, 13))


def _copied(e: Evaluator, value: Any, name: str, copies: dict[int, Any]) -> Any:
    """Return a copy of a Python object that the evaluation can change.

    Args:
        value: the object, or a part of it.
        name: name of the value in messages.
        copies: id of an object -> its copy.

    Raises:
        Refused: it contains other values than numbers, texts, functions, lists, objects of own classes.
    """
    if isinstance(value, (v.Box, v.Union, ir.Var, v.Closure, v.Bound, v.Picked)):
        if isinstance(value, ir.Var):
            return value
        raise Refused("a copy of what is computed at run time")
    if is_plain(value) or isinstance(value, (type, types.FunctionType, types.BuiltinFunctionType, enum.Enum)):
        return value
    if id(value) in copies:
        return copies[id(value)]
    if isinstance(value, functools.partial):
        passed = (value.func, *value.args, *value.keywords.values())
        if all(_copied(e, x, name, copies) is x for x in passed):
            return value
        raise Refused(f"{name} of something that may change cannot be copied")
    if isinstance(value, types.MethodType):
        return v.Bound(value.__func__, _copied(e, value.__self__, name, copies))
    if type(value) is tuple or hasattr(type(value), "_fields"):
        return like(value, [_copied(e, x, f"{name}[{k}]", copies) for k, x in enumerate(value)])
    made: v.Box
    held: dict[Any, Any]
    if type(value) is list:
        made, held = v.List([None] * len(value)), dict(enumerate(value))
    elif type(value) is dict:
        made, held = v.Dict({}), {e.items.key(key): x for key, x in value.items()}
    elif _is_its_attributes(value):
        made, held = v.Instance(type(value)), vars(value)
    else:
        raise Refused(f"{name}, of type {type(value).__name__}, cannot be copied")
    copies[id(value)] = made
    is_object = isinstance(made, v.Instance)
    for key, x in held.items():
        made.slots[key] = _copied(e, x, f"{name}.{key}" if is_object else f"{name}[{key!r}]", copies)
    return made


def _fill(
    e: Evaluator,
    made: v.Instance,
    cls: type,
    init: types.FunctionType,
    args: list[Any],
    named: dict[str, Any],
) -> None:
    """Do what the __init__ that a dataclass has generated does."""
    fields, signature = dataclasses.fields(cls), inspect.signature(init)
    try:
        given = signature.bind(made, *args, **named).arguments
    except TypeError as error:
        raise Refused(f"making a {cls.__name__}: {error}") from None
    names = [p.name for p in list(signature.parameters.values())[1:]]
    frozen = is_generated(vars(cls).get("__setattr__"))
    for f in fields:
        if f.name in given:
            value = given[f.name]
        elif f.default_factory is not dataclasses.MISSING:
            value = e.call(f.default_factory, [], {})
        elif f.init:
            value = f.default
        else:
            continue
        (e.attributes.set_as_object if frozen else e.attributes.set)(made, f.name, value)
    if member(cls, "__post_init__") is not UNSET:
        known = {f.name for f in fields}
        rest = [given.get(x, signature.parameters[x].default) for x in names if x not in known]
        e.call(e.attributes.of(made, "__post_init__"), rest, {})


def _class(value: Any) -> type:
    return value.cls if isinstance(value, v.Instance) else type(value)


class _Empty:
    """Class without slots or base, for comparison with other classes."""


def _is_its_attributes(value: Any) -> bool:
    """Return whether a Python object consists of its attributes, and has no copy method of its own."""
    cls: Any = type(value)
    ways = ("__reduce_ex__", "__reduce__", "__getstate__", "__setstate__", "__deepcopy__")
    return (
        cls.__basicsize__ == _Empty.__basicsize__
        and hasattr(value, "__dict__")
        and not any(vars(base).get("__slots__") for base in cls.__mro__)
        and all(getattr(cls, way, None) is getattr(_Empty, way, None) for way in ways)
    )
