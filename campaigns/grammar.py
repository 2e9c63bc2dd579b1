"""Templates of the random programs: expressions, conditions, lists and statements.

`<x>` is a number, `<y>` a short one, `<i>` an integer, `<c>` a condition, `<l>` a list of numbers, `<N>` a
constant; `<e>` is a number that uses the names `<v>` and `<w>`, which the template binds; `<a>` and `<b>` are
new variables. `    <block>` is a block of statements, `    <loop>` one within a loop that binds `<v>` and
`<w>`, and `    <body>` that of a function.
"""

from __future__ import annotations

BEFORE = '''
class Pair(NamedTuple):
    """Two numbers."""

    one: float
    two: float = 2

    @property
    def both(self):
        return self.one + self.two

    def scaled(self, by):
        return Pair(self.one * by, self.two * by)


@dataclass
class Kept:
    """Numbers that change."""

    level: float
    count: int = 0

    def raised(self, by, times=1):
        self.count += times
        self.level = 0.5 * (self.level + by)
        return self.level


class Base:
    """Class with a state, and a method that others replace."""

    FACTOR = 2

    def __init__(self, x, *rest, **named):
        self.x = x
        self.rest = [*rest, named.get("more", 1)]

    def of(self, y):
        return self.FACTOR * self.x - y

    @property
    def size(self):
        return len(self.rest) + self.of(1)

    @staticmethod
    def half(y):
        return y / 2

    @classmethod
    def made(cls, y):
        return cls(y, 3)


class Derived(Base):
    """Class that extends the other."""

    FACTOR = -1.5

    def __init__(self, x, *rest, **named):
        super().__init__(x, 0.5, *rest, **named)
        self.calls = 0

    def of(self, y):
        self.calls += 1
        return super().of(y) + self.calls


LIMIT, STEPS = 1.5, 4
TABLE = (0.0, 1, -2.5, 3.0, True)
ROWS = ((1, 2.5), (-3, 0.0), (True, 7))
WEIGHTS = {"first": 2, "second": -0.5, "third": 0.0}


def saturated(x, most=LIMIT):
    return max(-most, min(most, x))


def counted(x, *more, scale=1):
    total = 0
    for y in (x, *more):
        total += scale * y
    return total


def found(x, values):
    for k, y in enumerate(values):
        if y > x:
            return k
        if y == x:
            break
    else:
        return -1
    return x


'''
"""Classes, constants and functions that every program can use."""

Templates = tuple[tuple[float, str], ...]
"""Weights and templates."""

CONSTANTS = (
    "0", "1", "-1", "2", "3", "7", "-5", "10", "True", "False", "0.0", "-0.0", "0.5", "-0.5", "1.0", "1.5",
    "2.5", "-2.5", "0.3", "1e-3", "5e-324", "1e300", "100", "2**40", "2**53", "(2**53 + 1)", "-2**53",
    "10**6", "10**20", "math.inf", "math.nan", "math.pi",
)  # fmt: skip
RARE = (
    "5e-324", "1e300", "2**40", "2**53", "(2**53 + 1)", "-2**53", "10**20", "math.inf", "math.nan", "10**6",
)  # fmt: skip
"""Constants that are drawn once in ten times."""
CHOICES: dict[str, tuple[str, ...]] = {
    "op": ("+", "-", "*", "+", "-", "*", "/", "//", "%"),
    "cmp": ("<", "<=", ">", ">=", "==", "!="),
    "and": ("and", "or"),
    "k": ("2", "3", "-2", "-3", "7", "-7", "1", "10"),
    "bit": ("0", "1", "2", "3", "5"),
    "f": (
        "sin", "cos", "tan", "atan", "tanh", "fabs", "floor", "ceil", "trunc", "degrees", "radians", "isnan",
        "isinf", "isfinite", "sqrt", "asin", "acos", "exp", "expm1", "log", "log1p", "log10", "sinh", "cosh",
    ),
    "f2": ("atan2", "hypot", "fmod", "copysign", "pow", "log"),
    "as": ("float", "bool", "int", "abs", "round", "math.floor"),
    "best": ("min", "max"),
    "any": ("any", "all"),
    "mode_is": ("first", "second", "third"),
    "row": ("0", "1", "2", "-1"),
    "power": ("2", "3", "0", "-1", "-2", "0.5", "1.5", "2.0", "-0.5"),
    "format": ("", ":.3g", "!r", ":g"),
    "short_whole": ("<count>", "1", "2", "-3", "int(<y>)", "-1"),
    "at": ("0", "-1", "1", "2", "<i> % 2", "int(<y>) % 3"),
    "place": ("0", "-1", "1", "<i> % 2"),
    "times_of_while": ("3", "10", "25", "min(abs(<y>), 8)"),
    "leave": ("break", "continue"),
    "times": ("3", "20", "STEPS", "<count>", "1, 5", "len(u)", "5, 0, -2", "-2, 9, 3", "17"),
}  # fmt: skip
"""Words among which a placeholder is chosen."""

