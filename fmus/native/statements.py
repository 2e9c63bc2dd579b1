"""Evaluation of statements: side effects, control flow, assignments.

The control flow of a function is a value of its frame, `EXIT`, which is merged like any other where two
paths join, so returns, breaks and continues on a single path need no special treatment.
"""

from __future__ import annotations

import ast
from collections.abc import Callable
from typing import Any

from .evaluate import Evaluator
from .operators import BINARY
from .stack import BREAK, CONTINUE, RESULT, RETURN
from .values import Array, Closure, Dict, Failure, List, Refused, Ring, Text, Union


def _assign(e: Evaluator, node: ast.Assign) -> None:
    value = e.evaluate(node.value)
    for target in node.targets:
        e.stack.at(node)
        assign(e, target, value)


def _annotated(e: Evaluator, node: ast.AnnAssign) -> None:
    if node.value is not None:
        assign(e, node.target, e.evaluate(node.value))


def _augmented(e: Evaluator, node: ast.AugAssign) -> None:
    op, target = BINARY[type(node.op)], node.target
    if isinstance(target, ast.Name):
        before = e.evaluate(ast.copy_location(ast.Name(target.id, ast.Load()), target))
        value = e.evaluate(node.value)
        e.stack.at(node)
        assign(e, target, _in_place(e, op, before, value))
    elif isinstance(target, ast.Attribute):
        owner = e.evaluate(target.value)
        before = e.paths.by_form(owner, lambda x: e.attributes.of(x, target.attr))
        value = e.evaluate(node.value)
        e.stack.at(node)
        e.attributes.set(owner, target.attr, _in_place(e, op, before, value))
    else:
        owner, index = e.evaluate(target.value), e.evaluate(target.slice)
        before = e.paths.by_form(owner, lambda x: e.items.at(x, index))
        value = e.evaluate(node.value)
        e.stack.at(node)
        e.items.set(owner, index, _in_place(e, op, before, value))


def _in_place(e: Evaluator, op: str, before: Any, value: Any) -> Any:
    if isinstance(before, (Dict, Ring, Array)) or type(before) in (list, dict, set):
        raise Refused(f"{op}= of a {type(before).__name__.lower()}")
    if not isinstance(before, List):
        return e.operators.operate(op, before, value, in_place=True)
    if before.path is not None or not (op == "+" or (op == "*" and isinstance(value, int))):
        raise Refused(f"{op}= of a list")
    held = e.paths.open(before)  # other references to the list see the change, too
    held[:] = [*held, *e.items.of(value)] if op == "+" else held * value
    return before


def _return(e: Evaluator, node: ast.Return) -> None:
    value = None if node.value is None else e.evaluate(node.value)
    e.paths.write(e.stack.frame, RESULT, value)
    e.leave(RETURN)


def _define(e: Evaluator, node: ast.FunctionDef) -> None:
    named = {
        a.arg: e.evaluate(d)
        for a, d in zip(node.args.kwonlyargs, node.args.kw_defaults, strict=True)
        if d is not None
    }
    defaults = tuple(e.values(node.args.defaults))
    decorators = [e.evaluate(x) for x in node.decorator_list]
    made: Any = Closure(node, e.stack.frame, e.stack.call.source, defaults, named)
    for decorator in reversed(decorators):
        made = e.call(decorator, [made], {})
    e.paths.write(e.stack.frame, node.name, made)


def _raise(e: Evaluator, node: ast.Raise) -> None:
    if node.exc is None:
        raise Refused("raise without an exception")
    error = e.evaluate(node.exc)
    if isinstance(error, type) and issubclass(error, BaseException):
        error = Failure(error, Text(()))
    if not isinstance(error, Failure):
        raise Refused("raising an exception that is not created in place")
    e.stack.at(node)
    e.lower.end(error.kind.__name__, *error.message.parts)


def _delete(e: Evaluator, node: ast.Delete) -> None:
    for target in node.targets:
        if not isinstance(target, ast.Subscript):
            raise Refused("del of a name or attribute")
        owner, index = e.evaluate(target.value), e.evaluate(target.slice)
        e.stack.at(node)
        e.items.remove(owner, index, "list assignment index out of range")


def assign(e: Evaluator, target: ast.expr, value: Any) -> None:
    """Assign a value to a target."""
    if isinstance(target, ast.Name):
        e.paths.write(e.stack.frame, target.id, value)
    elif isinstance(target, (ast.Tuple, ast.List)):
        _unpack(e, target, e.paths.by_form(value, lambda x: tuple(e.items.of(x))))
    elif isinstance(target, ast.Attribute):
        e.attributes.set(e.evaluate(target.value), target.attr, value)
    elif isinstance(target, ast.Subscript):
        e.items.set(e.evaluate(target.value), e.evaluate(target.slice), value)
    else:
        raise Refused(f"assigning to {type(target).__name__}")


def _unpack(e: Evaluator, target: ast.Tuple | ast.List, value: Any) -> None:
    if isinstance(value, Union):
        raise Refused("unpacking a value with several forms")
    values = list(value)
    starred = [i for i, t in enumerate(target.elts) if isinstance(t, ast.Starred)]
    if starred:
        i, more = starred[0], len(values) - len(target.elts) + 1
        if more >= 0:
            values[i : i + more] = [List(values[i : i + more])]
    if len(values) != len(target.elts):
        few = len(values) < len(target.elts)
        expected = f"expected {len(target.elts)}"
        text = f"not enough values to unpack ({expected}, got {len(values)})"
        e.lower.end("ValueError", text if few else f"too many values to unpack ({expected})")
    for inner, x in zip(target.elts, values, strict=True):
        assign(e, inner.value if isinstance(inner, ast.Starred) else inner, x)


def _if(e: Evaluator, node: ast.If) -> None:
    test = e.operators.truth_of(e.evaluate(node.test))
    e.paths.branch(test, lambda: e.block(node.body), lambda: e.block(node.orelse))


STATEMENTS: dict[type[ast.AST], Callable[[Evaluator, Any], Any]] = {
    ast.AnnAssign: _annotated,
    ast.Assign: _assign,
    ast.AugAssign: _augmented,
    ast.Break: lambda e, node: e.leave(BREAK),
    ast.Continue: lambda e, node: e.leave(CONTINUE),
    ast.Delete: _delete,
    ast.Expr: lambda e, node: isinstance(node.value, ast.Constant) or e.evaluate(node.value),
    ast.FunctionDef: _define,
    ast.If: _if,
    ast.Pass: lambda e, node: None,
    ast.Raise: _raise,
    ast.Return: _return,
}
"""Statements that are understood, with what carries them out."""
