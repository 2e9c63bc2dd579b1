"""Partial evaluation of operators, comparisons and comprehensions."""

from __future__ import annotations

import ast
import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from types import MethodType
from typing import Any

from . import ir
from .attributes import member
from .evaluate import Call, Evaluation
from .lower import OPERATORS
from .merge import alike
from .read import kinds_within
from .values import (
    EITHER,
    UNSET,
    Array,
    Bound,
    Box,
    Bytes,
    Closure,
    Dict,
    Each,
    Frame,
    Instance,
    List,
    Picked,
    Refused,
    Ring,
    Span,
    Text,
    Union,
    is_mixed,
    is_number,
    is_plain,
    is_real,
)

BINARY = {
    ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/", ast.FloorDiv: "//", ast.Mod: "%", ast.Pow: "**",
    ast.BitAnd: "&", ast.BitOr: "|", ast.BitXor: "^", ast.RShift: ">>", ast.LShift: "<<",
}  # fmt: skip
COMPARED = {
    ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">=", ast.Eq: "==", ast.NotEq: "!=",
}  # fmt: skip


METHODS = {
    "+": "add", "-": "sub", "*": "mul", "/": "truediv", "//": "floordiv", "%": "mod", "**": "pow", "&": "and",
    "|": "or", "^": "xor", ">>": "rshift", "<<": "lshift", "@": "matmul",
}  # fmt: skip
COMPARISONS = {
    "<": ("__lt__", "__gt__"), "<=": ("__le__", "__ge__"),
    ">": ("__gt__", "__lt__"), ">=": ("__ge__", "__le__"),
    "==": ("__eq__", "__eq__"), "!=": ("__ne__", "__ne__"),
}  # fmt: skip
"""Special methods of operators, and those of the other operand."""


