"""`yawbench cache`: what is kept to save time."""

from __future__ import annotations

import os
import sys
from enum import Enum
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from ..fmu.kept import Entry


class Action(str, Enum):
    """What to do with the cache."""

    show = "show"
    verify = "verify"
    clear = "clear"


What = Annotated[
    Action,
    typer.Argument(
        help="show: what there is, and how large; verify: look at every byte, and delete what is damaged; "
        "clear: delete everything.",
    ),
]


def cache(action: What = Action.show) -> None:
    """Show, verify or clear the cache.

    Unpacked FMUs, the compiled launcher, keys of sources, and FMUs whose own folder cannot be
    written. All of it is made again when it is needed. A run in progress may miss what is cleared.
    """
    from ..cache import cache_folders
    from ..fmu.kept import kept_in, remove

    damaged = 0
    for folder in cache_folders():
        if not os.access(folder, os.R_OK | os.X_OK):
            continue
        print(folder)
        for kind, entries in kept_in(folder).items():
            size = sum(entry.size for entry in entries)
            deleted = [entry for entry in entries if _is_to_go(entry, action)]
            for entry in deleted:
                remove(entry.path)
            damaged += len(deleted)
            print(
                f"  {kind}: {len(entries)}, {size / 1e6:.1f} MB" + f", {len(deleted)} deleted" * bool(deleted)
            )
    if action is Action.verify:
        print(f"damaged: {damaged}" if damaged else "everything is whole", file=sys.stderr)


def _is_to_go(entry: Entry, action: Action) -> bool:
    return action is Action.clear or (action is Action.verify and not entry.whole())
