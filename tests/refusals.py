"""What tests ask of messages: codes, places, numbers and the names of things, never the wording.

with refused(Kind, "some-code", names=("a.yaml:3", "'mas'")):   an error of this code that names these
assert told(found, "some-code | a.yaml:3: units | 'mas' | 5 m")  diagnostics, each with code, place and names
assert mentions(text, "'mas'", "0.5 s")                         a line of the text names all of these
assert each_mentions(texts, ("plant",), ("tyre", "5 m"))        so many texts, or lines, each with its names
"""

from __future__ import annotations

import contextlib
import re
from collections.abc import Collection, Iterable, Iterator
from typing import Any

import pytest

from yawbench.foundation.errors import Diagnostic


def texts_of(told: Any) -> tuple[str, ...]:
    """Return the texts of the diagnostics of a plan, a run or an error."""
    return tuple(map(str, told.diagnostics))


def places_of(told: Iterable[Diagnostic]) -> list[tuple[str, str]]:
    """Return the code and the location of each diagnostic."""
    return [(one.code, str(one.location)) for one in told]


def told(found: Collection[Diagnostic], lines: str) -> bool:
    """Assert that there are as many diagnostics as lines, which say of each: `code | place | name | name`."""
    expected = [line.split(" | ") for line in lines.splitlines()]
    assert places_of(found) == [(code, place) for code, place, *_ in expected]
    return each_mentions(found, *(tuple(names) for _, _, *names in expected))


def mentions(text: object, *names: object) -> bool:
    """Assert that one line of a text, or of several texts, names all of these things."""
    several = isinstance(text, Iterable) and not isinstance(text, str)
    lines = [line for one in (text if several else [text]) for line in str(one).splitlines()]
    assert any(_named(line, names) for line in lines), f"no line names {names}:\n" + "\n".join(lines)
    return True


def each_mentions(texts: object, *names: tuple[object, ...]) -> bool:
    """Assert that there are as many texts, or lines of one, as groups of names, each with its names."""
    several = isinstance(texts, Iterable) and not isinstance(texts, str)
    told = list(map(str, texts)) if several else str(texts).splitlines()
    assert len(told) == len(names), f"{len(told)} texts, not {len(names)}:\n" + "\n".join(told)
    for one, group in zip(told, names, strict=True):
        assert _named(one, group), f"{[name for name in group if not _named(one, (name,))]} not in: {one}"
    return True


def sentence_has(page: str, *names: object) -> bool:
    """Assert that one sentence of a page names all of these things, however it is worded."""
    return mentions(re.split(r"(?<=[.!?]) (?=[A-Z`*(\[-])|(?<=[|]) ", " ".join(page.split())), *names)


def _named(text: str, names: Iterable[object]) -> bool:
    """Whether a text holds all names, none of them as a part of a longer word or number."""
    return all(
        re.search(rf"(?<![\w.:/-]){re.escape(n)}(?!\w|\.\d)" if n[:1].isdigit() else _whole(n), text)
        for n in map(str, names)
    )


def _whole(name: str) -> str:
    """Return the pattern of a name that is no part of a longer word."""
    before, after = (r"(?<!\w)" if name[:1].isalnum() else ""), (r"(?!\w)" if name[-1:].isalnum() else "")
    return before + re.escape(name) + after


@contextlib.contextmanager
def refused(
    kind: type[BaseException], *codes: str, names: Iterable[object] = ()
) -> Iterator[pytest.ExceptionInfo[Any]]:
    """Expect an error with one of these codes, of which a line names all of these things."""
    with pytest.raises(kind) as caught:
        yield caught
    if codes:
        assert caught.value.code in codes
    assert mentions(caught.value, *names)
