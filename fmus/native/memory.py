"""Memory whose places are chosen at run time: tables, arrays, and lists of the state whose length changes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from . import ir
from . import values as v
from .lower import Lowering
from .shapes import Widening, build, numbers_of, numbers_of_item, shape_of, types_of
from .values import OF_RING, OF_TABLE, Refused, alike, boxes_in, is_number, is_real, like, read, same


class Memory:
    """Items at an index that is only known at run time, checked as Python does."""

    def __init__(self, lower: Lowering) -> None:
        self.lower = lower

    def ring_length(self, ring: v.Ring) -> ir.Var:
        """Return len(ring)."""
        return self.lower.let(ir.INT, "ring_length", ring.number)

    def ring_index(self, ring: v.Ring, index: Any, text: str) -> ir.Operand:
        """Return an index in a list of the state, counted from the beginning."""
        length = self.ring_length(ring)
        if not isinstance(index, ir.Var) and index < 0:
            index = self.lower.binary("+", length, index)
            self.lower.require(self.lower.compare(">=", index, 0), "IndexError", text)
            return index  # type: ignore[no-any-return]
        if isinstance(index, ir.Var):
            return self.lower.placed(index, length, text)
        self.lower.require(self.lower.compare("<", index, length), "IndexError", text)
        return index  # type: ignore[no-any-return]

    def set_ring_item(self, ring: v.Ring, index: Any, value: Any) -> None:
        """Replace an item of a list of the state."""
        place = self.ring_index(ring, index, "list assignment index out of range")
        self.lower.out.append(ir.Replace(ring.number, place, numbers_of_item(ring, value, read, self.lower)))

    def array_item(self, array: v.Array, index: Any) -> ir.Var:
        """Return array[index]."""
        place = self._array_index(array, index, "array index out of range")
        target = self.lower.new(ir.REAL)
        self.lower.out.append(ir.Fetch(target, array.memory, place))
        return target

    def put(self, array: v.Array, index: Any, value: ir.Operand) -> None:
        """Set array[index] to a real number."""
        place = self._array_index(array, index, "array assignment index out of range")
        self.lower.out.append(ir.Put(array.memory, place, value))

    def _array_index(self, array: v.Array, index: Any, text: str) -> ir.Operand:
        if is_real(index):
            self.lower.end("TypeError", "array indices must be integers")
        if not isinstance(index, (ir.Var, int)):
            raise Refused("a slice of an array")
        return self.lower.within(index, array.memory.length, text)

    def ring_item(self, ring: v.Ring, index: ir.Operand) -> Any:
        """Return the item at a valid index."""
        types = list(types_of(ring.item))
        numbers = [self.lower.let(type, "ring_item", ring.number, k, index) for k, type in enumerate(types)]
        return build(ring.item, iter(numbers), alias=OF_RING)

    def length_of_picked(self, value: v.Picked) -> int:
        """Return the length of an item of a table, if that of all is the same."""
        rows = [read(x) if isinstance(x, v.List) else x for x in value.items]
        lengths = {len(x) if isinstance(x, (tuple, list)) else None for x in rows}
        if len(lengths) != 1 or None in lengths:
            raise Refused("an item of a table whose items are of different length")
        return lengths.pop()  # type: ignore[return-value]

    def by_item(self, value: v.Picked, use: Callable[[Any], Any]) -> Any:
        """Apply `use`, which computes nothing at run time, to the item of a table."""
        return self.at(tuple(self.known_item(use(x)) for x in value.items), value.index)

    def known_item(self, value: Any) -> Any:
        """Return a value of a table that is known at build time."""
        if isinstance(value, ir.Var):
            raise Refused("an item of a table whose items are only known at run time")
        return value

    def at(self, items: tuple[Any, ...], index: ir.Operand) -> Any:
        """Return the item of a table at a valid index."""
        if not isinstance(index, ir.Var):
            return items[int(index)]
        if all(is_number(x) for x in items):
            types = [ir.type_of(x) for x in items]
            if ir.are_joined(types):
                return self._load(ir.joined(types), items, index)
            real = self._load(ir.REAL, items, index)
            is_real = self._load(ir.INT, tuple(int(type == ir.REAL) for type in types), index)
            whole = ir.joined(type for type in types if type != ir.REAL)
            return v.Union(is_real, (self.lower.let(whole, "copy", real), real))
        if all(same(x, items[0]) for x in items):
            return items[0]
        return v.Picked(items, index)

    def _load(self, type: str, table: tuple[ir.Operand, ...], index: ir.Operand) -> ir.Var:
        target = self.lower.new(type)
        self.lower.out.append(ir.Load(target, table, index))
        return target

    def of_picked(self, owner: v.Picked, index: Any) -> Any:
        """Return the item at an index of an item of a table."""
        rows = [read(x) if isinstance(x, v.List) else x for x in owner.items]
        if not all(isinstance(row, (tuple, list)) and len(row) == len(rows[0]) for row in rows):
            raise Refused("an item of a table whose rows are not alike")
        if not isinstance(index, ir.Var):
            return self.at(tuple(row[index] for row in rows), owner.index)
        width = len(rows[0])
        index = self.lower.within(index, width, beyond(rows[0]))
        place = self.lower.binary("+", self.lower.binary("*", owner.index, width), index)
        return self.at(tuple(x for row in rows for x in row), place)

    def loaded(self, value: v.Picked) -> Any:
        """Return an item of a table, with its numbers loaded."""
        first = value.items[0]
        if not all(alike(first, x) for x in value.items):
            raise Refused("an item of a table whose items are not alike")
        if isinstance(first, tuple):
            return like(first, [self._whole(self.of_picked(value, k)) for k in range(len(first))])
        shape = shape_of(first, read)
        for x in value.items[1:]:
            shape = Widening().of(shape, shape_of(x, read))
        rows = [numbers_of(shape, x, read, self.lower) for x in value.items]
        leaves = iter([self.at(column, value.index) for column in zip(*rows, strict=True)])
        made = build(shape, leaves, alias=OF_TABLE)
        origins = tuple(boxes_in(value))
        for box in boxes_in(made):
            box.origins = origins
        return made

    def _whole(self, value: Any) -> Any:
        return self.loaded(value) if isinstance(value, v.Picked) else value


def beyond(items: Any) -> str:
    return f"{kind_of(items)} index out of range"


def kind_of(items: Any) -> str:
    row = items.items[0] if isinstance(items, v.Picked) else items
    return "tuple" if isinstance(row, tuple) else "list"
