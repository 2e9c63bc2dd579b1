"""The intermediate form between a component in Python and C: typed variables, each assigned in one place.

A variable that both arms of an `If` assign is what the two paths join in; one that a loop carries is assigned
before it and at the end of its body. Integers are kept as doubles, exact up to 2^53, except words of 64 bits.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

REAL, INT, BOOL, WORD, WIDE = "real", "int", "bool", "word", "wide"
"""Types. A WORD is an integer of 64 bits without sign, a WIDE one known modulo 2^64 alone."""

EXACT = 2**53
"""Up to which an integer is exact as a double."""
INEXACT = "an integer beyond 2^53, which Python alone computes exactly: set YAWBENCH_UNITS=python"
"""Error of a native library whose integer becomes larger."""


@dataclass(frozen=True, eq=False)
class Var:
    """A variable, told apart by identity."""

    name: str
    type: str

    def __repr__(self) -> str:
        return self.name


Operand = Var | bool | int | float
Part = str | tuple[Operand, str]
"""Part of a text: as it is, or a value with its format: "r" as `repr`, ".3g" as `:.3g`."""


@dataclass(frozen=True)
class Let:
    """target = op(operands)."""

    target: Var
    op: str
    operands: tuple[Operand, ...]


@dataclass(frozen=True)
class Load:
    """target = table[index]."""

    target: Var
    table: tuple[Operand, ...]
    index: Operand


@dataclass(frozen=True)
class Digits:
    """count = number of characters of an integer's text; they are read by `Digit`."""

    count: Var
    value: Operand


@dataclass(frozen=True)
class Digit:
    """target = character at `index` of the text that `Digits` made."""

    target: Var
    digits: Var
    index: Operand


@dataclass
class If:
    """A branch: one of two paths is taken."""

    test: Var
    then: list[Statement] = field(default_factory=list)
    orelse: list[Statement] = field(default_factory=list)


@dataclass
class Loop:
    """A loop that ends at a `Leave`."""

    body: list[Statement] = field(default_factory=list)


@dataclass(frozen=True)
class Leave:
    """Leave the innermost loop if `test` holds."""

    test: Operand


@dataclass(frozen=True)
class Raise:
    """End the call as the exception `kind` does."""

    kind: str
    message: tuple[Part, ...]
    where: str


@dataclass(frozen=True)
class Push:
    """Append to the end of a list of the state."""

    ring: int
    items: tuple[Operand, ...]


@dataclass(frozen=True)
class Drop:
    """Take the first item off a list of the state; `every` one of them."""

    ring: int
    every: bool = False


@dataclass(frozen=True, eq=False)
class Outlined:
    """A function of its own: what it computes from numbers alone."""

    name: str
    parameters: tuple[Var, ...]
    body: tuple[Statement, ...]
    results: tuple[Operand, ...]


@dataclass(frozen=True)
class Invoke:
    """targets = function(operands)."""

    targets: tuple[Var, ...]
    function: Outlined
    operands: tuple[Operand, ...]


Statement = Let | Load | Invoke | Digits | Digit | If | Loop | Leave | Raise | Push | Drop


@dataclass(frozen=True)
class Function:
    """One of the four functions of a component.

    Attributes:
        body: its statements.
        stores: (place, value): what it leaves in the instance; a place is a C expression.
    """

    body: Sequence[Statement]
    stores: Sequence[tuple[str, Operand]]


def every(body: Sequence[Statement]) -> Iterator[Statement]:
    """Yield statements and all that are within them."""
    for s in body:
        yield s
        if isinstance(s, If):
            yield from every(s.then)
            yield from every(s.orelse)
        elif isinstance(s, Loop):
            yield from every(s.body)


def type_of(value: Operand) -> str:
    """Return the type of a variable or constant."""
    if isinstance(value, Var):
        return value.type
    if isinstance(value, bool):
        return BOOL
    if isinstance(value, int):
        return INT if abs(value) < EXACT else WORD
    return REAL


def joined(first: str, second: str) -> str:
    """Return the type that holds the values of both.

    Raises:
        ValueError: there is none.
    """
    if first == second:
        return first
    both = {first, second}
    if WIDE in both:
        raise ValueError("an integer beyond 64 bits is kept")
    if WORD in both:
        if REAL in both:
            raise ValueError("an integer of 64 bits or a real number")
        return WORD
    return REAL if REAL in both else INT
