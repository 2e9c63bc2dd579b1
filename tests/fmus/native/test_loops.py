"""Loops over lists, arrays and iterators: native and Python runs give the same bits."""

from __future__ import annotations

import pytest

from .together import comparisons

LOOPS = {
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
    "enumerate from one": """
def output(self, t, u):
    total = 0.0
    for k, x in enumerate(u, start=1):
        total += k * x
    return (total,)
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
    "a variable changed on a path that breaks out": """
def output(self, t, u):
    x, found, passes = u[0], -1.0, 0
    while 0.01 < abs(x) < 1e6:
        passes += 1
        x *= 0.7
        if x < u[1]:
            found = x
            x = 100.0
            break
    return (x + found + passes,)
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
    "else of loops": """
def output(self, t, u):
    for x in u:
        if x > 0.5:
            break
    else:
        x = -3.0
    k = 0
    while k < 30:
        k += 1
        if k * u[0] > 9.0:
            break
    else:
        k = 99
    return (x + k,)
""",
    "continue": """
def output(self, t, u):
    total = 0.0
    for k in range(30):
        if k % 3 == 0 or u[0] * k > 8.0:
            continue
        total += u[1] / (k + 1)
    for x in u:
        if x < 0.0:
            continue
        total += x
    return (total,)
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
    return (sum(x * k for k, x in enumerate(flat)) + bisect_right([-0.5, 0.0, 0.5], u[1]),)
""",
    "any and all": """
def output(self, t, u):
    return (1.0 * any(x > 0.5 for x in u) + 2.0 * all(x > -0.5 for x in u) + 4.0 * (u[0] in (0.0, u[1])),)
""",
    "a step of many passes": """
def start(self, t, u):
    self.x, self.v = 1.0, 0.0
def advance(self, t, h, u):
    passes = max(1, math.ceil(h / 0.0007))
    part = h / passes
    for _ in range(passes):
        self.v -= part * (50.0 * self.x - u[0])
        self.x += part * self.v
def output(self, t, u):
    return (self.x,)
""",
}


@pytest.fixture(scope="module")
def compare(tmp_path_factory):
    with comparisons(LOOPS, "", tmp_path_factory.mktemp("laws")) as compare:
        yield compare


@pytest.mark.parametrize("name", LOOPS)
def test_loops_give_the_same_bits(name, compare):
    compare(name)
