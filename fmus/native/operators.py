"""Partial evaluation of operators, comparisons and comprehensions."""

from __future__ import annotations

import ast
from collections.abc import Callable
from types import MethodType
from typing import Any

from . import ir
from . import values as v
from .attributes import member
from .items import Containers
from .lower import OPERATORS, name_of
from .values import EITHER, UNSET, Refused, is_mixed, is_number, is_plain, is_real, read

BINARY = {
    ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/", ast.FloorDiv: "//", ast.Mod: "%", ast.Pow: "**",
    ast.BitAnd: "&", ast.BitOr: "|", ast.BitXor: "^", ast.RShift: ">>", ast.LShift: "<<", ast.MatMult: "@",
}  # fmt: skip
COMPARED = {
    ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">=", ast.Eq: "==", ast.NotEq: "!=",
}  # fmt: skip
COMPARISONS = {
    "<": ("__lt__", "__gt__"), "<=": ("__le__", "__ge__"),
    ">": ("__gt__", "__lt__"), ">=": ("__ge__", "__le__"),
    "==": ("__eq__", "__eq__"), "!=": ("__ne__", "__ne__"),
}  # fmt: skip
"""Special methods of operators, and those of the other operand."""


class Operators:
    """Operators of values of all kinds, comparisons, and what counts as true."""

    def __init__(self, items: Containers) -> None:
        self.lower, self.memory, self.paths = items.lower, items.memory, items.paths
        self.attributes, self.items = items.attributes, items

    def _by_class(self, a: Any, b: Any, name: str, reflected: str) -> Any:
        """Return the result of an operator that the class of an operand defines, else `NotImplemented`."""
        kinds = [_class_of(x) for x in (a, b)]
        of_a, of_b = self.attributes.special(a, name), self.attributes.special(b, reflected)
        attempts = [(of_a, b), (of_b, a)]
        compares = (name, reflected) in COMPARISONS.values()
        if kinds[0] is kinds[1]:
            attempts = attempts if compares else attempts[:1]
        elif issubclass(kinds[1], kinds[0]) and (
            compares or member(kinds[1], reflected) is not member(kinds[0], reflected)
        ):
            attempts.reverse()
        for method, other in attempts:
            if method is UNSET:
                continue
            result = self.paths.narrowed(self.attributes.call(method, [other], {}))
            if isinstance(result, v.Union) and NotImplemented in result.alternatives:
                raise Refused(f"{name} that returns NotImplemented on some paths")
            if result is not NotImplemented:
                return result
        return NotImplemented

    def operate(self, op: str, a: Any, b: Any, in_place: bool = False) -> Any:
        """Return a op b, or the result of a op= b."""
        if is_mixed(a) and is_real(b):
            a = self.paths.real(a)
        elif is_mixed(b) and is_real(a):
            b = self.paths.real(b)
        if isinstance(a, v.Union) or isinstance(b, v.Union):
            return self.paths.by_form(
                a, lambda x: self.paths.by_form(b, lambda y: self.operate(op, x, y, in_place))
            )
        a, b = (self.memory.loaded(x) if isinstance(x, v.Picked) else x for x in (a, b))
        if not (is_number(a) and is_number(b)):
            name = name_of(op)
            result = self._by_class(a, b, f"__i{name}__", "") if in_place else NotImplemented
            if result is NotImplemented:
                result = self._by_class(a, b, f"__{name}__", f"__r{name}__")
            if result is not NotImplemented:
                return result
            a, b = _basic(a), _basic(b)
        if is_number(a) and is_number(b):
            return self._exact(op, self.lower.binary(op, a, b), a, b)
        lists = [isinstance(x, v.List) or type(x) is list for x in (a, b)]
        if op == "+" and all(lists):
            return v.List([*self.items.of(a), *self.items.of(b)])
        if isinstance(a, v.List) and op == "*" and isinstance(b, int):
            return v.List(read(a) * b)
        if isinstance(a, tuple) and isinstance(b, tuple) and op == "+":
            return a + b
        if isinstance(a, tuple) and isinstance(b, int) and op == "*":
            return a * b
        if (is_plain(a) and is_plain(b) and a is not None and b is not None and op != "@") or (
            type(a) is frozenset and type(b) in (set, frozenset)
        ):
            return OPERATORS[op](a, b)
        if (a is None or b is None) and (is_number(a) or is_number(b)):
            types = f"'{_type_name(a)}' and '{_type_name(b)}'"
            self.lower.end("TypeError", f"unsupported operand type(s) for {op}: {types}")
        raise Refused(f"{op} of a {type(a).__name__} and a {type(b).__name__}")

    def _exact(self, op: str, result: ir.Operand, a: ir.Operand, b: ir.Operand) -> ir.Operand:
        """Emit an exception for integers that are not exact as doubles; Python's integers are unbounded."""
        if not isinstance(result, ir.Var) or result.type != ir.INT:
            return result
        between = self._range_of_result(op, a, b)
        if between is not None and -ir.EXACT < between[0] <= between[1] < ir.EXACT:
            self.lower.ranges[result] = between
            return result
        for x in (a, result) if op == "//" else (result,):  # the quotient of a larger one may be rounded
            inside = self.lower.compare(
                "<", self.lower.size(x), float(ir.EXACT)
            )  # 2^53 may be 2^53 + 1, rounded
            self.lower.require(inside, "OverflowError", ir.INEXACT)
        return result

    def _range_of_result(self, op: str, a: ir.Operand, b: ir.Operand) -> tuple[int, int] | None:
        """Return the least and the largest value of an integer operation, as far as they are known."""
        of_a, of_b = self.lower.range_of(a), self.lower.range_of(b)
        if op == "%" and isinstance(b, int) and b > 0:
            return 0, b - 1
        if of_a is None or of_b is None:
            return None
        if op in ("+", "-", "*"):
            ends = [OPERATORS[op](x, y) for x in of_a for y in of_b]
            return min(ends), max(ends)
        if op == "//" and isinstance(b, int) and b > 0:
            return of_a[0] // b, of_a[1] // b
        return None

    def unary(self, name: str, usual: Callable[[Any], Any] | None, value: Any) -> Any:
        """Return the value of a special method of an operand, or of the operation of numbers."""
        own = self.attributes.called(value, name)
        if own is not UNSET:
            return own
        value = _basic(value)
        if usual is None or not is_number(value):
            raise Refused(f"{name} of a {type(value).__name__}")
        return usual(value)

    def positive(self, value: Any) -> ir.Operand:
        return value if is_real(value) else self.lower.binary("+", value, 0)

    def truth_of(self, value: Any) -> ir.Operand:
        """Return whether a value counts as true."""
        value = self.paths.real(value) if is_mixed(value) else value
        if isinstance(value, v.Union):
            return self.paths.by_form(value, self.truth_of)  # type: ignore[no-any-return]
        if is_number(value):
            return self.lower.truth(value)
        if isinstance(value, v.Ring):
            return self.lower.compare("!=", self.memory.ring_length(value), 0)
        if isinstance(value, v.Span):
            return self.lower.compare("<", value.first, value.end)
        if isinstance(value, v.Each):
            return value.once or bool(value.count)
        if isinstance(value, (v.List, v.Dict)):
            return bool(read(value))
        if isinstance(value, v.Picked):
            holds = [bool(read(x)) if isinstance(x, v.List) else self.truth_of(x) for x in value.items]
            return self.memory.at(tuple(map(self.memory.known_item, holds)), value.index)  # type: ignore[no-any-return]
        for name in ("__bool__", "__len__"):
            result = self.attributes.called(value, name)
            if result is not UNSET:
                result = self.paths.narrowed(result)
                if not is_number(result) or ir.type_of(result) not in (ir.BOOL, ir.INT)[name == "__len__" :]:
                    raise Refused(f"{name} that returns something other than Python wants")
                return self.lower.truth(result)
        return bool(_basic(value)) if is_plain(value) or isinstance(value, _SIZED) else True

    def compared(self, op: ast.cmpop, a: Any, b: Any) -> Any:
        """Return the result of a comparison."""
        if is_mixed(a) or is_mixed(b):
            a, b = (self.paths.real(x) if is_mixed(x) else x for x in (a, b))
        if isinstance(a, v.Union) or isinstance(b, v.Union):
            return self.paths.by_form(a, lambda x: self.paths.by_form(b, lambda y: self.compared(op, x, y)))
        if isinstance(op, (ast.In, ast.NotIn)):
            contained = self.truth_of(self._contained(a, b))
            return contained if isinstance(op, ast.In) else self.lower.negation(contained)
        if isinstance(op, (ast.Is, ast.IsNot)):
            return self._same(a, b) if isinstance(op, ast.Is) else self.lower.negation(self._same(a, b))
        if is_number(a) and is_number(b):
            return self.lower.compare(COMPARED[type(op)], a, b)
        if isinstance(op, ast.Eq):
            return self._equal(a, b)
        if isinstance(op, ast.NotEq):
            result = self._by_class(a, b, *COMPARISONS["!="])
            return (
                result
                if result is not NotImplemented
                else self.lower.negation(self.truth_of(self._equal(a, b)))
            )
        a, b = (self.memory.loaded(x) if isinstance(x, v.Picked) else x for x in (a, b))
        result = self._by_class(a, b, *COMPARISONS[COMPARED[type(op)]])
        if result is not NotImplemented:
            return result
        a, b = _basic(a), _basic(b)
        if is_number(a) and is_number(b):
            return self.lower.compare(COMPARED[type(op)], a, b)
        if (a is None or b is None) and (is_number(a) or is_number(b)):
            types = f"'{_type_name(a)}' and '{_type_name(b)}'"
            self.lower.end("TypeError", f"'{COMPARED[type(op)]}' not supported between instances of {types}")
        if is_plain(a) and is_plain(b):
            return bool(OPERATORS[COMPARED[type(op)]](a, b))
        raise Refused(f"comparing a {type(a).__name__} and a {type(b).__name__}")

    def _same(self, a: Any, b: Any) -> ir.Operand:
        if is_number(a) and is_number(b) and (isinstance(a, ir.Var) or isinstance(b, ir.Var)):
            types = {ir.type_of(a), ir.type_of(b)}
            if ir.EITHER in types:
                raise Refused(EITHER)
            if types == {ir.BOOL}:
                return self.lower.compare("==", a, b)
            if ir.BOOL not in types:
                raise Refused("comparing the identity of two numbers")
        if isinstance(a, (v.Picked, v.Span)) or isinstance(b, (v.Picked, v.Span)):
            raise Refused("comparing the identity of an item of a table")
        if a is b or (a is None or b is None):
            return a is b
        if isinstance(a, v.Box) and isinstance(b, v.Box):
            if any(x.alias or x.merged for x in (a, b)):
                raise Refused("comparing the identity of an object with two names")
        elif isinstance(a, _WITHOUT_IDENTITY) and isinstance(b, _WITHOUT_IDENTITY):
            raise Refused("comparing the identity of texts, tuples or functions")
        return False

    def _equal(self, a: Any, b: Any) -> Any:
        if isinstance(a, v.Union) or isinstance(b, v.Union):
            return self.paths.by_form(a, lambda x: self.paths.by_form(b, lambda y: self._equal(x, y)))
        if isinstance(a, v.Picked) or isinstance(b, v.Picked):
            picked, other = (a, b) if isinstance(a, v.Picked) else (b, a)
            if all(map(is_plain, picked.items)) and is_plain(other):
                return self.memory.by_item(picked, lambda x: x == other)
            return self._equal(*(self.memory.loaded(x) if isinstance(x, v.Picked) else x for x in (a, b)))
        if is_number(a) and is_number(b):
            return self.lower.compare("==", a, b)
        result = self._by_class(a, b, *COMPARISONS["=="])
        if result is not NotImplemented:
            return result
        a, b = _basic(a), _basic(b)
        if is_number(a) and is_number(b):
            return self.lower.compare("==", a, b)
        lists = [isinstance(x, v.List) or type(x) is list for x in (a, b)]
        if all(lists) or (isinstance(a, tuple) and isinstance(b, tuple)):
            items_a, items_b = self.items.of(a), self.items.of(b)
            return len(items_a) == len(items_b) and self.all_equal(list(zip(items_a, items_b, strict=True)))
        if isinstance(a, v.Dict) or isinstance(b, v.Dict):
            raise Refused("comparing dictionaries")
        if isinstance(a, v.Array) or isinstance(b, v.Array):
            raise Refused("comparing arrays")
        if isinstance(a, _INCOMPARABLE) or isinstance(b, _INCOMPARABLE):
            raise Refused(f"comparing a {type(a).__name__} and a {type(b).__name__}")
        if isinstance(a, v.Box) or isinstance(b, v.Box) or not (is_plain(a) and is_plain(b)):
            if isinstance(a, (dict, list, set)) or isinstance(b, (dict, list, set)):
                raise Refused(f"comparing a {type(a).__name__} and a {type(b).__name__}")
            if isinstance(a, (ir.Var, v.List, v.Dict)) or isinstance(b, (ir.Var, v.List, v.Dict)):
                return False  # of different kinds
            return self._same(a, b)
        return bool(a == b)

    def all_equal(self, pairs: list[tuple[Any, Any]], as_items: bool = True) -> ir.Operand:
        if not pairs:
            return True
        compare = self._same_item if as_items else lambda a, b: self.truth_of(self._equal(a, b))
        return self.paths.branch(  # type: ignore[no-any-return]
            compare(*pairs[0]), lambda: self.all_equal(pairs[1:], as_items), lambda: False
        )

    def _same_item(self, a: Any, b: Any) -> ir.Operand:
        """Return whether items are equal, as `in` and lists compare them: NaN is the same as itself."""
        if a is b:
            return True
        return self.truth_of(self._equal(a, b))

    def _contained(self, a: Any, b: Any) -> Any:
        own = self.attributes.called(b, "__contains__", a)
        if own is not UNSET:
            return own
        if is_plain(a) and type(b) in (str, dict, set, frozenset, range):
            return a in b
        each = self.items.each(b)

        def go(k: int) -> ir.Operand:
            if k == each.count:
                return False
            equal = self._same_item(each.item(k), a)
            return self.paths.branch(equal, lambda: True, lambda: go(k + 1))  # type: ignore[no-any-return]

        return go(0)


