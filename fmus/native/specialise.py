"""Specialization of a component into four functions: configure, start, advance, output.

The attributes on `self` are the component's state. Its shape is found by evaluating the functions until it no
longer widens: values that are the same in every step are constants, every other number has a place in the
instance.
"""

from __future__ import annotations

import sys
import threading
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import FunctionType
from typing import Any

from . import ir
from .calls import call
from .evaluate import Evaluator
from .expressions import EXPRESSIONS
from .loops import LOOPS
from .outline import Library
from .read import Sources
from .shapes import Growing, Memo, Promote, Shape, Widening, build, numbers_of, shape_of, types_of
from .statements import STATEMENTS
from .values import (
    OF_RING,
    OF_TABLE,
    SHARED,
    Instance,
    List,
    Refused,
    Union,
    Unreachable,
    boxes_in,
    is_mixed,
    is_number,
    read,
)

UNDERSTOOD = EXPRESSIONS | STATEMENTS | LOOPS
"""Kinds of nodes of the syntax tree that are understood, with what evaluates them."""
WIDEST = 40
"""Largest number of evaluations of a step until the shape of the state converges."""
MOST_NUMBERS = 5000
"""Largest number of numbers in a state of fixed shape; chosen: each is a variable in C."""
MOST_IN_ARRAYS = 32_768
"""Largest number of numbers in the arrays of a function; chosen: they take 256 KiB of its stack."""
STACK = 512 * 1024 * 1024
"""Stack of the translating thread [bytes], since nested calls are evaluated by nested calls."""
BASE = "fmi/"
"""Folder of the base class of components, whose lines say nothing about a component."""
HOOKS = ("configure", "start", "advance", "output")
"""Translated methods of a component."""


@dataclass
class Program:
    """Specialized component.

    Attributes:
        variables: its declared inputs, outputs and parameters.
        functions: configure, start, advance, output.
        reads: variable -> place from which it is read.
        configured, state: types of the values derived from parameters, and of the state.
        rings: number of doubles per item, for each list whose length changes.
    """

    variables: Sequence[Any]
    functions: dict[str, ir.Function] = field(default_factory=dict)
    reads: dict[ir.Var, str] = field(default_factory=dict)
    configured: list[str] = field(default_factory=list)
    state: list[str] = field(default_factory=list)
    rings: list[int] = field(default_factory=list)


def specialise(component: type[Any], home: Path, *others: Path, unnamed: Path | None = None) -> Program:
    """Translate a component to a program.

    Args:
        component: its class.
        home, others, unnamed: location of its functions (see `Sources`).

    Raises:
        Refused: a construct cannot be translated; with file and line.
    """
    _refuse_replaced_life_cycle(component, home)
    outcomes: list[Any] = []

    def run() -> None:
        try:
            outcomes.append(_Specialising(component, Sources(home, *others, unnamed=unnamed)).program())
        except BaseException as error:
            outcomes.append(error)

    size, deepest = threading.stack_size(STACK), sys.getrecursionlimit()
    sys.setrecursionlimit(200_000)
    try:
        thread = threading.Thread(target=run)
        thread.start()
        thread.join()
    finally:
        threading.stack_size(size)
        sys.setrecursionlimit(deepest)
    if isinstance(outcomes[0], BaseException):
        raise outcomes[0]
    return outcomes[0]  # type: ignore[no-any-return]


def _refuse_replaced_life_cycle(component: type[Any], home: Path) -> None:
    """Refuse a component that overrides methods of the base class other than `HOOKS`."""
    mro = component.__mro__
    names = [(cls.__name__, cls.__module__.rpartition(".")[2]) for cls in mro]
    base = names.index(("Component", "component"))
    for cls in mro[:base]:
        for name, member in vars(cls).items():
            if name in vars(mro[base]) and name not in HOOKS and isinstance(member, FunctionType):
                file = Path(member.__code__.co_filename)
                place = file.relative_to(home) if file.is_relative_to(home) else file.name
                line = member.__code__.co_firstlineno
                raise Refused(f"{cls.__name__} replaces {name} of the base class", f"{place}:{line}")


class _Covered(Exception):
    """Constants of the class that are covered by attributes, which have their values until they are set."""

    def __init__(self, values: dict[str, Any]) -> None:
        super().__init__()
        self.values = values


