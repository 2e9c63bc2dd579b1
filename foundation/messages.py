"""Building blocks of messages: lists, shortened text, ranges of numbers, "did you mean", merged wheels."""

from __future__ import annotations

import difflib
import math
import re
from collections.abc import Callable, Hashable, Iterable, Sequence
from itertools import pairwise
from typing import TypeVar

from yawbench.vocabulary.wheels import WHEELS

_WHEEL_SUFFIX = re.compile(rf"_({'|'.join(WHEELS)})(?=_true\b|\b)")
"""The wheel in a name, also in that of a sensor's true value (`wheel_speed_fl_true`)."""

_ENDS = tuple(f"_{wheel}" for wheel in WHEELS)

K = TypeVar("K")
T = TypeVar("T", bound=Hashable)

LISTED = 100
"""Maximum number of names in a list. Chosen: more than any of our FMUs has parameters."""
ALIKE = 500
"""Names compared with a wrong name; of more, those with the same beginning. Chosen: 20 ms."""
MANY, NEAREST = 30, 8
"""Names beyond which a hint lists the nearest alone, and how many. Chosen: three lines of a terminal, one."""


def listed(items: Iterable[object], *, last: str = "and") -> str:
    """Return 'a, b and c'; for long lists the first items, 'a, b, c and 900 more'."""
    words = [str(item) for item in items]
    if len(words) > LISTED:
        words[LISTED - 1 :] = [f"{len(words) - LISTED + 1} more"]
    if len(words) < 2:
        return "".join(words)
    return f"{', '.join(words[:-1])} {last} {words[-1]}"


def in_text(title: str) -> str:
    """Return a title as part of a sentence: in quotes if it has a comma of its own."""
    return f"“{title}”" if "," in title else title


def short(value: object) -> str:
    """Return a value for use in a message: its repr in one line, shortened, or its type if repr fails."""
    if value is None:
        return "nothing"
    try:
        text = repr(value)
    except Exception:  # a number of 5000 digits, or a user's class with a faulty __repr__
        return f"an object of {type(value).__name__}"
    return cut(printable(" ".join(text.splitlines())), 60)


def cut(text: str, longest: int = 200) -> str:
    """Return a text, truncated to `longest` characters."""
    return text if len(text) <= longest else text[: longest - 3] + "..."


_UNPRINTABLE = re.compile(
    "[\x00-\x08\x0b-\x1f\x7f-\x9f"  # control characters except tab and line feed
    "\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069\ufeff"  # bidirectional controls, invisible characters
    "\ufffe\uffff"  # not allowed in XML
    "\ud800-\udfff]"  # lone surrogates
)


def unprintable(text: str) -> str | None:
    """Return the first unprintable character of a text as its escape sequence, None if there is none."""
    match = _UNPRINTABLE.search(text)
    return ascii(match[0])[1:-1] if match else None


def printable(text: str) -> str:
    """Return a text with unprintable characters replaced by escape sequences, as `\\x1b`."""
    return _UNPRINTABLE.sub(lambda match: ascii(match[0])[1:-1], text)


def closest(name: str, valid: Iterable[str]) -> str | None:
    """Return the valid name most similar to `name`, or None if none is similar."""
    by_lower = {v.lower(): v for v in valid}
    if len(by_lower) > ALIKE:
        begins = name[:3].lower()
        alike = [lower for lower in by_lower if lower.startswith(begins)]
        by_lower = {lower: by_lower[lower] for lower in alike[:ALIKE]}
    matches = difflib.get_close_matches(name.lower(), by_lower, n=1, cutoff=0.65)
    if matches:
        return by_lower[matches[0]]
    ending = [known for low, known in by_lower.items() if re.search(rf"[._/]{re.escape(name.lower())}$", low)]
    return ending[0] if len(ending) == 1 else None  # `pid` of `controller_pid`


def hint(name: str, valid: Iterable[str], *, lead: str) -> str:
    """Return "; did you mean 'x'?", or if no name is similar, "; <lead>: a, b and c"."""
    names = list(valid)
    likely = closest(name, names)
    if likely is not None:
        return f"; did you mean {likely!r}?"
    if len(names) > MANY:
        near = difflib.get_close_matches(name, names[:ALIKE], n=NEAREST, cutoff=0.0)
        return f"; {lead} {len(names)}, such as {listed(sorted(near))}"
    return f"; {lead}: {listed(names) or 'none'}"