_SIZED = (str, bytes, tuple, list, dict, set, frozenset, range, int, float)
_WITHOUT_IDENTITY = (tuple, str, v.Text, bytes, v.Bytes, v.Closure, v.Bound, MethodType)
_INCOMPARABLE = (v.Ring, v.Span, v.Each, v.Text, v.Bytes, v.Closure, v.Bound, set)


def _class_of(value: Any) -> type:
    """Return the class that a value has in Python, as far as operators depend on it."""
    if isinstance(value, ir.Var):
        return {ir.REAL: float, ir.BOOL: bool}.get(value.type, int)
    if isinstance(value, v.Instance):
        return value.cls
    return {v.List: list, v.Ring: list, v.Dict: dict, v.Text: str}.get(type(value), type(value))


def _type_name(value: Any) -> str:
    if isinstance(value, ir.Var):
        if value.type == ir.EITHER:
            raise Refused(EITHER)
        return {ir.REAL: "float", ir.BOOL: "bool"}.get(value.type, "int")
    return type(value).__name__


def _basic(value: Any) -> Any:
    """Return a number of a class that is derived from int or float as one of the class itself."""
    if type(value) not in (bool, int, float) and isinstance(value, (int, float)):
        return int.__pos__(value) if isinstance(value, int) else float.__pos__(value)
    return value
