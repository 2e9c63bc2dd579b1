"""Values of the partial evaluation, other than plain Python values.

Numbers, strings, tuples, classes and functions that are known at build time are represented by themselves, a
number that is only known at run time by an `ir.Var`. Mutable objects are boxes, so that the changes of a path
can be undone before the other path is evaluated; a value with several forms is a `Union` with a tag.
"""

from __future__ import annotations

import ast
import enum
import itertools
import types
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import cache
from typing import Any

from . import ir
from .ir import Refused as Refused

RESIZED = "a list that changes its length during iteration"
"""Message of `Refused`: Python's loop would use the list's new length, the translated loop the old."""
EITHER = "a number that is True or False on some paths, another integer on others"
"""Message of `Refused` where the difference matters."""
OF_TABLE = "an object of a table whose index is only known at run time"
OF_RING = "an item of a list whose length changes"
SHARED = "an object with two names"
OF_LOOP = "an object that a loop passes on"
TWO_NAMES = f"{SHARED} is changed"
"""What is said of an object of which the translation has a copy for each name, when one is changed."""


class Unreachable(Exception):
    """Signal that the current path has raised an exception."""


class _Unset:
    def __repr__(self) -> str:
        return "nothing"


UNSET = _Unset()
"""Marker of a name or attribute without value."""


class _Any:
    def __repr__(self) -> str:
        return "anything"


ANY = _Any()
"""Marker of a value that is never used."""
_numbers = itertools.count()


class Box:
    """Mutable object; the evaluation changes it only through its journal.

    Attributes:
        age: index in the order of creation.
        fixed: whether it never changes.
        merged: the box into which it was merged where two paths joined.
        alias: what it is a copy of, so that it cannot be changed; "" if it is the object itself.
        pushed: whether it was copied into a list whose length changes.
        origins: the objects of a table of which it is a copy.
    """

    def __init__(self) -> None:
        self.age = next(_numbers)
        self.fixed = False
        self.slots: Any = {}
        self.merged: Box | None = None
        self.changed = False
        self.alias = ""
        self.pushed = False
        self.origins: tuple[Box, ...] = ()


class Frame(Box):
    """Names of a call, and those of the enclosing function.

    Attributes:
        inlined: whether they are those of a comprehension that Python evaluates in the enclosing function.
    """

    def __init__(self, names: dict[str, Any], parent: Frame | None = None, inlined: bool = False) -> None:
        super().__init__()
        self.slots = names
        self.parent, self.inlined = parent, inlined


class Instance(Box):
    """Instance of a class of the component's package."""

    def __init__(self, cls: type, attributes: dict[str, Any] | None = None) -> None:
        super().__init__()
        self.cls = cls
        self.slots = attributes or {}


class List(Box):
    """List of known length."""

    def __init__(self, items: Sequence[Any]) -> None:
        super().__init__()
        self.slots = list(items)
        self.path: str | None = None  # path in the state, for a list that existed when the call began


class Each(Box):
    """Iterable of a known number of items, created lazily: item(k) for k below `count`.

    An iterator yields them once, a view of a dictionary (`once` false) repeatedly. `end` is called when a
    loop reaches the end, and refuses a list that has grown meanwhile.
    """

    def __init__(
        self,
        count: int,
        item: Callable[[int], Any],
        end: Callable[[], object] = lambda: None,
        once: bool = True,
    ) -> None:
        super().__init__()
        self.count, self.item, self.end, self.once = count, item, end, once
        self.slots = {"used": False}


class Dict(Box):
    """Dictionary with known keys."""

    def __init__(self, items: dict[Any, Any]) -> None:
        super().__init__()
        self.slots = dict(items)


class Ring(Box):
    """List of the state whose length is only known at run time.

    Attributes:
        number: index of the list in the instance.
        item: shape of its items.
    """

    def __init__(self, number: int, item: Any) -> None:
        super().__init__()
        self.number, self.item = number, item


class Array(Box):
    """`array("d")`: real numbers in memory, whose content is only known at run time."""

    def __init__(self, memory: ir.Array) -> None:
        super().__init__()
        self.memory = memory


@dataclass(frozen=True, eq=False)
class Union:
    """Value with several forms; `tag` is the active alternative."""

    tag: ir.Var
    alternatives: tuple[Any, ...]


@dataclass(frozen=True, eq=False)
class Picked:
    """Item of a table of items of the same shape, at an index known at run time."""

    items: tuple[Any, ...]
    index: ir.Var


@dataclass(frozen=True, eq=False)
class Closure:
    """Function or lambda created during the evaluation of a component."""

    node: ast.FunctionDef | ast.Lambda
    frame: Frame
    source: Any
    defaults: tuple[Any, ...] = ()
    named_defaults: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Bound:
    """Method bound to an instance or a list."""

    function: Any
    owner: Any


@dataclass(frozen=True, eq=False)
class Text:
    """Text that contains numbers only known at run time."""

    parts: tuple[ir.Part, ...]


@dataclass(frozen=True, eq=False)
class Bytes:
    """Bytes of a text."""

    text: Text


@dataclass(frozen=True, eq=False)
class Span:
    """Items of a loop of unknown length: item(k) for `first` <= k < `end`."""

    first: ir.Operand
    end: ir.Operand
    item: Any
    ring: Ring | None = None


@dataclass(frozen=True, eq=False)
class Failure:
    """Exception instance."""

    kind: type[BaseException]
    message: Text


def now() -> int:
    """Return an age between those of existing and future boxes."""
    return next(_numbers)


def is_number(value: Any) -> bool:
    """Return whether a value is a number, known at build time or not; those of own classes are not."""
    return isinstance(value, ir.Var) or type(value) in (float, int, bool)


