"""Merging of two paths at a join: the changes of both are undone, and their values merged.

Different numbers are merged into a variable, tuples and objects of the same kind item by item; values of
different form become the alternatives of a union.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from . import ir
from . import values as v
from .lower import Facts
from .memory import Memory
from .stack import EXIT, RESULT, RETURN
from .values import (
    ANY,
    OF_TABLE,
    TWO_NAMES,
    Refused,
    Unreachable,
    alike,
    boxes_in,
    is_number,
    items_of,
    keys_of,
    like,
    now,
    same,
)

MOST_FORMS = 48
"""Largest number of alternatives of a union; chosen: more than components need, to detect endless growth."""


@dataclass
class Path:
    """Path of a branch: its statements, its value, and the content of boxes at its end."""

    out: list[ir.Statement]
    facts: Facts
    value: Any
    changed: dict[v.Box, Any]
    dead: bool

    def slots(self, box: v.Box) -> Any:
        return self.changed.get(box, box.slots)


def forms(value: Any) -> tuple[Any, ...]:
    """Return the alternatives of a value."""
    return value.alternatives if isinstance(value, v.Union) else (value,)


class Paths:
    """Branches, the journal of changes, and joins.

    Attributes:
        choosers: parameters with text choices.
        maps: variables that are functions of another.
        journals: for each path that is being followed, age at its start and previous content of boxes.
    """

    def __init__(self, memory: Memory) -> None:
        self.lower, self.memory = memory.lower, memory
        self.choosers: set[ir.Var] = set()
        self.maps: dict[ir.Var, tuple[ir.Var, dict[int, int]]] = {}
        self.journals: list[tuple[int, dict[v.Box, Any]]] = []

    def write(self, box: v.Box, key: Any, value: Any) -> None:
        """Change the content of a box at a key."""
        self.open(box)[key] = value

    def open(self, box: v.Box) -> Any:
        """Return the content of a box for modification."""
        if box.merged is not None or box.pushed:
            raise Refused(TWO_NAMES)
        if box.alias or box.fixed:
            raise Refused(f"{box.alias or 'the parameters'} is changed")
        box.changed = True
        if self.journals:
            since, journal = self.journals[-1]
            if box.age < since and box not in journal:
                journal[box] = box.slots
                box.slots = box.slots.copy()
        return box.slots

    def followed(self, body: Callable[[], Any], facts: Facts) -> Path:
        """Evaluate a body, undo its changes, and return its path."""
        outer, known = self.lower.out, self.lower.facts
        self.lower.out, self.lower.facts = [], facts
        self.journals.append((now(), {}))
        value, dead = None, False
        try:
            value = body()
        except Unreachable:
            dead = True
        finally:
            _, journal = self.journals.pop()
            changed = {box: box.slots for box in journal}
            for box, before in journal.items():
                box.slots = before
            path = Path(self.lower.out, self.lower.facts, value, changed, dead)
            self.lower.out, self.lower.facts = outer, known
        return path

    def _adopt(self, path: Path) -> None:
        for box, slots in path.changed.items():
            self.open(box)
            box.slots = slots

    def branch(
        self, test: ir.Operand, then: Callable[[], Any], orelse: Callable[[], Any], form: int | None = None
    ) -> Any:
        """Return the value of `then` if a condition is true, else that of `orelse`.

        Args:
            test, then, orelse: condition, and what is evaluated on the two paths.
            form: the alternative of a value that the condition is about; None if it is of the component.
        """
        known = self.lower.facts.known(test)
        if known is not None:
            return then() if known else orelse()
        assert isinstance(test, ir.Var)
        where = self.lower.stack.where(column=True) + ("" if form is None else f":{form}")
        paths = []
        for holds, body in ((True, then), (False, orelse)):
            facts = self.lower.facts.copy()
            facts.learn(test, holds)
            paths.append(self.followed(body, facts))
        a, b = paths
        if a.dead or b.dead:
            live = b if a.dead else a
            rest: list[ir.Statement] = []
            if not live.dead:
                live.out, rest = [], live.out  # later statements need not be in the arm
            self.lower.out.append(ir.If(test, a.out, b.out, where))
            if live.dead:
                raise Unreachable
            self.lower.out += rest
            self.lower.facts = live.facts
            self._adopt(live)
            return live.value
        join = _Join(self, test, a, b)
        value = join.of(a.value, b.value)
        changes = []
        for box in dict.fromkeys((*a.changed, *b.changed)):
            slots_a, slots_b = a.slots(box), b.slots(box)
            if isinstance(slots_a, list) and len(slots_a) != len(slots_b):
                raise Refused("the length of a list changes on one path only")
            if isinstance(box, v.Dict) and list(slots_a) != list(slots_b):
                raise Refused("the keys of a dictionary change on one path only")
            slots_a, slots_b = self._relevant(box, slots_a, slots_b)
            keys = range(len(slots_a)) if isinstance(slots_a, list) else dict.fromkeys((*slots_a, *slots_b))
            merged = {key: join.of(items_of(slots_a, key), items_of(slots_b, key)) for key in keys}
            changes.append((box, list(merged.values()) if isinstance(slots_a, list) else merged))
        join.finish()
        if a.out or b.out:
            self.lower.out.append(ir.If(test, a.out, b.out, where))
        for box, slots in changes:
            self.open(box)
            box.slots = slots
        return value

    def _relevant(self, box: v.Box, slots_a: Any, slots_b: Any) -> tuple[Any, Any]:
        """Return the content of a box on two paths, without names that a path that returns does not use."""
        if (
            box is not self.lower.stack.frame
            or not isinstance(slots_a, dict)
            or self.lower.stack.has_closures()
        ):
            return slots_a, slots_b
        exits = slots_a.get(EXIT), slots_b.get(EXIT)
        if [x is RETURN for x in exits] == [True, False]:
            slots_a = {**slots_b, **{k: slots_a[k] for k in (EXIT, RESULT)}}
        elif [x is RETURN for x in exits] == [False, True]:
            slots_b = {**slots_a, **{k: slots_b[k] for k in (EXIT, RESULT)}}
        return slots_a, slots_b

    def by_form(self, value: Any, use: Callable[[Any], Any]) -> Any:
        """Apply `use` to the active alternative of a value."""
        if not isinstance(value, v.Union):
            return use(value)

        def from_(possible: list[int]) -> Any:
            k = possible[0]
            if len(possible) == 1:
                return self.by_form(value.alternatives[k], use)
            test = self.lower.compare("==", value.tag, k)
            chosen = value.alternatives[k]
            return self.branch(test, lambda: self.by_form(chosen, use), lambda: from_(possible[1:]), k)

        return from_(self._possible(value, self.lower.facts))

    def narrowed(self, value: Any, facts: Facts | None = None) -> Any:
        """Return the active alternative of a value, if known."""
        if isinstance(value, v.Union):
            left = self._possible(value, facts or self.lower.facts)
            if len(left) == 1:
                return self.narrowed(value.alternatives[left[0]], facts)
        return value

    def _possible(self, value: v.Union, facts: Facts) -> list[int]:
        tag = self.lower.settled(value.tag, facts)
        if not isinstance(tag, ir.Var):
            return [int(tag)]
        left = facts.left(tag)
        if left is not None:
            return sorted(left)
        return [k for k in range(len(value.alternatives)) if k not in facts.others.get(tag, ())]

    def real(self, value: Any) -> Any:
        """Return a number of any form as a real one."""
        return self.by_form(value, self.lower.as_real)

    def selected(self, test: ir.Operand, a: Any, b: Any) -> Any:
        """Return one of two values, by a condition."""
        if is_number(a) and is_number(b) and alike(a, b) and self.lower.facts.known(test) is None:
            return self.lower.let(ir.joined(map(ir.type_of, (a, b))), "select", test, a, b)
        return self.branch(test, lambda: a, lambda: b)


def _values(x: ir.Operand, facts: Facts) -> frozenset[int] | None:
    if not isinstance(x, ir.Var):
        return frozenset([int(x)])
    return facts.left(x)


class _Join:
    """Merge of the values of two paths."""

    def __init__(self, paths: Paths, test: ir.Var, a: Path, b: Path) -> None:
        self.paths, self.lower, self.test, self.a, self.b = paths, paths.lower, test, a, b
        self.boxes: dict[tuple[v.Box, v.Box], v.Box] = {}
        self.numbers: dict[tuple[Any, Any], ir.Operand] = {}

    def finish(self) -> None:
        """Mark the objects that have been merged into others."""
        for (a, b), box in self.boxes.items():
            a.merged = b.merged = box

    def of(self, a: Any, b: Any) -> Any:
        """Return the merged value of `a` on one path and `b` on the other."""
        a, b = self.paths.narrowed(a, self.a.facts), self.paths.narrowed(b, self.b.facts)
        if a is b or same(a, b) or b is ANY:
            return a
        if a is ANY:
            return b
        if is_number(a) and is_number(b) and alike(a, b):
            return self.number(a, b)
        if isinstance(a, v.Picked):
            a = self._loaded(a, self.a)
        if isinstance(b, v.Picked):
            b = self._loaded(b, self.b)
        if not alike(a, b):
            return self.union(a, b)
        if isinstance(a, tuple):
            return like(a, [self.of(x, y) for x, y in zip(a, b, strict=True)])
        if isinstance(a, v.Box):
            return self.box(a, b)
        if isinstance(a, v.Closure):
            frame = self.box(a.frame, b.frame)
            return v.Closure(a.node, frame, a.source, a.defaults, a.named_defaults)
        if isinstance(a, v.Bound):
            return v.Bound(a.function, self.of(a.owner, b.owner))
        raise Refused(f"a value that is {type(a).__name__} on both paths")

    def _loaded(self, value: v.Picked, path: Path) -> Any:
        outer, self.lower.out = self.lower.out, path.out
        for box in boxes_in(value):
            box.alias = OF_TABLE
        try:
            return self.paths.memory.loaded(value)
        finally:
            self.lower.out = outer

    def number(self, a: ir.Operand, b: ir.Operand) -> ir.Operand:
        a, b = self.lower.settled(a, self.a.facts), self.lower.settled(b, self.b.facts)
        if same(a, b):
            return a
        key = (a if isinstance(a, ir.Var) else repr(a)), (b if isinstance(b, ir.Var) else repr(b))
        if key in self.numbers:
            return self.numbers[key]
        mapped = self._mapped(a, b)
        type = ir.joined(map(ir.type_of, (a, b)))
        if mapped is not None and type != ir.EITHER and all(k == x for k, x in mapped[1].items()):
            return self.lower.truth(mapped[0]) if type == ir.BOOL else mapped[0]
        target = self.lower.new(type)
        self.a.out.append(ir.Let(target, "copy", (a,)))
        self.b.out.append(ir.Let(target, "copy", (b,)))
        if isinstance(a, int) and isinstance(b, int):
            self.lower.choices[target] = (self.test, a, b)
        if mapped is not None:
            self.paths.maps[target] = mapped
        if target.type == ir.INT:
            left = _values(a, self.a.facts), _values(b, self.b.facts)
            if left[0] is not None and left[1] is not None:
                self.lower.facts.domains[target] = left[0] | left[1]
        if target.type == ir.BOOL:
            self._remember(target, a, b)
        self.numbers[key] = target
        return target

    def _mapped(self, a: ir.Operand, b: ir.Operand) -> tuple[ir.Var, dict[int, int]] | None:
        """Return a variable that distinguishes the two paths, and the number for each of its values."""
        kind, *of = self.lower.facts.meanings.get(self.test, ("",))
        if kind != "is" or isinstance(a, ir.Var) or not isinstance(a, int):
            return None
        source, number = of
        left = self.b.facts.left(source)
        if left is None:
            return None
        if isinstance(b, ir.Var):
            if b is source:
                rest = {k: k for k in left}
            elif b in self.paths.maps and self.paths.maps[b][0] is source:
                rest = {k: x for k, x in self.paths.maps[b][1].items() if k in left}
            else:
                return None
        elif isinstance(b, int):
            rest = dict.fromkeys(left, int(b))
        else:
            return None
        return source, {number: int(a), **rest}

    def _remember(self, target: ir.Var, a: ir.Operand, b: ir.Operand) -> None:
        meanings = self.lower.facts.meanings
        if b is False or a is True:
            first: Any = self.test
            if b is False and a is True:
                meanings[target] = ("and", first, True)
            else:
                meanings[target] = ("and", first, a) if b is False else ("or", first, b)
        elif a is False or b is True:
            against = ir.Var(f"not {self.test}", ir.BOOL)  # symbolic, never computed
            meanings[against] = ("not", self.test)
            if a is False and b is True:
                meanings[target] = ("not", self.test)
            else:
                meanings[target] = ("and", against, b) if a is False else ("or", against, a)

    def box(self, a: v.Box, b: v.Box) -> Any:
        if a is b:
            return a
        if (a, b) in self.boxes:
            return self.boxes[a, b]
        slots_a, slots_b = self.a.slots(a), self.b.slots(b)
        if isinstance(a, v.Ring) or (isinstance(a, v.List) and len(slots_a) != len(slots_b)):
            raise Refused("the length of a list changes on one path only")
        made: v.Box
        if isinstance(a, v.Instance):
            made = v.Instance(a.cls)
        elif isinstance(a, v.List):
            made = v.List(slots_a)
        elif isinstance(a, v.Frame) and isinstance(b, v.Frame):
            parent = self.box(a.parent, b.parent) if a.parent and b.parent else None
            made = v.Frame({}, parent)
        else:
            made = type(a)({})  # type: ignore[call-arg]
        made.alias = a.alias or b.alias
        self.boxes[a, b] = made
        keys = keys_of(made) if isinstance(made, v.List) else dict.fromkeys((*slots_a, *slots_b))
        joined = {key: self.of(items_of(slots_a, key), items_of(slots_b, key)) for key in keys}
        made.slots = list(joined.values()) if isinstance(made, v.List) else joined
        return made

    def _by_choice(self, a: Any, b: Any) -> v.Union | None:
        """Return a union tagged by the parameter that distinguishes the two paths, if there is one."""
        kind, *of = self.lower.facts.meanings.get(self.test, ("",))
        if kind != "is" or of[0] not in self.paths.choosers:
            return None
        source, number = of
        left = self.b.facts.left(source) or frozenset()
        alternatives = [ANY] * (max(number, *left) + 1)
        for k in left:
            alternatives[k] = b.alternatives[k] if isinstance(b, v.Union) and b.tag is source else b
        alternatives[number] = a
        return v.Union(source, tuple(alternatives))

    def union(self, a: Any, b: Any) -> v.Union:
        chosen = self._by_choice(a, b)
        if chosen is not None:
            return chosen
        alternatives = list(forms(a))
        places: list[int] = []
        for value in forms(b):  # each has a place of its own, so that no two of them are merged
            free = (i for i, x in enumerate(alternatives) if i not in places and alike(x, value))
            place = next(free, None)
            if place is None:
                alternatives.append(value)
                places.append(len(alternatives) - 1)
            else:
                alternatives[place] = self.of(alternatives[place], value)
                places.append(place)
        if len(alternatives) > MOST_FORMS:
            raise Refused(f"a value of more than {MOST_FORMS} forms")
        tag_a: ir.Operand = a.tag if isinstance(a, v.Union) else 0
        tag_b: ir.Operand = places[0]
        if isinstance(b, v.Union):
            tag_b = b.tag
            if places != list(range(len(places))):
                tag_b = self.lower.new(ir.INT)
                self.b.out.append(ir.Load(tag_b, tuple(places), b.tag))
        tag = self.number(tag_a, tag_b)
        if not isinstance(tag, ir.Var):
            raise Refused("two forms that cannot be distinguished")
        return v.Union(tag, tuple(alternatives))
