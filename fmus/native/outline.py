"""Outlining: functions of a component that depend only on numbers become C functions, each emitted once.

A call is evaluated separately, with the numbers of its arguments as parameters. If it has no side effects and
is long enough, the function is outlined; all other calls are evaluated in place.
"""

from __future__ import annotations

from collections.abc import Callable, Container
from dataclasses import replace
from typing import Any

from . import ir
from .lower import Facts
from .paths import Paths
from .read import Tree, kinds_within
from .shapes import (
    Forms,
    Growing,
    Held,
    Items,
    Known,
    Leaf,
    Made,
    Memo,
    Promote,
    Shape,
    build,
    numbers_of,
    shape_of,
    types_of,
)
from .stack import Call
from .values import Box, Frame, Picked, Refused, is_plain, read

SHORTEST = 40
"""Smallest number of statements of an outlined function; chosen: a call with its arguments takes a dozen."""
SMALLEST = 25
"""Smallest number of nodes of the syntax tree for an attempt."""
MOST_RESULTS = 40
"""Largest number of results of an outlined function."""


class Library:
    """Outlined functions, for all evaluations with the same fixed numbers."""

    def __init__(self) -> None:
        self.made: dict[Any, tuple[ir.Outlined, Shape] | None] = {}
        self.kept: list[Any] = []  # objects whose identity is part of a key


class Outlining:
    """Outlining of calls.

    Args:
        paths: what follows the paths of a call.
        fixed: variables that are the same in every call, such as parameters.
        library: functions that were outlined before.
        inside: evaluates a call in place.
    """

    def __init__(
        self, paths: Paths, fixed: Container[ir.Var], library: Library, inside: Callable[[Call, Tree], Any]
    ) -> None:
        self.lower, self.paths, self.fixed, self.library, self.inside = (
            paths.lower, paths, fixed, library, inside
        )  # fmt: skip

    def run(self, call: Call, node: Tree) -> Any:
        """Return the value of a call, of a function that is outlined if it can be."""
        if not self.lower.stack.calls or kinds_within(node).total() < SMALLEST:
            return self.inside(call, node)
        for name, value in call.frame.slots.items():
            if isinstance(value, Picked):
                call.frame.slots[name] = self.paths.memory.loaded(value)
        chosen = {
            tag: left for tag in self.paths.choosers if (left := self.lower.facts.left(tag)) is not None
        }
        try:
            shape = shape_of(call.frame, read, "", Memo(self.fixed))
        except Refused:
            return self.inside(call, node)  # an argument is not made of numbers
        key = id(call.source), id(node), _key(shape, {}), frozenset(chosen.items())
        if key not in self.library.made:
            self.library.kept.append((call.source, shape))
            self.library.made[key] = self._tried(call, node, shape, chosen)
        outlined = self.library.made[key]
        if outlined is None:
            return self.inside(call, node)
        function, result = outlined
        numbers = numbers_of(shape, call.frame, read, self.lower)
        targets = tuple(self.lower.new(type) for type in types_of(result))
        self.lower.out.append(ir.Invoke(targets, function, tuple(numbers)))
        return build(result, iter(targets))

    def _tried(
        self,
        call: Call,
        node: Tree,
        shape: Shape,
        chosen: dict[ir.Var, frozenset[int]],
    ) -> tuple[ir.Outlined, Shape] | None:
        parameters = tuple(self.lower.new(type) for type in types_of(shape))
        copies: dict[int, Any] = {}
        frame = build(shape, iter(parameters), copies)
        assert isinstance(frame, Frame)
        facts = Facts()
        facts.meanings, facts.domains = self.lower.facts.meanings, self.lower.facts.domains
        for tag, left in chosen.items():
            facts.others[tag] = facts.domains[tag] - left

        def run() -> Any:
            value = self.inside(replace(call, frame=frame, base=frame), node)
            form = shape_of(value, read, "", Memo(self.fixed))
            return form, tuple(numbers_of(form, value, read, self.lower)), value

        try:
            path = self.paths.followed(run, facts)
        except (Refused, Promote):
            return None
        boxes = [x for x in copies.values() if isinstance(x, Box)]
        if path.dead or any(x is not frame for x in path.changed):
            return None
        form, results, value = path.value
        if any(map(_is_of_list, ir.every(path.out))):
            return None  # lists of the state are not numbers
        if (
            sum(1 for _ in ir.every(path.out)) < SHORTEST
            or len(results) > MOST_RESULTS
            or ir.arrays_of(path.out)  # they share the stack of the method
            or _holds(value, set(map(id, boxes)))
        ):
            return None
        name = f"{getattr(node, 'name', 'lambda')}_{len(self.library.made)}"
        return ir.Outlined(name, parameters, tuple(path.out), results), form


def _is_of_list(statement: ir.Statement) -> bool:
    if isinstance(statement, ir.Let):
        return statement.op.startswith("ring_")
    return isinstance(statement, (ir.Push, ir.Replace, ir.Drop))


def _holds(value: Any, boxes: set[int]) -> bool:
    """Return whether a value is or contains an object that was passed to a function."""
    if isinstance(value, Box):
        if id(value) in boxes:
            return True
        held = read(value)
        return any(_holds(x, boxes) for x in (held if isinstance(held, list) else held.values()))
    if isinstance(value, tuple):
        return any(_holds(x, boxes) for x in value)
    if hasattr(value, "alternatives"):
        return any(_holds(x, boxes) for x in value.alternatives)
    if hasattr(value, "frame"):
        return _holds(value.frame, boxes) or _holds(value.frame.parent, boxes)
    return hasattr(value, "owner") and _holds(value.owner, boxes)


def _key(shape: Shape, seen: dict[int, int]) -> Any:
    """Return a key of a shape, equal for equal shapes."""
    if id(shape) in seen:
        return "again", seen[id(shape)]
    if isinstance(shape, Leaf):
        return shape.type
    if isinstance(shape, Known):
        value = shape.value
        return ("known", type(value), repr(value)) if is_plain(value) else ("known", id(value))
    if isinstance(shape, Items):
        return type(shape.sample), tuple(_key(x, seen) for x in shape.items)
    if isinstance(shape, Held):
        seen[id(shape)] = len(seen)
        items = tuple((k, _key(x, seen)) for k, x in shape.items.items())
        return shape.kind, items, shape.parent and _key(shape.parent, seen)
    if isinstance(shape, Made):
        return "made", id(shape.kind), _key(shape.inner, seen)
    if isinstance(shape, Forms):
        return "forms", _key(shape.tag, seen), tuple(_key(x, seen) for x in shape.alternatives)
    assert isinstance(shape, Growing)
    return "growing", shape.number