def counted(number: int, noun: str, several: str = "") -> str:
    """Return "1 run", "2 runs"; `several`: a plural that is not formed with s."""
    return f"{number} {noun if number == 1 else several or f'{noun}s'}"


def in_bytes(size: float) -> str:
    """Return a number of bytes in words: "1.5 GB", "20 MB", "3 kB"."""
    if size >= 1e9:
        return f"{size / 1e9:.1f} GB"
    return f"{size / 1e6:.0f} MB" if size >= 1e6 else f"{size / 1e3:.0f} kB"


RESOLVED, FINEST = 3, 6
"""Digits after the first one of the distance of numbers in a range, and of the smallest of them up to so many
decimals. Chosen: both read as exact to a thousandth, and no rounding is shown."""
EXACT = 1e15
"""Size beyond which numbers have no decimals as double precision."""


def span(begin: float, end: float, digits: int = 0) -> str:
    """Return "3 to 5.5": two numbers with so many decimals that they read differently.

    Args:
        begin, end: the numbers.
        digits: significant digits, where these are enough.

    >>> span(3.0, 5.5), span(1.7e9 + 3.0, 1.7e9 + 5.5), span(0.0, 1e-5)
    ('3 to 5.5', '1700000003 to 1700000005.5', '0 to 0.00001')
    >>> span(1050.25, 1261.5, 3), span(1050.25, 1051.5, 3)
    ('1.05e+03 to 1.26e+03', '1050.25 to 1051.5')
    """
    first, last = (f"{number:.{digits}g}" for number in (begin, end)) if digits else ("", "")
    return f"{first} to {last}" if first != last else " to ".join(resolved(begin, end))


def resolved(*numbers: float) -> list[str]:
    """Return numbers as text, with the decimals that tell them apart.

    >>> resolved(0.2, 1.7e9 + 0.3), resolved(5.0, 5.0)
    (['0.2', '1700000000.3'], ['5', '5'])
    """
    ordered = sorted(set(numbers))
    distances = [b - a for a, b in pairwise(ordered)]
    sizes = [abs(number) for number in ordered if number]
    if not math.isfinite(sum(numbers)) or max(sizes, default=0.0) >= EXACT:
        return [f"{number:.16g}" for number in numbers]
    decimals = max(_decimals(distances), min(FINEST, _decimals(sizes)))
    texts = [f"{round(number, decimals) + 0.0:.{decimals}f}" for number in numbers]
    return [text.rstrip("0").rstrip(".") if decimals else text for text in texts]


def _decimals(sizes: Sequence[float]) -> int:
    """Return the decimals that show the smallest of some sizes to a thousandth; 0 without any."""
    return min(17, max(0, RESOLVED - math.floor(math.log10(min(sizes))))) if sizes else 0


def fold(names: Sequence[str]) -> list[str]:
    """Return the names with every complete group of four wheels replaced by one name with `*`."""
    return _fold(names, lambda name: f"{name[:-2]}*" if name.endswith(_ENDS) else name)


def star(text: str) -> str:
    """Return the text with the wheel at the end of every name replaced by `*`."""
    return _WHEEL_SUFFIX.sub("_*", text)


def fold_sentences(items: Sequence[tuple[K, str]]) -> list[tuple[K, str]]:
    """Return (key, sentence) pairs with sentences that are the same for all four wheels merged into one."""
    return _fold(items, lambda item: (item[0], star(item[1])))


def fold_wires(pairs: Sequence[tuple[str, str]]) -> list[tuple[str, str]]:
    """Return (output, input) pairs with those of the four wheels merged into one with `*`."""
    from_one = _fold(pairs, lambda pair: (pair[0], star(pair[1])))
    return _fold(from_one, lambda pair: (star(pair[0]), star(pair[1])))


def _fold(items: Sequence[T], starred: Callable[[T], T]) -> list[T]:
    """Return the items once each; those that are the same for all four wheels, `starred`, become one."""
    alike: dict[T, set[T]] = {}
    for item in items:
        alike.setdefault(starred(item), set()).add(item)
    whole = {item for item, group in alike.items() if len(group) == len(WHEELS)}
    return [*dict.fromkeys(starred(item) if starred(item) in whole else item for item in items)]
