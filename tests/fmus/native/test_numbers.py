"""Arithmetic, functions and comparisons of numbers, translated and driven beside Python to the last bit."""

from __future__ import annotations

import pytest

from .together import comparisons

NUMBERS = {
    "whole numbers of inputs that may be huge": """
def output(self, t, u):
    n = round(20.0 * u[0])
    return (3 * n + n // 2 - (n + 1) % 5,)
""",
    "rounding": """
def output(self, t, u):
    x = round(u[0] * 3.0)
    return (math.copysign(1.0, x) + x + int(u[1] * 5.0) + math.copysign(1.0, -round(0.3 * u[1])),)
""",
    "whole numbers": """
def start(self, t, u):
    self.n = self.p.count
def advance(self, t, h, u):
    self.n = (7 * self.n + 3) % 11 - self.n // 4
def output(self, t, u):
    return (self.n * math.copysign(1.0, 0 * -self.n) + self.n / 7 + u[0] // 0.3 + u[1] % -0.7,)
""",
    "sums": """
def output(self, t, u):
    a, b = u
    return (sum([a, b, 1e-9, -a]) + sum((a * a, b, a), 0.1) + sum(x for x in (b, a)) + sum([]),)
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
    "extremes and order": """
def output(self, t, u):
    a, b = u
    x, y, z = sorted([a, b, 0.1])
    return (x + 2.0 * y + 4.0 * z + max(a, b, 0.0) * 8.0 + min([a, -b]) + max(map(abs, u)) + min(1, a),)
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
    return (sum([1e16 * u[1], n, u[0], True]) + sum((n, 0.1, 0.2, 0.3, n if u[0] > 0.0 else u[1])),)
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
    return (sum(weighted) + sum(best) + math.copysign(0.5, rows[1][2]),)
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
}


@pytest.fixture(scope="module")
def compare(tmp_path_factory):
    with comparisons(NUMBERS, "", tmp_path_factory.mktemp("laws")) as compare:
        yield compare


@pytest.mark.parametrize("name", NUMBERS)
def test_arithmetic_gives_the_same_bits(name, compare):
    compare(name)
