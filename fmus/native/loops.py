"""Evaluation of loops: unrolled if the items are known, else repeated until shapes of values converge."""

from __future__ import annotations

import ast
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from . import ir
from . import values as v
from .evaluate import Evaluator
from .read import kinds_within, names_within
from .shapes import Memo, Shape, Widening, build, numbers_of, shape_of, types_of
from .stack import CONTINUE, EXIT, ON, OVER, RESULT, RETURN
from .statements import assign
from .values import OF_LOOP, RESIZED, UNSET, Refused, boxes_in, items_of, now, read, same

UNROLLED = 16
"""Number of passes up to which a loop over a range is unrolled; chosen: four wheels, seven sets."""
WIDEST = 12
"""Largest number of evaluations of a loop until the shapes of its values converge."""


@dataclass
class Pass:
    """Pass through a loop: its statements, its end, its changes."""

    out: list[ir.Statement]
    exit: Any
    starts: dict[tuple[v.Box, Any], Any]
    ends: dict[tuple[v.Box, Any], Any]
    contents: dict[v.Box, Any]


def _while(e: Evaluator, node: ast.While) -> None:
    _loop(e, node, lambda: e.operators.truth_of(e.evaluate(node.test)), lambda: e.block(node.body))


def _for(e: Evaluator, node: ast.For) -> None:
    over = e.paths.narrowed(e.evaluate(node.iter))
    if isinstance(over, v.Ring):
        ring = over
        over = v.Span(0, e.memory.ring_length(ring), lambda k: e.memory.ring_item(ring, k), ring)
    if isinstance(over, v.Array) and over.memory.length > UNROLLED:
        each = e.items.each(over)
        over = v.Span(0, each.count, each.item)
    if isinstance(over, range) and len(over) > UNROLLED and over.step == 1:
        over = v.Span(over.start, over.stop, lambda k: k)
    if isinstance(over, v.Bytes):
        _for_bytes(e, node, over)
    elif isinstance(over, v.Span):
        start = len(e.lower.out)
        _for_span(e, node, over)
        if over.ring and any(
            isinstance(s, (ir.Push, ir.Drop)) and s.ring == over.ring.number
            for s in ir.every(e.lower.out[start:])
        ):
            raise Refused(RESIZED)
    else:
        _unrolled(e, node, e.items.each(over))


def _unrolled(e: Evaluator, node: ast.For, each: v.Each) -> None:
    def go(k: int) -> None:
        if k == each.count:
            each.end()
            e.leave(OVER)
            return
        assign(e, node.target, each.item(k))
        e.block(node.body)
        on = _goes_on(e, e.stack.exit)
        e.paths.branch(on, lambda: further(k + 1), lambda: None)

    def further(k: int) -> None:
        e.leave(ON)
        go(k)

    go(0)
    _after_loop(e, node)


def _goes_on(e: Evaluator, how: Any) -> ir.Operand:
    if not isinstance(how, ir.Var):
        return how in (ON, CONTINUE)
    return e.paths.branch(  # type: ignore[no-any-return]
        e.lower.compare("==", how, ON), lambda: True, lambda: e.lower.compare("==", how, CONTINUE)
    )


def _after_loop(e: Evaluator, node: ast.For | ast.While) -> None:
    how = e.stack.exit
    after: Any = RETURN if how == RETURN else ON
    if isinstance(how, ir.Var) and kinds_within(node)[ast.Return]:
        back = e.lower.compare("==", how, RETURN)
        after = e.paths.branch(back, lambda: RETURN, lambda: ON)
    if node.orelse:
        over = e.lower.compare("==", how, OVER)  # a break in `else` leaves the loop around this one
        e.paths.branch(over, lambda: _otherwise(e, node.orelse), lambda: e.leave(after))
    else:
        e.leave(after)


def _otherwise(e: Evaluator, statements: Sequence[ast.stmt]) -> None:
    e.leave(ON)
    e.block(statements)


def _for_bytes(e: Evaluator, node: ast.For, over: v.Bytes) -> None:
    kinds = kinds_within(node)
    if node.orelse or kinds[ast.Break] or kinds[ast.Return]:
        raise Refused("leaving a loop over a text")
    for part in over.text.parts:
        if isinstance(part, str):
            _unrolled(e, node, e.items.each(part.encode()))
            continue
        value, _ = part
        if ir.type_of(value) != ir.INT:
            raise Refused("the bytes of a number that is not an integer")
        count = e.lower.new(ir.INT)
        e.lower.out.append(ir.Digits(count, value))

        def digit(k: ir.Operand, count: ir.Var = count) -> ir.Var:
            target = e.lower.new(ir.INT)
            e.lower.out.append(ir.Digit(target, count, k))
            return target

        _for_span(e, node, v.Span(0, count, digit))


