"""Lowering of Python's arithmetic to operations of the intermediate form, with its exceptions.

Messages are those of the Python that runs the build. Known conditions on the current path (`Facts`) decide
further conditions.
"""

from __future__ import annotations

import math
import operator
import sys
from collections.abc import Callable
from typing import Any, NoReturn

from . import ir
from .stack import Stack
from .values import Refused, Unreachable

MASK = 2**64 - 1
LARGEST = 2**1023
"""An integer that is a real number, too, as all smaller ones are."""
OPERATORS: dict[str, Callable[[Any, Any], Any]] = {
    "+": operator.add, "-": operator.sub, "*": operator.mul, "/": operator.truediv, "**": operator.pow,
    "//": operator.floordiv, "%": operator.mod, "&": operator.and_, "|": operator.or_, "^": operator.xor,
    ">>": operator.rshift, "<<": operator.lshift, "<": operator.lt, "<=": operator.le, ">": operator.gt,
    ">=": operator.ge, "==": operator.eq, "!=": operator.ne, "@": operator.matmul,
}  # fmt: skip
OF_WIDE = ("copy", "word", "add_word", "mul_word")
"""Operations of which the lowest 64 bits follow from those of the operands."""
CAN_OVERFLOW = ("exp", "expm1", "sinh", "cosh")
ALWAYS_DEFINED = ("atan", "atan2", "tanh", "fabs", "copysign", "floor", "ceil", "trunc")
DOMAIN = ("sqrt", "sin", "cos", "tan", "asin", "acos", "log", "log1p", "log10", "fmod")
FUNCTIONS = (*CAN_OVERFLOW, *ALWAYS_DEFINED, *DOMAIN)
MOST_OPERATIONS = 200_000
"""Largest number of operations of an evaluated function; chosen: twice those of the sensors, the most."""


def name_of(op: str) -> str:
    """Return the name of an operator in operations and special methods: "add" for "+"."""
    return OPERATORS[op].__name__.rstrip("_")


def complaint(call: Callable[[], Any]) -> tuple[str, str]:
    """Return type and message of the exception raised by a call."""
    try:
        call()
    except Exception as error:
        return type(error).__name__, str(error)
    raise AssertionError("that raises nothing")


class Facts:
    """Conditions known to be true or false on a path."""

    def __init__(self) -> None:
        self.truths: dict[ir.Var, bool] = {}
        self.numbers: dict[ir.Var, int] = {}
        self.others: dict[ir.Var, frozenset[int]] = {}  # excluded values of a variable
        self.meanings: dict[ir.Var, tuple[Any, ...]] = {}
        self.domains: dict[ir.Var, frozenset[int]] = {}  # possible values of a variable

    def copy(self) -> Facts:
        """Return a copy to which facts can be added; the meanings of conditions are shared."""
        more = Facts()
        more.truths, more.numbers, more.others = dict(self.truths), dict(self.numbers), dict(self.others)
        more.meanings, more.domains = self.meanings, self.domains
        return more

    def left(self, variable: ir.Var) -> frozenset[int] | None:
        """Return the possible values of a variable on this path; None if unknown."""
        if variable in self.numbers:
            return frozenset([self.numbers[variable]])
        if variable not in self.domains:
            return None
        return self.domains[variable] - self.others.get(variable, frozenset())

    def learn(self, condition: ir.Operand, holds: bool) -> None:
        """Record that a condition is true or false."""
        if not isinstance(condition, ir.Var) or self.truths.get(condition) is holds:
            return
        self.truths[condition] = holds
        kind, *of = self.meanings.get(condition, ("",))
        if kind == "not":
            self.learn(of[0], not holds)
        elif kind == ("and" if holds else "or"):
            self.learn(of[0], holds)
            self.learn(of[1], holds)
        elif kind == "is":
            tag, number = of
            if holds:
                self.numbers[tag] = number
            else:
                self.others[tag] = self.others.get(tag, frozenset()) | {number}

    def known(self, condition: ir.Operand) -> bool | None:
        """Return whether a condition is true; None if unknown."""
        if not isinstance(condition, ir.Var):
            return bool(condition)
        if condition in self.truths:
            return self.truths[condition]
        kind, *of = self.meanings.get(condition, ("",))
        if kind == "not":
            value = self.known(of[0])
            return None if value is None else not value
        if kind in ("and", "or"):
            both = self.known(of[0]), self.known(of[1])
            decisive = kind == "or"
            return decisive if decisive in both else None if None in both else not decisive
        if kind == "is":
            tag, number = of
            if tag in self.numbers:
                return bool(self.numbers[tag] == number)
            if number in self.others.get(tag, ()):
                return False
            left = self.left(tag)
            if left is not None and (number not in left or len(left) == 1):
                return number in left
        return None


