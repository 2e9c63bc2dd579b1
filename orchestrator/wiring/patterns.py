"""Which names a pattern with a `*` means."""

from __future__ import annotations

from collections.abc import Collection


def match(pattern: str, name: str) -> str | None:
    """Return what the `*` of a pattern stands for in a name, '' without `*`, None if they differ."""
    head, star, tail = pattern.partition("*")
    if not star:
        return "" if name == pattern else None
    fits = len(name) >= len(head) + len(tail) and name.startswith(head) and name.endswith(tail)
    return name[len(head) : len(name) - len(tail)] if fits else None


def matching(pattern: str, names: Collection[str]) -> dict[str, str]:
    """Return the names that fit a pattern, each under what the `*` stands for in it."""
    if "*" not in pattern:
        return {"": pattern} if pattern in names else {}
    return {part: name for name in names if (part := match(pattern, name)) is not None}
