"""Checks of the arguments of the library's functions.

Public functions check their arguments here before they use them. A check returns the value as plain Python,
or raises TypeError (wrong kind) or ValueError (right kind, but not allowed) with a sentence that begins with
the argument's name. Methods of the value itself are not trusted: only its type counts, text and bytes are
never numbers, and iterators are read up to a limit.
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
"""Largest number of items of an argument. Chosen: the limit on runs of an experiment."""

LONGEST = 1000
"""Largest length of a name or a title. Chosen: longer than any sentence."""
NAME = 255
"""Largest length of a file name [bytes] that file systems allow."""

T = TypeVar("T")


def text(value: Any, name: str, *, empty: bool = False) -> str:
    """Return text without control characters; `empty`: allow the empty text."""
    converted = plain(value)
    if not is_a(converted, str):
        refuse(name, "text", value)
    if bad := unprintable(converted):
        raise ValueError(f"{name}: must be text without {bad} (got {short(converted)})")
    if not (converted.strip() or (empty and not converted)):
        raise ValueError(f"{name}: must not be blank")
    if len(converted) > LONGEST:
        raise ValueError(f"{name}: must be text of at most {LONGEST} characters (got {short(converted)})")
    return cast(str, converted)


def flag(value: Any, name: str) -> bool:
    """Return True or False."""
    converted = plain(value)
    return cast(bool, converted) if is_a(converted, bool) else refuse(name, "True or False", value)


def number(value: Any, name: str) -> float:
    """Return a finite number."""
    converted = plain(value)
    if is_a(converted, bool) or not is_a(converted, int, float, Fraction):
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
    if is_a(converted, bool) or not is_a(converted, int):
        refuse(name, "a whole number", value)
    if not least <= converted <= most:
        raise ValueError(f"{name}: must be a whole number from {least} to {most:,} (got {short(converted)})")
    return cast(int, converted)


def scalar(value: Any, name: str) -> float | int | bool | str:
    """Return a value allowed in a scenario: a number, True or False, or text."""
    converted = plain(value)
    if is_a(converted, bool):
        return cast(bool, converted)
    if is_a(converted, str):
        if bad := unprintable(converted):
            raise ValueError(f"{name}: must be text without {bad} (got {short(converted)})")
        return cast(str, converted)
    if is_a(converted, int, float, Fraction):
        finite = number(converted, name)
        return cast(int, converted) if is_a(converted, int) else finite
    refuse(name, "a number, True or False, or text", value)


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
    converted = plain(value)
    if is_a(value, os.PathLike):
        try:
            converted = os.fspath(value)
        except Exception as error:
            raise TypeError(f"{name}: is not a valid path: {error_text(error)}") from error
    if not is_a(converted, str):
        refuse(name, "a name or a path", value)
    try:
        longest = max((len(os.fsencode(part)) for part in Path(converted).parts), default=0)
    except UnicodeEncodeError:
        raise ValueError(f"{name}: is not a valid file name (got {short(converted)})") from None
    if "\0" in converted or not converted.strip() or longest > NAME:
        raise ValueError(f"{name}: is not a valid file name (got {short(converted)})")
    return Path(converted)


def names_file(value: object) -> TypeGuard[str | Path]:
    """Return whether a value is text or a path."""
    return is_a(value, str, os.PathLike)


def items(value: Any, name: str, wanted: str, *, ordered: bool = True) -> list[Any]:
    """Return the items of an iterable, at most `MOST`; text, bytes and mappings are refused.

    Args:
        value, name: the argument.
        wanted: description of valid arguments, for messages.
        ordered: whether to refuse sets, too, as their order is arbitrary.
    """
    unfit: tuple[type, ...] = (str, bytes, bytearray, memoryview, Mapping)
    unfit += (set, frozenset) if ordered else ()
    if is_a(value, *unfit) or not is_a(value, Iterable, np.ndarray) or _is_single(value):
        refuse(name, wanted, value)
    try:
        entries = list(islice(iter(value), MOST + 1))
    except Exception as error:
        raise TypeError(f"{name}: must be {wanted}, but cannot be read: {error_text(error)}") from error
    if len(entries) > MOST:
        raise ValueError(f"{name}: must have at most {MOST:,} items")
    return entries


def texts(value: Any, name: str, *, ordered: bool = True) -> list[str]:
    """Return a list of texts; a single text gives a list with one item."""
    if is_a(plain(value), str):
        return [text(value, name)]
    entries = items(value, name, "text, or a list of texts", ordered=ordered)
    return [text(entry, f"{name}[{k}]") for k, entry in enumerate(entries)]


def mapping(value: Any, name: str, wanted: str) -> dict[str, Any]:
    """Return a mapping whose keys are texts."""
    if not is_a(value, Mapping):
        refuse(name, wanted, value)
    try:
        pairs = list(islice(value.items(), MOST + 1))
        entries = [(key, entry) for key, entry in pairs]
    except Exception as error:
        raise TypeError(f"{name}: must be {wanted}, but cannot be read: {error_text(error)}") from error
    if len(entries) > MOST:
        raise ValueError(f"{name}: must have at most {MOST:,} keys")
    return {text(key, f"key {short(key)} of {name}"): entry for key, entry in entries}


def function(value: Any, name: str, *parameters: str) -> Callable[..., Any]:
    """Return a callable that accepts the positional arguments `parameters`."""
    wanted = f"a function of {listed(parameters)}"
    if not callable(value) or is_a(value, type):
        refuse(name, wanted, value)
    try:
        inspect.signature(value).bind(*parameters)
    except TypeError:
        refuse(name, wanted, value)
    except Exception:  # functions written in C may have no signature
        return cast(Callable[..., Any], value)
    return cast(Callable[..., Any], value)


def instance(value: Any, name: str, kind: type[T], made_by: str) -> T:
    """Return an object of one of the library's classes.

    Args:
        value, name: the argument.
        kind: the class.
        made_by: the function whose result it is, for messages.
    """
    if not is_a(value, kind):
        refuse(name, f"what {made_by} returns", value)
    return cast(T, value)


@contextlib.contextmanager
def as_scenario_errors(origin: str = "") -> Iterator[None]:
    """Turn errors about values of a scenario into ScenarioError, prefixed with their origin."""
    try:
        yield
    except (TypeError, ValueError) as error:
        raise ScenarioError(f"{origin} {error}".lstrip(), code=code_of(error, "argument-invalid")) from None


def plain(value: Any) -> Any:
    """Return a NumPy scalar, a 0-d array or an instance of a subclass as plain Python.

    Objects other than numbers, text, True and False are returned unchanged.
    """
    if is_a(value, np.generic, np.ndarray) and value.shape == ():
        makes = {"b": bool, "i": int, "u": int, "f": float, "U": str}
        make = makes.get(value.dtype.kind)
        return value if make is None else make(value)
    if is_a(value, int):
        return value if type(value) is bool else int.__int__(value)
    if is_a(value, float):
        return float.__float__(value)
    return str.__str__(value) if is_a(value, str) else value


def refuse(name: str, wanted: str, value: object) -> NoReturn:
    """Raise TypeError for an argument of the wrong kind."""
    raise TypeError(f"{name}: must be {wanted} (got {short(value)})")


def is_a(value: object, *kinds: type) -> bool:
    """Return whether a value has one of the types, ignoring what it claims about its class."""
    return issubclass(type(value), kinds)


def _is_single(value: Any) -> bool:
    return is_a(value, np.ndarray) and value.shape == ()


def error_text(error: BaseException) -> str:
    """Return type and text of an exception raised by a user's code."""
    try:
        return f"{type(error).__name__}: {error}"
    except Exception:
        return type(error).__name__
