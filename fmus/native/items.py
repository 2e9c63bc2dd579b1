"""Items of lists, tuples, dictionaries and other iterables: read, set, removed, iterated."""

from __future__ import annotations

import enum
import itertools
import types
from typing import Any

from . import ir
from . import values as v
from .attributes import Attributes
from .memory import beyond, kind_of
from .shapes import Promote, shape_of
from .values import RESIZED, UNSET, Refused, is_mixed, is_number, is_plain, is_real, read

_ITERABLE: tuple[type, ...] = (
    list, str, bytes, range, dict, set, frozenset, types.MappingProxyType,
    type({}.keys()), type({}.values()), type({}.items()),
)  # fmt: skip
_SUBSCRIPTED = (list, str, bytes, range, dict, types.MappingProxyType)
_FINITE = (
    itertools.accumulate, itertools.chain, itertools.combinations, itertools.combinations_with_replacement,
    itertools.compress, itertools.islice, itertools.pairwise, itertools.permutations, itertools.product,
    itertools.zip_longest,
)  # fmt: skip
"""Iterators that end, if what they are made of is known."""


class Containers:
    """Items of containers."""

    def __init__(self, attributes: Attributes) -> None:
        self.lower, self.memory, self.paths = attributes.lower, attributes.memory, attributes.paths
        self.attributes = attributes

    def key(self, value: Any) -> Any:
        value = self.lower.settled(value, self.lower.facts) if isinstance(value, ir.Var) else value
        if not is_plain(value):
            raise Refused("a key that is only known at run time")
        return value

    def each(self, value: Any) -> v.Each:
        """Return the items of an iterable, evaluated lazily.

        Raises:
            Refused: the number of items is only known at run time.
        """
        value = self._iterated(self.paths.narrowed(value))
        if isinstance(value, v.Each):
            if self.lower.facts.known(read(value)["used"]) is True:
                raise Refused("an iterator that is used twice")
            if value.once:
                self.paths.write(value, "used", True)
            return value
        if isinstance(value, v.Array):
            return v.Each(value.memory.length, lambda k: self.memory.array_item(value, k))
        if not isinstance(value, v.List):
            items = self.of(value)
            return v.Each(len(items), items.__getitem__)
        count = len(read(value))

        def content() -> list[Any]:
            if len(read(value)) != count:
                raise Refused(RESIZED)
            return read(value)  # type: ignore[no-any-return]

        return v.Each(count, lambda k: content()[k], content)

    def _iterated(self, value: Any) -> Any:
        """Return what the __iter__ of a value's class returns, if it is of a component."""
        iterator = self.attributes.called(value, "__iter__")
        if iterator is UNSET:
            return value
        iterator = self.paths.narrowed(iterator)
        if not isinstance(iterator, v.Each) or not iterator.once:
            raise Refused("an __iter__ that returns something other than an iterator of known length")
        return iterator

    def of(self, value: Any) -> list[Any]:
        """Return the items of an iterable.

        Raises:
            Refused: the number of items is only known at run time.
        """
        value = self._iterated(self.paths.narrowed(value))
        if isinstance(value, (v.Each, v.Array)):
            each = self.each(value)
            return [each.item(k) for k in range(each.count)]
        if isinstance(value, (v.List, v.Dict)):
            return list(read(value))
        if isinstance(value, v.Picked):
            return [self.at(value, k) for k in range(self.memory.length_of_picked(value))]
        if isinstance(value, (ir.Var, v.Ring, v.Span, v.Union, v.Bytes, v.Text, v.Instance)):
            raise Refused("the number of items is only known at run time")
        if isinstance(value, tuple) or type(value) in _ITERABLE:
            return [*value]
        if isinstance(value, enum.EnumMeta) and type(value) is enum.EnumMeta:
            return [*value]
        if value is None:
            self.lower.end("TypeError", "cannot unpack non-iterable NoneType object")
        raise Refused(f"iterating over {type(value).__name__}")

    def imported(self, value: Any) -> Any:
        """Convert the result of a Python function to a value of the evaluation."""
        if isinstance(value, _FINITE):
            items = [*value]
            return v.Each(len(items), items.__getitem__)
        if isinstance(value, list):
            return v.List([self.imported(x) for x in value])
        if type(value) is tuple:
            return tuple(self.imported(x) for x in value)
        if type(value) is dict:
            return v.Dict({k: self.imported(x) for k, x in value.items()})
        return value

    def at(self, owner: Any, index: Any) -> Any:
        """Return owner[index]."""
        if owner is None:
            self.lower.end("TypeError", "'NoneType' object is not subscriptable")
        if isinstance(owner, v.Array):
            return self.memory.array_item(owner, index)
        if isinstance(owner, v.Ring) and not is_real(index):
            return self.memory.ring_item(
                owner, self.memory.ring_index(owner, index, "list index out of range")
            )
        if isinstance(owner, v.Dict):
            return read(owner)[self.key(index)]
        if isinstance(owner, v.Picked) and not is_real(index):
            return self.memory.of_picked(owner, index)
        own = self.attributes.called(owner, "__getitem__", index)
        if own is not UNSET:
            return own
        if isinstance(owner, enum.EnumMeta):
            return owner.__members__[self.key(index)]
        known_kind = isinstance(owner, (v.List, tuple)) or type(owner) in _SUBSCRIPTED
        if not known_kind and not (is_real(index) and isinstance(owner, (v.Ring, v.Picked))):
            raise Refused(f"an item of a {type(owner).__name__}")
        items = read(owner) if isinstance(owner, v.List) else owner
        if is_real(index):
            self.lower.end("TypeError", f"{kind_of(items)} indices must be integers or slices, not float")
        if isinstance(index, ir.Var):
            index = self.lower.settled(index, self.lower.facts)
        if isinstance(index, ir.Var):
            if not isinstance(items, (tuple, list)) or not items:
                raise Refused("an index that is only known at run time")
            return self.memory.at(tuple(items), self.lower.within(index, len(items), beyond(items)))
        if isinstance(items, (dict, types.MappingProxyType)):
            return items[self.key(index)]
        if not isinstance(index, slice) and type(index) not in (int, bool):
            raise Refused(f"an index that is a {type(index).__name__}")
        known = isinstance(items, (tuple, list)) and isinstance(index, int)
        if known and not -len(items) <= index < len(items):
            self.lower.end("IndexError", beyond(items))
        item = items[index]
        return v.List(item) if isinstance(owner, v.List) and isinstance(index, slice) else item

    def remove(self, owner: Any, index: Any, text: str) -> Any:
        """Remove an item from a list and return it."""
        if isinstance(owner, v.Ring):
            if index != 0 or isinstance(index, (ir.Var, slice)):
                raise Refused("removing an item other than the first from a list whose length changes")
            item = self.memory.ring_item(owner, self.memory.ring_index(owner, 0, text))
            self.lower.out.append(ir.Drop(owner.number))
            return item
        own = self.attributes.called(owner, "__delitem__", index)
        if own is not UNSET:
            return own
        if isinstance(owner, v.Dict) and not isinstance(index, ir.Var):
            return self.paths.open(owner).pop(self.key(index))
        if not isinstance(owner, v.List) or isinstance(index, ir.Var):
            raise Refused(f"removing an item from a {type(owner).__name__}")
        self.promote(owner)
        held = self.paths.open(owner)
        if isinstance(index, int) and not -len(held) <= index < len(held):
            self.lower.end("IndexError", text)
        item = held[index]
        del held[index]
        return item

    def promote(self, owner: v.List, item: Any = UNSET) -> None:
        """Stop tracking the items of a list of the state, because its length changes."""
        if owner.path is not None:
            example = item if item is not UNSET else owner.slots[0] if owner.slots else UNSET
            if example is UNSET:
                raise Refused("a list of the state that loses items before any are added")
            raise Promote(owner.path, shape_of(example, read))

    def set(self, owner: Any, index: Any, value: Any) -> None:
        """Set an item of a list, array or dictionary."""
        if isinstance(owner, v.Union):
            self.paths.by_form(owner, lambda x: self.set(x, index, value))
            return
        if self.attributes.called(owner, "__setitem__", index, value) is not UNSET:
            return
        if isinstance(owner, v.Dict):
            self.paths.write(owner, self.key(index), value)
        elif isinstance(owner, v.Array):
            self.set_array_item(owner, index, value)
        elif isinstance(owner, v.Ring) and not is_real(index):
            self.memory.set_ring_item(owner, index, value)
        elif isinstance(owner, v.List):
            self._set_list_item(owner, index, value)
        else:
            raise Refused(f"setting an item of a {type(owner).__name__}")

    def set_array_item(self, array: v.Array, index: Any, value: Any) -> None:
        """Set an item of an array."""
        if not (is_number(value) or is_mixed(value)):
            raise Refused("an array of something other than real numbers")
        self.memory.put(array, index, self.paths.real(value))

    def _set_list_item(self, owner: v.List, index: Any, value: Any) -> None:
        held = read(owner)
        if is_real(index):
            self.lower.end("TypeError", "list indices must be integers or slices, not float")
        if not isinstance(index, ir.Var):
            if isinstance(index, slice):
                raise Refused("setting a slice")
            if not -len(held) <= index < len(held):
                self.lower.end("IndexError", "list assignment index out of range")
            self.paths.write(owner, index, value)
            return
        place = self.lower.within(index, len(held), "list assignment index out of range")
        for k in range(len(held)):
            self.paths.write(
                owner, k, self.paths.selected(self.lower.compare("==", place, k), value, held[k])
            )
