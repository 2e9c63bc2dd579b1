"""Values that the evaluation of a component works with, beside plain Python values.

Numbers, strings, tuples, classes and functions that are known at build time are themselves. A number that is
known at run time only is an `ir.Var`. Objects that can change are boxes, so that what one path changes can be
taken back before the other is followed; a value that has several forms is a `Union` with a tag.
"""

from __future__ import annotations

import ast
import itertools
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

from . import ir


class Refused(Exception):
    """Error: a construct of the component cannot be translated; the text names it."""

    def __init__(self, text: str, where: str = "") -> None:
        super().__init__(text)
        self.text, self.where = text, where

    def __str__(self) -> str:
        return f"{self.text} ({self.where})" if self.where else self.text


RESIZED = "a list that grows or shrinks while it is gone through"
"""Refused: Python's loop would see the list's new length, the translated one the old."""


class Unreachable(Exception):
    """The path that is being followed has raised an exception."""


class _Unset:
    def __repr__(self) -> str:
        return "nothing"


UNSET = _Unset()
"""A name or attribute without value."""


class _Any:
    def __repr__(self) -> str:
        return "anything"


ANY = _Any()
"""A value that is never used."""


_numbers = itertools.count()


class Box:
    """An object that can change; the evaluation writes by its journal alone.

    Attributes:
        age: number in the order in which boxes are made.
        fixed: it never changes.
    """

    def __init__(self) -> None:
        self.age = next(_numbers)
        self.fixed = False
        self.slots: Any = {}
        self.merged: Box | None = None  # what this and another became where two paths joined
        self.changed = False


class Frame(Box):
    """The names of a call, with those of the function around it."""

    def __init__(self, names: dict[str, Any], parent: Frame | None = None) -> None:
        super().__init__()
        self.slots = names
        self.parent = parent


class Instance(Box):
    """An instance of a class of the component's package."""

    def __init__(self, cls: type, attributes: dict[str, Any] | None = None) -> None:
        super().__init__()
        self.cls = cls
        self.slots = attributes or {}


class List(Box):
    """A list whose length is known."""

    def __init__(self, items: Sequence[Any]) -> None:
        super().__init__()
        self.slots = list(items)
        self.path: str | None = None  # in the state, of a list that was there when the call began


class Each(Box):
    """Items of a known number, each made when its turn comes: item(k) for k below `count`.

    An iterator gives them once, a view of a dictionary (`once` false) again and again. `end` is called
    where a loop comes to the end: it refuses a list that has grown meanwhile.
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
    """A dictionary with known keys."""

    def __init__(self, items: dict[Any, Any]) -> None:
        super().__init__()
        self.slots = dict(items)


class Ring(Box):
    """A list of the state whose length is known at run time only.

    Attributes:
        number: of the list in the instance.
        item: shape of its items.
    """

    def __init__(self, number: int, item: Any) -> None:
        super().__init__()
        self.number, self.item = number, item


@dataclass(frozen=True, eq=False)
class Union:
    """A value of several forms: alternative `tag`."""

    tag: ir.Var
    alternatives: tuple[Any, ...]


@dataclass(frozen=True, eq=False)
class Picked:
    """The item at an index, known at run time, of items that are alike."""

    items: tuple[Any, ...]
    index: ir.Var


@dataclass(frozen=True, eq=False)
class Closure:
    """A function or lambda made while a component was being evaluated."""

    node: ast.FunctionDef | ast.Lambda
    frame: Frame
    source: Any
    defaults: tuple[Any, ...] = ()
    named_defaults: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Bound:
    """A method of an instance or of a list."""

    function: Any
    owner: Any


@dataclass(frozen=True, eq=False)
class Text:
    """A text with numbers in it that are known at run time only."""

    parts: tuple[ir.Part, ...]


@dataclass(frozen=True, eq=False)
class Bytes:
    """The bytes of a text."""

    text: Text


@dataclass(frozen=True, eq=False)
class Span:
    """Items of a loop of unknown length: item(k) for k from `first` below `end`."""

    first: ir.Operand
    end: ir.Operand
    item: Any
    ring: Ring | None = None


@dataclass(frozen=True, eq=False)
class Failure:
    """An exception that has been made."""

    kind: type[BaseException]
    message: Text


def now() -> int:
    """Return an age between those of the boxes that there are and of those to come."""
    return next(_numbers)


def is_number(value: Any) -> bool:
    """Return whether a value is a number, known or not."""
    return isinstance(value, (ir.Var, int, float))


def is_plain(value: Any) -> bool:
    """Return whether a value is known at build time and cannot change."""
    if isinstance(value, tuple):
        return all(map(is_plain, value))
    return isinstance(value, (int, float, str, bytes, complex, type(None), range, frozenset))


def same(first: Any, second: Any) -> bool:
    """Return whether two values known at build time are the same, signs of zeros and types included."""
    if first is second:
        return True
    if type(first) is not type(second) or isinstance(first, ir.Var | Box | Union | Closure | Bound):
        return False
    if isinstance(first, (int, float, str)):
        return repr(first) == repr(second)
    if isinstance(first, tuple):
        return len(first) == len(second) and all(map(same, first, second))
    try:
        return bool(first == second)
    except Exception:
        return False


def like(value: tuple[Any, ...], items: Sequence[Any]) -> tuple[Any, ...]:
    """Return a tuple of the same class with other items."""
    return type(value)(*items) if hasattr(value, "_fields") else tuple(items)


def joined_text(parts: Sequence[ir.Part]) -> str | Text:
    """Return parts as a text, known where all of them are."""
    together: list[ir.Part] = []
    for part in parts:
        if isinstance(part, str) and together and isinstance(together[-1], str):
            together[-1] += part
        else:
            together.append(part)
    if all(isinstance(part, str) for part in together):
        return "".join(part for part in together if isinstance(part, str))
    return Text(tuple(together))


def keys_of(box: Box) -> Iterator[Any]:
    """Return the keys of all that a box holds."""
    return iter(range(len(box.slots)) if isinstance(box, List) else list(box.slots))