def _at_most_zero(a: ir.Operand) -> bool:
    return not isinstance(a, ir.Var) and a <= 0


def _in_double(a: ir.Operand) -> ir.Operand:
    if ir.type_of(a) not in (ir.WORD, ir.WIDE):
        return a
    if isinstance(a, ir.Var) or abs(a) > LARGEST or float(a) != a:
        raise Refused("comparing an integer beyond 2^53")
    return float(a)


class Lowering:
    """Statements emitted so far, what is known of their variables, and the arithmetic that emits more."""

    def __init__(self, stack: Stack) -> None:
        self.stack = stack
        self.out: list[ir.Statement] = []
        self.facts = Facts()
        self.ranges: dict[ir.Var, tuple[int, int]] = {}  # least and largest value of integers
        self.choices: dict[ir.Var, tuple[ir.Operand, int, int]] = {}  # between constants: test, then, else
        self.positive: set[ir.Var] = set()  # finite, too
        self._count = 0

    def new(self, type: str) -> ir.Var:
        """Return a new variable."""
        self._count += 1
        if self._count > MOST_OPERATIONS:
            raise Refused(f"more than {MOST_OPERATIONS:,} operations in a function")
        return ir.Var(f"{type[0]}{self._count}", type)

    def let(self, type: str, op: str, *operands: ir.Operand) -> ir.Var:
        """Return a new variable with the value of an operation."""
        if op not in OF_WIDE and any(ir.type_of(x) == ir.WIDE for x in operands):
            raise Refused("an integer beyond 64 bits")
        target = self.new(type)
        self.out.append(ir.Let(target, op, operands))
        return target

    def fail(self, kind: str, *message: ir.Part) -> None:
        """Emit an exception on the current path."""
        self.out.append(ir.Raise(kind, message, self.stack.raised_at()))

    def end(self, kind: str, *message: ir.Part) -> NoReturn:
        """Emit an exception on the current path, and stop evaluating the path."""
        self.fail(kind, *message)
        raise Unreachable

    def computed(self, function: Callable[..., Any], *args: Any) -> Any:
        """Return the value of a function at build time, or emit the exception that it raises."""
        try:
            return function(*args)
        except (ArithmeticError, ValueError) as error:
            self.end(type(error).__name__, str(error))

    def _reject(self, test: str, *operands: ir.Operand, error: tuple[str, str]) -> None:
        """Emit an exception for the case that an operation is true."""
        self.require(self.negation(self.let(ir.BOOL, test, *operands)), *error)

    def require(self, condition: ir.Operand, kind: str, message: str) -> None:
        """Emit an exception for the case that a condition is false.

        Raises:
            Unreachable: the condition is known to be false.
        """
        known = self.facts.known(condition)
        if known:
            return
        if known is False:
            self.end(kind, message)
        failing = self.negation(condition)
        assert isinstance(failing, ir.Var)
        self.out.append(ir.If(failing, [ir.Raise(kind, (message,), self.stack.raised_at())]))
        self.facts.learn(condition, True)

    def settled(self, value: ir.Operand, facts: Facts) -> ir.Operand:
        """Return the value of a variable on the current path, if known."""
        if not isinstance(value, ir.Var):
            return value
        if value in self.choices:
            condition, a, b = self.choices[value]
            known = facts.known(condition)
            if known is not None:
                return value if value.type == ir.BOOL else a if known else b
        left = facts.left(value)
        return next(iter(left)) if left is not None and len(left) == 1 else value

    def range_of(self, value: ir.Operand) -> tuple[int, int] | None:
        """Return the least and the largest value of an integer; None if unknown."""
        if not isinstance(value, ir.Var):
            return int(value), int(value)
        if value.type == ir.BOOL:
            return 0, 1
        values = self.facts.left(value)
        return (min(values), max(values)) if values else self.ranges.get(value)

    def within(self, index: ir.Operand, count: int, text: str) -> ir.Operand:
        """Return an index, counted from the beginning; raises if it is out of range."""
        if not isinstance(index, ir.Var):
            index = index + count if index < 0 else index
            self.require(0 <= index < count, "IndexError", text)
            return index
        between = self.range_of(index)
        if between is not None and between[0] >= 0 and between[1] < count:
            return index
        return self.placed(index, count, text)

    def placed(self, index: ir.Var, count: ir.Operand, text: str) -> ir.Var:
        """Return an index known at run time, counted from the beginning; raises if it is out of range."""
        place = self.let(ir.INT, "place_in", index, count)
        if self.range_of(index) is None:
            fits = self.compare("!=", place, -2)
            self.require(fits, "IndexError", "cannot fit 'int' into an index-sized integer")
        self.require(self.compare(">=", place, 0), "IndexError", text)
        return place

    # ---- conditions -------------------------------------------------------------------------

    def truth(self, value: ir.Operand) -> ir.Operand:
        """Return a number as a condition."""
        if not isinstance(value, ir.Var):
            return bool(value)
        if value.type == ir.BOOL:
            return value
        if value in self.choices:
            condition, a, b = self.choices[value]
            if bool(a) == bool(b):
                return bool(a)
            return condition if a else self.negation(condition)
        return self.let(ir.BOOL, "ne", value, 0)

    def negation(self, condition: ir.Operand) -> ir.Operand:
        """Return "not" of a condition."""
        if not isinstance(condition, ir.Var):
            return not condition
        kind, *of = self.facts.meanings.get(condition, ("",))
        if kind == "not":
            return of[0]  # type: ignore[no-any-return]
        negated = self.let(ir.BOOL, "not", condition)
        self.facts.meanings[negated] = ("not", condition)
        return negated

    def compare(self, op: str, a: ir.Operand, b: ir.Operand) -> ir.Operand:
        """Return the result of a comparison of two numbers."""
        if not isinstance(a, ir.Var) and not isinstance(b, ir.Var):
            return bool(OPERATORS[op](a, b))
        if isinstance(a, ir.Var) and a in self.choices and not isinstance(b, ir.Var):
            condition, if_true, if_false = self.choices[a]
            first, second = bool(OPERATORS[op](if_true, b)), bool(OPERATORS[op](if_false, b))
            if first == second:
                return first
            return condition if first else self.negation(condition)
        a, b = self.settled(a, self.facts), self.settled(b, self.facts)
        if not isinstance(a, ir.Var) and not isinstance(b, ir.Var):
            return bool(OPERATORS[op](a, b))
        if (a in self.positive and _at_most_zero(b)) or (b in self.positive and _at_most_zero(a)):
            return bool(OPERATORS[op](*(1 if isinstance(x, ir.Var) else x for x in (a, b))))
        kinds = {ir.type_of(a), ir.type_of(b)}
        if kinds & {ir.WORD, ir.WIDE} and kinds != {ir.WORD}:
            a, b = _in_double(a), _in_double(b)
        comparison = self.let(ir.BOOL, name_of(op), a, b)
        if op == "==" and isinstance(a, ir.Var) and isinstance(b, int) and a.type == ir.INT:
            self.facts.meanings[comparison] = ("is", a, int(b))
        return comparison

    # ---- arithmetic -------------------------------------------------------------------------

    def binary(self, op: str, a: ir.Operand, b: ir.Operand) -> ir.Operand:
        """Return a op b."""
        if not isinstance(a, ir.Var) and not isinstance(b, ir.Var):
            result = self.computed(OPERATORS[op], a, b)
            if isinstance(result, complex):
                raise Refused("a complex number")
            return result  # type: ignore[no-any-return]
        types = {ir.type_of(a), ir.type_of(b)}
        real = ir.REAL in types
        if not real and types & {ir.WORD, ir.WIDE} and op != "/":
            return self._of_words(op, a, b)
        if op in ("+", "-", "*"):
            if real:
                return self.let(ir.REAL, name_of(op), a, b)
            return self.let(ir.INT, "mul_int" if op == "*" else name_of(op), a, b)
        if op in ("/", "//", "%"):
            if b == 0 or isinstance(b, ir.Var):
                unit = 1.0 if real else 1
                self.require(self.compare("!=", b, 0), *complaint(lambda: OPERATORS[op](unit, 0 * unit)))
            if op == "/":
                return self.let(ir.REAL, "div", a, b)
            name = "floordiv" if op == "//" else "mod"
            return self.let(ir.REAL, name, a, b) if real else self.let(ir.INT, f"{name}_int", a, b)
        if op == "**":
            return self._power(a, b, real)
        raise Refused(f"{op} of integers of less than 64 bits")

    def _of_words(self, op: str, a: ir.Operand, b: ir.Operand) -> ir.Var:
        wide = ir.WIDE in (ir.type_of(a), ir.type_of(b))
        if op in ("+", "*"):
            return self.let(ir.WIDE, f"{name_of(op)}_word", a, b)
        if op == "&" and MASK in (a, b):
            return self.let(ir.WORD, "word", b if a == MASK else a)
        if op in ("&", "|", "^") and not wide:
            return self.let(ir.WORD, f"{name_of(op)}_word", a, b)
        if op == ">>" and not isinstance(b, ir.Var) and 0 <= b < 64 and not wide:
            return self.let(ir.WORD, "rshift_word", a, b)
        raise Refused(f"{op} of integers of 64 bits")

    def _power(self, a: ir.Operand, b: ir.Operand, real: bool) -> ir.Var:
        if not real and not (isinstance(b, int) and 0 <= b <= 8):
            raise Refused("a power of integers whose exponent is not a small number")
        if isinstance(b, ir.Var) or b < 0:
            self._reject("zero_power", a, b, error=complaint(lambda: 0.0**-1.0))
        if isinstance(b, ir.Var) or (math.isfinite(b) and b != int(b)):
            self._reject("complex_power", a, b, error=("TypeError", ir.COMPLEX))
        if not real:
            return self.let(ir.INT, "pow", a, b)
        power = self.let(ir.REAL, "pow", a, b)
        self._reject("overflown", power, a, b, error=complaint(lambda: 1e200**2.0))
        return power

    def negative(self, a: ir.Operand) -> ir.Operand:
        """Return -a."""
        if not isinstance(a, ir.Var):
            return -a
        if a.type in (ir.WORD, ir.WIDE):
            raise Refused("the negative of an integer of 64 bits")
        return self.let(ir.REAL, "neg", a) if a.type == ir.REAL else self.let(ir.INT, "sub", 0, a)

    def size(self, a: ir.Operand) -> ir.Operand:
        """Return abs(a)."""
        if not isinstance(a, ir.Var):
            return abs(a)
        if a.type in (ir.WORD, ir.WIDE):
            return a
        return self.let(ir.REAL if a.type == ir.REAL else ir.INT, "fabs", a)

    def as_real(self, a: ir.Operand) -> ir.Operand:
        """Return float(a)."""
        if not isinstance(a, ir.Var):
            return float(a)
        return a if a.type == ir.REAL else self.let(ir.REAL, "real", a)

    def whole(self, op: str, a: ir.Operand) -> ir.Operand:
        """Return int(a) or round(a) for `op` "trunc" or "rint", or floor or ceil of a."""
        rounding: dict[str, Callable[[Any], int]]
        rounding = {"trunc": int, "rint": round, "floor": math.floor, "ceil": math.ceil}
        by = rounding[op]
        if not isinstance(a, ir.Var):
            return self.computed(by, a)  # type: ignore[no-any-return]
        if a.type != ir.REAL:
            return a if a.type == ir.INT else self.let(ir.INT, "real", a)
        self._reject("isnan", a, error=complaint(lambda: by(math.nan)))
        self._reject("isinf", a, error=complaint(lambda: by(math.inf)))
        return self.let(ir.INT, op, a)

    def function(self, name: str, *operands: ir.Operand) -> ir.Operand:
        """Return the value of a function of `math`."""
        if not any(isinstance(x, ir.Var) for x in operands):
            return self.computed(getattr(math, name), *operands)  # type: ignore[no-any-return]
        if name in ("floor", "ceil", "trunc"):
            return self.whole(name, operands[0])
        if name in ("isfinite", "isnan", "isinf"):
            return self.let(ir.BOOL, name, *operands)
        if name in ("degrees", "radians"):
            by = 180.0 / math.pi if name == "degrees" else math.pi / 180.0
            return self.let(ir.REAL, "mul", operands[0], by)
        if name in ("hypot", "dist"):
            return self.let(ir.REAL, "norm", *operands)
        if name == "pow":
            for kind in ("pole" if POLE_IS_ERROR else "zero", "complex"):
                self._reject(f"{kind}_power", *operands, error=complaint(lambda: math.sqrt(-1.0)))
            power = self.let(ir.REAL, "pow", *operands)
            self._reject("overflown", power, *operands, error=complaint(lambda: math.exp(1e3)))
            return power
        if name not in FUNCTIONS:
            raise Refused(f"math.{name}")
        result = self.let(ir.REAL, name, *operands)
        if name in CAN_OVERFLOW:
            self._reject("overflown", result, operands[0], error=complaint(lambda: math.exp(1e3)))
        elif name in DOMAIN:
            self._reject("undefined", result, *operands, error=complaint(lambda: math.sqrt(-1.0)))
        return result


COMPENSATED = sum([1.0, 1e100, 1.0, -1e100]) == 2.0
"""Whether `sum` is compensated, as since CPython 3.12."""
POLE_IS_ERROR = sys.version_info < (3, 11)
"""Whether `math.pow(0.0, -inf)` is an error, as before CPython 3.11, where it became infinite."""
WHOLE_ARE_PLAIN = sum([1e100, 1, -1e100]) == 0.0
"""Whether `sum` does not compensate whole numbers after a real one, as in CPython 3.12 and 3.13."""
TIES = sorted([math.nan, 2.0, 1.0])[0] == 1.0
"""Whether sorted() takes equal items into descending runs, as since CPython 3.13."""