def _for_span(e: Evaluator, node: ast.For, over: v.Span) -> None:
    counter = v.List([over.first])

    def test() -> ir.Operand:
        return e.lower.compare("<", read(counter)[0], over.end)

    def body() -> None:
        k = read(counter)[0]
        ends = e.lower.range_of(over.first), e.lower.range_of(over.end)
        if isinstance(k, ir.Var) and ends[0] and ends[1]:
            e.lower.ranges[k] = ends[0][0], ends[1][1] - 1
        e.paths.write(counter, 0, e.lower.binary("+", k, 1))
        assign(e, node.target, over.item(k))
        e.block(node.body)

    _loop(e, node, test, body)


def _loop(
    e: Evaluator,
    node: ast.For | ast.While,
    test: Callable[[], ir.Operand],
    body: Callable[[], None],
) -> None:
    since = now()
    held = e.stack.frame.slots
    passing = {
        name
        for name in _stored(node)
        if held.get(name, UNSET) is UNSET and not _is_read_outside(e, node, name)
    }  # names that are local to a pass
    carried: dict[tuple[v.Box, Any], Shape] = {}
    for _ in range(WIDEST):
        heads: list[tuple[ir.Var, ir.Var]] = []
        made = _passed(e, test, body, carried, heads, passing)
        if not isinstance(made.exit, ir.Var) and made.exit not in (ON, CONTINUE):
            break  # the loop is left at once
        widening = Widening()
        grew = False
        for key, end in made.ends.items():
            box, name = key
            if box.age > since or name == EXIT or (box is e.stack.frame and name in passing):
                continue
            memo = Memo()
            before = carried.get(key) or shape_of(made.starts[key], read)
            after = shape_of(end, lambda b: made.contents.get(b, b.slots), "", memo)  # noqa: B023
            wide = widening.of(before, after)
            if key not in carried or widening.grew:
                grew = True
            carried[key] = wide
        if not grew:
            break
    else:
        raise Refused("a loop in which values keep taking new forms")
    _finish_loop(e, node, made, carried, heads)


def for_each_index(e: Evaluator, count: int, body: Callable[[ir.Var], None]) -> None:
    """Emit a loop over the indices below `count`; `body` changes nothing but arrays."""
    k = e.lower.new(ir.INT)
    e.lower.out.append(ir.Let(k, "copy", (0,)))
    outer, e.lower.out = e.lower.out, []
    e.lower.out.append(ir.Leave(e.lower.let(ir.BOOL, "ge", k, count)))
    e.lower.ranges[k] = 0, count - 1
    body(k)
    e.lower.out.append(ir.Let(k, "copy", (e.lower.let(ir.INT, "add", k, 1),)))
    loop, e.lower.out = ir.Loop(e.lower.out), outer
    e.lower.out.append(loop)


def _is_read_outside(e: Evaluator, loop: ast.AST, name: str) -> bool:
    read = name, ast.Load
    everywhere = names_within(e.stack.call.source.node)
    return name in (EXIT, RESULT) or everywhere[read] > names_within(loop)[read]


def _passed(
    e: Evaluator,
    test: Callable[[], ir.Operand],
    body: Callable[[], None],
    carried: dict[tuple[v.Box, Any], Shape],
    heads: list[tuple[ir.Var, ir.Var]],
    passing: set[str],
) -> Pass:
    starts: dict[tuple[v.Box, Any], Any] = {}

    def run() -> Any:
        for (box, key), shape in carried.items():
            leaves = []
            for type in types_of(shape):
                kept, head = e.lower.new(type), e.lower.new(type)
                heads.append((kept, head))
                e.lower.out.append(ir.Let(head, "copy", (kept,)))
                leaves.append(head)
            value = build(shape, iter(leaves))
            _replace(items_of(box.slots, key) if _has(box, key) else UNSET, value)
            starts[box, key] = value
            e.paths.write(box, key, value)
        e.paths.branch(test(), body, lambda: e.leave(OVER))
        how = e.stack.exit
        e.leave(ON)
        for name in passing:
            e.paths.open(e.stack.frame).pop(name, None)
        return how

    path = e.paths.followed(run, e.lower.facts.copy())
    if path.dead:
        raise Refused("a loop whose every pass raises")
    ends: dict[tuple[v.Box, Any], Any] = {}
    for box, slots in path.changed.items():
        keys = range(len(slots)) if isinstance(slots, list) else list(slots)
        for key in keys:
            before = starts.get((box, key), items_of(box.slots, key) if _has(box, key) else UNSET)
            if not same(before, slots[key]):
                starts.setdefault((box, key), before)
                ends[box, key] = slots[key]
        if isinstance(slots, list) and len(slots) != len(box.slots):
            raise Refused("a list whose length changes in a loop")
        if isinstance(box, v.Dict) and list(slots) != list(box.slots):
            raise Refused("a dictionary whose keys change in a loop")
    for key in carried:
        box, name = key
        held = path.changed.get(box, box.slots)
        ends.setdefault(key, items_of(held, name))
    return Pass(path.out, path.value, starts, ends, path.changed)


