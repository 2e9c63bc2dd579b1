"""Objects with methods and state in components: native and Python runs give the same bits."""

from __future__ import annotations

import pytest

from .together import comparisons

OBJECTS = '''class Lane(NamedTuple):
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
WITH_OBJECTS = {
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
}


@pytest.fixture(scope="module")
def compare(tmp_path_factory):
    with comparisons(WITH_OBJECTS, OBJECTS, tmp_path_factory.mktemp("laws")) as compare:
        yield compare


@pytest.mark.parametrize("name", WITH_OBJECTS)
def test_objects_give_the_same_bits(name, compare):
    compare(name)
