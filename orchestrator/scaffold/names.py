"""What a unit of one's own may be called."""

from __future__ import annotations

import keyword
import re
from collections.abc import Iterable

from ..errors import ScenarioError


def check_name(name: str, *, role: str, taken: Iterable[str]) -> None:
    """Raise ScenarioError with one sentence if `name` cannot be that of a unit.

    Args:
        name: of the file, without the role in front.
        role: of the unit, such as "controller".
        taken: names of the FMUs that there are.
    """
    if name.startswith(f"{role}_") and name != f"{role}_":
        raise ScenarioError(
            f"{name!r}: leave out {role!r}, the FMU gets it by itself: {_plain(name, role)!r}"
        )
    if not re.fullmatch(r"[a-z][a-z0-9_]{0,49}", name) or keyword.iskeyword(name):
        suggestion = _plain(name, role)
        usable = re.fullmatch(r"[a-z][a-z0-9_]{0,49}", suggestion) and not keyword.iskeyword(suggestion)
        guess = f"; for example {suggestion!r}" if usable else ""
        raise ScenarioError(
            f"{name!r} cannot name a {role}: use up to 50 lower-case letters, digits and _, "
            f"a letter first, no word of Python{guess}"
        )
    if f"{role}_{name}" in taken:
        raise ScenarioError(
            f"there is a {role} {name!r} already; nothing is overwritten, choose another name"
        )


def _plain(name: str, role: str) -> str:
    """Return what a name could have meant: MyIdea-2 -> my_idea_2."""
    words = re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", name)
    return re.sub(r"[^a-z0-9]+", "_", words.lower()).strip("_").removeprefix(f"{role}_")


def class_name(name: str) -> str:
    """Return the name of a class: my_idea -> MyIdea."""
    return "".join(part.capitalize() for part in name.split("_"))


def title(name: str) -> str:
    """Return a name as words: my_idea -> My idea."""
    return name.replace("_", " ").strip().capitalize()
