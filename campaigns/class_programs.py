"""Random laws made of classes, written as Python text: objects with operators, properties and descriptors.

A program is built from a model of its classes: what their fields, properties, methods and operators are, so
that most of what is written means something. Nothing is shared with the templates of `grammar.py`.
"""

from __future__ import annotations

import random
from dataclasses import dataclass, field

HEAD = "import enum\nimport functools\nfrom dataclasses import dataclass, field, InitVar\n"
BINARY = {"add": "+", "sub": "-", "mul": "*", "truediv": "/", "mod": "%", "pow": "**"}
ORDER = {"lt": "<", "le": "<=", "gt": ">", "ge": ">=", "eq": "==", "ne": "!="}
NUMBERS = ("0.0", "1.0", "-1.0", "0.5", "2.0", "-0.25", "3", "1", "0", "-2", "10.0", "True")
LIMITS = ("0.3", "0.0", "-0.5", "1.0", "2.0", "3", "7", "11")


@dataclass
class Made:
    """What is known of a class of a program."""

    name: str
    arguments: int
    kind: str = "plain"
    base: Made | None = None
    fields: list[str] = field(default_factory=list)
    readable: list[str] = field(default_factory=list)
    settable: list[str] = field(default_factory=list)
    methods: list[tuple[str, int]] = field(default_factory=list)
    operators: set[str] = field(default_factory=set)
    factories: list[str] = field(default_factory=list)


