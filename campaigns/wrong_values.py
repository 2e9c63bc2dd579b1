"""Values that no function of the library was made for, each with what it is."""

from __future__ import annotations

import math
from collections.abc import Callable
from decimal import Decimal
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np


def _pandas() -> Any:
    """Return pandas, which takes half a second of all who import this module."""
    import pandas

    return pandas


class Mute:
    """An object without anything."""


class Coloured:
    """An object whose text would do something to a terminal."""

    def __repr__(self) -> str:
        return "\x1b[31m\u202e red"


def _nested() -> list[Any]:
    inside: list[Any] = []
    for _ in range(3000):
        inside = [inside]
    return inside


def _itself() -> list[Any]:
    given: list[Any] = []
    given.append(given)
    return given


TEXTS: dict[str, Callable[[], Any]] = {
    "empty text": str,
    "blank text": lambda: " ",
    "number as text": lambda: "1.0",
    "nan as text": lambda: "nan",
    "1e400 as text": lambda: "1e400",
    "half a character": lambda: "\ud800",
    "text turned around": lambda: "\u202eabc",
    "zero byte": lambda: "a\0b",
    "escape sequence": lambda: "\x1b[31mred",
    "numpy text": lambda: np.str_("numpy text"),
    "path upwards": lambda: "../../../../nothing",
    "root": lambda: "/",
    "markup": lambda: "<script>$\\frac{$",
    "brackets": lambda: "(" * 3000,
    "minus one second": lambda: "-1 s",
    "one apple": lambda: "1 apple",
    "pattern": lambda: "*",
    "point": lambda: ".",
    "arrow": lambda: "a.b -> c.d -> e",
}
NUMBERS: dict[str, Callable[[], Any]] = {
    "zero": lambda: 0,
    "minus one": lambda: -1,
    "three": lambda: 3,
    "two and a half": lambda: 2.5,
    "minus one and a half": lambda: -1.5,
    "10**400": lambda: 10**400,
    "-10**400": lambda: -(10**400),
    "10**5000": lambda: 10**5000,
    "10**18": lambda: 10**18,
    "1e308": lambda: 1e308,
    "nan": lambda: math.nan,
    "inf": lambda: math.inf,
    "-inf": lambda: -math.inf,
    "numpy nan": lambda: np.float64("nan"),
    "numpy inf": lambda: np.float32("inf"),
    "numpy int": lambda: np.int64(-3),
    "numpy uint8": lambda: np.uint8(200),
    "numpy longdouble": lambda: np.longdouble("1e4000"),
    "array of no dimensions": lambda: np.array(-2.0),
    "fraction": lambda: Fraction(-1, 3),
    "huge fraction": lambda: Fraction(10**400),
}
OTHERS: dict[str, Callable[[], Any]] = {
    "None": lambda: None,
    "True": lambda: True,
    "False": lambda: False,
    "numpy True": lambda: np.True_,
    "complex": lambda: 1j,
    "numpy complex": lambda: np.complex128(1),
    "decimal": lambda: Decimal("1.0"),
    "decimal nan": lambda: Decimal("sNaN"),
    "array of 1 dimension": lambda: np.array([1.0]),
    "array of 2 dimensions": lambda: np.array([[1.0]]),
    "matrix 2x2": lambda: np.ones((2, 2)),
    "array of 3 dimensions": lambda: np.ones((1, 1, 1)),
    "empty array": lambda: np.array([]),
    "array of objects": lambda: np.array([None, {}], dtype=object),
    "object in an array": lambda: np.array({}, dtype=object),
    "array of records": lambda: np.zeros(1, dtype=[("a", float)]),
    "masked array": lambda: np.ma.masked,
    "date": lambda: np.datetime64("2020-01-01T00:00:00", "ns"),
    "time span": lambda: np.timedelta64(3, "ns"),
    "bytes": lambda: b"1",
    "bytearray": lambda: bytearray(b"1"),
    "memoryview": lambda: memoryview(b"1"),
    "memoryview of numbers": lambda: memoryview(np.array(1.0)),
    "object": object,
    "empty object": Mute,
    "coloured object": Coloured,
    "number as float()": lambda: type("Number", (), {"__float__": lambda self: 1.0})(),
    "path of bytes": lambda: type("Bytes", (), {"__fspath__": lambda self: b"/tmp"})(),
    "list": lambda: [1],
    "list of None": lambda: [None],
    "list of lists": lambda: [[1]],
    "list in itself": _itself,
    "nested list": _nested,
    "tuple": lambda: (1, 2, 3),
    "pair of texts": lambda: ("1.0", "2.0"),
    "pair of bytes": lambda: (b"1", b"2"),
    "pair turned around": lambda: (2.0, 1.0),
    "pair with nan": lambda: (0.0, math.nan),
    "pair of truths": lambda: (False, True),
    "list of a pair": lambda: [("a", 1)],
    "set": lambda: {1, 2},
    "set of texts": lambda: frozenset({"b", "a"}),
    "generator": lambda: (x for x in (None, 2)),
    "zip": lambda: zip(),
    "dict": lambda: {"a": 1},
    "dict of numbers": lambda: {1: 2},
    "dict of None": lambda: {None: None},
    "dict of tuples": lambda: {(): 1},
    "dict of halves": lambda: {"\ud800": 1},
    "class": lambda: int,
    "class of ours": lambda: Mute,
    "type": lambda: type,
    "lambda": lambda: lambda: None,
    "lambda of x": lambda: lambda x: x,
    "lambda of all": lambda: lambda *a, **k: None,
    "builtin": lambda: print,
    "builtin type method": lambda: str.join,
    "module": lambda: math,
    "ellipsis": lambda: ...,
    "not implemented": lambda: NotImplemented,
    "slice": lambda: slice(1, 2),
    "exception": lambda: ValueError("x"),
    "path": lambda: Path("nothing/of/this/name"),
    "path with a zero": lambda: Path("a\0b"),
    "path of half a character": lambda: Path("\ud800"),
    "link to nothing": lambda: Path("dangling"),
    "link to itself": lambda: Path("loop.yaml"),
    "link to a folder": lambda: Path("linked"),
    "device": lambda: Path("/dev/zero"),
    "series": lambda: _pandas().Series([None, 1]),
    "frame": lambda: _pandas().DataFrame({"a": [1]}),
    "pandas NA": lambda: _pandas().NA,
    "pandas NaT": lambda: _pandas().NaT,
    "file": lambda: open("/dev/null", "rb"),  # noqa: SIM115
}  # fmt: skip
WRONG = TEXTS | NUMBERS | OTHERS
"""Description of a value -> function that makes it, anew for every call."""


def plant_links(folder: Path) -> None:
    """Put the links that some of the values name into a folder."""
    (folder / "empty").mkdir()
    for name, target in (("dangling", "nowhere"), ("loop.yaml", "loop.yaml"), ("linked", "empty")):
        (folder / name).symlink_to(target)