def is_real(value: Any) -> bool:
    """Return whether a value is a real number, known or not."""
    return is_number(value) and ir.type_of(value) == ir.REAL


def is_mixed(value: Any) -> bool:
    """Return whether a value is a number that is whole on some paths, real on others."""
    return isinstance(value, Union) and all(
        is_number(x) and ir.type_of(x) in (ir.REAL, ir.INT, ir.BOOL, ir.EITHER) for x in value.alternatives
    )


_PLAIN = (int, float, bool, str, bytes, complex, type(None), range, frozenset)


def is_plain(value: Any) -> bool:
    """Return whether a value is known at build time, cannot change, and behaves as those of Python do."""
    if isinstance(value, tuple):
        return is_usual_tuple(value) and all(map(is_plain, value))
    return type(value) in _PLAIN or is_usual_member(value)


def is_usual_member(value: Any) -> bool:
    """Return whether a value is a member of an enumeration without operators of its own."""
    return isinstance(value, enum.Enum) and not _own_operators(type(value))


def is_usual_tuple(value: tuple[Any, ...]) -> bool:
    """Return whether a value is a tuple, or a named tuple without operators of its own."""
    cls = type(value)
    return cls is tuple or (hasattr(cls, "_fields") and not _own_operators(cls))


_HARMLESS = {
    "__new__", "__init__", "__init_subclass__", "__repr__", "__str__", "__format__", "__dir__", "__copy__",
    "__deepcopy__", "__replace__", "__getnewargs__", "__reduce_ex__", "__signature__",
}  # fmt: skip
"""Special methods that do not change how a value is computed with."""


@cache
def _own_operators(cls: type) -> bool:
    return any(
        name.startswith("__") and name.endswith("__") and name not in _HARMLESS
        for base in cls.__mro__
        if base.__module__ not in ("enum", "builtins")
        for name, member in vars(base).items()
        if isinstance(member, types.FunctionType)
    )


_COMPARED = (bytes, range, types.MethodType, types.BuiltinMethodType)
"""Types of values known at build time that are the same if they are equal; others are only themselves."""


def same(first: Any, second: Any) -> bool:
    """Return whether two values known at build time are identical, including types and signs of zeros."""
    if first is second:
        return True
    if type(first) is not type(second) or isinstance(first, ir.Var | Box | Union | Closure | Bound):
        return False
    if type(first) in (int, float, str, complex):
        return repr(first) == repr(second)
    if isinstance(first, tuple):
        return len(first) == len(second) and all(map(same, first, second))
    return type(first) in _COMPARED and bool(first == second)


def like(value: tuple[Any, ...], items: Sequence[Any]) -> tuple[Any, ...]:
    """Return a tuple of the same class with other items."""
    return type(value)(*items) if hasattr(value, "_fields") else tuple(items)


def joined_text(parts: Sequence[ir.Part]) -> str | Text:
    """Return the concatenation of parts, as a known text if all parts are known."""
    together: list[ir.Part] = []
    for part in parts:
        if isinstance(part, str) and together and isinstance(together[-1], str):
            together[-1] += part
        else:
            together.append(part)
    if all(isinstance(part, str) for part in together):
        return "".join(part for part in together if isinstance(part, str))
    return Text(tuple(together))


def boxes_in(value: Any) -> Iterator[Box]:
    """Yield the objects in a value, each once."""
    waiting, seen = [value], set()
    while waiting:
        x = waiting.pop()
        if isinstance(x, tuple):
            waiting.extend(x)
        elif isinstance(x, Union):
            waiting += x.alternatives
        elif isinstance(x, Picked):
            waiting += x.items
        elif isinstance(x, Closure):
            waiting.append(x.frame)
        elif isinstance(x, Bound):
            waiting.append(x.owner)
        elif isinstance(x, Box) and not x.fixed and id(x) not in seen:
            seen.add(id(x))
            yield x
            waiting += x.slots if isinstance(x.slots, list) else x.slots.values()
            if isinstance(x, Frame):
                waiting.append(x.parent)


def keys_of(box: Box) -> Iterator[Any]:
    """Return the keys of the content of a box."""
    return iter(range(len(box.slots)) if isinstance(box, List) else list(box.slots))


def items_of(slots: Any, key: Any) -> Any:
    """Return the content of slots at a key, or `UNSET`."""
    return slots[key] if isinstance(slots, list) else slots.get(key, UNSET)


def alike(a: Any, b: Any) -> bool:
    """Return whether two values can be merged into a value of the same form."""
    if a is b or same(a, b):
        return True
    if is_number(a) and is_number(b):
        return ir.are_joined((ir.type_of(a), ir.type_of(b)))
    if isinstance(a, Picked) or isinstance(b, Picked):
        return False
    if isinstance(a, tuple) and isinstance(b, tuple):
        return type(a) is type(b) and len(a) == len(b)
    if isinstance(a, Box) and isinstance(b, Box) and type(a) is type(b):
        if isinstance(a, List):
            return len(a.slots) == len(b.slots)
        if isinstance(a, Instance) and isinstance(b, Instance) and a.cls is not b.cls:
            return False
        if isinstance(a, Dict):
            return list(a.slots) == list(b.slots)
        return not isinstance(a, (Ring, Array)) and set(a.slots) == set(b.slots)
    if isinstance(a, Closure) and isinstance(b, Closure):
        return a.node is b.node and same(a.defaults, b.defaults)
    if isinstance(a, Union) or isinstance(b, Union):
        return False
    if isinstance(a, Bound) and isinstance(b, Bound):
        return a.function is b.function and alike(a.owner, b.owner)
    return False


def read(box: Box) -> Any:
    """Return the content of a box."""
    if box.merged is not None and box.merged.changed:
        raise Refused(TWO_NAMES)
    return box.slots