class Writer:
    """Writer of one program, as its seed decides."""

    def __init__(self, seed: int) -> None:
        self.chance = random.Random(f"classes {seed}")
        self.classes: list[Made] = []
        self.count = 0
        self.objects: dict[str, Made] = {}  # expression -> class of what it is
        self.numbers: list[str] = []
        self.lists: dict[str, tuple[Made, int]] = {}
        self.odd = self.chance.random() < 0.25  # whether rare constructs are written, most of them refused

    def maybe(self, share: float) -> bool:
        return self.chance.random() < share

    def name(self, prefix: str) -> str:
        self.count += 1
        return f"{prefix}{self.count}"

    # ---- expressions ------------------------------------------------------------------------

    def number(self, depth: int = 2) -> str:
        pick = self.chance.random()
        if depth <= 0 or pick < 0.25:
            return self.chance.choice([*self.numbers, *self.numbers, *NUMBERS])
        if pick < 0.45:
            sign = self.chance.choice(("+", "-", "*", "+", "-"))
            return f"({self.number(depth - 1)} {sign} {self.number(depth - 1)})"
        if pick < 0.5:
            return f"(1.0 if {self.condition(depth - 1)} else {self.number(depth - 1)})"
        if pick < 0.55:
            return f"min({self.number(depth - 1)}, {self.number(depth - 1)})"
        if pick < 0.58:
            return f"abs({self.number(depth - 1)})"
        return self.of_object(depth)

    def of_object(self, depth: int) -> str:
        """Return a number that an object gives."""
        found = self.thing(depth - 1)
        if found is None:
            return self.number(0)
        x, cls = found
        ways = [f"{x}.{name}" for name in (*cls.fields, *cls.readable)]
        for name, count in cls.methods:
            ways += [f"{x}.{name}({', '.join(self.number(0) for _ in range(count))})"] * 2
        ops = cls.operators
        ways += [f"len({x})"] * ("len" in ops) + [f"abs({x})"] * ("abs" in ops)
        ways += [f"float({x})"] * ("float" in ops) + [f"{x}[{self.chance.choice('01')}]"] * ("getitem" in ops)
        ways += [f"{x}({self.number(0)})"] * ("call" in ops) + [f"sum({x})"] * ("iter" in ops)
        ways += [f"sum([k * 2.0 for k in {x}])"] * ("iter" in ops)
        if self.odd and cls.fields:
            name = self.chance.choice(cls.fields)
            ways += [
                f'getattr({x}, "{name}", 5.0)',
                f'getattr({x}, "nothing", 5.0)',
                f'{x}.__dict__["{name}"]',
            ]
        return self.chance.choice(ways) if ways else self.number(0)

    def thing(self, depth: int, cls: Made | None = None) -> tuple[str, Made] | None:
        """Return an expression for an object, and its class."""
        known = [(x, c) for x, c in self.objects.items() if cls is None or c is cls]
        if known and (depth <= 0 or self.maybe(0.6)):
            return self.chance.choice(known)
        makeable = [c for c in self.classes if c.arguments >= 0]
        made = cls or (self.chance.choice(makeable) if makeable else None)
        if made is None or made.arguments < 0:
            return self.chance.choice(known) if known else None
        operator = [op for op in BINARY if op in made.operators]
        if depth > 0 and operator and self.maybe(0.4):
            left = self.thing(depth - 1, made)
            assert left is not None
            op = self.chance.choice(operator)
            right = self.number(0) if self.maybe(0.5) else (self.thing(depth - 1, made) or left)[0]
            if self.maybe(0.2):
                return f"({self.number(0)} {BINARY[op]} {left[0]})", made
            return f"({left[0]} {BINARY[op]} {right})", made
        if depth > 0 and "neg" in made.operators and self.maybe(0.2):
            return f"(-{(self.thing(depth - 1, made) or ('', made))[0]})", made
        if depth > 0 and len(known) > 1 and self.maybe(0.2):
            return f"({known[0][0]} if {self.condition(0)} else {known[1][0]})", made
        factory = self.chance.choice([made.name, *(f"{made.name}.{x}" for x in made.factories)])
        count = made.arguments if factory == made.name else 1
        return f"{factory}({', '.join(self.number(depth - 1) for _ in range(count))})", made

    def condition(self, depth: int = 1) -> str:
        pick = self.chance.random()
        found = self.thing(depth - 1) if pick < 0.45 else None
        if found is not None:
            x, cls = found
            order = [op for op in ORDER if op in cls.operators]
            ways = [f"{x} {ORDER[op]} {(self.thing(0, cls) or found)[0]}" for op in order]
            ways += [x, f"not {x}"] if cls.operators & {"bool", "len"} else []
            ways += [f"{self.number(0)} in {x}"] * ("contains" in cls.operators)
            ways += [f"isinstance({x}, {self.chance.choice([*self.classes, cls]).name})"]
            if self.odd:
                ways += [f"{x} is {(self.thing(0, cls) or found)[0]}", f'hasattr({x}, "extra")']
            return self.chance.choice(ways)
        left, sign = self.number(depth), self.chance.choice(list(ORDER.values())[:4])
        return f"{left} {sign} {self.chance.choice(LIMITS)}"

    # ---- classes ----------------------------------------------------------------------------

    def descriptor(self) -> tuple[str, list[str]]:
        """Return the name and text of a class of descriptors."""
        name = self.name("Held")
        text = [
            f"class {name}:",
            "    def __init__(self, most):",
            "        self.most = most",
            "    def __set_name__(self, owner, name):",
            '        self.place = "_" + name',
            "    def __get__(self, owner, kind=None):",
            f"        return getattr(owner, self.place) {self.chance.choice(('* 2.0', '+ 0.5', ''))}",
        ]
        if self.maybe(0.8):
            value = self.chance.choice(("min(value, self.most)", "value - 1.0"))
            text += [
                "    def __set__(self, owner, value):",
                f"        setattr(owner, self.place, {value})",
            ]
        return name, text

    def plain(self) -> list[str]:
        """Return the text of a class, which may have a base."""
        bases = [c for c in self.classes if c.kind == "plain"]
        base = self.chance.choice(bases) if bases and self.maybe(0.4) else None
        cls = Made(self.name("Thing"), self.chance.randint(1, 3), base=base)
        text: list[str] = []
        body: list[str] = []
        descriptor = ""
        if self.maybe(0.25):
            descriptor, text = self.descriptor()
        if base is not None:
            cls.arguments = base.arguments + self.chance.randint(0, 1)
            for name in ("fields", "readable", "settable", "methods"):
                getattr(cls, name).extend(getattr(base, name))
            cls.operators |= base.operators
            cls.factories += base.factories if cls.arguments == base.arguments else []
        own = [self.name("f") for _ in range(cls.arguments - (base.arguments if base else 0))]
        arguments = [f"a{k}" for k in range(cls.arguments)]
        if base is None and self.maybe(0.15):
            slots = ", ".join(f'"{x}"' for x in own)
            body.append(f"    __slots__ = ({slots},)" if not descriptor else "    level = 1.0")
        level = self.name("c")
        body.append(f"    {level} = {self.chance.choice(NUMBERS)}")
        cls.fields.append(level)
        body.append(f"    def __init__(self, {', '.join(arguments)}):")
        if base is not None:
            body.append(f"        super().__init__({', '.join(arguments[: base.arguments])})")
        body += [f"        self.{x} = {a}" for x, a in zip(own, arguments[::-1], strict=False)]
        body.append("        pass")
        cls.fields += own
        if descriptor and "__slots__" not in "".join(body):
            name = self.name("d")
            body.insert(0, f"    {name} = {descriptor}({self.chance.choice(NUMBERS)})")
            body.append(
                f"        self.{'_' if '__set__' not in ''.join(text) else ''}{name} = {arguments[0]}"
            )
            cls.readable.append(name)
            cls.settable += [name] if "__set__" in "".join(text) else []
        fields = [x for x in cls.fields if x.startswith("f")]
        outer = self.numbers, self.objects
        self.numbers, self.objects = [f"self.{x}" for x in cls.fields], {}
        body += self.properties(cls, fields)
        body += self.methods(cls, fields)
        if self.maybe(0.7):
            body += self.operators(cls, fields)
        if self.odd:
            body += self.rare(cls, fields)
        self.numbers, self.objects = outer
        self.classes.append(cls)
        return [*text, f"class {cls.name}{f'({base.name})' if base else ''}:", *body]

    def properties(self, cls: Made, fields: list[str]) -> list[str]:
        body: list[str] = []
        for _ in range(self.chance.randint(0, 2)):
            again = [x for x in cls.readable if x.startswith("p")]
            name = self.chance.choice(again) if again and self.maybe(0.4) else self.name("p")
            body += ["    @property", f"    def {name}(self):", f"        return {self.number(1)}"]
            cls.readable += [name] if name not in cls.readable else []
            if fields and self.maybe(0.7):
                self.numbers.append("value")
                body += [f"    @{name}.setter", f"    def {name}(self, value):"]
                body += [f"        self.{self.chance.choice(fields)} = {self.number(1)}"]
                self.numbers.remove("value")
                cls.settable += [name] if name not in cls.settable else []
            elif name in cls.settable:
                cls.settable.remove(name)
        return body

    def methods(self, cls: Made, fields: list[str]) -> list[str]:
        body: list[str] = []
        for _ in range(self.chance.randint(1, 3)):
            inherited = [m for m in cls.methods if m[0].startswith("m")]
            name, count = (
                self.chance.choice(inherited)
                if inherited and self.maybe(0.4)
                else (self.name("m"), self.chance.randint(0, 1))
            )
            if (name, count) not in cls.methods:
                cls.methods.append((name, count))
            known = list(self.numbers)
            self.numbers += ["x"] * (2 * count)
            body.append(f"    def {name}(self{', x' * count}):")
            if fields and self.maybe(0.7):
                body.append(
                    f"        self.{self.chance.choice(fields)}"
                    f" {self.chance.choice(('=', '+=', '-='))} {self.number(1)}"
                )
            if cls.base is not None and (name, count) in cls.base.methods and self.maybe(0.6):
                body.append(f"        return super().{name}({'x' * count}) + {self.number(1)}")
            else:
                body.append(f"        return {self.number(2)}")
            self.numbers = known
        if self.maybe(0.3):
            name = self.name("s")
            body += ["    @staticmethod", f"    def {name}(x):", "        return x * 2.0 - 1.0"]
            cls.methods.append((name, 1))
        if self.maybe(0.3):
            name = self.name("k")
            passed = ("x", "0.5", "2.0 * x")
            body += ["    @classmethod", f"    def {name}(cls, x):"]
            body.append(
                f"        return cls({', '.join(self.chance.choice(passed) for _ in range(cls.arguments))})"
            )
            cls.factories = [name]
        return body

    def operators(self, cls: Made, fields: list[str]) -> list[str]:
        body: list[str] = []
        take = fields[0] if fields else next(iter(cls.fields))
        rest = ", ".join(f"self.{self.chance.choice(cls.fields)}" for _ in range(cls.arguments - 1))

        def made(value: str) -> str:
            return f"return {cls.name}({value}{', ' * bool(rest)}{rest})"

        for op in self.chance.sample(list(BINARY)[:5], self.chance.randint(0, 3)):
            cls.operators.add(op)
            sign = BINARY[op] if op in ("add", "sub", "mul") else "+"
            body += [f"    def __{op}__(self, o):", f"        if isinstance(o, {cls.name}):"]
            body += [
                f"            {made(f'self.{take} {sign} o.{take}')}",
                f"        {made(f'self.{take} {sign} o')}",
            ]
            body += [f"    def __r{op}__(self, o):", f"        {made(f'o - self.{take}')}"]
            if fields and self.maybe(0.5):
                body += [f"    def __i{op}__(self, o):", f"        self.{take} += 1.0", "        return self"]
        for op in self.chance.sample(list(ORDER), self.chance.randint(0, 3)):
            cls.operators.add(op)
            body += [f"    def __{op}__(self, o):", f"        return self.{take} {ORDER[op]} o.{take}"]
        if "eq" in cls.operators:
            body.append("    __hash__ = None")
        single = {
            "neg": made(f"-self.{take}"),
            "abs": f"return abs(self.{take}) + 1.0",
            "bool": f"return self.{take} > {self.chance.choice(LIMITS)}",
            "len": f"return {self.chance.choice(('0', '2', '3'))}",
            "float": f"return self.{take} * 1.0",
            "iter": f"return iter((self.{take}, 2.0, {self.number(0)}))",
        }
        for op in self.chance.sample(list(single), self.chance.randint(0, 3)):
            cls.operators.add(op)
            body += [f"    def __{op}__(self):", f"        {single[op]}"]
        double = {
            "getitem": f"return (self.{take}, {self.number(0)})[o]",
            "contains": f"return o > self.{take}",
            "call": f"return self.{take} - o",
        }
        for op in self.chance.sample(list(double), self.chance.randint(0, 2)):
            cls.operators.add(op)
            body += [f"    def __{op}__(self, o):", f"        {double[op]}"]
        return body

    def rare(self, cls: Made, fields: list[str]) -> list[str]:
        """Return what few programs have; much of it is refused."""
        take = self.chance.choice(fields or cls.fields)
        some = [
            f"""
    def __getattr__(self, name):
        if name == "extra":
            return self.{take} + 1.0
        raise AttributeError(name)""",
            """
    def __setattr__(self, name, value):
        super().__setattr__(name, value + 0.5)""",
            """
    def __setattr__(self, name, value):
        object.__setattr__(self, name, 2.0 * value)""",
            """
    def __getattribute__(self, name):
        return object.__getattribute__(self, name)""",
            f"""
    @functools.cached_property
    def kept(self):
        return self.{take} * 3.0""",
            f"""
    def twice(self, by, x):
        self.{take} += by
        return x * by
    double = functools.partialmethod(twice, 2.0)""",
            f"""
    @functools.lru_cache
    def cached(self, x):
        return self.{take} * x""",
            """
    seen = [1.0]
    def log(self, x):
        self.seen += [x]
        return self.seen[0]""",
            f"""
    total = 0.0
    def tell(self, x):
        {cls.name}.total += x
        return {cls.name}.total""",
            """
    def __new__(cls, *a):
        return super().__new__(cls)""",
            f"""
    def __enter__(self):
        return self
    def __exit__(self, *a):
        self.{take} = 0.0""",
        ]
        chosen = self.chance.choice(some).splitlines()[1:]
        for line, name, count in (
            ("kept", "", 0),
            ("double", "double", 1),
            ("cached", "cached", 1),
            ("log(", "log", 1),
            ("tell(", "tell", 1),
        ):
            if any(line in x for x in chosen):
                if name:
                    cls.methods += [(name, count)] * 2
                else:
                    cls.readable += ["kept"] * 2
        if any("extra" in x for x in chosen):
            cls.readable += ["extra"] * 2
        return chosen

    def data(self) -> list[str]:
        """Return the text of a dataclass, a named tuple or an enumeration."""
        kind = self.chance.choice(("dataclass", "dataclass", "frozen", "tuple", "enum"))
        cls = Made(self.name("Data"), self.chance.randint(1, 3), kind=kind)
        if kind == "enum":
            body = [f"    {x} = {v}" for x, v in (("LOW", "1.0"), ("MID", "-0.5"), ("HIGH", "3"))]
            cls.readable = ["value", "twice"]
            body += ["    @property", "    def twice(self):", "        return self.value * 2.0"]
            self.objects |= {f"{cls.name}.{x}": cls for x in ("LOW", "MID", "HIGH")}
            cls.arguments = -1
            return [f"class {cls.name}(enum.Enum):", *body]
        cls.fields = [self.name("v") for _ in range(cls.arguments)]
        values = [f"    {x}: float" for x in cls.fields]
        if self.maybe(0.4):
            values[-1] += f" = {self.chance.choice(NUMBERS)}"
        outer = self.numbers, self.objects
        self.numbers, self.objects = [f"self.{x}" for x in cls.fields], {}
        body = ["    @property", "    def both(self):", f"        return {self.number(1)}"]
        cls.readable = ["both"]
        take = cls.fields[0]
        if kind == "tuple":
            text = [f"class {cls.name}(NamedTuple):", *values, *body]
            cls.operators |= {"eq"}
            if self.maybe(0.5):
                rest = "".join(f", self.{x}" for x in cls.fields[1:])
                text += ["    def __add__(self, o):"]
                text += [
                    f"        more = o.{take} if isinstance(o, {cls.name}) else o",
                    f"        return {cls.name}(self.{take} + more{rest})",
                ]
                cls.operators |= {"add"}
                text += ["    def __radd__(self, o):", "        return self.__add__(o)"]
            if self.maybe(0.3):
                text += ["    def __bool__(self):", f"        return self.{take} > 0.5"]
                cls.operators |= {"bool"}
            cls.kind = "value"
        else:
            options = (
                self.chance.choice(("", "(eq=False)", "(slots=True)"))
                if kind == "dataclass"
                else "(frozen=True)"
            )
            text = [f"@dataclass{options}", f"class {cls.name}:", *values]
            if self.maybe(0.3):
                extra = self.name("v")
                text.append(f"    {extra}: float = field(default=1.5{', kw_only=True' * self.maybe(0.5)})")
                cls.fields.append(extra)
            if self.maybe(0.3) and kind == "dataclass":
                text += ["    def __post_init__(self):", f"        self.{take} = self.{take} * 2.0"]
            text += body
            cls.operators |= {"eq"} if options != "(eq=False)" else set()
            if kind == "dataclass":
                cls.settable = []
            else:
                cls.kind = "value"
        self.numbers, self.objects = outer
        self.classes.append(cls)
        return text

    # ---- the law ----------------------------------------------------------------------------

    def statement(self, depth: int, pad: str) -> list[str]:
        pick = self.chance.random()
        mutable = [
            (x, c) for x, c in self.objects.items() if c.kind not in ("value", "enum") and c.arguments >= 0
        ]
        states = [x for x in self.numbers if x.startswith("self.n")]
        if depth > 0 and pick < 0.22:
            text = [f"{pad}if {self.condition()}:", *self.statement(depth - 1, pad + "    ")]
            if self.maybe(0.5):
                text += [f"{pad}else:", *self.statement(depth - 1, pad + "    ")]
            return text
        if depth > 0 and pick < 0.3 and self.lists:
            items, (cls, _) = self.chance.choice(list(self.lists.items()))
            name = self.name("each")
            self.objects[name] = cls
            text = [f"{pad}for {name} in {items}:", *self.statement(depth - 1, pad + "    ")]
            del self.objects[name]
            return text
        if mutable and pick < 0.7:
            x, cls = self.chance.choice(mutable)
            if cls.methods and self.maybe(0.3):
                name, count = self.chance.choice(cls.methods)
                return [f"{pad}{x}.{name}({', '.join(self.number(1) for _ in range(count))})"]
            if "add" in cls.operators and self.maybe(0.15):
                return [f"{pad}{x} += {self.number(0)}"]
            names = [*cls.settable, *cls.settable, *cls.fields]
            if self.odd and self.maybe(0.1):
                return [f'{pad}setattr({x}, "{self.chance.choice(names)}", {self.number(1)})']
            if self.odd and self.maybe(0.05):
                return [f"{pad}{cls.name}.{self.chance.choice(names)} = {self.number(1)}"]
            return [
                f"{pad}{x}.{self.chance.choice(names)}"
                f" {self.chance.choice(('=', '=', '+=', '*='))} {self.number(1)}"
            ]
        if pick < 0.8:
            names = [x for x in self.objects if x.startswith(("self.o", "self.t[", "self.l"))]
            if names:
                x = self.chance.choice(names)
                made = self.thing(1, self.objects[x])
                if made is not None and not made[0].startswith("-"):
                    return [f"{pad}{x} = {made[0]}"]
        return [f"{pad}{self.chance.choice(states)} {self.chance.choice(('=', '+='))} {self.number(2)}"]

    def program(self) -> str:
        text = HEAD.splitlines()
        for _ in range(self.chance.randint(1, 4)):
            text += self.data() if self.maybe(0.3) else self.plain()
        self.numbers = ["u[0]", "u[1]", "t"]
        usable = [c for c in self.classes if c.arguments >= 0]
        start = ["self.n1 = 0.0", "self.n2 = u[0]", "self.count = 0"]
        places: dict[str, Made] = {}
        for _ in range(self.chance.randint(1, 3) if usable else 0):
            found = self.thing(1, self.chance.choice(usable))
            assert found is not None
            name = f"self.{self.name('o')}"
            start.append(f"{name} = {found[0]}")
            places[name] = found[1]
        lists: dict[str, tuple[Made, int]] = {}
        if usable and self.maybe(0.5):
            cls, count = self.chance.choice(usable), self.chance.randint(1, 3)
            items = [(self.thing(1, cls) or ("", cls))[0] for _ in range(count)]
            start.append(f"self.l = [{', '.join(items)}]")
            lists["self.l"] = cls, count
            places |= {f"self.l[{k}]": cls for k in range(count)}
            if self.maybe(0.3):
                places[f"self.l[self.count % {count}]"] = cls
        if usable and self.maybe(0.3):
            cls = self.chance.choice(usable)
            items = [(self.thing(1, cls) or ("", cls))[0] for _ in range(2)]
            start.append(f'self.t = {{"a": {items[0]}, "b": {items[1]}}}')
            places |= {f'self.t["{k}"]': cls for k in "ab"}
            lists["self.t.values()"] = cls, 2
        self.objects |= places
        self.lists |= lists
        self.numbers += ["self.n1", "self.n2", "self.count"]
        grows = usable and self.maybe(0.15)
        advance = ["        self.count += 1"]
        if grows:
            start.append("self.g = []")
            item = self.number(1) if self.maybe(0.5) else (self.thing(1) or (self.number(1), None))[0]
            advance += [
                f"        self.g.append({item})",
                "        if len(self.g) > 3:",
                "            self.g.pop(0)",
            ]
            if item.startswith(("(", "u", "self.n")) and self.maybe(0.5):
                self.numbers.append("len(self.g)")
        for _ in range(self.chance.randint(2, 6)):
            advance += self.statement(2, "        ")
        if self.maybe(0.5):
            advance += [
                f"        if self.count == {self.chance.choice(('5', '8', '11'))}:",
                *self.statement(0, "            "),
            ]
        output = " + ".join(self.number(2) for _ in range(2))
        pad = "        "
        law = [
            "class Law:",
            '    inputs, outputs = ("yaw_rate", "sideslip"), ("yaw_moment",)',
            "    def start(self, t, u):",
            *[pad + x for x in start],
            "    def advance(self, t, h, u):",
            *advance,
            "    def output(self, t, u):",
            f"        return 1.0 * ({output})",
        ]
        return "\n".join([*text, *law]) + "\n"


def program(seed: int) -> str:
    """Return the text of the program of a seed."""
    return Writer(seed).program()
