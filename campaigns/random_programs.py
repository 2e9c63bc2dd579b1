"""Small components and laws at random, in the part of Python that both are written in."""

from __future__ import annotations

import random
import re
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

from . import grammar
from .grammar import Templates

COMPONENT, FUNCTION, CALLED, OBJECT = KINDS = ("component", "function", "called", "object")
"""Kinds of programs: methods of a component, and laws: functions, objects that are called or have outputs."""
PLACE = re.compile(r"(?m)^( *)<(block|loop|body)>$|<(\w+)>")
"""Place of a template that is filled."""
NEW = ("a", "b", "v", "w", "function", "new_list")
"""Places of new names."""
OF_UNITS = {"gain": "self.p.gain", "count": "self.p.count", "on": "self.p.on", "mode": "self.p.mode"}
OF_OBJECTS = {"gain": "self.gain", "count": "self.count", "on": "self.on", "mode": "self.mode"}
OF_FUNCTIONS = {name: name for name in OF_UNITS}
HEAD = """
def law(yaw_rate, sideslip, t, gain=2.0, count: int = 3, on=True, mode: Mode = "first"):
"""
LAW = '''
class Law:
    """A law with a state."""

    inputs, outputs = ("yaw_rate", "sideslip"), ("yaw_moment",)

    def __init__(self, gain=2.0, count: int = 3, on=True, mode: Mode = "first"):
        self.gain, self.count, self.on, self.mode = gain, count, on, mode
        u = a, b = (0.5, -2.0)
'''


@dataclass
class Scope:
    """Names and loops at a place of a program.

    Attributes:
        numbers: expressions that are numbers.
        parameters: parameter -> expression.
        lists: names of lists of numbers.
        functions: names of functions of one number.
        loop: whether there is a loop around.
        returned: template of a returned number; "" if nothing is returned.
        changes: whether the state may change.
        deep: number of blocks that may be nested here.
    """

    numbers: list[str]
    parameters: dict[str, str]
    lists: list[str] = field(default_factory=list)
    functions: list[str] = field(default_factory=list)
    loop: bool = False
    returned: str = "{}"
    changes: bool = False
    deep: int = 2

    def own(self) -> list[str]:
        """Return variables that may be set anew."""
        return [x for x in self.numbers if re.fullmatch(r"[ab]\d+", x)]

    def inner(self, *names: str, **changes: object) -> Scope:
        """Return the scope of a block, or of an expression that binds names."""
        own = {
            "numbers": [*self.numbers, *names, *names],
            "lists": list(self.lists),
            "functions": list(self.functions),
        }
        return replace(self, **{**own, **changes})  # type: ignore[arg-type]


