"""Evaluation of calls of a component's own functions and classes (`built_in`: those of Python)."""

from __future__ import annotations

import ast
import copy
import dataclasses
import functools
import inspect
import operator
import types
from collections.abc import Sequence
from typing import Any

from . import ir
from .built_in import BuiltIn
from .evaluate import DEEPEST, Call
from .read import names_set_by
from .statements import EXIT, ON, RESULT, RETURN
from .values import (
    ANY,
    Bound,
    Box,
    Closure,
    Dict,
    Failure,
    Frame,
    Instance,
    List,
    Picked,
    Refused,
    Union,
    is_plain,
    like,
)


class Calling(BuiltIn):
    """Calls of functions, methods, classes and built-in functions."""

    def _call(self, node: ast.Call) -> Any:
        if isinstance(node.func, ast.Name) and node.func.id == "super":
            raise Refused("super() outside a call of a method")
        function = self._called(node.func)
        args = self.values(node.args)
        named: dict[str, Any] = {}
        for keyword in node.keywords:
            value = self.evaluate(keyword.value)
            if keyword.arg is None:
                named |= self.read(value) if isinstance(value, Dict) else value
            else:
                named[keyword.arg] = value
        self.at(node)
        return self.by_form(function, lambda f: self.call(f, args, named))

    def _called(self, node: ast.expr) -> Any:
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Call):
            inner = node.value.func
            if isinstance(inner, ast.Name) and inner.id == "super" and not node.value.args:
                return self._of_base(node.attr)
        return self.evaluate(node)

    def _of_base(self, name: str) -> Any:
        call = self.calls[-1]
        cls, frame = call.source.cells.get("__class__"), call.frame
        while frame.parent is not None:
            frame = frame.parent
        me = frame.slots[call.source.node.args.args[0].arg]
        if not isinstance(me, Instance) or cls is None:
            raise Refused("super() outside a method")
        mro = me.cls.__mro__
        for base in mro[mro.index(cls) + 1 :]:
            if name in base.__dict__:
                member = base.__dict__[name]
                if isinstance(member, types.FunctionType):
                    return Bound(member, me)
                if name == "__init__":
                    return lambda: None
                raise Refused(f"super().{name}")
        raise Refused(f"super().{name}")

    def call(self, function: Any, args: Sequence[Any], named: dict[str, Any]) -> Any:
        """Return the value of a call."""
        function = self.narrowed(function)
        args = list(args)
        if isinstance(function, Union):
            return self.by_form(function, lambda f: self.call(f, args, named))
        if isinstance(function, Picked):
            function = self.loaded(function)
        if isinstance(function, Closure):
            names = self._bound(function.node.args, args, named, function.defaults, function.named_defaults)
            frame = Frame(names, function.frame)
            call = Call(function.source, frame, base=frame, own=names_set_by(function.node))
            return self._run(call, function.node)
        if isinstance(function, Bound):
            if isinstance(function.function, str):
                return self._method(function.owner, function.function, args, named)
            if isinstance(function.owner, Instance) and function.function is function.owner.cls.__init__:  # type: ignore[misc]
                return self._initialized(function.owner, args, named)
            return self.call(function.function, [function.owner, *args], named)
        if isinstance(function, Instance):
            return self.call(self.attribute(function, "__call__"), args, named)
        if isinstance(function, types.MethodType):
            return self.call(function.__func__, [function.__self__, *args], named)
        if isinstance(function, functools._lru_cache_wrapper):
            function = function.__wrapped__
        if function is copy.deepcopy:
            return self._copied(args[0], type(args[0]).__name__, {})
        if isinstance(function, types.FunctionType) and self.sources.contains(function):
            return self._inlined(function, args, named)
        if isinstance(function, operator.itemgetter):
            keys = function.__reduce__()[1]
            picked = tuple(self.subscript(args[0], key) for key in keys)
            return picked if len(keys) > 1 else picked[0]
        if isinstance(function, functools.partial):
            return self.call(function.func, [*function.args, *args], function.keywords | named)
        if function is object.__new__ and isinstance(args[0], type):
            return Instance(args[0])
        if isinstance(function, type) and not self._is_python(function):
            return self._made(function, args, named)
        of_object = inspect.getattr_static(type(function), "__call__", None)
        if isinstance(of_object, types.FunctionType) and self.sources.contains(of_object):
            return self._inlined(of_object, [function, *args], named)
        return self._built_in(function, args, named)

    @staticmethod
    def _is_python(cls: type) -> bool:
        return cls.__module__ in ("array", "builtins", "itertools", "operator", "collections", "functools")

    # ---- functions of the component ---------------------------------------------------------

    def _inlined(self, function: types.FunctionType, args: list[Any], named: dict[str, Any]) -> Any:
        source = self.sources.of(function)
        self.entered = f"{source.file}:{source.node.lineno}" if source.file else self.entered
        names = self._bound(
            source.node.args, args, named, function.__defaults__ or (), function.__kwdefaults__ or {}
        )
        return self._run(Call(source, Frame(names)), source.node)

    def _run(self, call: Call, node: ast.FunctionDef | ast.Lambda) -> Any:
        return self.inside(call, node)

    def inside(self, call: Call, node: ast.FunctionDef | ast.Lambda) -> Any:
        """Return the value of a function, evaluated in place."""
        if len(self.calls) > DEEPEST:
            raise Refused("recursion whose depth is only known at run time")
        self.calls.append(call)
        try:
            if isinstance(node, ast.Lambda):
                return self.evaluate(node.body)
            call.frame.slots |= {EXIT: ON, RESULT: ANY}
            self.block(node.body)
            how, result = self.exit, self.narrowed(call.frame.slots[RESULT])
            if isinstance(how, ir.Var):
                return self.branch(self.compare("==", how, RETURN), lambda: result, lambda: None)
            return result if how == RETURN else None
        finally:
            self.calls.pop()

    def _bound(
        self,
        to: ast.arguments,
        args: list[Any],
        named: dict[str, Any],
        defaults: Sequence[Any],
        named_defaults: dict[str, Any],
    ) -> dict[str, Any]:
        positional = [a.arg for a in (*to.posonlyargs, *to.args)]
        names = dict(zip(positional, args, strict=False))
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
            names[to.kwarg.arg] = Dict(rest)
        elif rest:
            raise Refused(f"no parameter is called {next(iter(rest))}")
        missing = [n for n in (*positional, *(a.arg for a in to.kwonlyargs)) if n not in names]
        if missing:
            raise Refused(f"no argument for {missing[0]}")
        return names

    def _made(self, cls: type, args: list[Any], named: dict[str, Any]) -> Any:
        if issubclass(cls, BaseException):
            return Failure(cls, self._text(args))
        if issubclass(cls, tuple) and hasattr(cls, "_fields"):
            return cls(*args, **named)
        if issubclass(cls, (tuple, list, dict, int, float, str)):
            raise Refused(f"making a {cls.__name__}")
        made = Instance(cls)
        self._initialized(made, args, named)
        return made

    def _initialized(self, made: Instance, args: list[Any], named: dict[str, Any]) -> None:
        init = made.cls.__init__  # type: ignore[misc]
        own = isinstance(init, types.FunctionType) and self.sources.contains(init)
        if dataclasses.is_dataclass(made.cls) and not own:
            self._fill(made, made.cls, args, named)
        elif isinstance(init, types.FunctionType):
            self.call(init, [made, *args], named)

    def _copied(self, value: Any, name: str, copies: dict[int, Any]) -> Any:
        """Return a copy of a Python object that the evaluation can change.

        Args:
            value: the object, or a part of it.
            name: name of the value in messages.
            copies: id of an object -> its copy.

        Raises:
            Refused: it contains other values than numbers, texts, functions, lists, objects of own classes.
        """
        if is_plain(value) or isinstance(value, (type, types.FunctionType, types.BuiltinFunctionType)):
            return value
        if id(value) in copies:
            return copies[id(value)]
        if isinstance(value, functools.partial):
            passed = (value.func, *value.args, *value.keywords.values())
            if all(self._copied(x, name, copies) is x for x in passed):
                return value
            raise Refused(f"{name} of something that may change cannot be copied")
        if isinstance(value, types.MethodType):
            return Bound(value.__func__, self._copied(value.__self__, name, copies))
        if isinstance(value, tuple):
            return like(value, [self._copied(x, f"{name}[{k}]", copies) for k, x in enumerate(value)])
        made: Box
        held: dict[Any, Any]
        if type(value) is list:
            made, held = List([None] * len(value)), dict(enumerate(value))
        elif type(value) is dict:
            made, held = Dict({}), {self._key(key): x for key, x in value.items()}
        elif _is_its_attributes(value):
            made, held = Instance(type(value)), vars(value)
        else:
            raise Refused(f"{name}, of type {type(value).__name__}, cannot be copied")
        copies[id(value)] = made
        is_object = isinstance(made, Instance)
        for key, x in held.items():
            made.slots[key] = self._copied(x, f"{name}.{key}" if is_object else f"{name}[{key!r}]", copies)
        return made

    def _fill(self, made: Instance, cls: type, args: list[Any], named: dict[str, Any]) -> None:
        fields = [f for f in dataclasses.fields(cls) if f.init]
        arguments = dict(zip([f.name for f in fields], args, strict=False)) | named
        for f in fields:
            if f.name in arguments:
                value = arguments[f.name]
            elif f.default is not dataclasses.MISSING:
                value = f.default
            elif f.default_factory is not dataclasses.MISSING:
                value = self.call(f.default_factory, [], {})
            else:
                raise Refused(f"{cls.__name__} needs {f.name}")
            made.slots[f.name] = value
        if hasattr(cls, "__post_init__"):
            self.call(cls.__post_init__, [made], {})


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
