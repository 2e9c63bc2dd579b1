"""Statements of a component: what they change, where they go on, loops of known and unknown length.

How a function goes on stands in a place of its frame, `EXIT`: it is joined like any other value where two
paths join, so returns, breaks and continues on one path need nothing of their own.
"""

from __future__ import annotations

import ast
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from . import ir
from .evaluate import BINARY, Evaluation, Promote
from .merge import items_of
from .read import Sources, kinds_within, names_within
from .shapes import Known, Memo, Shape, Widening, build, numbers_of, shape_of, types_of
from .values import (
    UNSET,
    Box,
    Bytes,
    Closure,
    Dict,
    Failure,
    Frame,
    Instance,
    List,
    Refused,
    Ring,
    Span,
    Text,
    Union,
    Unreachable,
    is_number,
    now,
    same,
)

EXIT, RESULT = "<exit>", "<result>"
ON, CONTINUE, BREAK, RETURN, OVER = range(5)
"""How a block ends: it goes on, or not; a loop's test fails."""
UNROLLED = 16
"""Passes up to which a loop over a range is written out; chosen: four wheels, seven sets."""
WIDEST = 12
"""Times a loop is followed until what it carries has its form."""


@dataclass
class Pass:
    """One pass through a loop: its statements, how it ends, what has changed."""

    out: list[ir.Statement]
    exit: Any
    starts: dict[tuple[Box, Any], Any]
    ends: dict[tuple[Box, Any], Any]
    contents: dict[Box, Any]


