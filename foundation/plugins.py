"""Plug-ins: commands, kinds of files and more that packages add to the program, imported when they are used.

A package says what it adds in its `__init__.py`, which imports nothing for it:

    PLUGINS = {"command": {"rank": "yawbench.ranking.command:rank"}}

The packages of the program are listed in `yawbench.parts`. An installed package of somebody else names itself
as an entry point:

    [project.entry-points."yawbench.plugins"]
    mine = "my_package"
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cache
from importlib import import_module
from typing import Any

from .errors import ScenarioError

PARTS = "yawbench.parts"
"""Module that lists the packages of the program, read by name: the foundation imports none of them."""
GROUP = "yawbench.plugins"
"""Group of entry points of packages of others."""

Table = Mapping[str, Mapping[str, str]]
"""Kind -> name -> module and attribute, "module:attribute"."""


def find(kind: str, name: str) -> Any:
    """Return what a package adds under a name; None if no package does."""
    where = place(kind, name)
    return _imported(where) if where else None


def require(kind: str, name: str) -> Any:
    """Return what a package adds under a name.

    Raises:
        ScenarioError: no package does.
    """
    if not (where := place(kind, name)):
        raise ScenarioError(
            f"{name}: the part of yawbench that makes this ({kind}) is not installed", code="part-missing"
        )
    return _imported(where)


def names(kind: str) -> list[str]:
    """Return the names under which packages add something of a kind, those of the program first."""
    return [*dict.fromkeys(name for table in (_ours, _of_others) for name in table().get(kind, {}))]


def place(kind: str, name: str) -> str:
    """Return the module and attribute under a name, without importing them; "" if no package adds it."""
    places = (table().get(kind, {}).get(name, "") for table in (_ours, _of_others))
    return next(filter(None, places), "")


def _imported(place: str) -> Any:
    module, _, attribute = place.partition(":")
    loaded = import_module(module)
    return getattr(loaded, attribute) if attribute else loaded


@cache
def _ours() -> Table:
    return _merged(import_module(PARTS).PARTS)


@cache
def _of_others() -> Table:
    from importlib.metadata import entry_points  # slow to import

    return _merged(entry.value for entry in entry_points(group=GROUP))


def _merged(packages: Iterator[str] | tuple[str, ...]) -> Table:
    table: dict[str, dict[str, str]] = {}
    for package in packages:
        plugins: Table = getattr(import_module(package), "PLUGINS", {})
        for kind, added in plugins.items():
            table.setdefault(kind, {}).update(added)
    return table