class Writer:
    """Writes one program."""

    def __init__(self, seed: int | str) -> None:
        self.chance = random.Random(seed)
        self.count = 0

    def filled(self, template: str, s: Scope, depth: int, names: dict[str, str] | None = None) -> str:
        """Return a template with random content; `names` receives the names that it binds."""
        known = {} if names is None else names
        return PLACE.sub(lambda found: self._part(found, s, depth, known), template)

    def _part(self, found: re.Match[str], s: Scope, depth: int, names: dict[str, str]) -> str:
        indent, block, kind = found.groups()
        bound = [names[x] for x in ("v", "w") if x in names]
        if block:
            return self._block(block, indent, s, bound)
        if kind in NEW:
            return names.setdefault(kind, self._fresh(kind[0]))
        if kind in ("own", "list"):
            return names.setdefault(kind, self.chance.choice(s.lists if kind == "list" else s.own()))
        if kind in s.parameters:
            return s.parameters[kind]
        if kind == "x":
            return self.number(s, depth)
        if kind == "y":
            return self.number(s, 0)
        if kind == "N":
            return self._constant()
        if kind == "e":
            return self.number(s.inner(*bound), min(depth, 1))
        if kind == "i":
            return self._drawn(grammar.INTEGERS, s, depth, "<short_whole>")
        if kind == "c":
            return self._drawn(grammar.CONDITIONS, s.inner(*bound), depth, "(<y> <cmp> <y>)")
        if kind == "l":
            return self._list(s, depth)
        if kind == "call":
            return f"{self.chance.choice(s.functions or ['saturated'])}({self.number(s, depth - 1)})"
        if kind == "a_list":
            return self.chance.choice(s.lists or ["u"])
        return self.filled(self.chance.choice(grammar.CHOICES[kind]), s, 0)

    def _fresh(self, kind: str) -> str:
        self.count += 1
        return f"{kind}{self.count}"

    def _drawn(self, templates: Templates, s: Scope, depth: int, shortest: str) -> str:
        if depth <= 0:
            return self.filled(shortest, s, 0)
        weights, texts = zip(*templates, strict=True)
        return self.filled(self.chance.choices(texts, weights)[0], s, depth - 1)

    def number(self, s: Scope, depth: int = 3) -> str:
        """Return an expression that is a number."""
        if depth <= 0 or self.chance.random() < 0.15:
            return self.chance.choice(s.numbers) if self.chance.random() < 0.75 else self._constant()
        return self._drawn(grammar.NUMBERS, s, depth, "<y>")

    def _constant(self) -> str:
        chosen = self.chance.choice(grammar.CONSTANTS)
        return "1.5" if chosen in grammar.RARE and self.chance.random() < 0.9 else chosen

    def _list(self, s: Scope, depth: int) -> str:
        if s.lists and self.chance.random() < 0.5:
            return self.chance.choice(s.lists)
        return self._drawn(grammar.LISTS, s, depth, "(<y>, <y>, <y>)")

    # ---- statements -------------------------------------------------------------------------

    def block(self, s: Scope, count: int) -> str:
        """Return statements."""
        return "\n".join(self.statement(s) for _ in range(count)) or "pass"

    def statement(self, s: Scope) -> str:
        """Return a statement; the scope receives its names."""
        kinds = [
            (10.0, grammar.STATEMENTS),
            (6.0 * (s.deep > 0), grammar.BLOCKS),
            (6.0 * s.changes, grammar.CHANGES),
        ]
        kinds += [
            (0.4, ((1.0, f"if <c>:\n    return {s.returned.format('<x>')}"),)),
            (1.2 * s.loop, grammar.LEAVES),
        ]
        weights, groups = zip(*kinds, strict=True)
        template = ""
        while not template or ("<list>" in template and not s.lists) or ("<own>" in template and not s.own()):
            chances, texts = zip(*self.chance.choices(groups, weights)[0], strict=True)
            template = self.chance.choices(texts, chances)[0]
        names: dict[str, str] = {}
        text = self.filled(template, s, 3 if s.deep > 0 else 2, names)
        leaks = ("v",) if template.startswith(("<v> = 0", "for <v> in range(<times>)")) else ()
        s.numbers += 2 * [names[x] for x in ("a", "b", *leaks) if x in names]
        s.lists += [names[x] for x in ("new_list",) if x in names]
        s.functions += [names[x] for x in ("function",) if x in names]
        return text

    def _block(self, kind: str, indent: str, s: Scope, bound: Sequence[str]) -> str:
        inner = s.inner(*bound, deep=s.deep - 1, loop=s.loop or kind == "loop")
        if kind == "body":
            known = [x for x in s.numbers if not re.fullmatch(r"[abvw]\d+", x)][-6:] + s.numbers[-2:]
            inner = Scope([*bound, *bound, *known], s.parameters, deep=s.deep - 1)
        text = self.block(inner, self.chance.choice((0, 1, 2) if kind == "body" else (1, 2)))
        text += f"\nreturn {self.number(inner, 2)}" if kind == "body" else ""
        return self.indented(text, indent)

    @staticmethod
    def indented(text: str, by: str = "    ") -> str:
        """Return a text with every line indented."""
        return "\n".join(by + line for line in text.splitlines())

    # ---- programs ---------------------------------------------------------------------------

    def function(self, head: str, s: Scope, before: str = "", most: int = 4) -> str:
        """Return a function with random statements."""
        text = before + self.block(s, self.chance.randint(0, most))
        text += f"\nreturn {s.returned.format(self.number(s))}" if s.returned else ""
        return f"{head}\n{self.indented(text)}"

    def _state(self, names: Sequence[str], parameters: dict[str, str]) -> tuple[str, list[str], str]:
        """Return the statements that set the state, its numbers, and methods."""
        fixed = [x for name, x in parameters.items() if name != "mode"]
        start = self.filled(grammar.START.strip(), Scope([*names, *fixed], parameters), 2)
        state = list(grammar.STATE)
        method = Scope(["x", "x", "y", *fixed, "self.x", "self.n"], parameters, deep=1)
        methods = "@property\ndef doubled(self):\n    return 2 * self.x\n"
        return start, state, methods + self.function("def moved(self, x, y=1.5):", method, most=2)

    def _scope(
        self, numbers: Sequence[str], state: Sequence[str], parameters: dict[str, str], **other: object
    ) -> Scope:
        fixed = [x for name, x in parameters.items() if name != "mode"]
        drawn = [self.filled(x, Scope(["1.5", *numbers], parameters), 0) for x in state]
        return Scope([*numbers, *numbers, *fixed, "LIMIT", *drawn], parameters, **other)  # type: ignore[arg-type]

    def component(self) -> str:
        """Return the methods of a component."""
        names = ("u[0]", "u[1]", "a", "b")
        start, state, methods = self._state(names, OF_UNITS)
        taken = "a, b = u\n"
        advancing = self._scope((*names, "t", "h"), state, OF_UNITS, changes=True, returned="")
        advancing.functions.append("self.moved")
        out = self._scope(names, state, OF_UNITS, returned="({},)", functions=["self.moved"])
        return "\n".join([
            "def start(self, t, u):", self.indented(taken + start), methods,
            self.function("def advance(self, t, h, u):", advancing, taken),
            self.function("def output(self, t, u):", out, taken), "",
        ])  # fmt: skip

    def law(self, kind: str) -> str:
        """Return a law: a function, or a class whose objects are called or have outputs."""
        if kind == FUNCTION:
            scope = self._scope(("a", "b", "t"), (), OF_FUNCTIONS)
            return self.function(HEAD.strip(), scope, "u = a, b = [yaw_rate, sideslip]\n") + "\n"
        names = ("a", "b", "t")
        start, state, methods = self._state(("a", "b"), OF_OBJECTS)
        scope = self._scope(names, state, OF_OBJECTS, changes=True, functions=["self.moved"])
        if kind == CALLED:
            parts = [
                self.function(
                    "def __call__(self, yaw_rate, sideslip, t):", scope, "u = a, b = yaw_rate, sideslip\n"
                )
            ]
        else:
            scope.returned = ""
            out = self._scope(("u.sideslip", "u[0]"), state, OF_OBJECTS, functions=["self.moved"])
            parts = [
                self.function("def advance(self, t, h, u):", scope, "a, b = u\n"),
                self.function("def output(self, t, u):", out),
            ]
        return (
            LAW.strip()
            + "\n"
            + self.indented(start, "        ")
            + "\n"
            + self.indented("\n".join([methods, *parts, ""]))
            + "\n"
        )


def program(seed: int | str, kind: str = COMPONENT) -> str:
    """Return a component's methods or a law, the same text for the same seed."""
    writer = Writer(seed)
    return writer.component() if kind == COMPONENT else writer.law(kind)
