"""Evaluation of expressions: names, constants, structures, operators, comprehensions."""

from __future__ import annotations

import ast
import builtins
import re
import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

from . import ir
from . import values as v
from .evaluate import Evaluator
from .operators import BINARY
from .read import kinds_within
from .stack import Call
from .statements import assign
from .values import EITHER, UNSET, Refused, is_plain, joined_text, read


def _name(e: Evaluator, node: ast.Name) -> Any:
    call = e.stack.call
    frame: v.Frame | None = call.frame
    outside = free = False
    while frame is not None:
        value = read(frame).get(node.id, UNSET)
        if value is not UNSET:
            if outside and node.id in call.own:
                raise Refused(f"{node.id} is read before the inner function sets it")
            return present(e, value, *_unset(node.id, free))
        outside = outside or frame is call.base
        free = free or not frame.inlined
        frame = frame.parent
    for names in (call.source.cells, call.source.names, vars(builtins)):
        if node.id in names:
            return names[node.id]
    raise Refused(f"{node.id} has no value here")


def present(e: Evaluator, value: Any, kind: str, text: str) -> Any:
    """Return a value that is set, or raise an exception where it is not."""
    if not isinstance(value, v.Union) or not any(x is UNSET for x in value.alternatives):
        return value

    def use(x: Any) -> Any:
        if x is UNSET:
            e.lower.end(kind, text)
        return x

    return e.paths.by_form(value, use)


def _joinedstr(e: Evaluator, node: ast.JoinedStr) -> Any:
    parts: list[ir.Part] = []
    for piece in node.values:
        if isinstance(piece, ast.Constant):
            parts.append(str(piece.value))
            continue
        assert isinstance(piece, ast.FormattedValue)
        spec = e.evaluate(piece.format_spec) if piece.format_spec else ""
        if piece.conversion == ord("a"):
            raise Refused("the conversion !a")
        parts += formatted(e.evaluate(piece.value), spec, piece.conversion == ord("r"))
    return joined_text(parts)


def formatted(value: Any, spec: str, as_repr: bool) -> list[ir.Part]:
    if isinstance(value, v.Text):
        return list(value.parts)
    if isinstance(value, ir.Var):
        if value.type == ir.EITHER and not spec:
            raise Refused(EITHER)
        if spec != "" and not re.fullmatch(r"(\.\d)?g", spec):
            raise Refused(f"the format {spec!r}")
        return [(value, spec or "r")]
    if (type(value) is tuple or isinstance(value, v.List)) and not is_plain(value):
        items = read(value) if isinstance(value, v.List) else value
        opening, closing = "[]" if isinstance(value, v.List) else "()"
        parts: list[ir.Part] = [opening]
        for i, item in enumerate(items):
            parts += [", "] * bool(i) + formatted(item, "", True)
        return [*parts, ",)" if closing == ")" and len(items) == 1 else closing]
    if not is_plain(value):
        raise Refused("a text of something unknown")
    return [format(repr(value) if as_repr else value, spec)]


def _dict(e: Evaluator, node: ast.Dict) -> Any:
    made: dict[Any, Any] = {}
    for key, value in zip(node.keys, node.values, strict=True):
        if key is None:
            inner = e.evaluate(value)
            made |= read(inner) if isinstance(inner, v.Dict) else inner
        else:
            made[e.items.key(e.evaluate(key))] = e.evaluate(value)
    return v.Dict(made)


def _attribute(e: Evaluator, node: ast.Attribute) -> Any:
    inner = node.value
    if isinstance(inner, ast.Call) and isinstance(inner.func, ast.Name) and inner.func.id == "super":
        return e.attributes.of_base(*_super(e, inner), node.attr)
    owner = e.evaluate(inner)
    e.stack.at(node)
    return e.paths.by_form(owner, lambda x: e.attributes.of(x, node.attr))


def _super(e: Evaluator, node: ast.Call) -> tuple[Any, type]:
    """Return the object and the class of super(...)."""
    call = e.stack.call
    if node.args:
        cls, me = e.values(node.args)
    else:
        cls, names = call.source.cells.get("__class__"), call.source.node.args.args
        if cls is None or not names or call.frame.parent is not None:
            raise Refused("super() outside a method, or within another function of it")
        me = read(call.frame)[names[0].arg]
    if not isinstance(cls, type):
        raise Refused("super() of something other than a class")
    return e.paths.narrowed(me), cls


