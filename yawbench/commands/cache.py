"""`yawbench cache`: show, verify or clear the cache."""

from __future__ import annotations

import contextlib
import os
import sys
from typing import Annotated, Literal

import typer

CacheAction = Annotated[
    Literal["show", "clear"],
    typer.Argument(help="show: list contents and sizes; clear: delete everything."),
]


def cache(action: CacheAction = "show") -> None:
    """Show or clear the cache.

    Unpacked FMUs, compiled libraries, keys of sources, and FMUs whose own folder cannot be
    written. Deleted entries are made again when needed.
    Nothing is deleted while another command uses the cache.
    """
    from yawbench.fmus.archive import kept_in, size_of
    from yawbench.foundation.cache import alone_in, cache_folders, remove

    in_use = False
    for folder in cache_folders():
        if not os.access(folder, os.R_OK | os.X_OK):
            continue
        print(folder)
        clears = action == "clear"
        with alone_in(folder) if clears else contextlib.nullcontext(True) as alone:
            for kind, entries in kept_in(folder).items():
                size = sum(map(size_of, entries))
                for entry in entries if clears and alone else ():
                    remove(entry)
                also = f", {len(entries)} {'deleted' if alone else 'kept'}" if clears else ""
                print(f"  {kind}: {len(entries)}, {size / 1e6:.1f} MB{also}")
                in_use = in_use or not alone
        if not alone:
            print(f"{folder}: in use by another command, nothing was deleted", file=sys.stderr)
    if in_use:
        raise typer.Exit(1)
