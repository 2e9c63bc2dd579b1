"""The language that units are written in, translated and driven beside Python: the same bits."""

from __future__ import annotations

import pytest

from .together import comparisons

BEFORE = '''
WEIGHTS = {"first": 2, "third": -0.5}
SHARES = {"first": 2, "second": -0.5, "third": 0.0}


class Held:
    def __init__(self, x):
        self.x = x


class Other(Held):
    pass


class Lane(NamedTuple):
    """A tuple with a property."""

    left: float
    right: float

    @property
    def middle(self):
        return 0.5 * (self.left + self.right)


class Base:
    factor = 3.0

    def __init__(self, x):
        self.x = x

    def value(self):
        return self.factor * self.x


class Filter(Base):
    def __init__(self, x, *, tau=0.1):
        super().__init__(x)
        self.tau = tau

    def see(self, x, h):
        self.x += h / (self.tau + h) * (x - self.x)

    def value(self):
        return super().value() + 1.0

    @classmethod
    def fast(cls, x):
        return cls(x, tau=0.001)
'''
LAWS = {
    # ---- numbers
    "whole numbers and rounding": """
def start(self, t, u):
    self.n = self.p.count
def advance(self, t, h, u):
    self.n = (7 * self.n + 3) % 11 - self.n // 4
def output(self, t, u):
    x, y = round(u[0] * 3.0), round(0.3 * u[1])
    n = self.n * math.copysign(1.0, 0 * -self.n) + self.n / 7 + u[0] // 0.3 + u[1] % -0.7
    return (n + math.copysign(1.0, x) + x + int(u[1] * 5.0) + math.copysign(1.0, -y) - (x + 1) % 5 + x // 2,)
""",
    "integers of 64 bits": """
def configure(self):
    state = 0xCBF29CE484222325
    for byte in f"{self.p.count}/noise".encode():
        state = ((state ^ byte) * 0x100000001B3) & (2**64 - 1)
    self.key = state
def start(self, t, u):
    self.n = 0
def advance(self, t, h, u):
    self.n += 1
def output(self, t, u):
    z = (self.key + (self.n + 1) * 0x9E3779B97F4A7C15) & (2**64 - 1)
    z = ((z ^ (z >> 30)) * 0xBF58476D1CE4E5B9) & (2**64 - 1)
    return (((z >> 12) + 0.5) * 2.0**-52,)
""",
    "exceptions of arithmetic": """
def output(self, t, u):
    a, b = u
    if b > 0.9:
        return (1.0 / (a - a),)
    if b > 0.8:
        return (math.sqrt(a - 2.0),)
    if b > 0.7:
        return (math.exp(1e4 * abs(a) + 800.0),)
    if b > 0.6:
        return (math.log(a - a),)
    if b > 0.5:
        return ((a - 2.0) ** 2 + (1e200 * a) ** 2,)
    return (math.asin(2.0 * a),)
""",
    "functions of mathematics": """
def output(self, t, u):
    a, b = u
    return (
        math.hypot(a, b) + math.dist((a, b, 1.0), (b, 2.0, a)) + math.atan2(a, b) + math.tanh(a)
        + math.degrees(b) + math.copysign(a, b) + math.floor(3.0 * a) + math.ceil(3.0 * b)
        + abs(a) ** 0.37 + a**3 + math.cosh(b),
    )
""",
    "a number that is whole on one path, real on another": """
def start(self, t, u):
    self.x, self.kept = 0, [1, 2.5, u[0]]
def advance(self, t, h, u):
    self.x = max(0, u[0])
    self.kept[int(3.0 * abs(u[1])) % 3] = 0 if u[0] > u[1] else -u[0]
def output(self, t, u):
    table = (0, 0.0, 3, -1.5)
    one = table[int(4.0 * abs(u[0])) % 4]
    n = 0 if u[1] > 0.0 else u[1]
    total = 0
    for k in range(20):
        if u[0] * k > 1.0:
            total -= u[0]
    if u[1] < -0.9:
        n //= max(0, -1.0 - u[1])
    return (
        math.copysign(1.0, -self.x) + 2.0 * math.copysign(1.0, self.p.count * one) + 4.0 * isinstance(n, int)
        + 8.0 * math.copysign(1.0, -n) + 16.0 * math.copysign(1.0, -total) + sum(self.kept)
        + 32.0 * math.copysign(1.0, -min(sorted([0, u[0], 0.0, u[1]]))) + math.hypot(n, one) + (not n),
    )
""",
    "integers that grow": """
def output(self, t, u):
    return (3.0 * round(20.0 * u[0]) ** 4 + round(u[1]) ** 0,)
""",
    "sums of whole and real numbers": """
def output(self, t, u):
    n = round(5.0 * u[0])
    rows = [1e16 * u[1], n, u[0], True], (n, 0.1, 0.2, 0.3, n if u[0] > 0.0 else u[1])
    return (sum(map(sum, rows)) + sum([*u, 1e-9, -u[0]]) + sum((u[0] * u[0], u[1]), 0.1) + sum([]),)
""",
    "the sign of zero": """
def output(self, t, u):
    x = 0.0 * u[0]
    whole = -(x > 1.0), 0.0 - abs(x), 0.0 - float(x > 1.0), -abs(int(x)), -self.p.count, 0 - self.p.on
    signs = math.copysign(1.0, +x), math.copysign(1.0, -x), *(math.copysign(1.0, n) for n in whole)
    return (sum(2.0**k * sign for k, sign in enumerate(signs)),)
""",
    "powers and logarithms": """
def output(self, t, u):
    a, b = u
    if b > 0.9:
        return (math.pow(a - a, -abs(b)),)
    if b > 0.8:
        return (math.pow(-2.0 - abs(a), b),)
    if b > 0.7:
        return (math.pow(1e200 * b, 2.0),)
    if b > 0.6:
        return ((a - a) ** -math.inf + (a - a) ** (-1e308 * (10.0 + b)),)
    if b > 0.5:
        return (math.log(2.0 + a, b - b + 1.0),)
    return (math.log(2.0 + a, 3) + math.pow(a + 3.0, b) + math.pow(a, 3),)
""",
    "comparisons with integers beyond 2^53": """
def start(self, t, u):
    self.n = -5
def advance(self, t, h, u):
    self.n += 1
def output(self, t, u):
    below = self.n < 2**60, self.n > -(2**60), u[0] < 2**70, u[0] == 10**20
    return (sum(below) + self.n,)
""",
    "decimals, nearness and division with a rest": """
def output(self, t, u):
    a, b = u
    if b > 0.9:
        return (sum(divmod(a, a - a)),)
    if b > 0.8:
        return (sum(divmod(self.p.count, self.p.count - 3)),)
    tenths = round(a, 1) + 3.0 * round(1e15 * b, 2) + 5.0 * round(self.p.count, 2) + round(0.5 * round(a), 0)
    eighth = round(0.125 * round(8.0 * a), 2)
    near = math.isclose(a, b, rel_tol=0.5), math.isclose(a, 0.0, abs_tol=0.3), math.isclose(a, math.inf)
    quotient, rest = divmod(a, -0.3)
    return (tenths + eighth + 2.0 * sum(near) + 7.0 * quotient + rest + sum(divmod(round(9 * b), -4)),)
""",
    "order by a key": """
def output(self, t, u):
    a, b = u
    rows = sorted([a, b, -a, 0.1], key=abs), sorted([a, 0, -0.0, b], reverse=True), sorted((3, -1), key=abs)
    best = min(a, b, key=abs), max([a, -a, b], key=lambda x: x * x), max((1.0, -1.0), key=abs)
    weighted = [sum(2.0**k * x for k, x in enumerate(row)) for row in rows]
    plain = max(a, b, 0.0), min([a, -b]), max(map(abs, u)), min(1, a)
    return (sum(weighted) + sum(best) + math.copysign(0.5, rows[1][2]) + sum(plain),)
""",
    "NaN among items": """
def output(self, t, u):
    x = math.nan if u[0] > 0.0 else u[0]
    y = 2.0 * x
    found = x in (0.5, x), y in [x, 0.5], [x, 1.0] == [x, 1], (y,) == (2.0 * x,), x == x
    return (sum(2.0**k * one for k, one in enumerate(found)),)
""",
    "order of numbers some of which are NaN": """
def output(self, t, u):
    a, b = u
    nan = math.nan if b > 0.0 else 0.0
    row = [a, b, -a, nan * a, 0.3, a + nan, 2.0 * b, 0.3]
    rows = sorted(row), sorted(row[:4]), sorted(row[1:4], reverse=True), sorted(row, key=lambda x: -x)
    plain = [-9.0 - k if x != x else x for row in rows for k, x in enumerate(row)]
    return (sum([1.1**k * x for k, x in enumerate(plain)]),)
""",
    "distances of constants": """
def output(self, t, u):
    return (u[0] * math.dist((0.0, 1.0), (3, 4)) + math.dist((u[0], 1), (True, u[1])),)
""",
    "truth values among numbers": """
def configure(self):
    self.second = True if self.p.mode == "second" else False
def output(self, t, u):
    a, b = u
    n = a > 0.0 if b > 0.0 else 3
    if b > 0.8:
        raise ValueError(f"{a > 0.5} and {self.second}")
    return (-n + abs(n) * 2 + math.copysign(1.0, -(n * 0)) + round(n) + max(n, a > b) + self.second,)
""",
    "chained comparisons": """
def output(self, t, u):
    a, b = u
    return (1.0 * (-0.5 < a <= b < 0.9) + 2.0 * (a == a == a) + 4.0 * (not a < b) + 8.0 * (a != 0.0),)
""",
    # ---- loops
    "a list changed while it is gone through": """
def start(self, t, u):
    self.a = [1.0, 2.0, 3.0]
    self.last = 0.0
def advance(self, t, h, u):
    for k, x in enumerate(self.a):
        if k < 2:
            self.a[k + 1] = 0.5 * x + u[0]
    for x in reversed(self.a):
        self.a[0] = 0.5 * x + u[1]
    for x, y in pairwise(self.a):
        self.a[2] = 0.5 * (x + y)
    for x, y in zip(self.a, chain(self.a, u)):
        self.a[1] = 0.3 * (x + y)
    self.a = [self.moved(x) for x in self.a]
    self.last = sum(self.moved(x) for x in self.a)
def moved(self, x):
    self.a[2] = 0.5 * x
    return x
def output(self, t, u):
    named = {"x": u[0], "y": u[1]}
    for _, x in named.items():
        named["y"] = 0.5 * x
    return (sum(self.a) + self.a[2] + self.last + named["y"],)
""",
    "items that are made as far as they are asked for": """
def start(self, t, u):
    self.n = 0
def counted(self, x):
    self.n += 1
    return x
def advance(self, t, h, u):
    self.n += 10 * any(self.counted(x) > 0.5 for x in u)
    self.n += 100 * all(self.counted(x * y) > 0.2 for x in u for y in (0.5, 1.0) if y)
    for x in (self.counted(x) for x in u):
        if x > 0.4:
            break
    for x in map(self.counted, u):
        if x > 0.3:
            break
    if 1 in (int(3.0 * self.counted(x)) for x in u):
        self.n += 1000
    self.n %= 100000
def output(self, t, u):
    factor = 1.0
    late = (x * factor for x in u)
    factor = u[1]
    return (self.n + sum(late) + any(math.sqrt(x + 4.0) > 2.05 for x in u),)
""",
    "else of a loop that leaves the loop around it": """
def output(self, t, u):
    total = 0.0
    for k in range(5):
        total += 1.0
        for x in (u[0], 0.5, u[1]):
            if x > 0.8:
                break
            total += x
        else:
            if u[0] < u[1]:
                break
            if k % 2:
                continue
            total += 10.0
        for x in range(20):
            if x > 10.0 * u[1]:
                break
        else:
            return (total,)
        total += 100.0
    return (total,)
""",
    "an array that loops of many passes fill": """
def configure(self):
    n = 20
    self.table = self.solved(n)
def solved(self, n):
    rows = array("d", [0.0] * (n * n))
    for i in range(n):
        for j in range(n):
            rows[i * n + j] = self.p.gain / (i + j + 1.0)
        rows[i * n + i] += 1 + self.p.on
    x = array("d", [1.0] * n)
    further = array("d", x)
    for sweep in range(30):
        largest = 0.0
        for i in range(n):
            rest = 0.0
            for j in range(n):
                if j != i:
                    rest += rows[n * i + j] * x[j]
            further[i] = (1.0 - rest) / rows[i * n + i] / 3.0
            largest = max(largest, abs(further[i] - x[i]))
        for i in range(n):
            x[i] = further[i]
        if largest < 1e-3:
            break
    return [value for value in x]
def start(self, t, u):
    self.last = 0.0
def advance(self, t, h, u):
    few = array("d", [u[0], u[1], True, 2])
    other = few if u[0] > 0.5 else array("d", few)
    other[-1] = 0.25 * u[1]
    k = int(8.0 * u[0])
    if abs(k) < 4:
        other[k] += 3
    few[2] -= u[0]
    self.last = sum(few) + sum(x * y for x, y in zip(few, u)) + len(few) + other[0] + bool(few)
def output(self, t, u):
    total = 0.0
    for x in array("d", self.table):
        total += x
    return (total + self.last + self.table[int(19.9 * abs(u[0])) % 20],)
""",
    "items of a list that grows are replaced": """
def start(self, t, u):
    self.table = []
    self.seen = 0
def advance(self, t, h, u):
    while len(self.table) < 12 + self.p.count:
        self.table.append((0.0, len(self.table)))
    place = self.seen % len(self.table)
    self.table[place] = (u[0], self.table[place - 1][1])
    self.table[-1] = (self.table[-1][0] + u[1], 2.0)
    self.seen += 1
def output(self, t, u):
    total = 0.0
    for k, x in self.table:
        total = 0.5 * total + k * x
    return (total,)
""",
    "a return within a loop": """
def output(self, t, u):
    return (self.halved(u[0]) + self.first(u),)
def halved(self, x):
    for k in range(40):
        x *= 0.5
        if abs(x) < 0.001:
            return x + k
    return -1.0
def first(self, u):
    for x in u:
        if x > 0.3:
            return x
    return 7.0
""",
    "loop variables that leak": """
def output(self, t, u):
    for k, x in enumerate((u[0], u[1], 3.0)):
        pass
    total = k + x
    for n in range(25):
        z = n * u[0]
        if z > 6.0:
            break
    rows = [k * x for k in range(3)]
    return (total + n + z + k + sum(rows),)
""",
    "zips, maps and chains": """
def output(self, t, u):
    rows = [[1.0, 2.0], [3.0, u[0]]]
    columns = zip(*rows, strict=True)
    products = [sum(map(mul, column, u)) for column in columns]
    flat = [*chain.from_iterable(rows), *reversed(products), *map(mul, u, repeat(3.0))]
    return (sum(x * k for k, x in enumerate(flat, start=1)) + bisect_right([-0.5, 0.0, 0.5], u[1]),)
""",
    # ---- objects
    "objects and inheritance": """
def start(self, t, u):
    self.filters = [Filter(u[0]), Filter.fast(u[1])]
    self.maybe = Filter(0.5) if self.p.on else None
def advance(self, t, h, u):
    for f, x in zip(self.filters, u, strict=True):
        f.see(x, h)
    if self.maybe is not None:
        self.maybe.see(u[0], h)
def output(self, t, u):
    extra = self.maybe.value() if self.maybe else -1.0
    return (self.filters[0].value() - self.filters[1].x + extra,)
""",
    "properties of tuples": """
def output(self, t, u):
    lane = Lane(u[0], u[1])
    wider = lane._replace(left=lane.left + 1.0)
    return (lane.middle + wider.middle * self.p.gain,)
""",
    # ---- all others
    "constants of the class that attributes cover": """
total, on, name, never = 0.5, False, "low", 3
def start(self, t, u):
    self.on = u[0] > 0.5
def advance(self, t, h, u):
    self.total += h * u[0]
    if u[1] > 0.9:
        self.name = "high"
def output(self, t, u):
    return (self.total + self.on + 10.0 * (self.name == "high") + self.never,)
""",
    "a list made longer in place": """
def output(self, t, u):
    a = [u[0]]
    b = a
    a += [u[1], 2.0]
    a *= 2
    return (sum(b) + len(b),)
""",
    "whether a switch is set": """
def output(self, t, u):
    on = u[0] > 0.5
    return ((on is True) + 2.0 * (on is not self.p.on) + 4.0 * (on is False),)
""",
    "del of an item": """
def start(self, t, u):
    self.queue = [(t, u[0])]
def advance(self, t, h, u):
    self.queue.append((t, u[0]))
    while len(self.queue) > 1 and self.queue[0][0] < t - 5.0 * h:
        del self.queue[0]
def output(self, t, u):
    return (self.queue[0][1] + len(self.queue),)
""",
    "a list that grows beyond any ring": """
def start(self, t, u):
    self.seen = []
    self.total = 0.0
def advance(self, t, h, u):
    self.seen.append((u[0], u[1]))
    self.total = 0.0
    if u[0] > 0.9:
        while self.seen:
            a, b = self.seen.pop(0)
            self.total += a * b
def output(self, t, u):
    return (self.total + len(self.seen),)
""",
    "names without a value, in a function and in those inside it": """
def output(self, t, u):
    for x in u:
        if x > 0.9:
            y = x
    if u[0] > 0.5:
        return (sum(y * k for k in (1.0, 2.0)),)
    if u[0] > 0.0:
        return (sum([y * k for k in (1.0, 2.0)]),)
    if u[0] > -0.5:
        return (y,)
    return ((lambda z: z + y)(0.5),)
""",
    "a list of the state gone through in pairs": """
def start(self, t, u):
    self.seen = [(t, 0.0)]
def advance(self, t, h, u):
    self.seen.append((t, u[0]))
    if len(self.seen) > 7:
        self.seen.pop(0)
def output(self, t, u):
    area = 0.0
    for (one, x), (other, _) in pairwise(self.seen):
        if x > 0.95:
            break
        area += x * (other - one)
    for time, x in self.seen:
        if x > u[1]:
            return (area + x,)
    return (area + self.seen[-1][1],)
""",
    "a store into a list on one path": """
def start(self, t, u):
    self.items = [0.0, 1.0, 2.0]
    self.same = self.items
def advance(self, t, h, u):
    if u[0] > 0.0:
        self.items[1] = u[0]
        if u[1] > 0.0:
            self.same[2] += u[1]
def output(self, t, u):
    return (sum(self.items) + self.same[1],)
""",
    "one of several numbers by a choice, returned from a loop": """
def output(self, t, u):
    for x in u:
        if x > 0.0:
            return (SHARES[self.p.mode],)
    return (0,)
""",
    "or and and as values": """
def output(self, t, u):
    a, b = u
    return ((a or b) + 2.0 * (a and b) + ((a > 0.0 and b) or 3.0) + (0.0 or self.p.gain),)
""",
    "closures": """
def configure(self):
    gain = self.p.gain
    def scaled(x, by=1.0):
        return gain * x * by
    self.law = scaled if self.p.on else (lambda x: x - gain)
def output(self, t, u):
    shift = u[1]
    moved = lambda x: x + shift
    shift = 2.0 * u[1]
    def twice(f, x):
        return f(f(x))
    return (twice(moved, self.law(u[0])),)
""",
    "functions made by a comprehension, which see its last names": """
def output(self, t, u):
    laws = [lambda x: x - k for k in (1.0, 2.0, u[0])]
    kept = [lambda x, k=k: x - k for k in (1.0, 2.0, u[0])]
    late = [(k * x for x in u) for k in (1.0, 3.0)]
    named = {k: (lambda x: x * k) for k in (5.0, 7.0)}
    return (laws[0](u[1]) + 2.0 * kept[1](3.0) + 4.0 * sum(late[0]) + 8.0 * named[5.0](0.3),)
""",
    "a dictionary of the module that is asked": """
def output(self, t, u):
    return (WEIGHTS.get(self.p.mode, u[0]) + WEIGHTS.get("second", u[1]),)
""",
    "an attribute of one of two objects": """
def start(self, t, u):
    self.one, self.other = Held(1.0), Held(u[0])
    self.count = 0
def advance(self, t, h, u):
    self.count += 1
    made = Held(u[0]) if u[1] > 0.0 else Other(u[1])
    made.x += 0.5
    self.one = made
def output(self, t, u):
    return (self.one.x + self.other.x,)
""",
    "the place of an item": """
def output(self, t, u):
    return ([1, 0.5, 3].index(0.5) + u[0] if u[0] < 0.9 else [1, 2].index(5),)
""",
    "a choice of laws": """
def configure(self):
    laws = {"first": math.sin, "second": math.cos, "third": self.third}
    self.law = laws[self.p.mode]
    self.table = (1.0, 2.0) if self.p.mode == "first" else (3.0, 4.0, 5.0)
@staticmethod
def third(x):
    return x * x
def output(self, t, u):
    return (self.law(u[0]) + len(self.table) + self.table[-1],)
""",
    "nothing or something": """
def start(self, t, u):
    self.last = None
def advance(self, t, h, u):
    if u[0] > 0.5:
        self.last = None
    elif self.last is None:
        self.last = (t, u[0])
def output(self, t, u):
    since, x = self.last or (t, 9.0)
    return (t - since + x,)
""",
    "an exception of its own": """
def configure(self):
    if self.p.gain > 2.2:
        raise ValueError(f"at most {2.2:g} (got {self.p.gain!r}, {self.p.gain:.3g} of {self.p.count})")
def output(self, t, u):
    if u[0] > 0.95:
        raise ValueError(f"a is {u[0]}: 100 % too large")
    return (u[0],)
""",
    "a list of what is always the same, and one of many numbers": """
def start(self, t, u):
    self.marks, self.rows = [], []
def advance(self, t, h, u):
    self.marks.append(1)
    self.rows.append(tuple(u[0] + k for k in range(20)))
    if len(self.marks) > 9:
        self.marks.pop(0)
        self.rows.pop(0)
def output(self, t, u):
    total = 0.0
    for row in self.rows:
        total += sum(row)
    return (len(self.marks) + total,)
""",
    "what is no index": """
def start(self, t, u):
    self.seen = [u[0]]
def advance(self, t, h, u):
    self.seen.append(u[1])
    if len(self.seen) > 3:
        self.seen.pop(0)
def output(self, t, u):
    if u[0] > 0.95:
        return ((1.0, 2.0)[int(1e30 * u[1])],)
    if u[0] > 0.9:
        return ((1.0, 2.0)[u[1]],)
    if u[0] > 0.8:
        return ([1.0, 2.0][max(0, u[1] - 2.0) if u[1] > 0.0 else u[1]],)
    if u[0] > 0.7:
        return (self.seen[u[1]],)
    total = 0
    for k in range(3 if u[0] < 0.6 else u[0]):
        total += k
    return (total,)
""",
    "taking apart": """
def start(self, t, u):
    self.pair, self.rest = (u[0], u[1]), [1.0, 2.0, 3.0]
def advance(self, t, h, u):
    first, *others = self.rest
    *self.rest, last = [*others, first + u[0], *self.pair][:4]
    self.pair = last, self.pair[0]
def output(self, t, u):
    (a, b), [c, *_] = self.pair, self.rest
    return (a + 2.0 * b + 4.0 * c,)
""",
    "an assignment in a condition": """
def output(self, t, u):
    if (x := u[0] - 0.2) > 0.0:
        return (x,)
    return (-2.0 * x if x else 5.0,)
""",
}


@pytest.fixture(scope="module")
def compare(tmp_path_factory):
    with comparisons(LAWS, BEFORE, tmp_path_factory.mktemp("laws")) as compare:
        yield compare


@pytest.mark.parametrize("name", LAWS)
def test_a_law_gives_the_same_bits(name, compare):
    compare(name)
