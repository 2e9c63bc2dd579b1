"""Shapes of values that loops carry between passes, and components between steps.

A shape contains the constant parts of a value, and leaves for its numbers; two values have a common shape
that is wide enough for both. A value is converted to the list of the numbers of its leaves, and back.
"""

from __future__ import annotations

from collections.abc import Callable, Container, Iterator, Mapping
from dataclasses import dataclass, field
from functools import partial
from types import BuiltinFunctionType, FunctionType
from typing import Any

from . import ir
from . import values as v
from .lower import Lowering
from .values import ANY, SHARED, UNSET, Refused, boxes_in, is_number, is_plain, items_of, keys_of, like, same


@dataclass(eq=False)
class Shape:
    """Base class of shapes."""


@dataclass(eq=False)
class Known(Shape):
    """Constant: a value known at build time, or always the same object."""

    value: Any


@dataclass(eq=False)
class Leaf(Shape):
    """Number that is only known at run time."""

    type: str


@dataclass(eq=False)
class Items(Shape):
    """Tuple of the class of `sample`."""

    sample: tuple[Any, ...]
    items: list[Shape]


@dataclass(eq=False)
class Held(Shape):
    """Box; `blank` creates an empty box of the same kind."""

    kind: Any
    blank: Callable[[], v.Box]
    items: dict[Any, Shape] = field(default_factory=dict)
    parent: Shape | None = None
    path: str = ""
    alias: str = ""


@dataclass(eq=False)
class Made(Shape):
    """Closure or bound method: `make` applied to `inner`."""

    kind: Any
    make: Callable[[Any], Any]
    inner: Shape


@dataclass(eq=False)
class Forms(Shape):
    """Alternatives of several shapes, distinguished by a tag."""

    tag: Shape
    alternatives: list[Shape]


@dataclass(eq=False)
class Growing(Shape):
    """List of the state whose length changes."""

    number: int
    item: Shape


class Promote(Exception):
    """Signal that a list of the state changes its length or the shape of its items; restarts the evaluation.

    Attributes:
        path: of the list in the state, or its number if it is known that its length changes.
        item: shape of an item.
    """

    def __init__(self, path: str | int, item: Shape) -> None:
        super().__init__(path)
        self.path, self.item = path, item


Place = Callable[[v.Box], Any]
"""Returns the content of a box at a given time."""


class Memo(dict[Any, Shape]):
    """Shapes of visited objects, and fixed values.

    Attributes:
        fixed: variables that are the same in every call.
        growing: path -> list whose length changes.
    """

    def __init__(self, fixed: Container[ir.Var] = (), growing: Mapping[str, Growing] | None = None) -> None:
        super().__init__()
        self.fixed, self.growing = fixed, growing or {}


def shape_of(value: Any, slots: Place, path: str = "", memo: Memo | None = None) -> Shape:
    """Return the shape of a value in which every unknown number is a leaf."""
    memo = Memo() if memo is None else memo
    if isinstance(value, ir.Var):
        return Known(value) if value in memo.fixed else Leaf(value.type)
    if isinstance(value, v.Union):
        forms = [shape_of(x, slots, f"{path}|{i}", memo) for i, x in enumerate(value.alternatives)]
        return Forms(Known(value.tag) if value.tag in memo.fixed else Leaf(ir.INT), forms)
    if isinstance(value, tuple):
        return Items(value, [shape_of(x, slots, f"{path}.{i}", memo) for i, x in enumerate(value)])
    if isinstance(value, v.Ring):
        return Growing(value.number, value.item)
    if isinstance(value, v.Array):
        raise Refused("an array that is passed on between steps or passes of a loop; use a list")
    if isinstance(value, v.Box):
        if value.fixed:
            return Known(value)
        if value in memo:
            return memo[value]
        if path in memo.growing and isinstance(value, v.List):
            return memo.growing[path]
        kind, blank = _kind(value)
        made = Held(kind, blank, path=path, alias=value.alias)
        memo[value] = made
        held = slots(value)
        for key in range(len(held)) if isinstance(held, list) else list(held):
            made.items[key] = shape_of(items_of(held, key), slots, f"{path}.{key}", memo)
        if isinstance(value, v.Frame) and value.parent is not None:
            made.parent = shape_of(value.parent, slots, f"{path}.", memo)
        return made
    if isinstance(value, v.Closure):
        of = value.source, value.defaults, value.named_defaults
        if not all(map(_never_changes, (*value.defaults, *value.named_defaults.values()))):
            raise Refused("a function whose default arguments are only known at run time")

        def closure(frame: Any, node: Any = value.node) -> v.Closure:
            return v.Closure(node, frame, *of)

        return Made(value.node, closure, shape_of(value.frame, slots, path, memo))
    if isinstance(value, v.Bound):
        owner = shape_of(value.owner, slots, path, memo)
        return Made(value.function, partial(v.Bound, value.function), owner)
    if isinstance(value, v.Picked):
        raise Refused("an item of a table is kept")
    return Known(value)