def _finish_loop(
    e: Evaluator,
    node: ast.For | ast.While,
    made: Pass,
    carried: dict[tuple[v.Box, Any], Shape],
    heads: list[tuple[ir.Var, ir.Var]],
) -> None:
    if not isinstance(made.exit, ir.Var):
        if made.exit in (ON, CONTINUE):
            raise Refused("an endless loop")
        e.lower.out += made.out  # a single pass, which always leaves
        for (box, name), end in made.ends.items():
            e.paths.write(box, name, end)
        e.leave(made.exit)
        _after_loop(e, node)
        return
    queue = iter(heads)
    kept: dict[tuple[v.Box, Any], list[ir.Var]] = {}
    for key, shape in carried.items():
        box, name = key
        leaves = [next(queue)[0] for _ in types_of(shape)]
        start = items_of(box.slots, name) if _has(box, name) else UNSET
        for leaf, number in zip(leaves, numbers_of(shape, start, read, e.lower), strict=True):
            e.lower.out.append(ir.Let(leaf, "copy", (number,)))
        kept[key] = leaves
    outer, e.lower.out = e.lower.out, made.out

    def contents(box: v.Box) -> Any:
        return made.contents.get(box, box.slots)

    sets = []
    for key, shape in carried.items():
        for leaf, number in zip(kept[key], numbers_of(shape, made.ends[key], contents, e.lower), strict=True):
            sets.append((leaf, e.lower.let(leaf.type, "copy", number)))
    e.lower.out += [ir.Let(leaf, "copy", (number,)) for leaf, number in sets]
    stays = _goes_on(e, made.exit)
    leaving = e.lower.let(ir.BOOL, "not", stays)
    e.lower.out.append(ir.Leave(leaving))
    body, e.lower.out = e.lower.out, outer
    e.lower.out.append(ir.Loop(body))
    for (box, name), shape in carried.items():
        leaves = [e.lower.let(leaf.type, "copy", leaf) for leaf in kept[box, name]]
        value = build(shape, iter(leaves))
        for before in (items_of(box.slots, name) if _has(box, name) else UNSET, made.ends[box, name]):
            _replace(before, value)
        e.paths.write(box, name, value)
    e.leave(made.exit)
    _after_loop(e, node)


def _replace(before: Any, after: Any) -> None:
    """Note that the objects in a value are replaced by copies, with which they are not to be confused."""
    pairs = [(before, after)]
    while pairs:
        a, b = pairs.pop()
        if isinstance(a, tuple) and isinstance(b, tuple) and len(a) == len(b):
            pairs += zip(a, b, strict=True)
        elif isinstance(a, v.Closure) and isinstance(b, v.Closure):
            pairs.append((a.frame, b.frame))
        elif isinstance(a, v.Bound) and isinstance(b, v.Bound):
            pairs.append((a.owner, b.owner))
        elif isinstance(a, v.Box) and type(a) is type(b) and a is not b and a.merged is not b:
            a.merged = b
            keys = range(len(a.slots)) if isinstance(a.slots, list) else list(a.slots)
            pairs += [(a.slots[k], items_of(b.slots, k)) for k in keys if _has(b, k)]
            if isinstance(a, v.Frame) and isinstance(b, v.Frame):
                pairs.append((a.parent, b.parent))
        elif a is not b and not isinstance(a, v.Box) and not isinstance(b, v.Box):
            for box in boxes_in(a):
                box.alias = box.alias or OF_LOOP
        elif isinstance(a, v.Box):
            a.alias = a.alias or OF_LOOP


def _has(box: v.Box, key: Any) -> bool:
    return key < len(box.slots) if isinstance(box, v.List) else key in box.slots


def _stored(loop: ast.AST) -> set[str]:
    return {name for name, context in names_within(loop) if context is ast.Store}


LOOPS: dict[type[ast.AST], Callable[[Evaluator, Any], None]] = {ast.For: _for, ast.While: _while}
"""Loops that are understood, with what carries them out."""
