"""Intermediate form between Python and C: typed variables with static single assignment.

Two exceptions: a variable in which the paths of an `If` join is assigned in both arms, and a loop-carried
variable before the loop and at the end of its body. Integers are stored as doubles, exact below 2^53, except
64-bit words.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field

REAL, INT, BOOL, EITHER, WORD, WIDE = "real", "int", "bool", "int or bool", "word", "wide"
"""Types. EITHER is True or False on some paths, another integer on others; a WORD is an unsigned 64-bit
integer, a WIDE an integer known only modulo 2^64."""

EXACT = 2**53
"""Smallest positive integer that may be a larger one, rounded to a double."""
ALONE = "Python alone computes"
"""Part of what a native library says where it gives up, and Python may go on."""
INEXACT = f"an integer of 2^53 or more, which {ALONE} exactly: set YAWBENCH_UNITS=python"
"""Error message of a native library for larger integers."""
COMPLEX = f"a complex number, with which {ALONE}: set YAWBENCH_UNITS=python"
"""Error message of a native library for complex powers."""
UNTRIED = f"no comparison with Python came here when this was built, and {ALONE}: set YAWBENCH_UNITS=python"
"""Error message of a native library for branches that were never compared with Python."""


class Refused(Exception):
    """Error: a construct of the component, named in the text, cannot be translated."""

    def __init__(self, text: str, where: str = "") -> None:
        super().__init__(text)
        self.text, self.where = text, where

    def __str__(self) -> str:
        return f"{self.text} ({self.where})" if self.where else self.text


@dataclass(frozen=True, eq=False)
class Var:
    """Variable, distinguished by identity."""

    name: str
    type: str

    def __repr__(self) -> str:
        return self.name


Operand = Var | bool | int | float
Part = str | tuple[Operand, str]
"""Part of a text: a literal, or a value with its format: "r" for `repr`, ".3g" for `:.3g`."""


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


@dataclass(frozen=True, eq=False)
class Array:
    """Array of real numbers in memory, which lasts until its function returns."""

    name: str
    length: int


@dataclass(frozen=True)
class Fetch:
    """target = array[index]."""

    target: Var
    array: Array
    index: Operand


@dataclass(frozen=True)
class Put:
    """array[index] = value."""

    array: Array
    index: Operand
    value: Operand


@dataclass(frozen=True)
class Digits:
    """count = number of characters of an integer's text, which are read by `Digit`."""

    count: Var
    value: Operand


@dataclass(frozen=True)
class Digit:
    """target = character at `index` of the text of `Digits`."""

    target: Var
    digits: Var
    index: Operand


@dataclass
class If:
    """Branch with two paths; `where` is the same for all branches of the same place in the component."""

    test: Var
    then: list[Statement] = field(default_factory=list)
    orelse: list[Statement] = field(default_factory=list)
    where: str = ""


@dataclass
class Loop:
    """Loop that ends at a `Leave`."""

    body: list[Statement] = field(default_factory=list)


@dataclass(frozen=True)
class Leave:
    """Leave the innermost loop if `test` is true."""

    test: Operand


@dataclass(frozen=True)
class Raise:
    """End the call with an exception of the type `kind`."""

    kind: str
    message: tuple[Part, ...]
    where: str


@dataclass(frozen=True)
class Push:
    """Append an item to a list of the state."""

    ring: int
    items: tuple[Operand, ...]


@dataclass(frozen=True)
class Replace:
    """Replace an item of a list of the state."""

    ring: int
    index: Operand
    items: tuple[Operand, ...]


@dataclass(frozen=True)
class Drop:
    """Remove the first item of a list of the state, or `every` item."""

    ring: int
    every: bool = False


@dataclass(frozen=True, eq=False)
class Outlined:
    """Outlined function, which depends only on numbers."""

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


Statement = (
    Let | Load | Fetch | Put | Invoke | Digits | Digit | If | Loop | Leave | Raise | Push | Replace | Drop
)


@dataclass(frozen=True)
class Function:
    """Function of a component: configure, start, advance or output.

    Attributes:
        body: its statements.
        stores: (place, value) of the values stored in the instance; a place is a C expression.
    """

    body: Sequence[Statement]
    stores: Sequence[tuple[str, Operand]]


def every(body: Sequence[Statement]) -> Iterator[Statement]:
    """Yield statements and all nested statements."""
    for s in body:
        yield s
        if isinstance(s, If):
            yield from every(s.then)
            yield from every(s.orelse)
        elif isinstance(s, Loop):
            yield from every(s.body)


def raises(body: Sequence[Statement]) -> bool:
    """Return whether statements always end with an exception."""
    last = body[-1] if body else None
    return isinstance(last, Raise) or (isinstance(last, If) and raises(last.then) and raises(last.orelse))


def thresholds(body: Sequence[Statement]) -> set[float]:
    """Return the constants with which statements, and the functions that they call, compare numbers."""
    found: set[float] = set()
    known: set[Outlined] = set()
    waiting = [body]
    while waiting:
        for s in every(waiting.pop()):
            if isinstance(s, Let) and s.op in ("lt", "le", "gt", "ge", "eq", "ne"):
                found |= {float(x) for x in s.operands if isinstance(x, (int, float)) and abs(x) < 1e12}
            elif isinstance(s, Invoke) and s.function not in known:
                known.add(s.function)
                waiting.append(s.function.body)
    return found


def arrays_of(body: Sequence[Statement]) -> list[Array]:
    """Return the arrays that statements fill."""
    return list(dict.fromkeys(s.array for s in every(body) if isinstance(s, Put)))


def type_of(value: Operand) -> str:
    """Return the type of a variable or constant."""
    if isinstance(value, Var):
        return value.type
    if isinstance(value, bool):
        return BOOL
    if isinstance(value, int):
        return INT if abs(value) < EXACT else WORD
    return REAL


def are_joined(types: Iterable[str]) -> bool:
    """Return whether one type holds the values of all: a whole number stays one, whose zero has no sign.

    Raises:
        Refused: integers of 64 bits and other numbers are among them.
    """
    every = set(types)
    if WORD in every and every != {WORD}:
        raise Refused("an integer of 64 bits or another number")
    if WIDE in every and every != {WIDE}:
        raise Refused("an integer beyond 64 bits is stored")
    return len({type == REAL for type in every}) == 1


def joined(types: Iterable[str]) -> str:
    """Return the type that holds the values of all, which `are_joined`."""
    every = set(types)
    return every.pop() if len(every) == 1 else EITHER
