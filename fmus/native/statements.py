"""Evaluation of statements: side effects, control flow, assignments.

The control flow of a function is a value of its frame, `EXIT`, which is merged like any other where two
paths join, so returns, breaks and continues on a single path need no special treatment.
"""

from __future__ import annotations

import ast
from collections.abc import Sequence
from typing import Any

from . import ir
from .operators import BINARY, Operating
from .read import kinds_within
from .shapes import Promote, shape_of
from .values import (
    UNSET,
    Array,
    Box,
    Closure,
    Dict,
    Failure,
    Frame,
    List,
    Refused,
    Ring,
    Text,
    Union,
    Unreachable,
    is_real,
)

EXIT, RESULT = "<exit>", "<result>"
ON, CONTINUE, BREAK, RETURN, OVER = range(5)
"""Ends of a block: it continues, leaves a loop or the function, or the test of a loop fails."""


class Execution(Operating):
    """Evaluation of statements."""

    @property
    def frame(self) -> Frame:
        return self.calls[-1].frame

    @property
    def exit(self) -> Any:
        return self.frame.slots.get(EXIT, ON)

    def leave(self, how: Any) -> None:
        """Set the end of the block."""
        self.write(self.frame, EXIT, how)

    def block(self, statements: Sequence[ast.stmt]) -> None:
        """Evaluate statements until the block is left."""
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
        """Evaluate a statement.

        Raises:
            Refused: with file and line.
        """
        try:
            self.dispatched("_do_", node)
        except (Promote, Refused, Unreachable):
            raise
        except Exception as error:  # unexpected: the component runs in Python
            self.at(node)
            raise Refused(f"not translated: {type(error).__name__}: {error}", self.where()) from error

    def relevant(self, box: Box, slots_a: Any, slots_b: Any) -> tuple[Any, Any]:
        if box is not self.frame or not isinstance(slots_a, dict) or self._has_closures():
            return slots_a, slots_b
        exits = slots_a.get(EXIT), slots_b.get(EXIT)
        if [x is RETURN for x in exits] == [True, False]:
            slots_a = {**slots_b, **{k: slots_a[k] for k in (EXIT, RESULT)}}
        elif [x is RETURN for x in exits] == [False, True]:
            slots_b = {**slots_a, **{k: slots_b[k] for k in (EXIT, RESULT)}}
        return slots_a, slots_b

    def _has_closures(self) -> bool:
        kinds = kinds_within(self.calls[-1].source.node)
        return kinds[ast.Lambda] + kinds[ast.FunctionDef] > 1  # more functions than itself

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
            self.assign(target, self._in_place(op, before, value))
        elif isinstance(target, ast.Attribute):
            owner = self.evaluate(target.value)
            before = self.by_form(owner, lambda x: self.attribute(x, target.attr))
            value = self.evaluate(node.value)
            self.at(node)
            self.set_attribute(owner, target.attr, self._in_place(op, before, value))
        else:
            owner, index = self.evaluate(target.value), self.evaluate(target.slice)
            before = self.by_form(owner, lambda x: self.subscript(x, index))
            value = self.evaluate(node.value)
            self.at(node)
            self.set_item(owner, index, self._in_place(op, before, value))

    def _in_place(self, op: str, before: Any, value: Any) -> Any:
        if isinstance(before, (Dict, Ring, Array)) or type(before) in (list, dict, set):
            raise Refused(f"{op}= of a {type(before).__name__.lower()}")
        if not isinstance(before, List):
            return self.operate(op, before, value, in_place=True)
        if before.path is not None or not (op == "+" or (op == "*" and isinstance(value, int))):
            raise Refused(f"{op}= of a list")
        held = self.open(before)  # other references to the list see the change, too
        held[:] = [*held, *self.items(value)] if op == "+" else held * value
        return before

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
        decorators = [self.evaluate(x) for x in node.decorator_list]
        made: Any = Closure(node, self.frame, self.calls[-1].source, defaults, named)
        for decorator in reversed(decorators):
            made = self.call(decorator, [made], {})
        self.write(self.frame, node.name, made)

    def _do_raise(self, node: ast.Raise) -> None:
        if node.exc is None:
            raise Refused("raise without an exception")
        error = self.evaluate(node.exc)
        if isinstance(error, type) and issubclass(error, BaseException):
            error = Failure(error, Text(()))
        if not isinstance(error, Failure):
            raise Refused("raising an exception that is not created in place")
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
        """Remove an item from a list and return it."""
        if isinstance(owner, Ring):
            if index != 0 or isinstance(index, (ir.Var, slice)):
                raise Refused("removing an item other than the first from a list whose length changes")
            item = self.ring_item(owner, self.ring_index(owner, 0, text))
            self.out.append(ir.Drop(owner.number))
            return item
        own = self.special(owner, "__delitem__")
        if own is not UNSET:
            return self.call(own, [index], {})
        if isinstance(owner, Dict) and not isinstance(index, ir.Var):
            return self.open(owner).pop(self._key(index))
        if not isinstance(owner, List) or isinstance(index, ir.Var):
            raise Refused(f"removing an item from a {type(owner).__name__}")
        self.promote(owner)
        held = self.open(owner)
        if isinstance(index, int) and not -len(held) <= index < len(held):
            self.fail("IndexError", text)
            raise Unreachable
        item = held[index]
        del held[index]
        return item

    def promote(self, owner: List, item: Any = UNSET) -> None:
        """Stop tracking the items of a list of the state, because its length changes."""
        if owner.path is not None:
            example = item if item is not UNSET else owner.slots[0] if owner.slots else UNSET
            if example is UNSET:
                raise Refused("a list of the state that loses items before any are added")
            raise Promote(owner.path, shape_of(example, self.read))

    # ---- places -----------------------------------------------------------------------------

    def assign(self, target: ast.expr, value: Any) -> None:
        """Assign a value to a target."""
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
            self.fail("ValueError", text if few else f"too many values to unpack ({expected})")
            raise Unreachable
        for inner, x in zip(target.elts, values, strict=True):
            self.assign(inner.value if isinstance(inner, ast.Starred) else inner, x)

    def set_item(self, owner: Any, index: Any, value: Any) -> None:
        """Set an item of a list, array or dictionary."""
        if isinstance(owner, Union):
            self.by_form(owner, lambda x: self.set_item(x, index, value))
            return
        own = self.special(owner, "__setitem__")
        if own is not UNSET:
            self.call(own, [index, value], {})
            return
        if isinstance(owner, Dict):
            self.write(owner, self._key(index), value)
            return
        if isinstance(owner, Array):
            self.set_array_item(owner, index, value)
            return
        if isinstance(owner, Ring) and not is_real(index):
            self.set_ring_item(owner, index, value)
            return
        if not isinstance(owner, List):
            raise Refused(f"setting an item of a {type(owner).__name__}")
        held = self.read(owner)
        if is_real(index):
            self.end("TypeError", "list indices must be integers or slices, not float")
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
            self.write(owner, k, self.selected(self.compare("==", place, k), value, held[k]))

    # ---- branches ---------------------------------------------------------------------------

    def _do_if(self, node: ast.If) -> None:
        test = self.truth_of(self.evaluate(node.test))
        self.branch(test, lambda: self.block(node.body), lambda: self.block(node.orelse))