def _never_changes(value: Any) -> bool:
    return is_plain(value) or isinstance(value, (type, FunctionType, BuiltinFunctionType))


def _kind(box: v.Box) -> tuple[Any, Callable[[], v.Box]]:
    if isinstance(box, v.Instance):
        return box.cls, partial(v.Instance, box.cls)
    if isinstance(box, v.List):
        return ("list", len(box.slots)), lambda: v.List([])
    if isinstance(box, v.Dict):
        return ("dict", tuple(box.slots)), lambda: v.Dict({})
    return "frame", lambda: v.Frame({})


class Widening:
    """Common shapes of two shapes; remembers pairs, so that shared objects stay shared."""

    def __init__(self) -> None:
        self._pairs: dict[tuple[int, int], Shape] = {}
        self._partners: dict[int, Shape] = {}
        self._made: dict[int, list[Held]] = {}
        self._kept: list[Any] = []
        self.grew = False

    def of(self, a: Shape, b: Shape) -> Shape:
        """Return a shape for all values of `a` and `b`; `grew` is set if it differs from `a`."""
        if a is b or (isinstance(b, Known) and b.value is ANY):
            return a
        if isinstance(a, Known) and a.value is ANY:
            self.grew = True
            return b
        key = id(a), id(b)
        if key in self._pairs:
            return self._pairs[key]
        self._kept.append((a, b))
        if isinstance(a, Known) and isinstance(b, Known) and same(a.value, b.value):
            return a
        types = _number_type(a), _number_type(b)
        if all(types) and ir.are_joined(types):
            type = ir.joined(types)
            if isinstance(a, Leaf) and a.type == type:
                return a
            self.grew = True
            return Leaf(type)
        if isinstance(a, Items) and isinstance(b, Items) and _alike(a, b):
            items = [self.of(x, y) for x, y in zip(a.items, b.items, strict=True)]
            return a if all(x is y for x, y in zip(items, a.items, strict=True)) else Items(a.sample, items)
        if isinstance(a, Held) and isinstance(b, Held) and _alike(a, b):
            made = Held(a.kind, a.blank, path=a.path, alias=a.alias or b.alias)
            self.grew = self.grew or made.alias != a.alias
            self._note_names(a, b, made)
            self._pairs[key] = made
            nothing = Known(UNSET)
            for name in dict.fromkeys((*a.items, *b.items)):
                made.items[name] = self.of(a.items.get(name, nothing), b.items.get(name, nothing))
            if a.parent is not None and b.parent is not None:
                made.parent = self.of(a.parent, b.parent)
            return made
        if isinstance(a, Made) and isinstance(b, Made) and _alike(a, b):
            return Made(a.kind, a.make, self.of(a.inner, b.inner))
        if isinstance(a, Growing) and isinstance(b, Growing) and a.number == b.number:
            return a
        return self._forms(a, b)

    def _note_names(self, a: Held, b: Held, made: Held) -> None:
        """Keep objects from being changed if two names are those of one object in only one of the shapes."""
        shared = self._partners.setdefault(id(a), b) is not b
        again = self._partners.setdefault(id(b), a) is not a
        ours = [self._made.setdefault(id(x), []) for x in (a, b)]
        for some in ours:
            some.append(made)
        if shared or again:
            for x in (*ours[0], *ours[1]):
                self.grew = self.grew or shared or not x.alias
                x.alias = x.alias or SHARED

    def _forms(self, a: Shape, b: Shape) -> Shape:
        ours = list(a.alternatives) if isinstance(a, Forms) else [a]
        if not isinstance(a, Forms):
            self.grew = True
        places: list[int] = []
        for shape in b.alternatives if isinstance(b, Forms) else [b]:
            i = _place(ours, shape, len(places))
            if i == len(ours):
                ours.append(shape)
                self.grew = True
            else:
                ours[i] = self.of(ours[i], shape)
            places.append(i)
        tag: Shape = Leaf(ir.INT)
        if isinstance(a, Forms) and isinstance(b, Forms) and places == list(range(len(ours))):
            tag = self.of(a.tag, b.tag)
        elif isinstance(a, Forms) and isinstance(a.tag, Known):
            self.grew = True
        return Forms(tag, ours)


