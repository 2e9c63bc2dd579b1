"""Places in lists and tuples: indices known at run time only, and items of lists whose length changes."""

from __future__ import annotations

from typing import Any

from . import ir
from .merge import Merging
from .shapes import build, numbers_of_item, types_of
from .values import OF_RING, Array, Refused, Ring, Unreachable, is_mixed, is_number, is_real


class Places(Merging):
    """Indices, checked as Python does."""

    def within(self, index: ir.Operand, count: int, text: str) -> ir.Operand:
        """Return an index, counted from the beginning; raises if it is out of range."""
        if not isinstance(index, ir.Var):
            index = index + count if index < 0 else index
            self.require(0 <= index < count, "IndexError", text)
            return index
        between = self.range_of(index)
        if between is not None and between[0] >= 0 and between[1] < count:
            return index
        return self._placed(index, count, text)

    def _placed(self, index: ir.Var, count: ir.Operand, text: str) -> ir.Var:
        place = self.let(ir.INT, "place_in", index, count)
        if self.range_of(index) is None:
            fits = self.compare("!=", place, -2)
            self.require(fits, "IndexError", "cannot fit 'int' into an index-sized integer")
        self.require(self.compare(">=", place, 0), "IndexError", text)
        return place

    def ring_length(self, ring: Ring) -> ir.Var:
        """Return len(ring)."""
        return self.let(ir.INT, "ring_length", ring.number)

    def ring_index(self, ring: Ring, index: Any, text: str) -> ir.Operand:
        """Return an index in a list of the state, counted from the beginning."""
        length = self.ring_length(ring)
        if not isinstance(index, ir.Var) and index < 0:
            index = self.binary("+", length, index)
            self.require(self.compare(">=", index, 0), "IndexError", text)
            return index  # type: ignore[no-any-return]
        if isinstance(index, ir.Var):
            return self._placed(index, length, text)
        self.require(self.compare("<", index, length), "IndexError", text)
        return index  # type: ignore[no-any-return]

    def set_ring_item(self, ring: Ring, index: Any, value: Any) -> None:
        """Replace an item of a list of the state."""
        place = self.ring_index(ring, index, "list assignment index out of range")
        self.out.append(ir.Replace(ring.number, place, numbers_of_item(ring, value, self.read, self)))

    def array_item(self, array: Array, index: Any) -> ir.Var:
        """Return array[index]."""
        place = self._array_index(array, index, "array index out of range")
        target = self.new(ir.REAL)
        self.out.append(ir.Fetch(target, array.memory, place))
        return target

    def set_array_item(self, array: Array, index: Any, value: Any) -> None:
        """Set array[index]."""
        if not (is_number(value) or is_mixed(value)):
            raise Refused("an array of something other than real numbers")
        value = self.by_form(value, self.as_real)
        place = self._array_index(array, index, "array assignment index out of range")
        self.out.append(ir.Put(array.memory, place, value))

    def _array_index(self, array: Array, index: Any, text: str) -> ir.Operand:
        if is_real(index):
            self.fail("TypeError", "array indices must be integers")
            raise Unreachable
        if not isinstance(index, (ir.Var, int)):
            raise Refused("a slice of an array")
        return self.within(index, array.memory.length, text)

    def ring_item(self, ring: Ring, index: ir.Operand) -> Any:
        """Return the item at a valid index."""
        types = list(types_of(ring.item))
        read = [self.let(type, "ring_item", ring.number, k, index) for k, type in enumerate(types)]
        return build(ring.item, iter(read), alias=OF_RING)
