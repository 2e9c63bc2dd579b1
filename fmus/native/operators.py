"""Partial evaluation of operators, comparisons and comprehensions."""

from __future__ import annotations

import ast
import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

from . import ir
from .evaluate import Call, Evaluation
from .lower import OPERATORS
from .merge import alike
from .read import kinds_within
from .values import (
    EITHER,
    Array,
    Box,
    Closure,
    Dict,
    Each,
    Frame,
    List,
    Picked,
    Refused,
    Ring,
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


class Operating(Evaluation):
    """Evaluation of operators and comprehensions."""

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

    def operate(self, op: str, a: Any, b: Any) -> Any:
        """Return a op b."""
        if is_mixed(a) and is_real(b):
            a = self.real(a)
        elif is_mixed(b) and is_real(a):
            b = self.real(b)
        if isinstance(a, Union) or isinstance(b, Union):
            return self.by_form(a, lambda x: self.by_form(b, lambda y: self.operate(op, x, y)))
        if is_number(a) and is_number(b):
            return self._exact(op, self.binary(op, a, b), a, b)
        if isinstance(a, (List, list)) and op == "+" and isinstance(b, (List, list)):
            return List([*self.items(a), *self.items(b)])
        if isinstance(a, List) and op == "*" and isinstance(b, int):
            return List(self.read(a) * b)
        if isinstance(a, tuple) and isinstance(b, tuple) and op == "+":
            return a + b
        if isinstance(a, tuple) and isinstance(b, int) and op == "*":
            return a * b
        if (is_plain(a) and is_plain(b) and None not in (a, b)) or (
            isinstance(a, frozenset) and isinstance(b, (set, frozenset))
        ):
            return OPERATORS[op](a, b)
        if None in (a, b) and (is_number(a) or is_number(b)):
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
        if isinstance(node.op, ast.Invert):
            raise Refused("~ is not translated")
        negative = isinstance(node.op, ast.USub)
        return self.by_form(value, self.negative if negative else self._positive)

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
        if isinstance(value, Array):
            return True
        if isinstance(value, (List, Dict)):
            return bool(self.read(value))
        if isinstance(value, Picked):
            return bool(len(value.items[0]))
        return bool(value)

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
            holds = self.compared(node.ops[k], left, right)
            if k == len(node.ops) - 1:
                return holds
            return self.branch(self.truth_of(holds), lambda: go(right, k + 1), lambda: False)

        return go(self.evaluate(node.left), 0)

    def compared(self, op: ast.cmpop, a: Any, b: Any) -> ir.Operand:
        """Return the result of a comparison."""
        if is_mixed(a) or is_mixed(b):
            a, b = (self.real(x) if is_mixed(x) else x for x in (a, b))
        if isinstance(a, Union) or isinstance(b, Union):
            return self.by_form(a, lambda x: self.by_form(b, lambda y: self.compared(op, x, y)))  # type: ignore
        if isinstance(op, (ast.In, ast.NotIn)):
            contained = self._contained(a, b)
            return contained if isinstance(op, ast.In) else self.negation(contained)
        if isinstance(op, (ast.Is, ast.IsNot)):
            return self._same(a, b) if isinstance(op, ast.Is) else self.negation(self._same(a, b))
        if is_number(a) and is_number(b):
            return self.compare(COMPARED[type(op)], a, b)
        if isinstance(op, (ast.Eq, ast.NotEq)):
            equal = self._equal(a, b)
            return equal if isinstance(op, ast.Eq) else self.negation(equal)
        if None in (a, b) and (is_number(a) or is_number(b)):
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
        return a is b

    def _equal(self, a: Any, b: Any) -> ir.Operand:
        if isinstance(a, Union) or isinstance(b, Union):
            return self.by_form(a, lambda x: self.by_form(b, lambda y: self._equal(x, y)))  # type: ignore
        if is_number(a) and is_number(b):
            return self.compare("==", a, b)
        lists = isinstance(a, List), isinstance(b, List)
        if all(lists) or (isinstance(a, tuple) and isinstance(b, tuple)):
            items_a, items_b = self.items(a), self.items(b)
            return len(items_a) == len(items_b) and self._all_equal(list(zip(items_a, items_b, strict=True)))
        if isinstance(a, Array) or isinstance(b, Array):
            raise Refused("comparing arrays")
        if isinstance(a, Box) or isinstance(b, Box):
            return a is b
        return not (isinstance(a, ir.Var) or isinstance(b, ir.Var)) and bool(a == b)

    def _all_equal(self, pairs: list[tuple[Any, Any]]) -> ir.Operand:
        if not pairs:
            return True
        return self.branch(  # type: ignore[no-any-return]
            self._same_item(*pairs[0]), lambda: self._all_equal(pairs[1:]), lambda: False
        )

    def _same_item(self, a: Any, b: Any) -> ir.Operand:
        """Return whether items are equal, as `in` and lists compare them: NaN is the same as itself."""
        return True if a is b else self._equal(a, b)

    def _contained(self, a: Any, b: Any) -> ir.Operand:
        if is_plain(a) and isinstance(b, (str, dict, set, frozenset, range)):
            return a in b
        each = self.each(b)

        def go(k: int) -> ir.Operand:
            if k == each.count:
                return False
            equal = self._same_item(a, each.item(k))
            return self.branch(equal, lambda: True, lambda: go(k + 1))  # type: ignore[no-any-return]

        return go(0)


def _type_name(value: Any) -> str:
    if isinstance(value, ir.Var):
        if value.type == ir.EITHER:
            raise Refused(EITHER)
        return {ir.REAL: "float", ir.BOOL: "bool"}.get(value.type, "int")
    return type(value).__name__
