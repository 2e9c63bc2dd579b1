"""Partial evaluation: what is known at build time is computed, all else lowered to statements."""

from __future__ import annotations

import ast
from collections.abc import Callable, Container, Mapping, Sequence
from typing import Any

from . import ir
from .attributes import Attributes
from .items import Containers
from .lower import Lowering
from .memory import Memory
from .operators import Operators
from .outline import Library, Outlining
from .paths import Paths
from .read import Sources, Tree
from .shapes import Promote
from .stack import EXIT, ON, RESULT, RETURN, Call, Stack
from .values import ANY, Refused, Unreachable

DEEPEST = 60
"""Largest depth of nested calls; chosen: more than components need, to detect infinite recursion."""


class Evaluator:
    """Evaluator of a function and of all that it calls; its parts hold each other.

    Args:
        understood: kinds of nodes of the syntax tree that are understood, with what evaluates them.
        calling: evaluates a call of a function with arguments and named arguments.
        library: functions that were outlined before.

    Attributes:
        sources: functions that are translated.
        fixed: variables that are the same in every call, such as parameters.
        stack: calls that are being evaluated.
        lower: statements of the function, and arithmetic.
        memory, paths, attributes, items, operators, outlining: see their classes.
    """

    def __init__(
        self,
        understood: Mapping[type[ast.AST], Callable[..., Any]],
        calling: Callable[..., Any],
        sources: Sources,
        fixed: Container[ir.Var],
        library: Library,
    ) -> None:
        self._table, self._calling, self.sources, self.fixed = understood, calling, sources, fixed
        self.stack = Stack()
        self.lower = Lowering(self.stack)
        self.memory = Memory(self.lower)
        self.paths = Paths(self.memory)
        self.attributes = Attributes(self.paths, self.call)
        self.items = Containers(self.attributes)
        self.operators = Operators(self.items)
        self.outlining = Outlining(self.paths, fixed, library, self.inside)

    def evaluate(self, node: ast.expr) -> Any:
        """Return the value of an expression.

        Raises:
            Refused: with file and line.
        """
        return self.paths.narrowed(self._understood(node))

    def _understood(self, node: ast.AST) -> Any:
        """Return what the function in the table of the syntax makes of a node.

        Raises:
            Refused: there is none, or it refuses; with file and line.
        """
        kind = type(node).__name__
        self.stack.at(node)
        if type(node) not in self._table:
            raise Refused(f"{kind} is not translated: {_first_line(node)}", self.stack.where())
        try:
            return self._table[type(node)](self, node)
        except Refused as refused:
            if not refused.where:
                self.stack.at(node)
                refused.where = self.stack.where()
            raise
        except (TypeError, AttributeError, LookupError, ValueError) as error:
            self.stack.at(node)
            raise Refused(f"{kind} is not translated: {_first_line(node)}", self.stack.where()) from error

    def values(self, nodes: Sequence[ast.expr]) -> list[Any]:
        """Return the values of expressions, some of which may be starred."""
        results: list[Any] = []
        for node in nodes:
            if isinstance(node, ast.Starred):
                results += self.items.of(self.evaluate(node.value))
            else:
                results.append(self.evaluate(node))
        return results

    def leave(self, how: Any) -> None:
        """Set the end of the block."""
        self.paths.write(self.stack.frame, EXIT, how)

    def block(self, statements: Sequence[ast.stmt]) -> None:
        """Evaluate statements until the block is left."""
        for i, statement in enumerate(statements):
            self.statement(statement)
            how = self.stack.exit
            if isinstance(how, ir.Var):
                rest = statements[i + 1 :]
                if rest:
                    on = self.lower.compare("==", how, ON)
                    self.paths.branch(on, lambda: self.block(rest), lambda: None)  # noqa: B023
                return
            if how != ON:
                return

    def statement(self, node: ast.stmt) -> None:
        """Evaluate a statement.

        Raises:
            Refused: with file and line.
        """
        try:
            self._understood(node)
        except (Promote, Refused, Unreachable):
            raise
        except Exception as error:  # unexpected: the component runs in Python
            self.stack.at(node)
            raise Refused(f"not translated: {type(error).__name__}: {error}", self.stack.where()) from error

    def call(self, function: Any, args: Sequence[Any], named: dict[str, Any]) -> Any:
        """Return the value of a call."""
        return self._calling(self, function, list(args), named)

    def inside(self, call: Call, node: Tree) -> Any:
        """Return the value of a function, evaluated in place."""
        if len(self.stack.calls) > DEEPEST:
            raise Refused("recursion whose depth is only known at run time")
        self.stack.calls.append(call)
        try:
            if isinstance(node, ast.Lambda):
                return self.evaluate(node.body)
            call.frame.slots |= {EXIT: ON, RESULT: ANY}
            self.block(node.body)
            how, result = self.stack.exit, self.paths.narrowed(call.frame.slots[RESULT])
            if isinstance(how, ir.Var):
                return self.paths.branch(self.lower.compare("==", how, RETURN), lambda: result, lambda: None)
            return result if how == RETURN else None
        finally:
            self.stack.calls.pop()


def _first_line(node: ast.AST) -> str:
    return ast.unparse(node).strip().splitlines()[0]