NUMBERS: Templates = (
    (10, "(<x> <op> <x>)"), (3, "(-<x>)"), (1, "(+<x>)"), (2, "abs(<x>)"), (1, "round(<x>)"), (1, "int(<x>)"),
    (3, "<best>(<x>, <x>)"), (1, "<best>([<x>, <x>, <y>])"), (2, "(<x> if <c> else <x>)"),
    (2, "(<x> <and> <x>)"), (3, "math.<f>(<x>)"), (2, "math.<f2>(<x>, <x>)"), (1, "(<x> ** <power>)"),
    (0.3, "(<x> ** <y>)"), (1.5, "<as>(<x>)"), (1, "<c>"), (2, "<i>"), (0.5, "(<v> if (<v> := <x>) else 3)"),
    (0.5, "[<x>, 1][<c>]"), (0.5, "saturated(<x>)"), (0.5, "saturated(<x>, <y>)"), (2, "<call>"),
    (0.5, "counted(<x>, <y>, scale=<y>)"), (0.5, "(lambda z, w=<y>: z - w)(<x>)"), (0.5, "counted(*<l>)"),
    (0.5, "found(<x>, <l>)"), (0.4, "Pair(<x>, <y>).both"), (0.4, "Pair(<x>)[1]"),
    (0.4, "sum(Pair(<x>, <y>))"), (0.4, "max(Pair(two=<x>, one=<y>))"), (0.4, "Kept(<x>).raised(<y>)"),
    (0.4, "Kept(<x>, 2).count"), (0.4, "Pair(<x>, <y>)._replace(one=1).one"),
    (0.4, "Pair(<x>, <y>).scaled(<y>).both"), (0.4, "Base(<x>).of(<y>)"), (0.4, "Derived(<x>, <y>).of(<y>)"),
    (0.4, "Derived(<x>, more=<y>).size"), (0.4, "Base.half(<x>)"), (0.4, "Derived.made(<x>).of(<y>)"),
    (0.4, "sum(Derived(<x>, <y>).rest)"), (0.4, "TABLE[<i> % 5]"), (0.4, "ROWS[<i> % 3][<i> % 2]"),
    (0.4, "ROWS[<row>][1]"), (0.3, "TABLE[<i>]"), (0.4, "WEIGHTS[<mode>]"),
    (0.4, "WEIGHTS.get('<mode_is>', <x>)"), (0.4, "{'p': <x>, 'q': <y>}['q']"),
    (0.4, "sum(v * <y> for v in WEIGHTS.values())"), (0.3, "len(<mode>)"), (0.3, "isinstance(<x>, float)"),
    (0.3, "isinstance(<x>, int)"), (0.3, "[<x>, <y>, <y>][-1:0:-1][0]"),
    (0.3, "[[<x>, <y>], [1, <y>]][1][-1]"), (0.4, "math.isclose(<x>, <y>)"),
    (0.2, "math.isclose(<x>, <y>, rel_tol=0.1, abs_tol=0.01)"), (0.4, "round(<x>, 2)"),
    (0.4, "sum(divmod(<x>, <y>))"), (0.2, "math.dist((<x>, <y>), (1, <y>))"),
    (0.3, "<best>((<x>, <y>), key=abs)"), (0.2, "<best>(<l>, key=lambda z: -z)"), (0.2, "float('nan')"),
    (1, "sum(<l>)"), (0.4, "sum(<l>, 0.5)"), (0.4, "len(<l>)"), (0.5, "<best>(<l>)"), (0.4, "sorted(<l>)[0]"),
    (0.2, "sorted(<l>, reverse=True)[0]"), (0.2, "sorted(<l>, key=abs)[-1]"), (0.05, "math.fsum(<l>)"),
    (0.5, "sum(<e> for <v> in <l>)"), (0.5, "sum([<e> for <v> in <l>])"), (0.4, "<any>(<e> for <v> in <l>)"),
    (0.4, "<any>([<e> for <v> in <l>])"), (0.3, "sum(<v> * k for k, <v> in enumerate(<l>, 1))"),
    (0.3, "<best>(<e> for <v> in reversed(<l>))"), (0.3, "sum(<v> * <w> for <v>, <w> in zip(<l>, TABLE))"),
    (0.3, "(<y> in <l>)"), (0.3, "sum(sorted(<l>)[:2])"), (0.3, "sum(<l>[::-1])"),
    (0.3, "sum(map(abs, <l>))"), (0.3, "sum(math.copysign(1, <v>) for <v> in <l>)"), (0.3, "math.prod(<l>)"),
    (0.3, "sum(<l>[1:])"), (0.3, "sum(<e> for <v> in <l> for <w> in (0, 1.5))"),
    (0.05, "sum(<e> for <v> in <l> if <c>)"), (0.3, "sum(<e> for k, <v> in enumerate(<l>) if k % 2)"),
    (0.3, "[f(<y>) for f in (abs, math.floor)][1]"),
    (0.3, "[lambda z, <v>=<v>: z - <v> for <v> in TABLE][1](<x>)"), (0.05, "list(<l>).index(<y>)"),
    (0.3, "[lambda z: z - <v> for <v> in TABLE][0](<x>)"),
    (0.05, "next((<v> for <v> in <l> if <v> > 0), <y>)"), (0.5, "<a_list>[<place>]"),
)  # fmt: skip
INTEGERS: Templates = (
    (3, "int(<y>)"), (2, "round(<y>)"), (2, "<count>"), (1, "len(<l>)"), (2, "(<i> // <k>)"),
    (2, "(<i> % <k>)"), (2, "(<i> + <i>)"), (2, "(<i> - <i>)"), (1, "(<i> * <k>)"), (0.5, "(<i> * <i>)"),
    (0.05, "(<i> & <bit>)"), (0.05, "(<i> | <bit>)"), (0.05, "(<i> ^ <i>)"), (0.05, "(<i> >> <bit>)"),
    (0.05, "(<i> << <bit>)"), (0.05, "(~<i>)"), (1, "int(<c>)"), (1, "math.floor(<y>)"),
    (1, "math.ceil(<y>)"), (1, "(-<i>)"), (1, "abs(<i>)"), (0.5, "<best>(<i>, <i>)"),
    (0.5, "(<i> if <c> else <i>)"), (0.3, "(<i> ** 2)"), (0.3, "int(<y> * 1e16)"),
    (0.3, "(int(<y>) * 2**50)"), (0.3, "(<c> + <c>)"), (0.05, "(<c> & <c>)"), (0.3, "(<i> and <i>)"),
)  # fmt: skip
CONDITIONS: Templates = (
    (9, "(<x> <cmp> <x>)"), (3, "(<x> <cmp> <x> <cmp> <y>)"), (2, "(not <x>)"), (2, "(<c> <and> <c>)"),
    (1, "<on>"), (1, "(<mode> == '<mode_is>')"), (1, "(<y> in (0, 1.0, 0.5))"), (1, "bool(<x>)"),
    (1, "(<i> <cmp> <i>)"), (0.5, "(<mode> in ('first', 'third'))"), (0.3, "(<mode> <cmp> '<mode_is>')"),
    (0.05, "(<y> is None)"), (0.3, "((<x>, <y>) == (1, <y>))"), (0.05, "((<x>, <y>) < (1, <y>))"),
    (0.3, "(<c> is True)"), (0.3, "isinstance(<y>, bool)"), (0.3, "(<y> not in TABLE)"),
    (0.5, "(<i> % 2 == 0)"), (0.3, "(<c> != <c>)"),
)  # fmt: skip
LISTS: Templates = (
    (2, "[<y>, <y>, <y>]"), (2, "(<y>, <y>, <y>)"), (1, "[<y>, <y>, <y>][1:]"), (1, "TABLE[1:]"),
    (0.5, "TABLE[-3:]"), (0.5, "TABLE[::2]"), (0.5, "[*TABLE[:2], <y>]"), (0.5, "([<y>] * 3)"),
    (0.5, "ROWS[<row>]"), (1, "u"), (0.3, "[x for row in ROWS for x in row]"), (0.3, "tuple(TABLE)"),
    (0.3, "list(range(4))"),
)  # fmt: skip
STATEMENTS: Templates = (
    (8, "<a> = <x>"), (1, "<a> = <i>"), (1, "<a> = <c>"), (4, "<own> <op>= <x>"), (3, "<own> = <x>"),
    (1, "<a>, <b> = <x>, <x>"), (0.5, "<a>, <b> = Pair(<x>)"), (0.5, "<a> = <b> = <x>"),
    (0.5, "<a>, *rest_<b> = [<y>, <y>, <y>]\n<b> = sum(rest_<b>)"), (0.5, "(<a>, <b>), _ = (<y>, <x>), 3"),
    (1, "<new_list> = [<x>, <x>, <y>]"), (0.5, "<new_list> = [<y>] * 3"),
    (0.5, "<new_list> = [<e> for <v> in (1, 0, -2.5)]"), (0.5, "<new_list> = [<e> for <v> in range(3)]"),
    (0.5, "<new_list> = sorted([<x>, <x>, <y>])"), (0.5, "<new_list> = list(u) + [<y>]"),
    (2, "<list>[<at>] = <x>"), (1, "<list>[<at>] <op>= <x>"), (0.5, "<list>.reverse()"),
    (0.5, "<list>[0], <list>[1] = <list>[1], <list>[0]"), (0.1, "<list>.append(<list>.pop(0))"),
    (0.3, "<list>.append(<x>)\ndel <list>[1]"), (0.3, "<list>.insert(0, <x>)\n<list>.pop()"),
    (0.05, "<list>[1:] = [<y>, <x>]"), (0.05, "<list>.sort()"), (0.3, "<list> += [<x>]\n<a> = <list>.pop()"),
    (0.3, "<a> = <list>\n<a>[0] = <x>\n<a> = 3 * <a>[1]"),
    (0.3, "for k, <v> in enumerate(<list>):\n    <list>[k] = <e>"),
    (0.4, "array_<a> = array('d', [<x>, <y>, <x>])\narray_<a>[<at>] = <x>\n<a> = sum(array_<a>)"),
    (0.3, "array_<a> = array('d', [<y>] * 20)\nfor <v> in range(20):\n    array_<a>[<v>] += <e>\n"
     "<a> = array_<a>[<place>] + max(array('d', array_<a>))"),
    (0.3, "array_<a> = array('d', <l>)\nif <c>:\n    array_<a>[<place>] = <x>\n<a> = array_<a>[0]"),
    (0.1, "r<a> = [[<y>, 1], [2, <y>]]\nr<a>[<i> % 2][0] = <x>\n<a> = r<a>[0][0] + sum(r<a>[1])"),
    (0.2, "r<a> = [[0, 1.0]] * 2\nr<a>[0][0] = <x>\n<a> = r<a>[1][0]"),
    (0.4, "k<a> = Kept(<x>)\nif <c>:\n    k<a>.raised(<y>)\n<a> = k<a>.level + k<a>.count"),
    (0.3, "k<a> = Kept(<x>)\nl<a> = k<a> if <c> else Kept(0.5)\n<a> = l<a>.raised(<y>) + k<a>.level"),
    (0.4, "o<a> = Derived(<x>) if <c> else Base(<y>)\n<a> = o<a>.of(<y>) + o<a>.of(1)"),
    (0.4, "d<a> = {'p': <x>, 'q': 0}\nd<a>['q'] += <y>\nd<a>['r'] = 1\n<a> = sum(d<a>.values())"),
    (0.3, "n<a> = None\nif <c>:\n    n<a> = <x>\n<a> = 0 if n<a> is None else n<a>"),
    (0.4, "if <c>:\n    raise ValueError(f\"\"\"{<y><format>} and {<i>}, {<c>}\"\"\")"),
    (0.2, "if <c>:\n    raise RuntimeError('at ' + <mode>)"), (0.05, "assert <c>, 'no'"),
    (0.05, "try:\n    <a> = <x>\nexcept ArithmeticError:\n    <a> = 0"),
    (0.05, "match <i>:\n    case 1:\n        <a> = <x>\n    case _:\n        <a> = 2"),
    (0.1, "del_<a> = <x>\n<a> = 2 * del_<a>\ndel del_<a>"),
)  # fmt: skip
BLOCKS: Templates = (
    (3, "if <c>:\n    <block>"), (3, "if <c>:\n    <block>\nelse:\n    <block>"),
    (2, "if <c>:\n    <block>\nelif <c>:\n    <block>\nelse:\n    <block>"),
    (1, "if <c>:\n    <block>\nelif <c>:\n    <block>"), (1, "for <v> in <l>:\n    <loop>"),
    (1, "for <v> in range(<times>):\n    <loop>"), (0.5, "for <v> in <l>:\n    <loop>\nelse:\n    <block>"),
    (0.5, "for <v>, <w> in enumerate(<l>, start=1):\n    <loop>"),
    (0.5, "for <v>, <w> in zip(<l>, TABLE):\n    <loop>"), (0.5, "for <v> in reversed(<l>):\n    <loop>"),
    (0.5, "for <v>, <w> in pairwise(<l>):\n    <loop>"), (0.7, "for <v> in range(<i> % 7):\n    <loop>"),
    (0.5, "for <v>, <w> in ROWS:\n    <loop>"), (0.3, "for <v>, <w> in ((<y>, 1), (2.5, <y>)):\n    <loop>"),
    (0.3, "for k, (<v>, <w>) in enumerate(ROWS):\n    <loop>"),
    (0.3, "for <w>, <v> in WEIGHTS.items():\n    <w> = len(<w>)\n    <loop>"),
    (1, "<v> = 0\nwhile <v> < <times_of_while>:\n    <v> += 1\n    <loop>"),
    (0.5, "<v> = 0\nwhile <v> < <times_of_while>:\n    <v> += 0.5\n    <loop>\nelse:\n    <block>"),
    (0.5, "<v> = 0\nwhile <c> and <v> < 12:\n    <v> += 1\n    <loop>"),
    (0.5, "<v> = 9\nwhile True:\n    <v> -= 1\n    if <v> < 0 or <c>:\n        break\n    <loop>"),
    (0.3, "<a> = 0\nfor <v> in range(3):\n    for <w> in (1, <y>):\n        if <c>:\n"
     "            <leave>\n        <a> += <e>\n    else:\n        <a> -= 1"),
    (1, "def <function>(<v>, <w>=<N>):\n    <body>"),
    (0.5, "def <function>(<v>, *<w>_s):\n    <w> = len(<w>_s)\n    <body>"),
    (0.2, "held_<a> = [<x>]\ndef <function>(<v>, <w>=1):\n    held_<a>[0] = <v>\n    <body>"),
    (0.05, "<a> = <x>\ndef <function>(<v>, <w>=1):\n    nonlocal <a>\n    <a> += <v>\n    <body>"),
)  # fmt: skip
"""Statements with blocks."""
LEAVES: Templates = (
    (1, "if <c>:\n    break"), (1, "if <c>:\n    continue"), (0.1, "break"),
)  # fmt: skip
"""Statements of loops."""
CHANGES: Templates = (
    (4, "self.x = <x>"), (2, "self.n = <i>"), (2, "self.n += <k>"), (2, "self.x <op>= <x>"),
    (1, "self.lit = <c>"), (2, "self.items[<at>] = <x>"), (1, "self.items[self.n % 3] <op>= <x>"),
    (1, "self.items = [*self.items[1:], <x>]"), (1, "self.pair = Pair(<x>, <x>)"),
    (1, "self.kept.raised(<x>)"), (1, "self.kept.level = <x>"),
    (1, "self.last = (<y>, <y>) if <c> else None"),
    (1, "self.seen.append(<y>)\nif len(self.seen) > 5:\n    self.seen.pop(0)"),
    (0.5, "self.seen.append(<x>)\nwhile len(self.seen) > 3:\n    del self.seen[0]"),
    (0.1, "self.grid[<i> % 2][<i> % 2] = <x>"),
    (0.5, "self.grid[0], self.grid[1] = self.grid[1], self.grid[0]"), (0.5, "self.grid[1] = [<x>, <y>]"),
    (0.5, "self.one = Derived(<x>) if <c> else Base(<y>)"), (0.5, "self.one.x += <y>"),
    (0.5, "self.one.of(<y>)"), (0.4, "self.named['<mode_is>'] = <x>"),
    (0.4, "self.law = math.sin if <c> else abs"), (0.3, "self.other.level = <x>"),
    (0.3, "self.other = self.kept if <c> else Kept(<y>)"), (0.3, "self.n = (self.n + 1) % 5"),
    (0.3, "self.n = min(9, max(-9, self.n + <i>))"),
)  # fmt: skip
"""Changes of the state."""
STATE = (
    "self.x", "self.x", "self.n", "self.lit", "self.pair.one", "self.kept.level", "self.kept.count",
    "self.items[1]", "self.items[-1]", "self.seen[-1]", "(self.last or (0, 1.5))[1]", "sum(self.items)",
    "self.grid[1][0]", "self.one.x", "self.named['second']", "len(self.seen)", "self.law(0.5)",
    "self.other.level", "self.doubled", "self.moved(<y>)",
)  # fmt: skip
"""Numbers of the state."""
START = """
self.x = <x>
self.n = <i>
self.lit = <c>
self.items = [0.0, <x>, 1]
self.pair = Pair(<y>)
self.kept = Kept(<x>)
self.other = Kept(1)
self.last = None
self.seen = [<x>]
self.grid = [[<y>, 0], [1, 2.0]]
self.one = Base(<y>)
self.named = {"first": 0, "second": <y>, "third": 1.5}
self.law = abs
"""
