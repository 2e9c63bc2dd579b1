"""Attributes of objects, classes and modules: what Python does when one is read or set, and special methods.

An attribute is looked up as by `object.__getattribute__`: a data descriptor of the class (a property, a slot)
goes before the object's own attributes, these before the class's, and `__getattr__` comes last. What a class
does in another way is refused. No code of a component is called here: it is evaluated, like all other code.
"""

from __future__ import annotations

import enum
import functools
import types
from collections.abc import Callable, Sequence
from typing import Any

from . import ir
from . import values as v
from .paths import Paths
from .values import UNSET, Refused, is_number, is_plain, read

_KINDS: dict[type, type] = {v.List: list, v.Ring: list, v.Dict: dict, v.Text: str}
_OF_EVALUATION = (ir.Var, v.Union, v.Picked, v.Closure, v.Bound, v.Text, v.Bytes, v.Span, v.Failure)
"""Values of the evaluation that stand for Python's own objects."""
_BUILT_IN = (
    types.MethodDescriptorType,
    types.ClassMethodDescriptorType,
    types.WrapperDescriptorType,
    types.BuiltinFunctionType,
)
_COMPUTED = tuple({types.DynamicClassAttribute, getattr(enum, "property", types.DynamicClassAttribute)})
_METACLASSES = ("type", "ABCMeta", "EnumMeta", "EnumType", "_ProtocolMeta", "NamedTupleMeta")
_OF_TYPE = ("__name__", "__qualname__", "__module__", "__doc__", "__mro__")


def member(cls: type, name: str) -> Any:
    """Return what a class or one of its bases has under a name, as it is there; `UNSET` if nothing."""
    return next((vars(base)[name] for base in cls.__mro__ if name in vars(base)), UNSET)


def is_generated(function: Any) -> bool:
    """Return whether a function is one that a dataclass or a named tuple has generated."""
    return isinstance(function, types.FunctionType) and function.__code__.co_filename.startswith("<string>")


def _is_data(raw: Any) -> bool:
    return any(member(type(raw), name) is not UNSET for name in ("__set__", "__delete__"))


def _has_own(cls: type, name: str) -> bool:
    return isinstance(member(cls, name), types.FunctionType)


Caller = Callable[[Any, Sequence[Any], dict[str, Any]], Any]
"""Evaluates a call of a function with arguments and named arguments."""


