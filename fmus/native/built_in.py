"""Evaluation of Python's built-in functions, and of methods of lists, strings and dictionaries."""

from __future__ import annotations

import array
import bisect
import itertools
import math
import operator
import types
from collections.abc import Sequence
from typing import Any

from . import ir
from .attributes import member
from .loops import UNROLLED
from .of_numbers import OfNumbers
from .shapes import push
from .values import (
    EITHER,
    UNSET,
    Array,
    Bound,
    Bytes,
    Closure,
    Dict,
    Each,
    Failure,
    Instance,
    List,
    Picked,
    Refused,
    Ring,
    Span,
    Text,
    Union,
    Unreachable,
    is_mixed,
    is_number,
    is_plain,
    is_real,
    joined_text,
    same,
)

_OPERATORS = {
    operator.mul: "*", operator.add: "+", operator.sub: "-", operator.truediv: "/", operator.floordiv: "//",
    operator.mod: "%", operator.pow: "**",
}  # fmt: skip

MOST_IN_ARRAY = 4096
"""Largest number of numbers in an array; chosen: it is on the stack."""

_OF_FORMS = ("getattr", "hasattr", "isinstance", "bool", "zip")
"""Functions that take values of several forms."""
_PURE = (set, frozenset, str, repr, ord, chr, divmod, pow, format, float, int, bool, tuple, complex, range)


def _is_pure(function: Any) -> bool:
    """Return whether a function has no side effects, so that it may be called at build time."""
    if any(function is pure for pure in _PURE):
        return True
    owner = getattr(function, "__self__", None)
    if type(owner) is dict:
        return function.__name__ in ("get", "keys", "values", "items", "copy")
    if is_plain(owner) and owner is not None:
        return True
    return getattr(function, "__module__", "") in ("math", "_operator", "_bisect", "itertools")


class Repeated:
    """Endless `itertools.repeat`."""

    def __init__(self, value: Any) -> None:
        self.value = value


