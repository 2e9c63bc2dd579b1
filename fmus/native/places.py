"""Places in lists and tuples: indices known at run time only, and items of lists whose length changes."""

from __future__ import annotations

from typing import Any

from . import ir
from .merge import Merging
from .shapes import build, types_of
from .values import Ring


class Places(Merging):
    """Indices, checked as Python does."""

    def within(self, index: ir.Operand, count: int, text: str) -> ir.Operand:
        """Return an index known at run time, counted from the beginning; raises if it is out of range."""
        self._fits(index)
        from_end = self.compare("<", index, 0)
        index = self.branch(from_end, lambda: self.binary("+", index, count), lambda: index)
        self.require(self.compare(">=", index, 0), "IndexError", text)
        self.require(self.compare("<", index, count), "IndexError", text)
        return index

    def _fits(self, index: ir.Operand) -> None:
        for op, end in ((">=", -(2.0**63)), ("<", 2.0**63)):
            fits = self.compare(op, index, end)
            self.require(fits, "IndexError", "cannot fit 'int' into an index-sized integer")

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
            self._fits(index)
            from_end = self.compare("<", index, 0)
            place = index
            index = self.branch(from_end, lambda: self.binary("+", length, place), lambda: place)
            self.require(self.compare(">=", index, 0), "IndexError", text)
        self.require(self.compare("<", index, length), "IndexError", text)
        return index  # type: ignore[no-any-return]

    def ring_item(self, ring: Ring, index: ir.Operand) -> Any:
        """Return the item at a valid index."""
        types = list(types_of(ring.item))
        read = [self.let(type, "ring_item", ring.number, k, index) for k, type in enumerate(types)]
        return build(ring.item, iter(read))