def _subscript(e: Evaluator, node: ast.Subscript) -> Any:
    owner, index = e.evaluate(node.value), e.evaluate(node.slice)
    e.stack.at(node)
    return e.paths.by_form(owner, lambda x: e.paths.by_form(index, lambda i: e.items.at(x, i)))


def _slice(e: Evaluator, node: ast.Slice) -> Any:
    ends = [None if x is None else e.evaluate(x) for x in (node.lower, node.upper, node.step)]
    if any(isinstance(x, ir.Var) for x in ends):
        raise Refused("a slice whose ends are only known at run time")
    return slice(*ends)


def _comprehended(
    e: Evaluator, generators: list[ast.comprehension], make: Callable[[], Any], element: ast.expr
) -> list[Any]:
    call, kinds = e.stack.call, kinds_within(element)
    together = bool(kinds[ast.Lambda] or kinds[ast.GeneratorExp])
    frames = _frames(e, generators, together, inlined=sys.version_info >= (3, 12))
    return [_in_scope(e, call, frame, make) for frame in frames]


def _frames(
    e: Evaluator, generators: list[ast.comprehension], together: bool, inlined: bool = False
) -> Iterator[v.Frame]:
    """Yield the names of each element of a comprehension.

    Args:
        generators: its loops.
        together: whether the elements share their names, so that a function made by one of them sees
            those of the last; otherwise elements can be evaluated later.
        inlined: see `Frame`.
    """
    call = e.stack.call
    shared = v.Frame({}, call.frame, inlined)

    def go(k: int, frame: v.Frame) -> Iterator[v.Frame]:
        if k == len(generators):
            yield frame
            return
        each = e.items.each(_in_scope(e, call, frame, lambda: e.evaluate(generators[k].iter)))
        for i in range(each.count):
            inner = shared if together else v.Frame({}, frame, inlined)
            if _in_scope(e, call, inner, lambda: _passes(e, generators[k], each.item(i))):  # noqa: B023
                yield from go(k + 1, inner)

    return go(0, call.frame)


def _in_scope(e: Evaluator, call: Call, frame: v.Frame, evaluated: Callable[[], Any]) -> Any:
    """Evaluate a part of a comprehension in the scope where it was written, even if evaluated later."""
    e.stack.calls.append(replace(call, frame=frame))
    try:
        return evaluated()
    finally:
        e.stack.calls.pop()


def _passes(e: Evaluator, generator: ast.comprehension, item: Any) -> bool:
    assign(e, generator.target, item)
    for condition in generator.ifs:
        holds = e.lower.facts.known(e.operators.truth_of(e.evaluate(condition)))
        if holds is None:
            raise Refused("a filter that is only known at run time")
        if not holds:
            return False
    return True


def _generatorexp(e: Evaluator, node: ast.GeneratorExp) -> Any:
    call, generator = e.stack.call, node.generators[0]
    if kinds_within(node.elt)[ast.Lambda] or isinstance(node.elt, ast.GeneratorExp):
        raise Refused("functions or generators made by a generator expression")
    if len(node.generators) > 1 or generator.ifs:
        frames = list(_frames(e, node.generators, together=False))
        return v.Each(len(frames), lambda k: _in_scope(e, call, frames[k], lambda: e.evaluate(node.elt)))
    each = e.items.each(e.evaluate(generator.iter))

    def element(k: int) -> Any:
        assign(e, generator.target, each.item(k))
        return e.evaluate(node.elt)

    return v.Each(each.count, lambda k: _in_scope(e, call, v.Frame({}, call.frame), lambda: element(k)))


def _setcomp(e: Evaluator, node: ast.SetComp) -> Any:
    return frozenset(_comprehended(e, node.generators, lambda: e.items.key(e.evaluate(node.elt)), node.elt))


def _dictcomp(e: Evaluator, node: ast.DictComp) -> Any:
    def make() -> tuple[Any, Any]:
        return e.items.key(e.evaluate(node.key)), e.evaluate(node.value)

    return v.Dict(dict(_comprehended(e, node.generators, make, node.value)))


def _binop(e: Evaluator, node: ast.BinOp) -> Any:
    a, b = e.evaluate(node.left), e.evaluate(node.right)
    e.stack.at(node)
    return e.operators.operate(BINARY[type(node.op)], a, b)


