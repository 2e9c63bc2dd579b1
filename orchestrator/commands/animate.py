"""`yawbench animate`: one or two runs seen from above, as a page that needs no server."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated

import typer

Folders = Annotated[
    list[Path],
    typer.Argument(help="Folders of results: one, or two laid over each other.", metavar="RUN"),
]
Labels = Annotated[
    list[str] | None,
    typer.Option("--label", metavar="TEXT", help="Name of a run in the legend, in the order of RUN."),
]
Page = Annotated[Path | None, typer.Option("--out", metavar="FILE.html", help="The page to write.")]


def animate(folders: Folders, label: Labels = None, out: Page = None) -> None:
    """Write a page that plays one or two runs seen from above.

    Cars, paths, lanes, steer angles, tyre forces and their friction circles. Without --out, the
    page of one run is animation.html in its folder; that of two lies in the folder that holds them
    both.
    """
    from ..errors import ResultsError, ScenarioError
    from ..pages.animation import MOST, page
    from ..results.read import load_results
    from ..titles import changed_each, changes_in
    from ..writing import write_whole
    from .batch import say
    from .plot import distinct

    if len(folders) > MOST:
        raise ScenarioError(f"an animation shows one or two runs, not {len(folders)}")
    if label and len(label) != len(folders):
        raise ScenarioError(f"--label: needs one for each run ({len(label)} for {len(folders)} given)")
    runs = list(zip(label or distinct(folders), map(load_results, folders), strict=True))
    titles = [str(results.run.get("title") or name) for name, results in runs]
    changed = changed_each([(name, changes_in(results.run)) for name, results in runs])
    if len(runs) == 1:
        text = page(runs, title=titles[0], changed=changed)
    else:
        text = page(runs, below="; ".join(dict.fromkeys(titles)), changed=changed)
    target = folders[0]
    if len(folders) > 1:
        target = Path(os.path.commonpath([folder.absolute().parent for folder in folders]))
    file = out or target / "animation.html"
    try:
        write_whole(file, text)
    except OSError as error:
        raise ResultsError(f"{file}: the page cannot be written: {error.strerror or error}.") from None
    say(f"{file}: {len(text.encode()) / 1000:.0f} kB")
