"""Constructs that are not translated are refused in one sentence with file and line."""

from __future__ import annotations

import pytest

from yawbench.fmus.native.specialise import specialise
from yawbench.fmus.native.values import Refused

from .small import component_of, source

REFUSED = {
    "try": (
        "def output(self, t, u):\n    try:\n        return (u[0],)\n    finally:\n        pass",
        "Try is not translated",
        2,
    ),
    "a filter": (
        "def output(self, t, u):\n    return (sum(x for x in u if x > 0.0),)",
        "a filter that is only known at run time",
        2,
    ),
    "a state that output changes": (
        "def start(self, t, u):\n    self.n = 0.0\n"
        "def output(self, t, u):\n    self.n += u[0]\n    return (self.n,)",
        "output() changes the component's state",
        3,
    ),
    "an endless loop": (
        "def output(self, t, u):\n    x = u[0]\n    while True:\n        x += 1.0\n    return (x,)",
        "an endless loop",
        3,
    ),
    "a slice": (
        "def output(self, t, u):\n    return (sum(u[: self.p.count]),)",
        "a slice whose ends are only known at run time",
        2,
    ),
    "a list that grows in its loop": (
        "def output(self, t, u):\n    a = [u[0]]\n    for x in a:\n        a.append(x)\n    return (sum(a),)",
        "a list that changes its length during iteration",
        3,
    ),
    "what always fails": (
        "def output(self, t, u):\n    raise ValueError('never')",
        "output() fails for all inputs",
        1,
    ),
    "one list of two": (
        "def start(self, t, u):\n    self.a, self.b = [0.0], [1.0]\n"
        "def advance(self, t, h, u):\n    kept = self.a if u[0] > 0.5 else self.b\n    kept[0] += u[1]\n"
        "def output(self, t, u):\n    return (self.a[0] + self.b[0],)",
        "an object with two names is changed",
        3,
    ),
    "a state of very many numbers": (
        "def start(self, t, u):\n    self.a = [0.0] * 6000\n"
        "def advance(self, t, h, u):\n    self.a[int(t / h) % 6000] = u[0]\n"
        "def output(self, t, u):\n    return (self.a[17],)",
        "a state of 6000 numbers; at most 5000 are translated",
        1,
    ),
    "an iterator used up": (
        "def output(self, t, u):\n    z = zip(u, u)\n    a = list(z)\n    return (len(a) + len(list(z)),)",
        "an iterator that is used twice",
        4,
    ),
    "a function of another module": (
        "def output(self, t, u):\n    return (math.gamma(u[0]),)",
        "math.gamma",
        2,
    ),
    "an integer of 64 bits or a negative one": (
        "def output(self, t, u):\n    n = -1 if u[0] > 0.5 else 2**53\n    return (n,)",
        "an integer of 64 bits or another number",
        2,
    ),
    "an integer beyond 64 bits": (
        "def output(self, t, u):\n    return (math.sqrt(int(1e300) * int(u[0])),)",
        "an integer beyond 64 bits",
        2,
    ),
    "a number that may be True": (
        "def output(self, t, u):\n    n = u[0] > 0.5 if u[1] > 0.5 else 3\n    return (isinstance(n, bool),)",
        "a number that is True or False on some paths, another integer on others",
        3,
    ),
    "a text with a number that may be True": (
        "def output(self, t, u):\n    n = max(u[0] > 0.5, 3)\n    if n > u[1]:\n"
        "        raise ValueError(f'{n}')\n    return (n,)",
        "a number that is True or False on some paths, another integer on others",
        4,
    ),
    "a name of an inner function that is not set yet": (
        "def output(self, t, u):\n    x = u[0]\n    def f(y):\n        x = x + y\n        return x\n"
        "    return (f(u[1]),)",
        "x is read before the inner function sets it",
        4,
    ),
    "functions made by a generator expression": (
        "def output(self, t, u):\n    return (next(iter((lambda: x) for x in u))(),)",
        "functions or generators made by a generator expression",
        2,
    ),
    "an array that is passed on between passes": (
        "def output(self, t, u):\n    a = array('d', u)\n    for k in range(self.p.count):\n"
        "        a = array('d', a)\n    return (a[0],)",
        "an array that is passed on between steps or passes of a loop",
        3,
    ),
    "a long array": (
        "def output(self, t, u):\n    return (array('d', [0.0] * 5000)[int(u[0])],)",
        "an array of more than 4,096 numbers",
        2,
    ),
    "many long arrays": (
        "def output(self, t, u):\n    a = [array('d', [0.5] * 4000) for k in range(10)]\n"
        "    return (sum(x[int(u[0])] for x in a),)",
        "arrays of more than 32,768 numbers together",
        1,
    ),
    "arrays that are compared": (
        "def output(self, t, u):\n    return (array('d', u) == array('d', u),)",
        "comparing arrays",
        2,
    ),
    "a generator": (
        "def output(self, t, u):\n    return (sum(self.halves(u)),)\n"
        "def halves(self, u):\n    for x in u:\n        yield 0.5 * x",
        "halves is a generator",
        3,
    ),
}


@pytest.mark.parametrize("what", REFUSED)
def test_what_is_not_understood_is_refused_where_it_is(what, tmp_path):
    body, text, line = REFUSED[what]
    written = source(body)
    first = written[: written.index("def output" if body.startswith("def output") else "def start")].count(
        "\n"
    )
    with component_of(written, tmp_path) as (component, home), pytest.raises(Refused) as refused:
        specialise(component, home)
    assert text in refused.value.text
    assert refused.value.where == f"controllers/small.py:{first + line}"
