"""Checks of the arguments of the library's functions.

Public functions check their arguments here before they use them. A check returns the value as plain Python,
or raises TypeError (wrong kind) or ValueError (right kind, but not allowed) with a sentence that begins with
the argument's name.
"""

from __future__ import annotations

import contextlib
import inspect
import math
import os
from collections.abc import Callable, Iterable, Iterator, Mapping
from fractions import Fraction
from itertools import islice
from pathlib import Path
from typing import Any, NoReturn, TypeGuard, TypeVar, cast

import numpy as np

from yawbench.foundation.errors import ScenarioError, code_of
from yawbench.foundation.messages import listed, resolved, short, unprintable

MOST = 100_000
"""Largest count. Chosen: the limit on runs of an experiment."""

T = TypeVar("T")


def text(value: Any, name: str, *, empty: bool = False) -> str:
    """Return text without control characters; `empty`: allow the empty text."""
    converted = plain(value)
    if not isinstance(converted, str):
        refuse(name, "text", value)
    scalar(converted, name)
    if not (converted.strip() or (empty and not converted)):
        raise ValueError(f"{name}: must not be blank")
    return converted


def flag(value: Any, name: str) -> bool:
    """Return True or False."""
    converted = plain(value)
    return converted if isinstance(converted, bool) else refuse(name, "True or False", value)


def number(value: Any, name: str) -> float:
    """Return a finite number."""
    converted = plain(value)
    if isinstance(converted, bool) or not isinstance(converted, (int, float, Fraction)):
        refuse(name, "a number", value)
    try:
        result = float(converted)
    except OverflowError:
        result = math.inf
    if not math.isfinite(result):
        raise ValueError(f"{name}: must be a finite number (got {short(value)})")
    return result


def count(value: Any, name: str, *, least: int = 1, most: int = MOST) -> int:
    """Return a whole number from `least` to `most`."""
    converted = plain(value)
    if isinstance(converted, bool) or not isinstance(converted, int):
        refuse(name, "a whole number", value)
    if not least <= converted <= most:
        raise ValueError(f"{name}: must be a whole number from {least} to {most:,} (got {short(converted)})")
    return converted


def scalar(value: Any, name: str) -> float | int | bool | str:
    """Return a value allowed in a scenario: a number, True or False, or text."""
    converted = plain(value)
    if isinstance(converted, str):
        if bad := unprintable(converted):
            raise ValueError(f"{name}: must be text without {bad} (got {short(converted)})")
        return converted
    if not isinstance(converted, (int, float, Fraction)):  # a bool is an int
        refuse(name, "a number, True or False, or text", value)
    if isinstance(converted, bool):
        return converted
    finite = number(converted, name)
    return converted if isinstance(converted, int) else finite


def span(value: Any, name: str) -> tuple[float, float]:
    """Return start and end of a time span [s]."""
    ends = items(value, name, "a pair of times, (1.0, 3.0)")
    if len(ends) != 2:
        refuse(name, "a pair of times, (1.0, 3.0)", value)
    first, last = (number(end, f"{name}[{k}]") for k, end in enumerate(ends))
    if first > last:
        got = " to ".join(resolved(first, last))
        raise ValueError(f"{name}: must not end before it begins (got {got} s)")
    return first, last


def path(value: Any, name: str) -> Path:
    """Return a path or a name as a path."""
    if not names_file(value):
        refuse(name, "a name or a path", value)
    if "\0" in str(value) or not str(value).strip():
        raise ValueError(f"{name}: is not a valid file name (got {short(value)})")
    return Path(value)


def names_file(value: object) -> TypeGuard[str | Path]:
    """Return whether a value is text or a path."""
    return isinstance(value, (str, os.PathLike))


def items(value: Any, name: str, wanted: str, *, ordered: bool = True) -> list[Any]:
    """Return the items of an iterable, at most `MOST`: `itertools.count()` never ends; text is refused.

    Args:
        value, name: the argument.
        wanted: description of valid arguments, for messages.
        ordered: whether to refuse sets, too, as their order is arbitrary.
    """
    unfit = (str, bytes, bytearray, memoryview, Mapping, *((set, frozenset) if ordered else ()))
    is_single = isinstance(value, np.ndarray) and value.shape == ()
    if isinstance(value, unfit) or is_single or not isinstance(value, Iterable):
        refuse(name, wanted, value)
    entries = list(islice(value, MOST + 1))
    if len(entries) > MOST:
        raise ValueError(f"{name}: must have at most {MOST:,} items")
    return entries


def texts(value: Any, name: str, *, ordered: bool = True) -> list[str]:
    """Return a list of texts; a single text gives a list with one item."""
    if isinstance(value, str):
        return [text(value, name)]
    entries = items(value, name, "text, or a list of texts", ordered=ordered)
    return [text(entry, f"{name}[{k}]") for k, entry in enumerate(entries)]


def mapping(value: Any, name: str, wanted: str) -> dict[str, Any]:
    """Return a mapping whose keys are texts."""
    if not isinstance(value, Mapping):
        refuse(name, wanted, value)
    return {text(key, f"key {short(key)} of {name}"): entry for key, entry in value.items()}


def function(value: Any, name: str, *parameters: str) -> Callable[..., Any]:
    """Return a callable that accepts the positional arguments `parameters`."""
    wanted = f"a function of {listed(parameters)}"
    if not callable(value) or isinstance(value, type):
        refuse(name, wanted, value)
    with contextlib.suppress(ValueError):  # functions written in C may have no signature
        try:
            inspect.signature(value).bind(*parameters)
        except TypeError:
            refuse(name, wanted, value)
    return cast(Callable[..., Any], value)


def instance(value: Any, name: str, kind: type[T], made_by: str) -> T:
    """Return an object of one of the library's classes.

    Args:
        value, name: the argument.
        kind: the class.
        made_by: the function whose result it is, for messages.
    """
    return value if isinstance(value, kind) else refuse(name, f"what {made_by} returns", value)


@contextlib.contextmanager
def as_scenario_errors(origin: str = "") -> Iterator[None]:
    """Turn errors about values of a scenario into ScenarioError, prefixed with their origin."""
    try:
        yield
    except (TypeError, ValueError) as error:
        raise ScenarioError(f"{origin} {error}".lstrip(), code=code_of(error, "argument-invalid")) from None


def plain(value: Any) -> Any:
    """Return a NumPy scalar or a 0-d array as plain Python, anything else unchanged."""
    is_single = isinstance(value, (np.generic, np.ndarray)) and value.shape == ()
    is_single = is_single and value is not np.ma.masked
    return value.item() if is_single and value.dtype.kind in "biufU" else value  # no dates


def refuse(name: str, wanted: str, value: object) -> NoReturn:
    """Raise TypeError for an argument of the wrong kind."""
    raise TypeError(f"{name}: must be {wanted} (got {short(value)})")