def _unaryop(e: Evaluator, node: ast.UnaryOp) -> Any:
    value = e.evaluate(node.operand)
    e.stack.at(node)
    if isinstance(node.op, ast.Not):
        return e.lower.negation(e.operators.truth_of(value))
    name, usual = {
        ast.USub: ("__neg__", e.lower.negative),
        ast.UAdd: ("__pos__", e.operators.positive),
    }.get(type(node.op), ("__invert__", None))
    return e.paths.by_form(value, lambda x: e.operators.unary(name, usual, x))


def _boolop(e: Evaluator, node: ast.BoolOp) -> Any:
    conjunction = isinstance(node.op, ast.And)

    def go(k: int) -> Any:
        value = e.evaluate(node.values[k])
        if k == len(node.values) - 1:
            return value
        test = e.operators.truth_of(value)

        def stay() -> Any:
            return e.paths.narrowed(value)

        return e.paths.branch(
            test, *((lambda: go(k + 1), stay) if conjunction else (stay, lambda: go(k + 1)))
        )

    return go(0)


def _ifexp(e: Evaluator, node: ast.IfExp) -> Any:
    test = e.operators.truth_of(e.evaluate(node.test))
    return e.paths.branch(test, lambda: e.evaluate(node.body), lambda: e.evaluate(node.orelse))


def _namedexpr(e: Evaluator, node: ast.NamedExpr) -> Any:
    value = e.evaluate(node.value)
    assign(e, node.target, value)
    return value


def _lambda(e: Evaluator, node: ast.Lambda) -> Any:
    call = e.stack.call
    return v.Closure(node, call.frame, call.source, tuple(e.values(node.args.defaults)))


def _compare(e: Evaluator, node: ast.Compare) -> Any:
    def go(left: Any, k: int) -> Any:
        right = e.evaluate(node.comparators[k])
        e.stack.at(node)
        holds: Any = e.operators.compared(node.ops[k], left, right)
        if k == len(node.ops) - 1:
            return holds
        return e.paths.branch(e.operators.truth_of(holds), lambda: go(right, k + 1), lambda: False)

    return go(e.evaluate(node.left), 0)


def _call(e: Evaluator, node: ast.Call) -> Any:
    if isinstance(node.func, ast.Name) and node.func.id == "super":
        raise Refused("super() outside a call of a method")
    function = e.evaluate(node.func)
    args = e.values(node.args)
    named: dict[str, Any] = {}
    for keyword in node.keywords:
        value = e.evaluate(keyword.value)
        more = {keyword.arg: value} if keyword.arg is not None else _named(value)
        if named.keys() & more.keys():
            raise Refused(f"two values for the argument {next(iter(named.keys() & more.keys()))}")
        named |= more
    e.stack.at(node)
    return e.paths.by_form(function, lambda f: e.call(f, args, named))


def _named(value: Any) -> dict[str, Any]:
    held = read(value) if isinstance(value, v.Dict) else value
    if type(held) is not dict:
        raise Refused(f"** of a {type(held).__name__}")
    return held


def _unset(name: str, free: bool) -> tuple[str, str]:
    """Return Python's exception for a name without value, of a function itself or of the one around it."""
    kind = "free" if free else "local"
    text = f"cannot access {kind} variable '{name}' where it is not associated with a value"
    return ("NameError", f"{text} in enclosing scope") if free else ("UnboundLocalError", text)


EXPRESSIONS: dict[type[ast.AST], Callable[[Evaluator, Any], Any]] = {
    ast.Attribute: _attribute,
    ast.BinOp: _binop,
    ast.BoolOp: _boolop,
    ast.Call: _call,
    ast.Compare: _compare,
    ast.Constant: lambda e, node: node.value,
    ast.Dict: _dict,
    ast.DictComp: _dictcomp,
    ast.GeneratorExp: _generatorexp,
    ast.IfExp: _ifexp,
    ast.JoinedStr: _joinedstr,
    ast.Lambda: _lambda,
    ast.List: lambda e, node: v.List(e.values(node.elts)),
    ast.ListComp: lambda e, node: v.List(
        _comprehended(e, node.generators, lambda: e.evaluate(node.elt), node.elt)
    ),
    ast.Name: _name,
    ast.NamedExpr: _namedexpr,
    ast.SetComp: _setcomp,
    ast.Slice: _slice,
    ast.Subscript: _subscript,
    ast.Tuple: lambda e, node: tuple(e.values(node.elts)),
    ast.UnaryOp: _unaryop,
}
"""Expressions that are understood, with what evaluates them."""
