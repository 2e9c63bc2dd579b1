"""Small components at random, in the part of Python that components and users' laws are written in."""

from __future__ import annotations

import random
from dataclasses import dataclass, field

BEFORE = '''
class Pair(NamedTuple):
    """Two numbers."""

    one: float
    two: float = 2

    @property
    def both(self):
        return self.one + self.two


@dataclass
class Kept:
    """Numbers that change."""

    level: float
    count: int = 0

    def raised(self, by, times=1):
        self.count += times
        self.level = 0.5 * (self.level + by)
        return self.level


LIMIT, STEPS = 1.5, 4
TABLE = (0.0, 1, -2.5, 3.0, True)


def saturated(x, most=LIMIT):
    return max(-most, min(most, x))


def counted(x, *more, scale=1):
    total = 0
    for y in (x, *more):
        total += scale * y
    return total


'''
"""Classes, constants and functions that every program can use."""

NUMBERS = (
    "0", "1", "-1", "2", "3", "7", "-5", "10", "True", "False", "0.0", "-0.0", "0.5", "-0.5", "1.0", "1.5",
    "2.5", "-2.5", "0.3", "1e-3", "1e-300", "1e300", "100", "2**40", "2**53", "10**6", "math.inf", "math.pi",
)  # fmt: skip
FUNCTIONS = (
    "sqrt", "sin", "cos", "tan", "asin", "acos", "atan", "exp", "expm1", "log", "log1p", "log10", "sinh",
    "cosh", "tanh", "fabs", "floor", "ceil", "trunc", "degrees", "radians", "isnan", "isinf", "isfinite",
)  # fmt: skip
OF_TWO = ("atan2", "hypot", "fmod", "copysign", "pow", "log", "atan2", "hypot", "fmod", "copysign")
ARITHMETIC = ("+", "-", "*", "+", "-", "*", "/", "//", "%")
COMPARISONS = ("<", "<=", ">", ">=", "==", "!=")


@dataclass
class Scope:
    """Names and loops at a place of a program.

    Attributes:
        numbers: expressions that are numbers.
        lists: names of lists of numbers -> their length, None if that changes.
        functions: names of functions of one number.
        loop: depth of loops around.
        returns: expressions returned: a tuple of one, or a number.
    """

    numbers: list[str]
    lists: dict[str, int | None] = field(default_factory=dict)
    functions: list[str] = field(default_factory=list)
    loop: int = 0
    returns: str = "{}"
    changes: bool = False
    fresh: list[int] = field(default_factory=lambda: [0])

    def inner(self, loop: int = 0) -> Scope:
        return Scope(
            list(self.numbers), dict(self.lists), list(self.functions), self.loop + loop, self.returns,
            self.changes, self.fresh,
        )  # fmt: skip

    def name(self, kind: str = "v") -> str:
        self.fresh[0] += 1
        return f"{kind}{self.fresh[0]}"