class Operating(Evaluation):
    """Evaluation of operators and comprehensions."""

    # ---- operators of classes ---------------------------------------------------------------

    def _by_class(self, a: Any, b: Any, name: str, reflected: str) -> Any:
        """Return the result of an operator that the class of an operand defines, else `NotImplemented`."""
        kinds = [_class_of(x) for x in (a, b)]
        of_a, of_b = self.special(a, name), self.special(b, reflected)
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
            result = self.narrowed(self.call(method, [other], {}))
            if isinstance(result, Union) and NotImplemented in result.alternatives:
                raise Refused(f"{name} that returns NotImplemented on some paths")
            if result is not NotImplemented:
                return result
        return NotImplemented

    def _basic(self, value: Any) -> Any:
        """Return a number of a class that is derived from int or float as one of the class itself."""
        if type(value) not in (bool, int, float) and isinstance(value, (int, float)):
            return int.__pos__(value) if isinstance(value, int) else float.__pos__(value)
        return value

    # ---- comprehensions ---------------------------------------------------------------------

    def _comprehended(
        self, generators: list[ast.comprehension], make: Callable[[], Any], element: ast.expr
    ) -> list[Any]:
        call, kinds = self.calls[-1], kinds_within(element)
        together = bool(kinds[ast.Lambda] or kinds[ast.GeneratorExp])
        frames = self._frames(generators, together, inlined=sys.version_info >= (3, 12))
        return [self._within(call, frame, make) for frame in frames]

    def _frames(
        self, generators: list[ast.comprehension], together: bool, inlined: bool = False
    ) -> Iterator[Frame]:
        """Yield the names of each element of a comprehension.

        Args:
            generators: its loops.
            together: whether the elements share their names, so that a function made by one of them sees
                those of the last; otherwise elements can be evaluated later.
            inlined: see `Frame`.
        """
        call = self.calls[-1]
        shared = Frame({}, call.frame, inlined)

        def go(k: int, frame: Frame) -> Iterator[Frame]:
            if k == len(generators):
                yield frame
                return
            each = self.each(self._within(call, frame, lambda: self.evaluate(generators[k].iter)))
            for i in range(each.count):
                inner = shared if together else Frame({}, frame, inlined)
                if self._within(call, inner, lambda: self._passes(generators[k], each.item(i))):  # noqa: B023
                    yield from go(k + 1, inner)

        return go(0, call.frame)

    def _within(self, call: Call, frame: Frame, evaluated: Callable[[], Any]) -> Any:
        """Evaluate a part of a comprehension in the scope where it was written, even if evaluated later."""
        self.calls.append(replace(call, frame=frame))
        try:
            return evaluated()
        finally:
            self.calls.pop()

    def _passes(self, generator: ast.comprehension, item: Any) -> bool:
        self.assign(generator.target, item)  # type: ignore[attr-defined]
        for condition in generator.ifs:
            holds = self.facts.known(self.truth_of(self.evaluate(condition)))
            if holds is None:
                raise Refused("a filter that is only known at run time")
            if not holds:
                return False
        return True

    def _listcomp(self, node: ast.ListComp) -> Any:
        return List(self._comprehended(node.generators, lambda: self.evaluate(node.elt), node.elt))

    def _generatorexp(self, node: ast.GeneratorExp) -> Any:
        call, generator = self.calls[-1], node.generators[0]
        if kinds_within(node.elt)[ast.Lambda] or isinstance(node.elt, ast.GeneratorExp):
            raise Refused("functions or generators made by a generator expression")
        if len(node.generators) > 1 or generator.ifs:
            frames = list(self._frames(node.generators, together=False))
            return Each(len(frames), lambda k: self._within(call, frames[k], lambda: self.evaluate(node.elt)))
        each = self.each(self.evaluate(generator.iter))

        def element(k: int) -> Any:
            self.assign(generator.target, each.item(k))  # type: ignore[attr-defined]
            return self.evaluate(node.elt)

        return Each(each.count, lambda k: self._within(call, Frame({}, call.frame), lambda: element(k)))

    def _setcomp(self, node: ast.SetComp) -> Any:
        return frozenset(
            self._comprehended(node.generators, lambda: self._key(self.evaluate(node.elt)), node.elt)
        )

    def _dictcomp(self, node: ast.DictComp) -> Any:
        def make() -> tuple[Any, Any]:
            return self._key(self.evaluate(node.key)), self.evaluate(node.value)

        return Dict(dict(self._comprehended(node.generators, make, node.value)))

    # ---- operators --------------------------------------------------------------------------

    def _binop(self, node: ast.BinOp) -> Any:
        a, b = self.evaluate(node.left), self.evaluate(node.right)
        self.at(node)
        return self.operate(BINARY.get(type(node.op), "@"), a, b)

    def operate(self, op: str, a: Any, b: Any, in_place: bool = False) -> Any:
        """Return a op b, or the result of a op= b."""
        if is_mixed(a) and is_real(b):
            a = self.real(a)
        elif is_mixed(b) and is_real(a):
            b = self.real(b)
        if isinstance(a, Union) or isinstance(b, Union):
            return self.by_form(a, lambda x: self.by_form(b, lambda y: self.operate(op, x, y, in_place)))
        a, b = (self.loaded(x) if isinstance(x, Picked) else x for x in (a, b))
        if not (is_number(a) and is_number(b)):
            name = METHODS[op]
            result = self._by_class(a, b, f"__i{name}__", "") if in_place else NotImplemented
            if result is NotImplemented:
                result = self._by_class(a, b, f"__{name}__", f"__r{name}__")
            if result is not NotImplemented:
                return result
            a, b = self._basic(a), self._basic(b)
        if is_number(a) and is_number(b):
            return self._exact(op, self.binary(op, a, b), a, b)
        lists = [isinstance(x, List) or type(x) is list for x in (a, b)]
        if op == "+" and all(lists):
            return List([*self.items(a), *self.items(b)])
        if isinstance(a, List) and op == "*" and isinstance(b, int):
            return List(self.read(a) * b)
        if isinstance(a, tuple) and isinstance(b, tuple) and op == "+":
            return a + b
        if isinstance(a, tuple) and isinstance(b, int) and op == "*":
            return a * b
        if (is_plain(a) and is_plain(b) and a is not None and b is not None and op in OPERATORS) or (
            type(a) is frozenset and type(b) in (set, frozenset)
        ):
            return OPERATORS[op](a, b)
        if (a is None or b is None) and (is_number(a) or is_number(b)):
            types = f"'{_type_name(a)}' and '{_type_name(b)}'"
            self.end("TypeError", f"unsupported operand type(s) for {op}: {types}")
        raise Refused(f"{op} of a {type(a).__name__} and a {type(b).__name__}")

    def _exact(self, op: str, result: ir.Operand, a: ir.Operand, b: ir.Operand) -> ir.Operand:
        """Emit an exception for integers that are not exact as doubles; Python's integers are unbounded."""
        if not isinstance(result, ir.Var) or result.type != ir.INT:
            return result
        between = self._range_of_result(op, a, b)
        if between is not None and -ir.EXACT < between[0] <= between[1] < ir.EXACT:
            self.ranges[result] = between
            return result
        for x in (a, result) if op == "//" else (result,):  # the quotient of a larger one may be rounded
            inside = self.compare("<", self.size(x), float(ir.EXACT))  # 2^53 may be 2^53 + 1, rounded
            self.require(inside, "OverflowError", ir.INEXACT)
        return result

    def _range_of_result(self, op: str, a: ir.Operand, b: ir.Operand) -> tuple[int, int] | None:
        """Return the least and the largest value of an integer operation, as far as they are known."""
        of_a, of_b = self.range_of(a), self.range_of(b)
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

    def _unaryop(self, node: ast.UnaryOp) -> Any:
        value = self.evaluate(node.operand)
        self.at(node)
        if isinstance(node.op, ast.Not):
            return self.negation(self.truth_of(value))
        name, usual = {
            ast.USub: ("__neg__", self.negative),
            ast.UAdd: ("__pos__", self._positive),
        }.get(type(node.op), ("__invert__", None))
        return self.by_form(value, lambda x: self.unary(name, usual, x))

    def unary(self, name: str, usual: Callable[[Any], Any] | None, value: Any) -> Any:
        """Return the value of a special method of an operand, or of the operation of numbers."""
        method = self.special(value, name)
        if method is not UNSET:
            return self.call(method, [], {})
        value = self._basic(value)
        if usual is None or not is_number(value):
            raise Refused(f"{name} of a {type(value).__name__}")
        return usual(value)

    def _positive(self, value: Any) -> ir.Operand:
        return value if is_real(value) else self.binary("+", value, 0)

    def real(self, value: Any) -> Any:
        """Return a number of any form as a real one."""
        return self.by_form(value, self.as_real)

    def selected(self, test: ir.Operand, a: Any, b: Any) -> Any:
        """Return one of two values, by a condition."""
        if is_number(a) and is_number(b) and alike(a, b) and self.facts.known(test) is None:
            return self.let(ir.joined(map(ir.type_of, (a, b))), "select", test, a, b)
        return self.branch(test, lambda: a, lambda: b)

    def truth_of(self, value: Any) -> ir.Operand:
        """Return whether a value counts as true."""
        value = self.real(value) if is_mixed(value) else value
        if isinstance(value, Union):
            return self.by_form(value, self.truth_of)  # type: ignore[no-any-return]
        if is_number(value):
            return self.truth(value)
        if isinstance(value, Ring):
            return self.compare("!=", self.ring_length(value), 0)
        if isinstance(value, Span):
            return self.compare("<", value.first, value.end)
        if isinstance(value, Each):
            return value.once or bool(value.count)
        if isinstance(value, (List, Dict)):
            return bool(self.read(value))
        if isinstance(value, Picked):
            holds = [bool(self.read(x)) if isinstance(x, List) else self.truth_of(x) for x in value.items]
            return self._at(tuple(map(self.known_item, holds)), value.index)  # type: ignore[no-any-return]
        for name in ("__bool__", "__len__"):
            method = self.special(value, name)
            if method is not UNSET:
                result = self.narrowed(self.call(method, [], {}))
                if not is_number(result) or ir.type_of(result) not in (ir.BOOL, ir.INT)[name == "__len__" :]:
                    raise Refused(f"{name} that returns something other than Python wants")
                return self.truth(result)
        return bool(self._basic(value)) if is_plain(value) or isinstance(value, _SIZED) else True

    def _boolop(self, node: ast.BoolOp) -> Any:
        conjunction = isinstance(node.op, ast.And)

        def go(k: int) -> Any:
            value = self.evaluate(node.values[k])
            if k == len(node.values) - 1:
                return value
            test = self.truth_of(value)

            def stay() -> Any:
                return self.narrowed(value)

            return self.branch(
                test, *((lambda: go(k + 1), stay) if conjunction else (stay, lambda: go(k + 1)))
            )

        return go(0)

    def _ifexp(self, node: ast.IfExp) -> Any:
        test = self.truth_of(self.evaluate(node.test))
        return self.branch(test, lambda: self.evaluate(node.body), lambda: self.evaluate(node.orelse))

    def _namedexpr(self, node: ast.NamedExpr) -> Any:
        value = self.evaluate(node.value)
        self.assign(node.target, value)  # type: ignore[attr-defined]
        return value

    def _lambda(self, node: ast.Lambda) -> Any:
        call = self.calls[-1]
        return Closure(node, call.frame, call.source, tuple(self.values(node.args.defaults)))

    def _compare(self, node: ast.Compare) -> Any:
        def go(left: Any, k: int) -> Any:
            right = self.evaluate(node.comparators[k])
            self.at(node)
            holds: Any = self.compared(node.ops[k], left, right)
            if k == len(node.ops) - 1:
                return holds
            return self.branch(self.truth_of(holds), lambda: go(right, k + 1), lambda: False)

        return go(self.evaluate(node.left), 0)

    def compared(self, op: ast.cmpop, a: Any, b: Any) -> Any:
        """Return the result of a comparison."""
        if is_mixed(a) or is_mixed(b):
            a, b = (self.real(x) if is_mixed(x) else x for x in (a, b))
        if isinstance(a, Union) or isinstance(b, Union):
            return self.by_form(a, lambda x: self.by_form(b, lambda y: self.compared(op, x, y)))
        if isinstance(op, (ast.In, ast.NotIn)):
            contained = self.truth_of(self._contained(a, b))
            return contained if isinstance(op, ast.In) else self.negation(contained)
        if isinstance(op, (ast.Is, ast.IsNot)):
            return self._same(a, b) if isinstance(op, ast.Is) else self.negation(self._same(a, b))
        if is_number(a) and is_number(b):
            return self.compare(COMPARED[type(op)], a, b)
        if isinstance(op, ast.Eq):
            return self._equal(a, b)
        if isinstance(op, ast.NotEq):
            result = self._by_class(a, b, *COMPARISONS["!="])
            return result if result is not NotImplemented else self.negation(self.truth_of(self._equal(a, b)))
        a, b = (self.loaded(x) if isinstance(x, Picked) else x for x in (a, b))
        result = self._by_class(a, b, *COMPARISONS[COMPARED[type(op)]])
        if result is not NotImplemented:
            return result
        a, b = self._basic(a), self._basic(b)
        if is_number(a) and is_number(b):
            return self.compare(COMPARED[type(op)], a, b)
        if (a is None or b is None) and (is_number(a) or is_number(b)):
            types = f"'{_type_name(a)}' and '{_type_name(b)}'"
            self.end("TypeError", f"'{COMPARED[type(op)]}' not supported between instances of {types}")
        if is_plain(a) and is_plain(b):
            return bool(OPERATORS[COMPARED[type(op)]](a, b))
        raise Refused(f"comparing a {type(a).__name__} and a {type(b).__name__}")

    def _same(self, a: Any, b: Any) -> ir.Operand:
        if is_number(a) and is_number(b) and (isinstance(a, ir.Var) or isinstance(b, ir.Var)):
            types = {ir.type_of(a), ir.type_of(b)}
            if ir.EITHER in types:
                raise Refused(EITHER)
            if types == {ir.BOOL}:
                return self.compare("==", a, b)
            if ir.BOOL not in types:
                raise Refused("comparing the identity of two numbers")
        if isinstance(a, (Picked, Span)) or isinstance(b, (Picked, Span)):
            raise Refused("comparing the identity of an item of a table")
        if a is b or (a is None or b is None):
            return a is b
        if isinstance(a, Box) and isinstance(b, Box):
            if any(x.alias or x.merged for x in (a, b)):
                raise Refused("comparing the identity of an object with two names")
        elif isinstance(a, _WITHOUT_IDENTITY) and isinstance(b, _WITHOUT_IDENTITY):
            raise Refused("comparing the identity of texts, tuples or functions")
        return False

    def _equal(self, a: Any, b: Any) -> Any:
        if isinstance(a, Union) or isinstance(b, Union):
            return self.by_form(a, lambda x: self.by_form(b, lambda y: self._equal(x, y)))
        if isinstance(a, Picked) or isinstance(b, Picked):
            picked, other = (a, b) if isinstance(a, Picked) else (b, a)
            if all(map(is_plain, picked.items)) and is_plain(other):
                return self.by_item(picked, lambda x: x == other)
            return self._equal(*(self.loaded(x) if isinstance(x, Picked) else x for x in (a, b)))
        if is_number(a) and is_number(b):
            return self.compare("==", a, b)
        result = self._by_class(a, b, *COMPARISONS["=="])
        if result is not NotImplemented:
            return result
        a, b = self._basic(a), self._basic(b)
        if is_number(a) and is_number(b):
            return self.compare("==", a, b)
        lists = [isinstance(x, List) or type(x) is list for x in (a, b)]
        if all(lists) or (isinstance(a, tuple) and isinstance(b, tuple)):
            items_a, items_b = self.items(a), self.items(b)
            return len(items_a) == len(items_b) and self._all_equal(list(zip(items_a, items_b, strict=True)))
        if isinstance(a, Dict) or isinstance(b, Dict):
            raise Refused("comparing dictionaries")
        if isinstance(a, Array) or isinstance(b, Array):
            raise Refused("comparing arrays")
        if isinstance(a, _INCOMPARABLE) or isinstance(b, _INCOMPARABLE):
            raise Refused(f"comparing a {type(a).__name__} and a {type(b).__name__}")
        if isinstance(a, Box) or isinstance(b, Box) or not (is_plain(a) and is_plain(b)):
            if isinstance(a, (dict, list, set)) or isinstance(b, (dict, list, set)):
                raise Refused(f"comparing a {type(a).__name__} and a {type(b).__name__}")
            if isinstance(a, (ir.Var, List, Dict)) or isinstance(b, (ir.Var, List, Dict)):
                return False  # of different kinds
            return self._same(a, b)
        return bool(a == b)

    def _all_equal(self, pairs: list[tuple[Any, Any]], as_items: bool = True) -> ir.Operand:
        if not pairs:
            return True
        compare = self._same_item if as_items else lambda a, b: self.truth_of(self._equal(a, b))
        return self.branch(  # type: ignore[no-any-return]
            compare(*pairs[0]), lambda: self._all_equal(pairs[1:], as_items), lambda: False
        )

    def _same_item(self, a: Any, b: Any) -> ir.Operand:
        """Return whether items are equal, as `in` and lists compare them: NaN is the same as itself."""
        if a is b:
            return True
        return self.truth_of(self._equal(a, b))

    def _contained(self, a: Any, b: Any) -> Any:
        contains = self.special(b, "__contains__")
        if contains is not UNSET:
            return self.call(contains, [a], {})
        if is_plain(a) and type(b) in (str, dict, set, frozenset, range):
            return a in b
        each = self.each(b)

        def go(k: int) -> ir.Operand:
            if k == each.count:
                return False
            equal = self._same_item(each.item(k), a)
            return self.branch(equal, lambda: True, lambda: go(k + 1))  # type: ignore[no-any-return]

        return go(0)


_SIZED = (str, bytes, tuple, list, dict, set, frozenset, range, int, float)
_WITHOUT_IDENTITY = (tuple, str, Text, bytes, Bytes, Closure, Bound, MethodType)
_INCOMPARABLE = (Ring, Span, Each, Text, Bytes, Closure, Bound, set)


def _class_of(value: Any) -> type:
    """Return the class that a value has in Python, as far as operators depend on it."""
    if isinstance(value, ir.Var):
        return {ir.REAL: float, ir.BOOL: bool}.get(value.type, int)
    if isinstance(value, Instance):
        return value.cls
    return {List: list, Ring: list, Dict: dict, Text: str}.get(type(value), type(value))


def _type_name(value: Any) -> str:
    if isinstance(value, ir.Var):
        if value.type == ir.EITHER:
            raise Refused(EITHER)
        return {ir.REAL: "float", ir.BOOL: "bool"}.get(value.type, "int")
    return type(value).__name__