class _Specialising:
    def __init__(self, component: type[Any], sources: Sources) -> None:
        self.component, self.sources = component, sources
        self.growing: dict[str, Growing] = {}
        self.covered: dict[str, Any] = {}
        self.last_line = ""  # of the last function, for reasons without a line of their own
        self.reads: dict[ir.Var, str] = {}
        self.domains: dict[ir.Var, frozenset[int]] = {}
        of = {
            c: [v for v in component.variables if v.causality == c] for c in ("input", "output", "parameter")
        }
        self.inputs = [self._read(ir.REAL, f"u_{v.name}", f"v->{v.name}") for v in of["input"]]
        self.outputs = len(of["output"])
        self.t, self.h = self._read(ir.REAL, "t", "t"), self._read(ir.REAL, "h", "h")
        self.parameters = Instance(
            component.Parameters, {v.name: self._parameter(v) for v in of["parameter"]}
        )
        self.parameters.fixed = True
        self.fixed = {x for x in self.reads if self.reads[x].startswith("v->") and x not in self.inputs}

    def _read(self, type: str, name: str, place: str) -> ir.Var:
        made = ir.Var(name, type)
        self.reads[made] = place
        return made

    def _parameter(self, v: Any) -> Any:
        type = {"Real": ir.REAL, "Boolean": ir.BOOL}.get(v.type, ir.INT)
        if v.type == "String":
            if not v.choices:
                raise Refused(f"the parameter {v.name} is a text without choices")
            if len(v.choices) == 1:
                return v.choices[0]
            made = Union(self._read(ir.INT, f"p_{v.name}", f"v->{v.name}"), tuple(v.choices))
            self.domains[made.tag] = frozenset(range(len(v.choices)))
            return made
        return self._read(type, f"p_{v.name}", f"v->{v.name}")

    def program(self) -> Program:
        for _ in range(WIDEST):
            try:
                return self._attempt()
            except Promote as promoted:  # noqa: PERF203 - each attempt follows from the last
                self._grow(promoted)
            except _Covered as covered:
                self.covered |= covered.values
            except Refused as refused:
                raise Refused(refused.text, refused.where or self.last_line) from None
        raise Refused("too many lists whose length changes", self.last_line)

    def _grow(self, promoted: Promote) -> None:
        path = promoted.path if isinstance(promoted.path, str) else list(self.growing)[promoted.path]
        number, item, widening = len(self.growing), promoted.item, Widening()
        if path in self.growing:
            number = self.growing[path].number
            item = widening.of(self.growing[path].item, item)
            if not widening.grew:
                raise Refused("a list whose length changes in ways that are not followed", self.last_line)
        self.growing[path] = Growing(number, item)

    # ---- one attempt ------------------------------------------------------------------------

    def _attempt(self) -> Program:
        program = Program(self.component.variables, reads=dict(self.reads))
        fixed = self.fixed
        self.libraries = Library(), Library()
        me, evaluator = self._run("configure", dict(self.covered))
        configured = shape_of(me, lambda box: box.slots, "self", Memo(fixed))  # its lists are of fixed length
        program.functions["configure"] = ir.Function(
            evaluator.lower.out, _placed("c->c", self._numbers(configured, me, evaluator, "configure"))
        )
        program.configured = list(types_of(configured))
        leaves = self._leaves(program, program.configured, "c")
        fixed = self.all_fixed = fixed | set(leaves)
        me, started = self._run("start", self._attributes(configured, leaves), self.t, List(self.inputs))
        state = self._shape(me, fixed)
        at_start = me
        for _ in range(WIDEST):
            program.state = list(types_of(state))
            if len(program.state) > MOST_NUMBERS:
                text = f"a state of {len(program.state)} numbers; at most {MOST_NUMBERS} are translated"
                raise Refused(text, self._line_of("start"))
            leaves = self._leaves(program, program.state, "s")
            args = self.t, self.h, List(self.inputs)
            me, advanced = self._run("advance", self._attributes(state, leaves), *args)
            widening = Widening()
            wide = widening.of(state, self._shape(me, fixed))
            if not widening.grew:
                break
            state = wide
        else:
            raise Refused("a state that keeps taking new forms")
        program.functions["start"] = ir.Function(
            started.lower.out, _placed("s->s", self._numbers(state, at_start, started, "start"))
        )
        changes = _placed("s->s", self._numbers(state, me, advanced, "advance"))
        program.functions["advance"] = ir.Function(
            advanced.lower.out,
            [change for change, leaf in zip(changes, leaves, strict=True) if change[1] is not leaf],
        )
        program.functions["output"] = self._output(state, leaves, fixed)
        for name, function in program.functions.items():
            if sum(array.length for array in ir.arrays_of(function.body)) > MOST_IN_ARRAYS:
                text = f"arrays of more than {MOST_IN_ARRAYS:,} numbers together"
                raise Refused(text, self._line_of(name))
        program.rings = [max(1, len(list(types_of(g.item)))) for g in self.growing.values()]
        for g in self.growing.values():
            if ir.WORD in types_of(g.item):
                raise Refused("a list of integers of 64 bits whose length changes")
        return program

    def _output(self, state: Shape, leaves: list[ir.Var], fixed: set[ir.Var]) -> ir.Function:
        me, evaluator = self._run("output", self._attributes(state, leaves), self.t, List(self.inputs))
        widening = Widening()
        widening.of(state, self._shape(me, fixed))
        after = self._numbers(state, me, evaluator, "output")
        if widening.grew or any(x is not leaf for x, leaf in zip(after, leaves, strict=True)):
            raise Refused("output() changes the component's state", self._line_of("output"))
        outputs = self.returned
        if isinstance(outputs, Union) or not isinstance(outputs, (tuple, List)):
            raise Refused("output() returns a value with several forms", self._line_of("output"))
        values = evaluator.items.of(outputs)
        if len(values) != self.outputs or not all(is_number(x) or is_mixed(x) for x in values):
            raise Refused("output() returns something other than all outputs", self._line_of("output"))
        return ir.Function(evaluator.lower.out, _placed("y", list(map(evaluator.paths.real, values))))

    def _line_of(self, method: str) -> str:
        source = self.sources.of(getattr(self.component, method))
        return f"{source.file}:{source.node.lineno}" if source.file else ""

    def _run(self, method: str, attributes: dict[str, Any], *args: Any) -> tuple[Instance, Evaluator]:
        me = Instance(self.component, {**attributes, "p": self.parameters})
        fixed = self.fixed if method == "configure" else self.all_fixed
        evaluator = Evaluator(UNDERSTOOD, call, self.sources, fixed, self.libraries[method == "configure"])
        evaluator.lower.facts.domains |= self.domains
        evaluator.paths.choosers |= set(self.domains)
        evaluator.lower.positive.add(self.h)  # or the step is refused: may_step of calling_sequence.h
        try:
            self.returned = evaluator.call(evaluator.attributes.of(me, method), list(args), {})
        except Unreachable:
            where = self._line_of(method) or evaluator.stack.entered
            raise Refused(f"{method}() fails for all inputs", where) from None
        finally:
            line = self._line_of(method) or evaluator.stack.entered
            self.last_line = self.last_line if line.startswith(BASE) else line or self.last_line
        values = {
            name: value
            for name in me.slots.keys() - attributes.keys() - {"p"}
            if isinstance(value := getattr(self.component, name, ...), (int, float, str, type(None)))
        }
        if not values.keys() <= self.covered.keys():
            raise _Covered(values)
        return me, evaluator

    def _shape(self, me: Instance, fixed: set[ir.Var]) -> Shape:
        self._keep_from_change(me)
        return shape_of(me, lambda box: box.slots, "self", Memo(fixed, self.growing))

    def _keep_from_change(self, me: Instance) -> None:
        """Mark objects of the state that have a copy there, since only one of the two would be changed."""
        held = set(boxes_in(me))
        for box in held:
            for copied in box.origins:
                copied.alias = copied.alias or OF_TABLE
            box.alias = box.alias or (OF_RING if box.pushed else "")
            merged = box.merged
            while merged is not None:
                if merged in held:
                    box.alias, merged.alias = box.alias or SHARED, merged.alias or SHARED
                merged = merged.merged

    def _numbers(self, shape: Shape, me: Instance, evaluator: Evaluator, method: str) -> list[ir.Operand]:
        try:
            numbers = numbers_of(shape, me, read, evaluator.lower)
            if any(box.pushed and not box.alias for box in self._outside_lists(me)):
                raise Refused(f"{OF_RING} has another name")
            return numbers
        except Refused as refused:
            raise Refused(refused.text, refused.where or self._line_of(method)) from None

    def _outside_lists(self, me: Instance) -> Memo:
        """Return the objects of the state, without those in lists whose length changes."""
        memo = Memo(growing=self.growing)
        shape_of(me, lambda box: box.slots, "self", memo)
        return memo

    def _attributes(self, shape: Shape, leaves: list[ir.Var]) -> dict[str, Any]:
        made = build(shape, iter(leaves))
        assert isinstance(made, Instance)
        return dict(made.slots)

    def _leaves(self, program: Program, types: list[str], kind: str) -> list[ir.Var]:
        made = [ir.Var(f"{kind}_{i}", type) for i, type in enumerate(types)]
        program.reads |= {x: f"{kind}->{kind}{i}" for i, x in enumerate(made)}
        return made


def _placed(prefix: str, numbers: list[ir.Operand]) -> list[tuple[str, ir.Operand]]:
    """Return numbers with their places prefix0, prefix1, ..."""
    return [(f"{prefix}{i}", x) for i, x in enumerate(numbers)]
