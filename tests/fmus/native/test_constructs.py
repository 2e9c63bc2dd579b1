"""Every construct of the language that units use, translated and driven beside Python to the last bit."""

from __future__ import annotations

import pytest

from .together import comparisons

CONSTRUCTS = {
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
    "a store at an index of the state": """
def start(self, t, u):
    self.items = [0.0] * 4
    self.at = 0
def advance(self, t, h, u):
    self.items[self.at] = u[0]
    self.at = (self.at + 1) % 4
def output(self, t, u):
    return (self.items[self.at - 1] - 0.5 * self.items[self.at],)
""",
    "an index out of range": """
def start(self, t, u):
    self.at = 0
def advance(self, t, h, u):
    self.at += 1
def output(self, t, u):
    return ((1.0, 2.0, 3.0, u[0], u[1])[self.at],)
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
    "a list of the state with items of several kinds": """
def start(self, t, u):
    self.seen, self.both = [1e-3], []
def advance(self, t, h, u):
    self.seen.append(1)
    if len(self.seen) > 5:
        self.seen.pop(0)
    self.both.append(u[0] if u[1] > 0.0 else 0)
    self.both.append(u[1] > 0.3)
    if len(self.both) > 6:
        self.both.pop(0)
def output(self, t, u):
    last = self.both[-1] if self.both else 3
    return (self.seen[0] + 2.0 * math.copysign(1.0, -last) + len(self.both),)
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


BEFORE = """
WEIGHTS = {"first": 2, "third": -0.5}
SHARES = {"first": 2, "second": -0.5, "third": 0.0}


class Held:
    def __init__(self, x):
        self.x = x


class Other(Held):
    pass
"""


@pytest.fixture(scope="module")
def compare(tmp_path_factory):
    with comparisons(CONSTRUCTS, BEFORE, tmp_path_factory.mktemp("laws")) as compare:
        yield compare


@pytest.mark.parametrize("name", CONSTRUCTS)
def test_a_construct_gives_the_same_bits(name, compare):
    compare(name)
