"""Partial evaluation of a component's expressions at build time."""

from __future__ import annotations

import ast
import builtins
import enum
import itertools
import re
import types
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from . import ir
from .attributes import Attributes
from .merge import alike
from .read import Source, Sources
from .shapes import Widening, build, numbers_of, shape_of
from .values import (
    EITHER,
    OF_TABLE,
    RESIZED,
    UNSET,
    Array,
    Bytes,
    Dict,
    Each,
    Failure,
    Frame,
    Instance,
    List,
    Picked,
    Refused,
    Ring,
    Span,
    Text,
    Union,
    boxes_in,
    is_number,
    is_plain,
    is_real,
    joined_text,
    like,
    same,
)

DEEPEST = 60
"""Largest depth of nested calls; chosen: more than components need, to detect infinite recursion."""


@dataclass
class Call:
    """Call of a function that is being evaluated."""

    source: Source
    frame: Frame
    cls: type | None = None
    line: int = 0
    column: int = 0
    base: Frame | None = None  # of an inner function
    own: frozenset[str] = frozenset()  # names that an inner function sets


class Evaluation(Attributes):
    """Evaluation of names, structures, attributes and items; other modules add the rest."""

    def __init__(self, sources: Sources) -> None:
        super().__init__()
        self.sources = sources
        self.calls: list[Call] = []
        self.entered = ""  # file and line of the last function that was entered

    def where(self) -> str:
        named = next((call for call in reversed(self.calls) if call.source.file), None)
        return f"{named.source.file}:{named.line}" if named else ""

    def branch_at(self) -> str:
        named = next((call for call in reversed(self.calls) if call.source.file), None)
        return f"{named.source.file}:{named.line}:{named.column}" if named else ""

    def raised_at(self) -> str:
        inner = next((call for call in reversed(self.calls) if call.source.of_package), None)
        return f"{inner.source.file}:{inner.line}" if inner else ""

    def at(self, node: ast.AST) -> None:
        """Record the line that is being evaluated."""
        self.calls[-1].line = node.lineno  # type: ignore[attr-defined]
        self.calls[-1].column = node.col_offset  # type: ignore[attr-defined]

    def evaluate(self, node: ast.expr) -> Any:
        """Return the value of an expression.

        Raises:
            Refused: with file and line.
        """
        return self.narrowed(self.dispatched("_", node))

    def dispatched(self, prefix: str, node: ast.AST) -> Any:
        """Call the method for a kind of node, whose name consists of `prefix` and the kind.

        Raises:
            Refused: there is no such method, or it refuses; with file and line.
        """
        kind = type(node).__name__
        method = getattr(self, prefix + kind.lower(), None)
        self.at(node)
        if method is None:
            raise Refused(f"{kind} is not translated: {_first_line(node)}", self.where())
        try:
            return method(node)
        except Refused as refused:
            if not refused.where:
                self.at(node)
                refused.where = self.where()
            raise
        except (TypeError, AttributeError, LookupError, ValueError) as error:
            self.at(node)
            raise Refused(f"{kind} is not translated: {_first_line(node)}", self.where()) from error

    # ---- names and constants ----------------------------------------------------------------

    def _constant(self, node: ast.Constant) -> Any:
        return node.value

    def _name(self, node: ast.Name) -> Any:
        call = self.calls[-1]
        frame: Frame | None = call.frame
        outside = free = False
        while frame is not None:
            value = self.read(frame).get(node.id, UNSET)
            if value is not UNSET:
                if outside and node.id in call.own:
                    raise Refused(f"{node.id} is read before the inner function sets it")
                return self.present(value, *_unset(node.id, free))
            outside = outside or frame is call.base
            free = free or not frame.inlined
            frame = frame.parent
        for names in (call.source.cells, call.source.names, vars(builtins)):
            if node.id in names:
                return names[node.id]
        raise Refused(f"{node.id} has no value here")

    def present(self, value: Any, kind: str, text: str) -> Any:
        """Return a value that is set, or raise an exception where it is not."""
        if not isinstance(value, Union) or not any(x is UNSET for x in value.alternatives):
            return value

        def use(x: Any) -> Any:
            if x is UNSET:
                self.end(kind, text)
            return x

        return self.by_form(value, use)

    def _joinedstr(self, node: ast.JoinedStr) -> Any:
        parts: list[ir.Part] = []
        for piece in node.values:
            if isinstance(piece, ast.Constant):
                parts.append(str(piece.value))
                continue
            assert isinstance(piece, ast.FormattedValue)
            spec = self.evaluate(piece.format_spec) if piece.format_spec else ""
            if piece.conversion == ord("a"):
                raise Refused("the conversion !a")
            parts += self._formatted(self.evaluate(piece.value), spec, piece.conversion == ord("r"))
        return joined_text(parts)

    def _formatted(self, value: Any, spec: str, as_repr: bool) -> list[ir.Part]:
        if isinstance(value, Text):
            return list(value.parts)
        if isinstance(value, ir.Var):
            if value.type == ir.EITHER and not spec:
                raise Refused(EITHER)
            if spec != "" and not re.fullmatch(r"(\.\d)?g", spec):
                raise Refused(f"the format {spec!r}")
            return [(value, spec or "r")]
        if (type(value) is tuple or isinstance(value, List)) and not is_plain(value):
            items = self.read(value) if isinstance(value, List) else value
            opening, closing = "[]" if isinstance(value, List) else "()"
            parts: list[ir.Part] = [opening]
            for i, item in enumerate(items):
                parts += [", "] * bool(i) + self._formatted(item, "", True)
            return [*parts, ",)" if closing == ")" and len(items) == 1 else closing]
        if not is_plain(value):
            raise Refused("a text of something unknown")
        return [format(repr(value) if as_repr else value, spec)]

    # ---- structures -------------------------------------------------------------------------

    def values(self, nodes: Sequence[ast.expr]) -> list[Any]:
        """Return the values of expressions, some of which may be starred."""
        results: list[Any] = []
        for node in nodes:
            if isinstance(node, ast.Starred):
                results += self.items(self.evaluate(node.value))
            else:
                results.append(self.evaluate(node))
        return results

    def _tuple(self, node: ast.Tuple) -> Any:
        return tuple(self.values(node.elts))

    def _list(self, node: ast.List) -> Any:
        return List(self.values(node.elts))

    def _dict(self, node: ast.Dict) -> Any:
        made: dict[Any, Any] = {}
        for key, value in zip(node.keys, node.values, strict=True):
            if key is None:
                inner = self.evaluate(value)
                made |= self.read(inner) if isinstance(inner, Dict) else inner
            else:
                made[self._key(self.evaluate(key))] = self.evaluate(value)
        return Dict(made)

    def _key(self, value: Any) -> Any:
        value = self.settled(value, self.facts) if isinstance(value, ir.Var) else value
        if not is_plain(value):
            raise Refused("a key that is only known at run time")
        return value

    def each(self, value: Any) -> Each:
        """Return the items of an iterable, evaluated lazily.

        Raises:
            Refused: the number of items is only known at run time.
        """
        value = self._iterated(self.narrowed(value))
        if isinstance(value, Each):
            if self.facts.known(self.read(value)["used"]) is True:
                raise Refused("an iterator that is used twice")
            if value.once:
                self.write(value, "used", True)
            return value
        if isinstance(value, Array):
            array = value
            return Each(array.memory.length, lambda k: self.array_item(array, k))
        if not isinstance(value, List):
            items = self.items(value)
            return Each(len(items), items.__getitem__)
        count = len(self.read(value))

        def content() -> list[Any]:
            if len(self.read(value)) != count:
                raise Refused(RESIZED)
            return self.read(value)  # type: ignore[no-any-return]

        return Each(count, lambda k: content()[k], content)

    def _iterated(self, value: Any) -> Any:
        """Return what the __iter__ of a value's class returns, if it is of a component."""
        iterate = self.special(value, "__iter__")
        if iterate is UNSET:
            return value
        iterator = self.narrowed(self.call(iterate, [], {}))
        if not isinstance(iterator, Each) or not iterator.once:
            raise Refused("an __iter__ that returns something other than an iterator of known length")
        return iterator

    def items(self, value: Any) -> list[Any]:
        """Return the items of an iterable.

        Raises:
            Refused: the number of items is only known at run time.
        """
        value = self._iterated(self.narrowed(value))
        if isinstance(value, (Each, Array)):
            each = self.each(value)
            return [each.item(k) for k in range(each.count)]
        if isinstance(value, (List, Dict)):
            return list(self.read(value))
        if isinstance(value, Picked):
            return [self.subscript(value, k) for k in range(self.length_of_picked(value))]
        if isinstance(value, (ir.Var, Ring, Span, Union, Bytes, Text, Instance)):
            raise Refused("the number of items is only known at run time")
        if isinstance(value, tuple) or type(value) in _ITERABLE:
            return [*value]
        if isinstance(value, enum.EnumMeta) and type(value) is enum.EnumMeta:
            return [*value]
        if value is None:
            self.end("TypeError", "cannot unpack non-iterable NoneType object")
        raise Refused(f"iterating over {type(value).__name__}")

    def length_of_picked(self, value: Picked) -> int:
        """Return the length of an item of a table, if that of all is the same."""
        rows = [self.read(x) if isinstance(x, List) else x for x in value.items]
        lengths = {len(x) if isinstance(x, (tuple, list)) else None for x in rows}
        if len(lengths) != 1 or None in lengths:
            raise Refused("an item of a table whose items are of different length")
        return lengths.pop()  # type: ignore[return-value]

    def by_item(self, value: Picked, use: Callable[[Any], Any]) -> Any:
        """Apply `use`, which computes nothing at run time, to the item of a table."""
        return self._at(tuple(self.known_item(use(x)) for x in value.items), value.index)

    def known_item(self, value: Any) -> Any:
        """Return a value of a table that is known at build time."""
        if isinstance(value, ir.Var):
            raise Refused("an item of a table whose items are only known at run time")
        return value

    def imported(self, value: Any) -> Any:
        """Convert the result of a Python function to a value of the evaluation."""
        if isinstance(value, _FINITE):
            items = [*value]
            return Each(len(items), items.__getitem__)
        if isinstance(value, list):
            return List([self.imported(x) for x in value])
        if type(value) is tuple:
            return tuple(self.imported(x) for x in value)
        if type(value) is dict:
            return Dict({k: self.imported(x) for k, x in value.items()})
        return value

    # ---- attributes and items ---------------------------------------------------------------

    def _attribute(self, node: ast.Attribute) -> Any:
        inner = node.value
        if isinstance(inner, ast.Call) and isinstance(inner.func, ast.Name) and inner.func.id == "super":
            return self.of_base(*self._super(inner), node.attr)
        owner = self.evaluate(inner)
        self.at(node)
        return self.by_form(owner, lambda x: self.attribute(x, node.attr))

    def _super(self, node: ast.Call) -> tuple[Any, type]:
        """Return the object and the class of super(...)."""
        call = self.calls[-1]
        if node.args:
            cls, me = self.values(node.args)
        else:
            cls, names = call.source.cells.get("__class__"), call.source.node.args.args
            if cls is None or not names or call.frame.parent is not None:
                raise Refused("super() outside a method, or within another function of it")
            me = self.read(call.frame)[names[0].arg]
        if not isinstance(cls, type):
            raise Refused("super() of something other than a class")
        return self.narrowed(me), cls

    def _subscript(self, node: ast.Subscript) -> Any:
        owner, index = self.evaluate(node.value), self.evaluate(node.slice)
        self.at(node)
        return self.by_form(owner, lambda x: self.by_form(index, lambda i: self.subscript(x, i)))

    def _slice(self, node: ast.Slice) -> Any:
        ends = [None if x is None else self.evaluate(x) for x in (node.lower, node.upper, node.step)]
        if any(isinstance(x, ir.Var) for x in ends):
            raise Refused("a slice whose ends are only known at run time")
        return slice(*ends)

    def subscript(self, owner: Any, index: Any) -> Any:
        """Return owner[index]."""
        if owner is None:
            self.end("TypeError", "'NoneType' object is not subscriptable")
        if isinstance(owner, Array):
            return self.array_item(owner, index)
        if isinstance(owner, Ring) and not is_real(index):
            return self.ring_item(owner, self.ring_index(owner, index, "list index out of range"))
        if isinstance(owner, Dict):
            return self.read(owner)[self._key(index)]
        if isinstance(owner, Picked) and not is_real(index):
            return self._of_picked(owner, index)
        own = self.special(owner, "__getitem__")
        if own is not UNSET:
            return self.call(own, [index], {})
        if isinstance(owner, enum.EnumMeta):
            return owner.__members__[self._key(index)]
        known_kind = isinstance(owner, (List, tuple)) or type(owner) in _SUBSCRIPTED
        if not known_kind and not (is_real(index) and isinstance(owner, (Ring, Picked))):
            raise Refused(f"an item of a {type(owner).__name__}")
        items = self.read(owner) if isinstance(owner, List) else owner
        if is_real(index):
            self.end("TypeError", f"{_kind_of(items)} indices must be integers or slices, not float")
        if isinstance(index, ir.Var):
            index = self.settled(index, self.facts)
        if isinstance(index, ir.Var):
            if not isinstance(items, (tuple, list)) or not items:
                raise Refused("an index that is only known at run time")
            return self._at(tuple(items), self.within(index, len(items), _beyond(items)))
        if isinstance(items, (dict, types.MappingProxyType)):
            return items[self._key(index)]
        if not isinstance(index, slice) and type(index) not in (int, bool):
            raise Refused(f"an index that is a {type(index).__name__}")
        known = isinstance(items, (tuple, list)) and isinstance(index, int)
        if known and not -len(items) <= index < len(items):
            self.end("IndexError", _beyond(items))
        item = items[index]
        return List(item) if isinstance(owner, List) and isinstance(index, slice) else item

    def _at(self, items: tuple[Any, ...], index: ir.Operand) -> Any:
        if not isinstance(index, ir.Var):
            return items[int(index)]
        if all(is_number(x) for x in items):
            types = [ir.type_of(x) for x in items]
            if ir.are_joined(types):
                return self._load(ir.joined(types), items, index)
            real = self._load(ir.REAL, items, index)
            is_real = self._load(ir.INT, tuple(int(type == ir.REAL) for type in types), index)
            whole = ir.joined(type for type in types if type != ir.REAL)
            return Union(is_real, (self.let(whole, "copy", real), real))
        if all(same(x, items[0]) for x in items):
            return items[0]
        return Picked(items, index)

    def _load(self, type: str, table: tuple[ir.Operand, ...], index: ir.Operand) -> ir.Var:
        target = self.new(type)
        self.out.append(ir.Load(target, table, index))
        return target

    def _of_picked(self, owner: Picked, index: Any) -> Any:
        rows = [self.read(x) if isinstance(x, List) else x for x in owner.items]
        if not all(isinstance(row, (tuple, list)) and len(row) == len(rows[0]) for row in rows):
            raise Refused("an item of a table whose rows are not alike")
        if not isinstance(index, ir.Var):
            return self._at(tuple(row[index] for row in rows), owner.index)
        width = len(rows[0])
        index = self.within(index, width, _beyond(rows[0]))
        place = self.binary("+", self.binary("*", owner.index, width), index)
        return self._at(tuple(x for row in rows for x in row), place)

    def loaded(self, value: Picked) -> Any:
        """Return an item of a table, with its numbers loaded."""
        first = value.items[0]
        if not all(alike(first, x) for x in value.items):
            raise Refused("an item of a table whose items are not alike")
        if isinstance(first, tuple):
            return like(first, [self._whole(self._of_picked(value, k)) for k in range(len(first))])
        shape = shape_of(first, self.read)
        for x in value.items[1:]:
            shape = Widening().of(shape, shape_of(x, self.read))
        rows = [numbers_of(shape, x, self.read, self) for x in value.items]
        leaves = iter([self._at(column, value.index) for column in zip(*rows, strict=True)])
        made = build(shape, leaves, alias=OF_TABLE)
        origins = tuple(boxes_in(value))
        for box in boxes_in(made):
            box.origins = origins
        return made

    def _whole(self, value: Any) -> Any:
        return self.loaded(value) if isinstance(value, Picked) else value


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


def _unset(name: str, free: bool) -> tuple[str, str]:
    """Return Python's exception for a name without value, of a function itself or of the one around it."""
    kind = "free" if free else "local"
    text = f"cannot access {kind} variable '{name}' where it is not associated with a value"
    return ("NameError", f"{text} in enclosing scope") if free else ("UnboundLocalError", text)


def _first_line(node: ast.AST) -> str:
    return ast.unparse(node).strip().splitlines()[0]


def _beyond(items: Any) -> str:
    return f"{_kind_of(items)} index out of range"


def _kind_of(items: Any) -> str:
    row = items.items[0] if isinstance(items, Picked) else items
    return "tuple" if isinstance(row, tuple) else "list"


__all__ = ["Call", "Evaluation", "Failure"]
