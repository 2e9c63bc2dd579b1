"""`yawbench cache`: what is kept to save time."""

from __future__ import annotations

import os
import sys
from typing import Annotated, Literal

import typer

Action = Literal["show", "verify", "clear"]
What = Annotated[
    Action,
    typer.Argument(
        help="show: what there is, and how large; verify: look at every byte, and delete what is damaged; "
        "clear: delete everything.",
    ),
]


def cache(action: What = "show") -> None:
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
            deleted = [
                one for one in entries if action == "clear" or (action == "verify" and not one.whole())
            ]
            for entry in deleted:
                remove(entry.path)
            damaged += len(deleted)
            also = f", {len(deleted)} deleted" if deleted else ""
            print(f"  {kind}: {len(entries)}, {size / 1e6:.1f} MB{also}")
    if action == "verify":
        print(f"damaged: {damaged}" if damaged else "everything is whole", file=sys.stderr)