class Execution(Evaluation):
    """The execution of statements."""

    def __init__(self, sources: Sources) -> None:
        super().__init__(sources)

    @property
    def frame(self) -> Frame:
        return self.calls[-1].frame

    @property
    def exit(self) -> Any:
        return self.frame.slots.get(EXIT, ON)

    def leave(self, how: Any) -> None:
        """Set how the block goes on."""
        self.write(self.frame, EXIT, how)

    def block(self, statements: Sequence[ast.stmt]) -> None:
        """Execute statements until one of them leaves."""
        for i, statement in enumerate(statements):
            self.statement(statement)
            how = self.exit
            if isinstance(how, ir.Var):
                rest = statements[i + 1 :]
                if rest:
                    self.branch(self.compare("==", how, ON), lambda: self.block(rest), lambda: None)  # noqa: B023
                return
            if how != ON:
                return

    def statement(self, node: ast.stmt) -> None:
        """Execute a statement.

        Raises:
            Refused: with file and line.
        """
        method = getattr(self, f"_do_{type(node).__name__.lower()}", None)
        self.at(node)
        if method is None:
            raise Refused(f"{type(node).__name__} is not translated", self.where())
        try:
            method(node)
        except Refused as refused:
            if not refused.where:
                self.at(node)
                refused.where = self.where()
            raise
        except (Promote, Unreachable):
            raise
        except Exception as error:  # something that nobody has thought of yet
            self.at(node)
            raise Refused(f"not translated: {type(error).__name__}: {error}", self.where()) from error

    def relevant(self, box: Box, one: Any, other: Any) -> tuple[Any, Any]:
        if box is not self.frame or not isinstance(one, dict) or self._has_closures():
            return one, other
        exits = one.get(EXIT), other.get(EXIT)
        if [x is RETURN for x in exits] == [True, False]:
            one = {**other, **{k: one[k] for k in (EXIT, RESULT)}}
        elif [x is RETURN for x in exits] == [False, True]:
            other = {**one, **{k: other[k] for k in (EXIT, RESULT)}}
        return one, other

    def _has_closures(self) -> bool:
        kinds = kinds_within(self.calls[-1].source.node)
        return kinds[ast.Lambda] + kinds[ast.FunctionDef] > 1  # more than itself

    # ---- simple statements ------------------------------------------------------------------

    def _do_pass(self, node: ast.Pass) -> None:
        pass

    def _do_expr(self, node: ast.Expr) -> None:
        if not isinstance(node.value, ast.Constant):
            self.evaluate(node.value)

    def _do_assign(self, node: ast.Assign) -> None:
        value = self.evaluate(node.value)
        for target in node.targets:
            self.at(node)
            self.assign(target, value)

    def _do_annassign(self, node: ast.AnnAssign) -> None:
        if node.value is not None:
            self.assign(node.target, self.evaluate(node.value))

    def _do_augassign(self, node: ast.AugAssign) -> None:
        op, target = BINARY[type(node.op)], node.target
        if isinstance(target, ast.Name):
            before = self.evaluate(ast.copy_location(ast.Name(target.id, ast.Load()), target))
            value = self.evaluate(node.value)
            self.at(node)
            self.assign(target, self.operate(op, before, value))
        elif isinstance(target, ast.Attribute):
            owner = self.evaluate(target.value)
            before = self.attribute(owner, target.attr)
            value = self.evaluate(node.value)
            self.at(node)
            self.set_attribute(owner, target.attr, self.operate(op, before, value))
        else:
            owner, index = self.evaluate(target.value), self.evaluate(target.slice)
            before = self.subscript(owner, index)
            value = self.evaluate(node.value)
            self.at(node)
            self.set_item(owner, index, self.operate(op, before, value))

    def _do_return(self, node: ast.Return) -> None:
        value = None if node.value is None else self.evaluate(node.value)
        self.write(self.frame, RESULT, value)
        self.leave(RETURN)

    def _do_break(self, node: ast.Break) -> None:
        self.leave(BREAK)

    def _do_continue(self, node: ast.Continue) -> None:
        self.leave(CONTINUE)

    def _do_functiondef(self, node: ast.FunctionDef) -> None:
        named = {
            a.arg: self.evaluate(d)
            for a, d in zip(node.args.kwonlyargs, node.args.kw_defaults, strict=True)
            if d is not None
        }
        defaults = tuple(self.values(node.args.defaults))
        made = Closure(node, self.frame, self.calls[-1].source, defaults, named)
        self.write(self.frame, node.name, made)

    def _do_raise(self, node: ast.Raise) -> None:
        if node.exc is None:
            raise Refused("raise without an exception")
        error = self.evaluate(node.exc)
        if isinstance(error, type) and issubclass(error, BaseException):
            error = Failure(error, Text(()))
        if not isinstance(error, Failure):
            raise Refused("raising what is not made in place")
        self.at(node)
        self.fail(error.kind.__name__, *error.message.parts)
        raise Unreachable

    def _do_delete(self, node: ast.Delete) -> None:
        for target in node.targets:
            if not isinstance(target, ast.Subscript):
                raise Refused("del of a name or attribute")
            owner, index = self.evaluate(target.value), self.evaluate(target.slice)
            self.at(node)
            self.remove(owner, index, "list assignment index out of range")

    def remove(self, owner: Any, index: Any, text: str) -> Any:
        """Take an item off a list and return it."""
        if isinstance(owner, Ring):
            if index != 0 or isinstance(index, (ir.Var, slice)):
                raise Refused("taking another item than the first off a list whose length changes")
            item = self.ring_item(owner, self.ring_index(owner, 0, text))
            self.out.append(ir.Drop(owner.number))
            return item
        if isinstance(owner, Dict) and not isinstance(index, ir.Var):
            return self.open(owner).pop(index)
        if not isinstance(owner, List) or isinstance(index, ir.Var):
            raise Refused(f"taking an item off a {type(owner).__name__}")
        self.promote(owner)
        held = self.open(owner)
        if isinstance(index, int) and not -len(held) <= index < len(held):
            self.fail("IndexError", text)
            raise Unreachable
        item = held[index]
        del held[index]
        return item

    def promote(self, owner: List, item: Any = UNSET) -> None:
        """Give up following a list of the state item by item, now that its length changes."""
        if owner.path is not None:
            example = item if item is not UNSET else owner.slots[0] if owner.slots else UNSET
            if example is UNSET:
                raise Refused("a list of the state that loses items before it gets any")
            raise Promote(owner.path, shape_of(example, self.read))

    # ---- places -----------------------------------------------------------------------------

    def assign(self, target: ast.expr, value: Any) -> None:
        """Give a value to a target."""
        if isinstance(target, ast.Name):
            self.write(self.frame, target.id, value)
        elif isinstance(target, (ast.Tuple, ast.List)):
            self._unpack(target, self.by_form(value, lambda x: tuple(self.items(x))))
        elif isinstance(target, ast.Attribute):
            self.set_attribute(self.evaluate(target.value), target.attr, value)
        elif isinstance(target, ast.Subscript):
            self.set_item(self.evaluate(target.value), self.evaluate(target.slice), value)
        else:
            raise Refused(f"assigning to {type(target).__name__}")

    def _unpack(self, target: ast.Tuple | ast.List, value: Any) -> None:
        if isinstance(value, Union):
            raise Refused("taking apart what has several forms")
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
            self.fail("ValueError", text if few else f"too many values to unpack ({expected})")
            raise Unreachable
        for inner, x in zip(target.elts, values, strict=True):
            self.assign(inner.value if isinstance(inner, ast.Starred) else inner, x)

    def set_attribute(self, owner: Any, name: str, value: Any) -> None:
        """Set an attribute of an instance."""

        def use(x: Any) -> None:
            if not isinstance(x, Instance):
                raise Refused(f"setting an attribute of a {type(x).__name__}")
            self.write(x, name, value)

        self.by_form(owner, use)

    def set_item(self, owner: Any, index: Any, value: Any) -> None:
        """Set an item of a list or dictionary."""
        if isinstance(owner, Dict):
            self.write(owner, self._key(index), value)
            return
        if not isinstance(owner, List):
            raise Refused(f"setting an item of a {type(owner).__name__}")
        held = self.read(owner)
        if not isinstance(index, ir.Var):
            if isinstance(index, slice):
                raise Refused("setting a slice")
            if not -len(held) <= index < len(held):
                self.fail("IndexError", "list assignment index out of range")
                raise Unreachable
            self.write(owner, index, value)
            return
        place = self.within(index, len(held), "list assignment index out of range")
        for k in range(len(held)):
            if is_number(value) and is_number(held[k]):
                kind = ir.joined(ir.type_of(value), ir.type_of(held[k]))
                there = self.compare("==", place, k)
                self.write(owner, k, self.let(kind, "select", there, value, held[k]))
            else:
                there = self.compare("==", place, k)
                before = held[k]
                self.write(owner, k, self.branch(there, lambda: value, lambda: before))  # noqa: B023

    # ---- branches ---------------------------------------------------------------------------

    def _do_if(self, node: ast.If) -> None:
        test = self.truth_of(self.evaluate(node.test))
        self.branch(test, lambda: self.block(node.body), lambda: self.block(node.orelse))

    # ---- loops ------------------------------------------------------------------------------

    def _do_while(self, node: ast.While) -> None:
        self._loop(node, lambda: self.truth_of(self.evaluate(node.test)), lambda: self.block(node.body))

    def _do_for(self, node: ast.For) -> None:
        over = self.narrowed(self.evaluate(node.iter))
        if isinstance(over, Ring):
            ring = over
            over = Span(0, self.ring_length(ring), lambda k: self.ring_item(ring, k))
        if isinstance(over, range) and len(over) > UNROLLED and over.step == 1:
            over = Span(over.start, over.stop, lambda k: k)
        if isinstance(over, Bytes):
            self._for_bytes(node, over)
        elif isinstance(over, Span):
            self._for_span(node, over)
        else:
            self._unrolled(node, self.items(over))

    def _unrolled(self, node: ast.For, items: list[Any]) -> None:
        def go(k: int) -> None:
            if k == len(items):
                self.leave(OVER)
                return
            self.assign(node.target, items[k])
            self.block(node.body)
            on = self._goes_on(self.exit)
            self.branch(on, lambda: further(k + 1), lambda: None)

        def further(k: int) -> None:
            self.leave(ON)
            go(k)

        go(0)
        self._after_loop(node)

    def _goes_on(self, how: Any) -> ir.Operand:
        if not isinstance(how, ir.Var):
            return how in (ON, CONTINUE)
        return self.branch(  # type: ignore[no-any-return]
            self.compare("==", how, ON), lambda: True, lambda: self.compare("==", how, CONTINUE)
        )

    def _after_loop(self, node: ast.For | ast.While) -> None:
        how = self.exit
        if node.orelse:
            over = self.compare("==", how, OVER)
            self.branch(over, lambda: self._otherwise(node.orelse), lambda: None)
            how = self.exit
        if isinstance(how, ir.Var):
            if kinds_within(node)[ast.Return]:
                back = self.compare("==", how, RETURN)
                how = self.branch(back, lambda: RETURN, lambda: ON)
            else:
                how = ON
        self.leave(how if isinstance(how, ir.Var) or how == RETURN else ON)

    def _otherwise(self, statements: Sequence[ast.stmt]) -> None:
        self.leave(ON)
        self.block(statements)

    def _for_bytes(self, node: ast.For, over: Bytes) -> None:
        kinds = kinds_within(node)
        if node.orelse or kinds[ast.Break] or kinds[ast.Return]:
            raise Refused("leaving a loop over a text")
        for part in over.text.parts:
            if isinstance(part, str):
                self._unrolled(node, list(part.encode()))
                continue
            value, _ = part
            if ir.type_of(value) != ir.INT:
                raise Refused("the bytes of a number that is no integer")
            count = self.new(ir.INT)
            self.out.append(ir.Digits(count, value))

            def digit(k: ir.Operand, count: ir.Var = count) -> ir.Var:
                target = self.new(ir.INT)
                self.out.append(ir.Digit(target, count, k))
                return target

            self._for_span(node, Span(0, count, digit))

    def _for_span(self, node: ast.For, over: Span) -> None:
        counter = List([over.first])

        def test() -> ir.Operand:
            return self.compare("<", self.read(counter)[0], over.end)

        def body() -> None:
            k = self.read(counter)[0]
            self.write(counter, 0, self.binary("+", k, 1))
            self.assign(node.target, over.item(k))
            self.block(node.body)

        self._loop(node, test, body)

    def _loop(
        self,
        node: ast.For | ast.While,
        test: Callable[[], ir.Operand],
        body: Callable[[], None],
    ) -> None:
        since = now()
        held = self.frame.slots
        passing = {
            name
            for name in _stored(node)
            if held.get(name, UNSET) is UNSET and not self._is_read_outside(node, name)
        }  # names of one pass, which no other looks at
        carried: dict[tuple[Box, Any], Shape] = {}
        for _ in range(WIDEST):
            heads: list[tuple[ir.Var, ir.Var]] = []
            made = self._pass(test, body, carried, heads, passing)
            if not isinstance(made.exit, ir.Var) and made.exit not in (ON, CONTINUE):
                break  # it is left at once
            widening = Widening()
            grew = False
            for key, end in made.ends.items():
                box, name = key
                if box.age > since or name == EXIT or (box is self.frame and name in passing):
                    continue
                memo = Memo()
                before = carried.get(key) or shape_of(made.starts[key], self.read)
                after = shape_of(end, lambda b: made.contents.get(b, b.slots), "", memo)  # noqa: B023
                wide = widening.of(before, after)
                if key not in carried or widening.grew:
                    grew = True
                carried[key] = wide
            if not grew:
                break
        else:
            raise Refused("a loop in which values take ever new forms")
        self._finish_loop(node, made, carried, heads)

    def _is_read_outside(self, loop: ast.AST, name: str) -> bool:
        read = name, ast.Load
        everywhere = names_within(self.calls[-1].source.node)
        return name in (EXIT, RESULT) or everywhere[read] > names_within(loop)[read]

    def _pass(
        self,
        test: Callable[[], ir.Operand],
        body: Callable[[], None],
        carried: dict[tuple[Box, Any], Shape],
        heads: list[tuple[ir.Var, ir.Var]],
        passing: set[str],
    ) -> Pass:
        starts: dict[tuple[Box, Any], Any] = {}

        def run() -> Any:
            for (box, key), shape in carried.items():
                leaves = []
                for type in types_of(shape):
                    kept, head = self.new(type), self.new(type)
                    heads.append((kept, head))
                    self.out.append(ir.Let(head, "copy", (kept,)))
                    leaves.append(head)
                value = build(shape, iter(leaves))
                starts[box, key] = value
                self.write(box, key, value)
            self.branch(test(), body, lambda: self.leave(OVER))
            how = self.exit
            self.leave(ON)
            for name in passing:
                self.open(self.frame).pop(name, None)
            return how

        path = self.followed(run, self.facts.copy())
        if path.dead:
            raise Refused("a loop whose every pass raises")
        ends: dict[tuple[Box, Any], Any] = {}
        for box, slots in path.changed.items():
            keys = range(len(slots)) if isinstance(slots, list) else list(slots)
            for key in keys:
                before = starts.get((box, key), items_of(box.slots, key) if _has(box, key) else UNSET)
                if not same(before, slots[key]):
                    starts.setdefault((box, key), before)
                    ends[box, key] = slots[key]
            if isinstance(slots, list) and len(slots) != len(box.slots) and not path.dead:
                raise Refused("a list that is made longer or shorter in a loop")
        for key in carried:
            box, name = key
            held = path.changed.get(box, box.slots)
            ends.setdefault(key, items_of(held, name))
        return Pass(path.out, path.value, starts, ends, path.changed)

    def _finish_loop(
        self,
        node: ast.For | ast.While,
        made: Pass,
        carried: dict[tuple[Box, Any], Shape],
        heads: list[tuple[ir.Var, ir.Var]],
    ) -> None:
        if not isinstance(made.exit, ir.Var):
            if made.exit in (ON, CONTINUE):
                raise Refused("a loop without end")
            self.out += made.out  # one pass, which always leaves
            for (box, name), end in made.ends.items():
                self.write(box, name, end)
            self.leave(made.exit)
            self._after_loop(node)
            return
        queue = iter(heads)
        kept: dict[tuple[Box, Any], list[ir.Var]] = {}
        for key, shape in carried.items():
            box, name = key
            leaves = [next(queue)[0] for _ in types_of(shape)]
            start = items_of(box.slots, name) if _has(box, name) else UNSET
            for leaf, number in zip(leaves, numbers_of(shape, start, self.read, self), strict=True):
                self.out.append(ir.Let(leaf, "copy", (number,)))
            kept[key] = leaves
        outer, self.out = self.out, made.out

        def contents(box: Box) -> Any:
            return made.contents.get(box, box.slots)

        sets = []
        for key, shape in carried.items():
            for leaf, number in zip(
                kept[key], numbers_of(shape, made.ends[key], contents, self), strict=True
            ):
                sets.append((leaf, self.let(leaf.type, "copy", number)))
        self.out += [ir.Let(leaf, "copy", (number,)) for leaf, number in sets]
        stays = self._goes_on(made.exit)
        leaving = self.let(ir.BOOL, "not", stays)
        self.out.append(ir.Leave(leaving))
        body, self.out = self.out, outer
        self.out.append(ir.Loop(body))
        for (box, name), shape in carried.items():
            leaves = [self.let(leaf.type, "copy", leaf) for leaf in kept[box, name]]
            self.write(box, name, build(shape, iter(leaves)))
        self.leave(made.exit)
        self._after_loop(node)


def _has(box: Box, key: Any) -> bool:
    return key < len(box.slots) if isinstance(box, List) else key in box.slots


def _stored(loop: ast.AST) -> set[str]:
    return {name for name, context in names_within(loop) if context is ast.Store}


__all__ = ["Execution", "Known"]
