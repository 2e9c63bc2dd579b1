"""Evaluation of Python's built-in functions of numbers: rounding, sums, extremes and order."""

from __future__ import annotations

import math
import types
from collections.abc import Sequence
from typing import Any

from . import ir
from .loops import Looping
from .lower import COMPENSATED, complaint
from .values import (
    UNSET,
    List,
    Refused,
    Union,
    is_mixed,
    is_number,
    is_plain,
    is_real,
)

MOST_DIGITS = 15
"""Largest number of digits to which numbers are rounded."""
MOST_SORTED = 63
"""Largest number of numbers that are sorted natively; see `arithmetic.h`."""


class OfNumbers(Looping):
    """Calls of functions of numbers."""

    def _python_abs(self, value: Any) -> Any:
        return self.by_form(value, lambda x: self.unary("__abs__", self.size, x))

    def _python_fabs(self, value: Any) -> Any:
        return self.function("fabs", value)

    def _python_float(self, value: Any) -> Any:
        if type(value) is str:
            return self._called(float, value)
        return self._converted("__float__", (ir.REAL,), self.as_real, value)

    def _python_int(self, value: Any) -> Any:
        if type(value) is str:
            return self._called(int, value)
        return self._converted("__int__", (ir.INT,), lambda x: self.whole("trunc", x), value)

    def _called(self, function: Any, text: str) -> Any:
        try:
            return function(text)
        except ValueError as error:
            self.end("ValueError", str(error))

    def _converted(self, name: str, of: Sequence[str], usual: Any, value: Any) -> Any:
        """Return a number, or that of an object whose class has a special method that returns one."""
        result = self.narrowed(self.unary(name, usual, value))
        if self.special(value, name) is UNSET:
            return result
        if not is_number(result) or ir.type_of(result) not in of:
            raise Refused(f"{name} that returns something other than Python wants")
        return result

    def _python_round(self, value: Any, digits: Any = None) -> Any:
        if digits is None:
            return self.unary("__round__", lambda x: self.whole("rint", x), value)
        if not is_number(value):
            raise Refused(f"round of a {type(value).__name__}")
        if not isinstance(value, ir.Var):
            return round(value, digits)
        if not isinstance(digits, int) or not 0 <= digits <= MOST_DIGITS:
            raise Refused(f"round to other than 0 to {MOST_DIGITS} digits")
        return self.let(ir.REAL, "rounded", value, digits) if is_real(value) else self.whole("rint", value)

    def _python_divmod(self, a: Any, b: Any) -> Any:
        if is_number(a) and is_number(b):
            unit: Any = 1.0 if is_real(a) or is_real(b) else 1
            self.require(self.compare("!=", b, 0), *complaint(lambda: divmod(unit, 0 * unit)))
        return self.operate("//", a, b), self.operate("%", a, b)

    def _python_isclose(self, a: Any, b: Any, *, rel_tol: Any = 1e-09, abs_tol: Any = 0.0) -> Any:
        if not all(isinstance(x, (int, float)) and x >= 0.0 for x in (rel_tol, abs_tol)):
            raise Refused("math.isclose with tolerances that are only known at run time, or negative")
        a, b = self.real(a), self.real(b)
        finite = [self.negation(self.function("isinf", x)) for x in (a, b)]
        apart = self.size(self.binary("-", b, a))
        bounds = [self.size(self.binary("*", float(rel_tol), x)) for x in (b, a)]

        def near() -> Any:
            return self._one_of([self.compare("<=", apart, bound) for bound in (*bounds, float(abs_tol))])

        def of_finite() -> Any:
            return self.branch(finite[0], lambda: self.branch(finite[1], near, lambda: False), lambda: False)

        return self.branch(self.compare("==", a, b), lambda: True, of_finite)

    def _one_of(self, conditions: list[ir.Operand]) -> ir.Operand:
        first, *rest = conditions
        return self.branch(first, lambda: True, lambda: self._one_of(rest)) if rest else first

    def _python_hypot(self, *values: Any) -> Any:
        return (
            self.function("hypot", *values)
            if any(isinstance(x, ir.Var) for x in values)
            else math.hypot(*values)
        )

    def _python_dist(self, first: Any, second: Any) -> Any:
        pairs = list(zip(self.items(first), self.items(second), strict=True))
        if not any(isinstance(x, (ir.Var, Union)) for pair in pairs for x in pair):
            return math.dist(*zip(*pairs, strict=True))
        return self.function("dist", *[self.binary("-", self.real(a), self.real(b)) for a, b in pairs])

    def _python_prod(self, values: Any) -> Any:
        product: Any = 1
        for item in self.items(values):
            product = self.operate("*", product, item)
        return product

    def _python_sum(self, values: Any, start: Any = 0) -> Any:
        """Return sum(values, start), by the summation of the Python that builds."""
        numbers = [start, *self.items(values)]
        if not all(is_number(x) or is_mixed(x) for x in numbers):
            raise Refused("a sum of values that are not numbers")
        if COMPENSATED:
            return self._compensated(numbers, 0)
        total = numbers[0]
        for x in numbers[1:]:
            total = self.operate("+", total, x)
        return total

    def _compensated(self, numbers: list[Any], k: int) -> Any:
        mixed = next((i for i in range(k, len(numbers)) if isinstance(numbers[i], Union)), None)
        if mixed is not None:
            before, after = numbers[:mixed], numbers[mixed + 1 :]
            return self.by_form(numbers[mixed], lambda x: self._compensated([*before, x, *after], mixed))
        if not any(isinstance(x, ir.Var) for x in numbers):
            return sum(numbers[1:], numbers[0])
        first = next((i for i, x in enumerate(numbers) if is_real(x)), len(numbers))
        whole: Any = 0
        for x in numbers[:first]:
            whole = self.operate("+", whole, x)
        if first == len(numbers):
            return whole
        return self.let(ir.REAL, "compensated_sum", whole, *numbers[first:])

    def _python_max(self, *args: Any, **named: Any) -> Any:
        return self._extreme(">", args, named)

    def _python_min(self, *args: Any, **named: Any) -> Any:
        return self._extreme("<", args, named)

    def _extreme(self, op: str, args: Sequence[Any], named: dict[str, Any]) -> Any:
        items = self.items(args[0]) if len(args) == 1 else list(args)
        if not items and "default" in named:
            return named["default"]
        key = named.get("key")
        if items and key is None and all(map(self._is_constant, items)):
            return (max if op == ">" else min)(items)
        if not items:
            raise Refused("min or max of nothing")
        best, *others = self._keyed(items, key, "min or max of values that are not numbers")
        for other in others:
            better = self._in_order(op, other[0], best[0])
            best = tuple(self.selected(better, x, y) for x, y in zip(other, best, strict=True))
        return best[-1]

    def _python_sorted(self, values: Any, key: Any = None, reverse: Any = False) -> Any:
        items = self.items(values)
        if not isinstance(reverse, (bool, int)):
            raise Refused("an order that is only known at run time")
        if key is None and all(map(self._is_constant, items)):
            return List(sorted(items, reverse=bool(reverse)))
        rows = self._keyed(items, key, "sorting values that are not numbers")
        if len(rows) > MOST_SORTED:
            raise Refused(f"sorting more than {MOST_SORTED} numbers that are only known at run time")
        rows = rows[::-1] if reverse else rows  # of equal ones, the first stays first
        keys = [self.real(row[0]) if is_mixed(row[0]) else row[0] for row in rows]
        if any(ir.type_of(x) in (ir.WORD, ir.WIDE) for x in keys):
            raise Refused("sorting integers of 64 bits")
        places = [self.let(ir.INT, "sorted_item", k, *keys) for k in range(len(keys))] if keys[1:] else [0]
        ordered = [self._numbered(place, [row[-1] for row in rows]) for place in places]
        return List(ordered[::-1] if reverse else ordered)

    def _numbered(self, number: ir.Operand, items: Sequence[Any]) -> Any:
        chosen = items[0]
        for k, item in enumerate(items[1:], start=1):
            chosen = self.selected(self.compare("==", number, k), item, chosen)
        return chosen

    def _keyed(self, items: Sequence[Any], key: Any, text: str) -> list[tuple[Any, ...]]:
        """Return items with their keys before them, if there are keys; refused with a text if not numbers."""
        if not all(is_number(x) or is_mixed(x) for x in items):
            raise Refused(text)
        if key is None:
            return [(x,) for x in items]
        keys = [self.call(key, [x], {}) for x in items]
        if not all(is_number(x) or is_mixed(x) for x in keys):
            raise Refused("keys that are not numbers")
        return list(zip(keys, items, strict=True))

    def _in_order(self, op: str, a: Any, b: Any) -> ir.Operand:
        return self.compare(op, *(self.real(x) if is_mixed(x) else x for x in (a, b)))

    def _is_constant(self, value: Any) -> bool:
        """Return whether a value is known at build time, and none of its operators is of a component."""
        if type(value) in (tuple, list, set, frozenset):
            return all(map(self._is_constant, value))
        if type(value) is dict:
            return all(map(self._is_constant, (*value, *value.values())))
        return is_plain(value) or isinstance(value, (range, slice, *_FUNCTIONS))


_FUNCTIONS = (type, types.BuiltinFunctionType)