class Writer:
    """Writes one program."""

    def __init__(self, seed: int | str) -> None:
        self.chance = random.Random(seed)

    # ---- expressions ------------------------------------------------------------------------

    def number(self, s: Scope, depth: int = 3) -> str:
        r = self.chance
        if depth <= 0 or r.random() < 0.15:
            return r.choice(s.numbers) if r.random() < 0.7 else r.choice(NUMBERS)
        makers = [
            (10, self._arithmetic), (3, self._sign), (2, self._rounded), (3, self._extreme), (2, self._choice),  # noqa: E501
            (2, self._either), (3, self._function), (2, self._of_two), (1, self._power), (2, self._of_list),
            (1, self._as), (1, self._called), (1, self._of_object), (1, self.condition), (1, self._bits),
        ]  # fmt: skip
        weights, chosen = zip(*makers, strict=True)
        return r.choices(chosen, weights)[0](s, depth - 1)

    def _arithmetic(self, s: Scope, d: int) -> str:
        return f"({self.number(s, d)} {self.chance.choice(ARITHMETIC)} {self.number(s, d)})"

    def _sign(self, s: Scope, d: int) -> str:
        return self.chance.choice(("(-{})", "abs({})", "(+{})", "(-{})")).format(self.number(s, d))

    def _rounded(self, s: Scope, d: int) -> str:
        x = self.number(s, d)
        return self.chance.choice((f"round({x})", f"int({x})", f"round({x})", f"math.floor({x})"))

    def _extreme(self, s: Scope, d: int) -> str:
        r = self.chance
        items = ", ".join(self.number(s, d) for _ in range(r.choice((2, 2, 3))))
        return f"{r.choice(('min', 'max'))}({items if r.random() < 0.8 else f'[{items}]'})"

    def _choice(self, s: Scope, d: int) -> str:
        return f"({self.number(s, d)} if {self.condition(s, d)} else {self.number(s, d)})"

    def _either(self, s: Scope, d: int) -> str:
        return f"({self.number(s, d)} {self.chance.choice(('and', 'or'))} {self.number(s, d)})"

    def _function(self, s: Scope, d: int) -> str:
        return f"math.{self.chance.choice(FUNCTIONS)}({self.number(s, d)})"

    def _of_two(self, s: Scope, d: int) -> str:
        return f"math.{self.chance.choice(OF_TWO)}({self.number(s, d)}, {self.number(s, d)})"

    def _power(self, s: Scope, d: int) -> str:
        r = self.chance
        exponent = r.choice(("2", "3", "0", "-1", "-2", "0.5", "1.5", "2.0", "-0.5", self.number(s, 0)))
        return f"({self.number(s, d)} ** {exponent})"

    def _of_list(self, s: Scope, d: int) -> str:
        r = self.chance
        known = [name for name, count in s.lists.items() if count]
        if not known or r.random() < 0.25:
            items = ", ".join(self.number(s, d - 1) for _ in range(3))
            made = r.choice((f"[{items}]", f"({items})", f"[{items}][1:]", f"TABLE[{r.choice((1, 2, -3))}:]"))
        else:
            made = r.choice(known)
            if r.random() < 0.4:
                i = r.choice(
                    ("0", "-1", f"int({self.number(s, 0)})", f"int({self.number(s, 0)}) % {s.lists[made]}")
                )
                return f"{made}[{i}]"
        x = s.name("x")
        inner = s.inner()
        inner.numbers.append(x)
        each = self.number(inner, min(d, 1))
        return r.choice((
            f"sum({made})", f"sum({made}, 0.5)", f"len({made})", f"max({made})", f"min({made})",
            f"sorted({made})[0]", f"sum({each} for {x} in {made})", f"sum([{each} for {x} in {made}])",
            f"any({each} for {x} in {made})", f"all({each} for {x} in {made})",
            f"sum({x} * k for k, {x} in enumerate({made}, 1))", f"max({each} for {x} in reversed({made}))",
            f"sum({x} * y for {x}, y in zip({made}, TABLE))", f"({self.number(s, 0)} in {made})",
            f"sum(sorted({made})[:2])", f"sum({made}[::-1])", f"sum(map(abs, {made}))",
            f"sum(math.copysign(1, {x}) for {x} in {made})", f"math.prod({made})",
        ))  # fmt: skip

    def _as(self, s: Scope, d: int) -> str:
        return f"{self.chance.choice(('float', 'bool', 'int', 'float'))}({self.number(s, d)})"

    def _called(self, s: Scope, d: int) -> str:
        r = self.chance
        x = self.number(s, d)
        own = f"{r.choice(s.functions)}({x})" if s.functions else f"saturated({x})"
        return r.choice((
            own, own, f"saturated({x}, {self.number(s, 0)})", f"counted({x}, {self.number(s, 0)}, scale={self.number(s, 0)})",  # noqa: E501
            f"(lambda z, w={self.number(s, 0)}: z - w)({x})",
        ))  # fmt: skip

    def _of_object(self, s: Scope, d: int) -> str:
        x, y = self.number(s, d), self.number(s, 0)
        return self.chance.choice((
            f"Pair({x}, {y}).both", f"Pair({x})[1]", f"sum(Pair({x}, {y}))", f"max(Pair(two={x}, one={y}))",
            f"Kept({x}).raised({y})", f"Pair({x}, {y})._replace(one=1).one", f"self.GAIN * {x}", "self.doubled",  # noqa: E501
            f"TABLE[int({x}) % 5]", f"{{'p': {x}, 'q': {y}}}['q']",
            f"Kept({x}, 2).count", f"isinstance({x}, float)", f"isinstance({x}, int)",
        ))  # fmt: skip

    def _bits(self, s: Scope, d: int) -> str:
        x, y = s.name("y"), self.number(s, d)
        return (
            f"({x} if ({x} := {y}) else 3)"
            if self.chance.random() < 0.5
            else f"[{y}, 1][{self.condition(s, 0)}]"
        )

    def condition(self, s: Scope, d: int) -> str:
        r = self.chance
        d = max(d - 1, 0)
        kind = r.random()
        if kind < 0.55:
            return f"({self.number(s, d)} {r.choice(COMPARISONS)} {self.number(s, d)})"
        if kind < 0.7:
            return f"({self.number(s, d)} {r.choice(COMPARISONS)} {self.number(s, d)} {r.choice(COMPARISONS)} {self.number(s, 0)})"  # noqa: E501
        if kind < 0.8:
            return f"(not {self.number(s, d)})"
        if kind < 0.9:
            return (
                f"({self.condition(s, d)} {r.choice(('and', 'or'))} {self.condition(s, d)})"
                if d
                else "self.p.on"
            )
        return r.choice(
            (
                "self.p.on",
                "(self.p.mode == 'first')",
                f"({r.choice(s.numbers)} in (0, 1.0, 0.5))",
                f"bool({self.number(s, d)})",
            )
        )

    # ---- statements -------------------------------------------------------------------------

    def block(self, s: Scope, count: int, depth: int) -> list[str]:
        lines: list[str] = []
        for _ in range(count):
            lines += self.statement(s, depth)
        return lines or ["pass"]

    def statement(self, s: Scope, depth: int) -> list[str]:
        r = self.chance
        makers = [
            (8, self._assign), (4, self._augmented), (2, self._unpack), (2, self._new_list), (3, self._change_list),  # noqa: E501
            (1, self._raise), (1 if s.loop else 0, self._leave), (1, self._return),
        ]  # fmt: skip
        if depth > 0:
            makers += [(5, self._if), (3, self._for), (2, self._while), (1, self._def)]  # type: ignore[list-item]
        if s.changes:
            makers += [(6, self._state)]  # type: ignore[list-item]
        weights, chosen = zip(*makers, strict=True)
        return r.choices(chosen, weights)[0](s, depth)

    def _assign(self, s: Scope, depth: int) -> list[str]:
        own = [x for x in s.numbers if x.isidentifier() and x[0] == "v"]
        name = self.chance.choice(own) if own and self.chance.random() < 0.5 else s.name()
        line = f"{name} = {self.number(s)}"
        s.numbers += [name] * 2
        return [line]

    def _augmented(self, s: Scope, depth: int) -> list[str]:
        own = [x for x in s.numbers if x.isidentifier() and x[0] == "v"]
        if not own:
            return self._assign(s, depth)
        return [f"{self.chance.choice(own)} {self.chance.choice(ARITHMETIC)}= {self.number(s, 2)}"]

    def _unpack(self, s: Scope, depth: int) -> list[str]:
        r = self.chance
        a, b = s.name(), s.name()
        line = r.choice((
            f"{a}, {b} = {self.number(s, 2)}, {self.number(s, 2)}",
            f"{a}, {b} = Pair({self.number(s, 2)})",
            f"{a}, *{b}_ = [{self.number(s, 1)}, {self.number(s, 1)}, {self.number(s, 1)}]; {b} = sum({b}_)",
            f"{a} = {b} = {self.number(s, 2)}",
        ))  # fmt: skip
        s.numbers += [a, b]
        return [line]

    def _new_list(self, s: Scope, depth: int) -> list[str]:
        r = self.chance
        name, x = s.name("l"), s.name("x")
        inner = s.inner()
        inner.numbers += [x, x]
        line, count = r.choice((
            (f"[{self.number(s, 2)}, {self.number(s, 2)}, {self.number(s, 1)}]", 3),
            (f"[{self.number(s, 1)}] * 4", 4),
            (f"[{self.number(inner, 2)} for {x} in TABLE]", 5),
            (f"[{self.number(inner, 2)} for {x} in range(3)]", 3),
            (f"list(u) + [{self.number(s, 1)}]", 3),
            ("[*u, *TABLE[1:3]]", 4),
            (f"sorted([{self.number(s, 2)}, {self.number(s, 2)}, {self.number(s, 1)}])", 3),
        ))  # fmt: skip
        s.lists[name] = count
        return [f"{name} = {line}"]

    def _change_list(self, s: Scope, depth: int) -> list[str]:
        r = self.chance
        known = [(name, count) for name, count in s.lists.items() if count and name[0] == "l"]
        if not known:
            return self._new_list(s, depth)
        name, count = r.choice(known)
        i = r.choice(("0", "-1", "1", f"int({self.number(s, 0)}) % 2"))
        if s.loop or depth < 2 or r.random() < 0.6:  # of the same length on all paths
            return [f"{name}[{i}] {r.choice(('', '', '+', '*', '-'))}= {self.number(s, 2)}"]
        line, more = r.choice((
            (f"{name}.append({self.number(s, 2)})", 1), (f"{name}.insert(0, {self.number(s, 1)})", 1),
            (f"{name} += [{self.number(s, 1)}]", 1), (f"{name}.reverse()", 0), (f"{name}.pop()", -1),
            (f"{name}.pop(0)", -1), (f"del {name}[0]", -1), (f"{name}.extend(u)", 2),
        ))  # fmt: skip
        s.lists[name] = (count or 0) + more
        return [line]

    def _raise(self, s: Scope, depth: int) -> list[str]:
        shown = self.chance.choice(("{{{}}}", "{{{}!r}}", "{{{}:.3g}}", "{{{}:g}}")).format(
            self.chance.choice(s.numbers)
        )
        return [
            f"if {self.condition(s, 2)} and {self.condition(s, 1)}:",
            f'    raise ValueError(f"it is {shown} %")',
        ]

    def _leave(self, s: Scope, depth: int) -> list[str]:
        return [f"if {self.condition(s, 2)}:", f"    {self.chance.choice(('break', 'continue', 'break'))}"]

    def _return(self, s: Scope, depth: int) -> list[str]:
        if not s.returns:
            return self._assign(s, depth)
        return [f"if {self.condition(s, 2)}:", f"    return {s.returns.format(self.number(s, 2))}"]

    def _if(self, s: Scope, depth: int) -> list[str]:
        r = self.chance
        lines = [f"if {self.condition(s, 2)}:"]
        lines += self._indented(self.block(self._path(s), r.choice((1, 2)), depth - 1))
        if r.random() < 0.3:
            lines += [
                f"elif {self.condition(s, 2)}:",
                *self._indented(self.block(self._path(s), 1, depth - 1)),
            ]
        if r.random() < 0.6:
            lines += ["else:", *self._indented(self.block(self._path(s), r.choice((1, 2)), depth - 1))]
        return lines

    def _path(self, s: Scope, loop: int = 0) -> Scope:
        inner = s.inner(loop)
        inner.lists = {name: count for name, count in inner.lists.items()}
        return inner

    def _for(self, s: Scope, depth: int) -> list[str]:
        r = self.chance
        inner = self._path(s, 1)
        x, k = s.name(), s.name()
        known = [name for name, count in s.lists.items() if count]
        made = (
            r.choice(known)
            if known and r.random() < 0.7
            else r.choice(("u", "TABLE", f"({self.number(s, 1)}, 1, 0.5)"))
        )
        head, names = r.choice((
            (f"for {x} in {made}:", [x]), (f"for {x} in range({r.choice(('3', '20', 'STEPS', 'self.p.count', '1, 5', 'len(u)', '5, 0, -2'))}):", [x]),  # noqa: E501
            (f"for {k}, {x} in enumerate({made}, start={r.choice((0, 1))}):", [k, x]),
            (f"for {k}, {x} in zip({made}, TABLE):", [k, x]), (f"for {x} in reversed({made}):", [x]),
            (f"for {k}, {x} in pairwise({made}):", [k, x]),
            (f"for {x} in range(int({self.number(s, 0)}) % 7):", [x]),
        ))  # fmt: skip
        inner.numbers += names * 2
        lines = [head, *self._indented(self.block(inner, r.choice((1, 2, 3)), depth - 1))]
        if r.random() < 0.25:
            lines += ["else:", *self._indented(self.block(self._path(s), 1, depth - 1))]
        return lines

    def _while(self, s: Scope, depth: int) -> list[str]:
        r = self.chance
        k = s.name("k")
        inner = self._path(s, 1)
        inner.numbers += [k] * 2
        bound = r.choice(("3", "10", "25", f"abs({self.number(s, 1)}) and {k} < 12"))
        lines = [f"{k} = 0", f"while {k} < {bound}:", f"    {k} += {r.choice((1, 1, 2, '0.5'))}"]
        lines += self._indented(self.block(inner, r.choice((1, 2)), depth - 1))
        if r.random() < 0.25:
            lines += ["else:", *self._indented(self.block(self._path(s), 1, depth - 1))]
        s.numbers.append(k)
        return lines

    def _def(self, s: Scope, depth: int) -> list[str]:
        r = self.chance
        name, x, y = s.name("f"), s.name("x"), s.name("x")
        inner = s.inner()
        inner.loop, inner.returns, inner.changes = 0, "{}", False
        inner.lists = {}
        inner.numbers = [x, x, x, y, *(n for n in s.numbers if n[0] != "v"), *s.numbers[-2:]]
        lines = [f"def {name}({x}, {y}={r.choice(NUMBERS)}):"]
        body = [line for line in self.block(inner, r.choice((0, 1, 2)), min(depth - 1, 1))]
        lines += self._indented([*body, f"return {self.number(inner, 2)}"])
        s.functions.append(name)
        return lines

    def _state(self, s: Scope, depth: int) -> list[str]:
        r = self.chance
        return r.choice((
            [f"self.x = {self.number(s)}"], [f"self.n = int({self.number(s)})"], [f"self.n += {r.choice((1, 2, -3))}"],  # noqa: E501
            [f"self.x {r.choice(ARITHMETIC)}= {self.number(s, 2)}"], [f"self.on = {self.condition(s, 2)}"],
            [f"self.items[{r.choice((0, 1, -1, 'self.n % 3'))}] = {self.number(s, 2)}"],
            [f"self.pair = Pair({self.number(s, 2)}, {self.number(s, 2)})"],
            [f"self.kept.raised({self.number(s, 2)})"], [f"self.kept.level = {self.number(s, 2)}"],
            [f"self.last = (t, {self.number(s, 1)}) if {self.condition(s, 1)} else None"],
            [f"self.seen.append({self.number(s, 1)})", "if len(self.seen) > 5:", "    self.seen.pop(0)"],
        ))  # fmt: skip

    @staticmethod
    def _indented(lines: list[str]) -> list[str]:
        return ["    " + line for line in lines]

    # ---- the program ------------------------------------------------------------------------

    def program(self) -> str:
        """Return the methods of a component."""
        r = self.chance
        inputs = ["u[0]", "u[0]", "u[1]", "u[1]", "a", "b"]
        fixed = ["self.p.gain", "self.p.count", "self.p.on", "self.GAIN", "LIMIT"]
        state = ["self.x", "self.x", "self.n", "self.on", "self.pair.one", "self.kept.level", "self.kept.count",  # noqa: E501
                 "self.items[1]", "self.seen[-1]", "(self.last or (0, 1.5))[1]", "sum(self.items)"]  # fmt: skip  # noqa: E501
        starting = Scope([*inputs, *fixed])
        advancing = Scope([*inputs, *fixed, *state, "t", "h"], changes=True, returns="")
        method = Scope(["x", "x", "y", *fixed, "self.x"], returns="{}")
        out = Scope([*inputs, *fixed, *state, *state], returns="({},)", functions=["self.moved"])
        advancing.functions.append("self.moved")
        lines = ["GAIN = " + r.choice(NUMBERS), "def start(self, t, u):", "    a, b = u"]
        lines += self._indented([
            f"self.x = {self.number(starting, 2)}", f"self.n = {r.choice(('0', '3', '-7', 'self.p.count'))}",
            f"self.on = {self.condition(starting, 1)}", f"self.items = [0.0, {self.number(starting, 1)}, 1]",
            "self.pair = Pair(a)", f"self.kept = Kept({self.number(starting, 1)})", "self.last = None",
            f"self.seen = [{self.number(starting, 1)}]",
        ])  # fmt: skip
        lines += ["def advance(self, t, h, u):", "    a, b = u"]
        lines += self._indented(self.block(advancing, r.choice((1, 2, 3, 4)), 2))
        lines += ["@property", "def doubled(self):", "    return 2 * self.x"]
        lines += ["def moved(self, x, y=1.5):"]
        lines += self._indented(
            [*self.block(method, r.choice((0, 1, 2)), 1), f"return {self.number(method, 2)}"]
        )
        lines += ["def output(self, t, u):", "    a, b = u"]
        lines += self._indented(
            [*self.block(out, r.choice((1, 2, 3, 4)), 2), f"return ({self.number(out)},)"]
        )
        return "\n".join(lines) + "\n"


def program(seed: int | str) -> str:
    """Return the methods of a component, the same ones for the same seed."""
    return Writer(seed).program()