class BuiltIn(OfNumbers):
    """Calls of built-in functions and methods."""

    # ---- methods of lists, texts and dictionaries -------------------------------------------

    def _method(self, owner: Any, name: str, args: list[Any], named: dict[str, Any]) -> Any:
        if isinstance(owner, Text) and name == "encode":
            return Bytes(owner)
        if isinstance(owner, Ring):
            return self._of_ring(owner, name, args)
        if isinstance(owner, Dict):
            return self._of_dict(owner, name, args)
        assert isinstance(owner, List)
        if name == "append":
            self.promote(owner, args[0])
            self.open(owner).append(args[0])
            return None
        if name == "pop":
            return self.remove(owner, args[0] if args else -1, "pop from empty list")
        if name in ("extend", "insert", "clear", "reverse"):
            if owner.path is not None and name != "reverse":
                raise Refused(f"{name} of a list of the state")
            held = self.open(owner)
            if name == "extend":
                held += self.items(args[0])
            else:
                getattr(held, name)(*args)
            return None
        if name == "copy":
            return List(self.read(owner))
        if name in ("index", "count") and all(map(is_plain, (*self.read(owner), *args))):
            try:
                return getattr(self.read(owner), name)(*args)
            except ValueError as error:
                self.end("ValueError", str(error))
        raise Refused(f"the method {name} of a list")

    def _of_ring(self, ring: Ring, name: str, args: list[Any]) -> Any:
        if name == "append":
            push(ring, args[0], self.read, self)
            return None
        if name == "pop" and args:
            return self.remove(ring, args[0], "pop from empty list")
        raise Refused(f"the method {name} of a list whose length changes")

    def _of_dict(self, owner: Dict, name: str, args: list[Any]) -> Any:
        held = self.read(owner)
        if name == "keys":
            return tuple(held)
        if name in ("items", "values"):
            return self._view(owner, tuple(held), with_keys=name == "items")
        if name == "get":
            return held.get(self._key(args[0]), args[1] if len(args) > 1 else None)
        if name == "copy":
            return Dict(held)
        raise Refused(f"the method {name} of a dictionary")

    def _view(self, owner: Dict, keys: tuple[Any, ...], with_keys: bool) -> Each:
        def item(k: int) -> Any:
            if tuple(self.read(owner)) != keys:
                raise Refused("a dictionary whose keys change during iteration")
            value = self.read(owner)[keys[k]]
            return (keys[k], value) if with_keys else value

        return Each(len(keys), item, once=False)

    # ---- built-in functions -----------------------------------------------------------------

    def _built_in(self, function: Any, args: list[Any], named: dict[str, Any]) -> Any:
        name = getattr(function, "__name__", "")
        if function == itertools.chain.from_iterable:
            return self._python_chain(*self.items(args[0]))
        if name == "_replace" and isinstance(args[0], tuple):
            return function(*args, **named)
        if function is math.log and len(args) == 2:
            return self.operate("/", *[self._built_in(function, [x], {}) for x in args])
        if getattr(function, "__module__", "") == "math" and name not in ("floor", "ceil", "trunc"):
            args = [self.real(x) if is_mixed(x) else x for x in args]
        if any(isinstance(x, Union) for x in args) and name not in _OF_FORMS:
            k = next(i for i, x in enumerate(args) if isinstance(x, Union))
            return self.by_form(
                args[k], lambda x: self._built_in(function, [*args[:k], x, *args[k + 1 :]], named)
            )
        if function is iter and len(args) == 1 and not named:
            each = self.each(args[0])
            return each if each.once else Each(each.count, each.item, each.end)
        if name == "get" and type(getattr(function, "__self__", None)) is dict:
            return self._of_dict(Dict(function.__self__), name, args)
        own = getattr(self, f"_python_{name}", None)
        if own is not None and getattr(function, "__module__", "") in (
            "array", "builtins", "itertools", "math", "_bisect", "bisect", "functools", "_functools",
        ):  # fmt: skip
            return own(*args, **named)
        if getattr(function, "__module__", "") == "math" and all(map(is_number, args)):
            return self.function(name, *args)
        if isinstance(function, type) and issubclass(function, BaseException):
            return Failure(function, self._text(args))
        for known, op in _OPERATORS.items():
            if function is known:
                return self.operate(op, *args)
        if getattr(function, "__module__", "") == "_operator" and name.startswith(("i", "set", "del")):
            raise Refused(f"a call of operator.{name}")
        plain = [tuple(self.items(x)) if isinstance(x, List) else x for x in args]
        if _is_pure(function) and all(map(self._is_constant, (*plain, *named.values()))):
            try:
                return self.imported(function(*plain, **named))
            except Exception as error:
                self.fail(type(error).__name__, str(error))
                raise Unreachable from None
        raise Refused(f"a call of {name or type(function).__name__}")

    def _python_setattr(self, owner: Any, name: str, value: Any) -> None:
        self.set_attribute(owner, name, value)

    def _python_hasattr(self, owner: Any, name: str) -> Any:
        return self.by_form(owner, lambda x: self.has(x, name))

    def _python_len(self, value: Any) -> Any:
        method = self.special(value, "__len__")
        if method is not UNSET:
            return self.truth_or_length(method)
        if isinstance(value, Ring):
            return self.ring_length(value)
        if isinstance(value, Picked):
            if all(isinstance(x, str) or type(x) is tuple for x in value.items):
                return self.by_item(value, len)
            return self.length_of_picked(value)
        if isinstance(value, Array):
            return value.memory.length
        if isinstance(value, Each) and not value.once:
            return value.count
        if isinstance(value, (List, Dict)):
            return len(self.read(value))
        if isinstance(value, tuple) or type(value) in (str, bytes, range, list, dict, set, frozenset):
            return len(value)
        raise Refused(f"len of a {type(value).__name__}")

    def truth_or_length(self, method: Any) -> Any:
        """Return what a __len__ returns, which must be an integer that is not negative."""
        count = self.narrowed(self.call(method, [], {}))
        if not is_number(count) or ir.type_of(count) not in (ir.INT, ir.BOOL):
            raise Refused("a __len__ that returns something other than an integer")
        self.require(self.compare(">=", count, 0), "ValueError", "__len__() should return >= 0")
        return self.binary("+", count, 0)

    def _python_array(self, kind: Any, values: Any = ()) -> Array:
        each = self.each(values)
        if kind != "d" or not each.count:
            raise Refused("an array other than one of real numbers")
        if each.count > MOST_IN_ARRAY:
            raise Refused(f"an array of more than {MOST_IN_ARRAY:,} numbers")
        made = Array(ir.Array(f"a{self.new(ir.REAL).name}", each.count))
        if isinstance(values, Array):
            self.for_each_index(
                each.count, lambda k: self.set_array_item(made, k, self.array_item(values, k))
            )
            return made
        items = [each.item(k) for k in range(each.count)]
        if len(items) > UNROLLED and all(same(x, items[0]) for x in items):
            self.for_each_index(len(items), lambda k: self.set_array_item(made, k, items[0]))
            return made
        for k, x in enumerate(items):
            self.set_array_item(made, k, x)
        return made

    def _python_bool(self, value: Any) -> Any:
        return self.truth_of(value)

    def _python_str(self, value: Any) -> Any:
        return joined_text(self._formatted(value, "", False))

    def _python_list(self, value: Any = ()) -> Any:
        return List(self.items(value))

    def _python_tuple(self, value: Any = ()) -> Any:
        return tuple(self.items(value))

    def _python_dict(self, value: Any = (), **named: Any) -> Any:
        if type(value) is dict:
            value = Dict(value)
        held = self.read(value) if isinstance(value, Dict) else dict(map(self.items, self.items(value)))
        held = {self._key(k): x for k, x in held.items()}
        return Dict({**held, **named})

    def _python_any(self, values: Any) -> Any:
        return self._decided(self.each(values), True)

    def _python_all(self, values: Any) -> Any:
        return self._decided(self.each(values), False)

    def _decided(self, each: Each, by: bool, k: int = 0) -> Any:
        if k == each.count:
            return not by
        test = self.truth_of(each.item(k))
        on = lambda: self._decided(each, by, k + 1)  # noqa: E731
        return self.branch(test, *((lambda: True, on) if by else (on, lambda: False)))

    def _python_zip(self, *values: Any, strict: bool = False) -> Any:
        rows = [x if isinstance(x, Repeated) else self.each(x) for x in values]
        counts = {x.count for x in rows if isinstance(x, Each)}
        if strict and len(counts) > 1:
            self.fail("ValueError", "zip() arguments differ in length")
            raise Unreachable
        return Each(min(counts), lambda k: tuple(x.item(k) if isinstance(x, Each) else x.value for x in rows))

    def _python_map(self, function: Any, *values: Any) -> Any:
        rows = self._python_zip(*values)
        return Each(rows.count, lambda k: self.call(function, rows.item(k), {}))

    def _python_enumerate(self, values: Any, start: int = 0) -> Any:
        if isinstance(values, (Ring, Span)):
            raise Refused("enumerate of a list whose length changes")
        each = self.each(values)
        return Each(each.count, lambda k: (start + k, each.item(k)), each.end)

    def _python_reversed(self, values: Any) -> Any:
        if self.special(values, "__reversed__") is not UNSET or isinstance(values, Instance):
            raise Refused("reversed of an object")
        each = self.each(values)
        return Each(each.count, lambda k: each.item(each.count - 1 - k))

    def _python_pairwise(self, values: Any) -> Any:
        if isinstance(values, Ring):
            ring = values
            last = self.binary("-", self.ring_length(ring), 1)

            def pair(k: ir.Operand) -> tuple[Any, Any]:
                return self.ring_item(ring, k), self.ring_item(ring, self.binary("+", k, 1))

            return Span(0, last, pair, ring)
        each = self.each(values)
        before: list[Any] = []

        def following(k: int) -> tuple[Any, Any]:
            first = before.pop() if k else each.item(0)
            before.append(each.item(k + 1))
            return first, before[0]

        return Each(max(each.count - 1, 0), following)

    def _python_repeat(self, value: Any, times: int | None = None) -> Any:
        return Repeated(value) if times is None else (value,) * times

    def _python_chain(self, *values: Any) -> Any:
        rows = [(each, k) for each in map(self.each, values) for k in range(each.count)]
        return Each(len(rows), lambda i: rows[i][0].item(rows[i][1]))

    def _python_range(self, *ends: Any) -> Any:
        if any(map(is_real, ends)):
            self.end("TypeError", "'float' object cannot be interpreted as an integer")
        if not any(isinstance(x, ir.Var) for x in ends):
            return range(*ends)
        if len(ends) > 2:
            raise Refused("a range whose step or ends are only known at run time")
        return Span(ends[0] if len(ends) == 2 else 0, ends[-1], lambda k: k)

    def _python_bisect_right(self, values: Any, x: Any) -> Any:
        place: ir.Operand = 0
        items = self.items(values)
        if not any(isinstance(v, ir.Var) for v in (*items, x)):
            return bisect.bisect_right(items, x)
        low, high = 0, len(items)

        def go(low: int, high: int) -> ir.Operand:  # the search order of `bisect`
            if low == high:
                return low
            middle = (low + high) // 2
            less = self.compare("<", x, items[middle])
            return self.branch(less, lambda: go(low, middle), lambda: go(middle + 1, high))  # type: ignore

        place = go(low, high)
        return place

    def _python_getattr(self, owner: Any, name: str, *default: Any) -> Any:
        missing = (lambda: default[0]) if default else None
        return self.by_form(owner, lambda x: self.attribute(x, name, missing))

    def _python_isinstance(self, value: Any, kinds: Any) -> Any:
        value = self.narrowed(value)
        if isinstance(value, Union):
            return self.by_form(value, lambda x: self._python_isinstance(x, kinds))
        if isinstance(value, ir.Var):
            of = {ir.REAL: float, ir.BOOL: bool}.get(value.type, int)
            if value.type == ir.EITHER and issubclass(bool, kinds) != issubclass(int, kinds):
                raise Refused(EITHER)
            return issubclass(of, kinds)
        for kind in kinds if isinstance(kinds, tuple) else (kinds,):
            check = member(type(kind), "__instancecheck__")
            if isinstance(check, types.FunctionType) and type(kind).__module__ not in (
                "abc",
                "typing",
                "enum",
            ):
                raise Refused(f"isinstance of {kind.__name__}, whose class has a metaclass")
        if isinstance(value, Picked):
            value = self.loaded(value)
        if isinstance(value, (Closure, Bound, Bytes, Span, Each, Failure)):
            raise Refused(f"isinstance of a {type(value).__name__}")
        if isinstance(value, Text):
            return issubclass(str, kinds)
        if isinstance(value, Instance):
            return issubclass(value.cls, kinds)
        if isinstance(value, Array):
            return issubclass(array.array, kinds)
        if isinstance(value, (List, Ring, Dict)):
            return issubclass(dict if isinstance(value, Dict) else list, kinds)
        return isinstance(value, kinds)

    def _text(self, args: Sequence[Any]) -> Text:
        if len(args) > 1:
            raise Refused("an exception of several values")
        if not args:
            return Text(())
        if isinstance(args[0], Text):
            return args[0]
        if not is_plain(args[0]):
            raise Refused("an exception of something unknown")
        return Text((str(args[0]),))
