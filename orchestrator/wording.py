"""What error messages say about a wrong name: the likely one, or all that are allowed."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Sequence

WHEELS = ("fl", "fr", "rl", "rr")


def listed(items: Iterable[object], *, last: str = "and") -> str:
    """Return 'a, b and c'."""
    words = [str(item) for item in items]
    if len(words) < 2:
        return "".join(words)
    return f"{', '.join(words[:-1])} {last} {words[-1]}"


def closest(name: str, valid: Iterable[str]) -> str | None:
    """Return the valid name most like `name`, or None if none is like it."""
    by_lower = {v.lower(): v for v in valid}
    found = difflib.get_close_matches(name.lower(), by_lower, n=1, cutoff=0.7)
    return by_lower[found[0]] if found else None


def hint(name: str, valid: Iterable[str], *, lead: str) -> str:
    """Return "; did you mean 'x'?", or if nothing is alike "; <lead>: a, b and c"."""
    names = list(valid)
    likely = closest(name, names)
    if likely is not None:
        return f"; did you mean {likely!r}?"
    return f"; {lead}: {listed(names) or 'none'}"


def fold(names: Sequence[str]) -> list[str]:
    """Return the names with every complete group of four wheels folded to one with `*`."""
    present = set(names)
    folded: dict[str, None] = {}
    for name in names:
        stem = name[:-2]
        per_wheel = name[-2:] in WHEELS and stem.endswith("_")
        whole = per_wheel and all(stem + wheel in present for wheel in WHEELS)
        folded[stem + "*" if whole else name] = None
    return list(folded)
