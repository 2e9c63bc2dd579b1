"""Numbers that a study derives from several runs: expressions of their metrics, rank correlations.

An expression knows numbers, the names that its `of` gives, + - * / and parentheses. Where a run is
missing, or a divisor is zero, there is no number; never a wrong one.
"""

from __future__ import annotations

import ast
import math
import operator
from collections.abc import Callable, Iterator, Mapping, Sequence

import numpy as np

from ..wording import short

LONGEST = 400
"""Characters of an expression. Chosen: eight times the longest of ours; deeper ones could not be computed."""

_OPERATIONS: dict[type[ast.operator], Callable[[float, float], float]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
}


def parse(text: str) -> ast.expr:
    """Return the expression that a text holds.

    Raises:
        ValueError: it is none, or holds more than arithmetic.
    """
    if len(text) > LONGEST:
        raise ValueError(f"{short(text)}: an expression has at most {LONGEST} characters")
    try:
        tree = ast.parse(text.strip(), mode="eval").body
    except (SyntaxError, ValueError, RecursionError, MemoryError):  # by what is in it, by brackets
        raise ValueError(f"{short(text)} is no expression, for example (a - b) / a") from None
    for node in _nodes(tree):
        plain = isinstance(node, ast.Constant) and type(node.value) in (int, float)
        if not (plain or isinstance(node, (ast.Name, ast.BinOp, ast.UnaryOp))):
            raise ValueError(f"{text!r}: only numbers, names, + - * / and parentheses are allowed")
        if isinstance(node, ast.BinOp) and type(node.op) not in _OPERATIONS:
            raise ValueError(f"{text!r}: only + - * / are allowed")
        if isinstance(node, ast.UnaryOp) and not isinstance(node.op, ast.USub):
            raise ValueError(f"{text!r}: only + - * / are allowed")
    return tree


def _nodes(tree: ast.expr) -> Iterator[ast.expr]:
    return (node for node in ast.walk(tree) if isinstance(node, ast.expr))


def names_in(text: str) -> list[str]:
    """Return the names in an expression, each once."""
    return list(dict.fromkeys(node.id for node in _nodes(parse(text)) if isinstance(node, ast.Name)))


def calculate(text: str, values: Mapping[str, float]) -> float | None:
    """Return the value of an expression; None if it divides by zero or is not finite.

    Args:
        text: the expression.
        values: of every name in it.
    """

    def value_of(node: ast.expr) -> float:
        if isinstance(node, ast.BinOp):
            return _OPERATIONS[type(node.op)](value_of(node.left), value_of(node.right))
        if isinstance(node, ast.UnaryOp):
            return -value_of(node.operand)
        if isinstance(node, ast.Name):
            return values[node.id]
        assert isinstance(node, ast.Constant)
        return float(node.value)  # type: ignore[arg-type]

    try:
        number = value_of(parse(text))
    except (ZeroDivisionError, OverflowError):
        return None
    return number if math.isfinite(number) else None


def ranks(x: Sequence[float]) -> np.ndarray:
    """Return the rank of every value, counted from 1; equal values share the mean of their ranks."""
    array = np.asarray(x, dtype=float)
    below = (array[:, None] > array[None, :]).sum(axis=1)
    equal = (array[:, None] == array[None, :]).sum(axis=1)
    return below + (equal + 1) / 2


def rank_correlation(x: Sequence[float], y: Sequence[float]) -> float | None:
    """Return Spearman's rank correlation of two sequences of equal length; None if one is constant."""
    a, b = (ranks(values) - (len(values) + 1) / 2 for values in (x, y))
    scale = math.sqrt(float(a @ a) * float(b @ b)) if len(x) > 1 else 0.0
    return float(a @ b) / scale if scale > 0 else None