class Attributes:
    """Attributes and special methods."""

    def __init__(self, paths: Paths, call: Caller) -> None:
        self.lower, self.memory, self.paths, self.call = paths.lower, paths.memory, paths, call

    def of(self, owner: Any, name: str, missing: Callable[[], Any] | None = None) -> Any:
        """Return an attribute, or what `missing` returns if there is none.

        Raises:
            Refused: there is none, or Python finds it in a way that is not translated.
        """
        if isinstance(owner, v.Picked):
            owner = self.memory.loaded(owner)
        if isinstance(owner, v.Union):
            return self.paths.by_form(owner, lambda x: self.of(x, name, missing))
        if type(owner) in _KINDS:
            if hasattr(_KINDS[type(owner)], name):
                return v.Bound(name, owner)
            return self._missing(type(owner).__name__.lower(), name, missing)
        if owner is None and not hasattr(None, name):
            if missing:
                return missing()
            self.lower.end("AttributeError", f"'NoneType' object has no attribute '{name}'")
        if isinstance(owner, _OF_EVALUATION) or (
            isinstance(owner, v.Box) and not isinstance(owner, v.Instance)
        ):
            raise Refused(f"the attribute {name} of a {type(owner).__name__}")
        if isinstance(owner, type):
            return self._of_class(owner, name, missing)
        if isinstance(owner, types.ModuleType):
            if name in vars(owner):
                return vars(owner)[name]
            raise Refused(f"{owner.__name__} has no attribute {name}, or computes it")
        cls = owner.cls if isinstance(owner, v.Instance) else type(owner)
        if cls.__module__ == "builtins" or isinstance(owner, functools.partial):
            return (
                getattr(owner, name) if hasattr(owner, name) else self._missing(cls.__name__, name, missing)
            )
        return self._of_object(owner, cls, name, missing)

    def _missing(self, cls: str, name: str, missing: Callable[[], Any] | None) -> Any:
        if missing is None:
            raise Refused(f"{cls} has no attribute {name}")
        return missing()

    def _of_object(self, owner: Any, cls: type, name: str, missing: Callable[[], Any] | None) -> Any:
        if not isinstance(member(cls, "__getattribute__"), types.WrapperDescriptorType):
            raise Refused(f"{cls.__name__} has a __getattribute__")
        raw = member(cls, name)
        if name == "__class__" and raw is vars(object)["__class__"]:
            return cls
        fallback = member(cls, "__getattr__")

        def otherwise() -> Any:
            if raw is not UNSET:
                return self._bound_to(raw, owner, cls, name)
            if fallback is UNSET:
                return self._missing(cls.__name__, name, missing)
            if missing is not None or not isinstance(fallback, types.FunctionType):
                raise Refused(f"{cls.__name__} has a __getattr__")
            return self.call(fallback, [owner, name], {})

        if raw is not UNSET and _is_data(raw):
            if fallback is not UNSET or missing is not None:
                return self._without_attribute_errors(cls, name, otherwise)
            return otherwise()
        held = self._held(owner).get(name, UNSET)
        if held is UNSET:
            return otherwise()
        if not (isinstance(held, v.Union) and UNSET in held.alternatives):
            return held
        nowhere = raw is UNSET and fallback is UNSET and missing is None

        def use(x: Any) -> Any:
            if x is UNSET and nowhere:
                self.lower.end("AttributeError", f"'{cls.__name__}' object has no attribute '{name}'")
            return otherwise() if x is UNSET else x

        return self.paths.by_form(held, use)

    def _held(self, owner: Any) -> Any:
        """Return the attributes that an object itself has."""
        if isinstance(owner, v.Instance):
            return read(owner)
        return vars(owner) if hasattr(type(owner), "__dict__") and hasattr(owner, "__dict__") else {}

    def _without_attribute_errors(self, cls: type, name: str, evaluated: Callable[[], Any]) -> Any:
        """Return a value whose evaluation must raise no AttributeError, which Python would take otherwise."""
        start = len(self.lower.out)
        try:
            return evaluated()
        finally:
            if any(
                isinstance(s, ir.Raise) and s.kind == "AttributeError"
                for s in ir.every(self.lower.out[start:])
            ):
                raise Refused(
                    f"{cls.__name__}.{name} may raise an AttributeError, with another value instead"
                )

    def _bound_to(self, raw: Any, owner: Any, cls: type, name: str) -> Any:
        """Return the value of a class's attribute for an object of the class (`descriptor.__get__`)."""
        if isinstance(raw, types.FunctionType):
            return v.Bound(raw, owner)
        if isinstance(raw, staticmethod):
            return raw.__func__
        if isinstance(raw, classmethod) and isinstance(raw.__func__, types.FunctionType):
            return v.Bound(raw.__func__, cls)
        if type(raw) is functools.partialmethod and isinstance(raw.func, types.FunctionType):
            return v.Bound(raw, owner)
        if isinstance(raw, property) and not _has_own(type(raw), "__get__"):
            if raw.fget is None:
                raise Refused(f"{cls.__name__}.{name} cannot be read")
            return self.call(raw.fget, [owner], {})
        if type(raw) is functools.cached_property:
            if not isinstance(owner, v.Instance) or cls.__dictoffset__ == 0:
                raise Refused(f"{cls.__name__}.{name} is computed when it is first read")
            value = self.call(raw.func, [owner], {})
            self.paths.write(owner, raw.attrname, value)
            return value
        if isinstance(raw, types.MemberDescriptorType):
            held = self._held(owner).get(name, UNSET) if isinstance(owner, v.Instance) else raw.__get__(owner)
            if held is UNSET or (isinstance(held, v.Union) and UNSET in held.alternatives):
                raise Refused(f"{cls.__name__}.{name} may have no value")
            return held
        if isinstance(raw, _COMPUTED) and type(raw).__module__ in ("enum", "types"):
            return getattr(owner, name)
        if isinstance(owner, tuple) and name in getattr(cls, "_fields", ()):
            return tuple.__getitem__(owner, cls._fields.index(name))  # type: ignore[attr-defined]
        getter = member(type(raw), "__get__")
        if getter is UNSET:
            return raw
        if isinstance(raw, _BUILT_IN) and not isinstance(owner, v.Instance):
            return getattr(owner, name)
        if isinstance(getter, types.FunctionType) and not isinstance(raw, functools.partialmethod):
            return self.call(getter, [raw, owner, cls], {})
        raise Refused(f"{cls.__name__}.{name} is a {type(raw).__name__}")

    def _of_class(self, owner: type, name: str, missing: Callable[[], Any] | None) -> Any:
        kind = type(owner)
        if isinstance(owner, enum.EnumMeta) and name in owner.__members__:
            return owner.__members__[name]
        if kind.__name__ not in _METACLASSES:
            raise Refused(f"{owner.__name__} has a metaclass")
        raw = member(owner, name)
        if raw is UNSET or name in _OF_TYPE:
            if name in _OF_TYPE:
                return getattr(owner, name)
            return self._missing(owner.__name__, name, missing)
        if isinstance(raw, (types.FunctionType, type)):
            return raw
        if isinstance(raw, staticmethod):
            return raw.__func__
        if isinstance(raw, classmethod) and isinstance(raw.__func__, types.FunctionType):
            return v.Bound(raw.__func__, owner)
        if isinstance(raw, _BUILT_IN):
            return getattr(owner, name)
        getter = member(type(raw), "__get__")
        if getter is UNSET:
            return raw
        if isinstance(getter, types.FunctionType) and type(raw).__module__ != "functools":
            return self.call(getter, [raw, None, owner], {})
        raise Refused(f"{owner.__name__}.{name}, which is a {type(raw).__name__}")

    def of_base(self, me: Any, after: type, name: str) -> Any:
        """Return super(after, me).name."""
        cls = me.cls if isinstance(me, v.Instance) else me if isinstance(me, type) else type(me)
        if not (isinstance(me, (v.Instance, type)) and after in cls.__mro__):
            raise Refused("super() outside a method")
        bases = cls.__mro__[cls.__mro__.index(after) + 1 :]
        raw = next((vars(base)[name] for base in bases if name in vars(base)), UNSET)
        if raw is UNSET or isinstance(me, type):
            if isinstance(raw, classmethod) and isinstance(raw.__func__, types.FunctionType):
                return v.Bound(raw.__func__, me)
            raise Refused(f"super().{name}")
        if raw is object.__init__:
            return lambda: None
        if raw is object.__setattr__:
            return v.Bound(raw, me)
        if isinstance(raw, _BUILT_IN):
            raise Refused(f"super().{name}")
        return self._bound_to(raw, me, cls, name)

    def has(self, owner: Any, name: str) -> Any:
        """Return hasattr(owner, name)."""
        if is_number(owner) and not isinstance(owner, ir.Var):
            return hasattr(owner, name)
        if isinstance(owner, v.Instance) and isinstance(member(owner.cls, name), property):
            raise Refused(f"hasattr of the property {name}")
        nothing = object()
        value = self.of(owner, name, lambda: nothing)
        return self.paths.by_form(value, lambda x: x is not nothing)

    def set(self, owner: Any, name: str, value: Any) -> None:
        """Set an attribute of an instance."""
        self.paths.by_form(owner, lambda x: self._set(x, name, value))

    def _set(self, owner: Any, name: str, value: Any) -> None:
        if not isinstance(owner, v.Instance):
            what = f"class {owner.__name__}" if isinstance(owner, type) else type(owner).__name__
            raise Refused(f"setting an attribute of a {what}")
        setter = member(owner.cls, "__setattr__")
        if setter is object.__setattr__:
            self.set_as_object(owner, name, value)
        elif is_generated(setter) or not isinstance(setter, types.FunctionType):
            raise Refused(f"setting {name} of a {owner.cls.__name__}, which is frozen")
        else:
            self.call(setter, [owner, name, value], {})

    def set_as_object(self, owner: Any, name: str, value: Any) -> None:
        """Set an attribute as object.__setattr__ does."""
        if not isinstance(owner, v.Instance) or not isinstance(name, str):
            raise Refused("object.__setattr__ of this object")
        cls = owner.cls
        raw = member(cls, name)
        if raw is UNSET or not _is_data(raw):
            if cls.__dictoffset__ == 0:
                raise Refused(f"{cls.__name__} has no place for an attribute {name}")
            self.paths.write(owner, name, value)
        elif isinstance(raw, types.MemberDescriptorType):
            self.paths.write(owner, name, value)
        elif isinstance(raw, property) and not _has_own(type(raw), "__set__"):
            if raw.fset is None:
                raise Refused(f"{cls.__name__}.{name} cannot be set")
            self.call(raw.fset, [owner, value], {})
        elif _has_own(type(raw), "__set__"):
            self.call(member(type(raw), "__set__"), [raw, owner, value], {})
        else:
            raise Refused(f"setting {cls.__name__}.{name}, which is a {type(raw).__name__}")

    def special(self, value: Any, name: str) -> Any:
        """Return a special method that a value's class has in Python, bound to the value; `UNSET` if none."""
        if is_number(value) or isinstance(value, _OF_EVALUATION):
            return UNSET
        if isinstance(value, v.Box) and not isinstance(value, v.Instance):
            return UNSET
        cls = value.cls if isinstance(value, v.Instance) else type(value)
        if isinstance(value, type) and cls.__name__ in _METACLASSES:
            return UNSET
        raw = member(cls, name)
        if isinstance(raw, types.FunctionType):
            return v.Bound(raw, value)
        if raw is None or (raw is not UNSET and not isinstance(raw, (*_BUILT_IN, staticmethod, classmethod))):
            raise Refused(f"{cls.__name__}.{name} is a {type(raw).__name__}")
        return UNSET

    def is_own(self, value: Any) -> bool:
        """Return whether a value is an object of a class that is not one of Python's own."""
        return isinstance(value, v.Instance) or not (
            is_plain(value)
            or isinstance(value, (*_OF_EVALUATION, v.Box))
            or type(value).__module__ in ("builtins", "functools", "itertools", "operator")
        )

    def called(self, value: Any, name: str, *args: Any) -> Any:
        """Return what a special method of a value's class returns; `UNSET` if the class has none."""
        method = self.special(value, name)
        return UNSET if method is UNSET else self.call(method, args, {})
