"""Arithmetic of named numbers: parsed from text, or made of other expressions by operators."""

from __future__ import annotations

import ast
import math
import operator
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Annotated

from pydantic import PlainSerializer, PlainValidator, WithJsonSchema

from yawbench.foundation.messages import short

LONGEST = 400
"""Characters of an expression. Chosen: eight times our longest; bounds the depth of recursion."""

_OPERATIONS: dict[type[ast.operator], Callable[[float, float], float]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
}


@dataclass(frozen=True)
class Expression:
    """An arithmetic expression of named numbers.

    >>> gain = Expression.parse("(frozen - learning) / frozen")
    >>> gain.value({"frozen": 4.0, "learning": 3.0})
    0.25
    >>> str(0.5 * Expression.named("a") + 2.0 * Expression.named("b"))
    '0.5 * a + 2.0 * b'
    """

    tree: ast.expr
    text: str = ""  # as parsed

    @classmethod
    def parse(cls, text: str) -> Expression:
        """Parse an expression: numbers, names, + - * / and parentheses.

        Raises:
            ValueError: the text is not an expression, or contains more than arithmetic.
        """
        if len(text) > LONGEST:
            raise ValueError(f"{short(text)}: an expression has at most {LONGEST} characters")
        try:
            tree = ast.parse(text.strip(), mode="eval").body
        except (SyntaxError, ValueError, RecursionError, MemoryError):  # syntax, null bytes, nested brackets
            raise ValueError(f"{short(text)} is not an expression such as (a - b) / a") from None
        for node in _nodes(tree):
            plain = isinstance(node, ast.Constant) and type(node.value) in (int, float)
            if not (plain or isinstance(node, (ast.Name, ast.BinOp, ast.UnaryOp))):
                raise ValueError(f"{text!r}: only numbers, names, + - * / and parentheses are allowed")
            if isinstance(node, (ast.BinOp, ast.UnaryOp)) and type(node.op) not in (*_OPERATIONS, ast.USub):
                raise ValueError(f"{text!r}: only + - * / are allowed")
        return cls(tree, text)

    @classmethod
    def named(cls, name: str) -> Expression:
        """Return the expression of a name alone."""
        return cls(ast.Name(name))

    def __add__(self, other: Expression) -> Expression:
        return Expression(ast.BinOp(self.tree, ast.Add(), other.tree))

    def __rmul__(self, factor: float) -> Expression:
        return Expression(ast.BinOp(ast.Constant(factor), ast.Mult(), self.tree))

    def __truediv__(self, divisor: float) -> Expression:
        return Expression(ast.BinOp(self.tree, ast.Div(), ast.Constant(divisor)))

    def __str__(self) -> str:
        return self.text or ast.unparse(self.tree)

    @property
    def names(self) -> list[str]:
        """The names in it, each once."""
        return list(dict.fromkeys(node.id for node in _nodes(self.tree) if isinstance(node, ast.Name)))

    def value(self, numbers: Mapping[str, float]) -> float | None:
        """Return its value; None if it divides by zero or is not finite.

        Args:
            numbers: name -> number, of every name in it.
        """

        def value_of(node: ast.expr) -> float:
            if isinstance(node, ast.BinOp):
                return _OPERATIONS[type(node.op)](value_of(node.left), value_of(node.right))
            if isinstance(node, ast.UnaryOp):
                return -value_of(node.operand)
            if isinstance(node, ast.Name):
                return numbers[node.id]
            assert isinstance(node, ast.Constant)
            return float(node.value)  # type: ignore[arg-type]

        try:
            number = value_of(self.tree)
        except (ZeroDivisionError, OverflowError):
            return None
        return number if math.isfinite(number) else None


def _nodes(tree: ast.expr) -> Iterator[ast.expr]:
    return (node for node in ast.walk(tree) if isinstance(node, ast.expr))


def _expression(value: object) -> Expression:
    if isinstance(value, Expression):
        return value
    if not isinstance(value, str):
        raise ValueError(f"must be an expression such as (a - b) / a (got {short(value)})")
    return Expression.parse(value)


ExpressionField = Annotated[
    Expression, PlainValidator(_expression), PlainSerializer(str), WithJsonSchema({"type": "string"})
]
"""An expression in a schema."""