def _number_type(shape: Shape) -> str:
    if isinstance(shape, Leaf):
        return shape.type
    return ir.type_of(shape.value) if isinstance(shape, Known) and is_number(shape.value) else ""


def _alike(a: Shape, b: Shape) -> bool:
    types = _number_type(a), _number_type(b)
    if all(types):
        return ir.are_joined(types)
    if isinstance(a, Known) and isinstance(b, Known):
        return same(a.value, b.value)
    if isinstance(a, Items) and isinstance(b, Items):
        return type(a.sample) is type(b.sample) and len(a.items) == len(b.items)
    if isinstance(a, Held) and isinstance(b, Held):
        return bool(a.kind == b.kind)
    if isinstance(a, Made) and isinstance(b, Made):
        return a.kind is b.kind
    if isinstance(a, Forms) and isinstance(b, Forms):
        return len(a.alternatives) == len(b.alternatives)
    if isinstance(a, Growing):
        return isinstance(b, Growing) and a.number == b.number
    return False


def _place(shapes: list[Shape], form: Shape, wanted: int) -> int:
    """Return the index of a shape that matches a form, preferably `wanted`; their number if none does."""
    if wanted < len(shapes) and _alike(shapes[wanted], form):
        return wanted
    return next((i for i, shape in enumerate(shapes) if _alike(shape, form)), len(shapes))


def types_of(shape: Shape) -> Iterator[str]:
    """Yield the types of a shape's leaves, in order."""
    yield from _types(shape, set())


def _types(shape: Shape, seen: set[int]) -> Iterator[str]:
    if isinstance(shape, Leaf):
        yield shape.type
    elif isinstance(shape, Items):
        for item in shape.items:
            yield from _types(item, seen)
    elif isinstance(shape, Held) and id(shape) not in seen:
        seen.add(id(shape))
        for item in (*shape.items.values(), *((shape.parent,) if shape.parent else ())):
            yield from _types(item, seen)
    elif isinstance(shape, Made):
        yield from _types(shape.inner, seen)
    elif isinstance(shape, Forms):
        yield from _types(shape.tag, seen)
        for item in shape.alternatives:
            yield from _types(item, seen)


