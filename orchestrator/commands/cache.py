"""`yawbench cache`: what is kept to save time."""

from __future__ import annotations

import contextlib
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
    written. All of it is made again when it is needed. Nothing is deleted while another command uses it.
    """
    from ..cache import alone_in, cache_folders
    from ..fmu.kept import kept_in, remove

    damaged, in_use = 0, False
    for folder in cache_folders():
        if not os.access(folder, os.R_OK | os.X_OK):
            continue
        print(folder)
        with contextlib.nullcontext(True) if action == "show" else alone_in(folder) as alone:
            for kind, entries in kept_in(folder).items():
                size = sum(entry.size for entry in entries)
                unwanted = [
                    one for one in entries if action == "clear" or (action == "verify" and not one.whole())
                ]
                for entry in unwanted if alone else ():
                    remove(entry.path)
                damaged += len(unwanted)
                also = f", {len(unwanted)} {'deleted' if alone else 'kept'}" if unwanted else ""
                print(f"  {kind}: {len(entries)}, {size / 1e6:.1f} MB{also}")
                if unwanted and not alone:
                    in_use = True
        if not alone:
            print(f"{folder}: another command uses it, so nothing was deleted", file=sys.stderr)
    if action == "verify":
        print(f"damaged: {damaged}" if damaged else "everything is whole", file=sys.stderr)
    if in_use:
        raise typer.Exit(1)