def build(shape: Shape, leaves: Iterator[Any], memo: dict[int, Any] | None = None, alias: str = "") -> Any:
    """Return the value of a shape with the given numbers at its leaves.

    Args:
        shape, leaves: the shape and its numbers.
        memo: filled with what was built, by the identity of its shape.
        alias: what the objects are copies of, and cannot be changed therefore; "" if they are themselves.
    """
    memo = {} if memo is None else memo
    if isinstance(shape, Leaf):
        return next(leaves)
    if isinstance(shape, Known):
        return shape.value
    if isinstance(shape, Items):
        return like(shape.sample, [build(item, leaves, memo, alias) for item in shape.items])
    if isinstance(shape, Growing):
        return v.Ring(shape.number, shape.item)
    if isinstance(shape, Made):
        return shape.make(build(shape.inner, leaves, memo, alias))
    if isinstance(shape, Forms):
        tag = build(shape.tag, leaves, memo, alias)
        return v.Union(tag, tuple(build(item, leaves, memo, alias) for item in shape.alternatives))
    assert isinstance(shape, Held)
    if id(shape) not in memo:
        made = memo[id(shape)] = shape.blank()
        made.alias = alias or shape.alias
        held = {key: build(item, leaves, memo, alias) for key, item in shape.items.items()}
        made.slots = list(held.values()) if isinstance(made, v.List) else held
        if isinstance(made, v.List):
            made.path = shape.path
        if shape.parent is not None and isinstance(made, v.Frame):
            made.parent = build(shape.parent, leaves, memo, alias)
    return memo[id(shape)]


def numbers_of(shape: Shape, value: Any, slots: Place, lower: Lowering) -> list[ir.Operand]:
    """Return the numbers of a value at the leaves of a shape."""
    operands: list[ir.Operand] = []
    _collect(shape, value, slots, lower, operands, set())
    return operands


def push(ring: Growing | v.Ring, item: Any, slots: Place, lower: Lowering) -> None:
    """Append an item to a list of the state."""
    lower.out.append(ir.Push(ring.number, numbers_of_item(ring, item, slots, lower)))


def numbers_of_item(
    ring: Growing | v.Ring, item: Any, slots: Place, lower: Lowering
) -> tuple[ir.Operand, ...]:
    """Return the numbers of an item of a list of the state.

    Raises:
        Promote: the shape of its items is not wide enough.
    """
    widening, shape = Widening(), shape_of(item, slots)
    widening.of(ring.item, shape)
    if widening.grew:
        raise Promote(ring.number, shape)
    for box in boxes_in(item):
        box.pushed = True
    return tuple(numbers_of(ring.item, item, slots, lower))


def _collect(
    shape: Shape, value: Any, slots: Place, lower: Lowering, operands: list[ir.Operand], seen: set[int]
) -> None:
    if value is ANY:
        operands += [0] * len(list(_types(shape, seen)))
    elif isinstance(shape, Leaf):
        operands.append(value)
    elif isinstance(shape, Items):
        for item, x in zip(shape.items, value, strict=True):
            _collect(item, x, slots, lower, operands, seen)
    elif isinstance(shape, Held):
        if id(shape) in seen:
            return
        seen.add(id(shape))
        held = slots(value)
        for key, item in shape.items.items():
            _collect(item, items_of(held, key), slots, lower, operands, seen)
        if shape.parent is not None:
            _collect(shape.parent, value.parent, slots, lower, operands, seen)
    elif isinstance(shape, Growing):
        if isinstance(value, v.List):
            lower.out.append(ir.Drop(shape.number, every=True))
            for item in slots(value):
                push(shape, item, slots, lower)
    elif isinstance(shape, Made):
        inner = value.frame if isinstance(value, v.Closure) else value.owner
        _collect(shape.inner, inner, slots, lower, operands, seen)
    elif isinstance(shape, Forms):
        alternatives = list(value.alternatives) if isinstance(value, v.Union) else [value]
        memo = Memo()
        places: list[int] = []
        for x in alternatives:
            form = shape_of(x, slots, "", memo)
            places.append(_place(shape.alternatives, form, len(places)))
        tag: ir.Operand = places[0]
        if isinstance(value, v.Union):
            tag = value.tag
            if places != list(range(len(places))):
                tag = lower.new(ir.INT)
                lower.out.append(ir.Load(tag, tuple(places), value.tag))
        operands += [tag] * isinstance(shape.tag, Leaf)
        for i, mine in enumerate(shape.alternatives):
            if i in places:
                _collect(mine, alternatives[places.index(i)], slots, lower, operands, seen)
            else:
                operands += [0] * len(list(_types(mine, seen)))


__all__ = ["Forms", "Growing", "Held", "Known", "Leaf", "Shape", "Widening", "build", "keys_of", "numbers_of"]
